// OutputFile: a file that appears under its name when it is complete, and never before.
//
// Bytes go into a new file in the same folder, and commit() renames it. So the old file stays whole until then,
// whatever happens: an error, a full disk, a killed process. A name that is a link stands for the file it leads to. A
// device or a pipe is written as the bytes come. Invariant: after the first error nothing more is written, and commit()
// reports it. An object that is destroyed without a commit() removes what it wrote. Threading: one thread an object.
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
    /// Fails if nothing can be written there, or if there is a file that is to be kept.
    static Result<OutputFile> create(const std::filesystem::path& file, Existing existing = Existing::replace);
    OutputFile(OutputFile&& other) noexcept;
    OutputFile& operator=(OutputFile&& other) noexcept;
    ~OutputFile();

    Result<> write(std::span<const std::byte> bytes);
    Result<> write(std::string_view text) { return write(std::as_bytes(std::span(text))); }
    /// For libraries that write by themselves; they must not close it.
    int descriptor() const { return descriptor_; }

    /// Closes the file and gives it its name. Errors: the first one of write(), or that of this step.
    Result<> commit();

  private:
    OutputFile() = default;
    Result<> failure(int error);
    void discard();

    std::filesystem::path file_, target_, fresh_;  // as named; what it leads to; where it is until commit()
    int descriptor_ = -1, error_ = 0;
    Existing existing_ = Existing::replace;
};

/// All at once.
Result<> writeWholeFile(const std::filesystem::path& file, std::span<const std::byte> bytes,
                        Existing existing = Existing::replace);

/// Whether two names lead to one file, through whatever links; if there is none yet, whether they would.
bool sameFile(const std::filesystem::path& a, const std::filesystem::path& b);

/// A name under which the file can be written before it is renamed to `file`: in the same folder, unused so far, with
/// the same extension. Follows links.
std::filesystem::path freshNameBeside(const std::filesystem::path& file);

}  // namespace rtsg
