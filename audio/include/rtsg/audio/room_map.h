// RoomMap: room-acoustic figures at the points of a grid, as a table and as a picture.
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

/// The figure that a map shows.
struct MapFigure {
    std::string name;                 // "C80", or "STI"
    std::optional<std::size_t> band;  // none: the mean of 500 and 1000 Hz; none for the STI

    /// Parses "C80", "C80@2000" or "STI". Errors: an unknown figure or octave; the message lists the known ones.
    static Result<MapFigure> parse(std::string_view text);
    /// With octave and unit.
    std::string title() const;
};

struct RoomMap {
    FloorGrid grid;
    RoomReport report;  // its pairs are source by source, with the points of the grid in order; without echograms

    /// By point of the grid, row by row: the mean over sources; NaN outside the room and where the figure does not
    /// exist.
    std::vector<double> values(const MapFigure& figure) const;
    /// A line for each source and point: source, x, y, z, then each figure in each octave with the half width of its 95
    /// % interval. NaN becomes an empty cell.
    std::string toCsv() const;
    /// A plan from above (x to the right, z down) with the sources, the figure as colours, and a colour scale.
    Picture picture(const MapFigure& figure) const;
};

}  // namespace rtsg
