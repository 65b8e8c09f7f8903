// Construction, nodes, names and routes of a scene, and the checks that calls come from its own thread.
#include <rtsg/core/scene.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "writing.h"

namespace rtsg {

Scene::Scene() : state_(std::make_unique<State>(*this)), bus_(std::make_unique<Bus>(*this)) {
    // The root is there from the start and in no ChangeSet; only what is put into it is.
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
    // What an InlineGeometry has loaded is in its place, too.
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
NodePlace Scene::placeOf(NodeId id) const {
    const auto& places = state_->readAt;
    const auto at = std::ranges::lower_bound(places, id.value, {}, &State::ReadAt::node);
    if (at == places.end() || at->node != id.value) return {};
    return {state_->filesRead[at->file], at->where};
}
void Scene::setPlace(NodeId id, const NodePlace& place) {
    std::vector<State::ReadAt>& places = state_->readAt;
    std::vector<std::string>& files = state_->filesRead;
    if (places.size() >= kMostPlaces) return;
    // Nearly always the file of the node before, and always a greater number.
    std::size_t file = places.empty() ? files.size() : places.back().file;
    if (file >= files.size() || files[file] != place.file)
        file = static_cast<std::size_t>(std::ranges::find(files, place.file) - files.begin());
    if (file == files.size()) files.push_back(place.file);
    const State::ReadAt made{id.value, static_cast<std::uint32_t>(file), place.where};
    if (places.empty() || places.back().node < id.value) {
        places.push_back(made);
        return;
    }
    const auto at = std::ranges::lower_bound(places, id.value, {}, &State::ReadAt::node);
    if (at != places.end() && at->node == id.value)
        *at = made;
    else
        places.insert(at, made);
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
    s.crew.reset();
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
    ++state_->linkEdits;  // what may run on other threads is another now
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
    state_->places.clear();
    if (enabled) forEachNode([&](const Node& node) { state_->wake(node); });
}

// ---- editing ---------------------------------------------------------------------------------------------------

Result<TypeIndex> Scene::defineType(std::shared_ptr<const NodeType> type) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return std::unexpected(ok.error());
    if (s.types.size() >= 0xFFFF) return fail("too many node types");
    const TypeIndex index{static_cast<std::uint16_t>(s.types.size())};
    s.addTypeEntry(*type);
    s.ownTypes.push_back(type);
    s.newTypes.push_back({index, std::move(type)});
    return index;
}

NodeId Scene::createNode(TypeIndex type, NodeId scope) {
    State& s = *state_;
    if (s.refuseForeign() || !s.checkEdit() || type.value >= s.types.size() || s.nextId == UINT32_MAX) return {};
    Node& node = s.allocate(NodeId{s.nextId}, type, scope);
    s.hash.add(detail::nodeTerm(node.id_, s.types[type.value].nameHash, scope));
    s.newNodes.push_back({node.id_, s.writingExternally});
    s.wake(node);
    return node.id_;
}

Result<NodeId> Scene::createNode(std::string_view type, NodeId scope) {
    const auto index = findType(type);
    if (!index) return fail(fmt::format("unknown node type {}", type));
    const NodeType::Kind kind = state_->types[index->value].type->kind;
    if (kind == NodeType::Kind::proto || kind == NodeType::Kind::externProto) {
        if (auto ok = state_->checkEdit(); !ok) return std::unexpected(std::move(ok.error()));
        return documents().makePrototypeInstance(*this, *index, scope, state_->scriptOptions.resources.get());
    }
    const NodeId id = createNode(*index, scope);
    if (!id) return fail("no node could be created here");
    return id;
}

Result<> Scene::destroyNode(NodeId id) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* node = s.find(id);
    if (!node || id == root()) return fail(kNoSuchNode, fmt::format("no node {} to destroy", id.value));
    s.detachEverything(*node);
    s.releaseChildren(*node);
    s.destroy(*node, true);
    return {};
}

