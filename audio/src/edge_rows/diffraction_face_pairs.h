// Two edges of one face, between which sound travels along the face.
//
// If the scene is unfolded into the plane of the face, the listener lies beyond the second edge, and all paths from the
// first edge go straight there. The first edge diffracts like a single edge for those paths that pass the second edge,
// which transmits a share of them. So where the second edge begins to hide the first one, the contribution of the first
// one, with that of its ends, is halved on both sides. Edges that meet at a corner of the face have a part each. The
// same holds in the other direction, for the source and the second edge. Of the two directions, the one nearer to its
// boundary counts.
// Threading: pure functions.
#pragma once

#include <array>
#include <complex>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>
#include "edges/diffraction_wedge.h"

#include "response/edge_tones.h"

namespace rtsg {

class FacePair {
  public:
    /// False if both are not of one face, or no way along it leads by both within their ends.
    bool lay(const WallEdge& first, const WallEdge& second, const glm::dvec3& source, const glm::dvec3& listener);

    bool shared = false;  // there is such a face
    /// The places within both edges by which the way is shortest; nearly so if the way leads past their ends.
    glm::dvec3 byFirst{0}, bySecond{0};
    /// Whether the shortest way of edges without ends leads there.
    bool within = false;

    /// The wave from the end of a part: the excess of edges without ends, or the wave where the shortest path passes
    /// beside the part.
    struct End {
        glm::dvec3 first{0}, second{0};
        double pathLength = 0;
        std::array<std::complex<double>, kEdgeTones> pressure{};  // re the phase of its way
    };
    /// `path`: the way by the places above, with its angles.
    std::vector<End> endsOf(const TwoWedgePath& path, const EdgeTones& tones, double speedOfSound) const;

    /// About how much of sound in the open at 125 Hz comes that way; cheap.
    double strength(const TwoWedgePath& path) const;

    static bool shareFace(const WallEdge& a, const WallEdge& b);

  private:
    /// The place where the line from `from` to a place that is laid flat crosses an edge.
    static glm::dvec3 crossing(const glm::dvec3& from, const glm::dvec3& flat, const WallEdge& edge);
    /// An edge and what counts of it: where it is seen from, and where it is seen across the other edge, laid flat.
    struct Side {
        WallEdge edge;
        glm::dvec3 position{0}, flat{0};
        double along = 0, radius = 0, alongFlat = 0, radiusFlat = 0;
        double low = 0, high = 0, shortest = 0;  // metres from its beginning on

        bool any() const { return high > low; }
    };
    static Side layOne(const WallEdge& edge, const glm::dvec3& inward, const WallEdge& other,
                       const glm::dvec3& otherInward, const glm::dvec3& near, const glm::dvec3& beyond);
    void addEnds(const Side& side, const TwoWedgePath& path, double fraction, const EdgeTones& tones,
                 double speedOfSound, std::vector<End>& ends) const;

    std::array<Side, 2> sides_;
};

}  // namespace rtsg
