// Finds the tiles of a picture that cannot have changed: boxes around rays against boxes around changes.
#include "trail.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <unordered_set>
#include <utility>

#include "mesh/simd8.h"
#include "surface/surface_packet.h"
#include "world/ray_boxes.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// So many tests, of a box against a tile's rays, cost less than a twentieth of tracing the tile.
constexpr std::size_t kMaxBoxes = 64, kMaxTests = 1024;
constexpr std::size_t kBranches = 6;  // tests of a box besides two for each light
constexpr float kSlack = 0x1p-16f;    // of the coordinates: more than their roundings

constexpr float kInfinite = std::numeric_limits<float>::infinity();

// ---- rays ------------------------------------------------------------------------------------------------------

float smallestOf(F8 v) {
    float minimum = v[0];
    for (int i = 1; i < 8; ++i) minimum = std::min(minimum, v[i]);
    return minimum;
}
float greatestOf(F8 v) {
    return -smallestOf(-v);
}

/// Extends the box by the lanes in `mask`.
void extend(Bounds& box, std::uint32_t mask, const float* x, const float* y, const float* z) {
    if (!mask) return;
    const float* axes[] = {x, y, z};
    constexpr I8 kBits{1, 2, 4, 8, 16, 32, 64, 128};
    const auto low = static_cast<std::int32_t>(mask & 0xFF), high = static_cast<std::int32_t>(mask >> 8 & 0xFF);
    const I8 inLow = (kBits & low) != 0, inHigh = (kBits & high) != 0;
    for (int k = 0; k < 3; ++k) {
        const F8 a = load(axes[k]), b = load(axes[k] + 8), far = all(kInfinite);
        box.min[k] = std::min(box.min[k], smallestOf(min(select(inLow, a, far), select(inHigh, b, far))));
        box.max[k] = std::max(box.max[k], greatestOf(max(select(inLow, a, -far), select(inHigh, b, -far))));
    }
}

/// Whether something comes into `box` that at t lies between `low` + t `lowSide` and `high` + t `highSide`, for some t
/// from 0 to `end`.
bool sweeps(const Bounds& from, const Vec3f& lowSide, const Vec3f& highSide, double end, const Bounds& box) {
    double first = 0, last = end;
    // Keeps the part where c + t v <= 0.
    const auto cut = [&](double c, double v) {
        if (v > 0)
            last = std::min(last, -c / v);
        else if (v < 0)
            first = std::max(first, -c / v);
        else if (c > 0)
            last = -1;
    };
    for (int k = 0; k < 3; ++k) {
        cut(double{from.min[k]} - box.max[k], lowSide[k]);
        cut(double{box.min[k]} - from.max[k], -double{highSide[k]});
    }
    return first <= last;
}

/// Whether a straight way from one box to another comes into a third.
bool between(const Bounds& from, const Bounds& to, const Bounds& box) {
    if (from.empty() || to.empty()) return false;
    return sweeps(from, to.min - from.min, to.max - from.max, 1, box);
}
bool beyond(const Bounds& from, const Bounds& directions, const Bounds& box) {
    if (from.empty() || directions.empty()) return false;
    return sweeps(from, directions.min, directions.max, std::numeric_limits<double>::infinity(), box);
}

bool shadows(const Bounds& surfaces, const TraceLight& light, const Bounds& box) {
    if (surfaces.empty()) return false;
    if (light.kind == Light::Kind::directional || light.kind == Light::Kind::projectorParallel)
        return beyond(surfaces, {-light.direction, -light.direction}, box);
    return between(surfaces, {light.position, light.position}, box);
}

/// By what positions may be off.
Bounds loosened(Bounds box) {
    const Vec3f slack = glm::max(glm::abs(box.min), glm::abs(box.max)) * kSlack;
    return {box.min - slack, box.max + slack};
}

// ---- states ----------------------------------------------------------------------------------------------------

