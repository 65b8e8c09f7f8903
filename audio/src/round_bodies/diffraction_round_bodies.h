// Sound round cylinders and spheres, which many edges in a row stand for: what they add to direct sound, and what comes
// behind them, where there is none.
//
// By two sides of a body at most: the way by one goes over into direct sound and what its surface mirrors; the
// mirror images in its facets, which stand for the same, are taken away. Where a cylinder ends in the air so do its
// waves, by Fresnel's integral. Where a second body hides the first one from the listener sound goes round both: the
// product of what each does. Field: diffraction_round_way.h. Threading: pure functions over const geometry.
#pragma once

#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

namespace rtsg {

/// `arrivals` by image sources alone, sorted by time, before and after; `field` empty before.
void addRoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field);

}  // namespace rtsg
