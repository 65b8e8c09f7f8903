// A scene's file that runs: events with their times, edits of the file, and what is said of both.
#include <fstream>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/session/running_scene.h>

#include "session/recorded_notices.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

bool isOfCaller(const Result<>& result) {
    return !result && result.error().code == kUsageCode;
}

class RunningSceneTest : public testing::Test {
  protected:
    void write(const std::string& text) const { std::ofstream(file) << text; }
    RunningScene& run(bool follows = false) {
        SceneStart start;
        start.time = 100;
        running = std::make_unique<RunningScene>(file, Resources::ofFile(file), start, notices.context());
        if (follows) {
            EXPECT_TRUE(running->followEdits());
        }
        return *running;
    }
    Vec3f translation() const {
        const Scene& scene = running->scene();
        return scene.node(scene.findName("T")).get(x3d::Transform::translation);
    }

    test::TempFolder folder;
    const std::string file = folder / "scene.x3dv";
    test::RecordedNotices notices;
    std::unique_ptr<RunningScene> running;
};

constexpr const char* kScene = "#X3D V4.0 utf8\nPROFILE Interchange\nDEF T Transform { translation 1 0 0 }\n";

TEST_F(RunningSceneTest, EventsComeWhenTheyAreDue) {
    write(kScene);
    ASSERT_TRUE(run().load()) << notices.said();
    ASSERT_TRUE(running->inject({"T.translation=0 2 0@0.5"}, 1));
    running->frame(0.4);
    EXPECT_EQ(translation(), Vec3f(1, 0, 0));
    running->frame(0.5);
    EXPECT_EQ(translation(), Vec3f(0, 2, 0));
    EXPECT_DOUBLE_EQ(running->scene().now(), 100.5);
    EXPECT_EQ(notices.said(), "");
    EXPECT_EQ(notices.missing, 0);
}

TEST_F(RunningSceneTest, EventsThatCannotBeSentAreErrors) {
    write(kScene);
    ASSERT_TRUE(run().load());
    EXPECT_TRUE(isOfCaller(running->inject({"T.translation=0 2 0@soon"}, 1)));
    EXPECT_FALSE(running->inject({"T.nothing=1@0"}, 1));
    EXPECT_FALSE(running->inject({"T.translation=0 2 0@2"}, 1));
}

TEST_F(RunningSceneTest, ErrorsOfTheFileAreReportedAndCounted) {
    write(std::string(kScene) + "Transform { translation 1 }\n");
    EXPECT_TRUE(run().load());
    EXPECT_NE(notices.said().find("scene.x3dv:4:"), std::string::npos) << notices.said();
    const std::size_t errors = notices.damage;
    EXPECT_GT(errors, 0u);
    running->reportDiagnostics();
    EXPECT_EQ(notices.damage, errors) << "counted twice";
}

TEST_F(RunningSceneTest, EditsAreFollowedAndFaultyOnesAreNot) {
    write(kScene);
    ASSERT_TRUE(run(true).load());
    const auto rotation = [this](double t) {
        for (int i = 0; i < 600 && !running->isEdited(); ++i) std::this_thread::sleep_for(RunningScene::kLookEvery);
        running->frame(t);
    };
    running->frame(0);
    write("#X3D V4.0 utf8\nPROFILE Interchange\nDEF T Transform { translation 3 0 0 }\n# longer\n");
    rotation(1);
    EXPECT_EQ(translation(), Vec3f(3, 0, 0));
    EXPECT_NE(notices.said().find("it was edited: 1 change\n"), std::string::npos) << notices.said();
    write("#X3D V4.0 utf8\nPROFILE Interchange\nDEF T Transform { translation 4 0 }\n");
    rotation(2);
    EXPECT_EQ(translation(), Vec3f(3, 0, 0));
    running->reportDiagnostics();
    EXPECT_EQ(notices.missing, 1);
}

/// Somebody saves the file again just when the edit before has been read.
class EditingNotices final : public Notices {
  public:
    void note(std::string_view text) override {
        if (text.find("it was edited") != text.npos && !again.empty())
            std::ofstream(file) << std::exchange(again, std::string());
    }
    std::string file, again;
};

TEST_F(RunningSceneTest, AnEditThatComesWhileOneIsReadIsFollowedToo) {
    write(kScene);
    EditingNotices editing;
    editing.file = file;
    RunningScene scene(file, Resources::ofFile(file), {}, SessionContext{&editing, nullptr});
    ASSERT_TRUE(scene.followEdits());
    ASSERT_TRUE(scene.load());
    const auto at = [&] { return scene.scene().node(scene.scene().findName("T")).get(x3d::Transform::translation); };
    editing.again = "#X3D V4.0 utf8\nPROFILE Interchange\nDEF T Transform { translation 5 0 0 }\n# even longer\n";
    write("#X3D V4.0 utf8\nPROFILE Interchange\nDEF T Transform { translation 3 0 0 }\n# longer\n");
    for (const float wanted : {3.f, 5.f}) {
        for (int i = 0; i < 600 && !scene.isEdited(); ++i) std::this_thread::sleep_for(RunningScene::kLookEvery);
        scene.frame(wanted);
        EXPECT_EQ(at(), Vec3f(wanted, 0, 0));
    }
}

TEST_F(RunningSceneTest, OnlyDocumentsInFilesCanBeFollowed) {
    RunningScene standard("-", Resources());
    EXPECT_TRUE(isOfCaller(standard.followEdits()));
    RunningScene web("https://example.org/a.x3d", Resources());
    EXPECT_TRUE(isOfCaller(web.followEdits()));
}

}  // namespace
}  // namespace rtsg
