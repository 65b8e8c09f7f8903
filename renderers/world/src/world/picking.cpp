// Rays, nearest points, overlaps and moving balls, answered by the BVH that light and sound use.
#include <rtsg/renderers/picking.h>

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "mesh/exact_meeting.h"
#include "ray_view_impl.h"

namespace rtsg {

struct Picker::Candidate {
    std::uint32_t slot = kNoInstance, triangle = 0;
    exact::Weights where;
    double distance = std::numeric_limits<double>::infinity();
    Vec3d point{0}, normal{0};
    bool surfaceNormal = false;
};

namespace {

bool isFinite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Result<> checkPoint(const RayWorld& world, const Vec3d& point, const char* what) {
    if (!isFinite(point)) return fail(fmt::format("{} is not finite", what));
    const Vec3d p = glm::abs(point - world.origin());
    if (std::max({p.x, p.y, p.z}) > RayWorld::kMaxCoordinate)
        return fail(fmt::format("{} is farther than {} m away", what, RayWorld::kMaxCoordinate));
    return {};
}

exact::Triangle triangleOf(const RayInstance& instance, std::uint32_t triangle) {
    const Mesh& mesh = *instance.mesh;
    const WorldFromLocal& m = instance.info.worldFromLocal;
    const auto corner = [&](std::uint32_t i) { return m * glm::dvec4(Vec3d(mesh.vertex(triangle, i)), 1); };
    return {corner(0), corner(1), corner(2)};
}

/// The normal towards the front, of any length.
Vec3d normalOf(const RayInstance& instance, const exact::Triangle& t) {
    const Vec3d normal = glm::cross(t.b - t.a, t.c - t.a);
    return instance.sign < 0 ? -normal : normal;
}

/// How far from `center` the BVH must look so that no triangle within `radius` is missed: it holds floats.
float searchRadius(const RayWorld& world, const Vec3d& center, double radius) {
    constexpr double relative = 0x1p-20;
    const Vec3d c = glm::abs(center - world.origin());
    return static_cast<float>(radius * (1 + relative) + relative * std::max({c.x, c.y, c.z}) + 1e-30);
}

}  // namespace

Pick Picker::finish(const Candidate& candidate) const {
    Pick pick;
    if (candidate.slot == kNoInstance) return pick;
    const RayInstance& instance = world_->instance(candidate.slot);
    pick.instance = instance.info.id;
    pick.shape = instance.info.shape;
    pick.geometry = instance.info.geometry;
    pick.path = flattener_->path(instance.info.id);
    pick.triangle = candidate.triangle;
    pick.u = static_cast<float>(candidate.where.u);
    pick.v = static_cast<float>(candidate.where.v);
    pick.point = candidate.point;
    pick.distance = candidate.distance;
    pick.texCoord = instance.mesh->texCoord(candidate.triangle, pick.u, pick.v);
    const double length = glm::length(candidate.normal);
    if (!candidate.surfaceNormal && length > 0) {
        pick.normal = candidate.normal / length;
        return pick;
    }
    const Vec3d normal = normalOf(instance, triangleOf(instance, candidate.triangle));
    const double size = glm::length(normal);
    pick.normal = size > 0 ? normal / size : Vec3d(0, 0, 1);
    return pick;
}

namespace {

/// Leaves out all but one layer.
class LayerFilter final : public RayFilter {
  public:
    LayerFilter(const RayWorld& world, std::uint16_t layer, const RayFilter* cut)
        : world_(world), layer_(layer), cut_(cut) {}
    bool concerns(std::uint32_t slot) const override { return isElsewhere(slot) || (cut_ && cut_->concerns(slot)); }
    bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const override {
        return isElsewhere(slot) || (cut_ && cut_->leavesOut(slot, at, error));
    }

