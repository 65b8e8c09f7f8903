// Diffraction by cylinders and spheres, which rows of many edges represent: the change of direct sound, and the sound
// in the shadow behind them.
//
// Sound goes by at most two sides of a body. The path by one side turns continuously into direct sound and its
// reflection by the surface; the mirror images in the facets, which represent the same reflection, are removed. Where a
// cylinder ends in the air, its waves end by Fresnel's integral. If a second body hides the first one from the
// listener, sound goes round both: the product of their effects. Field: diffraction_detour.h. Threading: pure
// functions over const geometry.
#pragma once

#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

namespace rtsg {

/// `arrivals` by image sources alone, sorted by time, before and after; `field` empty before.
void addRoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field);

}  // namespace rtsg
