// Cuts the walls of a room at a height, and finds which points of a grid lie in the room.
#include <rtsg/audio/room_report.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include <rtsg/renderers/mesh.h>

#include "walls/walls.h"

namespace rtsg {
namespace {

constexpr std::size_t kMaxLines = 20'000, kMaxPoints = 10'000;

/// The line in which a triangle crosses a height.
std::optional<RoomPlan::Line> cutOf(const std::array<glm::dvec3, 3>& corners, double height) {
    RoomPlan::Line line;
    std::size_t found = 0;
    for (std::size_t i = 0; i < 3 && found < 2; ++i) {
        const glm::dvec3 &a = corners[i], &b = corners[(i + 1) % 3];
        // A corner exactly at the height counts as above it.
        if ((a.y < height) == (b.y < height)) continue;
        const glm::dvec3 at = a + (b - a) * ((height - a.y) / (b.y - a.y));
        line[found++] = {at.x, at.z};
    }
    return found == 2 ? std::optional(line) : std::nullopt;
}

}  // namespace

RoomPlan planOf(const WallsVersion& walls, double height, const AcousticBox& box) {
    constexpr double kMargin = 0.02;
    RoomPlan plan;
    plan.height = height;
    if (box.empty()) return plan;
    const double margin = kMargin * glm::distance(box.low, box.high);
    for (std::size_t i = 0; i < walls.walls.size(); ++i) {
        const Wall& wall = walls.walls[i];
        if (!wall.mesh) continue;
        const Mesh& mesh = *wall.mesh;
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
            std::array<glm::dvec3, 3> corners;
            for (std::uint32_t c = 0; c < 3; ++c)
                corners[c] = wall.worldFromLocal * glm::dvec4(glm::dvec3(mesh.vertex(t, c)), 1.0);
            const auto line = cutOf(corners, height);
            if (!line) continue;
            const glm::dvec2 low = glm::min((*line)[0], (*line)[1]), high = glm::max((*line)[0], (*line)[1]);
            if (high.x < box.low.x - margin || low.x > box.high.x + margin || high.y < box.low.z - margin ||
                low.y > box.high.z + margin)
                continue;
            if (plan.lines.size() < kMaxLines)
                plan.lines.push_back(*line);
            else
                ++plan.leftOut;
        }
    }
    return plan;
}

namespace {

bool canSee(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& to) {
    const double distance = glm::distance(from, to);
    AcousticHit hit;
    return !(distance > 0) || !geometry.closest(from, (to - from) / distance, distance, kNoPlane, hit);
}

/// The grid points that can be reached, from those seen from places of the room on to their neighbours.
std::vector<char> reachedFrom(const AcousticGeometry& geometry, const RoomSize& room, const FloorGrid& grid) {
    constexpr std::size_t kSeeds = 64;
    const std::size_t count = grid.columns * grid.rows;
    std::vector<char> reached(count);
    std::vector<std::size_t> ahead;
    const auto reach = [&](std::size_t point) {
        if (!std::exchange(reached[point], 1)) ahead.push_back(point);
    };
    const auto flood = [&] {
        while (!ahead.empty()) {
            const std::size_t point = ahead.back(), column = point % grid.columns, row = point / grid.columns;
            ahead.pop_back();
            const auto next = [&](bool there, std::size_t other) {
                if (there && !reached[other] && canSee(geometry, grid.position(point), grid.position(other)))
                    reach(other);
            };
            next(column > 0, point - 1);
            next(column + 1 < grid.columns, point + 1);
            next(row > 0, point - grid.columns);
            next(row + 1 < grid.rows, point + grid.columns);
        }
    };
    // Parts that furniture separates are seen from other places.
    const std::size_t step = std::max<std::size_t>(1, room.positions.size() / kSeeds);
    for (std::size_t i = 0; i < room.positions.size(); i += step)
        for (std::size_t point = 0; point < count; ++point) {
            if (reached[point] || !canSee(geometry, room.positions[i], grid.position(point))) continue;
            reach(point);
            flood();
        }
    return reached;
}

}  // namespace

Result<FloorGrid> gridIn(const AcousticGeometry& geometry, const RoomSize& room, double height, double step) {
    if (!room.known()) return fail("there is no room around the source whose floor a grid could cover: it is open");
    FloorGrid grid;
    grid.height = height;
    grid.step = step;
    const glm::dvec3 size = room.box.high - room.box.low;
    const double columns = std::floor(size.x / step), rows = std::floor(size.z / step);
    if (!(columns * rows <= static_cast<double>(kMaxPoints)))
        return fail(fmt::format("a step of {} m makes {:.0f} points, and there may be {}: take a larger one", step,
                                columns * rows, kMaxPoints));
    grid.columns = static_cast<std::size_t>(std::max(1.0, columns));
    grid.rows = static_cast<std::size_t>(std::max(1.0, rows));
    const auto first = [&](double low, double length, std::size_t count) {
        return low + (length - step * static_cast<double>(count - 1)) / 2;
    };
    grid.x = first(room.box.low.x, size.x, grid.columns);
    grid.z = first(room.box.low.z, size.z, grid.rows);
    const std::vector<char> reached = reachedFrom(geometry, room, grid);
    for (std::size_t point = 0; point < reached.size(); ++point)
        if (reached[point]) grid.inside.push_back(point);
    if (grid.inside.empty())
        return fail(
            fmt::format("at a height of {} m no point of the grid is in the room, which reaches from {:.3g} to "
                        "{:.3g} m",
                        height, room.box.low.y, room.box.high.y));
    return grid;
}

}  // namespace rtsg
