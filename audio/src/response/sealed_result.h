// Explains a silent result if no path leads from the source to the listener. Threading: pure functions.
#pragma once

#include <optional>

#include <rtsg/audio/trace_result.h>

#include "geometry/world_geometry.h"

namespace rtsg {

/// The reason why nothing arrived; none if something did, or might. Sound that came through a proven seal, by rounding
/// in a corner of it, is removed. Nothing is checked where sound comes directly, by a mirror or round an edge.
inline std::optional<Seal> sealOf(TraceResult& result, const OpenedGeometry& room, const glm::dvec3& source,
                                  const glm::dvec3& listener) {
    if (!result.arrivals.empty() || !result.edges.waves.empty()) return std::nullopt;
    std::optional<Seal> seal = room.sealBetween(source, listener);
    if (seal && seal->proven)
        for (EnergyHistogram& batch : result.batches) batch.bins.clear();
    if (seal && !result.silent()) seal.reset();
    return seal;
}

}  // namespace rtsg
