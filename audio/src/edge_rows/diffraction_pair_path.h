// A path over two edges: its shortest position, its diffraction coefficients, whether it is free, and its pressure.
//
// Threading: pure functions over const geometry.
#pragma once

#include <array>
#include <complex>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>
#include "edges/diffraction_wedge.h"

#include "diffraction_face_pairs.h"
#include "edges/diffraction_paths.h"
#include "response/edge_tones.h"

namespace rtsg {

/// A way round two edges.
struct PairPath {
    const WallEdge* first = nullptr;
    const WallEdge* second = nullptr;
    glm::dvec3 byFirst{0}, bySecond{0};
    EdgeSide atFirst, atSecond;
    TwoWedgePath path;
    /// For each edge: the distances from the place to both ends, metres, negative beyond an end; and half of the second
    /// derivative of the way's length by the place, while the place on the other edge is the best.
    std::array<double, 2> fromLow{}, fromHigh{}, bend{};
    bool fractionsLow[2]{}, fractionsHigh[2]{};  // the end is one of the other edge, too
    /// How much longer the way is by the ends that it leads past, metres.
    double past = 0;
    /// Along a face of both; then the ends are told by this, and nothing of the above is known of them.
    FacePair flat;
    bool onFace = false;
    /// For two rims of one sheet the unit normal of the side along which the way leads; else 0.
    glm::dvec3 side{0};
};

/// The shortest way by both edges of `way`, and its angles; `heardStraight`: whether direct sound is. False if there is
/// none that counts.
bool findPath(const glm::dvec3& source, const glm::dvec3& listener, bool heardStraight, PairPath& path);

/// Paths along faces with a smaller share of free-field sound than this are ignored.
inline double minOnFace(bool heardStraight) {
    return heardStraight ? 1e-2 : 2e-3;
}

/// Whether the path between the edges, and around both, is free. Paths along a face are tested slightly off it.
bool isFreeAlong(const AcousticGeometry& geometry, const PairPath& path);

/// The pressures that both edges bend, by tone: by the shortest way, relative to its phase, and by ends.
struct PairField {
    std::array<std::complex<double>, kEdgeTones> wave{};
    std::vector<FacePair::End> ends;
};

PairField fieldOf(const PairPath& path, const EdgeTones& tones, double speedOfSound);

}  // namespace rtsg
