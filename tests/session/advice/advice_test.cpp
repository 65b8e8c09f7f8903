// Advice: which settings are beaten, plans and their faults, and trials that keep to their time.
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <rtsg/documents/loader.h>
#include <rtsg/session/advice.h>

#include "support/temp_folder.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

std::vector<bool> beatenOf(std::vector<Trial> trials) {
    markBeaten(trials);
    std::vector<bool> beaten;
    for (const Trial& trial : trials) beaten.push_back(trial.beaten);
    return beaten;
}

Trial trial(std::vector<double> costs, double error, double interval = 0) {
    return {"", std::move(costs), error, interval};
}

TEST(Advice, MarksWhatAnotherBeatsInBoth) {
    EXPECT_EQ(beatenOf({trial({1}, .5), trial({2}, .2), trial({3}, .3)}), (std::vector{false, false, true}));
    EXPECT_EQ(beatenOf({trial({1}, .5), trial({1}, .2)}), (std::vector{true, false})) << "for the same cost";
    EXPECT_EQ(beatenOf({trial({2}, .2), trial({1}, .2)}), (std::vector{true, false})) << "with the same error, surely";
    EXPECT_EQ(beatenOf({trial({1}, .2), trial({1}, .2)}), (std::vector{false, false})) << "equal in both";
    EXPECT_EQ(beatenOf({}), std::vector<bool>());
    EXPECT_EQ(beatenOf({trial({1}, .2)}), std::vector{false}) << "not by itself";
}

TEST(Advice, MarksNothingThatIntervalsLeaveOpen) {
    EXPECT_EQ(beatenOf({trial({2}, .3, .1), trial({1}, .2, .05)}), (std::vector{false, false})) << ".25 is in both";
    EXPECT_EQ(beatenOf({trial({2}, .3, .04), trial({1}, .2, .05)}), (std::vector{true, false}));
    const double infinite = std::numeric_limits<double>::infinity(), none = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(beatenOf({trial({2}, .3, infinite), trial({1}, .2)}), (std::vector{false, false}));
    EXPECT_EQ(beatenOf({trial({2}, none), trial({1}, .2)}), (std::vector{false, false})) << "no error was measured";
    EXPECT_EQ(beatenOf({trial({2}, .3), trial({1}, none)}), (std::vector{false, false}));
}

TEST(Advice, MarksOnlyWhatIsWorseInEveryCost) {
    EXPECT_EQ(beatenOf({trial({100, 1}, 0), trial({50, 2}, 0)}), (std::vector{false, false}));
    EXPECT_EQ(beatenOf({trial({100, 2}, 0), trial({50, 2}, 0)}), (std::vector{true, false}));
    EXPECT_EQ(beatenOf({trial({100, 2}, 0), trial({50, 1}, .001)}), (std::vector{false, false}));
}

TEST(Advice, ErrorsOfPathsFallWithAPowerOfTheSamples) {
    const PathCost path{.8, .5, 0, .5, .1}, even{.8, .75, 0, .5, .1};
    EXPECT_EQ(path.samplesFor(.1), 64);
    EXPECT_EQ(path.samplesFor(.2), 16);
    EXPECT_EQ(path.samplesFor(2), 1);
    EXPECT_EQ(even.samplesFor(.1), 16);
    EXPECT_DOUBLE_EQ(even.errorAt(16), .1);
    EXPECT_DOUBLE_EQ(path.costOf(64), 6.9);
}

class AdvicePlan : public testing::Test {
  protected:
    Result<Plan> read(const std::string& text) {
        std::ofstream(file, std::ios::binary) << text;
        return Plan::read(file);
    }
    TempFolder folder;
    const std::string file = folder / "plan.txt";
};

