// Filters of rays: ClipPlanes, and instances that a picture leaves out.
#include "left_out.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "world/ray_boxes.h"

namespace rtsg::trace {

namespace {

/// The planes through a window's edges that are no edges of the picture's.
std::vector<CutPlane> planesOf(const std::array<float, 4>& window, const Camera& eye) {
    std::vector<CutPlane> planes;
    if (eye.panorama) return planes;
    const glm::dmat3 rows = glm::transpose(eye.steps());
    const auto add = [&](float fraction, double low, double high, const Vec3d& across, double side) {
        if (!(fraction > 0 && fraction < 1)) return;
        const double at = low + double{fraction} * (high - low);
        Vec3d normal = side * (eye.orthographic ? across : across - at * rows[2]);
        double offset = -glm::dot(normal, eye.position) - (eye.orthographic ? side * at : 0);
        const double length = glm::length(normal);
        if (length > 0 && std::isfinite(length + offset)) planes.push_back({normal / length, offset / length});
    };
    const auto [left, right, bottom, top] = window;
    add(left, eye.left, eye.rightEdge, rows[0], 1), add(right, eye.left, eye.rightEdge, rows[0], -1);
    add(bottom, eye.bottom, eye.top, rows[1], 1), add(top, eye.bottom, eye.top, rows[1], -1);
    return planes;
}

/// ClipPlanes, and Viewports of LayoutGroups or that are groups themselves: those of the scopes around a shape cut it
/// (11.4.1, 35.4.4, 36.4.2).
class ClipFilter final : public RayFilter {
  public:
    /// Null: nothing is cut.
    static std::shared_ptr<const RayFilter> of(const LightState& state, const RayView& world,
                                               const RenderSettings& settings, const Camera* eye) {
        std::shared_ptr<ClipFilter> filter;
        eachCut(state, eye, [&](const ClipEntry& clip, const std::vector<CutPlane>& planes) {
            if (!filter) filter = std::make_shared<ClipFilter>(state);
            for (const CutPlane& plane : planes) {
                const double offset = plane.offset + glm::dot(plane.normal, world.origin());
                const Vec4f cut(Vec3f(plane.normal), static_cast<float>(offset));
                filter->planes_[clip.scope].push_back(cut);
                if (settings.caps && clip.capped) filter->caps_.push_back({cut, clip.scope});
            }
        });
        // While a shutter is open things are elsewhere, too.
        if (filter && settings.shutter == 0) filter->findBounds(world);
        if (filter && filter->bounds_.empty()) return nullptr;
        return filter;
    }
    explicit ClipFilter(const LightState& state)
        : slots_(state.slots), planes_(std::max<std::size_t>(state.scopes.size(), 1)), around_(planes_.size()) {
        for (std::size_t i = 0; i < state.scopes.size(); ++i) around_[i] = state.scopes[i].around;
    }
    bool concerns(std::uint32_t slot) const override {
        for (std::uint32_t scope = scopeOf(slot);; scope = around_[scope]) {
            if (!planes_[scope].empty()) return true;
            if (scope == 0) return false;
        }
    }
    bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const override {
        for (std::uint32_t scope = scopeOf(slot);; scope = around_[scope]) {
            for (const Vec4f& plane : planes_[scope])
                if (glm::dot(Vec3f(plane), at) + plane.w < -slack(plane, error)) return true;
            if (scope == 0) return false;
        }
    }

    bool makesCaps() const override { return !caps_.empty(); }
    bool findNext(const Ray& ray, Crossing& at) const override {
        Crossing best;
        best.t = ray.tMax;
        bool found = false;
        for (std::uint32_t i = 0; i < caps_.size(); ++i) {
            const Vec4f& cut = caps_[i].plane;
            const float along = glm::dot(Vec3f(cut), ray.direction);
            const float t = -(glm::dot(Vec3f(cut), ray.origin) + cut.w) / along;
            const bool comes = t > at.t || (t == at.t && i > at.plane && at.plane != Crossing().plane);
            if (along == 0 || !comes || !(t < best.t)) continue;
            best = {t, i, -Vec3f(cut)};
            found = true;
        }
        if (found) at = best;
        return found;
    }
    bool isCapped(std::uint32_t slot, std::uint32_t plane, const Vec3f& at) const override {
        bool cuts = false;
        for (std::uint32_t scope = scopeOf(slot);; scope = around_[scope]) {
            cuts = cuts || scope == caps_[plane].scope;
            for (const Vec4f& other : planes_[scope])
                if (other != caps_[plane].plane && glm::dot(Vec3f(other), at) + other.w < 0) return false;
            if (scope == 0) return cuts;
        }
    }

