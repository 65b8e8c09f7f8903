// A recorded session as a test from the command line: rtsg record --set, rtsg replay --rerun, --expect-..., --update.
#include "program.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class ReplayAsTest : public CommandLine {
  protected:
    void SetUp() override {
        CommandLine::SetUp();
        const Outcome made = rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "20", "--set",
                                   "CLOCK.enabled=FALSE@0.5", "--set", "FLAG.set_boolean=TRUE@0.7", "--json"});
        ASSERT_EQ(made.status, 0) << made.err;
        ASSERT_EQ(json::parse(made.out)["frames"], 21);
    }
    Outcome rerun(std::vector<std::string> more = {}) {
        std::vector<std::string> arguments = {"replay", "--json", log, "--rerun", file};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return rtsg(arguments);
    }
    const std::vector<std::string> small = {"--size", "48x32", "--spp", "1"};
    std::vector<std::string> withPicture(std::vector<std::string> more) const {
        more.insert(more.end(), small.begin(), small.end());
        more.insert(more.end(), {"--expect-picture", picture});
        return more;
    }

    const std::string log = folder / "a.rlog", picture = folder / "a.png", sound = folder / "a.wav";
};

TEST_F(ReplayAsTest, TheSameScenePasses) {
    const Outcome same = rerun();
    EXPECT_EQ(same.status, 0) << same.err;
    const json report = json::parse(same.out);
    EXPECT_EQ(report["frames"], report["verified"]);
    EXPECT_TRUE(report["passed"]);
    EXPECT_TRUE(report["first_divergence"].is_null());
}

TEST_F(ReplayAsTest, AnotherSceneFailsNamingWhatIsOther) {
    writeFile(file, scene("3"));
    const Outcome other = rerun();
    EXPECT_EQ(other.status, 1);
    const json report = json::parse(other.out);
    EXPECT_FALSE(report["passed"]);
    EXPECT_EQ(report["first_divergence"]["node"], "PATH");
    EXPECT_EQ(report["first_divergence"]["field"], "keyValue");
    EXPECT_THAT(other.err, HasSubstr("PATH.keyValue: recorded [0 0 0, 2 0 0], now [0 0 0, 3 0 0]"));
    // Recorded anew, it passes, and the old one no longer does.
    EXPECT_EQ(rerun({"--update"}).status, 0);
    EXPECT_EQ(rerun().status, 0);
    writeFile(file, scene());
    EXPECT_EQ(rerun().status, 1);
}

TEST_F(ReplayAsTest, PicturesAndSoundsAreComparedWithinTolerances) {
    const Outcome none = rerun(withPicture({}));
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("a.png"));
    const std::vector<std::string> heard = {"--expect-sound", sound, "--rays", "2000", "--stereo"};
    const auto both = [&](std::vector<std::string> more) {
        more.insert(more.end(), heard.begin(), heard.end());
        return withPicture(std::move(more));
    };
    ASSERT_EQ(rerun(both({"--update"})).status, 0);
    const Outcome same = rerun(both({}));
    EXPECT_EQ(same.status, 0) << same.err;
    // A picture of another moment, and a sound that is another: the log alone is replayed, so that only they differ.
    ASSERT_EQ(
        rtsg({"replay", "--json", log, "--seek", "0.1s", "--render", picture, "--size", "48x32", "--spp", "1"}).status,
        0);
    const Outcome moved = rerun(both({}));
    EXPECT_EQ(moved.status, 1);
    EXPECT_THAT(moved.err, HasSubstr("differs from " + picture + ": rmse"));
    EXPECT_EQ(rerun(both({"--picture-tolerance", "10"})).status, 0);
}

TEST_F(ReplayAsTest, OptionsThatDoNotGoTogetherAreWrongUsage) {
    EXPECT_EQ(rtsg({"replay", "--json", log, "--update"}).status, 2);
    EXPECT_EQ(rerun(withPicture({"--render", folder / "b.png"})).status, 2);
    EXPECT_EQ(rtsg({"record", file, "-o", log, "--force", "--set", "NOBODY.on=TRUE@1"}).status, 2);
}

}  // namespace
}  // namespace rtsg::test