  private:
    bool isElsewhere(std::uint32_t slot) const { return world_.instance(slot).info.layer != layer_; }
    const RayWorld& world_;
    std::uint16_t layer_;
    const RayFilter* cut_;
};

/// Whether a ray may meet the box around a mesh as it stands in the world; a little too often.
bool mayMeet(const RayInstance& instance, const Vec3d& from, const Vec3d& unit) {
    const WorldFromLocal& m = instance.info.worldFromLocal;
    const Vec3d low(instance.mesh->bounds.min), high(instance.mesh->bounds.max);
    const Vec3d middle = (low + high) * .5, half = (high - low) * .5;
    const Vec3d center = m[0] * middle.x + m[1] * middle.y + m[2] * middle.z + m[3];
    Vec3d reach = glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z;
    reach += (glm::abs(center) + reach + glm::abs(from)) * 1e-12;
    double enter = 0, leave = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
        const double a = center[i] - reach[i] - from[i], b = center[i] + reach[i] - from[i];
        if (unit[i] == 0) {
            if (a > 0 || b < 0) return false;
            continue;
        }
        enter = std::max(enter, std::min(a / unit[i], b / unit[i]));
        leave = std::min(leave, std::max(a / unit[i], b / unit[i]));
    }
    return enter <= leave;
}

/// Finds what rays in the BVH pass: the boxes of volumes, which pointers meet, and the proxies of Collisions, which
/// avatars feel.
class UnmetByRays final : public RayView {
  public:
    explicit UnmetByRays(const RayView& view) : RayView(view) {}

    /// Calls `visit(slot, triangle)` for each triangle of the volumes' boxes.
    template <class Visit>
    void visitVolumes(const Visit& visit) const {
        for (const std::uint32_t slot : tables_->volumes)
            if (const RayInstance& box = instances_[slot]; box.info.seen && isThere(box))
                for (std::uint32_t i = 0; i < box.mesh->triangleCount; ++i) visit(slot, i);
    }
    /// Calls `tell(slot, triangle, weights, distance)` for each of their triangles that the ray meets; or of proxies.
    template <class Visitor>
    void crossVolumes(const Vec3d& from, const Vec3d& unit, const RayFilter* filter, const Visitor& report) const {
        visitVolumes([&](std::uint32_t slot, std::uint32_t i) { cross(slot, i, from, unit, filter, report); });
    }
    template <class Visitor>
    void crossProxies(const Vec3d& from, const Vec3d& unit, const Visitor& report) const {
        for (const std::uint32_t slot : tables_->proxies)
            if (const RayInstance& proxy = instances_[slot]; isThere(proxy) && mayMeet(proxy, from, unit))
                for (std::uint32_t i = 0; i < proxy.mesh->triangleCount; ++i)
                    cross(slot, i, from, unit, nullptr, report);
    }

  private:
    static bool isThere(const RayInstance& instance) {
        return instance.mesh && instance.sign != 0 && rtsg::isFinite(instance.info.worldFromLocal);
    }
    template <class Visitor>
    void cross(std::uint32_t slot, std::uint32_t triangle, const Vec3d& from, const Vec3d& unit,
               const RayFilter* filter, const Visitor& report) const {
        constexpr double kEdge = 1e-12;  // so that no ray slips between two triangles
        const std::optional<exact::Meeting> m = exact::meet(triangleOf(instances_[slot], triangle), from, unit);
        if (!m || !m->isInside(kEdge) || !(m->distance >= 0)) return;
        const Vec3f at = fromWorld(from + m->distance * unit);
        if (filter && filter->concerns(slot) && filter->leavesOut(slot, at, 0)) return;
        report(slot, triangle, m->where, m->distance);
    }
};

}  // namespace

namespace {

/// The lens of an eye that looks along the ray. Numbers that make no ray are reported elsewhere.
PixelLens lensAt(const RayWorld& world, const Vec3d& origin, const Vec3d& direction, double pixel) {
    const double length = glm::length(direction);
    return {world.fromWorld(origin), length > 0 && std::isfinite(length) ? Vec3f(direction / length) : Vec3f(0, 0, -1),
            static_cast<float>(pixel)};
}

}  // namespace

Result<Pick> Picker::ray(const Vec3d& origin, const Vec3d& direction, double maximum, double pixel) const {
    return pick(origin, direction, maximum, lensAt(*world_, origin, direction, pixel), nullptr, nullptr);
}

Result<Pick> Picker::ray(const Vec3d& origin, const Vec3d& direction, const SeenSurfaces& seen) const {
    return pick(origin, direction, std::numeric_limits<double>::infinity(), lensAt(*world_, origin, direction, kPixel),
                nullptr, &seen);
}

Result<Pick> Picker::ray(const Vec3d& origin, const Vec3d& direction, std::uint16_t layer, double maximum,
                         const PixelLens& lens, const RayFilter* cut, const SeenSurfaces* seen) const {
    const LayerFilter filter(*world_, layer, cut);
    return pick(origin, direction, maximum, lens, &filter, seen);
}

