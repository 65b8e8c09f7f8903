// Dialect: what documents may be, and may hold, beyond what this library brings: formats of files, and node types of a
// user's own tables.
//
// Invariant: what was added last is asked first, and all of it before the library's own formats, which are of the same
// kind; built-in node types cannot be replaced. Threading: fill it before it is shared; from then on it is constant,
// and its functions are called on the thread that reads or writes. Source: RTSG paper 3.1 (readers and writers are
// added without modifying the core library).

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

/// Takes the next piece of a file that is written, in order.
using TextSink = std::function<void(std::string_view)>;

/// What is known of a file before it is read.
struct FormatClue {
    std::string_view name;   // of the file, without a .gz at its end; empty: of text in memory, of standard input
    std::string_view head;   // its first bytes, unpacked: 4096, or all there are
    std::uint64_t size = 0;  // of all of it, unpacked; 0 if that is not known
};

/// A file that is being read.
class FormatSource {
  public:
    virtual ~FormatSource() = default;
    virtual std::string_view name() const = 0;  // as FormatClue has it
    /// All of its bytes, unpacked; valid as long as the source.
    virtual std::string_view bytes() = 0;
    /// The content of a file beside it. Errors: what the scene's resource policy says.
    virtual Result<std::string> beside(std::string_view url) const = 0;
    /// The animation that plays, of files that have several; empty: the first.
    virtual std::string_view clip() const = 0;
    /// How many bytes may be made of what it holds.
    virtual std::uint64_t maximumBytes() const = 0;
};

struct FormatReader {
    std::string name;  // for messages, such as "STL"
    /// Whether a file is of this format; the first reader that says so reads it.
    std::function<bool(const FormatClue& clue)> recognises;
    /// Pushes the document. False: it was so broken that reading stopped early. Commands that do not nest, fields that
    /// a type does not have, values of another type than the field's and numbers that are not finite are reported as
    /// errors of the format and left out; so is the rest of the file after an exception.
    std::function<bool(FormatSource& source, DocumentHandler& handler, Diagnostics& diagnostics)> read;
    bool isText = false;    // bytes that are no UTF-8 come as U+FFFD, and are reported
    bool hasClips = false;  // it looks at FormatSource::clip()
};

struct FormatWriter {
    std::string name;
    std::vector<std::string> extensions;  // of files' names: ".dot"; the same with .gz means gzip, too
    /// A handler that prints what it gets; it is complete after endDocument. An exception ends it: the file is not
    /// made.
    std::function<std::unique_ptr<DocumentHandler>(TextSink sink, Diagnostics& diagnostics)> make;
};

class Dialect {
  public:
    /// Precondition, checked: both functions are there.
    void add(FormatReader reader);
    void add(FormatWriter writer);
    /// The same type again is no error. Errors: a built-in type has the name, or one that has other fields.
    Result<> add(std::shared_ptr<const NodeType> type);

    const std::vector<FormatReader>& readers() const { return readers_; }
    const std::vector<FormatWriter>& writers() const { return writers_; }
    const std::vector<std::shared_ptr<const NodeType>>& nodeTypes() const { return types_; }

    /// Null if none of those that were added fits. A reader that throws does not fit.
    const FormatReader* readerOf(const FormatClue& clue) const;
    /// `extension`: ".dot".
    const FormatWriter* writerOf(std::string_view extension) const;
    std::shared_ptr<const NodeType> findType(std::string_view name) const;

  private:
    std::vector<FormatReader> readers_;
    std::vector<FormatWriter> writers_;
    std::vector<std::shared_ptr<const NodeType>> types_;
};

}  // namespace rtsg
