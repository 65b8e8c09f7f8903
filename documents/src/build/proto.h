// The prototypes that a SceneBuilder knows: declarations, and the environments in which their names are visible.
//
// Invariant: a declaration sees only what stands before it in the text (its environment up to `visible`), so a PROTO
// cannot contain itself by name; recursion through EXTERNPROTO is caught while instancing. All of this lives as long as
// the LoadSession; what outlives it is NodeType::declaration. Source: ISO/IEC 19775-1 V4.0 4.4.4 (prototypes), 4.4.5
// (external prototypes).
#pragma once

#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/documents/command_list.h>

namespace rtsg {

struct TextHash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const { return std::hash<std::string_view>()(text); }
};
template <class T>
using NameMap = std::unordered_map<std::string, T, TextHash, std::equal_to<>>;

/// Where a document came from.
struct DocumentSource {
    std::filesystem::path path;  // canonical; empty for text from memory
    std::filesystem::path base;  // relative urls start here
    std::string file;            // for diagnostics
};

struct InterfaceField {
    FieldDeclaration declaration;
    std::optional<Value> value;
    CommandList nodes;  // default of a node-valued field
    SourceLocation where;
};

class Environment;

struct ProtoDeclaration {
    std::string name;
    SourceLocation where;
    bool external = false;
    std::vector<InterfaceField> fields;
    CommandList body;
    std::vector<std::string> url;  // external only

    const Environment* environment = nullptr;  // where it was declared
    std::size_t visible = 0;                   // how much of it stood before the declaration
    const DocumentSource* source = nullptr;
    TypeIndex type;
    /// Type of the first node of the body, through nested instances; null if unknown.
    const NodeType* primary = nullptr;
    Environment* inside = nullptr;       // of the body, filled by its first instance
    ProtoDeclaration* target = nullptr;  // external: the declaration that the url led to
    std::string targetUrl;               // external: from where this is declared, through other EXTERNPROTOs
    bool resolved = false;               // external: the url has been tried
    bool instanced = false;              // diagnostics of the body have been given

    const InterfaceField* findField(std::string_view fieldName) const;

  private:
    mutable NameMap<std::size_t> byName_;  // of many fields, as far as they have been looked for
    mutable std::size_t named_ = 0;
};

class Environment {
  public:
    explicit Environment(const Environment* outer = nullptr, std::size_t outerVisible = 0)
        : outer_(outer), outerVisible_(outerVisible) {}
    /// Null if `name` is not declared within the first `visible` declarations or further out.
    ProtoDeclaration* find(std::string_view name, std::size_t visible = SIZE_MAX) const;
    /// Declared here, before or behind.
    ProtoDeclaration* findHere(std::string_view name) const;
    /// Precondition: findHere(declaration->name) is null.
    ProtoDeclaration* add(std::unique_ptr<ProtoDeclaration> declaration);
    std::size_t size() const { return declarations_.size(); }
    ProtoDeclaration* at(std::size_t index) const { return declarations_[index].get(); }

  private:
    const Environment* outer_;
    std::size_t outerVisible_;
    std::vector<std::unique_ptr<ProtoDeclaration>> declarations_;
    NameMap<std::size_t> byName_;
};

/// Sends beginProto ... endProto, or externProto.
void writeDeclaration(const ProtoDeclaration& proto, DocumentHandler& handler);
/// The name in the declaration of a document's own prototype: a type called `Name#2`, the second prototype of that name
/// in the scene, was declared as `Name`.
std::string_view declaredName(const NodeType& type);
/// The prototypes that the scene's document declares, in order. Where the scene knows several by one name, since the
/// document has been edited or replaced, it is the one that nodes are of, in the place of the first.
std::vector<const NodeType*> declaredTypes(const Scene& scene);
/// The interface as a NodeType with the hidden `body`; null if its fields contradict each other.
std::shared_ptr<NodeType> makeProtoType(const ProtoDeclaration& proto, std::string name);
/// Table 4.4: may a node's field be connected with this field of the PROTO's interface?
bool isConnectionLegal(Access protoField, Access nodeField);
std::string_view accessName(Access access);

}  // namespace rtsg
