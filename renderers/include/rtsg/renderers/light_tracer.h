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

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/material.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

/// Which lights cast shadows: those whose `shadows` field says so; all but the headlight, whatever the fields say;
/// none; or (automatic) as the fields say if that of any light says TRUE, and else all: authors seldom set the field.
enum class Shadows : std::uint8_t { authored, all, none, automatic };

/// Whitted: lights, mirrors and glass, X3D's ambient terms for the rest. Path: unbiased, light between surfaces and
/// from the sky included, ambient terms left out; colours that would send on more light than they get are smaller
/// (bsdf.h): highlights beside bright diffuse colours, PhysicalMaterial's white at grazing views. Raster: not of this
/// tracer.
enum class Integrator : std::uint8_t { whitted, path, raster };

/// Bits of RenderSettings::layers: what a picture tells of its pixels besides their colours, in Picture::layers. It is
/// of the first surface that lets less than half of what is behind it through, or bends it; where there is none, Z is
/// infinite and all else 0. depth, position, normal, node and motion are those of the pixel's middle, the others a mean
/// over samples; all are of the picture's own instant, whatever its shutter.
enum DataLayer : std::uint32_t {
    kDepth = 1,       // "Z": metres along the view, of panoramas from the eye
    kPosition = 2,    // "P.X", "P.Y", "P.Z": world, metres
    kNormal = 4,      // "N.X" ...: as it is shaded, in world space, on the eye's side
    kAlbedo = 8,      // "albedo.R" ...: diffuseColor, baseColor, or what an unlit one shows; with textures, as light
    kNode = 16,       // "node.id": NodeId of the Shape, an integer
    kObjects = 32,    // "CryptoObject00.R" ...: Cryptomatte 1.2 of RenderSettings::nameOf(shape)
    kMaterials = 64,  // "CryptoMaterial00.R" ...: of nameOf(appearance)
    /// "motion.X", "motion.Y": from a pixel's middle to where what it shows was in the picture before, in pixels to the
    /// right and up; 0 where that is not known. Of what is infinitely far, by the eye's turning.
    kMotion = 128
};
constexpr std::uint32_t kAllLayers = 255;

/// What a relative error is relative to, besides a pixel's value: darker differences are not seen.
constexpr float kErrorFloor = 0.01f;

/// What things have moved from since: the world and the eye of the picture before.
struct PictureBefore {
    std::shared_ptr<const WorldVersion> world;  // of the same RayWorld
    Camera camera;
};

struct RenderSettings {
    Integrator integrator = Integrator::whitted;
    int width = 1280, height = 720;
    int samplesPerPixel = 1;  // 1: through the pixels' centres; more: a scrambled (0,2)-sequence
    /// If above 0, tiles of 16 x 16 pixels are sampled until their relative standard error (RenderStats::error) is at
    /// most this, and that of no block of 4 x 4 more than a tenth above it, with at most samplesPerPixel samples a
    /// pixel; Picture::interval tells how well each pixel is known.
    float error = 0;
    std::uint64_t seed = 1;      // of the scrambling
    float cutoff = 1 / 1024.0f;  // of whitted: rays that could add less than this share (1e-6 at least) are left out
    int maxDepth = 250;          // of whitted: mirrorings and refractions on one way, should its weight not run out
    Shadows shadows = Shadows::automatic;
    /// In which space light is computed (docs/color.md). The picture is of the display's space, or linear if that is
    /// asked for. Paths compute in linear light always: automatic means that, display is an error.
    ColorSpace colorSpace = ColorSpace::automatic;
    /// Whether closed bodies that ClipPlanes cut (11.4.1) are filled there, in their material's own colours; else one
    /// looks into them.
    bool caps = false;
    unsigned threads = 0;      // 0: one a core
    std::uint32_t layers = 0;  // DataLayers
    /// The share, up to 1, of the time since the picture before in which the shutter was open; it closes at this one's
    /// instant. What has moved (instances, each as a rigid or evenly stretched thing, and the eye) is blurred along its
    /// way; lights, lines, points, volumes and what deforms stay where they are in the end. Needs several samples.
    float shutter = 0;
    /// Of `shutter` and kMotion; null: nothing has moved. LightRenderer knows its own.
    std::shared_ptr<const PictureBefore> before;
    /// Of kObjects and kMaterials: asked before the rays are traced, by the thread that asks for the picture. Empty, or
    /// what returns an empty name: the node's number. LightRenderer takes DEF names where it is on the scene's thread.
    std::function<std::string(NodeId)> nameOf;
    /// Called now and then, from any thread but never from two at once, with the share done; false cancels.
    std::function<bool(double)> progress;
};