bool isFiniteBox(const Bounds& box) {
    for (int k = 0; k < 3; ++k)
        if (!std::isfinite(box.min[k]) || !std::isfinite(box.max[k])) return false;
    return true;
}

/// Collects what differs.
class Comparison {
  public:
    Comparison(const RayView& before, const RayView& now) : before_(before), now_(now) {}

    void everywhere() { found_.everywhere = true; }
    void light(const LightReach& reach) { found_.lights.push_back(reach); }
    const RayView& before() const { return before_; }
    const RayView& now() const { return now_; }
    bool isEverywhere() const { return found_.everywhere; }

    void slot(std::size_t slot) {
        add(before_, slot);
        add(now_, slot);
    }
    Differences take() { return std::move(found_); }

  private:
    void add(const RayView& world, std::size_t slot) {
        if (slot >= world.instances().size()) return;
        const RayInstance& instance = world.instances()[slot];
        if (!instance.info.id || !instance.mesh) return;
        const Bounds box = boxAround(instance);
        // Lines and points are wider than their bounds.
        if (instance.mesh->strokeCount > 0 || !isFiniteBox(box)) return everywhere();
        found_.boxes.push_back({box, instance.info.castShadow});
    }

    const RayView &before_, &now_;
    Differences found_;
};

bool looksTheSame(const RayInstance& a, const RayInstance& b) {
    const Instance &i = a.info, &j = b.info;
    return i.id == j.id && a.mesh == b.mesh && a.rayFromLocal == b.rayFromLocal && i.layer == j.layer &&
           i.castShadow == j.castShadow && i.clear == j.clear && i.seen == j.seen && i.strokes == j.strokes &&
           i.scope == j.scope && i.boundingBox == j.boundingBox && i.volume == j.volume;
}

void compareInstances(const RayView& before, const RayView& now, Comparison& found) {
    if (before.origin() != now.origin()) return found.everywhere();
    const RayInstances &a = before.instances(), &b = now.instances();
    constexpr std::size_t kPage = RayInstances::kPerPage;
    for (std::size_t first = 0; first < std::max(a.size(), b.size()); first += kPage) {
        if (first < a.size() && first < b.size() && &a[first] == &b[first]) continue;  // versions share the page
        for (std::size_t slot = first; slot < first + kPage; ++slot) {
            const bool inA = slot < a.size() && a[slot].info.id, inB = slot < b.size() && b[slot].info.id;
            if ((inA || inB) && !(inA && inB && looksTheSame(a[slot], b[slot]))) found.slot(slot);
        }
    }
}

/// Whether light has to do with a placed thing at all; viewpoints are known by the camera.
bool concernsPictures(const PlacedEntry* entry) {
    if (!entry || std::holds_alternative<std::monostate>(entry->what)) return false;
    const View* view = std::get_if<View>(&entry->what);
    return !view || view->navigation;  // which may bring a headlight
}

/// `light`: a Light or a TraceLight at `apex`.
template <class L>
LightReach reachAt(const L& light, const Vec3f& apex) {
    constexpr float kAll = 4;
    const bool ends = (light.kind == Light::Kind::point || light.kind == Light::Kind::spot) && light.radius >= 0;
    return {apex, light.direction, ends ? light.radius / light.localFromWorld : kInfinite,
            light.kind == Light::Kind::spot ? light.cutOffAngle : kAll};
}
LightReach reachOf(const TraceLight& light) {
    return reachAt(light, light.position);
}

/// Compares lights that differ in place, direction and colour at most; false if they differ in more.
bool compareLamps(const PlacedEntry* before, const PlacedEntry* now, Comparison& found) {
    const Light* a = before ? std::get_if<Light>(&before->what) : nullptr;
    const Light* b = now ? std::get_if<Light>(&now->what) : nullptr;
    if (!a || !b || a->kind != b->kind || a->on != b->on || a->shadows != b->shadows || a->scope != b->scope ||
        before->placed.layer != now->placed.layer)
        return false;
    if (!a->on) return true;
    if (a->kind != Light::Kind::point && a->kind != Light::Kind::spot) return false;
    found.light(reachAt(*a, found.before().fromWorld(a->position)));
    found.light(reachAt(*b, found.now().fromWorld(b->position)));
    return true;
}

