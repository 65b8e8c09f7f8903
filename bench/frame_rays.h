// FrameRays: the rays of a picture by `whitted`, made from bare hits, for tracing by Embree alone.
//
// The eye's rays are the picture's own. From all their hits, rays go to the lamps and in the mirror direction, whether
// the material mirrors or not. The measured cost of one ray of each kind, times the picture's number of such rays, is a
// lower bound of the time that Embree takes for the picture, since rays behind mirrors are less coherent.
// Threading: values.
#pragma once

#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/ray_world.h>

#include "bare_embree.h"

namespace rtsg::bench {

struct FrameLamp {
    Vec3f position{0};  // world; of a DirectionalLight the direction to it
    bool far = false;
};
/// The lamps of a scene whose lights stand below no Transform.
std::vector<FrameLamp> lampsOf(const Scene& scene);

class FrameRays {
  public:
    FrameRays(const RayWorld& world, const Camera& camera, int width, int height, const std::vector<FrameLamp>& lamps);

    /// The least CPU seconds that Embree alone takes for as many rays of each kind as `counts` tells: of each kind the
    /// quickest of single rays and packets, with and without its flag for robustness, all in one flat scene.
    double minSeconds(const RayWorld& world, const RenderStats& counts) const;

  private:
    void follow(const RayWorld& world, const std::vector<FrameLamp>& lamps, RayPacket16& rays);

    std::vector<AskedPacket> fromEye_, mirrored_, toLamps_;
};

}  // namespace rtsg::bench
