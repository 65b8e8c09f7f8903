#include <algorithm>
#include <array>
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

struct WorldGeometry::MeshPlanes {
    std::vector<ReflectingPlane> planes;
    std::vector<std::uint32_t> planeOf;  // by triangle
    bool tooMany = false;
};

WorldGeometry::WorldGeometry(const RayWorld& world) : WorldGeometry(world, Options{}) {}
WorldGeometry::WorldGeometry(const RayWorld& world, const Options& options) : world_(&world), options_(options) {
    materials_.push_back(options_.defaultMaterial);
}
WorldGeometry::~WorldGeometry() = default;

std::uint32_t WorldGeometry::materialOf(NodeId acoustics) {
    if (!acoustics) return 0;
    const auto [at, fresh] =
        materialByNode_.try_emplace(acoustics.value, static_cast<std::uint32_t>(materials_.size()));
    if (fresh) materials_.push_back(options_.defaultMaterial);
    return at->second;
}

void WorldGeometry::setMaterial(NodeId acoustics, const AcousticMaterial& material) {
    materials_[materialOf(acoustics)] = material;
    ++version_;
}

std::shared_ptr<const WorldGeometry::MeshPlanes> WorldGeometry::planesOf(const std::shared_ptr<const Mesh>& mesh) {
    CachedMesh& cached = meshes_[mesh.get()];
    // The address may be another mesh's by now.
    if (cached.mesh.lock() == mesh)
        if (auto known = cached.planes.lock()) return known;
    auto result = std::make_shared<MeshPlanes>();
    const glm::dvec3 size(mesh->bounds.size());
    const double extent = std::max({size.x, size.y, size.z, 1e-9});
    PlaneMerger merger({.distance = std::min(1e-4, 2e-5 * extent)});
    result->planeOf.reserve(mesh->triangleCount);
    for (std::uint32_t t = 0; t < mesh->triangleCount; ++t) {
        result->planeOf.push_back(merger.add(mesh->vertex(t, 0), mesh->vertex(t, 1), mesh->vertex(t, 2)));
        if (merger.count() > options_.maxPlanes) {
            result->tooMany = true;
            result->planeOf.clear();
            break;
        }
    }
    if (!result->tooMany) result->planes = merger.finish();
    cached = {mesh, result};
    return result;
}

void WorldGeometry::release(Slot& slot) {
    for (const std::uint32_t plane : slot.planes)
        if (plane != kNoPlane && --users_[plane] == 0) index_.erase(plane);
    slot.planes.clear();
    if (slot.mesh && slot.mesh->tooMany) --withoutPlanes_;
    slot.mesh.reset();
}

