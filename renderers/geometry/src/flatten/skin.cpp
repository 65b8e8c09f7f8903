// Moves the points and normals of skinned humanoids with their joints.
#include "skin.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/instance_delta.h>

namespace rtsg::flatten {

namespace {

/// More joints than any real skeleton has; one that seems to have more shares joints many times over.
constexpr std::size_t kMaxJoints = 100'000;

Array<Vec3f> pointsOf(const Scene& scene, NodeId coordinate) {
    const Node* node = scene.find(coordinate);
    if (!node) return {};
    if (node->is(x3d::Coordinate::type)) return node->get(x3d::Coordinate::point);
    if (!node->is(x3d::CoordinateDouble::type)) return {};
    Array<Vec3f> result;
    for (const Vec3d& p : node->get(x3d::CoordinateDouble::point)) result.push_back(Vec3f(p));
    return result;
}

Array<Vec3f> vectorsOf(const Scene& scene, NodeId normal) {
    const Node* node = scene.find(normal);
    return node && node->is(x3d::Normal::type) ? node->get(x3d::Normal::vector) : Array<Vec3f>();
}

/// How normals turn where points go by the linear part of `m`; of what flattens: as the points.
glm::dmat3 posedFromRestNormal(const WorldFromLocal& m) {
    const glm::dmat3 linear(m[0], m[1], m[2]);
    return determinantSign(m) == 0 ? linear : glm::transpose(glm::inverse(linear));
}

/// Sums what joints and displacers do to each point, and joints to each normal.
class Blend {
  public:
    /// `normals` is as long as `rest`, or empty; `points`: the field that `rest` is of.
    Blend(const Array<Vec3f>& rest, const Array<Vec3f>& normals, const char* points, Diagnostics& problems)
        : rest_(rest),
          normals_(normals),
          points_(points),
          problems_(problems),
          offset_(rest.size(), Vec3d(0)),
          turned_(normals.size(), Vec3d(0)) {}

    void add(const Scene& scene, const Node& joint, const WorldFromLocal& m) {
        const Array<std::int32_t>& index = joint.get(x3d::HAnimJoint::skinCoordIndex);
        const Array<float>& weight = joint.get(x3d::HAnimJoint::skinCoordWeight);
        const glm::dmat3 rotation = posedFromRestNormal(m);
        for (std::size_t i = 0; i < index.size(); ++i) {
            const auto at = static_cast<std::uint32_t>(index[i]);
            const double w = i < weight.size() ? double{weight[i]} : 1.0;
            if (at >= rest_.size()) reportOnce(scene, joint, "skinCoordIndex", i, index[i]);
            if (at >= rest_.size() || !std::isfinite(w)) continue;
            const Vec3d p(rest_[at]);
            offset_[at] += w * (m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3] - p);
            if (at < normals_.size()) turned_[at] += w * (rotation * Vec3d(normals_[at]) - Vec3d(normals_[at]));
        }
        reported_ = false;
        displace(scene, joint.get(x3d::HAnimJoint::displacers), m);
    }
    void displace(const Scene& scene, const Array<NodeId>& displacers, const WorldFromLocal& m) {
        for (const NodeId id : displacers) {
            const Node* displacer = scene.find(id);
            if (!displacer || !displacer->is(x3d::HAnimDisplacer::type)) continue;
            const auto w = double{displacer->get(x3d::HAnimDisplacer::weight)};
            const Array<std::int32_t>& points = displacer->get(x3d::HAnimDisplacer::coordIndex);
            const Array<Vec3f>& by = displacer->get(x3d::HAnimDisplacer::displacements);
            if (w == 0 || !std::isfinite(w)) continue;
            for (std::size_t i = 0; i < std::min(points.size(), by.size()); ++i)
                if (const auto at = static_cast<std::uint32_t>(points[i]); at < rest_.size())
                    offset_[at] += w * (m[0] * double{by[i].x} + m[1] * double{by[i].y} + m[2] * double{by[i].z});
                else
                    reportOnce(scene, *displacer, "coordIndex", i, points[i]);
            reported_ = false;
        }
    }
    Array<Vec3f> points() const { return sum(rest_, offset_); }
    Array<Vec3f> normals() const { return sum(normals_, turned_); }

  private:
    static Array<Vec3f> sum(const Array<Vec3f>& rest, const std::vector<Vec3d>& offset) {
        Array<Vec3f> result = Array<Vec3f>::ofSize(rest.size());
        Vec3f* out = result.mutableData();
        for (std::size_t i = 0; i < rest.size(); ++i) out[i] = Vec3f(Vec3d(rest[i]) + offset[i]);
        return result;
    }

