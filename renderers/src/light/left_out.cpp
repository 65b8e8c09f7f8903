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
std::vector<ClipEntry::Plane> planesOf(const std::array<float, 4>& window, const Camera& eye) {
    std::vector<ClipEntry::Plane> planes;
    if (eye.panorama) return planes;
    const glm::dmat3 rows = glm::transpose(eye.steps());
    const auto add = [&](float share, double low, double high, const Vec3d& across, double side) {
        if (!(share > 0 && share < 1)) return;
        const double at = low + double{share} * (high - low);
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
        for (std::size_t i = 0; i < state.placed.size(); ++i) {
            const PlacedEntry* entry = state.placed[i].get();
            const ClipEntry* clip = entry ? std::get_if<ClipEntry>(&entry->what) : nullptr;
            if (!clip) continue;
            std::vector<ClipEntry::Plane> planes = clip->planes;
            if (clip->window && eye) planes = planesOf(*clip->window, *eye);
            if (planes.empty()) continue;
            if (!filter) filter = std::make_shared<ClipFilter>(state);
            for (const ClipEntry::Plane& plane : planes) {
                const double offset = plane.offset + glm::dot(plane.normal, world.origin());
                const Vec4f cut(Vec3f(plane.normal), static_cast<float>(offset));
                filter->planes_[clip->scope].push_back(cut);
                if (settings.caps && clip->capped) filter->caps_.push_back({cut, clip->scope});
            }
        }
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

/// Leaves out some instances besides what another filter does.
class HidingFilter final : public RayFilter {
  public:
    HidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other)
        : hidden_(std::move(hidden)), other_(std::move(other)) {}
    bool concerns(std::uint32_t slot) const override { return isHidden(slot) || (other_ && other_->concerns(slot)); }
    bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const override {
        return isHidden(slot) || (other_ && other_->leavesOut(slot, at, error));
    }
    bool makesCaps() const override { return other_ && other_->makesCaps(); }
    bool findNext(const Ray& ray, Crossing& at) const override { return other_ && other_->findNext(ray, at); }
    bool isCapped(std::uint32_t slot, std::uint32_t plane, const Vec3f& at) const override {
        return !isHidden(slot) && other_->isCapped(slot, plane, at);
    }
    void findKept(const RayView& world) {
        Bounds around;
        for (std::uint32_t slot = 0; slot < world.instances().size(); ++slot) {
            const RayInstance& instance = world.instances()[slot];
            if (!instance.info.id || !instance.mesh || isHidden(slot)) continue;
            if (instance.mesh->strokeCount > 0) return;  // as wide as pixels make them
            const Bounds box = boxAround(instance);
            around.extend(box.min), around.extend(box.max);
        }
        kept_ = around;
    }

  private:
    bool isHidden(std::uint32_t slot) const { return slot < hidden_.size() && hidden_[slot]; }
    std::vector<bool> hidden_;
    std::shared_ptr<const RayFilter> other_;
};

}  // namespace

std::shared_ptr<const RayFilter> clipFilter(const LightState& state, const RayView& world,
                                            const RenderSettings& settings, const Camera* eye) {
    return ClipFilter::of(state, world, settings, eye);
}

std::shared_ptr<const RayFilter> hidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other,
                                              const RayView& world, const RenderSettings& settings) {
    auto filter = std::make_shared<HidingFilter>(std::move(hidden), std::move(other));
    // While a shutter is open things are elsewhere, too.
    if (settings.shutter == 0) filter->findKept(world);
    return filter;
}

}  // namespace rtsg::trace
