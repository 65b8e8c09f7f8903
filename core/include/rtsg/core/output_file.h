// OutputFile: a file that gets its name only when it is complete.
//
// Bytes go into a new file in the same folder, which commit() renames. So an old file stays whole until then, whatever
// happens: an error, a full disk, a killed process. A symbolic link stands for the file it leads to. Bytes for a device
// or a pipe are written at once. Invariant: after the first error nothing more is written, and commit() reports it. An
// object that is destroyed without commit() removes its new file. Threading: one thread for each object.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// Says what happens to a file that exists already.
enum class Existing : bool { keep, replace };

class OutputFile {
  public:
    /// Errors: nothing can be written there; the file exists and is to be kept.
    static Result<OutputFile> create(const std::filesystem::path& file, Existing existing = Existing::replace);
    OutputFile(OutputFile&& other) noexcept;
    OutputFile& operator=(OutputFile&& other) noexcept;
    ~OutputFile();

    Result<> write(std::span<const std::byte> bytes);
    Result<> write(std::string_view text) { return write(std::as_bytes(std::span(text))); }
    /// For libraries that write to the file themselves; they must not close it.
    int descriptor() const { return descriptor_; }

    /// Closes the file and gives it its name. Errors: the first one of write(), or that of this step.
    Result<> commit();

  private:
    OutputFile() = default;
    Result<> failure(int error);
    void discard();

    std::filesystem::path file_, target_, fresh_;  // the name that was given; the file it leads to; the file until
                                                   // commit()
    int descriptor_ = -1, error_ = 0;
    Existing existing_ = Existing::replace;
};

/// Writes a whole file.
Result<> writeWholeFile(const std::filesystem::path& file, std::span<const std::byte> bytes,
                        Existing existing = Existing::replace);

/// Whether two names lead to one file, through any links; if there is no file yet, whether they would.
bool sameFile(const std::filesystem::path& a, const std::filesystem::path& b);

/// An unused name for writing a file that is then renamed to `file`: in the same folder, with the same extension. It
/// follows links.
std::filesystem::path freshNameBeside(const std::filesystem::path& file);

}  // namespace rtsg
