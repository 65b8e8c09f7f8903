// The scene of a picture for integrators, made from a version of the light tables.
//
// Threading: re-entrant.
#pragma once

#include <vector>

#include <rtsg/renderers/primary_sight.h>

#include "lighting/trace_scene.h"
#include "tables/light_tables.h"

namespace rtsg::trace {

/// The content of a picture, apart from its camera.
struct Part {
    Vec3d headlight{0, 0, -1};  // where it shines to; 0: there is none
    std::vector<bool> hidden;   // slots that are not there; empty: none
    bool over = false;          // something is seen where nothing is: no background of its own makes it clear
    bool windows = true;        // Viewports cut: the picture is not one that a scene draws for itself
    /// the surfaces that a rasteriser has found; null: none was used
    const PrimarySight* sight = nullptr;
};

/// The bound Fog of a layer, and the LocalFogs.
Fogs fogsOf(const LightState& state, std::uint16_t layer);

/// Reads `state` and `world`, which must outlive it.
TraceScene makeTraceScene(const LightState& state, const RayView& world, const Camera& camera,
                          const RenderSettings& settings, Part part);

}  // namespace rtsg::trace