std::size_t Scene::destroyUnreachable() {
    State& s = *state_;
    if (s.refuseForeign()) return 0;
    std::vector<bool> reached(s.nextId);
    std::vector<NodeId> pending;
    const auto reach = [&](NodeId id) {
        if (!id || reached[id.value]) return;
        reached[id.value] = true;
        pending.push_back(id);
    };
    reach(root());
    forEachNode([&](const Node& node) {
        if (node.links_ && (!node.links_->name.empty() || node.links_->hasRoutes())) reach(node.id_);
    });
    while (!pending.empty()) {
        const Node& node = *s.find(pending.back());
        pending.pop_back();
        reach(node.scope_);
        for (const FieldIndex i : node.type_->nodeFields()) {
            if (!node.type_->fields[i].readable()) continue;
            if (node.type_->fields[i].type == FieldType::SFNode)
                reach(*static_cast<const NodeId*>(node.storage(i)));
            else
                for (const NodeId child : *static_cast<const Array<NodeId>*>(node.storage(i))) reach(child);
        }
    }
    std::vector<NodeId> gone;
    forEachNode([&](const Node& node) {
        if (!reached[node.id_.value]) gone.push_back(node.id_);
    });
    std::size_t count = 0;
    for (const NodeId id : gone) count += destroyNode(id).has_value() ? 1 : 0;
    return count;
}

Result<> Scene::setField(NodeId id, FieldIndex field, Value value) {
    if (setPlain(id, field, value.type(), value.storage())) return {};
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* node = s.find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    if (field >= node->type_->fields.size())
        return fail(kNoSuchField, fmt::format("{} has no field {}", node->type_->name, field));
    const FieldDef& def = node->type_->fields[field];
    if (def.type != value.type())
        return fail(kWrongType, fmt::format("{}.{} is {}, not {}", node->type_->name, def.name, info(def.type).name,
                                            info(value.type()).name));
    if (!def.hidden && (def.access == Access::inputOnly || def.access == Access::outputOnly))
        return fail(kWrongAccess, fmt::format("{}.{} cannot be given a value", node->type_->name, def.name));
    if (sf(def.type) == FieldType::SFNode) {
        auto ok = s.checkNodes(*node, field, value.storage());
        if (ok) ok = s.checkAccepted(*node, field, value.storage());
        if (!ok) return ok;
    }
    s.write(*node, field, value.storage());
    if (s.types[node->typeIndex_.value].begun != kNoField) s.showFirst(s, *node, field);
    s.wake(*node);
    return s.passToBody(id, field);
}

Result<> Scene::State::passToBody(NodeId id, FieldIndex field) {
    const Node* node = find(id);
    const NodeType::Kind kind = node->type_->kind;
    if ((kind != NodeType::Kind::proto && kind != NodeType::Kind::externProto) || !node->links_) return {};
    for (const Route& route : owner.routesFrom(id)) {
        // An instance in a body is connected outwards as well.
        if (!route.isConnection || route.fromField != field || find(route.toNode)->scope_ != id) continue;
        const Access access = find(route.toNode)->type_->fields[route.toField].access;
        if (access != Access::initializeOnly && access != Access::inputOutput) continue;
        if (auto ok = owner.setField(route.toNode, route.toField, node->value(field)); !ok) return ok;
    }
    return {};
}

Result<> Scene::insertChild(NodeId parent, FieldIndex field, NodeId child, std::size_t index) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node *p = s.find(parent), *c = s.find(child);
    if (!p || !c) return fail(kNoSuchNode, "insertChild: no such node");
    if (field >= p->type_->fields.size() || p->type_->fields[field].type != FieldType::MFNode ||
        !p->type_->fields[field].readable())
        return fail(kNoSuchField, fmt::format("{} has no such MFNode field", p->type_->name));
    if (auto ok = s.checkAccepted(*p->type_, field, child); !ok) return ok;
    if (auto ok = s.insertChild(*p, field, *c, index); !ok) return ok;
    return s.passToBody(parent, field);
}

Result<> Scene::removeChild(NodeId parent, FieldIndex field, std::size_t index) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* p = s.find(parent);
    if (!p) return fail(kNoSuchNode, "removeChild: no such node");
    if (field >= p->type_->fields.size() || p->type_->fields[field].type != FieldType::MFNode ||
        !p->type_->fields[field].readable())
        return fail(kNoSuchField, fmt::format("{} has no such MFNode field", p->type_->name));
    if (index >= static_cast<const Array<NodeId>*>(p->storage(field))->size())
        return fail(fmt::format("{}.{} has no child {}", p->type_->name, p->type_->fields[field].name, index));
    s.removeChildAt(*p, field, index);
    return s.passToBody(parent, field);
}

