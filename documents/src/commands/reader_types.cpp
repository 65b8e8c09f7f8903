// Looks up types for readers: fields of nodes, PROTOs and Scripts, and which nodes a field accepts.
#include "reader_types.h"

#include <algorithm>
#include <array>

#include <rtsg/core/never_destroyed.h>

#include "versions.h"

namespace rtsg::detail {

namespace {

/// Fields that had other names in VRML97 (`until` 3) or in X3D 3.0 to 3.3 (`until` 4).
struct Renamed {
    std::string_view node, before, now;
    char until;
};
constexpr std::array<Renamed, 15> kRenamed = {{
    {"LOD", "level", "children", '3'},
    {"GeoLOD", "level", "children", '3'},
    {"Switch", "choice", "children", '3'},
    {"Collision", "collide", "enabled", '3'},
    {"ComposedCubeMapTexture", "back", "backTexture", '4'},
    {"ComposedCubeMapTexture", "bottom", "bottomTexture", '4'},
    {"ComposedCubeMapTexture", "front", "frontTexture", '4'},
    {"ComposedCubeMapTexture", "left", "leftTexture", '4'},
    {"ComposedCubeMapTexture", "right", "rightTexture", '4'},
    {"ComposedCubeMapTexture", "top", "topTexture", '4'},
    {"Layer", "isPickable", "pickable", '4'},
    {"LayoutLayer", "isPickable", "pickable", '4'},
    {"LoadSensor", "watchList", "children", '4'},
    {"ParticleSystem", "colorRamp", "color", '4'},
    {"ParticleSystem", "texCoordRamp", "texCoord", '4'},
}};

std::string_view withoutEvent(std::string_view name) {
    constexpr std::string_view before = "set_", after = "_changed";
    if (name.starts_with(before)) return name.substr(before.size());
    if (name.ends_with(after)) return name.substr(0, name.size() - after.size());
    return {};
}

}  // namespace

std::string renamedProto(const ProtoType& proto) {
    return "PROTO " + proto.calledInFile + " has the name of a node of X3D; it is called " + proto.name +
           " from here on";
}

std::string externIsBuiltin(const std::string& name) {
    return "EXTERNPROTO " + name + " has the name of a node of a later version of X3D, which is taken instead";
}

std::string alreadyDeclared(const std::string& name) {
    return "there is a node type " + name + " already, which stays";
}

bool DeclaredFields::add(FieldDeclaration field) {
    if (!byName_.emplace(field.name, fields_.size()).second) return false;
    fields_.push_back(std::move(field));
    return true;
}

const FieldDeclaration* DeclaredFields::find(std::string_view name) const {
    if (fields_.size() <= 8) {
        const auto found = std::ranges::find(fields_, name, &FieldDeclaration::name);
        return found == fields_.end() ? nullptr : &*found;
    }
    const auto found = byName_.find(std::string(name));
    return found == byName_.end() ? nullptr : &fields_[found->second];
}

bool declaresFields(const NodeType& type) {
    constexpr std::array<std::string_view, 4> names = {"Script", "ComposedShader", "PackagedShader", "ShaderProgram"};
    return std::ranges::find(names, type.name) != names.end();
}

FieldRef findField(const DeclaredFields& fields, std::string_view name) {
    const FieldDeclaration* field = fields.find(name);
    if (!field) {
        const std::string_view bare = withoutEvent(name);
        if (!bare.empty()) field = fields.find(bare);
        if (!field || field->access != Access::inputOutput) return {};
    }
    return {field->name, field->type, field->access, nullptr, field->custom.get()};
}

FieldRef findField(const NodeShape& shape, std::string_view name) {
    if (shape.own) {
        if (const FieldRef own = findField(*shape.own, name)) return own;
    }
    if (shape.type) {
        const FieldIndex index = shape.type->find(name);
        if (index != kNoField && !shape.type->fields[index].hidden) {
            const FieldDef& field = shape.type->fields[index];
            return {field.name, field.type, field.access, &field, field.custom.get()};
        }
        const std::string_view now = presentName(*shape.type, name);
        return now.empty() ? FieldRef{} : findField(shape, now);
    }
    if (!shape.proto) return {};
    if (const FieldRef declared = findField(shape.proto->fields, name)) return declared;
    // 4.4.4.3: X3DPrototypeInstance has metadata as every node has, declared or not.
    static const auto& anyNode = neverDestroyed([] { return NodeShape{findBuiltinType("Group"), {}, {}, {}}; });
    const FieldRef metadata = findField(anyNode, name);
    return metadata.name == "metadata" ? metadata : FieldRef{};
}

std::string_view presentName(const NodeType& type, std::string_view name) {
    const std::string_view bare = withoutEvent(name);
    for (const Renamed& renamed : kRenamed)
        if (type.name == renamed.node && (name == renamed.before || bare == renamed.before)) return renamed.now;
    return {};
}

std::string_view formerName(const NodeType& type, std::string_view field, std::string_view version) {
    for (const Renamed& renamed : kRenamed)
        if (type.name == renamed.node && field == renamed.now && !version.empty() && version[0] < renamed.until)
            return renamed.before;
    return {};
}

bool accepts(const FieldRef& field, const NodeType* child) {
    if (sf(field.type) != FieldType::SFNode) return false;
    if (!field.definition || field.definition->accepts.empty() || !child) return true;
    return std::ranges::any_of(field.definition->accepts, [&](const std::string& type) { return child->isA(type); });
}

std::string misplaced(std::string_view child, std::string_view field, std::string_view parent) {
    return "field '" + std::string(field) + "' of " + std::string(parent) + " does not take " + std::string(child) +
           "; the node is kept under its name, the field is not set";
}

std::string surplus(std::string_view field, std::string_view parent) {
    return "field '" + std::string(field) + "' of " + std::string(parent) +
           " has a node already; this one is kept under its name, and is in no field";
}

bool GivenFields::add(const FieldRef& field) {
    if (field.type == FieldType::MFNode) return true;
    for (const char*& known : few_) {
        if (known == field.name.data()) return false;
        if (known) continue;
        known = field.name.data();
        return true;
    }
    if (!many_) many_ = std::make_unique<std::unordered_set<const char*>>();
    return many_->insert(field.name.data()).second;
}

FieldRef ReaderTypes::findField(const NodeShape& shape, std::string_view name) const {
    FieldRef found = detail::findField(shape, name);
    if (found.name == "visible" && shape.type && shape.type->name == "CADLayer" && versionNumber(version_) < 40)
        found.type = FieldType::MFBool, found.definition = nullptr;
    return found;
}

std::string ReaderTypes::outdatedName(const NodeShape& shape, std::string_view written) const {
    if (!shape.type || shape.type->find(written) != kNoField || version_.empty()) return {};
    const std::string_view bare = withoutEvent(written);
    for (const Renamed& one : kRenamed)
        if (shape.type->name == one.node && (written == one.before || bare == one.before) && version_[0] >= one.until)
            return "field '" + std::string(one.before) + "' of " + shape.type->name + " is called '" +
                   std::string(one.now) + "' since X3D " + one.until + ".0";
    return {};
}

void ReaderTypes::popScope() {
    for (const std::string& name : scopes_.back().protos) {
        const auto found = protos_.find(name);
        found->second.pop_back();
        if (found->second.empty()) protos_.erase(found);
    }
    scopes_.pop_back();
}

bool ReaderTypes::declaredHere(std::string_view proto) const {
    const auto found = protos_.find(std::string(proto));
    return found != protos_.end() && found->second.back().scope == scopes_.size();
}

std::string ReaderTypes::protoName(std::string_view name) const {
    if (!fromTables(name)) return std::string(name);
    return isInVersion(name, version_) && !instancesAreReported_ ? std::string() : std::string(name) + '_';
}

bool ReaderTypes::declareProto(const std::shared_ptr<const ProtoType>& proto, std::string_view name) {
    if (declaredHere(name)) return false;
    if (fromTables(name)) {
        if (proto->name == name) return false;
        shadows_ = shadows_ || !isInVersion(name, version_);
    }
    protos_[std::string(name)].push_back({scopes_.size(), proto});
    scopes_.back().protos.emplace_back(name);
    return true;
}

ReaderTypes::Extern ReaderTypes::declareExtern(const std::shared_ptr<ProtoType>& proto) {
    proto->calledInFile = proto->name;
    const std::string name = protoName(proto->calledInFile);
    const bool isOurs = !findBuiltinType(proto->calledInFile) && fromTables(proto->calledInFile);
    const bool isLater = !name.empty() && name != proto->calledInFile;
    if (isLater || isOurs) {
        NodeShape builtin;
        builtin.type = fromTables(proto->calledInFile);
        const auto isItsField = [&](const FieldDeclaration& field) {
            const FieldRef found = findField(builtin, field.name);
            return found && haveOneType(found, field);
        };
        const bool isItself = std::ranges::all_of(proto->fields.all(), isItsField);
        if (isOurs && isItself) {
            ours_.try_emplace(proto->calledInFile, proto);
            return Extern::isOurs;
        }
        if (!isInVersion(proto->calledInFile, version_) && isItself) return Extern::isBuiltin;
        if (isLater) proto->name = name;
    }
    if (!declareProto(proto, proto->calledInFile)) return Extern::isThere;
    return isLater ? Extern::renamed : Extern::declared;
}

std::shared_ptr<const ProtoType> ReaderTypes::findProto(std::string_view name) const {
    if (protos_.empty()) return nullptr;
    const auto found = protos_.find(std::string(name));
    return found == protos_.end() ? nullptr : found->second.back().proto;
}

NodeShape ReaderTypes::findInstance(std::string_view proto) const {
    NodeShape shape;
    shape.proto = findProto(proto);
    if (shape.proto) return shape;
    if (const auto ours = ours_.find(std::string(proto)); ours != ours_.end()) {
        shape.type = fromTables(proto);
        shape.proto = ours->second;
    }
    return shape;
}

NodeShape ReaderTypes::find(std::string_view type) const {
    NodeShape shape;
    if (shadows_ && !(findBuiltinType(type) && isInVersion(type, version_))) shape.proto = findProto(type);
    if (!shape.proto) shape.type = fromTables(type);
    if (!shape.type && !shape.proto) shape.proto = findProto(type);
    if (!shape.known()) shape.unknown = std::make_shared<const std::string>(type);
    return shape;
}

void ReaderTypes::define(std::string_view def, const NodeShape& shape) {
    scopes_.back().defs[std::string(def)] = shape;
}

const NodeShape* ReaderTypes::defined(std::string_view def) const {
    const auto found = scopes_.back().defs.find(std::string(def));
    return found == scopes_.back().defs.end() ? nullptr : &found->second;
}

}  // namespace rtsg::detail
