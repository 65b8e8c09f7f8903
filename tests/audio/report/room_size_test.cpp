// Volume, surface and foretold reverberation of rooms whose sizes are known.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/audio/room_report.h>

#include "audio/triangle_geometry.h"

namespace rtsg {
namespace {

using test::Shoebox;
using test::TriangleGeometry;

/// Two rooms of 4 x 4 x 3 m beside each other, with a door of `width` by 2 m in a wall without thickness. `cupboard`:
/// one of 2 x 2 x 2 m stands in the first.
TriangleGeometry coupled(double width, bool cupboard = false) {
    TriangleGeometry rooms;
    const std::uint32_t left = rooms.addMaterial(.1, .1), right = rooms.addMaterial(.3, .1),
                        middle = rooms.addMaterial(.5, .1);
    const auto room = [&](double from, double to, std::uint32_t m, bool low, bool high) {
        rooms.addQuad({from, 0, 0}, {to, 0, 0}, {to, 0, 4}, {from, 0, 4}, m);
        rooms.addQuad({from, 3, 0}, {to, 3, 0}, {to, 3, 4}, {from, 3, 4}, m);
        rooms.addQuad({from, 0, 0}, {to, 0, 0}, {to, 3, 0}, {from, 3, 0}, m);
        rooms.addQuad({from, 0, 4}, {to, 0, 4}, {to, 3, 4}, {from, 3, 4}, m);
        if (low) rooms.addQuad({from, 0, 0}, {from, 0, 4}, {from, 3, 4}, {from, 3, 0}, m);
        if (high) rooms.addQuad({to, 0, 0}, {to, 0, 4}, {to, 3, 4}, {to, 3, 0}, m);
    };
    room(0, 4, left, true, false);
    room(4, 8, right, false, true);
    rooms.addQuad({4, 0, 0}, {4, 0, 4 - width}, {4, 3, 4 - width}, {4, 3, 0}, middle);
    rooms.addQuad({4, 2, 4 - width}, {4, 2, 4}, {4, 3, 4}, {4, 3, 4 - width}, middle);
    if (cupboard) rooms.addBox({1, 0, 1}, {3, 2, 3}, {left, left, left, left, left, left});
    rooms.finish();
    return rooms;
}

TEST(RoomSize, OfABoxWithItsMaterials) {
    Shoebox box = Shoebox::uniform({6, 5, 3}, .1);
    box.absorption[4] = .4;  // one that is 6 x 5 m
    const TriangleGeometry room = box.geometry();
    const RoomSize size = measureRoom(room, test::kSource);
    ASSERT_TRUE(size.known());
    EXPECT_NEAR(size.volume, 90, .3);
    EXPECT_NEAR(size.surface, 126, .8);
    EXPECT_NEAR(size.meanFreePath(), 4 * 90 / 126.0, .02);
    EXPECT_EQ(size.openings, 0);
    ASSERT_EQ(size.surfaces.size(), 6u);
    EXPECT_NEAR(size.surfaces[0].area, 30, .6);
    EXPECT_NEAR(size.surfaces[5].area, 15, .5);
    EXPECT_NEAR(glm::distance(size.box.low, glm::dvec3(0)), 0, .1);
    EXPECT_NEAR(glm::distance(size.box.high, glm::dvec3(6, 5, 3)), 0, .1);
    Air air;
    air.absorbs = false;
    const double area = 96 * .1 + 30 * .4, mean = area / 126, k = 24 * std::log(10.0) / 343 * 90;
    EXPECT_NEAR(absorptionArea(size, room.materials())[0], area, .25);
    EXPECT_NEAR(sabineTimes(size, room.materials(), air)[kBand1k], k / area, .015 * k / area);
    EXPECT_NEAR(eyringTimes(size, room.materials(), air)[kBand1k], k / (-126 * std::log(1 - mean)), .015);
    air.absorbs = true;
    const double m = airAttenuation(air)[9];
    EXPECT_NEAR(sabineTimes(size, room.materials(), air)[9], k / (area + 4 * m * 90), .01);
}

TEST(RoomSize, OfRoomsThatAreCoupled) {
    // A wide opening, and a door: each side of what is between counts.
    for (const double width : {3.0, 1.0}) {
        const TriangleGeometry rooms = coupled(width);
        const RoomSize size = measureRoom(rooms, {1, 1.5, 1});
        const double between = 12 - 2 * width;
        EXPECT_NEAR(size.volume / 96, 1, .04) << width;
        EXPECT_NEAR(size.surface / (2 * (4 * 4 * 2 + 4 * 3 * 3) + 2 * between), 1, .05) << width;
        double middle = 0;
        for (const RoomSize::Surface& surface : size.surfaces)
            if (surface.material == 2) middle = surface.area;
        EXPECT_NEAR(middle, 2 * between, 1) << width;
    }
}

TEST(RoomSize, OpeningsTakeAllAndMuchOfThemIsNoRoom) {
    Shoebox box = Shoebox::uniform({6, 5, 3}, .1);
    TriangleGeometry open = box.geometry();
    open.removeLastTriangle();  // half of a wall of 6 x 5 m
    const RoomSize size = measureRoom(open, test::kSource);
    EXPECT_NEAR(size.openings, 15, 1);
    EXPECT_NEAR(size.surface, 126, 4);
    EXPECT_NEAR(absorptionArea(size, open.materials())[3], 15 + 111 * .1, 1.2);
    TriangleGeometry floor;
    floor.addQuad({-9, 0, -9}, {9, 0, -9}, {9, 0, 9}, {-9, 0, 9}, floor.addMaterial(.1, .1));
    floor.finish();
    const RoomSize none = measureRoom(floor, {0, 1, 0});
    EXPECT_FALSE(none.known());
    EXPECT_TRUE(std::isnan(sabineTimes(none, floor.materials(), {})[4]));
    EXPECT_FALSE(gridIn(floor, none, 1, .5));
}

TEST(RoomGrid, HasThePointsThatAreInTheRoom) {
    const TriangleGeometry rooms = coupled(1);
    const RoomSize size = measureRoom(rooms, {1, 1.5, 1});
    const auto grid = gridIn(rooms, size, 1.2, .5);
    ASSERT_TRUE(grid) << grid.error().text;
    EXPECT_NEAR(static_cast<double>(grid->columns), 16, 1);
    EXPECT_NEAR(static_cast<double>(grid->rows), 8, 1);
    EXPECT_EQ(grid->inside.size(), grid->columns * grid->rows);
    for (const std::size_t point : grid->inside) {
        const glm::dvec3 position = grid->position(point);
        EXPECT_EQ(position.y, 1.2);
        EXPECT_TRUE(position.x > 0 && position.x < 8 && position.z > 0 && position.z < 4);
    }
    EXPECT_FALSE(gridIn(rooms, size, 5, .5));
    EXPECT_FALSE(gridIn(rooms, size, 1.2, .001));
    // A closed cupboard is no part of it.
    const TriangleGeometry furnished = coupled(1, true);
    const auto less = gridIn(furnished, measureRoom(furnished, {.5, 1.5, .5}), 1.2, .5);
    ASSERT_TRUE(less);
    for (const std::size_t point : less->inside) {
        const glm::dvec3 position = less->position(point);
        EXPECT_FALSE(position.x > 1 && position.x < 3 && position.z > 1 && position.z < 3);
    }
    EXPECT_LT(less->inside.size(), grid->inside.size() - 10);
}

}  // namespace
}  // namespace rtsg
