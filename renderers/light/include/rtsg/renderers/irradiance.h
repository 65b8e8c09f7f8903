// Irradiance: measures by paths how much light falls on a place, with an interval; for people who light rooms.
//
// Units: those of X3D's colours in linear light (docs/color.md), times steradian. A hemisphere of radiance 1 gives pi,
// and so does a light of intensity 1 head-on; so E = pi L F with the form factor F. The headlight belongs to the viewer
// and does not count; of the lights, those of the whole scene do. Fog is not included. Threading: re-entrant; it uses
// several threads. Source: Kajiya 1986; intervals by independent groups of samples; Van Oosterom & Strackee 1983 (solid
// angles).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <rtsg/renderers/light_tracer.h>

namespace rtsg {

struct IrradianceSettings {
    double error = 0.01;                 // the target: half the interval divided by the value
    std::uint64_t samples = 1ull << 26;  // the largest number; they double from 8192 on
    std::uint64_t seed = 1;
    Shadows shadows = Shadows::automatic;
    /// The TessellationOptions::chordError of curved geometry. The intervals include the light that curved lamps lose
    /// by tessellation. 0: lamps are taken as the triangles that they consist of.
    double chordError = 0;
    unsigned threads = 0;  // 0: one a core
    /// Called from time to time by the calling thread, with the number of samples; false ends the measurement.
    std::function<bool(std::uint64_t)> progress;
};

struct Irradiance {
    Vec3d value{0}, interval{0};                // red, green, blue; half the 95 % interval
    double luminous = 0, luminousInterval = 0;  // weighted for the eye (Y of Rec. 709)
    /// The part of luminousInterval for the light that curved lamps may lose by tessellation, and for rounding.
    double luminousCut = 0;
    std::uint64_t samples = 0;
    /// The share of light paths that were cut off after 10,000 bounces: so much of white light is missing, and the
    /// interval does not include it.
    double missing = 0;
    /// RenderStats::hiddenLight. The intervals hold a bound for such light until enough samples have met it.
    double hiddenLight = 0;
    /// The same share of the light of PointLights and SpotLights: how such surfaces gather or throw it on is left out.
    double lostLight = 0;
    /// Whether `luminous` has reached the error. Darkness counts as reached only where nothing shines, or where nothing
    /// that faces the place sends any light on.
    bool reached = false;
};

/// The lights that are on but do not count: those that shine in their group only (`global` FALSE) and those of layers;
/// ordered by node number.
std::vector<NodeId> lightsLeftOut(const LightState& state);

/// Measures on a small white surface at `place` that faces `normal` (world space, any length). The place is shifted
/// along the normal by the rounding error of floats there (some 2^-22 of its coordinates), so that a place on a wall is
/// on the wall's front. The result is the same for any number of threads. Errors: a normal without length, numbers that
/// are not finite, an error that is not positive.
Result<Irradiance> measureIrradiance(const LightState& state, const RayView& world, const Vec3d& position,
                                     const Vec3d& normal, const IrradianceSettings& settings = {});

}  // namespace rtsg