struct RenderStats {
    std::uint64_t primaryRays = 0, shadowRays = 0, secondaryRays = 0;
    double seconds = 0;
    /// The share of the picture's, and the largest share of a pixel's, lines of sight that was cut off by
    /// RenderSettings::maxDepth (whitted) or 10,000 bounces (path) before its weight had run out: how much darker than
    /// it is something may show.
    double missing = 0, missingMost = 0;
    /// Of RenderSettings::error: the relative standard error that was reached, root mean square over the pixels: each
    /// pixel's is that of its brightest channel over (value + kErrorFloor). The share of pixels in blocks that ran out
    /// of samples, and how many samples a pixel got on average.
    double error = 0, unreached = 0, samples = 0;
    /// The share of pixels that were taken from the picture before (LightRenderer), as nothing of what they show can
    /// have changed. Rays are those that were traced; all else is told of the whole picture.
    double kept = 0;
    bool cancelled = false;
};

/// A version of what light must know of a scene besides its rays: materials, lights, sky, fog, viewpoints. It never
/// changes, and needs neither scene nor tracer.
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
    /// One that shares its textures with others of this world that have the same resources.
    LightTracer(SharedWorld& world, const Resources& resources);
    ~LightTracer() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// As of the last apply(); the same one until something changes that it holds.
    std::shared_ptr<const LightState> latest();
    std::shared_ptr<const void> freeze() override;

    /// The bound viewpoint, else the first; without any, all of `world` seen along -z. `name`: the DEF name or the
    /// description of a viewpoint instead. Error: no viewpoint has that name.
    Result<Camera> camera(const RayView& world, double aspect, std::string_view name = {}) const;
    static Result<Camera> camera(const LightState& state, const RayView& world, double aspect,
                                 std::string_view name = {});

    /// What a picture of this size through `camera` shows, from the back to the front; without a LayerSet one that is
    /// all of it. Layers that show nothing are left out.
    std::vector<LayerView> layers(const RayView& world, const Camera& camera, int width, int height) const;
    static std::vector<LayerView> layers(const LightState& state, const RayView& world, const Camera& camera, int width,
                                         int height);

    /// What the world must know of such a picture for what has its size from pixels: SharedWorld::setViewer().
    static std::vector<LayerSight> sights(const std::vector<LayerView>& views, int width, int height);

    /// What is met at a place of such a picture, in pixels from the left and the top: the first surface of the
    /// frontmost layer that has one there. Error: as Picker::ray().
    static Result<Pick> pick(const Picker& picker, const std::vector<LayerView>& views, double x, double y);
    /// What is seen there: without what ClipPlanes and Viewports cut off, backs of solids, and what hatches, masks and
    /// alpha leave clear; but with what a Material's `transparency` hides. `world`: the picker's.
    Result<Pick> pick(const Picker& picker, const RayView& world, const std::vector<LayerView>& views, double x,
                      double y) const;

    /// Errors: a size or a number of samples that is not positive or is absurd; an error to reach that is negative or
    /// no number; paths in the display's space; a shutter with one sample a pixel, or outside of 0 to 1.
    Result<Picture> render(const RayView& world, const Camera& camera, const RenderSettings& settings = {},
                           RenderStats* stats = nullptr) const;
    static Result<Picture> render(const LightState& state, const RayView& world, const Camera& camera,
                                  const RenderSettings& settings = {}, RenderStats* stats = nullptr);

    /// How many materials, lights and textures have been read since the start; for tests of the invariant.
    struct Counts {
        std::uint64_t materialsRead = 0, lightsRead = 0;
        std::size_t materials = 0, lights = 0;
    };
    Counts counts() const;
    const Diagnostics& diagnostics() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
