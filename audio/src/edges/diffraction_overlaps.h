// Edges that lie on each other in part, as those of bodies that stand in each other, or go on in each other: they are
// one.
//
// Threading: pure functions.
#pragma once

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

/// Whether both lie on one line, meet there, and have the same faces and material; `both` is then all of them.
bool joinedEdge(const WallEdge& a, const WallEdge& b, WallEdge& both);

/// Metres; nearer than this, places in numbers of single precision are one.
double edgeRounding(const WallEdge& edge);

}  // namespace rtsg
