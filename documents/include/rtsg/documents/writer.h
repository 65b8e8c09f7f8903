// Writers: document handlers that print the commands they get as X3D XML, ClassicVRML, VRML97 or JSON.
//
// Invariant: reading the result gives the same commands, except for their order within a node where the encoding
// requires one (XML attributes come first), explicit NULLs, and names that an encoding cannot spell (these are changed
// and reported). Comments stay where they are between nodes and fields; in XML two hyphens in a row get a space between
// them. Authors' remarks on declarations (appinfo, documentation) are kept in XML and JSON, and become comments
// elsewhere. Numbers are the shortest text that reads back to the same bits. Threading: one thread for each writer.
// Source: ISO/IEC 19776-1 V3.3 (XML), 19776-2 V3.3 (ClassicVRML), 14772-1:1997 (VRML97), 19776-5 draft (JSON).
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
/// are held back from the outermost open node on, since its attributes may still follow its children.
std::unique_ptr<DocumentHandler> makeWriter(Encoding encoding, TextSink sink, Diagnostics& diagnostics);

/// Finds the encoding by a file's name: .x3d, .x3dv, .wrl or .json, each also with z or .gz at its end for gzip. False
/// for other names.
bool encodingFromName(const std::filesystem::path& file, Encoding& encoding, bool& gzip);
/// Checks that a file of this name can be written. The error lists the names that can be.
Result<> checkDocumentName(const std::filesystem::path& file, const Dialect* dialect = nullptr);

/// Writes a document into a file, with gzip if its name says so; "-" is standard output, in the encoding
/// `ofStandardOutput`. The file gets its name at close(); without close() there is no file. The formats of a dialect
/// come before the library's own, and an exception of one ends the file.
class DocumentFileWriter {
  public:
    static Result<std::unique_ptr<DocumentFileWriter>> create(const std::filesystem::path& file,
                                                              Diagnostics& diagnostics,
                                                              Existing existing = Existing::replace,
                                                              Encoding ofStandardOutput = Encoding::classicVrml,
                                                              std::shared_ptr<const Dialect> dialect = {});
    ~DocumentFileWriter();
    DocumentHandler& handler() { return *writer_; }
    /// Call it after endDocument: flushes, and reports errors such as a full disk.
    Result<> close();

  private:
    DocumentFileWriter() = default;
    struct File;
    std::unique_ptr<File> file_;
    std::unique_ptr<DocumentHandler> writer_;
};

}  // namespace rtsg
