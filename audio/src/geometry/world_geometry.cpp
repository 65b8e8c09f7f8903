// Answers the questions of acoustic tracing with single-precision rays and double-precision planes.
#include "world_geometry.h"
#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <utility>
#include "walls/plane_index.h"

#include "wall_edges.h"
#include "walls/even_direction.h"
#include "walls/few_walls.h"
#include "walls/loose_triangles.h"
#include "walls/wall_planes.h"

namespace rtsg {
namespace {

AcousticBox worldBox(const Wall& wall) {
    AcousticBox box;
    if (!wall.mesh || wall.mesh->bounds.empty()) return box;
    const Bounds& local = wall.mesh->bounds;
    for (int i = 0; i < 8; ++i)
        box.extend(wall.worldFromLocal * glm::dvec4(i & 1 ? local.max.x : local.min.x,
                                                    i & 2 ? local.max.y : local.min.y,
                                                    i & 4 ? local.max.z : local.min.z, 1.0));
    return box;
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

void cornersOf(const Wall& wall, std::uint32_t triangle, glm::dvec3 (&corners)[3]) {
    for (std::uint32_t c = 0; c < 3; ++c)
        corners[c] = wall.worldFromLocal * glm::dvec4(wall.mesh->vertex(triangle, c), 1.0);
}

}  // namespace

WorldGeometry::WorldGeometry() : WorldGeometry(Options{}) {}
WorldGeometry::WorldGeometry(const Options& options)
    : planes_(std::make_unique<WallPlanes>(options.maxPlanes)),
      edges_(options.edges ? std::make_unique<EdgeTable>() : nullptr),
      few_(std::make_unique<FewWalls>()) {}
WorldGeometry::~WorldGeometry() = default;

std::span<const ReflectingPlane> WorldGeometry::planes() const {
    return planes_->planes();
}
std::uint64_t WorldGeometry::work() const {
    return compared_ + planes_->work();
}

void WorldGeometry::visitEdgesBut(std::span<const std::uint32_t> open, const EdgeVisitor& visit) const {
    if (edges_) edges_->visitBut(open, visit);
}

void WorldGeometry::visitRoundBodiesBut(std::span<const std::uint32_t> open, const RoundVisitor& visit) const {
    if (edges_) edges_->visitRoundBut(open, visit);
}

void WorldGeometry::followMaterials(const PagedArray<AcousticMaterial>& materials) {
    materials_.resize(materials.size());
    PagedArray<AcousticMaterial>::differences(
        walls_.materials, materials, [&](std::size_t at, const AcousticMaterial& before, const AcousticMaterial& now) {
            ++compared_;
            if (at >= materials_.size()) return;
            // A new one is nobody's yet: the walls of it change too.
            const bool known = at < walls_.materials.size();
            if (known && before == now) return;
            materials_[at] = now;
            if (!known) return;
            planes_->materialChanged(static_cast<std::uint32_t>(at));
            changes_.everything = true;
        });
}

const WorldGeometry::Changes& WorldGeometry::note(const WallsVersion& version, const RayView& rays) {
    rays_ = &rays;
    changes_.boxes.clear();
    changes_.slots.clear();
    changes_.everything = !followed_;
    followed_ = true;
    followMaterials(version.materials);
    PagedArray<Wall>::differences(walls_.walls, version.walls,
                                  [&](std::size_t at, const Wall& before, const Wall& now) {
                                      ++compared_;
                                      if (before.stamp == now.stamp) return;
                                      const auto slot = static_cast<std::uint32_t>(at);
                                      few_->change(slot, before, now);
                                      if (slot >= isUnsettled_.size()) isUnsettled_.resize(slot + 1);
                                      if (!std::exchange(isUnsettled_[slot], 1)) unsettled_.push_back(slot);
                                      for (const AcousticBox& box : {worldBox(before), worldBox(now)})
                                          if (!box.empty()) {
                                              changes_.boxes.push_back(box);
                                              changes_.slots.push_back(slot);
                                          }
                                  });
    walls_ = version;
    return changes_;
}

void WorldGeometry::settle() {
    if (!rays_) return;
    for (const std::uint32_t slot : unsettled_) {
        const Wall wall = slot < walls_.walls.size() ? walls_.walls[slot] : Wall();
        planes_->change(slot, wall);
        if (edges_) edges_->change(slot, wall);
        isUnsettled_[slot] = 0;
    }
    planes_->settle(walls_.walls, materials_);
    if (!unsettled_.empty()) few_->build(walls_.walls, *planes_, *rays_);
    unsettled_.clear();
}

std::uint32_t WorldGeometry::planeOf(std::uint32_t slot, std::uint32_t triangle) const {
    const bool settled = slot < isUnsettled_.size() && !isUnsettled_[slot];
    return settled && planes_->usable() ? planes_->planeOf(slot, triangle) : kNoPlane;
}

/// The normal of the hit, and its distance: those of the plane in double precision; for a triangle without a plane
/// those of the ray query, within the error `clear`.
void WorldGeometry::makeExact(const Hit& found, const Wall& wall, std::uint32_t plane, const glm::dvec3& origin,
                              const glm::dvec3& direction, AcousticHit& hit) const {
    if (plane == kNoPlane) {
        hit.normal = looseNormal(found.normal);
        hit.clear = looseClearance(wall, rays_->instance(found.instance), rays_->origin()) + roundingAt(origin);
        return;
    }
    const double rough = hit.distance;
    hit.clear = 0;  // surfaces may be off a plane by more
    const ReflectingPlane& on = planes_->planes()[plane];
    hit.normal = on.normal;
    hit.distance = -on.signedDistance(origin) / glm::dot(direction, on.normal);
    // Grazing rays amplify what little the merged triangles are apart: then the triangle itself is right.
    if (isNearRough(hit.distance, rough)) return;
    glm::dvec3 corners[3];
    cornersOf(wall, found.triangle, corners);
    const glm::dvec3 normal = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    hit.distance = glm::dot(corners[0] - origin, normal) / glm::dot(direction, normal);
    // Also if it is not finite: for a sliver, or seen from its edge.
    if (!isNearRough(hit.distance, rough)) hit.distance = rough;
}

WorldGeometry::Judged WorldGeometry::judge(const Hit& found, double rough, std::span<const std::uint32_t> open,
                                           const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance,
                                           std::uint32_t except, AcousticHit& hit) const {
    const std::uint32_t known = planeOf(found.instance, found.triangle);
    // Without a plane the triangle itself is left out.
    const std::uint32_t plane = known != kNoPlane ? known : looseNumber(found.instance, found.triangle);
    if (plane == except || std::find(open.begin(), open.end(), found.instance) != open.end()) return Judged::doubtful;
    const Wall& wall = walls_.walls[found.instance];
    hit.distance = rough;
    makeExact(found, wall, known, origin, direction, hit);
    if (!(hit.distance >= 0)) return Judged::doubtful;
    if (hit.distance >= maxDistance) return Judged::beyond;
    hit.plane = plane;
    hit.material = wall.material;
    return Judged::hit;
}

bool WorldGeometry::closestBut(std::span<const std::uint32_t> open, const glm::dvec3& origin,
                               const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                               AcousticHit& hit) const {
    if (!(maxDistance > 0)) return false;
    // The ray in single precision is extended at both ends by its possible rounding; its hits are checked in double
    // precision.
    const double rounding = roundingAt(origin);
    Ray ray;
    ray.origin = rays_->fromWorld(origin - direction * rounding);
    ray.direction = Vec3f(direction);
    ray.tMax = static_cast<float>(std::min(maxDistance * (1 + 0x1p-20) + 2 * rounding, 1e9));
    // The surface a ray starts on may be hit, at most once for each of its triangles that meet there; the limit is for
    // geometry that is thousands of layers thick.
    for (int attempt = 0; attempt < 256; ++attempt) {
        const Hit found = rays_->intersect(ray, RayKind::sound);
        if (!found) return false;
        if (judge(found, static_cast<double>(found.t) - rounding, open, origin, direction, maxDistance, except, hit) ==
            Judged::hit)
            return true;
        ray.tMin = std::nextafter(std::max(found.t, 1e-30f), std::numeric_limits<float>::infinity());
        if (!(ray.tMin < ray.tMax)) return false;
    }
    return false;
}

bool WorldGeometry::blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction,
                            double distance, std::uint32_t except) const {
    const double rounding = roundingAt(origin);
    Ray ray;
    ray.origin = rays_->fromWorld(origin + facing * rounding);
    ray.direction = Vec3f(direction);
    ray.tMax = static_cast<float>(distance - 2 * rounding);
    if (!(ray.tMax > 0) || !rays_->occluded(ray, RayKind::sound)) return false;
    // Something is there, if not the surface itself, where it is not as even as its plane.
    AcousticHit hit;
    return closestBut({}, origin, direction, distance, except, hit);
}

void WorldGeometry::addBodies(const glm::dvec3& point, const glm::dvec3& direction, double maxSize,
                              std::vector<std::uint32_t>& bodies) const {
    Ray ray;
    ray.origin = rays_->fromWorld(point);
    ray.direction = Vec3f(direction);
    ray.tMax = static_cast<float>(maxSize);
    // Through one shell after the other, to the first thing that is no body.
    for (int layer = 0; layer < 64; ++layer) {
        const Hit hit = rays_->intersect(ray, RayKind::sound);
        if (!hit) return;
        if (std::find(bodies.begin(), bodies.end(), hit.instance) == bodies.end()) {
            const Wall& wall = walls_.walls[hit.instance];
            const AcousticBox box = worldBox(wall);
            if (box.empty() || box.distance(point) > 0 || glm::length(box.high - box.low) > maxSize) return;
            if (wall.mesh->isClosed() && !boxHolds(hit.instance, point)) return;
            bodies.push_back(hit.instance);
        }
        ray.tMin = std::nextafter(std::max(hit.t, 1e-30f), std::numeric_limits<float>::infinity());
        if (!(ray.tMin < ray.tMax)) return;
    }
}

std::vector<std::uint32_t> WorldGeometry::instancesAround(const glm::dvec3& point, double maxSize) const {
    constexpr int kDirections = 32;
    std::vector<std::uint32_t> result;
    for (int i = 0; i < kDirections; ++i) addBodies(point, evenDirection(i, kDirections), maxSize, result);
    return result;
}

bool WorldGeometry::boxHolds(std::uint32_t slot, const glm::dvec3& point) const {
    const Wall& wall = walls_.walls[slot];
    if (!wall.mesh || wall.mesh->bounds.empty()) return false;
    const WorldFromLocal& m = wall.worldFromLocal;
    const glm::dmat3 linear(m[0], m[1], m[2]);
    if (glm::determinant(linear) == 0) return false;
    const glm::dvec3 local = glm::inverse(linear) * (point - m[3]);
    const glm::dvec3 low(wall.mesh->bounds.min), high(wall.mesh->bounds.max);
    // What touches a closed body is not in it; sheets have no inside.
    const glm::dvec3 scale(glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2]));
    const glm::dvec3 slack = wall.mesh->isClosed() ? -4 * roundingAt(point) / scale : 1e-6 * (high - low);
    return glm::all(glm::greaterThanEqual(local, low - slack)) && glm::all(glm::lessThanEqual(local, high + slack));
}

