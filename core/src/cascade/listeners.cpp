// Listeners: collects from each set the events that somebody listens to, and calls listeners after the set was read.
#include <rtsg/core/listeners.h>

#include <algorithm>
#include <exception>
#include <map>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "state/state.h"

namespace rtsg {

// ---- the scene's records for them ------------------------------------------------------------------------------

Result<> Scene::listenTo(NodeId id, FieldIndex field) {
    State& s = *state_;
    if (auto ok = s.checkThread(); !ok) return ok;
    Node* node = s.find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    if (field >= node->type_->fields.size())
        return fail(kNoSuchField, fmt::format("{} has no field {}", node->type_->name, field));
    const FieldDef& def = node->type_->fields[field];
    if (def.hidden || !def.sends())
        return fail(kWrongAccess, fmt::format("{}.{} sends no events", node->type_->name, def.name));
    ++s.linkEdits;
    ++s.makeGroup(*node, field).listeners;
    return {};
}

void Scene::stopListening(NodeId id, FieldIndex field) {
    State& s = *state_;
    Node* node = s.refuseForeign() ? nullptr : s.find(id);
    RouteGroup* const group = node ? s.groupOf(*node, field) : nullptr;
    if (!group || group->listeners == 0) return;
    ++s.linkEdits;
    if (--group->listeners == 0 && group->targets.empty()) s.eraseGroup(*node, group);
    s.trimLinks(*node);
}

bool Scene::isHeard(NodeId id, FieldIndex field) const {
    Node* node = state_->find(id);
    return node && state_->groupOf(*node, field);
}

std::uint64_t Scene::hearingEdits() const {
    return state_->linkEdits;
}

std::vector<bool> Scene::areInWorld(std::span<const NodeId> ids) const {
    // Goes upwards, depth first, and visits each node once; the hierarchy has no cycles.
    const State& s = *state_;
    std::unordered_map<std::uint32_t, bool> known{{root().value, true}};
    std::vector<bool> result;
    struct Step {
        NodeId node;
        bool parentsKnown = false;
    };
    std::vector<Step> path;
    std::vector<NodeId> above;
    for (const NodeId id : ids) {
        path.assign(1, Step{id});
        while (!path.empty()) {
            Step& step = path.back();
            const NodeId at = step.node;
            if (!step.parentsKnown && !known.try_emplace(at.value, false).second) {
                path.pop_back();
                continue;
            }
            above.clear();
            for (const ParentRef& p : parents(at))
                if (s.isHierarchy(*s.find(p.node), p.field)) above.push_back(p.node);
            if (std::exchange(step.parentsKnown, true)) {
                known[at.value] = std::ranges::any_of(above, [&](NodeId one) { return known.at(one.value); });
                path.pop_back();
                continue;
            }
            for (const NodeId one : above) path.push_back({one});
        }
        result.push_back(known.at(id.value));
    }
    return result;
}

// ---- Listeners -----------------------------------------------------------------------------------------------------

struct Listeners::State final : Subscriber {
    /// One function that listens. It may end while it waits to be called, or is called.
    struct Ear {
        ListenerId id{};
        NodeId node;
        FieldIndex field = kNoField;
        OnField onField;
        OnNode onNode;
        std::function<void()> onWorld;
        bool inWorld = false, ended = false;
    };
    using EarPtr = std::shared_ptr<Ear>;
    /// A call to a listener that is due once the whole set has been looked at.
    struct Call {
        EarPtr ear;
        FieldEvent field;
        NodeEvent node;
    };

    explicit State(Scene& listened) : scene(listened) {}
    std::string subscriberName() const override { return "listeners"; }
    Result<> apply(const Scene&, const ChangeSet& set) override;

    void add(const EarPtr& ear);
    void gatherFields(const ChangeSet& set, std::vector<Call>& calls) const;
    void gatherNodes(const ChangeSet& set, std::vector<Call>& calls) const;
    void gatherMoves(const ChangeSet& set, std::vector<Call>& calls);
    void gatherAnew(const ChangeSet& set, std::vector<Call>& calls);
    bool isHeard(NodeId id) const { return id.value < heard.size() && heard[id.value]; }
    void call(const Call& one, double time);
    void end(ListenerId listener);