void compareLights(const LightState& before, const LightState& now, Comparison& found) {
    if (before.layers ? !now.layers || *before.layers != *now.layers : now.layers != nullptr) found.everywhere();
    using Entry = std::shared_ptr<const PlacedEntry>;
    PagedArray<Entry>::differences(before.placed, now.placed, [&](std::size_t, const Entry& a, const Entry& b) {
        if (a == b || (!concernsPictures(a.get()) && !concernsPictures(b.get()))) return;
        if (!compareLamps(a.get(), b.get(), found)) found.everywhere();
    });
    PagedArray<LightScope>::differences(before.scopes, now.scopes,
                                        [&](std::size_t, const LightScope& a, const LightScope& b) {
                                            if (a.around != b.around || a.lights != b.lights) found.everywhere();
                                        });
}

void compareMaterials(const LightState& before, const LightState& now, Comparison& found) {
    std::unordered_set<std::size_t> changed;
    using Entry = std::shared_ptr<const MaterialEntry>;
    PagedArray<Entry>::differences(before.materials, now.materials, [&](std::size_t i, const Entry& a, const Entry& b) {
        if (a != b) changed.insert(i);
    });
    using Slots = PagedArray<SlotShading, kSlotBits>;
    Slots::differences(before.slots, now.slots, [&](std::size_t slot, const SlotShading& a, const SlotShading& b) {
        if (a.material != b.material || a.lights != b.lights || a.channels != b.channels) found.slot(slot);
    });
    if (changed.empty()) return;
    for (const LightState* state : {&before, &now})
        for (std::size_t slot = 0; slot < state->slots.size(); ++slot)
            if (changed.contains(state->slots[slot].material)) found.slot(slot);
}

bool areDrawnAlike(const RenderSettings& a, const RenderSettings& b) {
    return a.integrator == b.integrator && a.width == b.width && a.height == b.height && a.region == b.region &&
           a.samplesPerPixel == b.samplesPerPixel && a.error == b.error && a.seed == b.seed && a.cutoff == b.cutoff &&
           a.maxDepth == b.maxDepth && a.shadows == b.shadows && a.colorSpace == b.colorSpace && a.caps == b.caps &&
           a.layers == b.layers;
}

}  // namespace

void TileReach::note(const RayPacket16& rays, std::uint32_t active, std::uint32_t hits, const SurfacePacket& surfaces,
                     bool primary) {
    if (primary) extend(eyes, active, rays.originX, rays.originY, rays.originZ);
    const Lanes3& met = surfaces.position;
    extend(primary ? first : later, hits, met.x, met.y, met.z);
    extend(primary ? lost : lostLater, active & ~hits, rays.directionX, rays.directionY, rays.directionZ);
}

bool TileReach::meets(const Bounds& box) const {
    return between(eyes, first, box) || beyond(eyes, lost, box) || between(first, later, box) ||
           between(later, later, box) || beyond(first, lostLater, box) || beyond(later, lostLater, box);
}

bool LightReach::meets(const Bounds& surfaces) const {
    if (surfaces.empty()) return false;
    const Bounds box = loosened(surfaces);
    const Vec3f nearest = glm::clamp(apex, box.min, box.max);
    constexpr float kMargin = 1 + kSlack;
    if (!(glm::distance(nearest, apex) <= radius * kMargin)) return false;
    const float angle = halfAngle + kSlack;
    if (!(angle < std::numbers::pi_v<float> / 2) || !(angle > 0)) return true;
    // A ball around the box against the cone (Eberly, "Intersection of a Sphere and a Cone", 2002).
    const Vec3f center = box.center(), from = center - apex;
    const float size = glm::length(box.size()) / 2 * kMargin, sine = std::sin(angle), cosine = std::cos(angle);
    const Vec3f behind = from + direction * (size / sine);
    if (!(glm::dot(direction, behind) >= glm::length(behind) * cosine)) return false;
    if (-glm::dot(direction, from) >= glm::length(from) * sine) return glm::length(from) <= size;
    return true;
}

