// A user who walks by keys and wheels, from the command line: pictures, logs and replays have the same eye.
#include "program.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Wanderer : public CommandLine {
  protected:
    void SetUp() override {
        writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { type "WALK" speed 2 headlight TRUE }
DEF EYE Viewpoint { position 0 1.6 10 }
DEF SENSOR ProximitySensor { size 1000 1000 1000 }
Transform { translation 0 -1 0 children Shape { geometry Box { size 100 2 100 } } }
Transform { translation 0 0 -1 children Shape { geometry Box { size 100 10 2 } } }
)");
        writeFile(there, replaced(readFile(file), "0 1.6 10", "0 1.6 .25"));
    }
    static std::string replaced(std::string text, const std::string& what, const std::string& by) {
        const std::size_t at = text.find(what);
        EXPECT_NE(at, std::string::npos);
        return text.replace(at, what.size(), by);
    }
    const std::string there = folder / "there.x3dv";
    const std::vector<std::string> walk{"--set", "key=down UP@0.5", "--set", "key=up UP@9"};
    Outcome with(std::vector<std::string> arguments) {
        arguments.insert(arguments.end(), walk.begin(), walk.end());
        return rtsg(arguments);
    }
};

TEST_F(Wanderer, StopsBeforeTheWallThatRaysFind) {
    const Outcome outcome = with({"run", file, "--for", "10s", "--fps", "20", "--watch", "SENSOR.position_changed"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    std::vector<json> positions;
    std::istringstream lines(outcome.out);
    for (std::string line; std::getline(lines, line);) positions.push_back(json::parse(line));
    ASSERT_FALSE(positions.empty());
    const auto half = std::ranges::find_if(
        positions, [](const json& one) { return std::abs(one.at("t").get<double>() - 2.5) < 1e-6; });
    ASSERT_NE(half, positions.end());
    EXPECT_NEAR(half->at("value").at(2).get<double>(), 6, 1e-4) << "2 m/s for 2 s";
    EXPECT_NEAR(positions.back().at("value").at(1).get<double>(), 1.6, 1e-4);
    EXPECT_NEAR(positions.back().at("value").at(2).get<double>(), .25, 1e-4);
}

/// 23.4.4: the avatar's radius holds beside a pole of 4 cm, wherever it stands, and on the way round it.
TEST_F(Wanderer, KeepsItsRadiusFromAThinPole) {
    for (const double aside : {-.2, -.12, -.06, 0., .03, .06, .12, .18}) {
        const std::string pole = folder / "pole.x3dv";
        std::ostringstream text;
        text << R"(#X3D V4.0 utf8
PROFILE Full
DEF SENSOR ProximitySensor { size 1e5 1e5 1e5 }
NavigationInfo { type "WALK" avatarSize [ 0.25 1.6 0.75 ] }
Viewpoint { position 0 1.6 5 }
Transform { translation 0 -0.05 0 children Shape { geometry Box { size 50 0.1 50 } } }
Transform { translation )"
             << aside << " 1 0 children Shape { geometry Box { size 0.04 4 0.04 } } }\n";
        writeFile(pole, text.str());
        const Outcome outcome =
            with({"run", pole, "--for", "10s", "--fps", "20", "--watch", "SENSOR.position_changed"});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        std::istringstream lines(outcome.out);
        double nearest = INFINITY;
        for (std::string line; std::getline(lines, line);) {
            const json position = json::parse(line).at("value");
            const double x = std::max(0., std::abs(position.at(0).get<double>() - aside) - .02);
            const double z = std::max(0., std::abs(position.at(2).get<double>()) - .02);
            nearest = std::min(nearest, std::hypot(x, z));
        }
        EXPECT_GT(nearest, .25 - 1e-4) << aside;
        EXPECT_LT(nearest, .3) << "it was met: " << aside;
    }
}

/// 61 degrees and more are too steep.
TEST_F(Wanderer, ClimbsNoSlopeOfMoreThanSixtyDegrees) {
    for (const double degrees : {50., 58., 62., 66., 71.}) {
        const std::string slope = folder / "slope.x3dv";
        const double rise = 6 * std::tan(degrees * M_PI / 180);
        std::ostringstream text;
        text << "#X3D V4.0 utf8\nPROFILE Full\nDEF SENSOR ProximitySensor { size 1e5 1e5 1e5 }\n"
                "NavigationInfo { type \"WALK\" }\nViewpoint { position 0 1.6 4 }\n"
                "Shape { geometry IndexedFaceSet { solid FALSE coord Coordinate { point [ -9 0 9, 9 0 9, 9 0 0, -9 0 "
                "0, 9 "
             << rise << " -6, -9 " << rise << " -6 ] } coordIndex [ 0 1 2 3 -1 3 2 4 5 -1 ] } }\n";
        writeFile(slope, text.str());
        const Outcome outcome =
            with({"run", slope, "--for", "9s", "--fps", "30", "--watch", "SENSOR.position_changed"});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        std::istringstream lines(outcome.out);
        double highest = 0;
        for (std::string line; std::getline(lines, line);)
            highest = std::max(highest, json::parse(line).at("value").at(1).get<double>());
        if (degrees < 60)
            EXPECT_GT(highest, 3) << degrees;
        else
            EXPECT_LT(highest, 1.6 + .8 + .1) << degrees;
    }
}

/// The wheel shows the box larger, though the eye comes no nearer.
TEST_F(Wanderer, EnlargesAParallelViewByTheWheel) {
    const std::string ortho = folder / "ortho.x3dv", box = folder / "box.x3dv";
    const std::string shape =
        "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } } geometry "
        "Box { size 2 2 8 } }\n";
    const std::string head = "#X3D V4.0 utf8\nPROFILE Full\nNavigationInfo { type \"EXAMINE\" }\n";
    writeFile(ortho, head + "OrthoViewpoint { fieldOfView [ -4 -4 4 4 ] }\n" + shape);
    writeFile(box, head + "OrthoViewpoint { fieldOfView [ -2.36196 -2.36196 2.36196 2.36196 ] }\n" + shape);
    const auto render = [&](const std::string& scene, const std::string& out, std::vector<std::string> more) {
        std::vector<std::string> arguments{"render", scene, "-o", out, "--size", "64x48", "--time", "1s"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readFile(out);
    };
    const std::string still = render(ortho, folder / "still.png", {});
    const std::string near = render(ortho, folder / "near.png", {"--set", "wheel=0 -5@0.2"});
    EXPECT_NE(still, near);
    EXPECT_EQ(near, render(box, folder / "like.png", {})) << ".9 to the fifth of the field of view";
}

TEST_F(Wanderer, PicturesAreFromThere) {
    const auto render = [&](const std::string& scene, const std::string& out, bool walks) {
        std::vector<std::string> arguments{"render", scene, "-o", out, "--size", "64x48", "--time", "9.5s"};
        const Outcome outcome = walks ? with(arguments) : rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readFile(out);
    };
    const std::string start = render(file, folder / "start.png", false);
    const std::string walked = render(file, folder / "walked.png", true);
    EXPECT_NE(walked, start);
    EXPECT_EQ(walked, render(there, folder / "there.png", false)) << "as from a viewpoint that stands there";
}

TEST_F(Wanderer, LogsAndReplaysFollowWithoutGeometry) {
    const std::string log = folder / "walk.rlog", back = folder / "back.x3dv";
    ASSERT_EQ(with({"record", file, "-o", log, "--for", "10s"}).status, 0);
    const Outcome verified = rtsg({"replay", log, "--verify", "--json"});
    EXPECT_EQ(verified.status, 0) << verified.err;
    EXPECT_EQ(rtsg({"replay", log, "--render", folder / "replayed.png", "--size", "64x48"}).status, 0);
    EXPECT_EQ(rtsg({"replay", log, "--rerun", file}).status, 0);
    writeFile(there, replaced(readFile(file), "DEF EYE", "WorldInfo { title \"one more\" } DEF EYE"));
    const Outcome grown = rtsg({"replay", log, "--rerun", there, "--field", "SENSOR.*", "--ignore", "initial"});
    EXPECT_EQ(grown.status, 0) << "the viewpoint has another number: " << grown.err;
    EXPECT_EQ(rtsg({"replay", log, "--save", back}).status, 0);
    EXPECT_THAT(readFile(back), HasSubstr("0 1.6 10")) << "the author's viewpoint stays";
}

}  // namespace
}  // namespace rtsg::test
