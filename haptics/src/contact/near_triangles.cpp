// Gathers the triangles around a hand, with their motion since the last tick.
#include "near_triangles.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace rtsg::haptics {

namespace {

constexpr double kMaxAhead = 0.1;       // metres that what moves is looked for beyond where it was
constexpr double kExitDistance = 0.25;  // metres to the surface of a solid that has moved over the hand

const RayInstance* instanceAt(const WorldMoment& moment, std::uint32_t slot) {
    if (!moment.state || slot >= moment.state->rays->instances().size()) return nullptr;
    const RayInstance& instance = moment.state->rays->instance(slot);
    return instance.mesh ? &instance : nullptr;
}

const TouchTables::Mover* moverOf(const WorldMoment& moment, const RayInstance& instance) {
    if (!moment.tables) return nullptr;
    const auto found = moment.tables->movers.find(instance.info.id.slot);
    return found != moment.tables->movers.end() && found->second.generation == instance.info.id.generation
               ? &found->second
               : nullptr;
}

/// How far ahead of its state a moment is, as a share of the time from the state before to this one.
double ahead(const WorldMoment& moment, double seconds) {
    if (!moment.tables || moment.tables->seconds <= 0) return 0;
    return std::clamp((seconds - moment.since) / moment.tables->seconds, 0.0, 1.0);
}

WorldFromLocal poseAt(const WorldMoment& moment, const RayInstance& instance, double seconds) {
    WorldFromLocal pose = instance.info.worldFromLocal;
    const TouchTables::Mover* mover = moverOf(moment, instance);
    if (mover && mover->steady) pose += ahead(moment, seconds) * (mover->to - mover->from);
    return pose;
}

void setCorners(const Mesh& mesh, const WorldFromLocal& pose, std::uint32_t triangle, Vec3d (&corners)[3]) {
    for (std::uint32_t c = 0; c < 3; ++c)
        corners[c] = pose * glm::dvec4(Vec3d(mesh.vertex(triangle, c)) + mesh.anchor, 1.0);
}

}  // namespace

void NearTriangles::find(const WorldMoment& now, const Vec3d& from, const Vec3d& to, double radius, double seconds) {
    now_ = now;
    all_.clear();
    found_.clear();
    if (!now_.state) return;
    const RayView& rays = *now_.state->rays;
    const double distance = glm::length(to - from);
    const double moved = now_.tables ? std::min(now_.tables->farthest * ahead(now_, seconds), kMaxAhead) : 0;
    const Vec3d middle = 0.5 * (from + to);
    // Places of rays are floats.
    const double rounding = 1e-6 * (1 + glm::length(middle - rays.origin()));
    const auto reach = static_cast<float>(0.5 * distance + radius + moved + rounding + 2 * kSkin);
    rays.visitNear(rays.fromWorld(middle), reach, [&](std::uint32_t slot, std::uint32_t triangle) {
        found_.emplace_back(slot, triangle);
        return reach;
    });
    std::ranges::sort(found_);
    found_.erase(std::ranges::unique(found_).begin(), found_.end());
    const bool changed = last_.state != now_.state;
    for (const auto& [slot, triangle] : found_) {
        const RayInstance* instance = instanceAt(now_, slot);
        if (!instance || triangle >= instance->mesh->triangleCount) continue;
        NearTriangle& t = all_.emplace_back();
        t.slot = slot, t.triangle = triangle;
        setCorners(*instance->mesh, poseAt(now_, *instance, seconds), triangle, t.corners);
        std::copy(t.corners, t.corners + 3, t.before);
        const RayInstance* before = changed || moverOf(now_, *instance) ? instanceAt(last_, slot) : nullptr;
        if (!before || before->info.id != instance->info.id ||
            before->mesh->triangleCount != instance->mesh->triangleCount)
            continue;
        setCorners(*before->mesh, poseAt(last_, *before, lastTime_), triangle, t.before);
        t.moves = !std::equal(t.corners, t.corners + 3, t.before);
    }
}

std::vector<NearTriangle> NearTriangles::still() const {
    std::vector<NearTriangle> result;
    std::ranges::copy_if(all_, std::back_inserter(result), [](const NearTriangle& t) { return !t.moves; });
    return result;
}

