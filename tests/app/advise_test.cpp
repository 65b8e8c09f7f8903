// rtsg advise as a script uses it, and what its faults and interruptions leave behind.
#include <filesystem>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Advise : public CommandLine {};

TEST_F(Advise, SaysWhatSettingsCostAndWritesAPageAndAPlan) {
    const std::string page = folder / "advice.html", plan = folder / "plan.txt";
    const Outcome outcome = rtsg({"advise", file, "--for", "pictures,mirror", "--size", "96x64", "--time", "8s",
                                  "--json", "-o", page, "--plan", plan});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    ASSERT_EQ(report.at("tables").size(), 2U);
    EXPECT_EQ(report.at("tables").at(0).at("for"), "pictures");
    EXPECT_EQ(report.at("tables").at(1).at("for"), "mirror");
    for (const json& table : report.at("tables")) {
        EXPECT_GT(table.at("trials").size(), 5U);
        for (const json& trial : table.at("trials")) EXPECT_EQ(trial.at("costs").size(), table.at("cost_units").size());
    }
    EXPECT_TRUE(report.at("missing").empty());
    EXPECT_THAT(readFile(page), HasSubstr("</html>"));
    EXPECT_THAT(readFile(plan), HasSubstr("render --integrator "));
}

TEST_F(Advise, ReadsALog) {
    const std::string log = folder / "session.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "1s"}).status, 0);
    const Outcome outcome = rtsg({"advise", log, "--for", "mirror", "--time", "5s", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(json::parse(outcome.out).at("tables").at(0).at("trials").size(), 9U);
}

TEST_F(Advise, StatusZeroOnlyIfAllAskedForIsThere) {
    const Outcome touch = rtsg({"advise", file, "--for", "mirror,touch", "--time", "5s"});
    EXPECT_EQ(touch.status, 1);
    EXPECT_THAT(touch.err, HasSubstr("error: missing: touch: not measured"));
    EXPECT_THAT(touch.out, HasSubstr("--coding smallest"));
}

TEST_F(Advise, NamesWhatIsWrong) {
    const std::string bad = folder / "bad.x3dv";
    writeFile(bad, "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry ] }\n");
    const Outcome scene = rtsg({"advise", bad, "--for", "mirror", "--time", "2s"});
    EXPECT_EQ(scene.status, 1);
    EXPECT_THAT(scene.err, HasSubstr("bad.x3dv:3:18: error:"));
    const Outcome absent = rtsg({"advise", folder / "none.x3dv"});
    EXPECT_EQ(absent.status, 1);
    const Outcome sense = rtsg({"advise", file, "--for", "pictures,smell"});
    EXPECT_EQ(sense.status, 2);
    EXPECT_THAT(sense.err, HasSubstr("--for: there is no \"smell\"; there are: pictures, sound, rooms, mirror, touch"));
    EXPECT_EQ(rtsg({"advise", file, "--time", "0s"}).status, 2);
    EXPECT_EQ(rtsg({"advise", file, "-o", folder / "advice.png"}).status, 2);
    EXPECT_EQ(rtsg({"advise", file, "--size", "0x5"}).status, 2);
    writeFile(folder / "broken.rlog", "no log");
    EXPECT_EQ(rtsg({"advise", folder / "broken.rlog", "--time", "2s"}).status, 1);
}

TEST_F(Advise, AnInterruptionLeavesNothingHalfWritten) {
    const std::string page = folder / "advice.html", plan = folder / "plan.txt";
    writeFile(page, "old");
    Program program({"advise", file, "--for", "pictures", "--time", "100s", "-o", page, "--plan", plan}, streams());
    std::this_thread::sleep_for(std::chrono::seconds(2));
    program.signal(SIGINT);
    const Outcome outcome = program.wait();
    EXPECT_EQ(outcome.status, 1) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr("interrupted: nothing was written"));
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(readFile(page), "old");
    EXPECT_FALSE(std::filesystem::exists(plan));
    for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(page).parent_path()))
        EXPECT_FALSE(entry.path().filename().string().starts_with(".rtsg-")) << entry.path();
}

TEST_F(Advise, PlansAndBudgetsChooseTheSettingsOfRender) {
    const std::string plan = folder / "plan.txt", picture = folder / "picture.png";
    writeFile(plan, "# by hand\nrender --integrator path --spp 3\nlisten --quality .5\n");
    const Outcome planned = rtsg({"render", file, "-o", picture, "--size", "64x48", "--plan", plan, "--json"});
    ASSERT_EQ(planned.status, 0) << planned.err;
    EXPECT_EQ(json::parse(planned.out).at("spp"), 3);
    const Outcome typed =
        rtsg({"render", file, "-o", picture, "--size", "64x48", "--plan", plan, "--spp", "2", "--json"});
    EXPECT_EQ(json::parse(typed.out).at("spp"), 2) << "what is typed counts";
    writeFile(plan, "render --spp many\n");
    const Outcome bad = rtsg({"render", file, "-o", picture, "--plan", plan});
    EXPECT_EQ(bad.status, 1);
    EXPECT_THAT(bad.err, HasSubstr("plan.txt:1:8: error: \"--spp many\" is no option of render"));
    const Outcome budget = rtsg({"render", file, "-o", picture, "--size", "64x48", "--budget", "3s", "--json"});
    ASSERT_EQ(budget.status, 0) << budget.err;
    const json report = json::parse(budget.out);
    EXPECT_GT(report.at("spp").get<double>(), 1);
    EXPECT_TRUE(report.contains("expected_error"));
    EXPECT_EQ(rtsg({"render", file, "-o", picture, "--budget", "3s", "--spp", "2"}).status, 2);
    EXPECT_EQ(rtsg({"render", file, "-o", picture, "--budget", "0s"}).status, 2);
}

}  // namespace
}  // namespace rtsg::test
