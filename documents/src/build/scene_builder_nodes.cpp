// The parts of SceneBuilder's commands: open nodes, scopes, places for children, checks of values, Scripts.

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "builder_state.h"
#include "commands/reader_types.h"
#include "commands/suggestion.h"

namespace rtsg {

namespace {

/// Axes shorter or longer than this are put right; the three digits that many files give are left as they are.
constexpr float kAxisTolerance = 1e-3f;

/// Up to so many fields are looked through.
constexpr std::size_t kFew = 8;
constexpr std::size_t kNotListed = SIZE_MAX;

/// ISO/IEC 19775-1 V4.0 5.3.18: the axis is a unit vector. Returns whether it had to be changed.
bool normaliseAxis(Rotation& r) {
    const float squared = r.x * r.x + r.y * r.y + r.z * r.z;
    if (std::abs(squared - 1.0f) <= 2 * kAxisTolerance) return false;
    const double length = portable::hypot(double(r.x), double(r.y), double(r.z));
    if (!std::isfinite(length) || length == 0.0) {
        r = Rotation{};  // no axis: no rotation
    } else {
        r.x = static_cast<float>(r.x / length);
        r.y = static_cast<float>(r.y / length);
        r.z = static_cast<float>(r.z / length);
    }
    return true;
}

}  // namespace

// ---- OpenNode --------------------------------------------------------------------------------------------------

std::vector<NodeId>& OpenNode::list(FieldIndex index) {
    if (children.size() <= kFew) {
        for (ChildList& one : children)
            if (one.field == index) return one.nodes;
    } else {
        for (; lists < children.size(); ++lists) {
            const std::size_t field = children[lists].field;
            if (listed.size() <= field) listed.resize(field + 1, kNotListed);
            listed[field] = lists;
        }
        if (index < listed.size() && listed[index] != kNotListed) return children[listed[index]].nodes;
    }
    return children.emplace_back(ChildList{index, {}}).nodes;
}

void OpenNode::forgetLists() {
    listed.clear();
    lists = 0;
}

void OpenNode::forgetOwn() {
    own.clear();
    if (ownNamed == 0) return;
    ownByName.clear();
    ownNamed = 0;
}

void OpenNode::markGiven(FieldIndex index) {
    if (given.size() <= index) given.resize(index + 1u);
    given[index] = true;
}

FieldIndex OpenNode::find(std::string_view name) const {
    if (!type) return kNoField;
    const FieldIndex found = type->find(name);
    if (found != kNoField) return found;
    const std::size_t index = findOwn(name);
    return index == own.size() ? kNoField : static_cast<FieldIndex>(type->fields.size() + index);
}

std::size_t OpenNode::findOwn(std::string_view name) const {
    if (own.size() <= kFew)
        return static_cast<std::size_t>(std::ranges::find(own, name, &FieldDef::name) - own.begin());
    for (; ownNamed < own.size(); ++ownNamed) ownByName.try_emplace(own[ownNamed].name, ownNamed);
    const auto known = ownByName.find(name);
    return known == ownByName.end() ? own.size() : known->second;
}

std::string OpenNode::describe() const {
    const std::string name = type ? type->name : std::string();
    return def.empty() ? name : fmt::format("{} {}", name, def);
}

const FieldDef& OpenNode::field(FieldIndex index) const {
    return index < type->fields.size() ? type->fields[index] : own[index - type->fields.size()];
}

// ---- State -----------------------------------------------------------------------------------------------------

SceneBuilder::State::State(SceneBuilder& builder, Scene& target, Diagnostics& sink, BuildOptions buildOptions)
    : handler(builder),
      scene(target),
      diagnostics(sink),
      options(std::move(buildOptions)),
      time{options.resources ? options.resources->policy().maximumSeconds : ResourcePolicy().maximumSeconds} {
    registerDocuments(scene);
    dialect = dialectOf(scene);
    DocumentSource source;
    std::error_code ignored;
    if (isWebAddress(options.file.native()))
        source.path = options.file;
    else if (!options.file.empty())
        source.path = std::filesystem::weakly_canonical(options.file, ignored);
    if (!options.resources) options.resources = options.file.empty() ? Resources() : Resources::ofFile(options.file);
    source.base = options.resources->folder();
    source.file = sink.file();
    NameScope& document = pushScope(options.scope, session.newEnvironment(), session.keep(std::move(source)));
    document.isDocument = true;
    push(OpenNode::Kind::body, {});
}

void SceneBuilder::State::error(SourceLocation where, std::string text) {
    if (!scope().quiet) diagnostics.error(where, std::move(text));
}

void SceneBuilder::State::warning(SourceLocation where, std::string text) {
    if (!scope().quiet) diagnostics.warning(where, std::move(text));
}

/// For messages about it while it runs.
void SceneBuilder::State::rememberLocation(const OpenNode& node) {
    if (isTrial || node.where.line == 0) return;
    const DocumentSource* source = scope().source;
    scene.setLocation(node.id, {source && !source->file.empty() ? source->file : diagnostics.file(), node.where});
}

OpenNode& SceneBuilder::State::push(OpenNode::Kind kind, SourceLocation where) {
    if (openCount == open.size()) open.emplace_back();
    OpenNode& node = open[openCount++];
    node.kind = kind;
    node.id = {};
    node.typeIndex = {};
    node.type = nullptr;
    node.proto = nullptr;
    node.parentField = kNoField;
    node.def.clear();
    node.where = where;
    node.children.clear();
    node.given.clear();
    node.connections.clear();
    node.values.clear();
    node.forgetOwn();
    node.forgetLists();
    return node;
}

void SceneBuilder::State::pop() {
    --openCount;
}

NameScope& SceneBuilder::State::pushScope(NodeId owner, Environment* environment, const DocumentSource* source) {
    auto fresh = std::make_unique<NameScope>();
    fresh->owner = owner;
    fresh->environment = environment;
    fresh->source = source;
    fresh->openBase = openCount;
    fresh->previousFile = diagnostics.file();
    diagnostics.setFile(source->file);
    scopes.push_back(std::move(fresh));
    return *scopes.back();
}

void SceneBuilder::State::popScope() {
    diagnostics.setFile(scopes.back()->previousFile);
    scopes.pop_back();
}

std::pair<TypeIndex, const NodeType*> SceneBuilder::State::findBuiltin(std::string_view name) {
    if (const auto found = builtin.find(name); found != builtin.end()) return found->second;
    std::pair<TypeIndex, const NodeType*> result{{}, nullptr};
    if (const auto index = scene.findType(name)) {
        const NodeType& type = scene.type(*index);
        const bool fromTables = type.kind == NodeType::Kind::builtin || type.kind == NodeType::Kind::user;
        if (fromTables && !type.internal) result = {*index, &type};
    } else if (const auto own = dialect ? dialect->findType(name) : nullptr) {
        // The scene learns a type of a table with the first node of it, so that unused types are not sent to mirrors.
        if (const auto defined = scene.defineType(own))
            result = {*defined, own.get()};
        else
            diagnostics.error({}, defined.error().text);
    }
    builtin.emplace(std::string(name), result);
    return result;
}

const NodeType* SceneBuilder::State::effectiveType(NodeId id) const {
    // 4.4.4.3: an instance counts as the first node of its body; bodies nest, but never endlessly.
    const Node* node = scene.find(id);
    while (node && (node->type().kind == NodeType::Kind::proto || node->type().kind == NodeType::Kind::externProto)) {
        const auto& body = *static_cast<const Array<NodeId>*>(node->storage(node->type().body()));
        node = body.empty() ? nullptr : scene.find(body[0]);
    }
    return node ? &node->type() : nullptr;
}

namespace {

bool acceptsType(const FieldDef& def, const NodeType* child) {
    if (sf(def.type) != FieldType::SFNode || !def.readable()) return false;
    if (!child || def.accepts.empty()) return true;
    return std::ranges::any_of(def.accepts, [&](const std::string& one) { return child->isA(one); });
}

}  // namespace

/// Opens a node of unknown type: its content is built, with names, but belongs to no field of it.
void SceneBuilder::State::openUnknown(std::string_view type, std::string_view def, SourceLocation where) {
    warning(where, detail::unknownType(type, diagnostics));
    if (!def.empty()) scope().names.insert_or_assign(std::string(def), kOfUnknownType);
    push(OpenNode::Kind::unknown, where);
}

/// The field of `parent` that a child goes into; kNoField after a diagnostic.
FieldIndex SceneBuilder::State::fieldFor(OpenNode& parent, std::string_view field, const NodeType* child,
                                         std::string_view childName, SourceLocation where) {
    if (parent.kind == OpenNode::Kind::body) return 0;
    if (parent.kind == OpenNode::Kind::unknown) return kNoField;
    const bool byDefault = field.empty();
    if (byDefault) field = child ? std::string_view(child->containerField) : "children";
    FieldIndex index = parent.find(field);
    if (index == kNoField || !acceptsType(parent.field(index), child)) {
        const bool exists = index != kNoField;
        // XML files often omit containerField. Then the field that takes the node is meant, if there is only one.
        FieldIndex other = kNoField;
        std::size_t candidates = 0;
        for (const FieldIndex i : parent.type->nodeFields()) {
            const FieldDef& def = parent.type->fields[i];
            if (def.hidden || !child || def.accepts.empty() || def.access == Access::outputOnly) continue;
            if (acceptsType(def, child)) other = i, ++candidates;
        }
        if (candidates != 1 || (!byDefault && (exists || (field != "children" && !isMF(parent.field(other).type))))) {
            // The readers say the same at the same place, which counts once.
            if (exists && sf(parent.field(index).type) != FieldType::SFNode)
                error(where, fmt::format("field '{}' of {} takes no nodes", field, parent.describe()));
            else
                warning(where, detail::misplaced(childName, field, parent.type->name));
            return kNoField;
        }
        if (!byDefault)
            warning(where, fmt::format("{} goes into field '{}' of {}, not '{}'", childName, parent.field(other).name,
                                       parent.describe(), field));
        index = other;
    }
    const FieldDef& def = parent.field(index);
    if (def.access == Access::inputOnly || def.access == Access::outputOnly) {
        error(where, fmt::format("field '{}' of {} is {} and cannot be given a node here", def.name, parent.describe(),
                                 accessName(def.access)));
        return kNoField;
    }
    if (def.type == FieldType::SFNode && !parent.list(index).empty()) {
        warning(where, detail::surplus(def.name, parent.type->name));
        return kNoField;
    }
    return index;
}

void SceneBuilder::State::nameNode(const OpenNode& node) {
    if (node.def.empty()) return;
    const auto [entry, isNew] = scope().names.try_emplace(node.def, node.id ? node.id : kSelf);
    if (!isNew) {
        if (entry->second != kSelf)
            warning(node.where, fmt::format("DEF '{}' is used twice; from here it means this one", node.def));
        entry->second = node.id ? node.id : kSelf;
    }
    if (node.id) giveName(node.id, node.def, node.where);
}

void SceneBuilder::State::giveName(NodeId id, const std::string& name, SourceLocation where) {
    if (options.detached) {
        const NodeId holder = scene.findName(name, scene.node(id).scope());
        if (holder && !named.contains(holder.value)) return;
        named.insert(id.value);
    }
    if (auto ok = scene.setName(id, name); !ok) error(where, ok.error().text);
}

void SceneBuilder::State::attach(OpenNode& parent, FieldIndex field, NodeId child) {
    parent.list(field).push_back(child);
    if (parent.kind != OpenNode::Kind::body) parent.markGiven(field);
}

/// Which children of a CADLayer show (X3D 3.1 to 3.3): those that do not are put below a Group that is not visible.
void SceneBuilder::State::hideChildren(OpenNode& node) {
    if (node.values.empty()) return;
    const auto shown = node.values.back().second.as<Array<bool>>();  // if a field is given twice, the last value counts
    node.values.clear();
    std::vector<NodeId>& children = node.list(x3d::CADLayer::children.index);
    for (std::size_t i = 0; i < std::min(shown.size(), children.size()); ++i) {
        if (shown[i] || !hasRoomFor(scope(), node.where)) continue;
        const NodeId hidden = scene.createNode(x3d::Group::type, scope().owner);
        if (!hidden) return error(node.where, "no node could be created here");
        setHidden(scene, hidden, x3d::Group::visible.index, Value(false));
        const auto put = scene.set(hidden, x3d::Group::children, Array<NodeId>{children[i]});
        if (!put) return error(node.where, fmt::format("{}.children: {}", node.describe(), put.error().text));
        children[i] = hidden;
    }
}

void SceneBuilder::State::storeChildren(OpenNode& node) {
    for (const ChildList& one : node.children) {
        if (one.nodes.empty()) continue;
        const FieldDef& def = node.field(one.field);
        Value value = def.type == FieldType::SFNode ? Value(one.nodes.front())
                                                    : Value(Array<NodeId>(std::span<const NodeId>(one.nodes)));
        const auto report = [&](const Diagnostic& why) {
            error(node.where, fmt::format("{}.{}: {}", node.describe(), def.name, why.text));
        };
        const auto stored = scene.setField(node.id, one.field, std::move(value));
        if (stored) continue;
        if (def.type == FieldType::SFNode) {
            report(stored.error());
            continue;
        }
        // The other nodes of a list stay.
        for (const NodeId child : one.nodes)
            if (const auto added = scene.insertChild(node.id, one.field, child); !added) report(added.error());
    }
}

void SceneBuilder::State::normalise(Value& value) {
    if (value.holds<Rotation>()) {
        Rotation rotation = value.as<Rotation>();
        if (normaliseAxis(rotation)) value = Value(rotation);
    } else if (value.holds<Array<Rotation>>()) {
        Array<Rotation> rotations = value.as<Array<Rotation>>();
        bool changed = false;
        for (std::size_t i = 0; i < rotations.size(); ++i) {
            Rotation rotation = rotations[i];
            if (!normaliseAxis(rotation)) continue;
            rotations.mutableData()[i] = rotation;
            changed = true;
        }
        if (changed) value = Value(std::move(rotations));
    }
}

void SceneBuilder::State::store(OpenNode& node, FieldIndex field, Value value, SourceLocation where) {
    if (node.kind == OpenNode::Kind::script) {
        node.values.emplace_back(field, std::move(value));
    } else if (auto stored = scene.setField(node.id, field, std::move(value)); !stored) {
        error(where, fmt::format("{}: {}", node.describe(), stored.error().text));
    }
}

void SceneBuilder::State::closeOpenNodes() {
    while (top() && top()->kind != OpenNode::Kind::body) handler.endNode(top()->where);
}

void SceneBuilder::State::endScript(OpenNode& node) {
    // Scripts with the same interface share a type, so that a thousand instances of a PROTO define one.
    if (!node.own.empty()) {
        std::string key = node.type->name;
        for (const FieldDef& field : node.own)
            key += fmt::format("\n{} {} {}", accessName(field.access), field.typeName(), field.name);
        if (scriptTypes.empty())
            for (std::size_t i = 0; i < scene.typeCount(); ++i) {
                const TypeIndex index{static_cast<std::uint16_t>(i)};
                const NodeType& known = scene.type(index);
                if (known.kind == NodeType::Kind::script) scriptTypes.emplace(known.declaration, index);
            }
        const auto found = scriptTypes.find(key);
        if (found != scriptTypes.end()) {
            node.typeIndex = found->second;
        } else {
            auto type = std::make_shared<NodeType>();
            type->name = node.type->name;
            type->component = node.type->component;
            type->level = node.type->level;
            type->kind = NodeType::Kind::script;
            type->containerField = node.type->containerField;
            type->implements = node.type->implements;
            type->declaration = key;
            for (const FieldDef& field : node.type->fields) type->fields.push_back(field);
            for (const FieldDef& field : node.own) type->fields.push_back(field);
            // Hidden fields stay last, as in every type; our indices follow the order of appearance until here.
            std::ranges::stable_partition(type->fields, [](const FieldDef& field) { return !field.hidden; });
            if (!type->finish()) {
                error(node.where, fmt::format("{} declares a field twice or too many of them", node.describe()));
                return;
            }
            const auto defined = scene.defineType(type);
            if (!defined) {
                error(node.where, defined.error().text);
                return;
            }
            scriptTypes.emplace(std::move(key), *defined);
            node.typeIndex = *defined;
        }
    }
    node.id = scene.createNode(node.typeIndex, scope().owner);
    if (!node.id) {
        error(node.where, "no node could be created here");
        return;
    }
    rememberLocation(node);
    const NodeType* base = node.type;
    node.type = &scene.type(node.typeIndex);
    // From the indices used while reading to those of the finished type.
    const auto finalIndex = [&](FieldIndex index) {
        return index < base->fields.size() ? node.type->findExact(base->fields[index].name)
                                           : node.type->findExact(node.own[index - base->fields.size()].name);
    };
    for (ChildList& one : node.children) {
        one.field = finalIndex(one.field);
        for (NodeId& child : one.nodes)
            if (child == kSelf) child = node.id;
    }
    node.forgetLists();
    std::vector<bool> given(node.type->fields.size());
    for (std::size_t i = 0; i < node.given.size(); ++i)
        if (node.given[i]) given[finalIndex(static_cast<FieldIndex>(i))] = true;
    node.given = std::move(given);
    node.kind = OpenNode::Kind::node;
    auto values = std::move(node.values);
    for (auto& [field, value] : values) store(node, finalIndex(field), std::move(value), node.where);
    node.forgetOwn();
    if (!node.def.empty()) {
        scope().names[node.def] = node.id;
        giveName(node.id, node.def, node.where);
    }
}

}  // namespace rtsg
