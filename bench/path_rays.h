// PathRays: the rays that paths send through a room with lamps under its ceiling, in the order in which they send them,
// to be traced by Embree alone.
//
// Threading: values.
#pragma once

#include <random>
#include <vector>

#include <rtsg/renderers/ray_world.h>

#include "bare_embree.h"

namespace rtsg::bench {

/// How many rays of each kind.
struct PathRayCounts {
    double fromEye = 0, bounced = 0, toLamps = 0;
};

class PathRays {
  public:
    struct Eye {
        Vec3f position{0};  // looking along -z
        float fieldOfView = 1;
    };
    /// Rectangles across y, looking down: their middles, and half a side.
    struct Lamps {
        std::vector<Vec3f> middles;
        float half = 0;
    };
    /// `samples` of a square picture's pixels. Paths go on as often as needed for `counts`' shares.
    PathRays(const RayWorld& world, const Eye& eye, const Lamps& lamps, int side, int samples,
             const PathRayCounts& counts);

    /// The least CPU seconds that Embree alone takes for so many: of each kind the quickest of single rays and packets,
    /// with and without its flag for robustness.
    double minSeconds(const RayWorld& world, const PathRayCounts& counts) const;

  private:
    struct Segment {
        Vec3f origin, direction;
    };
    void follow(const RayWorld& world, const Lamps& lamps, RayPacket16& rays, double goesOn,
                std::vector<Segment>& next);

    std::mt19937 random_{5};
    std::vector<AskedPacket> fromEye_, bounced_, toLamps_;
};

}  // namespace rtsg::bench
