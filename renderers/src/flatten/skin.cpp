// Moves the points and normals of skinned humanoids with their joints.
#include "skin.h"

#include <utility>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/instance_delta.h>

namespace rtsg::flatten {

namespace {

/// What no skeleton needs; what does has shared joints many times over.
constexpr std::size_t kMostJoints = 100'000;

Array<Vec3f> pointsOf(const Scene& scene, NodeId coordinate) {
    const Node* node = scene.find(coordinate);
    if (!node) return {};
    if (node->is(x3d::Coordinate::type)) return node->get(x3d::Coordinate::point);
    if (!node->is(x3d::CoordinateDouble::type)) return {};
    Array<Vec3f> result;
    for (const Vec3d& p : node->get(x3d::CoordinateDouble::point)) result.push_back(Vec3f(p));
    return result;
}

/// Sums what the joints do to each point.
class Blend {
  public:
    explicit Blend(const Array<Vec3f>& rest) : rest_(rest), offset_(rest.size(), Vec3d(0)) {}

    void add(const Scene& scene, const Node& joint, const WorldFromLocal& m) {
        const Array<std::int32_t>& index = joint.get(x3d::HAnimJoint::skinCoordIndex);
        const Array<float>& weight = joint.get(x3d::HAnimJoint::skinCoordWeight);
        for (std::size_t i = 0; i < index.size(); ++i) {
            const auto at = static_cast<std::uint32_t>(index[i]);
            const double w = i < weight.size() ? double{weight[i]} : 1.0;
            if (at >= rest_.size() || !std::isfinite(w)) continue;
            const Vec3d p(rest_[at]);
            offset_[at] += w * (m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3] - p);
        }
        for (const NodeId id : joint.get(x3d::HAnimJoint::displacers)) {
            const Node* displacer = scene.find(id);
            if (!displacer || !displacer->is(x3d::HAnimDisplacer::type)) continue;
            const auto w = double{displacer->get(x3d::HAnimDisplacer::weight)};
            const Array<std::int32_t>& points = displacer->get(x3d::HAnimDisplacer::coordIndex);
            const Array<Vec3f>& by = displacer->get(x3d::HAnimDisplacer::displacements);
            if (w == 0 || !std::isfinite(w)) continue;
            for (std::size_t i = 0; i < std::min(points.size(), by.size()); ++i)
                if (const auto at = static_cast<std::uint32_t>(points[i]); at < rest_.size())
                    offset_[at] += w * (m[0] * double{by[i].x} + m[1] * double{by[i].y} + m[2] * double{by[i].z});
        }
    }
    Array<Vec3f> result() const {
        Array<Vec3f> points = Array<Vec3f>::ofSize(rest_.size());
        Vec3f* out = points.mutableData();
        for (std::size_t i = 0; i < rest_.size(); ++i) out[i] = Vec3f(Vec3d(rest_[i]) + offset_[i]);
        return points;
    }

  private:
    const Array<Vec3f>& rest_;
    std::vector<Vec3d> offset_;
};

}  // namespace

void Skins::mark(const Scene& scene, NodeId node) {
    climbing_.assign(1, node);
    for (std::size_t steps = 0; !climbing_.empty() && steps < kMostJoints; ++steps) {
        const NodeId id = climbing_.back();
        climbing_.pop_back();
        const Node* at = scene.find(id);
        if (!at) continue;
        if (at->is(x3d::HAnimHumanoid::type)) {
            Humanoid& humanoid = humanoids_[id.value];
            if (!std::exchange(humanoid.marked, true)) marked_.push_back(id.value);
        } else if (id == node || at->is(x3d::HAnimJoint::type)) {
            for (const ParentRef& parent : scene.parents(id)) climbing_.push_back(parent.node);
        }
    }
}

void Skins::startOver(const Scene& scene) {
    humanoids_.clear();
    points_.clear();
    marked_.clear();
    scene.forEachNode([&](const Node& node) {
        if (node.is(x3d::HAnimHumanoid::type)) mark(scene, node.id());
    });
}

void Skins::letGo(Humanoid& humanoid, std::vector<NodeId>& changed) {
    if (humanoid.coordinate && points_.erase(humanoid.coordinate.value)) changed.push_back(humanoid.coordinate);
    humanoid.coordinate = {};
}

void Skins::update(const Scene& scene, RoleTable& roles, std::vector<NodeId>& changed) {
    if (marked_.empty()) return;
    for (const std::uint32_t value : marked_) {
        const auto found = humanoids_.find(value);
        if (found == humanoids_.end()) continue;
        found->second.marked = false;
        compute(scene, roles, NodeId{value}, found->second, changed);
        if (!scene.find(NodeId{value})) humanoids_.erase(found);
    }
    marked_.clear();
}

void Skins::compute(const Scene& scene, RoleTable& roles, NodeId id, Humanoid& humanoid, std::vector<NodeId>& changed) {
    const Node* node = scene.find(id);
    const NodeId coordinate = node ? node->get(x3d::HAnimHumanoid::skinCoord) : NodeId{};
    if (coordinate != humanoid.coordinate) letGo(humanoid, changed);
    if (!coordinate || !node) return;
    const NodeId binding = node->get(x3d::HAnimHumanoid::skinBindingCoords);
    const Array<Vec3f> rest = pointsOf(scene, binding ? binding : coordinate);
    if (rest.empty()) return letGo(humanoid, changed);
    Blend blend(rest);
    struct Visit {
        NodeId joint;
        WorldFromLocal above;
    };
    std::vector<Visit> stack;
    for (const NodeId root : node->get(x3d::HAnimHumanoid::skeleton)) stack.push_back({root, identityTransform()});
    for (std::size_t joints = 0; !stack.empty() && joints < kMostJoints; ++joints) {
        const Visit visit = stack.back();
        stack.pop_back();
        const Node* joint = scene.find(visit.joint);
        if (!joint || !joint->is(x3d::HAnimJoint::type)) continue;
        WorldFromLocal local = identityTransform();
        (void)localTransform(scene, *joint, roles.of(*joint), local);
        const WorldFromLocal m = compose(visit.above, local);
        blend.add(scene, *joint, m);
        for (const NodeId child : joint->get(x3d::HAnimJoint::children)) stack.push_back({child, m});
    }
    humanoid.coordinate = coordinate;
    points_[coordinate.value] = blend.result();
    changed.push_back(coordinate);
}

}  // namespace rtsg::flatten
