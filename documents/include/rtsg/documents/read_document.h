// Reads a document of any encoding, plain or gzip, as a stream of commands to a handler.
//
// Threading: one thread, which may have others help it with long lists. Never throws for bad input: it is in the
// diagnostics, with positions. Reading ends where the process holds as much as it may (memory.h). Source: RTSG
// paper 3.1.
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

/// Reports bytes read of bytes in all; for progress bars.
using Progress = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Detects the encoding from the content (after gunzip), never from the name alone.
Encoding detectEncoding(std::string_view head);

struct ReadOptions {
    Progress progress{};
    /// The number of threads that read a list of numbers of more than 4 MiB of text: 0 means one for each core; 8 at
    /// most are used. The result is the same for any number. The handler, the diagnostics and the progress are called
    /// by the caller's thread alone.
    unsigned threads = 0;
    bool headerless = false;  // ClassicVRML may come without its header's line
    /// Of text that says nothing of its size: a packed file, a pipe. If it is another than this, also of the memory
    /// that the process takes while it reads.
    std::uint64_t maximumBytes = std::uint64_t{4} << 30;
    /// Of a file with several animations (glTF) the one that plays, by its author's name or its DEF; an error if there
    /// is none. Empty: the first.
    std::string clip{};
    /// Formats and node types beyond the library's own (dialect.h); null: none.
    std::shared_ptr<const Dialect> dialect{};
    /// readDocumentFile() opens an http or https address by these, and only with them.
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
