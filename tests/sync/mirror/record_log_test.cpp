// A mirror's log holds the very bytes that came, and leads from each of its keyframes to the origin's states.
#include <rtsg/sync/record_log.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <thread>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/replay.h>

#include "mirror_support.h"
#include "support/random_edits.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using test::kAnyPort;
using test::pollUntilAt;

std::string textOf(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A scene that is served, a mirror of it, and the mirror's log.
class RecordLogTest : public testing::Test {
  protected:
    std::filesystem::path file() const { return folder / "a.rlog"; }

    void serve(MirrorServerOptions options = {}) {
        server = *MirrorServer::start(scene, kAnyPort, std::move(options));
        client = *MirrorClient::connect(replica, server->endpoint());
        scene.newFrame(0);
        ASSERT_TRUE(pollUntilAt(*client, scene));
    }
    void record(LogOptions options = {}) {
        auto created = RecordLog::start(replica, file(), std::move(options));
        ASSERT_TRUE(created) << created.error().text;
        log = std::move(*created);
        client->onStep([this](const RecordStep& step) {
            if (step.record) sent[step.record->header.to] = textOf(step.record->bytes.bytes());
            log->add(replica, step);
        });
    }
    void frame(double t) {
        scene.newFrame(t);
        hashes[scene.sequence()] = scene.hash();
        ASSERT_TRUE(pollUntilAt(*client, scene));
    }
    /// Every frame of the file that is one of those that came; the others.
    std::pair<std::size_t, std::size_t> framesAsTheyCame() const {
        auto reader = LogReader::open(file());
        EXPECT_TRUE(reader);
        std::size_t same = 0, others = 0;
        while (const auto one = reader->next()) {
            if (one->header.kind != RecordKind::frame) continue;
            const auto came = sent.find(one->header.to);
            ++(came != sent.end() && came->second == textOf(one->bytes) ? same : others);
        }
        EXPECT_TRUE(reader->damage().empty()) << reader->damageText();
        return {same, others};
    }
    /// From each keyframe on all states are the origin's.
    void replay() {
        auto reader = LogReader::open(file());
        ASSERT_TRUE(reader);
        for (const LogKeyframe& keyframe : reader->keyframes()) {
            auto opened = Replayer::open(file());
            ASSERT_TRUE(opened) << opened.error().text;
            Replayer& replayer = **opened;
            ASSERT_TRUE(replayer.seek(keyframe.time));
            do {
                const auto known = hashes.find(replayer.scene().sequence());
                if (known == hashes.end()) continue;
                ASSERT_EQ(replayer.scene().hash(), known->second) << "state " << known->first;
            } while (replayer.step().value_or(false));
            EXPECT_EQ(replayer.scene().dump(), scene.dump());
        }
    }

    test::TempFolder folder;
    Scene scene, replica;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;
    std::unique_ptr<RecordLog> log;
    std::map<std::uint64_t, std::string> sent;
    std::map<std::uint64_t, Hash128> hashes;
};

TEST_F(RecordLogTest, EveryFrameIsWrittenAsItCame) {
    for (int i = 0; i < 50; ++i) {
        const NodeId node = scene.createNode(x3d::Transform::type);
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    }
    serve();
    LogOptions options;
    options.keyframeBytes = 4000;
    record(options);
    for (int k = 1; k <= 200; ++k) {
        for (std::uint32_t i = 2; i < 52; ++i)
            ASSERT_TRUE(scene.set(NodeId{i}, x3d::Transform::translation, Vec3f(static_cast<float>(k * i), 0, 0)));
        frame(k * .1);
    }
    ASSERT_TRUE(log->stop());
    EXPECT_EQ(log->encoded(), 0u);
    EXPECT_EQ(framesAsTheyCame(), std::pair(std::size_t{200}, std::size_t{0}));
    EXPECT_GT(LogReader::open(file())->keyframes().size(), 10u);
    replay();
}

TEST_F(RecordLogTest, RandomEditsOfAllKindsComeThrough) {
    for (const std::uint64_t seed : {1, 2, 3}) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        client.reset();
        server.reset();
        ASSERT_TRUE(scene.reset());
        ASSERT_TRUE(replica.reset());
        sent.clear();
        hashes.clear();
        serve();
        LogOptions options;
        options.keyframeBytes = 2000;
        record(options);
        test::RandomEdits edits(scene, seed);
        for (int k = 1; k <= 150; ++k) {
            for (int i = 0; i < 5; ++i) edits.step();
            frame(k * .1);
        }
        ASSERT_TRUE(log->stop());
        const auto [same, others] = framesAsTheyCame();
        EXPECT_LE(others, log->encoded());
        EXPECT_LT(log->encoded(), (same + others) / 4) << "those that create nodes of a type for the first time";
        replay();
    }
}

