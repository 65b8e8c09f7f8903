// Clean edges: smooths the stairs at edges of coarse pictures, so that they can be enlarged.
//
// A pixel beside an edge that is nearly horizontal or vertical gets the share of the other side that a straight line
// through the edge's ends would give it. Exactly horizontal and vertical edges (except corners, which become rounder),
// thin things and textures stay as they are. Threading: re-entrant. Source: Lottes 2009 (FXAA), for finding the ends of
// an edge.
#pragma once

#include <cstdint>
#include <vector>

namespace rtsg {

/// `pixels`: B, G, R, 255; rows from the top.
void cleanEdges(std::vector<std::uint8_t>& pixels, int width, int height);

}  // namespace rtsg
