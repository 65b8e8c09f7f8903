// Pictures of the program by the rasteriser: skipped where there is no display or no OGRE.
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "ogre/display.h"
#include "program.h"
#include "test_paths.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Raster : public CommandLine {};

TEST_F(Raster, DrawsAndSaysWhatItLeavesOut) {
    if (!haveDisplay()) GTEST_SKIP() << "there is no display, and no Xvfb";
    const Outcome one = rtsg({"render", RTSG_SOURCE_DIR "/examples/demo/hall.x3dv", "--integrator", "raster", "-o",
                              folder / "hall.png", "--size", "64x36", "--json"});
    if (one.err.find("built without a rasteriser") != one.err.npos) GTEST_SKIP() << one.err;
    ASSERT_EQ(one.status, 0) << one.err;
    EXPECT_THAT(one.err, HasSubstr("mirrors reflect nothing"));
    const json said = json::parse(one.out);
    EXPECT_EQ(said.at("width"), 64);
    EXPECT_EQ(said.at("spp"), 4);
    EXPECT_GT(said.at("triangles"), 1000);
    EXPECT_TRUE(std::filesystem::exists(folder / "hall.png"));
    const Outcome film = rtsg({"render", RTSG_SOURCE_DIR "/examples/door.x3dv", "--integrator", "raster", "-o",
                               folder / "%d.png", "--frames", "3", "--size", "32x18"});
    EXPECT_EQ(film.status, 0) << film.err;
    EXPECT_THAT(film.out, HasSubstr("s of drawing"));
    EXPECT_TRUE(std::filesystem::exists(folder / "2.png"));
}

}  // namespace
}  // namespace rtsg::test
