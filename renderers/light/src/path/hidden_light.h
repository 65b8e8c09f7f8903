// HiddenLight: the light that paths find by chance alone, since clear or mirroring surfaces are between.
//
// Shining surfaces, lamps and the sky are sampled directly, but not through surfaces that bend light or by way of
// mirrors. What only bounces find may be missing in all samples; so its radiance bounds what they may lack. Rays from
// the shining surfaces tell whether such surfaces are the first that their light meets. Threading: values.
#pragma once

#include <limits>

#include "lighting/trace_scene.h"

namespace rtsg::trace {

struct HiddenLight {
    bool any = false;     // whether the scene has any light
    float brightest = 0;  // the largest radiance of anything, or intensity of a light
    /// The largest radiance that may arrive where nothing but bounces finds it; 0: none.
    float maximum = 0;
    /// What meets clear or mirroring surfaces first of the light of shining surfaces, and of PointLights and
    /// SpotLights: no path finds how such surfaces gather or throw on the latter.
    double fraction = 0, lost = 0;

    /// TraceScene::countsFrom: the brightest of it counts, as only that bounds what is missing.
    float countsFrom() const { return maximum > 0 ? maximum / 4 : std::numeric_limits<float>::infinity(); }
};

/// From so many finds on, their spread tells what they are worth.
constexpr std::uint64_t kEnoughFinds = 30;

/// Precondition: lookForLight().
HiddenLight findHiddenLight(const TraceScene& scene);

}  // namespace rtsg::trace
