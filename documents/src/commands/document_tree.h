// A whole document in memory, as a tree that filters change before they pass it on.
//
// Invariant: items are numbered; an item's contents are lists of numbers, so neither depth nor order costs a stack. An
// item that is taken out of its list is gone. Threading: one thread a document.
#pragma once

#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include <rtsg/documents/document_handler.h>
#include <rtsg/documents/filter.h>

namespace rtsg::detail {

class DocumentTree : public DocumentHandler {
  public:
    enum class Kind : std::uint8_t {
        document,     // [0]: everything else is in it
        component,    // name, level
        meta,         // name, other
        unit,         // name: category, other: its name, value
        node,         // name: type, def, field
        use,          // def, field
        value,        // field, value
        declaration,  // declaration, value; the nodes of its value follow as items of their own
        connection,   // field, other: of the prototype
        proto,        // name; its interface, then one `body`
        body,
        externProto,    // name, fields, url
        route,          // def.field, other.otherField
        importing,      // def: of the Inline, other: exported, otherField: local
        exporting,      // def: local, other: exported
        comment,        // name: the text
        documentation,  // fields.front().about
    };
    using Index = std::uint32_t;
    struct Item {
        Kind kind = Kind::document;
        int level = 0;
        SourceLocation where{}, end{};
        std::string name{}, def{}, field{}, other{}, otherField{};
        std::optional<Value> value{};
        FieldDeclaration declaration{};
        std::vector<FieldDeclaration> fields{};
        std::vector<std::string> url{};
        std::vector<Index> items{};
    };

    DocumentTree() { items_.emplace_back(); }

    DocumentHeader header;
    Item& operator[](Index index) { return items_[index]; }
    const Item& operator[](Index index) const { return items_[index]; }
    Index size() const { return static_cast<Index>(items_.size()); }
    /// A new item that is in no list yet. Moves the others.
    Index add(Item item);
    /// Calls `enter(index)` before an item's contents and `leave(index)` behind them; `enter` says whether to go in.
    template <class Enter, class Leave>
    void walk(Index from, Enter enter, Leave leave) const;
    /// The references to names of one scope (0: the document; else a PROTO's body), without those of prototypes within
    /// it.
    struct Uses {
        std::size_t uses = 0;  // USE
        bool linked = false;   // ROUTE, IMPORT, EXPORT
    };
    std::unordered_map<std::string, Uses> usesIn(Index scope) const;
    /// The document, and the bodies of all its prototypes.
    std::vector<Index> scopes() const;
    /// Sends the document.
    void send(DocumentHandler& handler) const;

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
    Item& put(Kind kind, SourceLocation where);
    void open() { open_.push_back(size() - 1); }
    void close(SourceLocation where);
    void sendStart(const Item& item, DocumentHandler& handler) const;

    std::vector<Item> items_;
    std::vector<Index> open_{0};
};

/// Waits for the end of the document, changes it as a whole, and passes it on.
class TreeFilter : public DocumentTree {
  public:
    explicit TreeFilter(DocumentHandler& next) : next_(next) {}
    void endDocument() override {
        change();
        send(next_);
    }
    virtual void change() = 0;

  private:
    DocumentHandler& next_;
};

template <class Enter, class Leave>
void DocumentTree::walk(Index from, Enter enter, Leave leave) const {
    struct Position {
        Index item;
        std::size_t next;
    };
    if (!enter(from)) return;
    std::vector<Position> path{{from, 0}};
    while (!path.empty()) {
        Position& at = path.back();
        const std::vector<Index>& items = items_[at.item].items;
        if (at.next == items.size()) {
            leave(at.item);
            path.pop_back();
            continue;
        }
        const Index next = items[at.next++];
        if (enter(next)) path.push_back({next, 0});
    }
}

}  // namespace rtsg::detail
