// Filters of rays: ClipPlanes, and instances that a picture leaves out.
#include "left_out.h"

#include <algorithm>
#include <utility>

namespace rtsg::trace {

namespace {

/// ClipPlanes, and viewports of LayoutGroups: those of the scopes around a shape cut it (11.4.1, 36.4.2).
class ClipFilter final : public RayFilter {
  public:
    /// Null: nothing is cut.
    static std::shared_ptr<const RayFilter> of(const LightState& state, const RayView& world) {
        std::shared_ptr<ClipFilter> filter;
        for (std::size_t i = 0; i < state.placed.size(); ++i) {
            const PlacedEntry* entry = state.placed[i].get();
            const ClipEntry* clip = entry ? std::get_if<ClipEntry>(&entry->what) : nullptr;
            if (!clip) continue;
            if (!filter) filter = std::make_shared<ClipFilter>(state);
            for (const ClipEntry::Plane& plane : clip->planes) {
                const double offset = plane.offset + glm::dot(plane.normal, world.origin());
                filter->planes_[clip->scope].emplace_back(Vec3f(plane.normal), static_cast<float>(offset));
            }
        }
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
    bool leavesOut(std::uint32_t slot, const Vec3f& at) const override {
        for (std::uint32_t scope = scopeOf(slot);; scope = around_[scope]) {
            for (const Vec4f& plane : planes_[scope])
                if (glm::dot(Vec3f(plane), at) + plane.w < 0) return true;
            if (scope == 0) return false;
        }
    }

  private:
    std::uint32_t scopeOf(std::uint32_t slot) const { return slot < slots_.size() ? slots_[slot].lights : 0; }
    SlotPages slots_;
    std::vector<std::vector<Vec4f>> planes_;  // by scope
    std::vector<std::uint32_t> around_;
};

/// Leaves out some instances besides what another filter does.
class HidingFilter final : public RayFilter {
  public:
    HidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other)
        : hidden_(std::move(hidden)), other_(std::move(other)) {}
    bool concerns(std::uint32_t slot) const override { return isHidden(slot) || (other_ && other_->concerns(slot)); }
    bool leavesOut(std::uint32_t slot, const Vec3f& at) const override {
        return isHidden(slot) || (other_ && other_->leavesOut(slot, at));
    }

  private:
    bool isHidden(std::uint32_t slot) const { return slot < hidden_.size() && hidden_[slot]; }
    std::vector<bool> hidden_;
    std::shared_ptr<const RayFilter> other_;
};

}  // namespace

std::shared_ptr<const RayFilter> clipFilter(const LightState& state, const RayView& world) {
    return ClipFilter::of(state, world);
}

std::shared_ptr<const RayFilter> hidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other) {
    return std::make_shared<const HidingFilter>(std::move(hidden), std::move(other));
}

}  // namespace rtsg::trace
