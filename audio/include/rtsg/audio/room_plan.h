// RoomPlan: a room cut at some height and seen from above, and the places of a grid in it.
//
// Threading: pure functions over what may be read from any thread.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_box.h>
#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/room_size.h>
#include <rtsg/audio/walls.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct RoomPlan {
    using Line = std::array<glm::dvec2, 2>;  // x and z, m
    double height = 0;                       // y of the cut, m
    std::vector<Line> lines;                 // where walls are cut
    std::size_t leftOut = 0;                 // lines beyond the first 20,000
};

/// Cuts all triangles that sound meets; of what lies outside of the box, with a margin, nothing is kept.
RoomPlan planOf(const WallsVersion& walls, double height, const AcousticBox& box);

/// Points at one height, a step apart along x and z, of which some are in the room.
struct FloorGrid {
    double height = 0, step = 1, x = 0, z = 0;  // m; x, z: of the first point
    std::size_t columns = 0, rows = 0;          // along x and z
    std::vector<std::size_t> inside;            // numbers of points, row by row

    glm::dvec3 place(std::size_t point) const {
        const std::size_t column = point % columns, row = point / columns;
        return {x + step * static_cast<double>(column), height, z + step * static_cast<double>(row)};
    }
};

/// The points that sound comes to through the air of the room. Errors: the room is open, or not known; more than
/// 10,000 points; none at that height.
Result<FloorGrid> gridIn(const AcousticGeometry& geometry, const RoomSize& room, double height, double step);

}  // namespace rtsg
