// Gathers a document's commands into a tree, and sends them again.
#include "document_tree.h"

#include <utility>

namespace rtsg::detail {

DocumentTree::Index DocumentTree::add(Item item) {
    items_.push_back(std::move(item));
    return size() - 1;
}

DocumentTree::Item& DocumentTree::put(Kind kind, SourceLocation where) {
    const Index index = add({.kind = kind, .where = where, .end = where});
    items_[open_.back()].items.push_back(index);
    return items_[index];
}

void DocumentTree::close(SourceLocation where) {
    items_[open_.back()].end = where;
    if (open_.size() > 1) open_.pop_back();
}

void DocumentTree::beginDocument(const DocumentHeader& given) {
    header = given;
}

void DocumentTree::endDocument() {}

void DocumentTree::component(std::string_view name, int level, SourceLocation where) {
    Item& item = put(Kind::component, where);
    item.name = name;
    item.level = level;
}

void DocumentTree::meta(std::string_view name, std::string_view content, SourceLocation where) {
    Item& item = put(Kind::meta, where);
    item.name = name;
    item.other = content;
}

void DocumentTree::unit(std::string_view category, std::string_view name, double conversionFactor,
                        SourceLocation where) {
    Item& item = put(Kind::unit, where);
    item.name = category;
    item.other = name;
    item.value = Value(conversionFactor);
}

void DocumentTree::beginNode(std::string_view type, std::string_view def, std::string_view field,
                             SourceLocation where) {
    Item& item = put(Kind::node, where);
    item.name = type;
    item.def = def;
    item.field = field;
    open();
}

void DocumentTree::endNode(SourceLocation where) {
    close(where);
}

void DocumentTree::useNode(std::string_view def, std::string_view field, SourceLocation where) {
    Item& item = put(Kind::use, where);
    item.def = def;
    item.field = field;
}

void DocumentTree::setField(std::string_view name, Value value, SourceLocation where) {
    Item& item = put(Kind::value, where);
    item.field = name;
    item.value = std::move(value);
}

void DocumentTree::declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) {
    Item& item = put(Kind::declaration, where);
    item.declaration = field;
    item.value = std::move(value);
}

void DocumentTree::isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) {
    Item& item = put(Kind::connection, where);
    item.field = nodeField;
    item.other = protoField;
}

void DocumentTree::beginProto(std::string_view name, SourceLocation where) {
    put(Kind::proto, where).name = name;
    open();
}

void DocumentTree::beginProtoBody(SourceLocation where) {
    put(Kind::body, where);
    open();
}

void DocumentTree::endProto(SourceLocation where) {
    if (items_[open_.back()].kind == Kind::body) close(where);
    close(where);
}

void DocumentTree::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                               const std::vector<std::string>& url, SourceLocation where) {
    Item& item = put(Kind::externProto, where);
    item.name = name;
    item.fields = fields;
    item.url = url;
}

void DocumentTree::route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                         std::string_view toField, SourceLocation where) {
    Item& item = put(Kind::route, where);
    item.def = fromNode;
    item.field = fromField;
    item.other = toNode;
    item.otherField = toField;
}

void DocumentTree::importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                              SourceLocation where) {
    Item& item = put(Kind::importing, where);
    item.def = inlineDef;
    item.other = exportedName;
    item.otherField = localName;
}

void DocumentTree::exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) {
    Item& item = put(Kind::exporting, where);
    item.def = localName;
    item.other = exportedName;
}

void DocumentTree::comment(std::string_view text, SourceLocation where) {
    put(Kind::comment, where).name = text;
}

void DocumentTree::documentation(const Documentation& about, SourceLocation where) {
    Item& item = put(Kind::documentation, where);
    item.fields.emplace_back().about = std::make_shared<const Documentation>(about);
}

std::unordered_map<std::string, DocumentTree::Uses> DocumentTree::usesIn(Index scope) const {
    std::unordered_map<std::string, Uses> result;
    walk(
        scope,
        [&](Index index) {
            const Item& item = items_[index];
            if (item.kind == Kind::use) ++result[item.def].uses;
            if (item.kind == Kind::route) result[item.def].linked = result[item.other].linked = true;
            if (item.kind == Kind::importing) result[item.def].linked = result[item.otherField].linked = true;
            if (item.kind == Kind::exporting) result[item.def].linked = true;
            return item.kind != Kind::body || index == scope;
        },
        [](Index) {});
    return result;
}

std::vector<DocumentTree::Index> DocumentTree::scopes() const {
    std::vector<Index> result{0};
    walk(
        0,
        [&](Index index) {
            if (items_[index].kind == Kind::body) result.push_back(index);
            return true;
        },
        [](Index) {});
    return result;
}

void DocumentTree::sendStart(const Item& item, DocumentHandler& handler) const {
    switch (item.kind) {
        case Kind::document:
            return handler.beginDocument(header);
        case Kind::component:
            return handler.component(item.name, item.level, item.where);
        case Kind::meta:
            return handler.meta(item.name, item.other, item.where);
        case Kind::unit:
            return handler.unit(item.name, item.other, item.value->as<double>(), item.where);
        case Kind::node:
            return handler.beginNode(item.name, item.def, item.field, item.where);
        case Kind::use:
            return handler.useNode(item.def, item.field, item.where);
        case Kind::value:
            return handler.setField(item.field, *item.value, item.where);
        case Kind::declaration:
            return handler.declareField(item.declaration, item.value, item.where);
        case Kind::connection:
            return handler.isConnection(item.field, item.other, item.where);
        case Kind::proto:
            return handler.beginProto(item.name, item.where);
        case Kind::body:
            return handler.beginProtoBody(item.where);
        case Kind::externProto:
            return handler.externProto(item.name, item.fields, item.url, item.where);
        case Kind::route:
            return handler.route(item.def, item.field, item.other, item.otherField, item.where);
        case Kind::importing:
            return handler.importNode(item.def, item.other, item.otherField, item.where);
        case Kind::exporting:
            return handler.exportNode(item.def, item.other, item.where);
        case Kind::comment:
            return handler.comment(item.name, item.where);
        case Kind::documentation:
            return handler.documentation(*item.fields.front().about, item.where);
    }
}

void DocumentTree::send(DocumentHandler& handler) const {
    walk(
        0,
        [&](Index index) {
            sendStart(items_[index], handler);
            return true;
        },
        [&](Index index) {
            const Item& item = items_[index];
            if (item.kind == Kind::node) handler.endNode(item.end);
            if (item.kind == Kind::proto) handler.endProto(item.end);
            if (item.kind == Kind::document) handler.endDocument();
        });
}

}  // namespace rtsg::detail
