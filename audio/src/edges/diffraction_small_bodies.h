// Reduces the effect of bodies that are small compared with a wave length.
//
// The theory of edges holds for edges farther apart than a wave length. For a smaller body p = open + w (p of its edges
// and faces - open), w = 1 / (1 + 8 / (k^3 V) + 1.5 / (k^4 A^2)), where V is its volume and A the area of its section
// across its longest side: scattering by a small body grows as k^2 V, and by a thin rod as (k A^(1/2))^(3/2) k^(1/2).
// Thin plates displace as much air as plates whose thickness is .3 of their width. Fitted to the integral over the
// surfaces of rigid boxes of 1 : 1 : 1 to 1 : 10 : 120. Threading: one thread per object.
#pragma once

#include <array>
#include <map>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/trace_result.h>

namespace rtsg {

class BodyWeights {
  public:
    using Tones = std::array<double, kEdgeTones>;

    /// For one source and one listener.
    BodyWeights(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                double speedOfSound);

    /// The factors of the pressure that a body adds. They are 1 for null, and for a body in whose box the source or the
    /// listener is, as in a room.
    const Tones& of(const WallBody* body);
    /// The factors for two edges, each of which may belong to a body.
    Tones of(const WallBody* first, const WallBody* second);
    /// Notes that a body lies in a way. Bodies that are not noted are not known to.
    void note(const WallBody* body) {
        if (body && (noted_.empty() || noted_.back() != body)) noted_.push_back(body);
    }
    /// The share of the pressure that goes straight from one place to another, as if bodies were not in its way; false
    /// where something is that is not small.
    bool straightOn(const glm::dvec3& from, const glm::dvec3& to, Tones& fraction);

  private:
    const WallBody* bodyAt(const glm::dvec3& position, double margin) const;
    bool touches(const WallBody& body, int axis, double side, double reach) const;
    bool isAtWall(const WallBody& body, const glm::dvec3& position) const;

    const AcousticGeometry& geometry_;
    const glm::dvec3 source_, listener_;
    const double speedOfSound_;
    Tones one_;
    std::map<const WallBody*, Tones> known_;
    std::vector<const WallBody*> noted_;
};

}  // namespace rtsg