namespace {

/// The surface that a ray meets first or, with `seen`, the first that is seen.
Hit firstOf(const RayView& view, Ray ray, const SeenSurfaces* seen) {
    constexpr int kMax = 10'000;  // clear surfaces one behind the other
    for (int i = 0; i < kMax; ++i) {
        const Hit met = view.intersect(ray);
        if (!met || !seen) return met;
        if (const Hit shown = seen->seen(view, ray, met)) return shown;
        ray.origin = RayView::leave(view.point(met, ray), ray.direction);
        ray.tMin = 1e-30f;  // the surface that it leaves may be hit at exactly 0
    }
    return {};
}

}  // namespace

Result<Pick> Picker::pick(const Vec3d& origin, const Vec3d& direction, double maximum, const PixelLens& lens,
                          const RayFilter* filter, const SeenSurfaces* seen) const {
    if (auto ok = checkPoint(*world_, origin, "the ray's origin"); !ok) return std::unexpected(ok.error());
    const double largest = std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
    if (!isFinite(direction) || !(largest > 0)) return fail("the ray's direction is zero or not finite");
    if (std::isnan(maximum)) return fail("the largest distance is not a number");
    const Vec3d unit = glm::normalize(direction / largest);
    if (!(lens.spread >= 0 && lens.size >= 0) || !std::isfinite(lens.spread + lens.size))
        return fail("the pixel's width is negative or not finite");
    const Vec3f eye = world_->fromWorld(origin), forward(unit);
    const LensedView view(*world_, lens, filter);
    const Hit hit = firstOf(view, {eye, 0, forward, std::numeric_limits<float>::infinity()}, seen);
    Candidate candidate;
    if (hit) {
        const exact::Triangle t = triangleOf(world_->instance(hit.instance), hit.triangle);
        const bool stroke = world_->instance(hit.instance).mesh->strokeCount > 0;
        candidate = {hit.instance, hit.triangle, {hit.u, hit.v}, 0, t.at(hit.u, hit.v), -unit, false};
        if (!stroke) candidate.normal = normalOf(world_->instance(hit.instance), t);
        // The BVH answers in floats: it tells the triangle, and the place is computed in double precision. For a
        // triangle that the ray grazes, the BVH's place must do.
        constexpr double kNear = 1e-4;
        if (const auto exactly = exact::meet(t, origin, unit); !stroke && exactly && exactly->isInside(kNear)) {
            candidate.where = exactly->where;
            candidate.point = t.at(exactly->where.u, exactly->where.v);
        }
        candidate.distance = std::max(0.0, glm::dot(candidate.point - origin, unit));
        if (candidate.distance > maximum) candidate = {};
    }
    UnmetByRays(*world_).crossVolumes(
        origin, unit, filter,
        [&](std::uint32_t slot, std::uint32_t triangle, const exact::Weights& where, double distance) {
            if (distance > maximum || distance >= candidate.distance) return;
            candidate = {slot, triangle, where, distance, origin + distance * unit, {}, true};
        });
    return finish(candidate);
}

namespace {

/// Leaves out the parts of each instance that have been hit.
class BeyondFilter final : public RayFilter {
  public:
    BeyondFilter(const Vec3f& origin, const Vec3f& unit) : origin_(origin), unit_(unit) {}
    bool concerns(std::uint32_t slot) const override { return met_.contains(slot); }
    bool leavesOut(std::uint32_t slot, const Vec3f& at, float) const override {
        return glm::dot(at - origin_, unit_) <= met_.at(slot);
    }
    /// Notes that an instance has been met at this distance. Returns a distance up to which all surfaces have been met.
    float meet(std::uint32_t slot, float distance) {
        const Vec3f o = glm::abs(origin_);
        const float margin = 0x1p-20f * (distance + std::max({o.x, o.y, o.z})) + 1e-30f;
        met_[slot] = distance + margin;
        return std::max(0.f, distance - 2 * margin);
    }

  private:
    Vec3f origin_, unit_;
    std::map<std::uint32_t, float> met_;  // by slot, up to where
};

}  // namespace

