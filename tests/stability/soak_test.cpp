// A server that stands for long: memory, descriptors and threads stay what they are, whoever follows, comes, goes,
// edits, stops or records. The long form runs a hundred thousand frames of each, the short one a few thousand.
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/record_log.h>

#include "support/long_form.h"
#include "support/resident_bytes.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

constexpr double kFps = 60;
constexpr int kNodes = 2000;

int frames() {
    return test::fewOrMany(6'000, 100'000);
}

std::size_t entriesOf(const char* folder) {
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& one : std::filesystem::directory_iterator(folder)) ++count;
    return count;
}

/// A scene in motion and its server. The served frames exceed the history by far; it is full after a tenth.
struct Standing {
    Scene scene;
    std::vector<NodeId> moving;
    std::unique_ptr<MirrorServer> server;
    int frame = 0;

    explicit Standing(MirrorServerOptions options = {}) {
        for (int i = 0; i < kNodes; ++i) {
            const NodeId node = scene.createNode(x3d::Transform::type);
            EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
            if (i % 100 == 0) moving.push_back(node);
        }
        options.history = 128 << 10;
        options.upstream = MirrorUpstream::edits;
        options.peerTimeout = 2000ms;
        server = *MirrorServer::start(scene, "tcp://127.0.0.1:*", std::move(options));
    }
    void step() {
        server->service();
        for (const NodeId node : moving)
            ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(frame), 0, 0)));
        scene.newFrame(frame++ / kFps);
        (void)server->takeDiagnostics();
        // The threads that follow get their share: what waits for them is another test's matter.
        if (frame % 8 == 0) std::this_thread::sleep_for(1ms);
    }
};

/// Runs the frames; `each` is called after each. Growth from the first tenth to the end by more than 1 kB a second of
/// scene time (in the short form by more than an allocator may round) is a leak.
void stand(Standing& standing, const std::function<void(int)>& each) {
    const int all = frames();
    std::size_t descriptors = 0, threads = 0;
    double begun = 0;
    std::size_t resident = 0;
    for (int i = 0; i < all; ++i) {
        ASSERT_NO_FATAL_FAILURE(standing.step());
        each(i);
        if (i + 1 != all / 10) continue;
        resident = test::residentBytes();
        descriptors = entriesOf("/proc/self/fd");
        threads = entriesOf("/proc/self/task");
        begun = standing.scene.now();
    }
    const double seconds = standing.scene.now() - begun;
    const double grown = static_cast<double>(test::residentBytes()) - static_cast<double>(resident);
    const double allowed = std::max(1024 * seconds, 1.5e6);
    EXPECT_LE(grown, allowed) << grown / seconds << " bytes a second of scene time";
    EXPECT_LE(entriesOf("/proc/self/fd"), descriptors + 1);
    EXPECT_LE(entriesOf("/proc/self/task"), threads);
}

struct Follower {
    Scene replica;
    std::unique_ptr<MirrorClient> client;
    explicit Follower(const Standing& of, MirrorClientOptions options = {})
        : client(*MirrorClient::connect(replica, of.server->endpoint(), std::move(options))) {}
};

TEST(Soak, NobodyFollows) {
    Standing standing;
    stand(standing, [](int) {});
}

TEST(Soak, OneFollows) {
    Standing standing;
    Follower follower(standing);
    stand(standing, [&](int) { follower.client->poll(0ms); });
    EXPECT_GT(follower.client->statistics().frames, 100u);
}

TEST(Soak, MirrorsComeAndGo) {
    Standing standing;
    std::unique_ptr<Follower> follower;
    int joined = 0;
    stand(standing, [&](int i) {
        if (i % 100 == 0) {
            joined += follower && follower->client->statistics().frames > 0;
            follower = std::make_unique<Follower>(standing);
        }
        follower->client->poll(0ms);
    });
    EXPECT_GT(joined, 10);
}

TEST(Soak, AMirrorEdits) {
    Standing standing;
    Follower follower(standing);
    std::uint64_t accepted = 0;
    stand(standing, [&](int i) {
        follower.client->poll(0ms);
        for (const MirrorVerdict& verdict : follower.client->takeVerdicts()) accepted += verdict.refusal.empty();
        if (i % 10 != 0 || !follower.client->inStep() || follower.client->unanswered() > 10) return;
        (void)follower.client->submitEdit(standing.moving.front(), x3d::Transform::scale.index,
                                          Vec3f(1, 1, static_cast<float>(i + 1)));
    });
    EXPECT_GT(accepted, 10u);
}

TEST(Soak, AMirrorStopsReading) {
    Standing standing;
    MirrorClientOptions options;
    options.window = 64 << 10;  // what the server may send it ahead
    Follower follower(standing, std::move(options));
    for (int i = 0; i < 2000 && follower.client->statistics().frames == 0; ++i) {
        standing.step();
        follower.client->poll(1ms);
    }
    ASSERT_GT(follower.client->statistics().frames, 0u);
    stand(standing, [](int) {});
}

TEST(Soak, ALogThatRotatesInARing) {
    const test::TempFolder folder;
    Standing standing;
    LogOptions options;
    options.rotateBytes = 256 << 10;
    options.keepSeconds = 5;
    auto log = *RecordLog::start(standing.scene, folder / "a.rlog", options);
    const std::shared_ptr<RecordLog> shared = std::move(log);
    standing.server->recordTo(shared);
    stand(standing, [](int) {});
    EXPECT_EQ(shared->failure(), "");
    EXPECT_LE(shared->encoded(), shared->merged()) << "where the disk could not keep up";
    ASSERT_TRUE(shared->stop());
    std::uintmax_t bytes = 0;
    for (const auto& one : std::filesystem::directory_iterator(folder.path())) bytes += one.file_size();
    EXPECT_LT(bytes, 3u << 20) << "only the last seconds stay";
}

}  // namespace
}  // namespace rtsg
