// Shutter: the world and the eye of a picture at the instants at which its samples are taken.
//
// Each sample of a tile belongs to one of these instants as a whole: its rays, shadows and reflections meet the world
// of that instant. So integrators need not know about it. The instants are spread evenly over the time in which the
// shutter is open, and a tile's samples evenly over the instants, with a start that differs from tile to tile. Lights,
// and the choice of the headlight, are those of the picture's own instant.
// Threading: const once made; the scene that it was made of must outlive it.
#pragma once

#include <memory>
#include <vector>

#include "trace_scene.h"
#include "world/moved_view.h"

namespace rtsg::trace {

class Shutter {
  public:
    /// `scene`: of the picture's own instant, as makeTraceScene() gives it. Precondition: settings.before.
    Shutter(const RayView& world, const Camera& camera, const RenderSettings& settings, const TraceScene& scene);

    /// Whether an instance is elsewhere at some of the instants.
    bool moves(std::uint32_t slot) const { return motions_.moves(slot); }
    /// Tells the scene of it, unless nothing moves.
    void openFor(TraceScene& scene) const;

    /// Does what traceTile() does.
    void trace(const TraceScene& scene, const RenderSettings& settings, int x0, int y0,
               std::span<TileResult> groups) const;

  private:
    struct Instant {
        std::unique_ptr<const MovedView> moved;  // null: nothing but the eye moves
        std::shared_ptr<const LensedView> world;
        Camera camera;
        void showTo(TraceScene& scene, int height) const;
    };
    static std::size_t countFor(const Motions& motions, const RenderSettings& settings);

    Motions motions_;
    std::vector<Instant> instants_;  // empty: nothing moves
};

}  // namespace rtsg::trace