void WorldGeometry::surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const {
    // As far as surfaces may be from the plane they are taken to lie on, the search reaches farther.
    const glm::dvec3 away = glm::abs(point - rays_->origin());
    const double reach = radius + 2 * PlaneTolerance().distance, rounding = 0x1p-20 * (away.x + away.y + away.z);
    const auto searched = static_cast<float>(reach + rounding);
    // By reference: std::function would allocate memory, and direct sound asks in every block.
    const auto look = [&](std::uint32_t slot, std::uint32_t triangle) {
        const Wall& wall = walls_.walls[slot];
        glm::dvec3 corners[3];
        cornersOf(wall, triangle, corners);
        if (distanceToTriangle(point, corners) > reach) return searched;
        const std::uint32_t plane = planeOf(slot, triangle);
        glm::dvec3 normal = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
        // A mirror turns a triangle over, not the side that it faces.
        const WorldFromLocal& m = wall.worldFromLocal;
        if (glm::dot(glm::cross(m[0], m[1]), m[2]) < 0) normal = -normal;
        const double length = glm::length(normal);
        if (!(length > 0)) return searched;
        normal /= length;
        double distance = glm::dot(point - corners[0], normal);
        if (plane != kNoPlane) {
            const ReflectingPlane& on = planes_->planes()[plane];
            const double side = glm::dot(on.normal, normal) < 0 ? -1 : 1;
            normal = side * on.normal;
            distance = side * on.signedDistance(point);
        }
        if (std::abs(distance) <= radius)
            visit({normal, distance, wall.mesh->solid && wall.mesh->isClosed() ? slot : kNoSolid});
        return searched;
    };
    rays_->visitNear(rays_->fromWorld(point), searched, std::cref(look), RayKind::sound);
}