Result<std::vector<Pick>> Picker::crossings(const Vec3d& origin, const Vec3d& direction, double maximum,
                                            Surfaces surfaces) const {
    constexpr std::size_t kMax = 10'000;
    if (auto ok = checkPoint(*world_, origin, "the ray's origin"); !ok) return std::unexpected(ok.error());
    const double largest = std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
    if (!isFinite(direction) || !(largest > 0)) return fail("the ray's direction is zero or not finite");
    if (std::isnan(maximum)) return fail("the largest distance is not a number");
    const Vec3d unit = glm::normalize(direction / largest);
    const Vec3f eye = world_->fromWorld(origin), forward(unit);
    BeyondFilter filter(eye, forward);
    const LensedView view(*world_, {}, &filter);
    std::vector<Pick> picks;
    for (float from = 0; picks.size() < kMax;) {
        const Hit hit = view.intersect({eye, from, forward, std::numeric_limits<float>::infinity()});
        if (!hit) break;
        // The plane's place on the ray in double precision, unless it is seen edge on.
        const exact::Triangle t = triangleOf(world_->instance(hit.instance), hit.triangle);
        const Vec3d normal = glm::cross(t.b - t.a, t.c - t.a);
        const double steep = glm::dot(normal, unit), along = glm::dot(normal, t.a - origin) / steep;
        const bool clear = std::abs(steep) > 1e-6 * glm::length(normal);
        const double distance = std::max(0.0, clear ? along : double(hit.t));
        // Later hits may only be nearer by the error of floats.
        if (double(hit.t) > maximum * (1 + 0x1p-18) + searchRadius(*world_, origin, 0)) break;
        from = filter.meet(hit.instance, hit.t);
        if (distance > maximum) continue;
        picks.push_back(
            finish({hit.instance, hit.triangle, {hit.u, hit.v}, distance, origin + distance * unit, {}, true}));
    }
    std::map<std::uint32_t, double> last;  // of each of those: where two triangles touch, a side counts once
    const auto report = [&](std::uint32_t slot, std::uint32_t triangle, const exact::Weights& where, double distance) {
        const auto [known, isNew] = last.try_emplace(slot, distance);
        if (distance > maximum || picks.size() >= kMax) return;
        if (!isNew && std::abs(known->second - distance) <= 1e-9 * (1 + distance)) return;
        known->second = distance;
        picks.push_back(finish({slot, triangle, where, distance, origin + distance * unit, {}, true}));
    };
    const UnmetByRays unmet(*world_);
    unmet.crossVolumes(origin, unit, nullptr, report);
    if (surfaces == Surfaces::felt) unmet.crossProxies(origin, unit, report);
    std::ranges::stable_sort(picks, {}, &Pick::distance);
    return picks;
}

Result<Pick> Picker::closest(const Vec3d& point, double maximum) const {
    if (auto ok = checkPoint(*world_, point, "the point"); !ok) return std::unexpected(ok.error());
    if (!(maximum >= 0)) return fail("the largest distance is negative or not a number");
    Candidate best;
    best.distance = maximum;
    const auto visit = [&](std::uint32_t slot, std::uint32_t triangle) {
        const exact::Triangle t = triangleOf(world_->instance(slot), triangle);
        const exact::Weights w = exact::nearest(point, t);
        const Vec3d at = t.at(w.u, w.v);
        const double distance = glm::distance(at, point);
        if (distance < best.distance || (distance == best.distance && best.slot == kNoInstance))
            best = {slot, triangle, w, distance, at, point - at, false};
        return searchRadius(*world_, point, best.distance);
    };
    world_->visitNear(world_->fromWorld(point), searchRadius(*world_, point, maximum), std::ref(visit));
    return finish(best);
}

Result<std::vector<Pick>> Picker::overlaps(const Vec3d& center, double radius, Surfaces surfaces) const {
    if (auto ok = checkPoint(*world_, center, "the centre"); !ok) return std::unexpected(ok.error());
    if (!(radius >= 0) || !std::isfinite(radius)) return fail("the radius is negative or not finite");
    std::map<std::uint32_t, Candidate> bySlot;
    const float search = searchRadius(*world_, center, radius);
    const auto visit = [&](std::uint32_t slot, std::uint32_t triangle) {
        const exact::Triangle t = triangleOf(world_->instance(slot), triangle);
        const exact::Weights w = exact::nearest(center, t);
        const Vec3d at = t.at(w.u, w.v);
        const double distance = glm::distance(at, center);
        if (distance > radius) return search;
        Candidate& best = bySlot[slot];
        if (distance < best.distance) best = {slot, triangle, w, distance, at, center - at, false};
        return search;
    };
    if (surfaces == Surfaces::felt)
        world_->visitFelt(world_->fromWorld(center), search, std::ref(visit));
    else
        world_->visitNear(world_->fromWorld(center), search, std::ref(visit));
    std::vector<Pick> picks;
    for (const auto& [slot, candidate] : bySlot) picks.push_back(finish(candidate));
    std::ranges::stable_sort(picks, {}, &Pick::distance);
    return picks;
}

