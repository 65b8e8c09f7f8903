// The table of shining triangles and the tree over them.
#include "emitters.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "trace_scene.h"

namespace rtsg::trace {

namespace {

/// Beyond this number of triangles, instances are left to bounces.
constexpr std::size_t kMost = std::size_t{1} << 22;

float largest(const Vec3f& v) {
    return std::max({v.x, v.y, v.z});
}

/// What a material emits at most, whatever its textures; 0: nothing, or not of the kind that is looked for.
float emission(const Material& material, const Mesh& mesh) {
    if (material.transmits() || material.refractiveIndex > 0 || material.reflectivity != Vec3f(0)) return 0;
    if (!material.stages.empty() || material.hatching.present) return 0;
    if (material.model != ShadingModel::unlit) return largest(material.linear.emissive);
    return mesh.colors.present() ? 1.0f : largest(material.linear.base);
}

/// cos(max(0, a - b)) of two angles from 0 to pi.
float cosOfDifference(float sinA, float cosA, float sinB, float cosB) {
    return cosA > cosB ? 1.0f : cosA * cosB + sinA * sinB;
}
float sinOf(float cosine) {
    return std::sqrt(std::max(1 - cosine * cosine, 0.0f));
}

}  // namespace

Emitters::Emitters(const TraceScene& scene) {
    const RayInstances& instances = scene.world->instances();
    for (std::uint32_t slot = 0; slot < instances.size(); ++slot) add(scene, slot);
    if (emitters_.empty()) return;
    order_.resize(emitters_.size());
    std::iota(order_.begin(), order_.end(), 0u);
    ways_.resize(emitters_.size());
    // A triangle without area never lights anything: density() of it is asked for by nobody.
    std::erase_if(order_, [&](std::uint32_t e) { return !(power_[e] > 0); });
    nodes_.reserve(order_.size() * 2);
    if (!order_.empty()) {
        nodes_.emplace_back();
        build(0, order_.size(), 0, 0, 0);
    } else {
        emitters_.clear();
    }
    order_ = {};
    power_ = {};
}

void Emitters::add(const TraceScene& scene, std::uint32_t slot) {
    const RayInstance& instance = scene.world->instance(slot);
    if (!instance.mesh || slot >= scene.slots.size()) return;
    const Mesh& mesh = *instance.mesh;
    const Material& front = scene.materials[scene.slots[slot].material].material;
    if (mesh.colors.present() && mesh.colors.components() == 4) return;
    const float glow = std::max(emission(front, mesh), front.back ? emission(*front.back, mesh) : 0.0f);
    if (!(glow > 0) || mesh.triangleCount == 0 || emitters_.size() + mesh.triangleCount > kMost) return;
    firstOf_.resize(scene.world->instances().size(), kNone);
    firstOf_[slot] = static_cast<std::uint32_t>(emitters_.size());
    const bool bothSides = !mesh.solid;
    for (std::uint32_t triangle = 0; triangle < mesh.triangleCount; ++triangle) {
        Emitter e;
        const auto place = [&](std::uint32_t corner) {
            return instance.rayFromLocal * Vec4f(mesh.vertex(triangle, corner), 1);
        };
        e.corner = place(0), e.ab = place(1) - e.corner, e.ac = place(2) - e.corner;
        const Vec3d normal = glm::cross(Vec3d(e.ab), Vec3d(e.ac));
        const double twice = glm::length(normal);
        const bool good = twice > 0 && std::isfinite(twice);
        e.area = good ? static_cast<float>(twice / 2) : 0.0f;
        if (good) e.normal = Vec3f(normal / twice) * static_cast<float>(instance.sign);
        e.instance = slot, e.triangle = triangle, e.bothSides = bothSides;
        emitters_.push_back(e);
        const float power = glow * e.area * (bothSides ? 2.0f : 1.0f);
        power_.push_back(std::isfinite(power) ? std::min(power, 1e20f) : 0.0f);
    }
}

Emitters::Cluster Emitters::clusterOf(std::uint32_t emitter) const {
    const Emitter& e = emitters_[emitter];
    Cluster result;
    result.bounds.extend(e.corner);
    result.bounds.extend(e.corner + e.ab);
    result.bounds.extend(e.corner + e.ac);
    result.axis = e.normal;
    result.cosCone = e.bothSides ? -1.0f : 1.0f;
    result.power = power_[emitter];
    return result;
}

Emitters::Cluster Emitters::join(const Cluster& a, const Cluster& b) {
    Cluster result = a;
    result.bounds.extend(b.bounds.min);
    result.bounds.extend(b.bounds.max);
    result.power += b.power;
    if (a.cosCone <= -1 || b.cosCone <= -1) {
        result.cosCone = -1;
        return result;
    }
    const float angleA = std::acos(std::clamp(a.cosCone, -1.0f, 1.0f)),
                angleB = std::acos(std::clamp(b.cosCone, -1.0f, 1.0f)),
                between = std::acos(std::clamp(glm::dot(a.axis, b.axis), -1.0f, 1.0f));
    // A little more than needed, as these are rounded.
    constexpr float kSlack = 1e-3f;
    const float pi = 3.14159265f;
    if (between + angleB <= angleA) return result;
    if (between + angleA <= angleB) {
        result.axis = b.axis, result.cosCone = b.cosCone;
        return result;
    }
    const float angle = (between + angleA + angleB) / 2 + kSlack;
    const Vec3f across = b.axis - glm::dot(a.axis, b.axis) * a.axis;
    const float length = glm::length(across);
    if (angle >= pi || !(length > 1e-6f)) {
        result.cosCone = length > 1e-6f || glm::dot(a.axis, b.axis) < 0 ? -1.0f : std::cos(std::min(angle, pi));
        return result;
    }
    const float turn = angle - angleA;
    result.axis = glm::normalize(std::cos(turn) * a.axis + std::sin(turn) * (across / length));
    result.cosCone = std::cos(angle);
    return result;
}

// Halves by the middle of the longest side, so that no way is longer than 64 forks.
Emitters::Cluster Emitters::build(std::size_t first, std::size_t last, std::uint32_t node, std::uint32_t depth,
                                  std::uint64_t way) {
    Cluster cluster;
    if (last - first == 1) {
        const std::uint32_t emitter = order_[first];
        cluster = clusterOf(emitter);
        nodes_[node].leaf = true;
        nodes_[node].next = emitter;
        ways_[emitter] = way;
    } else {
        Bounds centers;
        const auto middle = [&](std::uint32_t e) {
            return emitters_[e].corner + (emitters_[e].ab + emitters_[e].ac) * (1 / 3.0f);
        };
        for (std::size_t i = first; i < last; ++i) centers.extend(middle(order_[i]));
        const Vec3f size = centers.size();
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const std::size_t half = first + (last - first) / 2;
        const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
        std::nth_element(at(first), at(half), at(last), [&](std::uint32_t a, std::uint32_t b) {
            const float x = middle(a)[axis], y = middle(b)[axis];
            return x != y ? x < y : a < b;
        });
        nodes_.emplace_back();
        const Cluster one = build(first, half, node + 1, depth + 1, way);
        const auto second = static_cast<std::uint32_t>(nodes_.size());
        nodes_[node].next = second;
        nodes_.emplace_back();
        cluster = join(one, build(half, last, second, depth + 1, way | std::uint64_t{1} << depth));
    }
    Node& n = nodes_[node];
    n.center = cluster.bounds.center();
    const Vec3f diagonal = cluster.bounds.size() * 0.5f;
    n.radiusSquared = glm::dot(diagonal, diagonal) * 1.0001f;
    n.axis = cluster.axis, n.cosCone = cluster.cosCone, n.sinCone = sinOf(cluster.cosCone), n.power = cluster.power;
    return cluster;
}

/// An estimate of the light from there that is 0 only where nothing can come: the cosines are those of the most
/// favourable directions within the sphere around the node as the point sees it, and within its cone of normals.
float Emitters::importance(const Node& node, const Vec3f& point, const Vec3f& normal) {
    constexpr float kLeast = 1e-12f;  // m^2, so that no sum leaves the range of float
    Vec3f towards = node.center - point;
    const float distanceSquared = glm::dot(towards, towards);
    if (!(distanceSquared > node.radiusSquared)) return node.power / std::max(node.radiusSquared, kLeast);
    towards *= 1 / std::sqrt(distanceSquared);
    constexpr float kSlack = 1e-4f;  // of the rounded cosines
    const float sinSphere = std::sqrt(node.radiusSquared / distanceSquared), cosSphere = sinOf(sinSphere);
    const float cosAway = std::clamp(glm::dot(normal, towards), -1.0f, 1.0f);
    const float lit = cosOfDifference(sinOf(cosAway), cosAway, sinSphere, cosSphere) + kSlack;
    if (lit <= 0) return 0;
    float shines = 1;
    if (node.cosCone > -1) {
        const float cosAxis = std::clamp(-glm::dot(node.axis, towards), -1.0f, 1.0f), sinAxis = sinOf(cosAxis);
        if (cosAxis < node.cosCone) {
            const float cosLeft = cosAxis * node.cosCone + sinAxis * node.sinCone;
            shines = cosOfDifference(sinOf(std::clamp(cosLeft, -1.0f, 1.0f)), cosLeft, sinSphere, cosSphere) + kSlack;
        }
        if (shines <= 0) return 0;
    }
    return node.power * lit * shines / std::max(distanceSquared, kLeast);
}

Emitters::Choice Emitters::sample(const Vec3f& point, const Vec3f& normal, float u) const {
    Choice result;
    if (nodes_.empty()) return result;
    float probability = 1;
    std::uint32_t at = 0;
    while (!nodes_[at].leaf) {
        const float a = importance(nodes_[at + 1], point, normal),
                    b = importance(nodes_[nodes_[at].next], point, normal);
        if (!(a + b > 0)) return result;
        const float share = a / (a + b);
        if (u < share) {
            u /= share, probability *= share, at = at + 1;
        } else {
            u = (u - share) / (1 - share), probability *= 1 - share, at = nodes_[at].next;
        }
        u = std::min(u, 0x1.fffffep-1f);
    }
    result.emitter = nodes_[at].next, result.probability = probability;
    return result;
}

float Emitters::density(std::uint32_t emitter, const Vec3f& point, const Vec3f& normal) const {
    float probability = 1;
    std::uint32_t at = 0;
    for (std::uint64_t way = ways_[emitter]; !nodes_[at].leaf; way >>= 1) {
        const float a = importance(nodes_[at + 1], point, normal),
                    b = importance(nodes_[nodes_[at].next], point, normal);
        if (!(a + b > 0)) return 0;
        const float share = a / (a + b);
        probability *= way & 1u ? 1 - share : share;
        at = way & 1u ? nodes_[at].next : at + 1;
    }
    return nodes_[at].next == emitter ? probability : 0.0f;
}

std::uint32_t Emitters::find(std::uint32_t instance, std::uint32_t triangle) const {
    if (instance >= firstOf_.size() || firstOf_[instance] == kNone) return kNone;
    return firstOf_[instance] + triangle;
}

}  // namespace rtsg::trace
