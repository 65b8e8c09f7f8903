// Diffraction: what edges add to the image sources of a room, and take from them near their boundaries.
//
// Each part of the field that ends somewhere (direct sound, a mirror image of first order) goes on beyond its boundary
// by way of the edge that cuts it off. Pressure is the sum of what is there without edges and of the waves of all
// edges, with their phases; levels of octaves: wave_levels.h. Edges reflect as rigid ones, but for what the surface
// takes. Two edges in a row: diffraction_pairs.h. Source: see diffraction_wedge.h. Threading: pure functions over const
// geometry.
#pragma once

#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

#include "diffraction_pairs.h"
#include "response/wave_levels.h"

namespace rtsg {

/// Places off walls; adds waves to `field`. Paths beyond `seconds` do not count. Of `arrivals`, what comes straight or
/// mirrored, those that faces of small bodies mirror are
/// weakened. `parts`: what goes on into mirror images.
EdgePairCount addDiffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                             const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals,
                             EdgeField& field, BentParts& parts);

}  // namespace rtsg
