// Pictures, sound and documents of a scene while it runs.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/running_scene.h>

#include "session/recorded_notices.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

class OutputMakerTest : public testing::Test {
  protected:
    OutputMakerTest() {
        std::ofstream(file) << "#X3D V4.0 utf8\nPROFILE Immersive\nDirectionalLight { }\nViewpoint { }\n"
                               "DEF T Transform { children Shape { geometry Box { } } }\n"
                               "DEF C TimeSensor { cycleInterval 1 loop TRUE }\n"
                               "DEF P PositionInterpolator { key [0 1] keyValue [0 0 0, 4 0 0] }\n"
                               "ROUTE C.fraction_changed TO P.set_fraction\n"
                               "ROUTE P.value_changed TO T.set_translation\n";
        options.render = folder / "p%02d.pfm";
        options.picturesPerSecond = 4;
        options.seconds = 1;
        options.image.settings.width = 32, options.image.settings.height = 24;
        options.image.settings.threads = 1;
        options.context = notices.context();
    }
    OutputReport run() {
        RunningScene running(file, Resources::ofFile(file), {}, notices.context());
        EXPECT_TRUE(running.load()) << notices.said();
        std::unique_ptr<OutputMaker> outputs;
        running.run({.seconds = 1, .framesPerSecond = 20}, "running", [&](std::uint64_t, const ChangeSet&) {
            if (!outputs) {
                auto created = makeOutputs(running.world(), options, running.resources());
                if (!created) result = std::unexpected(created.error());
                if (!created) return false;
                outputs = std::move(*created);
            }
            return outputs->frame().has_value();
        });
        if (!outputs) return {};
        result = outputs->finish();
        return outputs->report();
    }
    static std::string bytes(const std::string& name) {
        std::ifstream in(name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

    test::TempFolder folder;
    const std::string file = folder / "scene.x3dv";
    test::RecordedNotices notices;
    OutputOptions options;
    Result<> result;
};

TEST_F(OutputMakerTest, PicturesAreAtEvenDistances) {
    options.save = folder / "last.x3dv";
    const OutputReport report = run();
    ASSERT_TRUE(result) << result.error().format();
    EXPECT_EQ(report.pictureTimes, (std::vector<double>{0, .25, .5, .75}));
    EXPECT_EQ(report.missing, "");
    EXPECT_EQ(notices.said(), "");
    for (int k = 0; k < 4; ++k) EXPECT_FALSE(bytes(folder / ("p0" + std::to_string(k) + ".pfm")).empty()) << k;
    EXPECT_TRUE(bytes(folder / "p00.pfm") != bytes(folder / "p02.pfm")) << "the box moves";
    EXPECT_TRUE(bytes(options.save).starts_with("#X3D"));
}

TEST_F(OutputMakerTest, SoundIsAsLongAsAskedFor) {
    options.render.clear();
    options.listen = folder / "s.wav";
    const OutputReport report = run();
    ASSERT_TRUE(result) << result.error().format();
    EXPECT_DOUBLE_EQ(report.soundSeconds, 1);
    const auto sound = readSound(options.listen);
    ASSERT_TRUE(sound);
    EXPECT_EQ(sound->frames(), static_cast<std::size_t>(sound->sampleRate));
}

TEST_F(OutputMakerTest, InterruptedRunsNameWhatIsMissing) {
    notices.isInterrupted = true;
    options.save = folder / "last.x3dv";
    const OutputReport report = run();
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().text, "interrupted before its end: not written");
    EXPECT_EQ(report.missing, "4 of 4 pictures");
    EXPECT_FALSE(std::filesystem::exists(options.save));
}

TEST_F(OutputMakerTest, FilesThatTheSceneUsesAreKept) {
    std::ofstream(folder / "in.x3dv") << "#X3D V4.0 utf8\nPROFILE Immersive\nShape { geometry Sphere { } }\n";
    std::ofstream(file, std::ios::app) << "Inline { url \"in.x3dv\" }\n";
    options.save = folder / "in.x3dv";
    const std::string before = bytes(options.save);
    run();
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, kUsageCode);
    EXPECT_NE(result.error().text.find("--save: the scene uses "), std::string::npos) << result.error().text;
    EXPECT_TRUE(bytes(options.save) == before);
}

TEST_F(OutputMakerTest, LastFailureIsReportedAndTheFirstReturned) {
    const Result<> first =
        allOf(notices.context(), {[]() -> Result<> { return fail("one"); }, []() -> Result<> { return {}; },
                                  []() -> Result<> { return fail("two"); }});
    ASSERT_FALSE(first);
    EXPECT_EQ(first.error().text, "one");
    EXPECT_NE(notices.said().find("two"), std::string::npos);
    EXPECT_EQ(notices.said().find("one"), std::string::npos);
}

}  // namespace
}  // namespace rtsg