  private:
    /// Surfaces that lie on a plane are kept: which of their rays end a rounding before it, and which behind, is
    /// chance.
    static float slack(const Vec4f& plane, float error) {
        const Vec3f normal = glm::abs(Vec3f(plane));
        return error * (normal.x + normal.y + normal.z) + 0x1p-23f * std::abs(plane.w);
    }
    void findBounds(const RayView& world) {
        if (!planes_[0].empty()) return;  // all there is
        Bounds around;
        for (std::size_t slot = 0; slot < world.instances().size(); ++slot) {
            const RayInstance& instance = world.instances()[slot];
            if (!instance.info.id || !instance.mesh || !concerns(static_cast<std::uint32_t>(slot))) continue;
            if (instance.mesh->strokeCount > 0) return;
            const Bounds box = boxAround(instance);
            around.extend(box.min), around.extend(box.max);
        }
        bounds_ = around;
    }
    struct Cap {
        Vec4f plane{0};
        std::uint32_t scope = 0;
    };
    std::uint32_t scopeOf(std::uint32_t slot) const { return slot < slots_.size() ? slots_[slot].lights : 0; }
    SlotPages slots_;
    std::vector<std::vector<Vec4f>> planes_;  // by scope
    std::vector<std::uint32_t> around_;
    std::vector<Cap> caps_;
};

/// Leaves out whole instances besides what another filter does. `Hides`: which ones, called with a slot.
template <class Base, class Hides>
class InstanceFilter : public Base {
  public:
    InstanceFilter(Hides hides, std::shared_ptr<const RayFilter> other)
        : hides_(std::move(hides)), other_(std::move(other)) {
        this->hidesAny_ = true;
        this->bounds_ = other_ ? other_->bounds() : Bounds{};
    }
    bool hides(std::uint32_t slot) const override { return hides_(slot); }
    bool concerns(std::uint32_t slot) const override { return hides_(slot) || (other_ && other_->concerns(slot)); }
    bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const override {
        return hides_(slot) || (other_ && other_->leavesOut(slot, at, error));
    }
    bool makesCaps() const override { return other_ && other_->makesCaps(); }
    bool findNext(const Ray& ray, RayFilter::Crossing& at) const override {
        return other_ && other_->findNext(ray, at);
    }
    bool isCapped(std::uint32_t slot, std::uint32_t plane, const Vec3f& at) const override {
        return !hides_(slot) && other_->isCapped(slot, plane, at);
    }
    /// Around the instances that are not hidden.
    void setKept(const Bounds& kept) { this->kept_ = kept; }

  protected:
    Hides hides_;

