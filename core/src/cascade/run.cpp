// The event cascade of one timestamp (ISO/IEC 19775-1 V4.0, 4.4.8.3): input events, time, routes, until nothing moves.
#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "state/writing.h"

namespace rtsg {

namespace {

/// Sensors are evaluated again while events reach them; a network that never settles is cut off here.
constexpr int kMaximumRounds = 100;
/// So many warnings are remembered, so that each is given once.
constexpr std::size_t kMaxRemembered = 10'000;

/// Sorted, each once. Mostly they are: all comparisons are made at a time, which compilers make vectors of.
void makeAscending(std::vector<NodeId>& ids) {
    unsigned wrong = 0;
    for (std::size_t i = 1; i < ids.size(); ++i) wrong |= ids[i - 1].value >= ids[i].value ? 1u : 0u;
    if (!wrong) return;
    std::ranges::sort(ids);
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

void Scene::Lane::emit(Node& node, RouteGroup& group, std::uint64_t linkEdits) {
    emissions.push_back({node.id_, group.field, linkEdits, &node, &group});
}

/// An output field has a new value: its routes and the listener are told once a timestamp, when it is its event's turn.
[[gnu::always_inline]] inline void Scene::State::send(Lane& lane, Node& node, FieldIndex field) {
    RouteGroup* const group = groupOf(node, field);
    if (group) {
        if (std::exchange(group->stamp, stamp) == stamp) {
            if (group->gone != stamp || !group->targets.empty()) return;
            group->gone = 0;  // nobody but listeners, who change nothing: they hear each
        }
        // 4.4.8.4 holds for outputs without routes too; only a listener can tell.
    } else if (!listener || !announced.emplace(node.id_, field).second) {
        return;
    }
    lane.emissions.push_back({node.id_, field, linkEdits, &node, group});
}

// ---- what a behaviour may do ---------------------------------------------------------------------------------

void Cascade::storeStorage(const Node& node, FieldIndex field, const void* value) {
    Scene::State& s = *scene_.state_;
    s.write(lane_, const_cast<Node&>(node), field, value);  // the scene's own, which behaviours may read only
    if (s.currentCall != Scene::State::kNoCall) s.recordEffect(BehaviourEffect::Kind::store, node.id(), field, value);
}

bool Cascade::takes(const Node& node, FieldIndex field, const Value& value) {
    const FieldDef& def = node.type().fields[field];
    if (def.holds(value)) return true;
    warn(node, fmt::format("{} is {}, and is given {}", def.name, def.typeName(), typeNameOf(value)));
    return false;
}

void Cascade::emitStorage(const Node& node, FieldIndex field, const void* value) {
    if (!hasSent(node, field)) emitAgain(node, field, value);
}

[[gnu::aligned(64)]] void Cascade::emitAgain(const Node& node, FieldIndex field, const void* value) {
    Scene::State& s = *scene_.state_;
    Node& target = const_cast<Node&>(node);  // the scene's own, which behaviours may read only
    s.write(lane_, target, field, value);
    if (s.currentCall != Scene::State::kNoCall) s.recordEffect(BehaviourEffect::Kind::emit, node.id(), field, value);
    s.send(lane_, target, field);
}

// Handles the usual case of most events without a stack frame; all others go to emitStorage.
template <std::size_t size>
[[gnu::aligned(64)]] void Cascade::emitPlain(const Node& node, FieldIndex field, const void* value) {
    Scene::State& s = *scene_.state_;
    Scene::Lane& lane = lane_;
    Node& target = const_cast<Node&>(node);  // the scene's own, which behaviours may read only
    const FieldSlot& slot = target.type_->slot(field);
    const bool isHeard = target.heardOf_ & Node::Links::heardBit(field);
    if (slot.size != size || s.currentCall != Scene::State::kNoCall ||
        (isHeard && target.links_->out.begin()->gone == s.stamp) ||
        !s.writeAsBefore(lane, target, field, slot, value, size)) [[unlikely]]
        return emitStorage(node, field, value);
    if (isHeard) {
        RouteGroup* const group = target.links_->out.begin();
        if (group->field != field) [[unlikely]]
            return s.sendUnusual(lane, target, field);
        if (std::exchange(group->stamp, s.stamp) != s.stamp) return lane.emit(target, *group, s.linkEdits);
    } else if (s.listener) [[unlikely]] {
        s.sendUnusual(lane, target, field);
    }
}
template void Cascade::emitPlain<1>(const Node&, FieldIndex, const void*);
template void Cascade::emitPlain<4>(const Node&, FieldIndex, const void*);
template void Cascade::emitPlain<8>(const Node&, FieldIndex, const void*);
template void Cascade::emitPlain<12>(const Node&, FieldIndex, const void*);
template void Cascade::emitPlain<16>(const Node&, FieldIndex, const void*);

Result<> Cascade::output(const Node& node, FieldIndex field, const Value& value) {
    Scene::State& s = *scene_.state_;
    if (auto ok = s.checkNodes(node, field, value.storage()); !ok) return ok;
    // A program relies on the value that it has written, even if an event with this timestamp has been sent.
    if (node.type_->fields[field].sends())
        emitAgain(node, field, value.storage());
    else
        storeStorage(node, field, value.storage());
    return {};
}

Result<> Cascade::deliver(NodeId id, FieldIndex field, const Value& value) {
    Scene::State& s = *scene_.state_;
    Node* node = s.find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    if (field >= node->type_->fields.size()) return fail(kNoSuchField, "no such field");
    const FieldDef& def = node->type_->fields[field];
    if (!def.writable() || !def.holds(value))
        return fail(kWrongAccess, fmt::format("{}.{} takes no such event", node->type_->name, def.name));
    if (auto ok = mayHold(*node, field, value); !ok) return ok;
    if (def.access == Access::inputOutput && s.hasGone(*node, field)) return {};
    if (s.currentCall != Scene::State::kNoCall)
        s.recordEffect(BehaviourEffect::Kind::deliver, id, field, value.storage());
    // Effects of other behaviours that follow from this are not recorded as this call's.
    const std::size_t call = std::exchange(s.currentCall, Scene::State::kNoCall);
    s.deliver(*this, *node, field, value.storage());
    s.currentCall = call;
    return {};
}

Result<> Cascade::mayHold(const Node& node, FieldIndex field, const Value& value) const {
    const Scene::State& s = *scene_.state_;
    auto ok = s.checkNodes(node, field, value.storage());
    return ok ? s.checkAccepted(node, field, value.storage()) : ok;
}

bool Cascade::hasSent(const Node& node, FieldIndex field) const {
    return scene_.state_->hasGone(const_cast<Node&>(node), field);
}

void* Cascade::context(const Node& node) const {
    return scene_.state_->types[node.typeIndex().value].behaviour.context;
}

void Cascade::wake(const Node& node) {
    scene_.state_->wake(lane_, node);
}

const glm::dmat4& Cascade::worldFromLocal(const Node& node, const Node& asker) {
    lane_.askedForTransform = true;
    return scene_.state_->worldTransforms.worldFromLocal(node.id(), asker.id());
}

bool Cascade::isShown(const Node& node, const Node& asker) {
    lane_.askedForTransform = true;
    return scene_.state_->worldTransforms.isShown(node.id(), asker.id());
}

std::span<const Standing> Cascade::otherTransforms(const Node& node, const Node& asker) {
    lane_.askedForTransform = true;
    return scene_.state_->worldTransforms.otherTransforms(node.id(), asker.id());
}

const Viewer& Cascade::viewer(const Node& asker) {
    lane_.askedForTransform = true;
    return scene_.state_->worldTransforms.viewer(asker.id());
}

void Cascade::warn(const Node& node, const std::string& text) {
    if (lane_.isBeside)
        lane_.complaints.push_back({&node, text});
    else
        scene_.state_->warn(node, text);
}

void Scene::State::warn(const Node& node, const std::string& text) {
    // Beyond that, each counts again, and is not kept.
    const bool isFull = warned.size() >= kMaxRemembered;
    if (isFull ? warned.contains({node.id(), text}) : !warned.emplace(node.id(), text).second) return;
    const std::string_view name = owner.name(node.id());
    diagnostics.warning(
        {}, fmt::format("{} {}: {}", node.type().name, name.empty() ? std::to_string(node.id().value) : name, text));
}

// ---- propagation ---------------------------------------------------------------------------------------------

/// An event arrives at an input field. `value` is in block representation and outlives the call. False: it is refused.
[[gnu::aligned(64)]] bool Scene::State::deliver(Cascade& cascade, Node& node, FieldIndex field, const void* value) {
    Lane& lane = cascade.lane_;
    const FieldDef& def = node.type_->fields[field];
    const TypeEntry& entry = types[node.typeIndex_.value];
    if (def.access == Access::inputOutput) {
        if (behavioursEnabled && entry.behaviour.accepts && !accepts(entry.behaviour, node, field, value)) return false;
        if (entry.isInstance && !bodyTakes(cascade, node, field, value)) return false;
        write(lane, node, field, value);
        lane.writingExternally = false;  // changes that follow from it are derived
        if (entry.begun != kNoField) showFirst(lane, node, field);
        send(lane, node, field);
        if (entry.behaviour.onTime) wake(lane, node);
        if (behavioursEnabled && entry.behaviour.onEvent) onEvent(entry.behaviour, cascade, node, field, value);
        return true;
    }
    lane.writingExternally = false;
    if (!listener) {
        deliverInput(cascade, node, field, value);
        return true;
    }
    // A listener may edit the scene: afterwards the node may be gone, and the value with the node that it came from.
    const NodeId id = node.id_;
    const Value kept = Value::fromStorage(def.type, value);
    listener(now, node, field, kept);
    if (Node* left = find(id)) deliverInput(cascade, *left, field, kept.storage());
    return true;
}

/// Whether a node's inputOutput field has a behaviour that may refuse events, at whatever depth of IS.
bool Scene::State::mayRefuse(Node& node, FieldIndex field) const {
    const TypeEntry& entry = types[node.typeIndex_.value];
    if (entry.behaviour.accepts) return true;
    const RouteGroup* group = entry.isInstance ? groupOf(node, field) : nullptr;
    return group && std::ranges::any_of(group->targets.items(), [&](const OutgoingRoute& r) {
               Node* inner = r.to.isConnection ? find(r.to.node) : nullptr;
               return inner && inner->scope_ == node.id_ && mayRefuse(*inner, r.to.field);
           });
}

/// 4.4.4.3: a PROTO instance's field stands for the fields of its body that IS connects with it. If all of them refuse
/// an event, it does not change the instance. Fields that may refuse get the event at once, because their decision
/// depends on the events before it. Returns false if they refuse it, or if their reaction has destroyed the instance.
bool Scene::State::bodyTakes(Cascade& cascade, Node& node, FieldIndex field, const void* value) {
    if (!behavioursEnabled || !mayRefuse(node, field)) return true;
    const NodeId id = node.id_;
    const bool external = std::exchange(cascade.lane_.writingExternally, false);  // the body's events are derived
    bool refused = false, taken = false;
    const auto items = groupOf(node, field)->targets.items();
    for (const OutgoingRoute& r : std::vector<OutgoingRoute>(items.begin(), items.end())) {
        Node* inner = r.to.isConnection ? find(r.to.node) : nullptr;
        if (!inner || inner->scope_ != id) continue;
        // One that has sent in this timestamp is where the event comes from.
        const bool decides = inner->type_->fields[r.to.field].access == Access::inputOutput &&
                             mayRefuse(*inner, r.to.field) && !hasGone(*inner, r.to.field);
        (decides && !deliver(cascade, *inner, r.to.field, value) ? refused : taken) = true;
    }
    cascade.lane_.writingExternally = external;
    return find(id) == &node && (taken || !refused);
}

/// Delivers an event to an inputOnly field.
void Scene::State::deliverInput(Cascade& cascade, Node& node, FieldIndex field, const void* value) {
    Lane& lane = cascade.lane_;
    const TypeEntry& entry = types[node.typeIndex_.value];
    for (const auto& [from, stored] : entry.inputs)
        if (from == field) write(lane, node, stored, value);
    if (field == entry.addChildren || field == entry.removeChildren)
        deliverChildren(cascade, node, field, value, entry);
    if (entry.behaviour.onTime) wake(lane, node);
    // An inputOnly field of a PROTO instance has no storage and hands the event on to its body at once. That may
    // destroy the instance.
    const NodeId id = node.id_;
    if (const RouteGroup* group = groupOf(node, field)) {
        const auto items = group->targets.items();
        const std::vector<OutgoingRoute> routes(items.begin(), items.end());
        for (const OutgoingRoute& r : routes)
            if (Node* target = find(r.to.node)) deliver(cascade, *target, r.to.field, value);
        if (find(id) != &node) return;
    }
    const Behaviour& behaviour = types[node.typeIndex_.value].behaviour;
    if (behavioursEnabled && behaviour.onEvent) onEvent(behaviour, cascade, node, field, value);
}

/// Does what deliver() does for nearly all events: those to a field of plain bytes of a node that does not react and
/// that nobody hears, and those to an input that only a behaviour waits for. Returns false, and does nothing, for all
/// others.
[[gnu::always_inline]] inline bool Scene::State::deliverAtOnce(Cascade& cascade, Node& node, FieldIndex field,
                                                               const FieldDef& def, const void* value) {
    Lane& lane = cascade.lane_;
    const TypeEntry& entry = types[node.typeIndex_.value];
    const Behaviour& behaviour = entry.behaviour;
    if (listener || behaviour.onTime || (node.heardOf_ & Node::Links::heardBit(field))) return false;
    if (def.access == Access::inputOutput) {
        if (behaviour.accepts || behaviour.onEvent) return false;
        const FieldSlot& slot = node.type_->slot(field);
        if (!writing::isPlain(slot.type) || !writeAsBefore(lane, node, field, slot, value, slot.size)) return false;
        lane.writingExternally = false;  // changes that follow from it are derived
        return true;
    }
    if (entry.takesInputs || !behaviour.onEvent || !behavioursEnabled || isTraced(behaviour)) return false;
    lane.writingExternally = false;
    behaviour.onEvent(cascade, node, field, EventValue(def.type, value));
    return true;
}

/// 10.2.1: a present child is not added again, an absent one not removed.
void Scene::State::deliverChildren(Cascade& cascade, Node& node, FieldIndex field, const void* value,
                                   const TypeEntry& entry) {
    bool changed = false;
    for (const NodeId id : *static_cast<const Array<NodeId>*>(value)) {
        Node* child = find(id);
        if (!child) continue;
        const auto& children = *static_cast<const Array<NodeId>*>(node.storage(entry.children));
        const auto found = std::ranges::find(children, id);
        if (field == entry.addChildren && found == children.end()) {
            auto ok = checkAccepted(*node.type_, entry.children, id);
            if (ok) ok = insertChild(node, entry.children, *child, SIZE_MAX);
            if (ok)
                changed = true;
            else
                cascade.warn(node, ok.error().text);
        } else if (field == entry.removeChildren && found != children.end()) {
            removeChildAt(node, entry.children, static_cast<std::size_t>(found - children.begin()));
            changed = true;
        }
    }
    if (changed) send(cascade.lane_, node, entry.children);
}

[[gnu::always_inline]] inline void Scene::State::follow(Cascade& cascade, RouteTarget target, const Node& from,
                                                        FieldIndex field) {
    Node* to = find(target.node);
    if (!to) return;
    const FieldDef& def = to->type_->fields[target.field];
    const void* value = from.storage(field);
    if (target.isConnection && !def.writable() && def.sends()) {
        // IS from a body's outputOnly to the instance's: the instance sends it.
        if (hasGone(*to, target.field)) return;
        write(cascade.lane_, *to, target.field, value);
        send(cascade.lane_, *to, target.field);
        return;
    }
    if (sf(def.type) == FieldType::SFNode) {
        auto ok = checkNodes(*to, target.field, value);
        if (ok) ok = checkAccepted(*to, target.field, value);
        if (!ok) return cascade.warn(*to, ok.error().text);
    }
    if (def.access == Access::inputOutput)
        if (const RouteGroup* sent = groupOf(*to, target.field)) {
            if (hasGone(*sent)) return;
            // The way back of a two-way connection: that field has already sent this event.
            if (target.isConnection && sent->stamp == stamp) return;
        }
    if (!deliverAtOnce(cascade, *to, target.field, def, value)) deliver(cascade, *to, target.field, value);
}

[[gnu::always_inline]] inline void Scene::State::sendEach(Cascade& cascade, const Emission& emission, std::size_t first,
                                                          std::size_t last) {
    // Copies, because the emissions that it leads to go into the list that holds it.
    const NodeId sender = emission.node;
    const FieldIndex field = emission.field;
    Node* from = emission.at;
    RouteGroup* group = emission.group;
    std::uint64_t edits = emission.linkEdits;
    if (edits == linkEdits && !listener && group)
        if (const OutgoingRoute* only = group->targets.only(); only && group->listeners == 0) {
            group->gone = stamp;
            ++cascade.lane_.work;
            return follow(cascade, only->to, *from, field);
        }
    const auto lookUpAgain = [&] {
        edits = linkEdits;
        from = find(sender);
        group = from ? groupOf(*from, field) : nullptr;
    };
    if (edits != linkEdits) lookUpAgain();
    if (listener && from) {
        announced.erase({sender, field});
        listener(now, *from, field, from->value(field));
        lookUpAgain();
    }
    if (!group) return;
    if (first == 0) {
        group->gone = stamp;
        if (group->listeners > 0) cascade.lane_.heard.push_back({sender, field, from->value(field)});
    }
    // Routes added while this event is on its way are not retroactive.
    const std::size_t count = std::min(last, group->targets.items().size());
    if (count > first) cascade.lane_.work += count - first;
    for (std::size_t i = first; group && i < count; ++i) {
        const std::span<const OutgoingRoute> routes = group->targets.items();
        if (i >= routes.size()) break;
        follow(cascade, routes[i].to, *from, field);
        if (edits != linkEdits) lookUpAgain();
    }
}

// Every event runs through this, emitStorage and deliver: from the start of a cache line on, as elsewhere they take up
// to half as long again.
[[gnu::aligned(64)]] void Scene::State::sendAlong(Cascade& cascade, const std::vector<Emission>& list,
                                                  std::size_t first, std::size_t end, std::size_t firstTarget,
                                                  std::size_t endTarget) {
    // One cache line of a node's routes is read, and is fetched while earlier events are delivered.
    constexpr std::size_t kAhead = 6;
    for (std::size_t i = first; i < end; ++i) {
        if (i + kAhead < end) __builtin_prefetch(list[i + kAhead].group, 1);
        sendEach(cascade, list[i], i == first ? firstTarget : 0, i + 1 == end ? endTarget : SIZE_MAX);
    }
}

void Scene::State::runRoutes(Cascade& cascade) {
    std::vector<Emission>& waiting = cascade.lane_.emissions;
    for (std::size_t sent = 0; sent < waiting.size();) {
        const std::size_t end = waiting.size();
        sendAlong(cascade, waiting, sent, end);
        sent = end;
    }
    waiting.clear();
}

/// Fetches the lists of the node some places on, which lie anywhere in memory, while earlier nodes are at work. The
/// nodes themselves are fetched sooner, since they hold the addresses of their lists.
void Scene::State::fetchAhead(std::span<const NodeId> nodes) const {
    constexpr std::size_t kNode = 8, kLists = 4;
    if (const Node* node = nodes.size() > kNode ? find(nodes[kNode]) : nullptr)
        for (std::size_t i = 0; i < 3; ++i) __builtin_prefetch(reinterpret_cast<const std::byte*>(node) + 64 * i, 1);
    const Node* node = nodes.size() > kLists ? find(nodes[kLists]) : nullptr;
    if (!node) return;
    for (const FieldIndex i : node->type_->sharedFields()) {
        const std::byte* list = nullptr;
        std::memcpy(&list, node->block() + node->type_->slot(i).offset, sizeof(list));
        if (!list) continue;
        __builtin_prefetch(list);
        __builtin_prefetch(list + 64);
    }
}

void Scene::State::tick(Cascade& cascade, std::span<const NodeId> nodes) {
    Lane& lane = cascade.lane_;
    lane.work += nodes.size();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const NodeId id = nodes[i];
        Node* node = find(id);
        if (!node) continue;
        const TypeEntry& entry = types[node->typeIndex_.value];
        if (entry.keepsLists) fetchAhead(nodes.subspan(i));
        const Behaviour& behaviour = entry.behaviour;
        if (!behaviour.onTime) continue;
        if (behaviour.last && !asksLast) {
            lane.late.push_back(id);
            continue;
        }
        lane.askedForTransform = false;
        const double wanted = onTime(behaviour, cascade, *node);
        if (wanted <= now)
            lane.nextActive.push_back(id);
        else if (wanted == kUntilMoved && !lane.askedForTransform)
            lane.watchers.push_back(id);
        else if (wanted == kUntilMoved)
            continue;
        else if (wanted < kNever)
            lane.goToSleep.emplace_back(wanted, id);
    }
}

/// Gathers the nodes whose time has come and, if anything has moved, those that wait for that.
void Scene::State::gatherDue() {
    due.assign(active.begin(), active.end());
    while (!sleepers.empty() && sleepers.top().first <= now) {
        due.push_back(sleepers.top().second);
        sleepers.pop();
    }
    if ((touched | std::exchange(touchedBefore, 0u)) & kTransformAspects) {
        due.insert(due.end(), watchers.begin(), watchers.end());
        watchers.clear();
    }
}

void Scene::State::runTime(Cascade& cascade) {
    gatherDue();
    const std::size_t waiting = watchers.size();
    nextActive.clear();
    bool first = true, lastAsked = false;
    asksLast = false;
    late.clear();
    for (int round = 0; first || !woken.empty(); ++round) {
        if (round == kMaximumRounds) {
            diagnostics.warning({}, fmt::format("events at t = {} did not settle in {} rounds", now, kMaximumRounds));
            break;
        }
        if (!woken.empty()) {
            due.insert(due.end(), woken.begin(), woken.end());
            woken.clear();
        }
        makeAscending(due);
        emissionRuns.assign(1, &emissions);
        tickAll(cascade, due, static_cast<std::size_t>(round));
        due.clear();
        for (const Sleeper& one : goToSleep) sleepers.push(one);
        goToSleep.clear();
        runAllRoutes(cascade, static_cast<std::size_t>(round));
        first = asksLast = false;
        if (!woken.empty() || std::exchange(lastAsked, true)) continue;
        // All has come to rest: those that come last, and once a timestamp, as they send one event then.
        wakeMoved();
        due.swap(late);
        due.insert(due.end(), woken.begin(), woken.end());
        woken.clear();
        asksLast = first = !due.empty();
    }
    // Nodes that events have reached since then are called in the next frame.
    woken.insert(woken.end(), late.begin(), late.end());
    late.clear();
    makeAscending(nextActive);
    active.swap(nextActive);
    if (watchers.size() == waiting) return;
    std::ranges::sort(watchers);
    watchers.erase(std::unique(watchers.begin(), watchers.end()), watchers.end());
}

Result<> Scene::State::checkAccepted(const NodeType& type, FieldIndex field, NodeId child) const {
    const FieldDef& def = type.fields[field];
    if (def.accepts.empty() || !child) return {};
    const Node* stands = owner.effectiveNode(child);
    // A node that could not be loaded, or whose type nobody knows, is accepted.
    if (!stands || stands->type_->kind != NodeType::Kind::builtin) return {};
    for (const std::string& one : def.accepts)
        if (stands->type_->isA(one)) return {};
    return fail(fmt::format("{} does not take {}", def.name, stands->type_->name));
}

Result<> Scene::State::checkAccepted(const Node& node, FieldIndex field, const void* value) const {
    const NodeType& type = *node.type_;
    const TypeEntry& entry = types[node.typeIndex_.value];
    if (type.fields[field].accepts.empty() || field == entry.addChildren || field == entry.removeChildren) return {};
    if (type.fields[field].type == FieldType::SFNode)
        return checkAccepted(type, field, *static_cast<const NodeId*>(value));
    if (type.fields[field].type == FieldType::MFNode)
        for (const NodeId child : *static_cast<const Array<NodeId>*>(value))
            if (auto ok = checkAccepted(type, field, child); !ok) return ok;
    return {};
}

void Scene::State::beginScripts(Cascade& cascade) {
    const auto call = [&](std::vector<NodeId> ids, ScriptPhase phase) {
        std::ranges::sort(ids);
        ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
        bool any = false;
        for (const NodeId id : ids) {
            const Node* node = find(id);
            if (!node || !types[node->typeIndex_.value].isScript) continue;
            scriptPhase = phase;
            any |= onTime(types[node->typeIndex_.value].behaviour, cascade, *node) <= now;
            scriptPhase = ScriptPhase::run;
        }
        runRoutes(cascade);
        return any;
    };
    if (call(woken, ScriptPhase::initialize)) {
        // Events that initialize() sends have an earlier timestamp than all others (29.2.2).
        ++stamp;
        announced.clear();
    }
    std::vector<NodeId> all = woken;
    all.insert(all.end(), active.begin(), active.end());
    call(std::move(all), ScriptPhase::prepare);
}

/// An inputOutput field passes on one event a timestamp (4.4.8.4): of several that wait for it, the last one is it.
/// inputOnly fields get all.
void Scene::State::dropSuperseded(std::vector<QueuedEvent>& queued) const {
    if (queued.size() < 2) return;
    std::set<std::pair<NodeId, FieldIndex>> later;
    for (std::size_t i = queued.size(); i-- > 0;) {
        const Node* node = find(queued[i].node);
        if (!node || node->type_->fields[queued[i].field].access != Access::inputOutput) continue;
        if (!later.emplace(queued[i].node, queued[i].field).second) queued[i].node = {};
    }
    std::erase_if(queued, [](const QueuedEvent& event) { return !event.node; });
}

std::shared_ptr<const ChangeSet> Scene::newFrame(double t) {
    State& s = *state_;
    if (s.refuseForeign() || s.refuseFromWithin()) return std::make_shared<ChangeSet>();
    s.reportForeign();
    if (!std::isfinite(t) || (s.started && t < s.now)) {
        s.diagnostics.warning({}, std::isfinite(t) ? fmt::format("time went back from {} to {}: kept", s.now, t)
                                                   : fmt::format("{} is no time: it stays at {}", t, s.now));
        t = s.now;
    }
    if (!s.playing) {
        // The application has no part in it: it comes by itself where the frames are run again.
        struct Derived {
            State& s;
            explicit Derived(State& state) : s(state) { s.writingExternally = false; }
            ~Derived() { s.writingExternally = true; }
        } const derived(s);
        s.serveRequests();
        s.destroyDropped();
    }
    s.prepareInput(t);
    if (s.recording) s.captureInput(true);
    s.callTeam();
    Cascade cascade(*this, t, s.started ? s.now : t, s);
    s.now = t;
    s.started = true;
    s.cascading = true;
    ++s.stamp;
    s.announced.clear();
    s.writingExternally = false;
    if (s.behavioursEnabled && s.scriptNodes > 0) s.beginScripts(cascade);
    std::vector<State::QueuedEvent> queued;
    queued.swap(s.inputQueue);
    s.inputQueue.swap(s.deferredInput);
    s.dropSuperseded(queued);
    for (State::QueuedEvent& event : queued) {
        Node* node = s.find(event.node);
        if (!node) continue;
        auto ok = s.checkNodes(*node, event.field, event.value.storage());
        if (ok) ok = s.checkAccepted(*node, event.field, event.value.storage());
        if (!ok) {
            cascade.warn(*node, ok.error().text);
            continue;
        }
        Change change;
        change.kind = ChangeKind::event;
        change.node = event.node;
        change.field = event.field;
        change.value = event.value;
        s.events.push_back(std::move(change));
        if (!event.author.empty()) s.authors.push_back({event.node, event.field, event.author});
        s.writingExternally = true;
        s.deliver(cascade, *node, event.field, event.value.storage());
        s.writingExternally = false;
        s.runRoutes(cascade);
    }
    s.writingExternally = false;
    if (s.behavioursEnabled) s.runTime(cascade);
    s.runRoutes(cascade);
    s.writingExternally = true;
    s.cascading = false;
    queued.clear();
    if (s.inputQueue.empty()) s.inputQueue.swap(queued);  // keeps the capacity
    return s.seal();
}

double Scene::restsUntil() const {
    const State& s = *state_;
    const bool asked = !s.inputQueue.empty() || !s.deferredInput.empty() || s.hasPending() ||
                       !node(root()).get(x3d::RtsgScene::_requests).empty();
    // Motion of the last frame matters in the next one, for sensors and for avatars on moving ground.
    const bool moves = !s.active.empty() || !s.woken.empty() || s.touchedBefore != 0 || s.viewerMoved;
    if (!s.started || asked || moves) return -kNever;
    return s.sleepers.empty() ? kNever : s.sleepers.top().first;
}

/// One that runs inside another would be half of both; and subscribers that answer every set with a further one would
/// never let the outermost call return.
bool Scene::State::refuseFromWithin() {
    if (cascading) {
        diagnostics.error({}, "newFrame was called from within a frame: refused", kFromWithin);
        return true;
    }
    return refuseEndlessDelivery();
}

bool Scene::State::refuseEndlessDelivery() {
    if (owner.bus_->inDelivery() < kMaxInDelivery) return false;
    const std::string text = fmt::format(
        "{} sets came from within one delivery: what is edited now waits for the next frame", kMaxInDelivery);
    if (warned.emplace(owner.root(), text).second) diagnostics.warning({}, text, kFromWithin);
    return true;
}

std::shared_ptr<const ChangeSet> Scene::seal() {
    State& s = *state_;
    if (s.refuseForeign() || s.cascading || !s.hasPending() || s.refuseEndlessDelivery()) return nullptr;
    return s.seal();
}

}  // namespace rtsg
