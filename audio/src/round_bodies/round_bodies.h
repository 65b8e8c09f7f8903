// Sound round cylinders and spheres, which many edges in a row stand for: what they add to direct sound, and what comes
// behind them, where there is none.
//
// By two sides of a body at most: the way by one goes over into direct sound and what its surface mirrors; the
// mirror images in its facets, which stand for the same, are taken away. Where a cylinder ends in the air so do its
// waves, by Fresnel's integral. Field: round_way.h; of two bodies, or of one and an edge: round_rows.h.
// Threading: over const geometry.
#pragma once

#include <memory>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/trace_result.h>

#include "edge_rows/edge_sources.h"

namespace rtsg {

class RoundBodies {
  public:
    /// `arrivals` by image sources alone, sorted by time, before and after; `field` empty before.
    RoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field);
    ~RoundBodies();

    /// What bodies bend, and two of them in a row; before edges.
    void addAlone();
    /// What a body and an edge in a row bend; after edges.
    void addRows(const EdgesSeen& edges);

  private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
