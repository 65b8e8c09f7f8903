// Replaces materials by instances of the portable materials with the same metadata. A material that differs from all of
// them, or whose fields are referred to, stays, and is reported.
#include <algorithm>
#include <map>
#include <string>
#include <unordered_set>
#include <vector>

#include <rtsg/documents/read_document.h>

#include "build/portable_materials.h"
#include "commands/document_tree.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

/// A prototype of the library whose body has metadata.
struct PortableForm {
    std::string name;
    std::map<std::string, DocumentTree::Item> fields{};  // declarations
    std::vector<FieldDeclaration> interface{};
    std::string body{};                                // the type of its node
    std::map<std::string, Value> fixed{};              // values of the node
    std::map<std::string, std::string> connections{};  // from fields of the node to those of the prototype
    bool used = false;
};

/// The fields of the library's prototypes that stand in metadata have the names of their entries.
std::vector<PortableForm> portableForms() {
    using Kind = DocumentTree::Kind;
    DocumentTree library;
    Diagnostics none;
    readDocument(kPortableMaterials, library, none);
    std::vector<PortableForm> forms;
    for (const DocumentTree::Index at : library[0].items) {
        const DocumentTree::Item& proto = library[at];
        if (proto.kind != Kind::proto) continue;
        PortableForm form{.name = proto.name};
        bool hasMetadata = false;
        for (const DocumentTree::Index inside : proto.items) {
            const DocumentTree::Item& part = library[inside];
            if (part.kind == Kind::declaration) {
                form.fields.emplace(part.declaration.name, part);
                form.interface.push_back(part.declaration);
            }
            if (part.kind != Kind::body) continue;
            const DocumentTree::Item& node = library[part.items.front()];
            form.body = node.name;
            for (const DocumentTree::Index field : node.items) {
                const DocumentTree::Item& one = library[field];
                if (one.kind == Kind::value) form.fixed.emplace(one.field, *one.value);
                if (one.kind == Kind::connection) form.connections.emplace(one.field, one.other);
                hasMetadata |= one.kind == Kind::node;
            }
        }
        if (hasMetadata) forms.push_back(std::move(form));
    }
    return forms;
}

class Portable final : public TreeFilter {
  public:
    Portable(DocumentHandler& next, Diagnostics& diagnostics) : TreeFilter(next), diagnostics_(diagnostics) {}

    void change() override {
        for (const Index scope : scopes())
            for (const auto& [name, uses] : usesIn(scope))
                if (uses.linked) linked_.insert(name);
        std::vector<Index> materials;
        walk(
            0,
            [&](Index index) {
                const Item& item = (*this)[index];
                if (item.kind == Kind::proto || item.kind == Kind::externProto) taken_.insert(item.name);
                if (item.kind == Kind::use && !isSame(item.field)) linked_.insert(item.def);
                if (item.kind == Kind::node && isMaterial(item) && metadataOf(item)) materials.push_back(index);
                return true;
            },
            [](Index) {});
        for (const Index index : materials) replace(index);
        declare();
    }

  private:
    using Entries = std::map<std::string, Item>;  // values or connections, by field of the prototype

    /// Fields whose materials nobody reads but renderers; a node in the body of a prototype stands in none.
    static bool isSame(const std::string& field) {
        return field.empty() || field == "material" || field == "backMaterial";
    }
    static bool isMaterial(const Item& node) {
        const NodeType* type = findBuiltinType(node.name);
        return type && type->isA("X3DMaterialNode");
    }
    const Value* valueIn(const Item& node, std::string_view field) const {
        for (const Index index : node.items)
            if (const Item& item = (*this)[index]; item.kind == Kind::value && item.field == field) return &*item.value;
        return nullptr;
    }
    bool says(const Item& node, std::string_view field, std::string_view text) const {
        const Value* value = valueIn(node, field);
        return value && value->holds<String>() && value->as<String>().view() == text;
    }
    /// The metadata for the tracer; null if the material has none.
    const Item* metadataOf(const Item& material) const {
        for (const Index index : material.items) {
            const Item& item = (*this)[index];
            if (item.kind == Kind::node && item.field == "metadata" &&
                (item.name == "MetadataSet" ? says(item, "name", "RTSG") : says(item, "reference", "RTSG")))
                return &item;
        }
        return nullptr;
    }

