// Imager: everything a running scene needs to be pictured, wired up: flattener, ray world, light tracer, on one bus.
//
// Invariant: a picture shows the scene's current state, however it got there: loaded, run, mirrored or replayed.
// Threading: the scene's thread; a picture itself is made by several.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <rtsg/core/bus.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

struct ImageOptions {
    RenderSettings settings;
    std::string viewpoint;  // DEF name or description; empty: the bound one
};

class Imager {
  public:
    struct Options {
        Resources resources;  // what urls of textures may open, and where relative ones start
        RayWorld::Options world;
        MeshSource meshes;  // none: tessellate()
    };

    /// Attaches to the scene's bus; the scene must outlive this.
    explicit Imager(Scene& scene);
    Imager(Scene& scene, Options options);
    ~Imager();

    /// Errors: an unknown viewpoint, an impossible size, an integrator that is not built in.
    Result<Picture> picture(const ImageOptions& options, RenderStats* stats = nullptr);

    /// What acoustic tracers, picking and others attach to.
    FlattenedScene& flattened();
    const RayWorld& world() const;
    const LightTracer& tracer() const;
    /// Of meshes, ray world and materials, since the start.
    Diagnostics diagnostics() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// One picture of the scene at `time`, which is run up to it first.
Result<Picture> render(Scene& scene, const ImageOptions& options, double time, Imager::Options imager = {},
                       Diagnostics* diagnostics = nullptr);

struct AnimationOptions {
    int frames = 1;
    double framesPerSecond = 25;
    double start = 0;  // scene time of the first frame, seconds
    /// Called after each frame with the number done; false stops.
    std::function<bool(int)> progress{};
    /// Called with every picture's counts.
    std::function<void(const RenderStats&)> stats{};
};
/// Runs the scene and writes its pictures: a GIF that moves, or one file a frame where the name holds a place for its
/// number such as %04d. A single frame needs neither. Errors: as picture() and writePicture(); several frames without a
/// place for the number.
Result<> renderToFile(Scene& scene, Imager& imager, const std::filesystem::path& file, const ImageOptions& options,
                      const AnimationOptions& animation = {}, const ToneMap& toneMap = {});

/// Puts `number` in place of the one `%d` or `%0Nd`; nothing if the name has none or another conversion.
std::optional<std::string> numberedName(const std::string& pattern, int number);

}  // namespace rtsg
