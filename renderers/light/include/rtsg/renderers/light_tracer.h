// LightTracer: ray-traced pictures of a scene, with the RayWorld that sound and picking use too.
//
// Invariant: after apply() its tables (materials, lights, viewpoints, sky, fog) are the same as if read from the scene
// anew; the cost follows the delta, and a transform never causes a material to be read. A picture depends on the scene,
// the camera and the settings, not on the number of threads. Threading: apply() and latest() on the scene's thread; in
// between, render() and camera() on any thread; those with a LightState at any time. The rays must be of the same
// change set; an instance that is missing here is drawn unlit white. Source: ISO/IEC 19775-1 V4.0 17.2.2 (lighting),
// 23.2 (bindable viewpoints), 24.2 (backgrounds, fog); Whitted 1980. It differs from 17.2.2: light from behind a
// surface gives no specular term; see also Material's header.
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

/// A layer of a LayerSet (clause 35) in a picture: its eye, and its rectangle in pixels from the left and the top.
struct LayerView {
    Camera camera;
    int left = 0, top = 0, width = 0, height = 0;
};

class LightTracer final : public InstanceSubscriber {
  public:
    /// `resources` says what urls of textures may open.
    explicit LightTracer(Resources resources = {});
    /// Makes a tracer that shares textures with others of this world that have the same resources.
    LightTracer(SharedWorld& world, const Resources& resources);
    ~LightTracer() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// The state after the last apply(); the same object as before if nothing in it has changed.
    std::shared_ptr<const LightState> latest();
    std::shared_ptr<const void> freeze() override;

    /// The camera of the bound viewpoint, else of the first; if there is none, all of `world` seen along -z. `name`
    /// selects another viewpoint by DEF name or description. Error: no viewpoint has that name.
    Result<Camera> camera(const RayView& world, double aspect, std::string_view name = {}) const;
    static Result<Camera> camera(const LightState& state, const RayView& world, double aspect,
                                 std::string_view name = {});

    /// The layers of a picture of this size through `camera`, from back to front; without a LayerSet there is one that
    /// shows everything. Empty layers are left out.
    std::vector<LayerView> layers(const RayView& world, const Camera& camera, int width, int height) const;
    static std::vector<LayerView> layers(const LightState& state, const RayView& world, const Camera& camera, int width,
                                         int height);

    /// The data of such a picture that the world needs for sizes in pixels; see SharedWorld::setViewer().
    static std::vector<LayerSight> sights(const std::vector<LayerView>& views, int width, int height);

    /// Finds the first surface at a place of such a picture, in pixels from the left and the top, in the frontmost
    /// layer that has a surface there. Errors: those of Picker::ray().
    static Result<Pick> pick(const Picker& picker, const std::vector<LayerView>& views, double x, double y);
    /// Finds the surface that is visible there. It passes through parts that ClipPlanes and Viewports cut off, through
    /// backs of solids, and through clear parts of hatches, masks and alpha; but it meets surfaces that only a
    /// Material's `transparency` hides. `world` is the picker's.
    Result<Pick> pick(const Picker& picker, const RayView& world, const std::vector<LayerView>& views, double x,
                      double y) const;

    /// Errors: a size or number of samples that is not positive or too large; an error target that is negative or no
    /// number; paths in the display space; a shutter with one sample a pixel, or outside of 0 to 1.
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
