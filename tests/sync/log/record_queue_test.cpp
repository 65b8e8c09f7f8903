// Every frame reaches a reader on another thread, however far it is behind.
#include <rtsg/sync/record_queue.h>

#include <map>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <rtsg/core/scene.h>

#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using Taken = RecordQueue::Taken;

constexpr auto kPatience = 60s;

/// Edits `scene` for so many frames; what each state was.
std::map<std::uint64_t, Hash128> edit(Scene& scene, int frames, std::uint64_t seed) {
    std::map<std::uint64_t, Hash128> states;
    test::RandomEdits edits(scene, seed);
    for (int frame = 0; frame < frames; ++frame) {
        for (int i = 0; i < 6; ++i) edits.step();
        scene.newFrame(frame * .1);
        states[scene.sequence()] = scene.hash();
    }
    return states;
}

/// Puts every set of a scene into a queue, encoded here.
struct Filling : Subscriber {
    explicit Filling(RecordQueue& into) : queue(into) {}
    Result<> apply(const Scene&, const ChangeSet& changes) override { return queue.add(changes); }
    std::string subscriberName() const override { return "filling"; }
    RecordQueue& queue;
};

/// Takes everything into a scene of its own; what each of its states was.
std::map<std::uint64_t, Hash128> follow(RecordQueue& queue) {
    std::map<std::uint64_t, Hash128> states;
    Scene copy;
    copy.setBehavioursEnabled(false);
    for (;;) {
        auto set = std::make_shared<ChangeSet>();
        const auto taken = queue.take(*set, kPatience);
        if (!taken) {
            ADD_FAILURE() << taken.error().text;
            break;
        }
        if (*taken != Taken::set) {
            EXPECT_EQ(*taken, Taken::ended);
            break;
        }
        const Hash128 origin = set->hash;
        const Result<> applied = copy.apply(set);
        EXPECT_TRUE(applied) << applied.error().text;
        EXPECT_EQ(copy.hash(), origin);
        states[copy.sequence()] = copy.hash();
    }
    return states;
}

TEST(RecordQueue, AReaderThatComesLaterGetsEveryFrameFromMemory) {
    Scene scene;
    RecordQueue queue;
    Filling filling(queue);
    const Attachment attachment = scene.bus().attach(filling);
    const auto states = edit(scene, 40, 1);
    queue.close();
    EXPECT_GE(queue.waiting(), 40u);
    EXPECT_NEAR(queue.secondsBehind(), 3.9, 1e-9);
    auto followed = follow(queue);
    followed.erase(0);  // the empty scene it was attached to
    EXPECT_EQ(followed, states);
    EXPECT_EQ(queue.maxOnDisk(), 0u);
    EXPECT_EQ(queue.waiting(), 0u);
    EXPECT_EQ(queue.secondsBehind(), 0);
}

TEST(RecordQueue, WhatDoesNotFitIntoMemoryWaitsInAFile) {
    for (const std::uint64_t seed : {2, 3, 4}) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        RecordQueue queue({.memoryBytes = 2000, .folder = {}});
        Filling filling(queue);
        const Attachment attachment = scene.bus().attach(filling);
        const auto states = edit(scene, 200, seed);
        queue.close();
        EXPECT_GT(queue.maxOnDisk(), 2000u);
        auto followed = follow(queue);
        followed.erase(0);
        EXPECT_EQ(followed, states);
    }
}

TEST(RecordQueue, MemoryAndFileInTurnKeepTheOrder) {
    Scene scene;
    RecordQueue queue({.memoryBytes = 500, .folder = {}});
    Filling filling(queue);
    const Attachment attachment = scene.bus().attach(filling);
    test::RandomEdits edits(scene, 5);
    Scene copy;
    copy.setBehavioursEnabled(false);
    std::mt19937 random(5);
    std::uint64_t last = 0;
    const auto takeOne = [&] {
        auto set = std::make_shared<ChangeSet>();
        const auto taken = queue.take(*set, 0ms);
        ASSERT_TRUE(taken);
        if (*taken != Taken::set) return;
        ASSERT_TRUE(copy.apply(set));
        EXPECT_EQ(copy.hash(), set->hash);
        EXPECT_LE(set->to, last + 1);
        last = set->to;
    };
    for (int frame = 0; frame < 300; ++frame) {
        for (int i = 0; i < 5; ++i) edits.step();
        scene.newFrame(frame);
        for (std::uint32_t n = random() % 3; n > 0; --n) takeOne();
    }
    while (queue.waiting() > 0) takeOne();
    EXPECT_EQ(last, scene.sequence());
    EXPECT_EQ(copy.dump(), scene.dump());
    EXPECT_GT(queue.maxOnDisk(), 0u);
}

TEST(RecordQueue, AReaderOnAnotherThreadNeverMissesOne) {
    Scene scene;
    RecordQueue queue({.memoryBytes = 4000, .folder = {}});
    Filling filling(queue);
    const Attachment attachment = scene.bus().attach(filling);
    std::map<std::uint64_t, Hash128> followed;
    std::thread reader([&] { followed = follow(queue); });
    const auto states = edit(scene, 500, 6);
    queue.close();
    reader.join();
    followed.erase(0);
    EXPECT_EQ(followed, states);
}

TEST(RecordQueue, NothingYetIsNoEnd) {
    Scene scene;
    RecordQueue queue;
    Filling filling(queue);
    const Attachment attachment = scene.bus().attach(filling);
    ChangeSet set;
    EXPECT_EQ(*queue.take(set, 0ms), Taken::set);  // the snapshot
    EXPECT_EQ(*queue.take(set, 0ms), Taken::nothingYet);
    queue.close();
    EXPECT_EQ(*queue.take(set, kPatience), Taken::ended);
}

TEST(RecordQueue, WithoutRoomOnTheDiskItSaysSoAndHandsOutWhatItHas) {
    Scene scene;
    RecordQueue queue({.memoryBytes = 300, .folder = "/nonexistent/folder"});
    Filling filling(queue);
    const Attachment attachment = scene.bus().attach(filling);
    edit(scene, 50, 7);
    EXPECT_FALSE(attachment.attached());
    EXPECT_THAT(attachment.failure(), testing::HasSubstr("/nonexistent/folder"));
    std::uint64_t sets = 0;
    for (ChangeSet set;; ++sets) {
        const auto taken = queue.take(set, kPatience);
        if (!taken) {
            EXPECT_THAT(taken.error().text, testing::HasSubstr("/nonexistent/folder"));
            break;
        }
        ASSERT_EQ(*taken, Taken::set);
    }
    EXPECT_GE(sets, 1u);
}

}  // namespace
}  // namespace rtsg