    /// Reads one MetadataFloat. False: it says more than a prototype's field does.
    bool readEntry(const Item& node, const PortableForm& form, Entries& entries) const {
        const Value* name = valueIn(node, "name");
        if (node.kind == Kind::comment) return true;
        if (node.kind != Kind::node || node.name != "MetadataFloat" || !node.def.empty() || !name) return false;
        const std::string field(name->as<String>().view());
        const auto known = form.fields.find(field);
        if (known == form.fields.end() || known->second.declaration.type != FieldType::MFFloat) return false;
        const Item* number = nullptr;
        for (const Index index : node.items) {
            const Item& item = (*this)[index];
            const bool isNumber = item.field == "value" && (item.kind == Kind::value || item.kind == Kind::connection);
            if (isNumber)
                number = &item;
            else if (item.kind != Kind::comment && item.field != "name" && item.field != "reference")
                return false;
        }
        return number && entries.emplace(field, *number).second;
    }
    bool readMetadata(const Item& metadata, const PortableForm& form, Entries& entries) const {
        if (metadata.name != "MetadataSet") return readEntry(metadata, form, entries);
        if (!metadata.def.empty()) return false;
        return std::ranges::all_of(metadata.items, [&](Index index) {
            const Item& item = (*this)[index];
            return item.field == "value" ? readEntry(item, form, entries)
                                         : item.kind == Kind::comment || item.field == "name";
        });
    }
    /// Reads the values of the prototype's fields from this material; false if it is another kind of material.
    bool read(const Item& material, const PortableForm& form, Entries& entries) const {
        if (material.name != form.body) return false;
        const NodeType& type = *findBuiltinType(form.body);
        const auto isDefault = [&](const std::string& field, const Value& value) {
            const FieldIndex index = type.find(field);
            return index != kNoField && type.fields[index].defaultValue == value;
        };
        std::unordered_set<std::string> given;
        for (const Index index : material.items) {
            const Item& item = (*this)[index];
            if (item.kind == Kind::comment) continue;
            given.insert(item.field);
            const auto connection = form.connections.find(item.field);
            const auto fixed = form.fixed.find(item.field);
            bool fits = false;
            if (item.kind == Kind::node)
                fits = item.field == "metadata" && readMetadata(item, form, entries);
            else if (connection != form.connections.end() &&
                     (item.kind == Kind::value || item.kind == Kind::connection))
                fits = entries.emplace(connection->second, item).second;
            else if (item.kind == Kind::value)
                fits = fixed != form.fixed.end() ? fixed->second == *item.value : isDefault(item.field, *item.value);
            if (!fits) return false;
        }
        for (const auto& [field, value] : form.fixed)
            if (!given.contains(field) && !isDefault(field, value)) return false;
        for (const auto& [field, own] : form.connections)
            if (!given.contains(field) && !isDefault(field, *form.fields.at(own).value)) return false;
        // Numbers that the metadata leaves out are 0 there.
        return std::ranges::all_of(form.fields, [&](const auto& one) {
            const std::optional<Value>& value = one.second.value;
            return entries.contains(one.first) || one.second.declaration.type != FieldType::MFFloat ||
                   *value == Value(Array<float>{0.0f});
        });
    }

    void replace(Index index) {
        const Item material = (*this)[index];
        const auto stays = [&](const std::string& why) {
            diagnostics_.warning(material.where, "portable: the material stays as it is: " + why);
        };
        if (!material.def.empty() && linked_.contains(material.def))
            return stays("'" + material.def + "' stands in a route, an export, or a field that is no material");
        if (!isSame(material.field))
            return stays("who reads the field " + material.field + " may want a " + material.name);
        for (PortableForm& form : forms_) {
            Entries entries;
            if (!read(material, form, entries)) continue;
            if (taken_.contains(form.name))
                return stays("the document declares a prototype with the name " + form.name);
            std::vector<Index> items;
            for (const Index inside : material.items)
                if ((*this)[inside].kind == Kind::comment) items.push_back(inside);
            for (const FieldDeclaration& field : form.interface) {
                const auto entry = entries.find(field.name);
                if (entry == entries.end()) continue;
                entry->second.field = field.name;
                items.push_back(add(std::move(entry->second)));
            }
            form.used = true;
            (*this)[index].name = form.name;
            (*this)[index].items = std::move(items);
            return;
        }
        stays("no portable material says the same");
    }
    /// Behind the statements of the document about itself.
    void declare() {
        std::vector<Index> declared;
        for (const PortableForm& form : forms_) {
            if (!form.used) continue;
            Item item{.kind = Kind::externProto, .name = form.name, .fields = form.interface};
            item.url = {std::string(kPortableUrn) + form.name, "materials.x3dv#" + form.name};
            declared.push_back(add(std::move(item)));
        }
        std::vector<Index>& items = (*this)[0].items;
        const auto entry = std::ranges::find_if(items, [&](Index index) {
            const Kind kind = (*this)[index].kind;
            return kind != Kind::component && kind != Kind::meta && kind != Kind::unit && kind != Kind::comment;
        });
        items.insert(entry, declared.begin(), declared.end());
    }

    Diagnostics& diagnostics_;
    std::vector<PortableForm> forms_ = portableForms();
    std::unordered_set<std::string> linked_, taken_;
};

}  // namespace

FilterPtr makePortable(DocumentHandler& next, Diagnostics& diagnostics) {
    return std::make_unique<Portable>(next, diagnostics);
}

}  // namespace rtsg::detail