    /// Reports the first index of a node that is beyond the points.
    void reportOnce(const Scene& scene, const Node& node, const char* field, std::size_t i, std::int32_t index) {
        if (std::exchange(reported_, true)) return;
        const std::string_view name = scene.name(node.id());
        problems_.warningAt(scene.locationOf(node.id()),
                            fmt::format("{}{}{}: {}[{}] is {}, but {} has {} points, counted from 0", node.type().name,
                                        name.empty() ? "" : " ", name, field, i, index, points_, rest_.size()),
                            DiagnosticCode("geometry"));
    }

    const Array<Vec3f>&rest_, &normals_;
    const char* points_;
    Diagnostics& problems_;
    bool reported_ = false;
    std::vector<Vec3d> offset_, turned_;
};

/// Adds the motion of all joints of the skeleton.
void addSkeleton(const Scene& scene, RoleTable& roles, const Node& humanoid, Blend& blend) {
    struct Visit {
        NodeId joint;
        WorldFromLocal above;
    };
    std::vector<Visit> stack;
    for (const NodeId root : humanoid.get(x3d::HAnimHumanoid::skeleton)) stack.push_back({root, identityTransform()});
    for (std::size_t joints = 0; !stack.empty() && joints < kMaxJoints; ++joints) {
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
}

bool isBody(const Node& node) {
    return node.is(x3d::HAnimHumanoid::type) || node.is(x3d::HAnimSegment::type);
}

}  // namespace

void Skins::mark(const Scene& scene, NodeId node) {
    climbing_.assign(1, node);
    for (std::size_t steps = 0; !climbing_.empty() && steps < kMaxJoints; ++steps) {
        const NodeId id = climbing_.back();
        climbing_.pop_back();
        const Node* at = scene.find(id);
        if (!at) continue;
        if (isBody(*at)) {
            Body& body = bodies_[id.value];
            if (!std::exchange(body.marked, true)) marked_.push_back(id.value);
        } else if (id == node || at->is(x3d::HAnimJoint::type)) {
            for (const ParentRef& parent : scene.parents(id)) climbing_.push_back(parent.node);
        }
    }
}

void Skins::startOver(const Scene& scene) {
    bodies_.clear();
    points_.clear();
    marked_.clear();
    scene.forEachNode([&](const Node& node) {
        if (isBody(node)) mark(scene, node.id());
    });
}

void Skins::letGo(NodeId& moved, std::vector<NodeId>& changed) {
    if (moved && points_.erase(moved.value)) changed.push_back(moved);
    moved = {};
}

void Skins::put(NodeId& moved, NodeId node, Array<Vec3f> values, std::vector<NodeId>& changed) {
    if (node != moved) letGo(moved, changed);
    if (values.empty()) return letGo(moved, changed);
    moved = node;
    points_[node.value] = std::move(values);
    changed.push_back(node);
}

void Skins::update(const Scene& scene, RoleTable& roles, std::vector<NodeId>& changed, Diagnostics& problems) {
    if (marked_.empty()) return;
    for (const std::uint32_t value : marked_) {
        const auto found = bodies_.find(value);
        if (found == bodies_.end()) continue;
        found->second.marked = false;
        compute(scene, roles, NodeId{value}, found->second, changed, problems);
        if (!found->second.coordinate) bodies_.erase(found);
    }
    marked_.clear();
}

void Skins::compute(const Scene& scene, RoleTable& roles, NodeId id, Body& body, std::vector<NodeId>& changed,
                    Diagnostics& problems) {
    const Node* node = scene.find(id);
    if (node && node->is(x3d::HAnimSegment::type)) {
        const Array<NodeId>& displacers = node->get(x3d::HAnimSegment::displacers);
        const NodeId coordinate = displacers.empty() ? NodeId{} : node->get(x3d::HAnimSegment::coord);
        const Array<Vec3f> rest = pointsOf(scene, coordinate), none;
        Blend blend(rest, none, "coord", problems);
        blend.displace(scene, displacers, identityTransform());
        return put(body.coordinate, coordinate, blend.points(), changed);
    }
    using H = x3d::HAnimHumanoid;
    const NodeId coordinate = node ? node->get(H::skinCoord) : NodeId{};
    const NodeId binding = node ? node->get(H::skinBindingCoords) : NodeId{};
    const Array<Vec3f> rest = coordinate ? pointsOf(scene, binding ? binding : coordinate) : Array<Vec3f>();
    const NodeId normal = node && !rest.empty() ? node->get(H::skinNormal) : NodeId{};
    const NodeId boundNormals = node ? node->get(H::skinBindingNormals) : NodeId{};
    Array<Vec3f> normals = normal ? vectorsOf(scene, boundNormals ? boundNormals : normal) : Array<Vec3f>();
    if (normals.size() != rest.size()) normals = {};
    Blend blend(rest, normals, binding ? "skinBindingCoords" : "skinCoord", problems);
    if (!rest.empty()) addSkeleton(scene, roles, *node, blend);
    put(body.coordinate, coordinate, blend.points(), changed);
    put(body.normal, normal, blend.normals(), changed);
}

}  // namespace rtsg::flatten