  private:
    std::shared_ptr<const RayFilter> other_;
};

struct IsListed {
    std::vector<bool> hidden;
    bool operator()(std::uint32_t slot) const { return slot < hidden.size() && hidden[slot]; }
};
using HidingFilter = InstanceFilter<RayFilter, IsListed>;

/// Scopes by number, and the one that each instance is in.
struct ScopeTree {
    explicit ScopeTree(const LightState& state)
        : slots(state.slots), around(std::max<std::size_t>(state.scopes.size(), 1)) {
        for (std::size_t i = 0; i < state.scopes.size(); ++i) around[i] = state.scopes[i].around;
    }
    std::uint32_t of(std::uint32_t slot) const { return slot < slots.size() ? slots[slot].lights : 0; }
    SlotPages slots;
    std::vector<std::uint32_t> around;
};

struct IsOutside {
    std::shared_ptr<const ScopeTree> tree;
    std::uint32_t scope = 0;
    bool operator()(std::uint32_t slot) const {
        for (std::uint32_t at = tree->of(slot); at != scope; at = tree->around[at])
            if (at == 0) return true;
        return false;
    }
};
class OutsideFilter final : public InstanceFilter<ScopeFilter, IsOutside> {
  public:
    using InstanceFilter::InstanceFilter;
    bool isOutside(std::uint32_t slot) const override { return hides_(slot); }
};

bool mayShade(const RayInstance& instance) {
    return instance.info.castShadow || instance.info.volume;
}

/// The box of instances, as long as it is known.
struct Extent {
    Bounds box;
    bool known = true;
    std::size_t casters = 0;
    void add(const RayInstance& instance) {
        casters += mayShade(instance);
        if (instance.mesh->strokeCount > 0) known = false;  // as wide as pixels make them
        if (!known) return;
        const Bounds around = boxAround(instance);
        box.extend(around.min), box.extend(around.max);
    }
};

}  // namespace

void eachCut(const LightState& state, const Camera* eye,
             const std::function<void(const ClipEntry&, const std::vector<CutPlane>&)>& take) {
    for (std::size_t i = 0; i < state.placed.size(); ++i) {
        const PlacedEntry* entry = state.placed[i].get();
        const ClipEntry* clip = entry ? std::get_if<ClipEntry>(&entry->what) : nullptr;
        if (!clip) continue;
        const bool byEye = clip->window && eye;
        if (const std::vector<CutPlane> planes = byEye ? planesOf(*clip->window, *eye) : clip->planes; !planes.empty())
            take(*clip, planes);
    }
}

std::shared_ptr<const RayFilter> clipFilter(const LightState& state, const RayView& world,
                                            const RenderSettings& settings, const Camera* eye) {
    return ClipFilter::of(state, world, settings, eye);
}

std::shared_ptr<const RayFilter> hidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other,
                                              const RayView& world, const RenderSettings& settings) {
    IsListed isHidden{std::move(hidden)};
    Extent kept;
    // While a shutter is open things are elsewhere, too.
    if (settings.shutter == 0)
        for (std::uint32_t slot = 0; slot < world.instances().size(); ++slot) {
            const RayInstance& instance = world.instances()[slot];
            if (instance.info.id && instance.mesh && !isHidden(slot)) kept.add(instance);
        }
    auto filter = std::make_shared<HidingFilter>(std::move(isHidden), std::move(other));
    if (settings.shutter == 0 && kept.known) filter->setKept(kept.box);
    return filter;
}

std::vector<std::shared_ptr<const ScopeFilter>> scopeFilters(std::span<const std::uint32_t> scopes,
                                                             const std::shared_ptr<const RayFilter>& other,
                                                             const LightState& state, const RayView& world,
                                                             const RenderSettings& settings) {
    std::vector<std::shared_ptr<const ScopeFilter>> filters(scopes.size());
    if (scopes.empty()) return filters;
    const auto tree = std::make_shared<const ScopeTree>(state);
    constexpr std::uint32_t kNone = 0xFFFFFFFF;
    std::vector<std::uint32_t> indexOf(tree->around.size(), kNone);
    for (std::uint32_t i = 0; i < scopes.size(); ++i) indexOf[scopes[i]] = i;
    std::vector<Extent> inside(scopes.size());
    std::size_t casters = 0;
    for (std::uint32_t slot = 0; slot < world.instances().size(); ++slot) {
        const RayInstance& instance = world.instances()[slot];
        if (!instance.info.id || !instance.mesh) continue;
        casters += mayShade(instance);
        for (std::uint32_t at = tree->of(slot); at != 0; at = tree->around[at])
            if (indexOf[at] != kNone) inside[indexOf[at]].add(instance);
    }
    for (std::size_t i = 0; i < scopes.size(); ++i) {
        if (inside[i].casters == casters) continue;
        auto filter = std::make_shared<OutsideFilter>(IsOutside{tree, scopes[i]}, other);
        if (settings.shutter == 0 && inside[i].known) filter->setKept(inside[i].box);
        filters[i] = std::move(filter);
    }
    return filters;
}

}  // namespace rtsg::trace
