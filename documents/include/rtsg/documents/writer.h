// Writers: document handlers that print the commands they get as X3D XML, ClassicVRML, VRML97 or JSON.
//
// Invariant: reading what was written gives the same commands, apart from their order within a node where the encoding
// dictates one (XML attributes come first), explicit NULLs, and names that an encoding cannot spell (those are changed
// and reported). Comments are kept where they stand between nodes and fields; in XML two hyphens in a row get a space
// between them. Authors' remarks on declarations (appinfo, documentation) are kept in XML and JSON, and become comments
// elsewhere. Numbers are the shortest text that reads back to the same bits. Threading: one thread a writer. Source:
// ISO/IEC 19776-1 V3.3 (XML), 19776-2 V3.3 (ClassicVRML), 14772-1:1997 (VRML97), 19776-5 draft (JSON).
#pragma once

#include <filesystem>
#include <iosfwd>
#include <memory>
#include <string_view>

#include <rtsg/core/output_file.h>
#include <rtsg/documents/dialect.h>
#include <rtsg/documents/document_handler.h>

namespace rtsg {

TextSink streamSink(std::ostream& stream);

/// A writer for `encoding` (null for `binary`). Parts that cannot be written are reported to `diagnostics`, which must
/// outlive the writer. The document is complete after endDocument. ClassicVRML is passed on as it comes; XML and JSON
/// are held back from the outermost open node on, whose attributes may still follow its children.
std::unique_ptr<DocumentHandler> makeWriter(Encoding encoding, TextSink sink, Diagnostics& diagnostics);

/// Finds the encoding in a file's name: .x3d, .x3dv, .wrl or .json, each also with z or .gz at its end for gzip. False
/// if the name has no encoding that can be written.
bool encodingFromName(const std::filesystem::path& file, Encoding& encoding, bool& gzip);
/// Whether a file of this name can be written; else why not, with the names that can be.
Result<> checkDocumentName(const std::filesystem::path& file, const Dialect* dialect = nullptr);

/// Writes a document into a file, gzipped if its name says so; "-" is standard output, in the encoding that is given
/// for it. The file has its name from close() on; without that there is none. The formats of a dialect come before the
/// library's own, and an exception of one ends the file.
class DocumentFileWriter {
  public:
    static Result<std::unique_ptr<DocumentFileWriter>> create(const std::filesystem::path& file,
                                                              Diagnostics& diagnostics,
                                                              Existing existing = Existing::replace,
                                                              Encoding ofStandardOutput = Encoding::classicVrml,
                                                              std::shared_ptr<const Dialect> dialect = {});
    ~DocumentFileWriter();
    DocumentHandler& handler() { return *writer_; }
    /// After endDocument: flushes, and says whether everything arrived (a full disk, say).
    Result<> close();

  private:
    DocumentFileWriter() = default;
    struct File;
    std::unique_ptr<File> file_;
    std::unique_ptr<DocumentHandler> writer_;
};

}  // namespace rtsg
