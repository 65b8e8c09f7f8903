#include <algorithm>
#include <cmath>

#include <rtsg/audio/world_geometry.h>

namespace rtsg {
namespace {

double distanceToBox(const glm::dvec3& p, const glm::dvec3& low, const glm::dvec3& high) {
    return glm::length(glm::max(glm::max(low - p, p - high), glm::dvec3(0)));
}

double distanceToTriangle(const glm::dvec3& p, const glm::dvec3 (&t)[3]) {
    const glm::dvec3 u = t[1] - t[0], v = t[2] - t[0], n = glm::cross(u, v), s = p - t[0];
    const double n2 = glm::dot(n, n);
    if (n2 > 0) {
        const double a = glm::dot(glm::cross(s, v), n) / n2, b = glm::dot(glm::cross(u, s), n) / n2;
        if (a >= 0 && b >= 0 && a + b <= 1) return std::abs(glm::dot(s, n)) / std::sqrt(n2);
    }
    double nearest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 edge = t[(i + 1) % 3] - t[i];
        const double length2 = glm::dot(edge, edge);
        const double along = length2 > 0 ? std::clamp(glm::dot(p - t[i], edge) / length2, 0.0, 1.0) : 0;
        nearest = std::min(nearest, glm::distance(p, t[i] + along * edge));
    }
    return nearest;
}

}  // namespace

WorldGeometry::WorldGeometry(const RayWorld& world) : WorldGeometry(world, Options{}) {}
WorldGeometry::WorldGeometry(const RayWorld& world, const Options& options) : world_(&world), options_(options) {}

void WorldGeometry::setMaterial(NodeId acoustics, const AcousticMaterial& material) {
    byNode_[acoustics.value] = material;
    materialsChanged_ = true;
}

void WorldGeometry::removeMaterial(NodeId acoustics) {
    if (byNode_.erase(acoustics.value)) materialsChanged_ = true;
}

void WorldGeometry::place(const RayInstance& instance, std::uint32_t triangle, glm::dvec3 (&corners)[3]) const {
    for (std::uint32_t c = 0; c < 3; ++c)
        corners[c] = instance.info.worldFromLocal * glm::dvec4(instance.mesh->vertex(triangle, c), 1.0);
}

bool WorldGeometry::update() {
    if (version_ > 0 && !materialsChanged_ && worldVersion_ == world_->version()) return false;
    materials_.assign(1, options_.defaultMaterial);
    std::unordered_map<std::uint32_t, std::uint32_t> materialOf;
    for (const auto& [node, material] : byNode_) {
        materialOf[node] = static_cast<std::uint32_t>(materials_.size());
        materials_.push_back(material);
    }
    const auto instances = world_->instances();
    std::size_t triangles = 0;
    for (const RayInstance& instance : instances)
        if (instance.info.id && instance.mesh) triangles += instance.mesh->triangleCount;
    const bool merge = triangles <= options_.maxPlaneTriangles;

    slots_.assign(instances.size(), {});
    planeOf_.clear();
    if (merge) planeOf_.reserve(triangles);
    PlaneMerger merger;
    std::vector<double> mirrors;
    for (std::size_t i = 0; i < instances.size(); ++i) {
        const RayInstance& instance = instances[i];
        if (!instance.info.id || !instance.mesh) continue;
        const auto material = materialOf.find(instance.info.acoustics.value);
        slots_[i] = {planeOf_.size(), material == materialOf.end() ? 0 : material->second};
        if (!merge) continue;
        const double share = materials_[slots_[i].material].mostMirrored();
        for (std::uint32_t t = 0; t < instance.mesh->triangleCount; ++t) {
            glm::dvec3 corners[3];
            place(instance, t, corners);
            const std::uint32_t plane = merger.add(corners[0], corners[1], corners[2]);
            planeOf_.push_back(plane);
            if (plane == kNoPlane) continue;
            if (plane >= mirrors.size()) mirrors.resize(plane + 1, 0.0);
            mirrors[plane] = std::max(mirrors[plane], share);
        }
    }
    planes_ = merger.finish();
    for (std::size_t i = 0; i < planes_.size(); ++i) planes_[i].mirrors = mirrors[i];
    worldVersion_ = world_->version();
    materialsChanged_ = false;
    ++version_;
    return true;
}

bool WorldGeometry::closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance,
                            std::uint32_t except, AcousticHit& hit) const {
    if (!(maxDistance > 0)) return false;
    Ray ray;
    ray.origin = world_->fromWorld(origin);
    ray.direction = Vec3f(direction);
    ray.tMax = static_cast<float>(std::min(maxDistance, 1e9));
    // The surface a ray starts on may be hit within the rounding of its origin, at most once for each of its triangles
    // that meet there; the limit is for geometry that is thousands of layers thick.
    for (int attempt = 0; attempt < 256; ++attempt) {
        const Hit found = world_->intersect(ray, RayKind::sound);
        if (!found) return false;
        const Slot& slot = slots_[found.instance];
        const std::uint32_t plane = planeOf_.empty() ? (found.instance * 0x9E3779B1u + found.triangle) & 0x7FFFFFFFu
                                                     : planeOf_[slot.firstPlane + found.triangle];
        if (plane != except || plane == kNoPlane) {
            hit.plane = plane;
            hit.material = slot.material;
            hit.distance = static_cast<double>(found.t);
            hit.normal = glm::normalize(glm::dvec3(found.normal));
            if (plane < planes_.size()) {
                hit.normal = planes_[plane].normal;
                const double exact = -planes_[plane].signedDistance(origin) / glm::dot(direction, hit.normal);
                // Grazing rays amplify what little the merged triangles are apart: then the triangle itself is right.
                if (std::abs(exact - hit.distance) < 1e-3 * (1 + hit.distance)) hit.distance = std::max(0.0, exact);
            }
            return true;
        }
        ray.tMin = std::nextafter(std::max(found.t, 1e-30f), std::numeric_limits<float>::infinity());
        if (!(ray.tMin < ray.tMax)) return false;
    }
    return false;
}

double WorldGeometry::distanceToSurface(const glm::dvec3& point) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const RayInstance& instance : world_->instances()) {
        if (!instance.info.id || !instance.mesh || instance.mesh->bounds.empty()) continue;
        glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
        for (int i = 0; i < 8; ++i) {
            const Bounds& box = instance.mesh->bounds;
            const glm::dvec3 corner =
                instance.info.worldFromLocal * glm::dvec4(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y,
                                                          i & 4 ? box.max.z : box.min.z, 1.0);
            low = glm::min(low, corner);
            high = glm::max(high, corner);
        }
        if (distanceToBox(point, low, high) >= nearest) continue;
        for (std::uint32_t t = 0; t < instance.mesh->triangleCount; ++t) {
            glm::dvec3 corners[3];
            place(instance, t, corners);
            nearest = std::min(nearest, distanceToTriangle(point, corners));
        }
    }
    return nearest;
}

}  // namespace rtsg
