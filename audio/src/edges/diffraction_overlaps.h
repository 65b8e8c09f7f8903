// Merges edges that partly coincide, such as those of bodies that overlap or continue each other.
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