/// The server describes a type once. Behind a keyframe of ours that does not, bytes as they came would name a type that
/// the log never describes, which readers of other programs could not take.
TEST_F(RecordLogTest, ATypeThatAKeyframeDoesNotDescribeIsDescribedAgain) {
    serve();
    const auto addBox = [&] { return scene.createNode(x3d::Box::type); };
    NodeId box = addBox();
    frame(1);
    ASSERT_TRUE(scene.destroyNode(box));
    frame(2);
    record();
    box = addBox();
    frame(3);
    ASSERT_TRUE(scene.destroyNode(box));
    addBox();
    frame(4);
    ASSERT_TRUE(log->stop());
    EXPECT_EQ(log->encoded(), 1u) << "the first alone";
    EXPECT_EQ(framesAsTheyCame(), std::pair(std::size_t{1}, std::size_t{1}));
    replay();
}

TEST_F(RecordLogTest, PredictedFramesAreEncodedAnew) {
    MirrorServerOptions options;
    options.mode.coding = Coding::compact;
    const NodeId node = scene.createNode(x3d::Transform::type);
    serve(options);
    record();
    for (int k = 1; k <= 40; ++k) {
        ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(k), 0, 0)));
        frame(k);
    }
    ASSERT_TRUE(log->stop());
    EXPECT_GT(log->encoded(), 0u);
    replay();
}

TEST_F(RecordLogTest, ASessionThatStartsOverIsAnotherOneInTheFile) {
    serve();
    record();
    frame(1);
    ASSERT_TRUE(scene.reset());
    scene.createNode(x3d::Group::type);
    frame(1.5);
    frame(2);
    ASSERT_TRUE(log->stop());
    auto reader = LogReader::open(file());
    std::size_t heads = 0;
    std::uint64_t epoch = 0;
    while (const auto one = reader->next())
        if (one->header.kind == RecordKind::head)
            if (const auto head = decodeHead(one->bytes); head && std::exchange(epoch, head->epoch) != head->epoch)
                ++heads;
    EXPECT_EQ(heads, 2u);
    auto opened = Replayer::open(file());
    ASSERT_TRUE(opened);
    Replayer& replayer = **opened;
    while (replayer.step().value_or(false)) continue;
    EXPECT_EQ(replayer.scene().hash(), scene.hash());
}

/// As a server adds records: it may not wait, and the snapshot arrives later, after other frames.
TEST_F(RecordLogTest, InPassingOneSnapshotIsAskedForAtATime) {
    const NodeId node = scene.createNode(x3d::Transform::type);
    scene.newFrame(0);
    LogOptions options;
    options.keyframeBytes = 1;
    options.keyframeFactor = 0;
    log = std::move(*RecordLog::start(scene, file(), options));
    ChangeEncoder encoder;
    int frames = 0;
    const auto step = [&] {
        EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(++frames), 0, 0)));
        const auto set = scene.newFrame(frames);
        hashes[scene.sequence()] = scene.hash();
        const auto one = std::make_shared<EncodedRecord>();
        encoder.encode(*set, one->bytes);
        finishRecord(*one);
        return log->addInPassing({one, nullptr}, *set);
    };
    const auto written = [&] { return log->acknowledged() == scene.sequence(); };
    for (int round = 0; round < 3; ++round) {
        while (!step()) ASSERT_TRUE(test::eventually(written));
        const std::uint64_t state = scene.sequence();
        const auto snapshot = std::make_shared<const ChangeSet>(scene.snapshot());
        ASSERT_TRUE(test::eventually(written));
        for (int i = 0; i < 10; ++i) EXPECT_FALSE(step()) << "another, while it waits for one";
        EXPECT_EQ(log->acknowledged(), state) << "nothing goes before the keyframe";
        log->giveSnapshot(state, round == 1 ? nullptr : snapshot);
        ASSERT_TRUE(test::eventually(written));
    }
    ASSERT_TRUE(log->stop());
    EXPECT_EQ(log->encoded(), 0u);
    EXPECT_EQ(LogReader::open(file())->keyframes().size(), 2u + 2u) << "the first, twice, and two that came";
    replay();
}

