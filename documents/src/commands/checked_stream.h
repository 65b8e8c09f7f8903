// CheckedStream: turns the commands of a reader that may break the rules into a stream that keeps them.
//
// Readers of other programs' files, and those of plug-ins, push through it. Commands that do not nest, fields that a
// type does not have, values of another type than the field's, names that no file can spell, and non-finite numbers are
// reported as faults of the reader, and left out or repaired. Invariant: whatever goes in, the output is what
// document_handler.h promises, from beginDocument to endDocument. Threading: one thread a stream.
#pragma once

#include <string>
#include <vector>

#include <rtsg/documents/dialect.h>
#include <rtsg/documents/filter.h>

namespace rtsg::detail {

class CheckedStream final : public Filter {
  public:
    /// `dialect` may be null; all must outlive the stream.
    CheckedStream(DocumentHandler& next, std::string format, const Dialect* dialect, Diagnostics& diagnostics);
    /// Call after the reader, which tells whether it has read all: ends what is open, and reports repairs. If a reader
    /// pushed nothing, there is no document.
    void close(bool complete);

    void beginDocument(const DocumentHeader& header) override;
    void endDocument() override;
    void component(std::string_view name, int level, SourceLocation where) override;
    void meta(std::string_view name, std::string_view content, SourceLocation where) override;
    void unit(std::string_view category, std::string_view name, double conversionFactor, SourceLocation where) override;
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override;
    void endNode(SourceLocation where) override;
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override;
    void setField(std::string_view name, Value value, SourceLocation where) override;
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override;
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override;
    void beginProto(std::string_view name, SourceLocation where) override;
    void beginProtoBody(SourceLocation where) override;
    void endProto(SourceLocation where) override;
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override;
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override;
    void importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                    SourceLocation where) override;
    void exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) override;
    void comment(std::string_view text, SourceLocation where) override;
    void documentation(const Documentation& about, SourceLocation where) override;

  private:
    enum class Kind : std::uint8_t { node, interface, body };
    struct Level {
        Kind kind = Kind::node;
        const NodeType* type = nullptr;  // null: not known here, as that of a prototype's instance
    };

    /// Whether a statement may come now; begins the document if the reader has not. False inside a refused part.
    bool mayCome(SourceLocation where);
    bool isIn(Kind kind) const { return !levels_.empty() && levels_.back().kind == kind; }
    /// At the top, or in a prototype's body.
    bool isAmongNodes() const { return levels_.empty() || isIn(Kind::body); }
    /// Checks names of types and fields, and names of nodes.
    bool areNames(std::initializer_list<std::string_view> names, SourceLocation where);
    bool areDefs(std::initializer_list<std::string_view> names, SourceLocation where);
    bool areAll(bool (*is)(std::string_view), std::initializer_list<std::string_view> names, SourceLocation where);
    /// False, and reported, if a node cannot be put there.
    bool mayHoldNode(std::string_view field, SourceLocation where);
    bool fits(std::string_view name, const Value& value, SourceLocation where);
    void mend(Value& value);
    std::string mended(std::string_view text);
    void fault(SourceLocation where, const std::string& what);
    void end(SourceLocation where);

    std::string format_;
    const Dialect* dialect_;
    Diagnostics& diagnostics_;
    std::vector<Level> levels_;
    std::size_t refused_ = 0;  // levels of a node or prototype that was refused: all within is left out
    bool begun_ = false, ended_ = false;
    std::size_t notFinite_ = 0, notUtf8_ = 0;
};

}  // namespace rtsg::detail
