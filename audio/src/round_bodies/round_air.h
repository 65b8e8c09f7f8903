// The round bodies about a way, and whether there is air on ways beside them.
//
// Whether a round body hides one place from another is told by its circle, not by its facets: so what goes by it and
// what it hides change over at one place. Threading: const once made.
#pragma once

#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "placed_body.h"
#include "round_side.h"

namespace rtsg {

class RoundAir {
  public:
    RoundAir(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener);

    const AcousticGeometry& geometry() const { return geometry_; }
    /// Those nearest to the straight way, the nearest first, each once.
    const std::vector<PlacedBody>& bodies() const { return bodies_; }

    /// Whether nothing lies between two places, of which one may be on a body that does not count.
    bool isClear(const glm::dvec3& from, const glm::dvec3& to, const RoundBody* one,
                 const RoundBody* other = nullptr) const;
    /// The same, of all but round bodies.
    bool isClearButBodies(const glm::dvec3& from, const glm::dvec3& to) const;
    /// The same along the surface, moved along the axis.
    bool isFreeAlong(const RoundSide& side, double offset = 0) const;
    /// The whole way by one side from place to place.
    bool isFree(const RoundSide& side, const glm::dvec3& from, const glm::dvec3& to, double offset = 0) const;
    /// Whether the body ends in the air: nothing goes on beside its surface.
    bool isEnd(const RoundSide& side, std::size_t end) const;

  private:
    const RoundBody* bodyAt(const glm::dvec3& place) const;
    bool hides(const RoundBody& body, const glm::dvec3& from, const glm::dvec3& to, bool& round) const;
    template <class Passes>
    bool passesFacets(const glm::dvec3& from, const glm::dvec3& to, const Passes& passes) const;

    const AcousticGeometry& geometry_;
    std::vector<PlacedBody> bodies_;
};

bool isSameBody(const RoundBody& a, const RoundBody& b);

}  // namespace rtsg