TEST_F(AdvicePlan, IsReadAsItWasWritten) {
    Plan plan;
    plan.integrator = "path", plan.samples = 77, plan.linear = true, plan.quality = .5, plan.diffraction = 1;
    const auto again = read(plan.toText("my\nhall.x3dv"));
    ASSERT_TRUE(again) << again.error().format();
    EXPECT_EQ(again->integrator, "path");
    EXPECT_EQ(again->samples, 77);
    EXPECT_TRUE(again->linear);
    EXPECT_EQ(again->quality, .5);
    EXPECT_EQ(again->diffraction, 1);
    const auto empty = read("# nothing\n\n");
    ASSERT_TRUE(empty);
    EXPECT_FALSE(empty->integrator || empty->quality);
}

TEST_F(AdvicePlan, NamesTheLineAndColumnOfAFault) {
    const struct {
        const char *text, *error;
    } cases[] = {
        {"# a\nrender --integrator path --spp 0\n", ":2:26: error: \"--spp 0\" is no option of render"},
        {"render --integrator raster\n", ":1:8: error: \"--integrator raster\" is no option of render"},
        {"listen --quality nan\n", ":1:8: error: \"--quality nan\" is no option of listen"},
        {"listen --spp 4\n", ":1:8: error: \"--spp 4\" is no option of listen"},
        {"render --spp\n", ":1:8: error: \"--spp \" is no option of render"},
        {"\n  serve --coding raw\n", ":2:3: error: a line of a plan begins with render or listen, not \"serve\""},
    };
    for (const auto& [text, error] : cases) {
        const auto plan = read(text);
        ASSERT_FALSE(plan) << text;
        EXPECT_THAT(plan.error().format(), HasSubstr(file + error));
    }
    EXPECT_THAT(Plan::read(folder / "none.txt").error().format(),
                HasSubstr("none.txt: error: the plan cannot be read"));
}

/// A lamp and its light in a box that is open towards the eye, and a block that moves.
constexpr const char* kRoom = R"(#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { headlight FALSE }
Viewpoint { position 0 1 3.6 fieldOfView .7 }
Shape { appearance Appearance { material Material { diffuseColor .7 .7 .7 } } geometry IndexedFaceSet { solid FALSE
  coord Coordinate { point [ -1 0 1, 1 0 1, 1 0 -1, -1 0 -1, -1 2 1, 1 2 1, 1 2 -1, -1 2 -1 ] }
  coordIndex [ 0 1 2 3 -1, 4 5 6 7 -1, 3 2 6 7 -1, 0 3 7 4 -1, 1 2 6 5 -1 ] } }
Shape { appearance Appearance { material UnlitMaterial { emissiveColor 8 8 8 } } geometry IndexedFaceSet { solid FALSE
  coord Coordinate { point [ -.3 1.99 .3, .3 1.99 .3, .3 1.99 -.3, -.3 1.99 -.3 ] } coordIndex [ 0 1 2 3 -1 ] } }
DEF BLOCK Transform { children Shape { geometry Box { size .3 .3 .3 } } }
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 .2 0, .5 .2 .1 ] }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BLOCK.set_translation
)";

class AdviceTrials : public testing::Test {
  protected:
    void SetUp() override {
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, kRoom, diagnostics));
        ASSERT_EQ(diagnostics.errors(), 0U);
        options.document = "room.x3dv";
        options.image.settings.width = 96, options.image.settings.height = 64;
        options.runTo = [this](double t) {
            scene.newFrame(t);
            return true;
        };
        // Each look at the clock takes so long, whatever the machine does.
        options.now = [this] { return clock += tick; };
        options.seconds = 1e6;
    }
    Scene scene;
    AdviceOptions options;
    double clock = 0, tick = 1e-4;
};

