// The document's own commands: header, prototypes, names, and what is checked at the end. Nodes are in
// scene_builder_nodes.cpp.
#include <rtsg/documents/scene_builder.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/x3d.h>

#include "builder_state.h"
#include "media/font_reports.h"

namespace rtsg {

SceneBuilder::SceneBuilder(Scene& scene, Diagnostics& diagnostics, BuildOptions options)
    : state_(std::make_unique<State>(*this, scene, diagnostics, std::move(options))) {}
SceneBuilder::~SceneBuilder() = default;

const std::vector<NodeId>& SceneBuilder::roots() const {
    return state_->roots;
}

const DocumentHead& SceneBuilder::head() const {
    return state_->head;
}

std::vector<std::pair<std::string, NodeId>> SceneBuilder::names() const {
    std::vector<std::pair<std::string, NodeId>> result;
    for (const auto& [name, id] : state_->scopes.front()->names)
        if (state_->scene.find(id)) result.emplace_back(name, id);
    std::ranges::sort(result);
    return result;
}

void SceneBuilder::beginDocument(const DocumentHeader& header) {
    if (state_->documentDepth++ == 0 && state_->scopes.size() == 1) state_->head.profile = header.profile;
}

void SceneBuilder::endDocument() {
    State& s = *state_;
    if (s.documentDepth > 0) --s.documentDepth;
    if (s.documentDepth == 0 && s.scopes.size() == 1) finish();
}

void SceneBuilder::finish() {
    State& s = *state_;
    if (s.finished) return;
    if (s.recording) {
        s.error(s.recording->where, fmt::format("PROTO {} is never closed", s.recording->name));
        s.recording.reset();
    }
    s.skipDepth = s.skipProtoDepth = 0;
    s.closeOpenNodes();
    s.finished = true;
    NameScope& document = s.scope();
    if (!document.declarationsOnly) {
        if (!s.open[0].children.empty()) s.roots = std::move(s.open[0].children.front().nodes);
        const NodeId root = s.scene.root();
        const FieldIndex children = s.scene.node(root).type().findExact("children");
        Array<NodeId> all = *static_cast<const Array<NodeId>*>(s.scene.node(root).storage(children));
        for (const NodeId id : s.roots) all.push_back(id);
        if (!s.roots.empty() && !s.options.detached)
            if (auto stored = s.scene.setField(root, children, Value(std::move(all))); !stored)
                s.error({}, stored.error().text);
        if (!s.options.detached) appendHead(s.scene, s.head);
        s.finishScope(document);
        if (s.linksFonts) linkFontStyles(s.scene);
        s.checkUnusedProtos();
    }
}

void SceneBuilder::component(std::string_view name, int level, SourceLocation) {
    if (state_->scopes.size() > 1) return;  // an Inline's own
    state_->head.components.push_back({std::string(name), level});
}

void SceneBuilder::meta(std::string_view name, std::string_view content, SourceLocation) {
    if (state_->scopes.size() > 1) return;
    state_->head.meta.push_back({std::string(name), std::string(content)});
}

void SceneBuilder::unit(std::string_view category, std::string_view name, double conversionFactor, SourceLocation) {
    if (state_->scopes.size() > 1) return;
    state_->head.units.push_back({std::string(category), std::string(name), conversionFactor});
}

void SceneBuilder::State::lookAtLimits(SourceLocation where) {
    if (time.isOver()) {
        isOver = true;
        diagnostics.error(where, time.text());
    } else if (auto ok = mayHold(); !ok) {
        isOver = true;
        diagnostics.error(where, "the rest of the nodes is left out: " + ok.error().text, ok.error().code);
    }
}

void SceneBuilder::State::noteWork(SourceLocation where) {
    constexpr std::uint64_t kPerClock = 16, kPerMemory = 1024;
    lastWhere = where;
    if (++commands % kPerClock != 0 || isOver) return;
    if (commands % kPerMemory == 0 || time.isOver()) lookAtLimits(where);
}

std::uint64_t SceneBuilder::State::nodesLeft() const {
    const std::uint64_t maximum = options.resources->policy().maximumNodes;
    return maximum - std::min(expandedNodes, maximum);
}

bool SceneBuilder::State::hasRoomFor(const NameScope& scope, SourceLocation where) {
    const std::uint64_t maximum = options.resources->policy().maximumNodes;
    if (isOver) return false;
    if ((!scope.proto && !scope.owner && !options.namedByUrl) || ++expandedNodes <= maximum) return true;
    if (expandedNodes == maximum + 1) diagnostics.error(where, tooManyNodes(maximum));
    return false;
}

bool SceneBuilder::isFull() const {
    State& s = *state_;
    if (!s.isOver && s.time.isOver()) s.lookAtLimits(s.lastWhere);
    return s.isOver || (s.options.namedByUrl && s.expandedNodes > s.options.resources->policy().maximumNodes);
}

std::string tooManyNodes(std::uint64_t maximum) {
    return fmt::format(
        "PROTO instances and Inlines make more than {} nodes; the rest is left out, unless --limit nodes=N raises this",
        maximum);
}

std::string whyFull(const CommandList& commands, const ResourcePolicy& policy) {
    if (commands.hasTooManyNodes()) return tooManyNodes(policy.maximumNodes);
    return fmt::format(
        "what is read takes more than {} bytes; the rest is left out, unless --limit bytes=N raises this",
        policy.maximumBytes);
}

void SceneBuilder::beginNode(std::string_view type, std::string_view def, std::string_view field,
                             SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth) return;
    if (s.skipDepth) {
        ++s.skipDepth;
        return;
    }
    if (s.isRecording()) {
        if (s.recordingOpen == "i") s.chooseDefault(field, where);
        s.recordingOpen += 'n';
        return s.recorder().beginNode(type, def, field, where);
    }
    NameScope& scope = s.scope();
    if (scope.declarationsOnly || !s.top()) {
        ++s.skipDepth;
        return;
    }
    if (!s.hasRoomFor(scope, where)) {
        ++s.skipDepth;
        return;
    }
    auto [index, known] = s.findBuiltin(type);
    ProtoDeclaration* proto = nullptr;
    if (!known) {
        proto = scope.environment->find(type);
        if (!proto) {
            const bool inItself =
                std::ranges::any_of(s.scopes, [&](const auto& one) { return one->proto && one->proto->name == type; });
            if (!inItself) return s.openUnknown(type, def, where);
            s.error(where, fmt::format("PROTO {} contains itself", type));
            ++s.skipDepth;
            return;
        }
        if (proto->external) s.resolveExternal(*proto);
        index = proto->type;
        known = &s.scene.type(index);
    }
    const FieldIndex fieldIndex = s.fieldFor(*s.top(), field, proto ? proto->primary : known, type, where);
    const bool isScript = !proto && (known->isA("X3DScriptNode") || known->isA("X3DProgrammableShaderObject"));
    OpenNode& node = s.push(proto      ? OpenNode::Kind::instance
                            : isScript ? OpenNode::Kind::script
                                       : OpenNode::Kind::node,
                            where);
    node.typeIndex = index;
    node.type = known;
    node.proto = proto;
    node.parentField = fieldIndex;
    node.def = def;
    if (!isScript) {
        node.id = s.scene.createNode(index, scope.owner);
        if (!node.id) {
            s.error(where, "no node could be created here");
            s.pop();
            ++s.skipDepth;
            return;
        }
        s.rememberLocation(node);
    }
    s.nameNode(node);
}

