// Maps of figures: what is asked for, tables that can be read again, pictures whose colours are those of the values.
#include <algorithm>
#include <cmath>
#include <sstream>

#include <gtest/gtest.h>

#include <rtsg/audio/room_report.h>

#include "audio/listen/listen_scene.h"

namespace rtsg {
namespace {

TEST(MapFigure, HasANameAndMaybeAnOctave) {
    const auto plain = MapFigure::parse("C80");
    ASSERT_TRUE(plain);
    EXPECT_EQ(plain->title(), "C80, dB, mean of 500 to 1000 Hz");
    const auto octave = MapFigure::parse("T20@2000");
    ASSERT_TRUE(octave);
    EXPECT_EQ(octave->band, std::size_t{kBand1k + 1});
    EXPECT_EQ(octave->title(), "T20, s, 2000 Hz");
    EXPECT_EQ(MapFigure::parse("LF")->title(), "LF, mean of 125 to 1000 Hz");
    EXPECT_TRUE(MapFigure::parse("IACC_early"));
    EXPECT_TRUE(MapFigure::parse("STI"));
    for (const char* wrong : {"", "C81", "C80@", "C80@900", "STI@1000", "@1000"})
        EXPECT_FALSE(MapFigure::parse(wrong)) << wrong;
    EXPECT_NE(
        MapFigure::parse("X").error().text.find("EDT, T20, T30, C50, C80, D50, Ts, G, LF, IACC_early, IACC_late, STI"),
        std::string::npos);
}

/// Three columns, two rows, one point outside; two sources.
RoomMap small() {
    RoomMap map;
    map.grid = {1.2, .5, 1, 2, 3, 2, {0, 1, 2, 3, 4}};
    for (int source = 0; source < 2; ++source)
        for (int i = 0; i < 5; ++i) {
            RoomReport::Pair& pair = map.report.pairs.emplace_back();
            pair.source = source == 0 ? "A" : "the \"second\"";
            pair.sourceAt = {1.5, 0, 2};
            pair.listenerAt = map.grid.position(map.grid.inside[static_cast<std::size_t>(i)]);
            pair.metrics.value.c80 = allBands(i + source);
            pair.speech.sti = .1 * i;
        }
    map.report.pairs[4].metrics.value.c80 = allBands(std::nan(""));
    return map;
}

TEST(RoomMap, IsTheMeanOverSources) {
    const RoomMap map = small();
    const std::vector<double> values = map.values(*MapFigure::parse("C80@1000"));
    ASSERT_EQ(values.size(), 6u);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(values[i], static_cast<double>(i) + .5);
    EXPECT_EQ(values[4], 5);
    EXPECT_TRUE(std::isnan(values[5]));
    EXPECT_EQ(map.grid.position(4), glm::dvec3(1.5, 1.2, 2.5));
}

TEST(RoomMap, IsATableWithALineForEachSourceAndPoint) {
    std::istringstream csv(small().toCsv());
    std::string head, line;
    std::getline(csv, head);
    const auto cells = [](const std::string& text) { return std::ranges::count(text, ',') + 1; };
    EXPECT_TRUE(head.starts_with("source,x,y,z,EDT_s@31.5,EDT_s@31.5_ci95,")) << head;
    EXPECT_TRUE(head.ends_with(",STI,STI_ci95"));
    std::vector<std::string> lines;
    for (; std::getline(csv, line); lines.push_back(line)) EXPECT_EQ(cells(line), cells(head));
    ASSERT_EQ(lines.size(), 10u);
    EXPECT_TRUE(lines.back().starts_with("\"the \"\"second\"\"\",1.5,1.2,2.5,")) << lines.back();
}

TEST(RoomMap, IsAPictureWhoseColoursGrowLighter) {
    const Picture picture = small().picture(*MapFigure::parse("STI"));
    ASSERT_GT(picture.width, 420);
    // The first row of squares of 96 pixels, below the title.
    const auto color = [&](int column, int row) { return picture.at(40 + 96 * column + 10, 74 + 96 * row + 10); };
    const auto light = [&](int column, int row) {
        return color(column, row).x + color(column, row).y + color(column, row).z;
    };
    EXPECT_LT(light(0, 0), light(1, 0));
    EXPECT_LT(light(1, 0), light(2, 0));
    EXPECT_LT(light(0, 1), light(1, 1));
    EXPECT_EQ(light(2, 1), 3);  // paper
    // The scale goes on a little beyond the lowest and the highest, which are at .0455 and .9545 of it.
    EXPECT_NEAR(color(0, 0).z, (74 + .0455 * 4 * (142 - 74)) / 255, .01);
    EXPECT_NEAR(color(1, 1).x, (86 + .818 * (250 - 86)) / 255, .01);
    EXPECT_EQ(picture.at(40 + 96 + 48, 74 + 48), Vec4f(.8f, .1f, .1f, 1)) << "where the source is";
    // Points without values are grey, and there is no scale.
    const Picture none = small().picture(*MapFigure::parse("LF"));
    EXPECT_EQ(none.at(88, 122).x, .86f);
}

using MapOfScene = test::Listen;

/// The map of a box: the figures at its points are those that a survey of these places has.
TEST_F(MapOfScene, MeasuresAllOverTheFloor) {
    Scene scene;
    load(scene,
         test::room("absorption .3 diffuse .7 specular 0",
                    "Sound { location 1 1 1.5 maxBack 90 maxFront 90 source AudioClip { url \"impulse.wav\" } }\n"
                    "Viewpoint { position 4 3 1.5 }\n"));
    SharedWorld world(scene);
    ListenOptions asked = options();
    asked.trace.rays = 1000;
    SoundRenderer sound(world, asked);
    const auto map = sound.map(1.2, 1);
    ASSERT_TRUE(map) << map.error().text;
    EXPECT_EQ(map->report.pairs.size(), map->grid.inside.size());
    // 6 m by 3 m: what is 5 m high here is along y.
    EXPECT_EQ(map->grid.inside.size(), 18u);
    EXPECT_NEAR(map->report.room.volume, 90, 1);
    for (const RoomReport::Pair& pair : map->report.pairs) {
        EXPECT_EQ(pair.listenerAt.y, 1.2);
        EXPECT_TRUE(pair.echogram.arrivals.empty());
        EXPECT_GT(pair.speech.sti, .5);
        EXPECT_LT(pair.metrics.value.g[kBand1k], 32);
        EXPECT_GT(pair.metrics.value.g[kBand1k], 16);
    }
    EXPECT_FALSE(map->report.plan.lines.empty());
    EXPECT_FALSE(sound.map(50, 1));
    EXPECT_FALSE(sound.map(1.2, 1e-3));
}

}  // namespace
}  // namespace rtsg
