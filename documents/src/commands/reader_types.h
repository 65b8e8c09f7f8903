// The types that a reader must know to read values: built-in tables, the prototypes declared so far, and the fields
// that Scripts and shaders declare for themselves. It also knows the type of each DEF.
//
// Invariant: looking up costs the same however deep prototypes nest. A DEF is visible in its own scope only, a
// prototype also in the scopes within (4.4.4.4, 4.4.7). Threading: one thread a document. Source: ISO/IEC 19775-1 V4.0
// 4.4.2.2, 4.4.4; renamed fields of VRML97: 19775-1 annex of changes.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <rtsg/documents/dialect.h>
#include <rtsg/documents/document_handler.h>

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
    std::string calledInFile{};  // as the file spells it; `name` is another where that is a later version's node
    DeclaredFields fields;
    /// The built-in type of the first node in the body, if known: where an instance may stand.
    const NodeType* primary = nullptr;
    bool hasBody = false;  // a node of it has been seen
};

/// The type of one node in the document: built in, or a prototype, or of an unknown type, of which there is the name
/// only; all null where not even that is known.
struct NodeShape {
    const NodeType* type = nullptr;
    std::shared_ptr<const ProtoType> proto;
    std::shared_ptr<DeclaredFields> own;         // Script, shaders: made on first declaration
    std::shared_ptr<const std::string> unknown;  // the name of a type that nobody knows

    bool known() const { return type || proto; }
    std::string_view name() const {
        if (type) return type->name;
        if (proto) return proto->name;
        return unknown ? std::string_view(*unknown) : std::string_view();
    }
    /// The built-in type that decides where the node may stand; null if unknown.
    const NodeType* standsFor() const { return type ? type : proto ? proto->primary : nullptr; }
};

struct FieldRef {
    std::string_view name;  // canonical; empty if there is no such field
    FieldType type = FieldType::SFBool;
    Access access = Access::inputOutput;
    const FieldDef* definition = nullptr;  // built-in types only
    const CustomType* custom = nullptr;    // which type, of SFCustom and MFCustom

    explicit operator bool() const { return !name.empty(); }
    bool takesValue() const { return access == Access::initializeOnly || access == Access::inputOutput; }
};

std::string renamedProto(const ProtoType& proto);
std::string externIsBuiltin(const std::string& name);
std::string alreadyDeclared(const std::string& name);

/// May nodes of this type declare fields of their own?
bool declaresFields(const NodeType& type);

/// `name`, `set_name` or `name_changed`; the names that fields had in earlier versions count too.
FieldRef findField(const NodeShape& shape, std::string_view name);
/// The name of a field in documents of that version ("2.0" is VRML97), if it was another then; else empty.
std::string_view formerName(const NodeType& type, std::string_view field, std::string_view version);
/// The name that the field has now which had this one once; empty if none had.
std::string_view presentName(const NodeType& type, std::string_view name);
FieldRef findField(const DeclaredFields& fields, std::string_view name);
/// May a node of type `child` be the value of `field`? Unknown types may.
bool accepts(const FieldRef& field, const NodeType* child);
/// The message about a node that stands where its type does not belong: it is kept under its name, and the field is not
/// set.
std::string surplus(std::string_view field, std::string_view parent);
std::string misplaced(std::string_view child, std::string_view field, std::string_view parent);

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
    /// `dialect`: whose node types are known beside the built-in ones; null: none.
    explicit ReaderTypes(std::shared_ptr<const Dialect> dialect = {}) : dialect_(std::move(dialect)) { pushScope(); }

    void pushScope() { scopes_.emplace_back(); }
    void popScope();

    /// Sets the version of the document, which decides which names are those of built-in nodes.
    void setVersion(std::string_view version) { version_ = version; }
    /// Instances of PROTOs say that they are some (XML, JSON), so that a PROTO may have the name of any node.
    void setInstancesAreReported() { instancesAreReported_ = true; }
    /// findField() as the document's version has it: a CADLayer's `visible` was a list before X3D 4.0, one value a
    /// child.
    FieldRef findField(const NodeShape& shape, std::string_view name) const;
    /// Complains of a field's name that was another one's in earlier versions than the document's ("collide" in X3D);
    /// empty if it is right.
    std::string outdatedName(const NodeShape& shape, std::string_view written) const;
    /// The name that a PROTO gets which the file calls `name`: another where that is one of a later version's nodes.
    /// Empty if the file's own version has a node of that name.
    std::string protoName(std::string_view name) const;
    /// False, and nothing happens, if there is such a PROTO in this very scope. `name` is the name in the file.
    bool declareProto(const std::shared_ptr<const ProtoType>& proto, std::string_view name);
    bool declareProto(const std::shared_ptr<const ProtoType>& proto) { return declareProto(proto, proto->name); }
    /// Chooses the name of an EXTERNPROTO. If it is that of a later version's node, or of one of the dialect, and all
    /// its fields are that node's, it means the node: then nothing is declared, as when there is such a type already.
    enum class Extern : std::uint8_t { declared, renamed, isBuiltin, isOurs, isThere };
    Extern declareExtern(const std::shared_ptr<ProtoType>& proto);
    bool declaredHere(std::string_view proto) const;
    NodeShape find(std::string_view type) const;
    /// The shape of a prototype's instances; for one that stands for a node of the dialect, both members are set.
    NodeShape findInstance(std::string_view proto) const;
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
    /// A type of a table, built in or of the dialect; null if there is none.
    const NodeType* fromTables(std::string_view name) const {
        const NodeType* builtin = findBuiltinType(name);
        return builtin || !dialect_ ? builtin : dialect_->findType(name).get();  // the dialect keeps it
    }

    std::shared_ptr<const Dialect> dialect_;
    std::string version_ = "4.0";
    bool shadows_ = false;  // a PROTO has the name of a later version's node, and is meant by it
    bool instancesAreReported_ = false;
    std::vector<Scope> scopes_;
    std::unordered_map<std::string, std::vector<Declared>> protos_;
    std::unordered_map<std::string, std::shared_ptr<const ProtoType>> ours_;  // EXTERNPROTOs of the dialect's nodes
};

}  // namespace rtsg::detail
