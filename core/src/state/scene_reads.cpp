// Construction of a scene, the checks that calls come from its own thread, and functions that read it.
#include <rtsg/core/scene.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "writing.h"

namespace rtsg {

Scene::Scene() : state_(std::make_unique<State>(*this)), bus_(std::make_unique<Bus>(*this)) {
    // The root exists from the start and is in no ChangeSet; only its content is.
    state_->allocate(root(), x3d::RtsgScene::type, {});
    state_->firstNewId = state_->nextId;
}
Scene::~Scene() {
    if (state_->scripts) state_->scripts->forgetAll();
}

Result<> Scene::State::checkThread() const {
    if (onOwnThread()) return {};
    return fail(kWrongThread, "the scene belongs to another thread");
}

Result<> Scene::State::checkOutsideFrame() const {
    if (auto ok = checkThread(); !ok || !cascading) return ok;
    return fail(kFromWithin, "the scene's state cannot be replaced from within a frame");
}

Result<> Scene::State::checkEdit() {
    auto ok = checkThread();
    if (ok) editedWithin |= cascading;
    return ok;
}

bool Scene::State::refuseForeign() {
    if (onOwnThread()) return false;
    foreignCalls.fetch_add(1, std::memory_order_relaxed);
    return true;
}

void Scene::State::reportForeign() {
    if (const std::size_t calls = foreignCalls.exchange(0, std::memory_order_relaxed))
        diagnostics.error({}, fmt::format("the scene belongs to another thread: {} calls refused", calls),
                          kWrongThread);
}

// ---- reading ---------------------------------------------------------------------------------------------------

const Node* Scene::find(NodeId id) const {
    return state_->find(id);
}
const Node& Scene::node(NodeId id, std::source_location caller) const {
    const Node* node = state_->find(id);
    if (!node) [[unlikely]]
        detail::checkFailed("the node exists", fmt::format("no node {} among {}", id.value, nodeCount()), caller);
    return *node;
}
const Node* Scene::effectiveNode(NodeId id) const {
    const Node* node = find(id);
    // The geometry that an InlineGeometry has loaded stands for it, too.
    while (node && (node->type().kind == NodeType::Kind::proto || node->type().kind == NodeType::Kind::externProto ||
                    node->is(x3d::InlineGeometry::type))) {
        const FieldIndex body = node->type().body();
        if (body == kNoField) return nullptr;
        const auto& nodes = node->get(Field<Array<NodeId>>{body});
        node = nodes.empty() ? nullptr : find(nodes[0]);  // bodies are part of the hierarchy: no cycles
    }
    return node;
}
std::size_t Scene::nodeCount() const {
    return state_->nodeTable.size();
}
void Scene::forEachNode(const std::function<void(const Node&)>& visit) const {
    state_->nodeTable.forEach(visit);
}
std::vector<ParentRef> Scene::parents(NodeId id) const {
    std::vector<ParentRef> result;
    const Node* node = find(id);
    if (!node) return result;
    if (node->parent_.node) result.push_back(node->parent_);
    if (node->links_) node->links_->parents.appendTo(result);
    std::ranges::sort(result, {}, [](const ParentRef& p) { return std::pair(p.node, p.field); });
    return result;
}
std::string_view Scene::name(NodeId id) const {
    const Node* node = find(id);
    return node && node->links_ ? node->links_->name.view() : std::string_view();
}
NodeLocation Scene::locationOf(NodeId id) const {
    const auto& worldTransforms = state_->readAt;
    const auto at = std::ranges::lower_bound(worldTransforms, id.value, {}, &State::ReadAt::node);
    if (at == worldTransforms.end() || at->node != id.value) return {};
    return {state_->filesRead[at->file], at->where};
}
void Scene::setLocation(NodeId id, const NodeLocation& location) {
    std::vector<State::ReadAt>& worldTransforms = state_->readAt;
    std::vector<std::string>& files = state_->filesRead;
    if (worldTransforms.size() >= kMaxLocations) return;
    // Nearly always the file of the node before, and always a greater number.
    std::size_t file = worldTransforms.empty() ? files.size() : worldTransforms.back().file;
    if (file >= files.size() || files[file] != location.file)
        file = static_cast<std::size_t>(std::ranges::find(files, location.file) - files.begin());
    if (file == files.size()) files.push_back(location.file);
    const State::ReadAt created{id.value, static_cast<std::uint32_t>(file), location.where};
    if (worldTransforms.empty() || worldTransforms.back().node < id.value) {
        worldTransforms.push_back(created);
        return;
    }
    const auto at = std::ranges::lower_bound(worldTransforms, id.value, {}, &State::ReadAt::node);
    if (at != worldTransforms.end() && at->node == id.value)
        *at = created;
    else
        worldTransforms.insert(at, created);
}
NodeId Scene::findName(std::string_view name, NodeId scope) const {
    const auto found = state_->names.find(State::NameKey{scope.value, String(name)});
    return found == state_->names.end() ? NodeId{} : found->second;
}
std::vector<Route> Scene::routesFrom(NodeId id) const {
    std::vector<Route> result;
    const Node* node = find(id);
    if (node && node->links_)
        for (const RouteGroup& group : node->links_->out)
            for (const OutgoingRoute& r : group.targets.items())
                if (r.to.node) result.push_back({id, group.field, r.to.node, r.to.field, r.to.isConnection});
    return result;
}
std::vector<Route> Scene::routesTo(NodeId id) const {
    std::vector<Route> result;
    const Node* node = find(id);
    if (node && node->links_)
        for (const IncomingRoute& r : node->links_->in.items())
            if (r.from) result.push_back({r.from, r.fromField, id, r.toField, r.isConnection});
    return result;
}
std::size_t Scene::routeCount() const {
    return state_->routeCount;
}
const NodeType& Scene::type(TypeIndex index) const {
    RTSG_CHECK_LT(index.value, state_->types.size());
    return *state_->types[index.value].type;
}
std::size_t Scene::typeCount() const {
    return state_->types.size();
}
std::optional<TypeIndex> Scene::findType(std::string_view name) const {
    const auto found = state_->typeByName.find(name);
    if (found == state_->typeByName.end()) return std::nullopt;
    return TypeIndex{found->second};
}
bool Scene::isInFrame() const {
    return state_->cascading;
}
double Scene::now() const {
    return state_->now;
}
std::uint64_t Scene::sequence() const {
    return state_->sequence;
}
Hash128 Scene::hash() const {
    // Pending writes are not yet in the running sum.
    detail::StateHash sum = state_->hash;
    state_->forEachWritten([&](const WrittenField& entry) {
        const Node* node = find(entry.node);
        if (!node) return;
        sum.subtract(state_->termBefore(*node, entry));
        sum.add(state_->termOf(*node, entry.field));
    });
    return sum.value();
}
void Scene::setThreads(unsigned threads) {
    State& s = *state_;
    if (s.refuseForeign() || s.refuseFromWithin()) return;
    s.threadsAsked = threads;
    s.team.reset();
    s.division.clear();
    s.laidOut.clear();
    s.patience = 2;
    s.untilDivided = 0;
}
Diagnostics& Scene::diagnostics() {
    if (state_->onOwnThread()) {
        state_->reportForeign();
        bus_->takeReports(state_->diagnostics);
    }
    return state_->diagnostics;
}
void Scene::setEventListener(EventListener listener) {
    if (state_->refuseForeign()) return;
    state_->listener = std::move(listener);
}
void Scene::registerBehaviour(TypeIndex type, const Behaviour& behaviour) {
    if (state_->refuseForeign()) return;
    RTSG_CHECK_LT(type.value, state_->types.size());
    state_->types[type.value].behaviour = behaviour;
    ++state_->linkEdits;  // the part that may run on other threads is another now
    state_->noteUse(type, behaviour);
    forEachNode([&](const Node& node) {
        if (node.is(type)) state_->wake(node);
    });
}
void Scene::registerBehaviour(std::string_view type, const Behaviour& behaviour) {
    if (state_->refuseForeign()) return;
    state_->behavioursByName.insert_or_assign(std::string(type), behaviour);
    for (std::size_t i = 0; i < state_->types.size(); ++i)
        if (state_->types[i].type->name == type) registerBehaviour(TypeIndex{static_cast<std::uint16_t>(i)}, behaviour);
}
bool Scene::isOwnThread() const {
    return state_->onOwnThread();
}

void Scene::setBehavioursEnabled(bool enabled) {
    if (state_->refuseForeign()) return;
    if (enabled == state_->behavioursEnabled) return;
    state_->behavioursEnabled = enabled;
    state_->active.clear();
    state_->woken.clear();
    state_->watchers.clear();
    state_->worldTransforms.clear();
    if (enabled) forEachNode([&](const Node& node) { state_->wake(node); });
}

}  // namespace rtsg
