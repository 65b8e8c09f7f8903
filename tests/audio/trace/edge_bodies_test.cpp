// Round boxes that stand free: levels beside boundary elements, and across the planes of their faces.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "rigid_body.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

Walled boxed(const glm::dvec3& low, const glm::dvec3& high) {
    std::vector<glm::dvec3> corners;
    for (int i = 0; i < 8; ++i)
        corners.emplace_back(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
    return {corners, {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                      2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5}};
}

/// A box, and listeners on a line through the plane of one of its faces.
struct Passing {
    glm::dvec3 low, high, source, from, to;
};
const Passing kPassings[] = {
    {{-1, -1, -1}, {1, 1, 1}, {-4, .3, .2}, {2.5, .8, .35}, {2.5, 1.2, .35}},
    {{-1, -1, -1}, {1, 1, 1}, {-4, .3, .2}, {2.5, .8, 1.6}, {2.5, 1.2, 1.6}},
    {{-1, -1, -1}, {1, 1, 1}, {-4, .3, .2}, {-1.2, .4, 2.5}, {-.8, .4, 2.5}},
    {{-1, -.3, -1.5}, {1, .3, 1.5}, {-2, 1.2, .2}, {2.5, -.5, .3}, {2.5, -.1, .3}},
    {{-1, -.3, -1.5}, {1, .3, 1.5}, {-.2, 1.6, .2}, {.1, -1.5, 1.3}, {.1, -1.5, 1.7}},
    {{-.2, -.2, -.2}, {.2, .2, .2}, {-2, .1, .05}, {1.2, .16, .1}, {1.2, .24, .1}},
    {{-.2, -.2, -.2}, {.2, .2, .2}, {-1.5, 1, .05}, {.16, -1, .1}, {.24, -1, .1}},
};

TEST(EdgeBodies, RoundABoxLevelsAreThoseOfTheIntegralOverItsSurface) {
    double sum = 0, worst = 0, step = 0;
    int count = 0;
    for (const Passing& one : kPassings) {
        const Walled wall = boxed(one.low, one.high);
        RigidBox box(one.low, one.high, 8);
        for (const double hz : {62.5, 125.0, 250.0}) {
            box.light(one.source, 2 * M_PI * hz / 343);
            double before = 0;
            for (const double part : {0.0, .48, .52, 1.0}) {
                const glm::dvec3 listener = one.from + part * (one.to - one.from);
                const double off = heardAt(wall.traced(one.source, listener), hz, glm::distance(one.source, listener)) -
                                   box.level(listener);
                sum += off * off;
                worst = std::max(worst, std::abs(off));
                if (part == .52) step = std::max(step, std::abs(off - before));
                before = off;
                ++count;
            }
        }
    }
    // Behind a box of 40 cm it was 20 dB too dark at 63 Hz, and 19 dB the step at its top's height.
    // In the plane of a face, beyond its corners, a step is left: sound goes round two edges, not round a third.
    EXPECT_LT(std::sqrt(sum / count), 1.7);
    EXPECT_LT(worst, 6.4);
    EXPECT_LT(step, 4.8);
}

}  // namespace
}  // namespace rtsg
