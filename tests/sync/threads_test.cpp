// Threads of ours that run out of memory: what they did ends with a reason, and the process goes on.
#include <array>
#include <atomic>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log_recorder.h>

#include "support/log_support.h"
#include "sync/heap.h"
#include "sync/mirror/mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::FailingHeap;
using test::pollUntil;
using test::pollUntilAt;

class Threads : public test::LogFolder {
  protected:
    Threads() {
        scene.bus().setReporter([this](const Diagnostic& d) { reported = d.text; });
        node = scene.createNode(x3d::Transform::type);
        scene.newFrame(0);
    }
    void SetUp() override {
        if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer has the heap";
    }
    void step() {
        EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(++frame))));
        scene.newFrame(frame);
    }
    bool stepUntilReported() {
        return eventually([this] {
            step();
            return !reported.empty();
        });
    }

    Scene scene;
    NodeId node;
    int frame = 0;
    std::string reported;
};

TEST_F(Threads, AMirrorServersThreadWithoutMemoryEndsTheServerWithAReason) {
    auto server = *MirrorServer::start(scene, "tcp://127.0.0.1:*");
    Scene replica;
    auto client = *MirrorClient::connect(replica, server->endpoint());
    ASSERT_TRUE(pollUntilAt(*client, scene));
    {
        const FailingHeap failing("rtsg mirror");
        ASSERT_TRUE(stepUntilReported());
    }
    EXPECT_NE(reported.find("the server's thread has ended: std::bad_alloc"), std::string::npos) << reported;
    EXPECT_FALSE(server->drain(10s)) << "nobody is told any more that all is well";
    EXPECT_EQ(server->statistics().peers, 0u);
    server.reset();
    // Its port is free again, and who followed goes on where it was.
    auto again = MirrorServer::start(scene, "tcp://127.0.0.1:*");
    EXPECT_TRUE(again) << again.error().text;
}

TEST_F(Threads, AMirrorServersReplicaWithoutMemoryEndsTheServerWithAReason) {
    auto server = *MirrorServer::start(scene, "tcp://127.0.0.1:*");
    {
        const FailingHeap failing("rtsg shadow");
        ASSERT_TRUE(stepUntilReported());
    }
    EXPECT_NE(reported.find("its replica's thread has ended: std::bad_alloc"), std::string::npos) << reported;
}

TEST_F(Threads, ARecorderWithoutMemoryEndsTheLogWithAReasonAndLeavesItUnclosed) {
    for (const auto whenBehind : {LogRecorder::WhenBehind::merge, LogRecorder::WhenBehind::wait}) {
        reported.clear();
        auto recorder = LogRecorder::start(scene, file(), {}, whenBehind);
        ASSERT_TRUE(recorder) << recorder.error().text;
        step();
        ASSERT_TRUE((*recorder)->waitFor(scene.sequence(), 30s)) << (*recorder)->failure();
        const std::uint64_t kept = scene.sequence();
        {
            const FailingHeap failing("rtsg recorder");
            // By now it has all memory that it allocates for a frame: nodes are new.
            ASSERT_TRUE(eventually([this] {
                for (int i = 0; i < 100; ++i) scene.createNode(x3d::Transform::type);
                step();
                return !reported.empty();
            }));
        }
        EXPECT_NE(reported.find("bad_alloc"), std::string::npos) << reported;
        EXPECT_NE((*recorder)->failure().find("bad_alloc"), std::string::npos) << (*recorder)->failure();
        EXPECT_FALSE((*recorder)->waitFor(scene.sequence() + 1, 30s));
        EXPECT_FALSE((*recorder)->stop());
        auto replayer = Replayer::open(file());
        ASSERT_TRUE(replayer) << replayer.error().text;
        while (*(*replayer)->step()) {
        }
        EXPECT_GE((*replayer)->scene().sequence(), kept);
        EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
        EXPECT_FALSE((*replayer)->log().closed()) << "nothing after this state is in it";
    }
}

/// A pipe that is emptied slowly is a disk that takes less than the scene makes.
TEST_F(Threads, ARecorderThatIsWaitedForLosesNoState) {
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    const int reader = ::open(file("pipe").c_str(), O_RDONLY | O_NONBLOCK);
    ASSERT_GE(reader, 0);
    std::atomic<bool> done{false};
    std::string bytes;
    std::thread slow([&] {
        std::array<char, 16384> part{};
        while (true) {
            const ssize_t got = ::read(reader, part.data(), part.size());
            if (got > 0) bytes.append(part.data(), static_cast<std::size_t>(got));
            const bool begun = !bytes.empty();  // a pipe that nobody has opened for writing yet ends at once
            if ((got == 0 && begun) || (got <= 0 && done)) break;
            std::this_thread::sleep_for(1ms);
        }
    });
    auto recorder = LogRecorder::start(scene, file("pipe"), {}, LogRecorder::WhenBehind::wait);
    ASSERT_TRUE(recorder) << recorder.error().text;
    const std::uint64_t first = scene.sequence();
    test::RandomEdits edits(scene, 11);
    for (int i = 0; i < 1500; ++i) {
        for (int k = 0; k < 10; ++k) edits.step();
        step();
    }
    EXPECT_TRUE((*recorder)->stop());
    EXPECT_EQ((*recorder)->merged(), 0u);
    done = true;
    slow.join();
    ::close(reader);
    test::writeAll(file(), bytes);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer) << replayer.error().text;
    for (std::uint64_t state = first; state <= scene.sequence(); ++state) {
        ASSERT_TRUE(*(*replayer)->step());
        ASSERT_EQ((*replayer)->scene().sequence(), state);
    }
    EXPECT_EQ((*replayer)->scene().dump(), scene.dump());
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
}

TEST_F(Threads, AMergersThreadWithoutMemoryDetachesWhomItMergesFor) {
    struct Idle final : Subscriber {
        Result<> apply(const Scene&, const ChangeSet&) override { return {}; }
        std::string subscriberName() const override { return "idle"; }
    } idle;
    Attachment attachment = scene.bus().attach(idle, Delivery::polled);
    {
        const FailingHeap failing("rtsg merger");
        EXPECT_TRUE(eventually([&] {
            scene.createNode(x3d::Transform::type);  // so that the merged sets grow
            step();
            return !attachment.attached();
        }));
    }
    EXPECT_EQ(attachment.failure(), "there was no memory to merge what it had not taken");
    EXPECT_FALSE(attachment.poll());
    step();
    EXPECT_EQ(reported, "detached: " + attachment.failure());
}

}  // namespace
}  // namespace rtsg