Result<std::size_t> Scene::removeFromParents(NodeId id) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return std::unexpected(std::move(ok.error()));
    if (!find(id)) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    std::size_t count = 0;
    for (const ParentRef& p : parents(id)) {
        const Node& parent = node(p.node);
        const FieldDef& def = parent.type().fields[p.field];
        const bool authors = def.access == Access::initializeOnly || def.access == Access::inputOutput;
        if (def.hidden || !authors || parent.type().kind == NodeType::Kind::script) continue;
        Result<> ok;
        if (def.type == FieldType::SFNode) {
            if (parent.get(Field<NodeId>{p.field}) != id) continue;  // what a PROTO instance had to say about it
            ok = setField(p.node, p.field, Value(NodeId{}));
        } else {
            const auto& children = parent.get(Field<Array<NodeId>>{p.field});
            std::size_t end = children.size();
            while (end > 0 && children[end - 1] != id) --end;
            if (end == 0) continue;
            ok = removeChild(p.node, p.field, end - 1);
        }
        if (!ok) return std::unexpected(std::move(ok.error()));
        ++count;
    }
    return count;
}

Result<> Scene::setName(NodeId id, std::string_view name) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* node = s.find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    // A name belongs to the node that got it last, as USE sees it.
    if (!name.empty())
        if (const NodeId holder = findName(name, node->scope_); holder && holder != id) {
            s.setName(*s.find(holder), {});
            s.renamedNodes.push_back({holder, s.writingExternally});
        }
    s.setName(*node, name);
    s.renamedNodes.push_back({id, s.writingExternally});
    return {};
}

namespace {

Result<> checkRoute(const Node* from, FieldIndex fromField, const Node* to, FieldIndex toField) {
    if (!from || !to) return fail(kNoSuchNode, "a route needs two nodes");
    if (fromField >= from->type().fields.size() || toField >= to->type().fields.size())
        return fail(kNoSuchField, "a route needs two fields");
    return {};
}

}  // namespace

Result<> Scene::addRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    const Node *from = find(fromNode), *to = find(toNode);
    if (auto ok = checkRoute(from, fromField, to, toField); !ok) return ok;
    const FieldDef &a = from->type().fields[fromField], &b = to->type().fields[toField];
    if (!a.sends()) return fail(kWrongAccess, fmt::format("{}.{} sends no events", from->type().name, a.name));
    if (!b.writable()) return fail(kWrongAccess, fmt::format("{}.{} takes no events", to->type().name, b.name));
    if (a.type != b.type)
        return fail(kWrongType,
                    fmt::format("route from {} {} to {} {}", info(a.type).name, a.name, info(b.type).name, b.name));
    if (from->links_)
        for (const RouteGroup& group : from->links_->out)
            if (group.field == fromField && group.targets.contains({{toNode, toField, false}})) return {};
    s.linkRoute({fromNode, fromField, toNode, toField, false}, true);
    return {};
}

Result<> Scene::removeRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    if (!s.unlinkRoute({fromNode, fromField, toNode, toField, false}, true)) return fail("no such route");
    return {};
}

Result<> Scene::addIsConnection(NodeId instance, FieldIndex instanceField, NodeId bodyNode, FieldIndex bodyField) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    const Node *from = find(instance), *to = find(bodyNode);
    if (auto ok = checkRoute(from, instanceField, to, bodyField); !ok) return ok;
    const FieldDef &a = from->type().fields[instanceField], &b = to->type().fields[bodyField];
    if (a.type != b.type)
        return fail(kWrongType,
                    fmt::format("IS between {} {} and {} {}", info(b.type).name, b.name, info(a.type).name, a.name));
    const Route inwards{instance, instanceField, bodyNode, bodyField, true};
    const Route outwards{bodyNode, bodyField, instance, instanceField, true};
    if (auto ok = s.checkIs(a.access == Access::outputOnly ? outwards : inwards); !ok) return ok;
    if (a.access != Access::outputOnly) s.linkRoute(inwards, true);
    if (a.sends()) s.linkRoute(outwards, true);
    return {};
}

Result<> Scene::sendEvent(NodeId id, FieldIndex field, Value value, std::string_view author) {
    State& s = *state_;
    if (auto ok = s.checkThread(); !ok) return ok;
    const Node* node = find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    if (field >= node->type().fields.size())
        return fail(kNoSuchField, fmt::format("{} has no field {}", node->type().name, field));
    const FieldDef& def = node->type().fields[field];
    if (!def.writable()) return fail(kWrongAccess, fmt::format("{}.{} takes no events", node->type().name, def.name));
    if (def.type != value.type())
        return fail(kWrongType, fmt::format("{}.{} is {}, not {}", node->type().name, def.name, info(def.type).name,
                                            info(value.type()).name));
    s.inputQueue.push_back({id, field, std::move(value), String(author)});
    return {};
}

void Scene::attribute(std::string_view author, NodeId id, FieldIndex field) {
    if (!state_->refuseForeign()) state_->authors.push_back({id, field, String(author)});
}

}  // namespace rtsg