/// The triangles of solids, in order of their distance; the first is where all that meet in the nearest point are one.
/// `nearest`: that one alone.
template <class Counts>
std::vector<NearTriangles::Surface> NearTriangles::surfacesNear(const WorldMoment& now, const Vec3d& position,
                                                                double reach, double seconds, bool nearest,
                                                                const Counts& counts) const {
    const RayView& rays = *now.state->rays;
    std::vector<Surface> found;
    Surface first{reach, Vec3d(0), Vec3d(0)};
    rays.visitNear(rays.fromWorld(position), static_cast<float>(reach),
                   [&](std::uint32_t slot, std::uint32_t triangle) {
                       const RayInstance* instance = instanceAt(now, slot);
                       if (instance && instance->mesh->solid && counts(*instance)) {
                           Vec3d corners[3];
                           setCorners(*instance->mesh, poseAt(now, *instance, seconds), triangle, corners);
                           const Vec3d at = closestOnTriangle(position, corners);
                           const double distance = glm::length(position - at);
                           const Vec3d face = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
                           const double area = glm::length(face);
                           if (area > 0 && distance < reach) {
                               const Vec3d normal = (instance->sign < 0 ? -1.0 : 1.0) / area * face;
                               if (!nearest) found.push_back({distance, at, normal});
                               // At an edge or a corner all triangles that meet there count.
                               if (distance < first.distance + 1e-9)
                                   first = {std::min(first.distance, distance), at,
                                            distance < first.distance - 1e-9 ? normal : first.front + normal};
                           }
                       }
                       return static_cast<float>(nearest ? first.distance * (1 + 1e-6) + 1e-6 : reach);
                   });
    std::ranges::sort(found, {}, &Surface::distance);
    if (first.front != Vec3d(0)) found.insert(found.begin(), first);
    return found;
}

/// Whether a ball is outside of all solids, and touches nothing.
bool NearTriangles::hasRoom(const WorldMoment& now, const Vec3d& position, double radius, double seconds) const {
    const auto solid =
        surfacesNear(now, position, kExitDistance, seconds, true, [](const RayInstance&) { return true; });
    if (!solid.empty() && glm::dot(position - solid[0].closest, solid[0].front) < 0) return false;
    NearTriangles around;
    around.find(now, position, position, radius, seconds);
    return touched(position, radius - 2 * kSkin, around.all()).empty();
}

NearTriangles::PathOut NearTriangles::exitDistance(const WorldMoment& now, const Vec3d& position, double radius,
                                                   double seconds, bool everything) const {
    constexpr std::size_t kTries = 64;
    if (!now.state) return {};
    const auto came = [&](const RayInstance& instance) {
        const RayInstance* before = instanceAt(last_, instance.info.id.slot);
        if (everything || !before || before->info.id != instance.info.id || before->mesh != instance.mesh) return true;
        const TouchTables::Mover* mover = moverOf(now, instance);
        return mover && !mover->steady;
    };
    const auto near = surfacesNear(now, position, kExitDistance, seconds, true, came);
    if (near.empty() || glm::dot(position - near[0].closest, near[0].front) >= 0) return {};
    const auto beyond = [&](const Surface& surface) {
        return surface.closest + (radius + 4 * kSkin) / glm::length(surface.front) * surface.front;
    };
    if (const Vec3d to = beyond(near[0]); hasRoom(now, to, radius, seconds)) return {true, to};
    const auto all =
        surfacesNear(now, position, kExitDistance, seconds, false, [](const RayInstance&) { return true; });
    for (std::size_t i = 0; i < std::min(all.size(), kTries); ++i)
        if (const Vec3d to = beyond(all[i]); hasRoom(now, to, radius, seconds)) return {true, to};
    return {true, std::nullopt};
}

TouchSurface NearTriangles::surfaceOf(const NearTriangle& triangle, const TouchSurface& otherwise) const {
    const RayInstance* instance = instanceAt(now_, triangle.slot);
    if (!instance || !now_.tables || !now_.tables->surfaces) return otherwise;
    const auto found = now_.tables->surfaces->find(instance->info.appearance.value);
    return found == now_.tables->surfaces->end() ? otherwise : found->second;
}

Vec3d NearTriangles::smoothNormal(const Touching& contact) const {
    // Facets that are farther from what they stand for are meant to be felt.
    constexpr double kMaxOff = 0.9, kFlat = 1e-6;
    const NearTriangle& t = all_[contact.triangle];
    const RayInstance* instance = instanceAt(now_, t.slot);
    if (!instance || !instance->mesh->normals.present()) return contact.normal;
    const Vec3d ab = t.corners[1] - t.corners[0], ac = t.corners[2] - t.corners[0],
                ap = contact.position - t.corners[0];
    const Vec3d face = glm::cross(ab, ac);
    const double squared = glm::dot(face, face);
    if (!(squared > 0)) return contact.normal;
    const double u = glm::dot(glm::cross(ap, ac), face) / squared, v = glm::dot(glm::cross(ab, ap), face) / squared;
    const glm::dmat3 linear(instance->info.worldFromLocal);
    const glm::dmat3 cofactors(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                               glm::cross(linear[0], linear[1]));
    Vec3d smooth =
        cofactors * Vec3d(instance->mesh->shadingNormal(t.triangle, static_cast<float>(u), static_cast<float>(v)));
    const double length = glm::length(smooth);
    if (!(length > 0)) return contact.normal;
    smooth *= (glm::dot(smooth, contact.normal) < 0 ? -1 : 1) / length;
    const bool isFlat = std::abs(glm::dot(smooth, face)) > (1 - kFlat) * std::sqrt(squared);
    return isFlat || glm::dot(smooth, contact.normal) < kMaxOff ? contact.normal : smooth;
}

NodeId NearTriangles::shapeOf(const NearTriangle& triangle) const {
    const RayInstance* instance = instanceAt(now_, triangle.slot);
    return instance ? instance->info.shape : NodeId();
}

}  // namespace rtsg::haptics