TEST_F(AdviceTrials, FindTheLightThatWhittedMissesAndTheErrorOfPaths) {
    SharedWorld world(scene);
    options.senses = {Sense::pictures};
    options.seconds = 1;
    const auto advice = advise(world, options);
    ASSERT_TRUE(advice) << advice.error().format();
    EXPECT_TRUE(advice->missing.empty());
    ASSERT_EQ(advice->tables.size(), 1U);
    const AdviceTable& table = advice->tables.front();
    const auto errorOf = [&](const std::string& setting) {
        for (const Trial& t : table.trials)
            if (t.setting == setting) return t.error;
        return std::numeric_limits<double>::quiet_NaN();
    };
    // Without light between surfaces the room is nearly black.
    EXPECT_GT(errorOf("--integrator whitted --spp 16"), .3);
    EXPECT_THAT(table.sentences,
                testing::Contains(testing::HasSubstr("of this picture's light comes from other surfaces")));
    const double few = errorOf("--integrator path --spp 1"), more = errorOf("--integrator path --spp 16");
    EXPECT_GT(few / more, 2.5) << "4 if samples are independent";
    EXPECT_LT(few / more, 16);
    const json parsed = json::parse(advice->toJson());
    EXPECT_EQ(parsed.at("tables").at(0).at("trials").size(), table.trials.size());
    EXPECT_THAT(advice->toHtml(), HasSubstr("<svg"));
    EXPECT_THAT(advice->toText(),
                HasSubstr("For 5 %: rtsg render room.x3dv -o OUT.png --size 96x64 --integrator path --spp "));
}

TEST_F(AdviceTrials, CompareCodingsAndFindWhatIsLossy) {
    SharedWorld world(scene);
    options.senses = {Sense::mirror};
    const auto advice = advise(world, options);
    ASSERT_TRUE(advice) << advice.error().format();
    ASSERT_EQ(advice->tables.size(), 1U);
    const std::vector<Trial>& trials = advice->tables.front().trials;
    ASSERT_EQ(trials.size(), 9U);
    for (const Trial& t : trials) {
        EXPECT_GT(t.costs[0], 0) << t.setting;
        const bool lossy = t.setting.contains("lossy");
        EXPECT_EQ(t.error > 0, lossy) << t.setting;
        if (lossy) {
            EXPECT_LE(t.error, std::stod(t.setting.substr(t.setting.find("--error ") + 8))) << t.setting;
        }
    }
    EXPECT_GT(trials[0].costs[0], trials[2].costs[0]) << "raw takes more bytes than smallest";
}

TEST_F(AdviceTrials, SayWhatTheTimeDoesNotSufficeFor) {
    SharedWorld world(scene);
    options.senses = {Sense::pictures, Sense::touch, Sense::rooms};
    tick = 1, options.seconds = 2;
    const auto advice = advise(world, options);
    ASSERT_TRUE(advice) << advice.error().format();
    EXPECT_TRUE(advice->tables.empty());
    EXPECT_THAT(advice->missing, testing::UnorderedElementsAre(
                                     testing::StartsWith("pictures: "), testing::StartsWith("touch: not measured"),
                                     "rooms: there is no source of sound that walls reflect"));
}

TEST_F(AdviceTrials, EndWhenTheyAreCancelled) {
    SharedWorld world(scene);
    int left = 40;
    options.goOn = [&] { return --left > 0; };
    const auto advice = advise(world, options);
    ASSERT_FALSE(advice);
    EXPECT_EQ(advice.error().text, "cancelled");
}

TEST_F(AdviceTrials, ABudgetTooSmallForTrialsGivesTheFastestPicture) {
    SharedWorld world(scene);
    scene.newFrame(0);
    LightRenderer light(world);
    const auto choice = chooseFor(light, options.image, 1e-6);
    ASSERT_TRUE(choice);
    EXPECT_EQ(choice->best.settings.integrator, Integrator::whitted);
    EXPECT_EQ(choice->best.settings.samplesPerPixel, 1);
    EXPECT_TRUE(std::isnan(choice->expectedError));
    const auto larger = chooseFor(light, options.image, 4);
    ASSERT_TRUE(larger);
    EXPECT_EQ(larger->best.settings.integrator, Integrator::path);
    EXPECT_GT(larger->best.settings.samplesPerPixel, 4);
    EXPECT_LT(larger->expectedError, .5);
}

}  // namespace
}  // namespace rtsg::test
