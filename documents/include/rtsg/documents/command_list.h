// CommandList: a recording of DocumentHandler commands that can be replayed into any handler, any number of times.
//
// A PROTO body, an Inline's document and the nodes of a default value are kept in such lists. Recording is cheap: names
// are shared between commands and values share their elements. Invariant: replaying gives the recorded calls, in order,
// with their positions; if there were more than the limits allow, only the first ones are kept. Threading: recording on
// one thread; replaying a finished list on any number.
#pragma once

#include <string_view>
#include <unordered_map>
#include <vector>

#include <rtsg/documents/document_handler.h>

namespace rtsg {

class CommandList final : public DocumentHandler {
  public:
    /// Limits for documents from untrusted sources.
    struct Limits {
        std::uint64_t nodes = UINT64_MAX;
        std::uint64_t bytes = UINT64_MAX;  // of memory that the commands and their values take
    };
    CommandList() = default;
    explicit CommandList(Limits limits) : limits_(limits) {}

    /// Whether a limit was reached: from then on all commands are left out.
    bool isFull() const override { return isFull_; }
    /// Whether the limit of nodes was reached (else that of bytes), and the position at which it happened.
    bool hasTooManyNodes() const { return fullOfNodes_; }
    SourceLocation fullAt() const { return fullAt_; }

    bool empty() const { return commands_.empty(); }
    std::size_t size() const { return commands_.size(); }
    void replay(DocumentHandler& handler) const;
    /// The type of the first node at the outermost level, outside of PROTO declarations; empty if there is none.
    std::string_view firstNodeType() const;

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
    enum class Kind : std::uint8_t {
        beginDocument,
        endDocument,
        component,
        meta,
        unit,
        beginNode,
        endNode,
        useNode,
        setField,
        declareField,
        isConnection,
        beginProto,
        beginProtoBody,
        endProto,
        externProto,
        route,
        importNode,
        exportNode,
        comment,
        documentation,
    };
    struct Command {
        Kind kind = Kind::endNode;
        bool hasValue = false;
        Access access = Access::inputOutput;
        FieldType type = FieldType::SFBool;
        // Index into headers_, externs_ or documentations_ (for a declaration one more than that, 0 for none); or a
        // component's level.
        std::uint32_t index = 0;
        SourceLocation where;
        String names[4];
        Value value;
    };
    struct Extern {
        std::vector<FieldDeclaration> fields;
        std::vector<std::string> url;
    };

    /// `names` are kept once for all commands.
    Command& add(Kind kind, SourceLocation where, std::initializer_list<std::string_view> names = {});
    /// Counts memory for a value or a name. Returns false if it exceeds the limit; then it and all that follows is left
    /// out.
    bool take(std::size_t bytes, SourceLocation where);
    String shared(std::string_view text);

    Limits limits_;
    std::uint64_t nodes_ = 0, bytes_ = 0;
    bool isFull_ = false, fullOfNodes_ = false;
    SourceLocation fullAt_;
    Command dropped_;  // receives a command that is left out
    std::vector<Command> commands_;
    std::vector<DocumentHeader> headers_;
    std::vector<Extern> externs_;
    std::vector<std::shared_ptr<const Documentation>> documentations_;
    std::unordered_map<std::string_view, String> shared_;  // keys point into the values
};

}  // namespace rtsg
