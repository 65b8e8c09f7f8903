// Reads a document of any encoding, plain or gzip, as a stream of commands to a handler.
//
// Threading: one thread, which may use others for long lists. Bad input never throws; the diagnostics have it, with
// positions. Reading ends when the process reaches its memory limit (machine.h). Source: RTSG paper 3.1.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include <rtsg/documents/dialect.h>
#include <rtsg/documents/document_handler.h>

namespace rtsg {

class Resources;

/// Called with the bytes read and the total; for progress bars.
using Progress = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Detects the encoding from the content (after gunzip), never from the name alone.
Encoding detectEncoding(std::string_view head);

struct ReadOptions {
    Progress progress{};
    /// The number of threads that read a list of numbers of more than 4 MiB of text: 0 means one for each core; 8 at
    /// most are used. The result is the same for any number. The handler, the diagnostics and the progress function are
    /// called on the caller's thread only.
    unsigned threads = 0;
    bool headerless = false;  // ClassicVRML may lack its header line
    /// The limit for text whose size is unknown: a packed file, a pipe. A value other than the default also limits the
    /// memory that the process takes while it reads.
    std::uint64_t maximumBytes = std::uint64_t{4} << 30;
    /// The animation to play of a file with several (glTF), by its author's name or its DEF; an error if there is none.
    /// Empty: the first.
    std::string clip{};
    /// Formats and node types beyond the library's own (dialect.h); null: none.
    std::shared_ptr<const Dialect> dialect{};
    /// With these, readDocumentFile() can open http and https addresses; without them it cannot.
    const Resources* resources = nullptr;
};

/// Parses one document, already in memory and unpacked, into commands. The view must stay valid during the call.
/// Returns false if the document was so broken that reading stopped early; what was read before has been pushed.
bool readDocument(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics,
                  const ReadOptions& options = {});
/// Same for a file or an address, plain or gzip; "-" is standard input.
bool readDocumentFile(const std::filesystem::path& file, DocumentHandler& handler, Diagnostics& diagnostics,
                      const ReadOptions& options = {});

}  // namespace rtsg