bool WorldGeometry::trianglesNearBut(std::span<const std::uint32_t> open, const glm::dvec3& point, double radius,
                                     std::vector<WallTriangle>& found) const {
    constexpr std::size_t kMax = 256;  // each look asks all of them
    if (!planes_->usable()) return false;
    const glm::dvec3 away = glm::abs(point - rays_->origin());
    const auto searched = static_cast<float>(radius + 0x1p-20 * (away.x + away.y + away.z));
    bool all = true;
    rays_->visitNear(
        rays_->fromWorld(point), searched,
        [&](std::uint32_t slot, std::uint32_t triangle) {
            WallTriangle one;
            cornersOf(walls_.walls[slot], triangle, one.corners);
            one.plane = planeOf(slot, triangle);
            if (distanceToTriangle(point, one.corners) > radius || std::ranges::find(open, slot) != open.end())
                return searched;
            if (one.plane == kNoPlane) {
                // Met by rays all the same, unless it has no area; then all of them are asked about by rays.
                all = all &&
                      glm::cross(one.corners[1] - one.corners[0], one.corners[2] - one.corners[0]) == glm::dvec3(0);
                return searched;
            }
            const ReflectingPlane& on = planes_->planes()[one.plane];
            one.normal = on.normal, one.offset = on.offset, one.material = walls_.walls[slot].material;
            for (const glm::dvec3& corner : one.corners)
                one.margin =
                    std::max(one.margin, 2 * std::abs(on.signedDistance(corner)) + 0x1p-45 * glm::length(corner));
            all = all && found.size() < kMax;
            if (all) found.push_back(one);
            return searched;
        },
        RayKind::sound);
    return all;
}

double WorldGeometry::distanceToSurface(const glm::dvec3& point) const {
    // Beyond this nothing is traced.
    double nearest = std::numeric_limits<double>::infinity();
    const glm::dvec3 away = glm::abs(point - rays_->origin());
    const double rounding = 0x1p-20 * std::max({away.x, away.y, away.z}) + 1e-30;
    const auto radius = [&](double distance) { return static_cast<float>(distance * (1 + 0x1p-20) + rounding); };
    rays_->visitNear(
        rays_->fromWorld(point), radius(RayWorld::kMaxCoordinate),
        [&](std::uint32_t slot, std::uint32_t triangle) {
            glm::dvec3 corners[3];
            cornersOf(walls_.walls[slot], triangle, corners);
            nearest = std::min(nearest, distanceToTriangle(point, corners));
            return radius(std::min<double>(nearest, RayWorld::kMaxCoordinate));
        },
        RayKind::sound);
    return nearest;
}

}  // namespace rtsg
