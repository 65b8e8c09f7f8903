// The round bodies near a path, and whether paths beside them are free.
//
// The effect of round bodies on pressure already describes what they hide, so their facets hide nothing here.
// Threading: const once made.
#pragma once

#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "diffraction_placed_body.h"
#include "diffraction_round_side.h"

namespace rtsg {

class RoundAir {
  public:
    RoundAir(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener);

    /// The bodies nearest to the direct path, the nearest first, each once.
    const std::vector<PlacedBody>& bodies() const { return bodies_; }

    /// Whether no surface but those of round bodies lies between two places, of which one may be on such a body.
    bool isClear(const glm::dvec3& from, const glm::dvec3& to) const;
    /// The whole way by one side from place to place, `offset` m along the axis from where it is shortest.
    bool isFree(const RoundSide& side, const glm::dvec3& from, const glm::dvec3& to, double offset = 0) const;
    /// Whether the body ends in the air: nothing goes on beside its surface.
    bool isEnd(const RoundSide& side, std::size_t end) const;

  private:
    bool isOnBody(const glm::dvec3& position) const;
    bool isFreeAlong(const RoundSide& side, double offset) const;

    const AcousticGeometry& geometry_;
    std::vector<PlacedBody> bodies_;
};

}  // namespace rtsg
