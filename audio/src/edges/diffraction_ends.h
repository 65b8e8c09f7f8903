// Corrects for edges of finite length. The wave over the shortest path loses the part beyond the ends, and the ends
// send sound themselves, even if the shortest path passes beside them. So levels are continuous there.
//
// Threading: pure functions.
#pragma once

#include <array>
#include <complex>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>
#include "diffraction_wedge.h"

#include "diffraction_paths.h"

namespace rtsg {

/// One end, and the contribution of the edge beyond it, by tone, see wedgeBeyond().
struct EdgeEnd {
    glm::dvec3 position{0};
    double pathLength = 0;  // m, by this end
    double fraction =
        0;  // of it that counts: -1 where it is beyond the place of the shortest way, +1 if it begins here
    std::array<std::complex<double>, kEdgeTones> besideDirect{}, besideMirrored{};
};

/// Sets the pressure that `path` would bring beyond a place by which the way is `end.way`.
void setBeyond(const WedgePath& path, double speedOfSound, EdgeEnd& end);

/// Both ends, the one with the shorter way first.
std::array<EdgeEnd, 2> endsOf(const WallEdge& edge, const RoundEdge& round, double speedOfSound);

/// At most what bentPast() is, of all edges that are in the air: without angles. Infinity where the way leads by the
/// edge. `straight`: metres between source and listener.
double bentPastAtMost(const WallEdge& edge, const BesideEdge& beside, double straight);

/// About how much of sound in the open an edge bends whose shortest way leads past it; cheap.
double bentPast(const WallEdge& edge, const RoundEdge& round);

}  // namespace rtsg
