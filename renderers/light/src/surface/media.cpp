// Keeps sets of bodies as lists with common tails, and finds the interface that a ray crosses where several surfaces
// meet.
#include "media.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "coincident.h"
#include "surface_packet.h"
#include "world/coincident_faces.h"
#include "world/ray_boxes.h"

namespace rtsg::trace {

namespace {

/// A ray that lies in more bodies does not notice the next one.
constexpr std::uint32_t kMaxBodies = 64;
constexpr std::size_t kMaxSets = std::size_t{1} << 20;

bool isBack(const Hit& hit, const Vec3f& direction) {
    return glm::dot(direction, hit.normal) > 0;
}

float diagonalOf(const RayInstance& instance) {
    const Bounds box = boxAround(instance);
    return glm::length(box.max - box.min);
}

/// Calls `tell(hit)` for the surfaces of bodies that the ray meets where it met this one, up to rounding, which is
/// `apart`.
template <class Visitor>
void visitCoincidentBodies(const TraceScene& scene, const Ray& ray, const Hit& hit, float& apart,
                           const Visitor& report) {
    const RayView& world = *scene.world;
    apart = roundingAt(ray.origin, ray.origin + hit.t * ray.direction) + 2 * glm::length(world.point(hit).error);
    const auto near = [&](const Vec3f& center, float radius, const NearVisitor& visit) {
        world.visitNear(center, radius, [&](std::uint32_t slot, std::uint32_t triangle) {
            return Media::isBody(scene, slot) ? visit(slot, triangle) : radius;
        });
    };
    visitCoincident(world, near, ray, hit.t, apart, [&](const Hit& found) {
        const bool leftOut = scene.filter && scene.filter->concerns(found.instance) &&
                             scene.filter->leavesOutAlong(found.instance, ray.origin, ray.direction, found.t);
        if (!leftOut) report(found);
    });
}

}  // namespace

Media::Media(const TraceScene& scene) : scene_(scene) {
    for (const std::uint32_t slot : scene.aroundEye) aroundEye_ = with(aroundEye_, slot);
}

const Vec3f& Media::absorption(Set set) const {
    static const Vec3f none(0);
    return set ? node(set).absorption : none;
}

Media::Set Media::with(Set set, std::uint32_t slot) {
    const std::uint64_t key = std::uint64_t{set} << 32 | slot;
    if (const auto found = known_.find(key); found != known_.end()) return found->second;
    const Material& material = scene_.materials[scene_.slot(slot).material].material;
    Node created;
    created.slot = created.shown = slot, created.rest = set;
    created.index = material.refractiveIndex, created.priority = material.priority,
    created.absorption = material.absorption;
    created.size = diagonalOf(scene_.world->instance(slot));
    if (set) {
        const Node& rest = node(set);
        if (rest.count >= kMaxBodies || nodes_.size() >= kMaxSets) return set;
        created.count = rest.count + 1;
        const auto rank = [](const Node& of) { return std::tuple(of.priority, -of.size, of.shown); };
        if (rank(rest) > rank(created)) {
            created.shown = rest.shown, created.index = rest.index, created.priority = rest.priority,
            created.size = rest.size;
            created.absorption = rest.absorption;
        }
    }
    nodes_.push_back(created);
    return known_[key] = static_cast<Set>(nodes_.size());
}

Media::Set Media::without(Set set, std::uint32_t slot) {
    std::uint32_t before[kMaxBodies];
    std::size_t count = 0;
    Set at = set;
    for (; at && node(at).slot != slot; at = node(at).rest) before[count++] = node(at).slot;
    if (!at) return set;
    Set result = node(at).rest;
    while (count > 0) result = with(result, before[--count]);
    return result;
}

bool Media::has(Set set, std::uint32_t slot) const {
    for (; set; set = node(set).rest)
        if (node(set).slot == slot) return true;
    return false;
}

std::vector<Hit> Media::inPlace(const Ray& ray, const Hit& hit, float& apart) const {
    std::vector<Hit> others;
    if (hit.isCap() || (scene_.coincident && !scene_.coincident->mayTouchBodies(scene_, hit))) return others;
    visitCoincidentBodies(scene_, ray, hit, apart, [&](const Hit& found) {
        if (found.instance != hit.instance || found.triangle != hit.triangle) others.push_back(found);
    });
    if (others.empty()) apart = 0;
    return others;
}

Media::Interface Media::cross(Set from, const Ray& ray, const Hit& hit) {
    float apart = 0;
    const std::vector<Hit> others = inPlace(ray, hit, apart);
    Interface found = cross(from, ray.direction, hit, others);
    found.apart = apart;
    return found;
}

Media::Interface Media::cross(Set from, const Vec3f& direction, const Hit& hit, std::span<const Hit> others) {
    // A ray that goes through an edge meets both of its triangles, and has met one surface.
    const auto isFirst = [&](std::size_t i) {
        const auto alike = [&](const Hit& other) {
            return other.instance == others[i].instance && isBack(other, direction) == isBack(others[i], direction);
        };
        return !alike(hit) && std::none_of(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(i), alike);
    };
    Set before = from, after = from;
    const auto take = [&](const Hit& met, bool back) {
        if (isBack(met, direction) != back) return;
        if (!back) return static_cast<void>(after = with(after, met.instance));
        if (has(after, met.instance))
            after = without(after, met.instance);
        else
            before = with(before, met.instance);
    };
    for (const bool back : {false, true}) {
        take(hit, back);
        for (std::size_t i = 0; i < others.size(); ++i)
            if (isBody(scene_, others[i].instance) && isFirst(i)) take(others[i], back);
    }
    Interface found;
    found.beyond = after;
    const Node* here = before ? &node(before) : nullptr;
    const Node* there = after ? &node(after) : nullptr;
    const bool same = here && there ? here->shown == there->shown : here == there;
    found.eta = same ? 0 : (there ? there->index : 1) / (here ? here->index : 1);
    return found;
}

std::optional<float> RunsIn::pass(const TraceScene& scene, const Ray& ray, const Hit& hit) {
    if (!media || !Media::isBody(scene, hit.instance)) return std::nullopt;
    const Media::Interface at = media->cross(set, ray, hit);
    set = at.beyond;
    return at.eta;
}

std::optional<float> RunsIn::pass(const TraceScene& scene, const Vec3f& direction, const Hit& hit,
                                  std::span<const Hit> others) {
    if (!media || !Media::isBody(scene, hit.instance)) return std::nullopt;
    const Media::Interface at = media->cross(set, direction, hit, others);
    set = at.beyond;
    return at.eta;
}

std::vector<std::uint32_t> bodiesAround(const TraceScene& scene, const Vec3f& position) {
    std::vector<std::uint32_t> possible, open, result;
    const RayInstances& instances = scene.world->instances();
    for (std::uint32_t slot = 0; slot < instances.size(); ++slot) {
        const RayInstance& instance = instances[slot];
        if (!instance.info.id || !instance.mesh || !Media::isBody(scene, slot)) continue;
        const Bounds box = boxAround(instance);
        const bool within =
            glm::all(glm::lessThanEqual(box.min, position)) && glm::all(glm::greaterThanEqual(box.max, position));
        if (within && instance.mesh->isClosed()) possible.push_back(slot);
    }
    if (possible.empty()) return result;
    // A ray to anywhere leaves those that it has not come into on its way.
    constexpr int kMax = 10'000;
    const auto find = [](std::vector<std::uint32_t>& in, std::uint32_t slot) { return std::ranges::find(in, slot); };
    Ray ray{position, 0, glm::normalize(Vec3f(.361f, .218f, .907f)), std::numeric_limits<float>::infinity()};
    for (int i = 0; i < kMax; ++i) {
        const Hit met = scene.world->intersect(ray);
        if (!met) break;
        std::vector<Hit> all{met};
        float apart = 0;
        if (!met.isCap()) visitCoincidentBodies(scene, ray, met, apart, [&](const Hit& hit) { all.push_back(hit); });
        for (const bool back : {false, true})
            for (std::size_t k = 0; k < all.size(); ++k) {
                const std::uint32_t slot = all[k].instance;
                const bool again = std::any_of(
                    all.begin(), all.begin() + static_cast<std::ptrdiff_t>(k),
                    [&](const Hit& hit) { return hit.instance == slot && isBack(hit, ray.direction) == back; });
                if (isBack(all[k], ray.direction) != back || again || find(possible, slot) == possible.end()) continue;
                if (!back)
                    open.push_back(slot);
                else if (const auto entered = find(open, slot); entered != open.end())
                    open.erase(entered);
                else
                    result.push_back(slot);
            }
        ray.tMin = std::nextafter((met.t + 2 * apart) * (1 + 0x1p-22f), HUGE_VALF);
        if (!std::isfinite(ray.tMin)) break;
    }
    return result;
}

void findInterfaces(const TraceScene& scene, const RayPacket16& rays, const PathTask* tasks, SurfacePacket& s) {
    for (std::uint32_t rest = s.mask; s.media && rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        s.within[lane] = s.beyond[lane] = tasks ? tasks[lane].media : s.media->aroundEye();
    }
    for (std::uint32_t rest = s.mask & s.special; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const float index = s.material[lane]->refractiveIndex;
        if (!(index > 0)) continue;
        s.eta[lane] = s.back >> lane & 1u ? 1 / index : index;
        if (!s.media || !Media::isBody(scene, s.hits.instance[lane])) continue;
        const Ray ray = rays.ray(lane);
        const Media::Interface found = s.media->cross(s.within[lane], ray, s.hit(lane));
        s.beyond[lane] = found.beyond;
        if (found.eta > 0)
            s.eta[lane] = found.eta;
        else
            s.coverage[lane] = 0;
        s.filled = nullptr;
        if (!(found.apart > 0)) continue;
        // Rays that go on must not meet the other surfaces again.
        findPoints(scene, s);
        s.error.set(lane, glm::max(s.error.get(lane), Vec3f(2 * found.apart)));
    }
}

}  // namespace rtsg::trace
