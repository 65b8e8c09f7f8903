// NearWalls: the sound that walls within centimetres of a listener scatter to it, computed from arrivals.
//
// From a wall right beside a listener half of what it scatters there comes from a spot so small that hardly a ray meets
// it. But what arrives at the listener lights that spot as well: of an arrival of energy e from the direction w, a wall
// of normal n scatters e max(0, n . w) times its share, alike in all directions (Lambert). So rays that meet the spot
// are not looked at, and every arrival is heard once more, from the wall. In the limit of a listener on the wall this
// is exact; over a spot of radius r it leaves out how what arrives changes over it, a share of some (r / distance of
// what sends it)^2 at most. Walls that meet there light each other and are seen in each other: the sum over all ways
// between them, by their form factors at the listener, mirrors on the way included. Source: radiosity, Cohen & Wallace
// 1993, chapter 4. Threading: const once made.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

#include "response/band_classes.h"

namespace rtsg::trace {

class NearWalls {
  public:
    /// No such walls.
    NearWalls() = default;
    /// `listener`: off the walls that it touches.
    NearWalls(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& source,
              const glm::dvec3& listener);

    /// The distance, m, up to which sound that walls scatter is counted here, by way of mirrors too; 0 where there are
    /// no such walls.
    double reach() const { return reach_; }
    /// The echoes of an arrival from the unit direction `from`, which points to where it comes from. `visit` gets for
    /// each the metres by which it is later, and shares of its energy by class of bands.
    template <class Visit>
    void echo(const glm::dvec3& from, const Visit& visit) const {
        for (const Wall& wall : walls_) {
            const double across = glm::dot(wall.normal, from);
            if (!(across > 0)) continue;
            Bands fractions{};
            for (std::size_t c = 0; c < classes_; ++c) fractions[c] = wall.back[c] * across;
            visit(std::max(0.0, wall.pathLength - glm::dot(wall.directionTo, from)), fractions);
        }
    }

  private:
    /// A direction in which a wall is seen, and what mirrors on the way there leave, by class.
    struct View {
        glm::dvec3 direction;
        Bands left;
    };
    struct Wall {
        glm::dvec3 normal{0};  // towards where it is seen from
        std::uint32_t material = 0;
        std::vector<View> views;    // until `back` is known
        double pathLength = 0;      // m to it, the mean over these
        glm::dvec3 directionTo{0};  // to its middle, m
        Bands back{};               // by class, of what lights it straight on
    };

    void look(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& listener);
    void follow(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& listener,
                const glm::dvec3& direction, AcousticHit hit);
    void lightEachOther(const AcousticGeometry& geometry, const BandClasses& classes);

    double reach_ = 0;
    std::size_t classes_ = 0;
    std::vector<Wall> walls_;
};

/// All that comes of what arrives by exact paths; by band, air included.
EnergyHistogram echoOf(const NearWalls& walls, const BandClasses& classes, std::span<const Arrival> arrivals,
                       const EnergyHistogram& like, double speedOfSound);

}  // namespace rtsg::trace
