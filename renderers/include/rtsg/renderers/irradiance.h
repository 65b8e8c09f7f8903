// Irradiance: how much light falls on a place, measured by paths, with its interval; for people who light rooms.
//
// Units: what X3D's colours are once they are decoded (docs/color.md), times steradian: a surface that shows radiance 1
// everywhere above gives pi, as a light of intensity 1 head-on does, so E = pi L F with the form factor F.
// The headlight is the viewer's and does not count; of lights those of the whole scene do. Fog lies on what is seen.
// Threading: re-entrant; several threads measure. Source: Kajiya 1986; intervals by independent groups of samples; Van
// Oosterom & Strackee 1983 (solid angles).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <rtsg/renderers/light_tracer.h>

namespace rtsg {

struct IrradianceSettings {
    double error = 0.01;                 // half the interval over the value: what to reach
    std::uint64_t samples = 1ull << 26;  // at most; they double from 8192 on
    std::uint64_t seed = 1;
    Shadows shadows = Shadows::automatic;
    /// The TessellationOptions::chordError with which curved geometry was cut. The intervals include the light that
    /// curved lamps lack because they are cut. 0: lamps are taken to be the triangles that they were cut into.
    double chordError = 0;
    unsigned threads = 0;  // 0: one a core
    /// Called now and then by the thread that asks, with the number of samples; false ends the measurement.
    std::function<bool(std::uint64_t)> progress;
};

struct Irradiance {
    Vec3d value{0}, interval{0};                // red, green, blue; half the 95 % interval
    double luminous = 0, luminousInterval = 0;  // of all three as an eye weighs them (Rec. 709's Y)
    /// The part of luminousInterval that stands for the light which curved lamps may lack because they are cut, and for
    /// rounding.
    double luminousCut = 0;
    std::uint64_t samples = 0;
    /// The share of the ways that light may come which was cut off after 10,000 bounces: so much of white light is
    /// missing, and in no interval.
    double missing = 0;
    bool reached = false;  // the error, by `luminous`; nothing at all counts as reached
};

/// The lights that are on and do not count: those that shine in their group alone (`global` FALSE), which such a place
/// is not in, and those of layers. In order of their numbers.
std::vector<NodeId> lightsLeftOut(const LightState& state);

/// On a small white surface at `place` that faces `normal` (world space, any length), and as far before it as floats
/// are off there (some 2^-22 of its coordinates), so that a place on a wall is seen from the wall's front. The same for
/// any number of threads. Errors: a normal without length, numbers that are not finite, an error that is not positive.
Result<Irradiance> measureIrradiance(const LightState& state, const RayView& world, const Vec3d& place,
                                     const Vec3d& normal, const IrradianceSettings& settings = {});

}  // namespace rtsg