void WorldGeometry::place(std::uint32_t number) {
    Slot& slot = slots_[number];
    release(slot);
    const RayInstance& instance = world_->instance(number);
    if (!instance.mesh || determinantSign(instance.info.worldFromLocal) == 0) return;
    slot.mesh = planesOf(instance.mesh);
    if (slot.mesh->tooMany) ++withoutPlanes_;
    const WorldFromLocal& m = instance.info.worldFromLocal;
    const glm::dmat3 linear(m[0], m[1], m[2]), normals = glm::transpose(glm::inverse(linear));
    slot.planes.reserve(slot.mesh->planes.size());
    for (const ReflectingPlane& local : slot.mesh->planes) {
        ReflectingPlane plane;
        plane.normal = glm::normalize(normals * local.normal);
        const glm::dvec3 foot = local.center - local.normal * local.signedDistance(local.center);
        plane.center = m * glm::dvec4(foot, 1);
        plane.offset = glm::dot(plane.normal, plane.center);
        // Two tangents as long as the surface is wide: where it lies, whatever the transform.
        const glm::dvec3 helper = std::abs(local.normal.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
        const glm::dvec3 tangent = glm::normalize(glm::cross(helper, local.normal));
        const glm::dvec3 u = linear * (tangent * local.radius);
        const glm::dvec3 v = linear * (glm::cross(local.normal, tangent) * local.radius);
        // A bound, also when the transform shears.
        plane.radius = std::hypot(glm::length(u), glm::length(v));
        const std::array<glm::dvec3, 5> points{plane.center, plane.center + u, plane.center - u, plane.center + v,
                                               plane.center - v};
        std::uint32_t index = index_.find(plane.normal, points);
        if (index == kNoPlane) {
            index = index_.insert(plane);
            if (index >= users_.size()) users_.resize(index + 1, 0);
        }
        ++users_[index];
        slot.planes.push_back(index);
    }
}

void WorldGeometry::apply(const InstanceDelta& delta) {
    const std::size_t before = slots_.size();
    slots_.resize(std::max(before, world_->instances().size()));
    const auto detach = [&](std::uint32_t number) {
        auto& list = slotsOf_[slots_[number].geometry.value];
        std::erase(list, number);
        if (list.empty()) slotsOf_.erase(slots_[number].geometry.value);
    };
    const auto attach = [&](const Instance& instance) {
        Slot& slot = slots_[instance.id.slot];
        if (slot.id) detach(instance.id.slot);
        slot.id = instance.id;
        slot.geometry = instance.geometry;
        slot.material = materialOf(instance.acoustics);
        slotsOf_[instance.geometry.value].push_back(instance.id.slot);
        place(instance.id.slot);
    };
    for (const InstanceId id : delta.removed)
        if (id.slot < slots_.size() && slots_[id.slot].id == id) {
            detach(id.slot);
            release(slots_[id.slot]);
            slots_[id.slot] = Slot{};
        }
    for (const Instance& instance : delta.added) attach(instance);
    for (const Instance& instance : delta.rebound) attach(instance);
    for (const InstanceDelta::Moved& moved : delta.moved)
        if (moved.id.slot < slots_.size() && slots_[moved.id.slot].id == moved.id) place(moved.id.slot);
    for (const InstanceDelta::Geometry& geometry : delta.geometries)
        if (const auto at = slotsOf_.find(geometry.node.value); at != slotsOf_.end())
            for (const std::uint32_t number : at->second) place(number);
    if (!delta.geometries.empty())
        std::erase_if(meshes_, [](const auto& entry) { return entry.second.planes.expired(); });
    if (!delta.removed.empty() || !delta.added.empty() || !delta.moved.empty() || !delta.rebound.empty() ||
        !delta.geometries.empty())
        ++version_;
}

void WorldGeometry::update() {
    if (updated_ == version_) return;
    updated_ = version_;
    planes_.clear();
    if (withoutPlanes_ > 0 || index_.count() > options_.maxPlanes) return;
    // What nobody uses mirrors nothing.
    planes_.resize(index_.size());
    std::vector<glm::dvec3> low(planes_.size(), glm::dvec3(std::numeric_limits<double>::infinity()));
    std::vector<glm::dvec3> high(planes_.size(), glm::dvec3(-std::numeric_limits<double>::infinity()));
    std::vector<std::uint32_t> parts(planes_.size());
    for (std::uint32_t i = 0; i < planes_.size(); ++i) {
        planes_[i] = index_[i];
        planes_[i].mirrors = 0;
    }
    for (std::size_t number = 0; number < slots_.size(); ++number) {
        const Slot& slot = slots_[number];
        if (slot.planes.empty()) continue;
        const double share = materials_[slot.material].mostMirrored();
        const WorldFromLocal& m = world_->instance(static_cast<std::uint32_t>(number)).info.worldFromLocal;
        const double scale = std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
        const double largest = std::max({glm::length(m[0]), glm::length(m[1]), glm::length(m[2])});
        // The largest column is the scale itself but for shear, which the sum of squares bounds.
        const bool sheared =
            std::abs(glm::dot(m[0], m[1])) + std::abs(glm::dot(m[1], m[2])) + std::abs(glm::dot(m[2], m[0])) >
            1e-9 * largest * largest;
        for (std::size_t k = 0; k < slot.planes.size(); ++k) {
            const std::uint32_t plane = slot.planes[k];
            const ReflectingPlane& local = slot.mesh->planes[k];
            planes_[plane].mirrors = std::max(planes_[plane].mirrors, share);
            const glm::dvec3 center = m * glm::dvec4(local.center, 1);
            const double radius = local.radius * (sheared ? scale : largest);
            if (parts[plane]++ == 0) {
                planes_[plane].center = center;
                planes_[plane].radius = radius;
            }
            low[plane] = glm::min(low[plane], center - radius);
            high[plane] = glm::max(high[plane], center + radius);
        }
    }
    for (std::size_t i = 0; i < planes_.size(); ++i) {
        if (parts[i] < 2) continue;
        planes_[i].center = (low[i] + high[i]) * 0.5;
        planes_[i].radius = glm::length(high[i] - low[i]) * 0.5;
    }
}

double WorldGeometry::exactDistance(const Hit& hit, const glm::dvec3& origin, const glm::dvec3& direction) const {
    const RayInstance& instance = world_->instance(hit.instance);
    glm::dvec3 corners[3];
    for (std::uint32_t c = 0; c < 3; ++c)
        corners[c] = instance.info.worldFromLocal * glm::dvec4(instance.mesh->vertex(hit.triangle, c), 1.0);
    const glm::dvec3 normal = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double along = glm::dot(direction, normal);
    return along != 0 ? glm::dot(corners[0] - origin, normal) / along : static_cast<double>(hit.t);
}

bool WorldGeometry::closestBut(std::span<const std::uint32_t> open, const glm::dvec3& origin,
                               const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                               AcousticHit& hit) const {
    if (!(maxDistance > 0)) return false;
    Ray ray;
    ray.origin = world_->fromWorld(origin);
    ray.direction = Vec3f(direction);
    ray.tMax = static_cast<float>(std::min(maxDistance, 1e9));
    const double rounding = 1e-6 * (1 + static_cast<double>(glm::length(ray.origin)));
    // The surface a ray starts on may be hit within the rounding of its origin, at most once for each of its triangles
    // that meet there; the limit is for geometry that is thousands of layers thick.
    for (int attempt = 0; attempt < 256; ++attempt) {
        const Hit found = world_->intersect(ray, RayKind::sound);
        if (!found) return false;
        const Slot& slot = slots_[found.instance];
        const bool known = slot.mesh && !slot.mesh->tooMany;
        const std::uint32_t local = known ? slot.mesh->planeOf[found.triangle] : kNoPlane;
        // Without a plane at least the triangle itself is left out, under a number no plane has.
        const std::uint32_t plane = local != kNoPlane
                                        ? slot.planes[local]
                                        : 0x80000000u | ((found.instance * 0x9E3779B1u + found.triangle) & 0x7FFFFFFEu);
        // A wall that the ray starts a hair in front of, and leaves, may be hit from behind through rounding.
        const bool behind = except != kNoPlane && static_cast<double>(found.t) < rounding &&
                            exactDistance(found, origin, direction) < 0;
        if (plane != except && !behind && std::find(open.begin(), open.end(), found.instance) == open.end()) {
            hit.plane = plane;
            hit.material = slot.material;
            hit.distance = static_cast<double>(found.t);
            hit.normal = glm::normalize(glm::dvec3(found.normal));
            if (local != kNoPlane) {
                hit.normal = index_[plane].normal;
                const double exact = -index_[plane].signedDistance(origin) / glm::dot(direction, hit.normal);
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

namespace {

bool worldBox(const RayInstance& instance, glm::dvec3& low, glm::dvec3& high) {
    if (!instance.info.id || !instance.mesh || instance.mesh->bounds.empty()) return false;
    low = glm::dvec3(std::numeric_limits<double>::infinity());
    high = -low;
    for (int i = 0; i < 8; ++i) {
        const Bounds& box = instance.mesh->bounds;
        const glm::dvec3 corner =
            instance.info.worldFromLocal * glm::dvec4(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y,
                                                      i & 4 ? box.max.z : box.min.z, 1.0);
        low = glm::min(low, corner);
        high = glm::max(high, corner);
    }
    return true;
}

}  // namespace

std::vector<std::uint32_t> WorldGeometry::instancesAround(const glm::dvec3& point, double maxSize) const {
    constexpr int kDirections = 32;
    constexpr double kGolden = 2.39996322972865332;
    std::vector<std::uint32_t> result;
    for (int i = 0; i < kDirections; ++i) {
        const double z = 1 - (2 * i + 1) / double{kDirections}, r = std::sqrt(1 - z * z);
        Ray ray;
        ray.origin = world_->fromWorld(point);
        ray.direction = Vec3f(glm::dvec3(r * std::cos(i * kGolden), r * std::sin(i * kGolden), z));
        ray.tMax = static_cast<float>(maxSize);
        // Through one shell after the other, to the first thing that is no body.
        for (int layer = 0; layer < 64; ++layer) {
            const Hit hit = world_->intersect(ray, RayKind::sound);
            if (!hit) break;
            if (std::find(result.begin(), result.end(), hit.instance) == result.end()) {
                glm::dvec3 low, high;
                if (!worldBox(world_->instance(hit.instance), low, high) || distanceToBox(point, low, high) > 0 ||
                    glm::length(high - low) > maxSize)
                    break;
                result.push_back(hit.instance);
            }
            ray.tMin = std::nextafter(std::max(hit.t, 1e-30f), std::numeric_limits<float>::infinity());
            if (!(ray.tMin < ray.tMax)) break;
        }
    }
    return result;
}

double WorldGeometry::distanceToSurface(const glm::dvec3& point) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const RayInstance& instance : world_->instances()) {
        glm::dvec3 low, high;
        if (!worldBox(instance, low, high)) continue;
        if (distanceToBox(point, low, high) >= nearest) continue;
        for (std::uint32_t t = 0; t < instance.mesh->triangleCount; ++t) {
            glm::dvec3 corners[3];
            for (std::uint32_t c = 0; c < 3; ++c)
                corners[c] = instance.info.worldFromLocal * glm::dvec4(instance.mesh->vertex(t, c), 1.0);
            nearest = std::min(nearest, distanceToTriangle(point, corners));
        }
    }
    return nearest;
}

}  // namespace rtsg
