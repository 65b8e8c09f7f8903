// Diffraction of second order: sound that is diffracted by two edges in a row, behind thick bodies and double screens.
//
// Behind both edges it is an arrival of its own. Where only one of them hides the source (or the listener), it
// continues the field of that edge, so that at the shadow boundary of the other edge half of the pressure is left on
// both sides. Where direct sound is heard, or neither edge hides anything, a pair counts only along a common face that
// sound leaves at its far edge (a broad body). So the field is continuous except where both boundaries meet. Ends of
// edges: diffraction_face_pairs.h. The shortest pairs are used, see EdgePairCount. Source: see diffraction_wedge.h.
// Threading: pure functions over const geometry.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "edges/diffraction_paths.h"
#include "edges/diffraction_small_bodies.h"
#include "response/wave_levels.h"

#include <rtsg/audio/trace_result.h>

namespace rtsg {

/// An edge that is heard by itself: in its shadow, or beside direct sound.
struct BentByOne {
    WallEdge edge;
    RoundEdge round;
    bool lit = false;
};

/// Edges by which sound may go, with the way by each alone, or its bound.
struct EdgeCandidate {
    WallEdge edge;
    double pathLength = 0;
    glm::dvec3 by{0};  // the place by which it goes
};

/// Over the point on an edge that is nearest to the straight line; no path over the edge is shorter.
EdgeCandidate candidateBy(const WallEdge& edge, const BesideEdge& beside);

/// The most edges that are tried with each other, those by which the way is shortest. This bounds the work, which grows
/// with the square.
constexpr std::size_t kPairedEdges = 32;
/// They are chosen from so many: seams between bodies are among them, and edges that are one. A bound of work, too.
constexpr std::size_t kLookedAtEdges = 256;

/// The edges that bend sound by themselves, and whether direct sound is heard.
struct EdgesAlone {
    std::vector<BentByOne> bent;
    bool heardStraight = false;
};

/// `candidates`: the shortest of `edgeCount`, kLookedAtEdges if there are so many.
EdgePairCount addEdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                           const TraceOptions& options, double seconds, const std::vector<EdgeCandidate>& candidates,
                           std::size_t edgeCount, const EdgesAlone& known, BodyWeights& bodies, BentParts& parts,
                           EdgeField& field);

}  // namespace rtsg
