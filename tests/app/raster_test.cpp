// Pictures of the program by the rasteriser: skipped where there is no display or no OGRE.
#include <cstdlib>

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

TEST_F(Raster, DrawsHybridPicturesInWhichNothingIsLeftOut) {
    if (!haveDisplay()) GTEST_SKIP() << "there is no display, and no Xvfb";
    const auto drawn = [&](const char* integrator, const char* name) {
        const Outcome one = rtsg({"render", RTSG_SOURCE_DIR "/examples/demo/hall.x3dv", "--integrator", integrator,
                                  "-o", folder / name, "--size", "64x36", "--spp", "1", "--frames", "2"});
        EXPECT_TRUE(one.status == 0 || one.err.find("built without a rasteriser") != one.err.npos) << one.err;
        return one;
    };
    const Outcome hybrid = drawn("hybrid", "hybrid%d.ppm");
    if (hybrid.status != 0) GTEST_SKIP() << hybrid.err;
    EXPECT_EQ(hybrid.err, drawn("whitted", "rays%d.ppm").err);
    EXPECT_THAT(hybrid.out, HasSubstr("of drawing and tracing"));
    constexpr std::size_t kBytes = std::size_t{64} * 36 * 3;  // at the end of such a file
    for (const char* number : {"0", "1"}) {
        const std::string a = readFile(folder / (std::string("hybrid") + number + ".ppm"));
        const std::string b = readFile(folder / (std::string("rays") + number + ".ppm"));
        ASSERT_GT(a.size(), kBytes);
        ASSERT_EQ(a.size(), b.size());
        double sum = 0;
        for (std::size_t i = a.size() - kBytes; i < a.size(); ++i)
            sum += std::abs(static_cast<unsigned char>(a[i]) - static_cast<unsigned char>(b[i]));
        EXPECT_LT(sum / kBytes, 1.5);
    }
}

}  // namespace
}  // namespace rtsg::test
