// Dialect: formats of files and node types that an application adds to those of this library.
//
// Invariant: later additions are asked first, and all of them before the library's own formats, which have the same
// interface; built-in node types cannot be replaced. Threading: fill it before it is shared; from then on it is
// constant, and its functions are called on the thread that reads or writes. Source: RTSG paper 3.1 (readers and
// writers are added without modifying the core library).

// Example:
//     #include <rtsg/documents/dialect.h>
//     #include <rtsg/documents/loader.h>
//     // Files that begin with "BOX" are a box.
//     rtsg::FormatReader boxes;
//     boxes.name = "BOX";
//     boxes.recognises = [](const rtsg::FormatClue& clue) { return clue.head.starts_with("BOX"); };
//     boxes.read = [](rtsg::FormatSource&, rtsg::DocumentHandler& handler, rtsg::Diagnostics&) {
//         handler.beginDocument({});
//         handler.beginNode("Shape", {}, {}, {});
//         handler.beginNode("Box", {}, "geometry", {});
//         handler.endNode({});
//         handler.endNode({});
//         handler.endDocument();
//         return true;
//     };
//     auto dialect = std::make_shared<rtsg::Dialect>();
//     dialect->add(boxes);
//     rtsg::Scene scene;
//     rtsg::registerDocuments(scene, dialect);  // its files, Inlines and pieces may be boxes now
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/documents/document_handler.h>

namespace rtsg {

/// Receives the pieces of a file that is written, in order.
using TextSink = std::function<void(std::string_view)>;

/// What is known of a file before it is read; recognises() decides by it.
struct FormatClue {
    std::string_view name;   // of the file, without a .gz at its end; empty for text in memory and standard input
    std::string_view head;   // the first bytes, unpacked: 4096, or all if there are fewer
    std::uint64_t size = 0;  // of the whole file, unpacked; 0 if unknown
};

/// A file that is being read.
class FormatSource {
  public:
    virtual ~FormatSource() = default;
    virtual std::string_view name() const = 0;  // as in FormatClue
    /// The whole file, unpacked; valid as long as the source.
    virtual std::string_view bytes() = 0;
    /// Reads another file, relative to this one. Errors: those of the scene's resource policy.
    virtual Result<std::string> beside(std::string_view url) const = 0;
    /// The animation to play, for files that have several; empty: the first.
    virtual std::string_view clip() const = 0;
    /// How many bytes of memory the content may take.
    virtual std::uint64_t maximumBytes() const = 0;
};

struct FormatReader {
    std::string name;  // for messages, such as "STL"
    /// Whether a file is of this format; the first reader that returns true reads it.
    std::function<bool(const FormatClue& clue)> recognises;
    /// Pushes the document. Returns false if the file was so broken that reading stopped early. Commands that do not
    /// nest, fields that a type does not have, values of another type than the field's and numbers that are not finite
    /// are reported as errors of the format and left out. An exception ends the file.
    std::function<bool(FormatSource& source, DocumentHandler& handler, Diagnostics& diagnostics)> read;
    bool isText = false;    // bytes that are not UTF-8 are passed as U+FFFD, and reported
    bool hasClips = false;  // it uses FormatSource::clip()
};

struct FormatWriter {
    std::string name;
    std::vector<std::string> extensions;  // of files' names, such as ".dot"; the same with .gz is written with gzip
    /// Makes a handler that writes the commands it receives; the document is complete after endDocument. If it throws,
    /// no file is made.
    std::function<std::unique_ptr<DocumentHandler>(TextSink sink, Diagnostics& diagnostics)> make;
};

class Dialect {
  public:
    /// Precondition, checked: both functions of the reader are set.
    void add(FormatReader reader);
    void add(FormatWriter writer);
    /// Adding the same type again is no error. Errors: a built-in type has the name; another type with the name has
    /// other fields.
    Result<> add(std::shared_ptr<const NodeType> type);

    const std::vector<FormatReader>& readers() const { return readers_; }
    const std::vector<FormatWriter>& writers() const { return writers_; }
    const std::vector<std::shared_ptr<const NodeType>>& nodeTypes() const { return types_; }

    /// The first added reader that recognises the file; null if there is none. A reader that throws does not count.
    const FormatReader* readerOf(const FormatClue& clue) const;
    /// `extension` is, for example, ".dot".
    const FormatWriter* writerOf(std::string_view extension) const;
    std::shared_ptr<const NodeType> findType(std::string_view name) const;

  private:
    std::vector<FormatReader> readers_;
    std::vector<FormatWriter> writers_;
    std::vector<std::shared_ptr<const NodeType>> types_;
};

}  // namespace rtsg
