// Irradiance as a script asks for it, against form factors: of curved lamps too, however small the error.
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;

struct Lamp {
    const char* geometry;
    double irradiance;  // 2 m below its middle
};
constexpr double kPi = std::numbers::pi;
const Lamp kLamps[] = {
    {"Disk2D { outerRadius .5 }", kPi * .25 / 4.25},
    {"Disk2D { innerRadius .3 outerRadius .5 }", kPi * (.25 / 4.25 - .09 / 4.09)},
    {"Sphere { radius .5 }", kPi * .25 / 4},
};

class Measure : public CommandLine {
  protected:
    std::string sceneOf(const Lamp& lamp) {
        const std::string path = folder / "lamp.x3dv";
        writeFile(path,
                  fmt::format("#X3D V4.0 utf8\nPROFILE Full\nTransform {{ translation 0 2 0 "
                              "rotation 1 0 0 1.5707963267949 children Shape {{ geometry {} appearance Appearance "
                              "{{ material Material {{ diffuseColor 0 0 0 emissiveColor 1 1 1 }} }} }} }}",
                              lamp.geometry));
        return path;
    }
};

TEST_F(Measure, CurvedLampsAreCutAsFinelyAsTheErrorNeeds) {
    for (const Lamp& lamp : kLamps)
        for (const char* error : {"0.01", "0.003", "0.001"}) {
            const Outcome outcome =
                rtsg({"measure", sceneOf(lamp), "--irradiance", "0,0,0,0,1,0", "--error", error, "--json"});
            ASSERT_EQ(outcome.status, 0) << outcome.err;
            EXPECT_EQ(outcome.err, "");
            const json report = json::parse(outcome.out);
            EXPECT_EQ(report.at("reached"), true);
            // Three standard errors, what is cut off among them.
            const double interval = report.at("luminous_ci95"), cut = report.at("luminous_cut");
            EXPECT_NEAR(report.at("luminous").get<double>(), lamp.irradiance, 3 / 1.96 * interval)
                << lamp.geometry << error;
            EXPECT_GT(cut, 0);
            EXPECT_LT(cut, std::stod(error) / 5 * lamp.irradiance);
        }
}

// The interval includes the light that chords cut off of a lamp. So it holds the truth in at least 95 of 100 cases,
// however small its other parts are; fewer than 27 of 32 have a probability of four in a thousand. This also holds for
// a ball half below the horizon, whose rim counts most there: E = L (arcsin s - s sqrt(1 - s^2)) with s its radius over
// its distance.
TEST_F(Measure, IntervalsHoldWhatCurvedLampsLackByTheirCut) {
    const double s = 1. / 3;
    const Lamp horizon{"Sphere { radius 1 }", std::asin(s) - s * std::sqrt(1 - s * s)};
    const struct {
        Lamp lamp;
        const char *position, *error;
    } cases[] = {
        {kLamps[0], "0,0,0,0,1,0", "0.01"}, {kLamps[0], "0,0,0,0,1,0", "0.002"}, {horizon, "3,2,0,0,1,0", "0.01"}};
    for (const auto& [lamp, position, error] : cases) {
        int inside = 0;
        for (int seed = 1; seed <= 32; ++seed) {
            const Outcome outcome = rtsg({"measure", sceneOf(lamp), "--irradiance", position, "--error", error,
                                          "--seed", std::to_string(seed), "--json"});
            ASSERT_EQ(outcome.status, 0) << outcome.err;
            const json report = json::parse(outcome.out);
            inside += std::abs(report.at("luminous").get<double>() - lamp.irradiance) <=
                      report.at("luminous_ci95").get<double>();
        }
        EXPECT_GE(inside, 27) << lamp.geometry << error;
    }
}

TEST_F(Measure, SaysWhereCurvesCannotBeCutFinelyEnough) {
    const Outcome outcome = rtsg({"measure", sceneOf(kLamps[0]), "--irradiance", "0,0,0,0,1,0", "--error", "1e-5"});
    EXPECT_EQ(outcome.status, 1) << "the error was not reached";
    EXPECT_THAT(outcome.err,
                testing::HasSubstr("error: missing: 0,0,0,0,1,0: curved lamps are cut too coarsely for the "
                                   "error 1e-05: up to 0.0082 % of what comes there may be missing"));
}

// A ball a hundred times as bright as the panel that hides it lacks nothing by its cut; once it looks out behind the
// panel, its whole cut counts.
TEST_F(Measure, CurvedLampsThatAreHiddenLackNothing) {
    constexpr double kForm = .2394564;  // of a square of 2 x 2, 2 m off its middle
    const std::string path = folder / "hidden.x3dv";
    const auto measured = [&](double aside) {
        writeFile(path, fmt::format(R"(#X3D V4.0 utf8
PROFILE Full
Transform {{ translation 0 2 0 rotation 1 0 0 1.5707963267949 children Shape {{
  geometry Rectangle2D {{ size 2 2 }}
  appearance Appearance {{ material Material {{ diffuseColor 0 0 0 emissiveColor 1 1 1 }} }} }} }}
Transform {{ translation {} 8 0 children Shape {{ geometry Sphere {{ radius 3 }}
  appearance Appearance {{ material UnlitMaterial {{ emissiveColor 100 100 100 }} }} }} }}
)",
                                    aside));
        return rtsg({"measure", path, "--irradiance", "0,0,0,0,1,0", "--samples", "65536", "--json"});
    };
    const Outcome hidden = measured(0), seen = measured(1.2);
    ASSERT_EQ(hidden.status, 0) << hidden.err;
    const json report = json::parse(hidden.out);
    EXPECT_NEAR(report.at("luminous").get<double>(), kPi * kForm, 3 / 1.96 * report.at("luminous_ci95").get<double>());
    const double ofHidden = report.at("luminous_cut"), ofSeen = json::parse(seen.out).at("luminous_cut");
    EXPECT_LT(ofHidden, .01 / 5 * kPi * kForm);
    EXPECT_GT(ofSeen, 20 * ofHidden);
}

TEST_F(Measure, NamesLightsThatDoNotShineOnThePlace) {
    const std::string path = folder / "group.x3dv";
    writeFile(path,
              "#X3D V4.0 utf8\nPROFILE Full\nDirectionalLight { direction 0 -1 0 }\nGroup { children [\n"
              "  DEF LAMP DirectionalLight { direction 0 -1 0 }\n  Shape { geometry Box { } } ] }\n");
    const Outcome outcome = rtsg({"measure", path, "--irradiance", "0,5,0,0,1,0", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.err, testing::HasSubstr("group.x3dv:5:3: warning: DirectionalLight LAMP is of a group"));
    EXPECT_NEAR(json::parse(outcome.out).at("luminous").get<double>(), kPi, .01) << "the one of the scene alone";
    EXPECT_EQ(json::parse(outcome.out).at("missing"), 0);
}

}  // namespace
}  // namespace rtsg::test
