// Mirror images by round sides of many facets, as a cone's: of those by its facets the ones by the twelve that stand
// for them. What edges bend goes with these.
//
// Threading: pure functions.
#pragma once

#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

namespace rtsg {

/// Stands for those of a round side within `bulge` metres of it.
struct SideFacet {
    std::vector<glm::dvec3> corners;  // one after the other
    glm::dvec3 outward{0};            // unit
    double bulge = 0;
    std::uint32_t material = 0;
};

/// The facet that an edge of a round side has with the next one; none of other edges.
std::vector<SideFacet> facetsAt(const WallEdge& edge);

/// Among the images of first order, of ways up to `longest` metres. Nothing where source and listener are not both
/// outside of the side.
void replaceSideImages(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                       const TraceOptions& options, double longest, const std::vector<SideFacet>& facets,
                       std::vector<Arrival>& arrivals);

}  // namespace rtsg