void SceneBuilder::endNode(SourceLocation where) {
    State& s = *state_;
    if (s.skipProtoDepth) return;
    if (s.skipDepth) {
        --s.skipDepth;
        return;
    }
    if (s.isRecording()) {
        if (s.recordingOpen.back() != 'n') return;
        s.recordingOpen.pop_back();
        return s.recorder().endNode(where);
    }
    if (!s.top() || s.top()->kind == OpenNode::Kind::body) return;
    if (s.top()->kind == OpenNode::Kind::unknown) return s.pop();
    if (s.top()->kind == OpenNode::Kind::script) s.endScript(*s.top());
    OpenNode& node = *s.top();
    if (!node.id) {
        s.pop();
        return;
    }
    s.connectInterface(node);
    const std::size_t position = s.openCount - 1;
    if (node.kind == OpenNode::Kind::instance) s.expand(node);  // may reallocate `open`
    OpenNode& done = s.open[position];
    if (done.typeIndex == x3d::CADLayer::type) s.hideChildren(done);
    if (done.kind != OpenNode::Kind::instance) s.storeChildren(done);
    if (done.typeIndex == x3d::Inline::type || done.typeIndex == x3d::InlineGeometry::type)
        s.scope().inlines.emplace_back(done.id, done.where);
    else if (s.scene.node(done.id).is(x3d::GeoLOD::type))
        s.addTiles(done.id, done.where);
    else if (done.typeIndex == x3d::FontLibrary::type)
        s.scope().fontLibraries.emplace_back(done.id, done.where), s.linksFonts = true;
    const NodeId id = done.id;
    s.reportOfNoEffect(id, done.where);
    s.reportOfOddValues(id, done.where);
    const FieldIndex field = done.parentField;
    s.pop();
    if (field != kNoField) s.attach(*s.top(), field, id);
}

void SceneBuilder::useNode(std::string_view def, std::string_view field, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen == "i") s.chooseDefault(field, where);
        return s.recorder().useNode(def, field, where);
    }
    NameScope& scope = s.scope();
    OpenNode* parent = s.top();
    if (scope.declarationsOnly || !parent) return;
    const auto found = scope.names.find(def);
    if (found == scope.names.end()) {
        s.error(where, fmt::format("USE '{}': no node has that name before this point", def));
        return;
    }
    const NodeId id = found->second;
    if (id == kOfUnknownType || parent->kind == OpenNode::Kind::unknown) return;
    // Scripts and PROTO instances may refer to anything, themselves included; a child may not be its own ancestor. The
    // use of it in a PROTO's body is checked there.
    const bool reports = parent->kind == OpenNode::Kind::script || parent->kind == OpenNode::Kind::instance;
    for (std::size_t i = scope.openBase; i < s.openCount; ++i) {
        const OpenNode& above = s.open[i];
        if (above.kind == OpenNode::Kind::body || above.def != def || (above.id ? above.id : kSelf) != id) continue;
        if (reports && (above.id || i + 1 == s.openCount)) continue;
        s.error(where, fmt::format("USE '{}' inside '{}' itself: a node cannot contain itself", def, def));
        return;
    }
    const NodeType* type = id == kSelf ? parent->type : s.effectiveType(id);
    const FieldIndex fieldIndex = s.fieldFor(*parent, field, type, fmt::format("USE {}", def), where);
    if (fieldIndex != kNoField) s.attach(*parent, fieldIndex, id);
}

