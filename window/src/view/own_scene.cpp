// Follows a scene but for the Transforms that are kept before an eye, and takes rays from here to there.
#include <rtsg/window/own_scene.h>

#include <algorithm>
#include <cmath>

#include <rtsg/core/placement.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

using Sensor = x3d::ProximitySensor;
using Moved = x3d::Transform;

/// `keeps(target, field, isPosition)` for each ROUTE that keeps something before the viewer.
template <class F>
void eachKept(const Scene& scene, const Node& sensor, const F& keeps) {
    for (const Route& route : scene.routesFrom(sensor.id())) {
        const Node* to = scene.find(route.toNode);
        if (!to || !to->is(Moved::type) || route.isConnection) continue;
        const bool isPosition = route.fromField == Sensor::position_changed.index;
        if (isPosition && route.toField == Moved::translation.index) keeps(*to, route.toField, true);
        const bool isOrientation = route.fromField == Sensor::orientation_changed.index;
        if (isOrientation && route.toField == Moved::rotation.index) keeps(*to, route.toField, false);
    }
}

}  // namespace

glm::dmat4 worldAroundNode(const Scene& scene, NodeId id) {
    constexpr int kDeepest = 10'000;
    glm::dmat4 world(1);
    for (int depth = 0; depth < kDeepest; ++depth) {
        const std::vector<ParentRef> parents = scene.parents(id);
        const auto field = std::ranges::find_if(
            parents, [&](const ParentRef& p) { return isTransform(scene.node(p.node).type(), p.field); });
        if (field == parents.end()) break;
        id = field->node;
        world = parentFromLocal(scene, scene.node(id)) * world;
    }
    return world;
}

bool OwnScene::isNeeded(const Scene& theirs) {
    bool found = false;
    theirs.forEachNode([&](const Node& node) {
        if (node.is(Sensor::type)) eachKept(theirs, node, [&](const Node&, FieldIndex, bool) { found = true; });
    });
    return found;
}

OwnScene::OwnScene(Scene& theirs) : theirs_(theirs) {
    shown_.setBehavioursEnabled(false);
    attachment_ = theirs_.bus().attach(*this, Delivery::immediate);
}
OwnScene::~OwnScene() = default;

/// Applies the set as the next state of the scene shown, whose hash is its own.
Result<> OwnScene::show(ChangeSet set) {
    set.from = shown_.sequence();
    set.to = set.from + 1;
    set.time = std::max(shown_.now(), theirs_.now());
    set.hash = {};
    return shown_.apply(std::make_shared<const ChangeSet>(std::move(set)));
}

Result<> OwnScene::apply(const Scene&, const ChangeSet& changes) {
    if (changes.isSnapshot()) {
        if (shown_.sequence() > 0)
            if (auto ok = shown_.reset(); !ok) return ok;
        shown_.setBehavioursEnabled(false);
        stale_ = true;
        ours_.clear();
        return shown_.apply(std::make_shared<const ChangeSet>(changes));
    }
    ChangeSet rest = changes;
    rest.input.reset();
    std::erase_if(rest.changes, [&](const Change& c) {
        stale_ = stale_ || c.kind == ChangeKind::addRoute || c.kind == ChangeKind::removeRoute ||
                 c.kind == ChangeKind::destroyNode;
        if (c.kind == ChangeKind::destroyNode)
            std::erase_if(ours_, [&](const auto& entry) { return entry.first.first == c.node.value; });
        return c.kind == ChangeKind::setField && ours_.contains({c.node.value, c.field});
    });
    return show(std::move(rest));
}

void OwnScene::find() {
    kept_.clear();
    shown_.forEachNode([&](const Node& node) {
        if (!node.is(Sensor::type)) return;
        eachKept(shown_, node, [&](const Node& to, FieldIndex field, bool isPosition) {
            Kept one{node.id(), {0, kNoField}, {0, kNoField}};
            FieldKey& key = isPosition ? one.position : one.orientation;
            key = FieldKey(to.id().value, field);
            kept_.push_back(one);
        });
    });
}

/// The values that the sensor would send for this eye, which it may not detect.
void OwnScene::want(const Kept& kept, const ViewerPose& eye, std::map<FieldKey, Value>& wanted) const {
    const Node* sensor = shown_.find(kept.sensor);
    if (!sensor || !sensor->get(Sensor::enabled)) return;
    const glm::dmat4 local = glm::inverse(worldAroundNode(shown_, kept.sensor));
    const Vec3d at(local * glm::dvec4(eye.position, 1));
    const Vec3d off = glm::abs(at - Vec3d(sensor->get(Sensor::center))), half = Vec3d(sensor->get(Sensor::size)) / 2.0;
    if (!(off.x <= half.x && off.y <= half.y && off.z <= half.z) || !(half.x * half.y * half.z > 0)) return;
    if (kept.position.second != kNoField) wanted.insert_or_assign(kept.position, Value(Vec3f(at)));
    if (kept.orientation.second == kNoField) return;
    glm::dmat3 rotation(local);
    for (int i = 0; i < 3; ++i) rotation[i] = glm::normalize(rotation[i]);
    const ViewerPose seen{at, glm::normalize(glm::quat_cast(rotation) * eye.orientation)};
    wanted.insert_or_assign(kept.orientation, Value(orientationOf(seen)));
}

Result<> OwnScene::setPose(const std::optional<ViewerPose>& eye) {
    if (!eye && ours_.empty()) return {};
    if (std::exchange(stale_, false)) find();
    std::map<FieldKey, Value> wanted;
    if (eye)
        for (const Kept& kept : kept_) want(kept, *eye, wanted);
    ChangeSet set;
    const auto change = [&](const FieldKey& field, const Value& value) {
        const Node* node = shown_.find(NodeId{field.first});
        if (!node || node->value(field.second) == value) return;
        Change& one = set.changes.emplace_back();
        one.node = node->id(), one.field = field.second, one.value = value;
    };
    for (const auto& [field, value] : ours_)
        if (const Node* there = theirs_.find(NodeId{field.first}); there && !wanted.contains(field))
            change(field, there->value(field.second));
    for (const auto& [field, value] : wanted) change(field, value);
    ours_ = std::move(wanted);
    return set.changes.empty() ? Result<>() : show(std::move(set));
}

std::optional<NodeId> OwnScene::keptOn(std::span<const NodeId> path) const {
    for (const NodeId id : path)
        if (const auto ours = ours_.lower_bound({id.value, 0}); ours != ours_.end() && ours->first.first == id.value)
            return id;
    return std::nullopt;
}

PointerInput OwnScene::asThere(const PointerInput& ray, NodeId kept) const {
    const Node *here = shown_.find(kept), *there = theirs_.find(kept);
    if (!here || !there) return ray;
    const glm::dmat4 around = worldAroundNode(shown_, kept);
    const glm::dmat4 moves =
        around * parentFromLocal(theirs_, *there) * glm::inverse(around * parentFromLocal(shown_, *here));
    PointerInput theirs = ray;
    theirs.origin = Vec3d(moves * glm::dvec4(ray.origin, 1));
    theirs.direction = glm::normalize(glm::dmat3(moves) * ray.direction);
    const Vec3d& o = theirs.origin;
    const Vec3d& d = theirs.direction;
    return std::isfinite(o.x + o.y + o.z + d.x + d.y + d.z) ? theirs : ray;
}

}  // namespace rtsg
