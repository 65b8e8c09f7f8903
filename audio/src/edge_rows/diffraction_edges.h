// Diffraction: the waves that edges add to the image sources of a room, and the changes of image sources near shadows.
//
// Each part of the field with a boundary (direct sound, a mirror image of first order) continues beyond the boundary
// through the edge that causes it. The pressure is the sum of the image sources and of the waves of all edges, with
// their phases; for levels in octaves see wave_levels.h. Edges are rigid, apart from the absorption of the surface. Two
// edges in a row: diffraction_pairs.h. Source: see diffraction_wedge.h. Threading: pure functions over const geometry.
#pragma once

#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

#include "diffraction_pairs.h"
#include "response/wave_levels.h"

namespace rtsg {

/// Both positions are off walls. Adds waves to `field`. Paths longer than `seconds` do not count. Of `arrivals` (direct
/// and specular), those that small bodies reflect are weakened. `parts`: waves that continue into mirror images.
EdgePairCount addDiffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                             const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals,
                             EdgeField& field, BentParts& parts);

}  // namespace rtsg