Untouched::Untouched(const Differences& differences, const std::vector<TraceLight>& lights)
    : differences_(differences) {
    for (const TraceLight& light : lights)
        if (light.shadows) lights_.push_back({light, reachOf(light)});
    const std::size_t maximum = std::clamp<std::size_t>(kMaxTests / (kBranches + 2 * lights_.size()), 1, kMaxBoxes);
    for (const Differences::Box& box : differences.boxes) {
        boxes_.push_back({loosened(box.around), box.castsShadow});
        all_.extend(boxes_.back().around.min), all_.extend(boxes_.back().around.max);
    }
    // Slots that follow each other often lie together.
    while (boxes_.size() > maximum) {
        for (std::size_t i = 0; i + 1 < boxes_.size(); i += 2) {
            const Differences::Box other = boxes_[i + 1];
            boxes_[i / 2] = boxes_[i];
            boxes_[i / 2].around.extend(other.around.min), boxes_[i / 2].around.extend(other.around.max);
            boxes_[i / 2].castsShadow |= other.castsShadow;
        }
        if (boxes_.size() % 2) boxes_[boxes_.size() / 2] = boxes_.back();
        boxes_.resize((boxes_.size() + 1) / 2);
    }
}

bool Untouched::operator()(const TileReach& reach) const {
    if (std::ranges::any_of(differences_.lights, [&](const LightReach& light) { return reach.isLitBy(light); }))
        return false;
    if (boxes_.empty()) return true;
    const auto isMet = [&](const Differences::Box& box) { return reach.meets(box.around); };
    if (reach.meets(all_) && std::ranges::any_of(boxes_, isMet)) return false;
    return std::ranges::none_of(lights_, [&](const ShadowLight& light) {
        const auto isBetween = [&](const Bounds& box) {
            return shadows(reach.first, light.light, box) || shadows(reach.later, light.light, box);
        };
        return reach.isLitBy(light.reach) && isBetween(all_) &&
               std::ranges::any_of(
                   boxes_, [&](const Differences::Box& box) { return box.castsShadow && isBetween(box.around); });
    });
}

Differences differences(const LightState& before, const RayView& worldBefore, const LightState& now,
                        const RayView& world) {
    Comparison found(worldBefore, world);
    if (&worldBefore != &world) compareInstances(worldBefore, world, found);
    if (&before != &now) {
        compareLights(before, now, found);
        if (!found.isEverywhere()) compareMaterials(before, now, found);
    }
    return found.take();
}

void Trail::begin(std::shared_ptr<const LightState> light, std::shared_ptr<const WorldVersion> world,
                  const RenderSettings& settings) {
    known_ = light_ && world_ && areDrawnAlike(settings, settings_);
    if (known_) differences_ = differences(*light_, *world_, *light, *world);
    light_ = std::move(light), world_ = std::move(world);
    settings_ = settings;
    settings_.progress = {}, settings_.nameOf = {}, settings_.before.reset();  // are not compared, and may hold much
    drawn_ = 0, usable_ = false;
}

bool Trail::refines() const {
    return refines_ && settings_.integrator == Integrator::path && settings_.error == 0;
}

void Trail::end(bool complete) {
    parts_.resize(complete ? drawn_ : 0);
    if (!complete) light_.reset(), world_.reset();
}

Trail::Part& Trail::next(const Camera& camera) {
    const bool isNew = drawn_ == parts_.size();
    if (isNew) parts_.push_back(std::make_unique<Part>());
    Part& part = *parts_[drawn_++];
    usable_ = known_ && !isNew && part.camera == camera;
    part.camera = camera;
    return part;
}

}  // namespace rtsg::trace
