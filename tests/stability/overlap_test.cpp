// Overlap: several threads follow one running scene, each on its own copy and at its own pace.
//
// Stated outcome: whatever their pace, each ends in the scene's state with the scene's hash; a log has every state in
// order and verifies; coming, going and the end of the scene itself disturb nobody. Run it under the thread sanitizer.
// What a follower on another thread may touch: the sets that it is given and its own copy, never the scene.
#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>

#include <unistd.h>

#include <gtest/gtest.h>

#include <rtsg/core/replica.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>

#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

constexpr const char* kMoving = R"(#X3D V4.0 utf8
DEF T TimeSensor { loop TRUE cycleInterval 2 }
DEF P PositionInterpolator { key [ 0 .5 1 ] keyValue [ -1 0 0, 1 0 0, -1 0 0 ] }
DEF M Transform { children Shape { appearance Appearance { material Material { } } geometry Box { } } }
Transform { translation 0 1 0 children Shape { geometry Sphere { } } }
ROUTE T.fraction_changed TO P.set_fraction
ROUTE P.value_changed TO M.set_translation
)";

void load(Scene& scene) {
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kMoving, diagnostics)) << diagnostics.all().front().format();
}

/// Runs `each` on a thread of its own until told to stop, and once more after that.
class Following {
  public:
    template <class Each>
    Following(Scene& origin, Each each) : replica_(std::make_unique<Replica>(origin)) {
        thread_ = std::jthread([this, each](const std::stop_token& stop) {
            for (bool last = false; !last;) {
                last = stop.stop_requested();
                each(*replica_);
                ++rounds_;
            }
        });
    }
    /// After the last edit of the scene.
    void finish() {
        thread_.request_stop();
        thread_.join();
    }
    Replica& replica() { return *replica_; }
    int rounds() const { return rounds_; }

  private:
    std::unique_ptr<Replica> replica_;
    std::atomic<int> rounds_ = 0;
    std::jthread thread_;
};

class Overlap : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Overlap, EveryFollowerEndsWithTheScenesHash) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    const auto file = std::filesystem::temp_directory_path() /
                      ("rtsg-overlap-" + std::to_string(GetParam()) + '-' + std::to_string(::getpid()) + ".rlog");
    Scene scene;
    load(scene);
    const NodeId top = scene.createNode(x3d::Group::type);
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, top));
    scene.newFrame(0);
    std::uint64_t logged = 0;
    {
        Following hasty(scene, [](Replica& replica) {
            replica.poll();
            std::this_thread::yield();
        });
        Following slow(scene, [](Replica& replica) {
            replica.poll();
            std::this_thread::sleep_for(40ms);
        });
        std::unique_ptr<SharedWorld> world;
        std::unique_ptr<LightRenderer> picture;
        Following light(scene, [&world, &picture](Replica& replica) {
            if (!world) {
                world = std::make_unique<SharedWorld>(replica.scene());
                picture = std::make_unique<LightRenderer>(*world);
            }
            replica.poll();
            ImageOptions options;
            options.settings.width = options.settings.height = 8;
            options.settings.threads = 1;
            EXPECT_TRUE(picture->picture(options));
        });
        std::unique_ptr<LogWriter> writer;
        Attachment writing;
        Following log(scene, [&](Replica& replica) {
            if (!writer) {
                auto created = LogWriter::create(file, builtinTypes());
                ASSERT_TRUE(created) << created.error().text;
                writer = std::move(*created);
                writing = replica.scene().bus().attach(*writer);
            }
            logged += replica.drain();
        });
        test::RandomEdits edits(scene, GetParam(), top);
        for (int frame = 1; frame <= 200; ++frame) {
            for (int i = 0; i < 6; ++i) edits.step();
            scene.newFrame(frame * .01);
            if (frame % 50 == 0) {  // others come and go meanwhile
                Following brief(scene, [](Replica& replica) { replica.poll(); });
                scene.newFrame(frame * .01 + .005);
                brief.finish();
                EXPECT_EQ(brief.replica().scene().hash(), scene.hash());
            }
            if (frame % 16 == 0) std::this_thread::sleep_for(2ms);  // so that the others get to see something
        }
        for (Following* one : {&hasty, &slow, &light, &log}) {
            one->finish();
            EXPECT_TRUE(one->replica().attached()) << one->replica().failure();
            EXPECT_EQ(one->replica().scene().sequence(), scene.sequence());
            EXPECT_EQ(one->replica().scene().hash(), scene.hash());
            EXPECT_EQ(one->replica().scene().dump(), scene.dump());
            EXPECT_GE(one->rounds(), 1);
        }
        writing.detach();
        ASSERT_TRUE(writer->close());
    }
    auto replayer = Replayer::open(file);
    ASSERT_TRUE(replayer) << replayer.error().text;
    while (true) {
        const auto more = (*replayer)->step();
        ASSERT_TRUE(more) << more.error().text;
        if (!*more) break;
    }
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
    EXPECT_EQ((*replayer)->gaps(), 0u);
    EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
    EXPECT_GE(logged, 1u);
    std::filesystem::remove(file);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Overlap, testing::Range<std::uint64_t>(1, 5));

TEST(Overlap, TheSceneMayEndFirst) {
    auto scene = std::make_unique<Scene>();
    load(*scene);
    scene->newFrame(0);
    Following one(*scene, [](Replica& replica) { replica.poll(); });
    for (int frame = 1; frame < 50; ++frame) scene->newFrame(frame * .01);
    scene.reset();
    one.finish();
    EXPECT_FALSE(one.replica().attached());
    EXPECT_FALSE(one.replica().poll());
    EXPECT_LE(one.replica().scene().sequence(), 50u);
}

TEST(Overlap, EditsFromAnotherThreadAreRefused) {
    Scene scene;
    load(scene);
    scene.newFrame(0);
    const Hash128 before = scene.hash();
    std::jthread([&] {
        EXPECT_FALSE(scene.set(scene.findName("M"), x3d::Transform::translation, Vec3f(1, 2, 3)));
        EXPECT_FALSE(scene.createNode(x3d::Group::type));
        EXPECT_FALSE(scene.destroyNode(scene.findName("M")));
    }).join();
    EXPECT_EQ(scene.hash(), before);
    EXPECT_EQ(scene.seal(), nullptr);
}

}  // namespace
}  // namespace rtsg
