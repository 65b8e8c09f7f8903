// Replay tests of files: a scene that runs as recorded passes, one that has changed fails and says where.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/session/replay_tests.h>
#include <rtsg/session/running_scene.h>
#include <rtsg/sync/log_recorder.h>

#include "session/recorded_notices.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

class ReplayTestsTest : public testing::Test {
  protected:
    ReplayTestsTest() {
        write("0 0 0, 4 0 0");
        RunningScene running(scene, Resources::ofFile(scene), {}, notices.context());
        EXPECT_TRUE(running.load());
        auto recorder = LogRecorder::start(running.scene(), log, {}, LogRecorder::WhenBehind::wait);
        EXPECT_TRUE(recorder);
        running.run({.seconds = 1, .framesPerSecond = 10}, "recording",
                    [](std::uint64_t, const ChangeSet&) { return true; });
        EXPECT_TRUE((*recorder)->stop());
        options.rerun = scene;
        options.junit = folder / "result.xml";
        options.page = folder / "page.html";
        outputs.context = notices.context();
        outputs.image.settings.width = 32, outputs.image.settings.height = 24;
    }
    void write(const std::string& path) const {
        std::ofstream(scene)
            << "#X3D V4.0 utf8\nPROFILE Immersive\nDEF T Transform { children Shape { geometry Box { } } }\n"
               "DEF C TimeSensor { cycleInterval 1 loop TRUE }\n"
               "DEF P PositionInterpolator { key [0 1] keyValue ["
            << path
            << "] }\nROUTE C.fraction_changed TO P.set_fraction\n"
               "ROUTE P.value_changed TO T.set_translation\n";
    }
    ReplayTestRun run() { return runReplayTest(log, options, outputs, Resources::ofFile(scene)); }

    test::TempFolder folder;
    const std::string scene = folder / "scene.x3dv", log = folder / "session.rlog";
    test::RecordedNotices notices;
    ReplayTestOptions options;
    OutputOptions outputs;
};

TEST_F(ReplayTestsTest, PassAsRecorded) {
    const ReplayTestRun passed = run();
    ASSERT_FALSE(passed.failure) << passed.failure->format();
    EXPECT_TRUE(passed.outcome.passed());
    EXPECT_GE(passed.outcome.report.frames, 11u);
    EXPECT_EQ(passed.outcome.report.verified, passed.outcome.report.frames);
    EXPECT_EQ(passed.outcome.name, "session");
    std::ofstream(options.page) << "of an earlier failure";
    ASSERT_TRUE(writeReports(options, passed.outcome, notices.context()));
    EXPECT_TRUE(std::filesystem::exists(options.junit));
    EXPECT_FALSE(std::filesystem::exists(options.page));
    EXPECT_EQ(notices.said(), "");
}

TEST_F(ReplayTestsTest, FailWhereTheSceneHasChanged) {
    write("0 0 0, 5 0 0");
    const ReplayTestRun failed = run();
    ASSERT_FALSE(failed.failure) << failed.failure->format();
    EXPECT_FALSE(failed.outcome.passed());
    ASSERT_TRUE(failed.outcome.report.divergence);
    EXPECT_TRUE(failed.outcome.differing) << "no picture was expected, so the page shows the difference";
    ASSERT_TRUE(writeReports(options, failed.outcome, notices.context()));
    EXPECT_TRUE(std::filesystem::exists(options.page));
    EXPECT_NE(notices.said().find("page.html shows what differed"), std::string::npos) << notices.said();
}

TEST_F(ReplayTestsTest, PicturesAreCompared) {
    options.expectPicture = folder / "expected.pfm";
    options.update = true;
    ASSERT_FALSE(run().failure);
    ASSERT_TRUE(std::filesystem::exists(options.expectPicture));
    options.update = false;
    std::string created;
    {
        const ReplayTestRun passed = run();
        EXPECT_TRUE(passed.outcome.passed());
        created = passed.outcome.createdPicture;
        EXPECT_TRUE(std::filesystem::exists(created));
    }
    EXPECT_FALSE(std::filesystem::exists(created)) << "it gets its name at the end";
    std::filesystem::remove(actualName(options.expectPicture));
}

TEST_F(ReplayTestsTest, CannotRunWithoutTheScene) {
    std::filesystem::remove(scene);
    const ReplayTestRun failed = run();
    ASSERT_TRUE(failed.failure);
    EXPECT_TRUE(failed.isReported);
    EXPECT_NE(notices.said(), "");
    EXPECT_FALSE(failed.outcome.passed());
}

TEST_F(ReplayTestsTest, CountFromTheLogsStart) {
    EXPECT_DOUBLE_EQ(logStart(log), SceneStart().time);
    EXPECT_EQ(logStart(folder / "none.rlog"), 0);
    Divergence divergence;
    divergence.time = 12.5;
    const auto later = fromStart(divergence, 10);
    EXPECT_DOUBLE_EQ(later->time, 2.5);
}

}  // namespace
}  // namespace rtsg
