// Finds the planes of meshes and follows, wall by wall, which lie in one plane and how far they reach on it.
#include "wall_planes.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace rtsg {
namespace {

/// The middle of the surfaces of a mesh on one of its planes, and how far they reach from there at most.
struct Extent {
    glm::dvec3 center;
    double radius;
};

Extent extentOf(const ReflectingPlane& local, const WorldFromLocal& m) {
    const double scale = std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
    const double largest = std::max({glm::length(m[0]), glm::length(m[1]), glm::length(m[2])});
    // The largest column is the scale itself but for shear, which the sum of squares bounds.
    const bool sheared =
        std::abs(glm::dot(m[0], m[1])) + std::abs(glm::dot(m[1], m[2])) + std::abs(glm::dot(m[2], m[0])) >
        1e-9 * largest * largest;
    return {m * glm::dvec4(local.center, 1), local.radius * (sheared ? scale : largest)};
}

/// A plane of a mesh in the world, and five points that tell whether another plane is the same.
struct PlacedPlane {
    ReflectingPlane plane;
    std::array<glm::dvec3, 5> points;
};

PlacedPlane placedPlane(const ReflectingPlane& local, const WorldFromLocal& m, const glm::dmat3& normals) {
    const glm::dmat3 linear(m[0], m[1], m[2]);
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
    return {plane, {plane.center, plane.center + u, plane.center - u, plane.center + v, plane.center - v}};
}

}  // namespace

std::shared_ptr<const WallPlanes::MeshPlanes> WallPlanes::planesOf(const std::shared_ptr<const Mesh>& mesh) {
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
        ++work_;
        if (merger.count() > maxPlanes_) {
            result->tooMany = true;
            result->planeOf.clear();
            break;
        }
    }
    if (!result->tooMany) result->planes = merger.finish();
    cached = {mesh, result};
    return result;
}

void WallPlanes::markDirty(std::uint32_t plane) {
    if (surfaces_[plane].dirty) return;
    surfaces_[plane].dirty = true;
    dirty_.push_back(plane);
}

void WallPlanes::release(std::uint32_t number) {
    Slot& slot = slots_[number];
    slot.waiting = false;
    if (!slot.mesh) return;
    for (const OnPlane& on : slot.planes) {
        Surfaces& surfaces = surfaces_[on.plane];
        const std::uint64_t before = surfaces.boxes.work();
        surfaces.boxes.erase(on.index);
        work_ += 1 + surfaces.boxes.work() - before;
        const Surface moved = surfaces.all.back();
        surfaces.all[on.index] = moved;
        surfaces.all.pop_back();
        slots_[moved.slot].planes[moved.number].index = on.index;
        const auto created = std::find_if(surfaces.created.begin(), surfaces.created.end(),
                                          [&](const auto& m) { return m.first == slot.material; });
        if (--created->second == 0) surfaces.created.erase(created);
        markDirty(on.plane);
        if (surfaces.all.empty()) index_.erase(on.plane);
    }
    slot.planes.clear();
    if (slot.mesh->tooMany) --withoutPlanes_;
    slot.mesh.reset();
}

void WallPlanes::put(std::uint32_t number, std::uint32_t local, std::uint32_t plane, const Wall& wall) {
    Slot& slot = slots_[number];
    Surfaces& surfaces = surfaces_[plane];
    const Extent extent = extentOf(slot.mesh->planes[local], wall.worldFromLocal);
    const std::uint64_t before = surfaces.boxes.work();
    surfaces.boxes.insert({extent.center - extent.radius, extent.center + extent.radius});
    work_ += 1 + surfaces.boxes.work() - before;
    slot.planes.push_back({plane, static_cast<std::uint32_t>(surfaces.all.size())});
    surfaces.all.push_back({number, local});
    const auto created = std::find_if(surfaces.created.begin(), surfaces.created.end(),
                                      [&](const auto& m) { return m.first == slot.material; });
    if (created != surfaces.created.end())
        ++created->second;
    else
        surfaces.created.emplace_back(slot.material, 1);
    markDirty(plane);
}

void WallPlanes::insertWall(std::uint32_t number, const Wall& wall) {
    Slot& slot = slots_[number];
    slot.mesh = planesOf(wall.mesh);
    slot.material = wall.material;
    if (slot.mesh->tooMany) ++withoutPlanes_;
    const WorldFromLocal& m = wall.worldFromLocal;
    const glm::dmat3 normals = glm::transpose(glm::inverse(glm::dmat3(m[0], m[1], m[2])));
    slot.planes.reserve(slot.mesh->planes.size());
    for (std::uint32_t local = 0; local < slot.mesh->planes.size(); ++local) {
        const PlacedPlane placed = placedPlane(slot.mesh->planes[local], m, normals);
        std::uint32_t plane = index_.find(placed.plane.normal, placed.points);
        if (plane == kNoPlane) {
            plane = index_.insert(placed.plane);
            if (plane >= surfaces_.size()) surfaces_.resize(plane + 1);
        }
        put(number, local, plane, wall);
    }
}

void WallPlanes::change(std::uint32_t number, const Wall& wall) {
    if (number >= slots_.size()) slots_.resize(number + 1);
    release(number);
    if (!wall.mesh || determinantSign(wall.worldFromLocal) == 0) return;
    if (usable()) {
        insertWall(number, wall);
        return;
    }
    Slot& slot = slots_[number];
    slot.waiting = true;
    if (!slot.queued) waiting_.push_back(number);
    slot.queued = true;
}

void WallPlanes::materialChanged(std::uint32_t material) {
    for (std::uint32_t plane = 0; plane < surfaces_.size(); ++plane)
        for (const auto& created : surfaces_[plane].created)
            if (created.first == material) markDirty(plane);
}

void WallPlanes::measure(std::uint32_t number, const PagedArray<Wall>& walls,
                         std::span<const AcousticMaterial> materials) {
    Surfaces& surfaces = surfaces_[number];
    surfaces.dirty = false;
    ++work_;
    ReflectingPlane& plane = planes_[number];
    plane = index_[number];
    // A plane that nobody uses mirrors nothing.
    plane.mirrors = 0;
    for (const auto& created : surfaces.created)
        plane.mirrors = std::max(plane.mirrors, materials[created.first].maxMirrored());
    if (surfaces.all.size() == 1) {
        const Surface only = surfaces.all[0];
        const Extent extent = extentOf(slots_[only.slot].mesh->planes[only.number], walls[only.slot].worldFromLocal);
        plane.center = extent.center;
        plane.radius = extent.radius;
    } else if (!surfaces.all.empty()) {
        const AcousticBox box = surfaces.boxes.all();
        plane.center = (box.low + box.high) * 0.5;
        plane.radius = glm::length(box.high - box.low) * 0.5;
    }
}

void WallPlanes::settle(const PagedArray<Wall>& walls, std::span<const AcousticMaterial> materials) {
    while (usable() && !waiting_.empty()) {
        const std::uint32_t number = waiting_.back();
        waiting_.pop_back();
        slots_[number].queued = false;
        if (!slots_[number].waiting) continue;
        slots_[number].waiting = false;
        insertWall(number, walls[number]);
    }
    planes_.resize(surfaces_.size());
    for (const std::uint32_t plane : dirty_) measure(plane, walls, materials);
    dirty_.clear();
    if (meshes_.size() > 2 * meshesAtPurge_ + 64) {
        std::erase_if(meshes_, [](const auto& entry) { return entry.second.planes.expired(); });
        meshesAtPurge_ = meshes_.size();
    }
}

}  // namespace rtsg
