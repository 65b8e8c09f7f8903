// RoomMap: figures of a room at the points of a grid, as a table and as a picture.
//
// Threading: a plain value.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/audio/room_plan.h>
#include <rtsg/audio/room_report.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

/// Which figure a map shows.
struct MapFigure {
    std::string name;                 // "C80", or "STI"
    std::optional<std::size_t> band;  // nothing: the mean of 500 and 1000 Hz; of STI none

    /// "C80", "C80@2000", "STI". Errors: no such figure or octave; it says which there are.
    static Result<MapFigure> parse(std::string_view text);
    /// With octave and unit.
    std::string title() const;
};

struct RoomMap {
    FloorGrid grid;
    RoomReport report;  // its pairs: source by source, the points of the grid in their order; no echograms

    /// By point of the grid, row by row: the mean over sources; NaN outside of the room and where there is none.
    std::vector<double> values(const MapFigure& figure) const;
    /// Source, x, y, z, and then each figure in each octave with the half width of its 95 % interval, a line a source
    /// and point; what is no number is empty.
    std::string toCsv() const;
    /// The plan from above (x to the right, z down) with sources, the figure in colours, and its scale.
    Picture picture(const MapFigure& figure) const;
};

}  // namespace rtsg
