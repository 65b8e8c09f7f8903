// Clean edges: coarse pictures whose edges are no stairs, so that they may be enlarged.
//
// A pixel beside an edge that runs nearly along rows or columns gets the share of the other side that a straight line
// through the edge's ends would give it. Edges along rows and columns (but for corners, which get rounder), thin things
// and textures stay as they are. Threading: re-entrant. Source: Lottes 2009 (FXAA), for how an edge's ends are found.
#pragma once

#include <cstdint>
#include <vector>

namespace rtsg {

/// `pixels`: B, G, R, 255; rows from the top.
void cleanEdges(std::vector<std::uint8_t>& pixels, int width, int height);

}  // namespace rtsg
