// What a reader must know of types to read values: built-in tables, the prototypes declared so far, and the fields
// that Scripts and shaders declare for themselves; and of names, which type each DEF has.
//
// Invariant: looking up costs the same however deep prototypes nest. A DEF is visible in its own scope only, a
// prototype also in the scopes within (4.4.4.4, 4.4.7). Threading: one thread a document.
// Source: ISO/IEC 19775-1 V4.0 4.4.2.2, 4.4.4; renamed fields of VRML97: 19775-1 annex of changes.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <rtsg/core/document_handler.h>

namespace rtsg::detail {

/// Fields declared in the document: by a prototype's interface, a Script or a shader.
class DeclaredFields {
  public:
    /// False if there is one of that name already.
    bool add(FieldDeclaration field);
    /// Null if absent.
    const FieldDeclaration* find(std::string_view name) const;
    const std::deque<FieldDeclaration>& all() const { return fields_; }

  private:
    std::deque<FieldDeclaration> fields_;  // a deque: names must not move
    std::unordered_map<std::string, std::size_t> byName_;
};

struct ProtoType {
    std::string name;
    DeclaredFields fields;
    /// The built-in type of the first node in the body, if known: where an instance may stand.
    const NodeType* primary = nullptr;
    bool hasBody = false;  // a node of it has been seen
};

/// The type of one node in the document; all null for an unknown one.
struct NodeShape {
    const NodeType* type = nullptr;
    std::shared_ptr<const ProtoType> proto;
    std::shared_ptr<DeclaredFields> own;  // Script, shaders: made on first declaration

    bool known() const { return type || proto; }
    std::string_view name() const {
        if (type) return type->name;
        return proto ? std::string_view(proto->name) : std::string_view();
    }
    /// The built-in type that decides where the node may stand; null if unknown.
    const NodeType* standsFor() const { return type ? type : proto ? proto->primary : nullptr; }
};

struct FieldRef {
    std::string_view name;  // canonical; empty if there is no such field
    FieldType type = FieldType::SFBool;
    Access access = Access::inputOutput;
    const FieldDef* definition = nullptr;  // built-in types only

    explicit operator bool() const { return !name.empty(); }
    bool takesValue() const { return access == Access::initializeOnly || access == Access::inputOutput; }
};

/// May nodes of this type declare fields of their own?
bool declaresFields(const NodeType& type);

/// `name`, `set_name` or `name_changed`. `vrml97`: the old names of renamed fields count too.
FieldRef findField(const NodeShape& shape, std::string_view name, bool vrml97 = false);
/// The name that a field had in VRML97, if another; else empty.
std::string_view vrml97Name(const NodeType& type, std::string_view field);
FieldRef findField(const DeclaredFields& fields, std::string_view name);
/// May a node of type `child` be the value of `field`? Unknown types may.
bool accepts(const FieldRef& field, const NodeType* child);

/// Which fields of one node have been given already.
class GivenFields {
  public:
    /// False if the field was there before; lists of nodes may come in parts.
    bool add(const FieldRef& field);

  private:
    static constexpr std::size_t kFew = 8;
    std::array<const char*, kFew> few_{};  // by the address of the name, which is one per field
    std::unique_ptr<std::unordered_set<const char*>> many_;
};

class ReaderTypes {
  public:
    ReaderTypes() { pushScope(); }

    void pushScope() { scopes_.emplace_back(); }
    void popScope();

    /// False, and nothing happens, if the name is a built-in type's or taken in this very scope.
    bool declareProto(const std::shared_ptr<const ProtoType>& proto);
    bool declaredHere(std::string_view proto) const;
    NodeShape find(std::string_view type) const;
    /// Just the prototype, built-in or not.
    std::shared_ptr<const ProtoType> findProto(std::string_view name) const;

    /// Remembers the shape of a DEF in the current scope; a later one replaces an earlier.
    void define(std::string_view def, const NodeShape& shape);
    const NodeShape* defined(std::string_view def) const;

  private:
    struct Scope {
        std::vector<std::string> protos;
        std::unordered_map<std::string, NodeShape> defs;
    };
    struct Declared {
        std::size_t scope;
        std::shared_ptr<const ProtoType> proto;
    };
    std::vector<Scope> scopes_;
    std::unordered_map<std::string, std::vector<Declared>> protos_;
};

}  // namespace rtsg::detail