void SceneBuilder::setField(std::string_view name, Value value, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen.back() == 'n') s.recorder().setField(name, std::move(value), where);
        return;
    }
    OpenNode* node = s.top();
    if (!node || node->kind == OpenNode::Kind::body || node->kind == OpenNode::Kind::unknown) return;
    const FieldIndex field = node->find(name);
    if (field == kNoField) {
        s.error(where, fmt::format("{} has no field '{}'", node->describe(), name));
        return;
    }
    const FieldDef& def = node->field(field);
    const bool isOfChildren = node->typeIndex == x3d::CADLayer::type && field == x3d::CADLayer::visible.index &&
                              value.type() == FieldType::MFBool;  // as before X3D 4.0
    if (def.access == Access::inputOnly || def.access == Access::outputOnly) {
        s.error(where, fmt::format("{}.{} is {} and cannot be given a value", node->describe(), def.name,
                                   accessName(def.access)));
        return;
    }
    if (!def.holds(value) && !isOfChildren) {
        s.error(where,
                fmt::format("{}.{} is {}, not {}", node->describe(), def.name, def.typeName(), typeNameOf(value)));
        return;
    }
    if (node->isGiven(field))
        s.warning(where, fmt::format("{}.{} is given twice; the last counts", node->describe(), def.name));
    node->markGiven(field);
    if (sf(def.type) == FieldType::SFNode) {
        // NULL or []: a PROTO instance overrides its default with it. Nodes come as beginNode and useNode.
        node->list(field).clear();
        return;
    }
    if (isOfChildren) return void(node->values.emplace_back(field, std::move(value)));
    s.normalise(value);
    s.store(*node, field, std::move(value), where);
}

void SceneBuilder::declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen != "i") {
            if (s.recordingOpen.back() != 'b') s.recorder().declareField(field, std::move(value), where);
            return;
        }
        if (s.recording->findField(field.name)) {
            s.error(where, fmt::format("PROTO {} declares field '{}' twice", s.recording->name, field.name));
            return;
        }
        if (s.recording->fields.size() == kMaxFields)
            return s.error(where, fmt::format("PROTO {} declares more than {} fields", s.recording->name, kMaxFields));
        if (value && !isOfType(*value, field.type, field.custom.get())) {
            s.error(where, fmt::format("field '{}' is {}, its default {}", field.name,
                                       fieldTypeName(field.type, field.custom.get()), typeNameOf(*value)));
            value.reset();
        }
        s.recording->fields.push_back({field, std::move(value), {}, where});
        return;
    }
    OpenNode* node = s.top();
    if (node && node->kind == OpenNode::Kind::unknown) return;
    if (!node || node->kind != OpenNode::Kind::script) {
        s.error(where, fmt::format("field '{}' cannot be declared here", field.name));
        return;
    }
    if (node->type->findExact(field.name) != kNoField || node->findOwn(field.name) < node->own.size()) {
        s.error(where, fmt::format("{} has a field '{}' already", node->describe(), field.name));
        return;
    }
    if (node->own.size() == kMaxFields)
        return s.error(where, fmt::format("{} declares more than {} fields", node->describe(), kMaxFields));
    FieldDef& def = node->own.emplace_back();
    def.name = field.name;
    def.type = field.type;
    def.custom = field.custom;
    def.access = field.access;
    if (!value || sf(field.type) == FieldType::SFNode) return;
    const auto index = static_cast<FieldIndex>(node->type->fields.size() + node->own.size() - 1);
    if (!def.holds(*value)) {
        s.error(where, fmt::format("field '{}' is {}, its value {}", field.name, def.typeName(), typeNameOf(*value)));
        return;
    }
    s.normalise(*value);
    s.store(*node, index, *std::move(value), where);
}

void SceneBuilder::isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipProtoDepth || s.skipDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen.back() == 'n') s.recorder().isConnection(nodeField, protoField, where);
        return;
    }
    OpenNode* node = s.top();
    if (!node || node->kind == OpenNode::Kind::body || node->kind == OpenNode::Kind::unknown) return;
    if (!s.scope().proto) {
        s.error(where, fmt::format("'{} IS {}' outside a PROTO", nodeField, protoField));
        return;
    }
    node->connections.push_back({std::string(nodeField), std::string(protoField), where});
}

}  // namespace rtsg