    Scene& scene;
    Attachment attachment;
    std::uint32_t last = 0;
    bool joined = false;        // the first snapshot says nothing new
    std::uint64_t reached = 0;  // the state that the set before led to
    std::map<ListenerId, EarPtr> ears;
    std::unordered_map<std::uint32_t, std::vector<EarPtr>> byNode;
    std::vector<bool> heard;  // by node: whether any ear listens to it
    std::size_t nodeEars = 0;
};

void Listeners::State::add(const EarPtr& ear) {
    ear->id = ListenerId{++last};
    ears.emplace(ear->id, ear);
    if (!ear->node) return;
    byNode[ear->node.value].push_back(ear);
    if (heard.size() <= ear->node.value) heard.resize(std::size_t{ear->node.value} + 1);
    heard[ear->node.value] = true;
    nodeEars += ear->onNode ? 1 : 0;
}

namespace {

/// A field that has another value after this change; nothing for other kinds.
std::optional<FieldIndex> changedField(const Scene& scene, const Change& change) {
    const bool any = change.kind == ChangeKind::setField || change.kind == ChangeKind::insertChild ||
                     change.kind == ChangeKind::removeChild;
    const Node* node = any ? scene.find(change.node) : nullptr;
    if (!node || node->type().fields[change.field].hidden) return std::nullopt;
    return change.field;
}

/// Whether ways from the root to nodes may be others after it.
bool isStructural(const Scene& scene, const Change& change) {
    if (change.kind != ChangeKind::setField)
        return change.kind == ChangeKind::insertChild || change.kind == ChangeKind::removeChild ||
               change.kind == ChangeKind::destroyNode;
    const Node* node = scene.find(change.node);
    return node && sf(node->type().fields[change.field].type) == FieldType::SFNode;
}

using NodeField = std::pair<NodeId, FieldIndex>;

}  // namespace

/// Events first, in their order; then fields that changed without one.
void Listeners::State::gatherFields(const ChangeSet& set, std::vector<Call>& calls) const {
    std::set<NodeField> reported;
    const auto report = [&](const FieldEvent& event) {
        for (const EarPtr& ear : byNode.at(event.node.value))
            if (ear->onField && ear->field == event.field) calls.push_back({ear, event, {}});
    };
    if (set.heard)
        for (const FieldEvent& event : *set.heard) {
            if (!isHeard(event.node)) continue;  // another one listens there
            reported.emplace(event.node, event.field);
            report(event);
        }
    for (const Change& change : set.changes) {
        if (!isHeard(change.node)) continue;
        const auto field = changedField(scene, change);
        if (!field || !reported.emplace(change.node, *field).second) continue;
        const Node& node = scene.node(change.node);
        if (node.type().fields[*field].readable()) report({change.node, *field, node.value(*field)});
    }
}

void Listeners::State::gatherNodes(const ChangeSet& set, std::vector<Call>& calls) const {
    std::set<NodeField> reported;
    for (const Change& change : set.changes) {
        if (!isHeard(change.node)) continue;
        const auto field = changedField(scene, change);
        if (!field || !reported.emplace(change.node, *field).second) continue;
        for (const EarPtr& ear : byNode.at(change.node.value))
            if (ear->onNode) calls.push_back({ear, {}, {NodeEvent::Kind::changed, change.node, *field, set.time}});
    }
}

/// Gathers nodes that have come into the world, left it, or been destroyed.
void Listeners::State::gatherMoves(const ChangeSet& set, std::vector<Call>& calls) {
    std::vector<EarPtr> asked;
    std::vector<NodeId> ids;
    for (const auto& [id, ear] : ears)
        if (ear->onNode) asked.push_back(ear), ids.push_back(ear->node);
    const std::vector<bool> inWorld = scene.areInWorld(ids);
    for (std::size_t i = 0; i < asked.size(); ++i) {
        const EarPtr& ear = asked[i];
        const auto report = [&](NodeEvent::Kind kind) {
            calls.push_back({ear, {}, {kind, ear->node, kNoField, set.time}});
        };
        if (ear->inWorld != inWorld[i]) report(inWorld[i] ? NodeEvent::Kind::entered : NodeEvent::Kind::left);
        ear->inWorld = inWorld[i];
        if (!scene.find(ear->node)) report(NodeEvent::Kind::destroyed);
    }
}

/// A replica has joined anew: all fields with listeners may have other values, and the scene has forgotten the
/// listeners.
void Listeners::State::gatherAnew(const ChangeSet& set, std::vector<Call>& calls) {
    for (const auto& [id, ear] : ears) {
        const Node* node = scene.find(ear->node);
        if (ear->onWorld) calls.push_back({ear, {}, {}});
        if (!node || !ear->onField || !scene.listenTo(ear->node, ear->field)) continue;
        calls.push_back({ear, {ear->node, ear->field, node->value(ear->field)}, {}});
    }
    gatherMoves(set, calls);
}

void Listeners::State::call(const Call& one, double time) {
    Ear& ear = *one.ear;
    if (ear.ended) return;
    try {
        if (ear.onField) ear.onField(one.field, time);
        if (ear.onNode) ear.onNode(one.node);
        if (ear.onWorld) ear.onWorld();
    } catch (const std::exception& e) {
        scene.diagnostics().error({}, fmt::format("a listener failed, and hears no more: {}", e.what()));
        end(ear.id);
    }
}

Result<> Listeners::State::apply(const Scene&, const ChangeSet& set) {
    const std::uint64_t before = std::exchange(reached, set.to);
    if (!std::exchange(joined, true)) return {};
    std::vector<Call> calls;
    // The first set of a scene that was empty starts at 0 as well.
    if (set.isSnapshot() && before > 0) {
        gatherAnew(set, calls);
    } else {
        if (!byNode.empty()) gatherFields(set, calls);
        if (nodeEars > 0) gatherNodes(set, calls);
        const auto structural = [&](const Change& change) { return isStructural(scene, change); };
        if (nodeEars > 0 && std::ranges::any_of(set.changes, structural)) gatherMoves(set, calls);
        const auto another = [&](const Change& c) {
            return c.node == scene.root() && c.field == x3d::RtsgScene::_world.index && c.kind == ChangeKind::setField;
        };
        if (std::ranges::any_of(set.changes, another))
            for (const auto& [id, ear] : ears)
                if (ear->onWorld) calls.push_back({ear, {}, {}});
    }
    for (const Call& one : calls) call(one, set.time);
    // Destroyed nodes send nothing more.
    for (const Change& change : set.changes)
        if (change.kind == ChangeKind::destroyNode && isHeard(change.node))
            for (const EarPtr& ear : std::vector<EarPtr>(byNode.at(change.node.value))) end(ear->id);
    return {};
}

void Listeners::State::end(ListenerId listener) {
    const auto found = ears.find(listener);
    if (found == ears.end()) return;
    const EarPtr ear = found->second;
    ears.erase(found);
    ear->ended = true;
    if (!ear->node) return;
    if (ear->onField) scene.stopListening(ear->node, ear->field);
    nodeEars -= ear->onNode ? 1 : 0;
    auto& there = byNode[ear->node.value];
    std::erase(there, ear);
    if (!there.empty()) return;
    byNode.erase(ear->node.value);
    heard[ear->node.value] = false;
}

Listeners::Listeners(Scene& scene) : state_(std::make_unique<State>(scene)) {
    state_->attachment = scene.bus().attach(*state_);
}

Listeners::~Listeners() {
    state_->attachment.detach();
    while (!state_->ears.empty()) end(state_->ears.begin()->first);
}

Result<ListenerId> Listeners::onField(NodeId node, FieldIndex field, OnField call) {
    if (auto ok = state_->scene.listenTo(node, field); !ok) return std::unexpected(std::move(ok.error()));
    auto ear = std::make_shared<State::Ear>();
    ear->node = node;
    ear->field = field;
    ear->onField = std::move(call);
    state_->add(ear);
    return ear->id;
}

Result<ListenerId> Listeners::onNode(NodeId node, OnNode call) {
    if (!state_->scene.find(node)) return fail(kNoSuchNode, fmt::format("no node {}", node.value));
    auto ear = std::make_shared<State::Ear>();
    ear->node = node;
    ear->onNode = std::move(call);
    ear->inWorld = state_->scene.areInWorld(std::span(&node, 1))[0];
    state_->add(ear);
    return ear->id;
}

ListenerId Listeners::onWorld(std::function<void()> call) {
    auto ear = std::make_shared<State::Ear>();
    ear->onWorld = std::move(call);
    state_->add(ear);
    return ear->id;
}

void Listeners::end(ListenerId listener) {
    state_->end(listener);
}

std::size_t Listeners::count() const {
    return state_->ears.size();
}

}  // namespace rtsg
