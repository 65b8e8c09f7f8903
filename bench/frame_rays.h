// FrameRays: the rays of a picture in Whitted's way, made from bare hits, to be traced by Embree alone.
//
// Those of the eye are the picture's own. From all that these meet go rays to the lamps and mirrored ones, whether the
// material mirrors or not: of each kind it is told what one costs at best, and a picture has so many of each. What lies
// behind mirrors is less even than what the eye sees, so this is rather less than Embree takes for the picture.
//
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
    Vec3f place{0};  // world; of a DirectionalLight the direction to it
    bool far = false;
};
/// Of a scene whose lights stand below no Transform.
std::vector<FrameLamp> lampsOf(const Scene& scene);

class FrameRays {
  public:
    FrameRays(const RayWorld& world, const Camera& camera, int width, int height, const std::vector<FrameLamp>& lamps);

    /// The least CPU seconds that Embree alone takes for as many rays of each kind as `counts` tells: of each kind the
    /// quickest of single rays and packets, with and without its flag for robustness, all in one flat scene.
    double leastSeconds(const RayWorld& world, const RenderStats& counts) const;

  private:
    void follow(const RayWorld& world, const std::vector<FrameLamp>& lamps, RayPacket16& rays);

    std::vector<AskedPacket> fromEye_, mirrored_, toLamps_;
};

}  // namespace rtsg::bench