TEST_F(RecordLogTest, ALogThatEndsBeforeItsSnapshotCameIsWhole) {
    const NodeId node = scene.createNode(x3d::Transform::type);
    scene.newFrame(0);
    LogOptions options;
    options.keyframeBytes = 1;
    options.keyframeFactor = 0;
    log = std::move(*RecordLog::start(scene, file(), options));
    bool asked = false;
    for (int k = 1; k < 1000 && !asked; ++k) {
        ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(k), 0, 0)));
        const auto set = scene.newFrame(k);
        asked = log->addInPassing({nullptr, set}, *set);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ASSERT_TRUE(asked);
    ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(-1, 0, 0)));
    const auto last = scene.newFrame(1000);
    EXPECT_FALSE(log->addInPassing({nullptr, last}, *last));
    ASSERT_TRUE(log->stop());
    EXPECT_EQ(log->acknowledged(), scene.sequence());
    replay();
}

/// A disk that takes nothing for a while: nobody waits, and nothing is lost.
TEST_F(RecordLogTest, WhatADiskDoesNotTakeIsMerged) {
    const NodeId node = scene.createNode(x3d::Transform::type), many = scene.createNode(x3d::Coordinate::type);
    scene.newFrame(0);
    const std::string pipe = folder / "pipe";
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    const int reading = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    ASSERT_GE(reading, 0);
    log = std::move(*RecordLog::start(scene, pipe));
    for (int k = 1; k <= 600; ++k) {
        ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(k), 0, 0)));
        ASSERT_TRUE(
            scene.set(many, x3d::Coordinate::point, Array<Vec3f>(std::vector<Vec3f>(200, Vec3f(1.f * k, 0, 0)))));
        const auto set = scene.newFrame(k * .001);
        (void)log->addInPassing({nullptr, set}, *set);
    }
    EXPECT_GT(log->merged(), 300u);
    EXPECT_LT(log->acknowledged(), 400u);
    std::string taken;
    std::thread reader([&] {
        char bytes[65536];
        pollfd there{reading, POLLIN, 0};
        for (ssize_t count = 1; count != 0;) {
            (void)::poll(&there, 1, 1000);
            count = ::read(reading, bytes, sizeof bytes);
            if (count > 0) taken.append(bytes, static_cast<std::size_t>(count));
        }
    });
    EXPECT_TRUE(log->stop());
    reader.join();
    ::close(reading);
    EXPECT_EQ(log->acknowledged(), scene.sequence());
    std::ofstream(file(), std::ios::binary) << taken;
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer) << replayer.error().text;
    while ((*replayer)->step().value_or(false)) continue;
    EXPECT_EQ((*replayer)->scene().dump(), scene.dump());
    EXPECT_EQ((*replayer)->gaps(), 0u);
}

TEST_F(RecordLogTest, AServedSceneThatStartsOverIsAnotherSessionOfItsServersLog) {
    serve();
    const std::shared_ptr<RecordLog> served = std::move(*RecordLog::start(scene, file()));
    server->recordTo(served, std::chrono::hours(1));
    frame(1);
    ASSERT_TRUE(scene.reset());
    Scene other;
    for (int i = 0; i < 5; ++i) other.createNode(x3d::Group::type);
    other.newFrame(9);
    ASSERT_TRUE(scene.apply(std::make_shared<const ChangeSet>(other.snapshot())));
    ASSERT_TRUE(test::pollUntil(*client, [&] { return replica.hash() == scene.hash(); }));
    std::uint64_t starts = 0;
    served->onAcknowledged([&](std::uint64_t start, std::uint64_t) { starts = start; });
    EXPECT_EQ(starts, 1u);
    ASSERT_TRUE(served->stop());
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    while ((*replayer)->step().value_or(false)) continue;
    EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
}

TEST_F(RecordLogTest, AFullDiskEndsTheLogAndNothingElse) {
    serve();
    auto created = RecordLog::start(replica, "/dev/full");
    EXPECT_FALSE(created);
    record();
    frame(1);
    std::filesystem::resize_file(file(), 10);  // somebody cuts it
    ASSERT_TRUE(scene.set(scene.createNode(x3d::Transform::type), x3d::Transform::translation, Vec3f(1, 0, 0)));
    frame(2);
    EXPECT_FALSE(log->stop()) << "what was cut is noticed at the end";
    EXPECT_NE(log->failure(), "");
    frame(3);
    EXPECT_EQ(replica.hash(), scene.hash());
}

}  // namespace
}  // namespace rtsg
