// Filters for shapes that rays ignore: things behind ClipPlanes, in other layers, and around a cube that is drawn; and,
// for rays towards a light, shapes that this light does not illuminate.
//
// Threading: the filters are const.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "light_tables.h"
#include "lighting/trace_scene.h"

namespace rtsg::trace {

/// Calls `take` with each ClipPlane and Viewport, and with the planes that it cuts by. `eye`: as for clipFilter().
void eachCut(const LightState& state, const Camera* eye,
             const std::function<void(const ClipEntry&, const std::vector<CutPlane>&)>& take);

/// Leaves out what ClipPlanes and Viewports cut off; null if they cut nothing. `eye` is the picture's; null if the
/// picture's edges do not matter.
std::shared_ptr<const RayFilter> clipFilter(const LightState& state, const RayView& world,
                                            const RenderSettings& settings, const Camera* eye);

/// The slots that `hidden` says besides what another filter leaves out, which may be null.
std::shared_ptr<const RayFilter> hidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other,
                                              const RayView& world, const RenderSettings& settings);

/// Leaves out the instances that are not in a scope.
class ScopeFilter : public RayFilter {
  public:
    virtual bool isOutside(std::uint32_t slot) const = 0;
};
/// A filter for each of `scopes` (numbers of LightState), which also leaves out what `other` does, if that is not null.
/// A filter is null if no instance that casts shadows is outside its scope. Looks at every instance once.
std::vector<std::shared_ptr<const ScopeFilter>> scopeFilters(std::span<const std::uint32_t> scopes,
                                                             const std::shared_ptr<const RayFilter>& other,
                                                             const LightState& state, const RayView& world,
                                                             const RenderSettings& settings);

/// The view in which rays towards a light are traced. The scene must outlive it.
class ViewOfLight {
  public:
    ViewOfLight(const TraceScene& scene, const TraceLight& light) : view_(scene.world) {
        if (light.scope) view_ = &own_.emplace(*scene.lensed, light.scope);
    }
    ViewOfLight(const ViewOfLight&) = delete;
    ViewOfLight& operator=(const ViewOfLight&) = delete;
    const RayView& operator*() const { return *view_; }

  private:
    std::optional<LensedView> own_;
    const RayView* view_;
};

}  // namespace rtsg::trace
