// RoomPlan: a horizontal cut through a room, and the points of a grid in it.
//
// Threading: pure functions over data that may be read on any thread.
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
    std::vector<Line> lines;                 // the cut walls
    std::size_t leftOut = 0;                 // number of lines beyond the first 20,000
};

/// Cuts all triangles that sound can hit. Lines outside the box, which has a margin, are dropped.
RoomPlan planOf(const WallsVersion& walls, double height, const AcousticBox& box);

/// Points at one height, `step` apart along x and z; some of them are in the room.
struct FloorGrid {
    double height = 0, step = 1, x = 0, z = 0;  // m; x, z: of the first point
    std::size_t columns = 0, rows = 0;          // along x and z
    std::vector<std::size_t> inside;            // numbers of points, row by row

    glm::dvec3 position(std::size_t point) const {
        const std::size_t column = point % columns, row = point / columns;
        return {x + step * static_cast<double>(column), height, z + step * static_cast<double>(row)};
    }
};

/// The points that sound can reach through the air of the room. Errors: the room is open or not known; more than 10,000
/// points; none at that height.
Result<FloorGrid> gridIn(const AcousticGeometry& geometry, const RoomSize& room, double height, double step);

}  // namespace rtsg