Result<std::vector<Pick>> Picker::overlaps(const Vec3d& center, double radius,
                                           const std::function<bool(const InstanceId&)>& concerns,
                                           const std::function<bool(const std::array<Vec3d, 3>&)>& meets,
                                           Surfaces surfaces) const {
    if (auto ok = checkPoint(*world_, center, "the centre"); !ok) return std::unexpected(ok.error());
    if (!(radius >= 0) || !std::isfinite(radius)) return fail("the radius is negative or not finite");
    struct Found {
        bool concerned = false, met = false;
        Candidate nearest;
    };
    std::map<std::uint32_t, Found> bySlot;
    const float search = searchRadius(*world_, center, radius);
    const auto visit = [&](std::uint32_t slot, std::uint32_t triangle) {
        const auto [entry, isNew] = bySlot.try_emplace(slot);
        Found& found = entry->second;
        if (isNew) found.concerned = concerns(world_->instance(slot).info.id);
        if (!found.concerned) return search;
        const exact::Triangle t = triangleOf(world_->instance(slot), triangle);
        const exact::Weights w = exact::nearest(center, t);
        const Vec3d at = t.at(w.u, w.v);
        const double distance = glm::distance(at, center);
        if (distance > radius) return search;
        if (distance < found.nearest.distance) found.nearest = {slot, triangle, w, distance, at, center - at, false};
        if (!found.met) found.met = meets({t.a, t.b, t.c});
        return search;
    };
    if (surfaces == Surfaces::felt)
        world_->visitFelt(world_->fromWorld(center), search, std::ref(visit));
    else
        world_->visitNear(world_->fromWorld(center), search, std::ref(visit));
    UnmetByRays(*world_).visitVolumes(visit);
    std::vector<Pick> picks;
    for (const auto& [slot, found] : bySlot)
        if (found.met) picks.push_back(finish(found.nearest));
    std::ranges::stable_sort(picks, {}, &Pick::distance);
    return picks;
}

Result<Pick> Picker::sweep(const Vec3d& center, double radius, const Vec3d& displacement) const {
    if (auto ok = checkPoint(*world_, center, "the ball's centre"); !ok) return std::unexpected(ok.error());
    if (!(radius >= 0) || !std::isfinite(radius)) return fail("the radius is negative or not finite");
    if (!isFinite(displacement)) return fail("the displacement is not finite");
    const double length = glm::length(displacement);
    if (auto now = closest(center, radius); !now || *now) {
        if (now) now->distance = 0;
        return now;
    }
    if (radius == 0 && length > 0) return ray(center, displacement, length);
    // Piece by piece, so that the ball around a piece is not much larger than the swept volume.
    constexpr double maxPieces = 256;
    const double pieces = std::clamp(std::ceil(length / (2 * radius)), 1.0, maxPieces);
    Candidate best;
    for (double piece = 0; piece < pieces && best.slot == kNoInstance; ++piece) {
        const Vec3d start = center + displacement * (piece / pieces), movement = displacement / pieces;
        const Vec3d middle = start + 0.5 * movement;
        const float search = searchRadius(*world_, middle, 0.5 * length / pieces + radius);
        double soonest = std::numeric_limits<double>::infinity();
        const auto visit = [&](std::uint32_t slot, std::uint32_t triangle) {
            const exact::Triangle t = triangleOf(world_->instance(slot), triangle);
            if (const auto contact = exact::sweep(start, radius, movement, t); contact && contact->time < soonest) {
                soonest = contact->time;
                const Vec3d at = t.at(contact->where.u, contact->where.v);
                best = {slot,
                        triangle,
                        contact->where,
                        length * (piece + contact->time) / pieces,
                        at,
                        start + contact->time * movement - at,
                        false};
            }
            return search;
        };
        // A piece out of reach hits nothing: things that far away are not traced.
        if (checkPoint(*world_, middle, "")) world_->visitNear(world_->fromWorld(middle), search, std::ref(visit));
    }
    return finish(best);
}

}  // namespace rtsg
