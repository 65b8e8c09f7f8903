// LightTracer: pictures of a scene by rays, through the RayWorld it shares with sound and picking.
//
// Invariant: after apply() its tables (materials, lights, viewpoints, sky, fog) are those that reading the scene anew
// would give; the work follows the delta, and a transform never touches a material. A picture depends on the scene, the
// camera and the settings alone, not on the number of threads.
// Threading: apply() and latest() on the scene's thread; in between, render() and camera() from any; those of a
// LightState at any time. The rays must be of the same change set; an instance that they alone know shows unlit white.
// Source: ISO/IEC 19775-1 V4.0 17.2.2 (lighting), 23.2 (bindable viewpoints), 24.2 (backgrounds, fog); Whitted 1980.
// Differs from 17.2.2 in that light from behind a surface gives no specular term, and in what Material's header says.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/material.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/renderers/ray_world.h>
#include <rtsg/renderers/render_settings.h>

namespace rtsg {

/// A version of the data that light needs besides rays: materials, lights, sky, fog, viewpoints. It never changes, and
/// needs neither scene nor tracer.
struct LightState;

class SharedWorld;
class Picker;
struct Pick;

/// A layer of a LayerSet (clause 35) in a picture: the eye that it is seen by and the rectangle that it is seen in, in
/// pixels from the left and the top.
struct LayerView {
    Camera camera;
    int left = 0, top = 0, width = 0, height = 0;
};

class LightTracer final : public InstanceSubscriber {
  public:
    /// `resources`: what urls of textures may open.
    explicit LightTracer(Resources resources = {});
    /// Makes a tracer that shares textures with others of this world that have the same resources.
    LightTracer(SharedWorld& world, const Resources& resources);
    ~LightTracer() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// The state after the last apply(); the same object until something changes that it holds.
    std::shared_ptr<const LightState> latest();
    std::shared_ptr<const void> freeze() override;

    /// The bound viewpoint, else the first; without any, all of `world` seen along -z. `name`: the DEF name or the
    /// description of a viewpoint instead. Error: no viewpoint has that name.
    Result<Camera> camera(const RayView& world, double aspect, std::string_view name = {}) const;
    static Result<Camera> camera(const LightState& state, const RayView& world, double aspect,
                                 std::string_view name = {});

    /// The layers of a picture of this size through `camera`, from the back to the front; without a LayerSet there is
    /// one that shows everything. Layers that show nothing are left out.
    std::vector<LayerView> layers(const RayView& world, const Camera& camera, int width, int height) const;
    static std::vector<LayerView> layers(const LightState& state, const RayView& world, const Camera& camera, int width,
                                         int height);

    /// The data of such a picture that the world needs to size things in pixels, for SharedWorld::setViewer().
    static std::vector<LayerSight> sights(const std::vector<LayerView>& views, int width, int height);

    /// Finds the first surface at a place of such a picture, in pixels from the left and the top, in the frontmost
    /// layer that has one there. Errors: those of Picker::ray().
    static Result<Pick> pick(const Picker& picker, const std::vector<LayerView>& views, double x, double y);
    /// Finds what is seen there. It passes through what ClipPlanes and Viewports cut off, backs of solids, and what
    /// hatches, masks and alpha leave clear; but it meets surfaces that only a Material's `transparency` hides. `world`
    /// is the picker's.
    Result<Pick> pick(const Picker& picker, const RayView& world, const std::vector<LayerView>& views, double x,
                      double y) const;

    /// Errors: a size or a number of samples that is not positive or is absurd; an error to reach that is negative or
    /// no number; paths in the display's space; a shutter with one sample a pixel, or outside of 0 to 1.
    Result<Picture> render(const RayView& world, const Camera& camera, const RenderSettings& settings = {},
                           RenderStats* stats = nullptr) const;
    static Result<Picture> render(const LightState& state, const RayView& world, const Camera& camera,
                                  const RenderSettings& settings = {}, RenderStats* stats = nullptr);

    using Counts = LightCounts;
    Counts counts() const;
    const Diagnostics& diagnostics() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
