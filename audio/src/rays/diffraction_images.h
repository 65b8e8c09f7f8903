// Finds sound that is diffracted by bodies before or after its specular reflection at a wall. Each mirror image of
// first order is a source of its own, in a world that is repeated beyond its mirror.
//
// Threading: pure functions.
#pragma once

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

#include "response/wave_levels.h"

namespace rtsg {

/// A function that bends sound from one place to another, round one body and round bodies in a row. It changes
/// `arrivals`, those of direct sound and of images, and adds waves to `field`.
struct BentBy {
    EdgePairCount pairs;
    BentParts parts;  // waves that continue into images
};
BentBy addBending(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                  const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field);

/// Adds all images in walls with bodies near their paths, if each might bring a fiftieth of an octave's energy in
/// `result`. `known`: the effect of the mirrors' own edges on their images, which stay as they are if it is large.
void addBentImages(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                   const TraceOptions& options, const BentParts& known, TraceResult& result);

}  // namespace rtsg
