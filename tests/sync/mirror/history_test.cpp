// A mirror server's history: contiguous frames within a limit of memory, and no keyframe that a repair made wrong.
#include "server/history.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

std::shared_ptr<EncodedRecord> record(RecordKind kind, std::uint64_t from, std::uint64_t to, std::size_t bytes = 100) {
    auto created = std::make_shared<EncodedRecord>();
    created->bytes.room(bytes);
    created->bytes.advance(bytes);
    created->header.kind = kind;
    created->header.from = from;
    created->header.to = to;
    return created;
}
SharedRecord keyframe(std::uint64_t to) {
    return record(RecordKind::keyframe, 0, to);
}
std::shared_ptr<EncodedRecord> frame(std::uint64_t from) {
    return record(RecordKind::frame, from, from + 1);
}

TEST(MirrorHistory, FramesAreFoundByTheStateTheyStartAt) {
    MirrorHistory history(1 << 20);
    ASSERT_TRUE(history.add(keyframe(5)));
    for (std::uint64_t s = 5; s < 9; ++s) ASSERT_TRUE(history.add(frame(s)));
    EXPECT_FALSE(history.add(frame(7))) << "does not follow";
    EXPECT_EQ(history.newest(), 9u);
    EXPECT_TRUE(history.continues(5));
    EXPECT_TRUE(history.continues(9));
    EXPECT_FALSE(history.continues(4));
    EXPECT_FALSE(history.continues(10));
    EXPECT_EQ(history.frameFrom(6)->header.to, 7u);
    EXPECT_EQ(history.bytesFrom(7), 200u);
    EXPECT_EQ(history.keyframe()->header.to, 5u);
}

TEST(MirrorHistory, KeepsTheFirstKeyframeOfASessionThatGoesOn) {
    const auto statesOf = [](const std::vector<SharedRecord>& records) {
        std::vector<std::uint64_t> states;
        for (const SharedRecord& r : records) states.push_back(r->header.to);
        return states;
    };
    for (const bool keeps : {true, false}) {
        MirrorHistory history(5000);
        if (keeps) history.keepFirst();
        const auto first = record(RecordKind::keyframe, 0, 9);
        first->header.hash = {9, 0};
        ASSERT_TRUE(history.add(first));
        for (std::uint64_t s = 9; s < 12; ++s) ASSERT_TRUE(history.add(frame(s)));
        EXPECT_EQ(statesOf(history.allSince(10)), (std::vector<std::uint64_t>{9, 10, 11, 12}));
        EXPECT_TRUE(history.allSince(8).empty());
        history.setKeyframe(keyframe(11));
        history.setKeyframe(keyframe(12));
        EXPECT_EQ(statesOf(history.allSince(12)), (std::vector<std::uint64_t>{12}));
        if (!keeps) {
            EXPECT_TRUE(history.allSince(11).empty());
            continue;
        }
        for (const std::uint64_t s : {9, 10, 11})
            EXPECT_EQ(statesOf(history.allSince(s)), (std::vector<std::uint64_t>{9, 10, 11, 12})) << s;
        EXPECT_TRUE(history.continues(9, {9, 0}));
        EXPECT_FALSE(history.continues(9, {9, 1})) << "another state";
        // As long as frames follow it.
        for (std::uint64_t s = 12; s < 100; ++s) ASSERT_TRUE(history.add(frame(s)));
        ASSERT_FALSE(history.continues(9));
        EXPECT_TRUE(history.allSince(99).empty());
        history.setKeyframe(keyframe(99));
        EXPECT_EQ(statesOf(history.allSince(100)), (std::vector<std::uint64_t>{99, 100}));
    }
}

/// By allocated memory, not by content: a buffer that once held a snapshot stays that large.
TEST(MirrorHistory, CountsMemoryThatIsReallyHeld) {
    constexpr std::uint64_t kLimit = 1 << 20;
    MirrorHistory history(kLimit);
    ASSERT_TRUE(history.add(keyframe(1)));
    std::deque<std::weak_ptr<const EncodedRecord>> all;
    std::uint64_t maximum = 0;
    for (std::uint64_t s = 1; s < 2000; ++s) {
        const auto one = frame(s);
        one->bytes.room(s % 7 == 0 ? 50'000 : 10);
        all.push_back(one);
        ASSERT_TRUE(history.add(one));
        std::uint64_t held = 0;
        for (const auto& kept : all)
            if (const auto there = kept.lock()) held += there->bytes.capacity();
        maximum = std::max(maximum, held);
        ASSERT_LE(history.memory(), kLimit + 51'000);
    }
    EXPECT_LE(maximum, kLimit + kLimit / 10);
    EXPECT_GT(maximum, kLimit / 2);
}

TEST(RecordPool, KeepsNoSnapshotsMemoryForFrames) {
    const auto pool = std::make_shared<RecordPool>();
    {
        const auto snapshot = pool->take();
        snapshot->bytes.room(5'000'000);
        snapshot->header.kind = RecordKind::keyframe;
    }
    auto next = pool->take();
    EXPECT_EQ(next->bytes.capacity(), 0u);
    next->header.kind = RecordKind::frame;
    next->bytes.room(1000);
    const std::byte* const there = next->bytes.data();
    next.reset();
    EXPECT_EQ(pool->take()->bytes.data(), there) << "what a frame took is used again";
}

TEST(RecordPool, HoldsEightMebibytesAtMost) {
    const auto pool = std::make_shared<RecordPool>();
    std::vector<std::shared_ptr<EncodedRecord>> many;
    for (int i = 0; i < 20; ++i) {
        many.push_back(pool->take());
        many.back()->bytes.room(1 << 20);
        many.back()->header.kind = RecordKind::frame;
    }
    many.clear();
    std::size_t kept = 0;
    for (int i = 0; i < 20; ++i) {
        many.push_back(pool->take());
        kept += many.back()->bytes.capacity();
    }
    EXPECT_EQ(kept, std::size_t{8} << 20);
}

TEST(ByteBuffer, FitsWhatItHolds) {
    ByteBuffer bytes;
    bytes.room(1 << 20);
    for (int i = 0; i < 1000; ++i) bytes.put(i);
    bytes.fit();
    EXPECT_EQ(bytes.capacity(), 4000u);
    EXPECT_EQ(bytes.size(), 4000u);
    int last = 0;
    std::memcpy(&last, bytes.data() + 3996, 4);
    EXPECT_EQ(last, 999);
    bytes.room(1500);
    const std::size_t room = bytes.capacity();
    bytes.fit();
    EXPECT_EQ(bytes.capacity(), room) << "more than half of it is used";
    bytes.clear();
    bytes.fit();
    EXPECT_EQ(bytes.capacity(), 256u);
}

TEST(MirrorHistory, GoesOnFromFramesOfBefore) {
    MirrorHistory history(1 << 20);
    for (std::uint64_t s = 5; s < 9; ++s) {
        const auto earlier = frame(s);
        earlier->header.hash = {s + 1, 0};
        history.addEarlier(earlier);
    }
    EXPECT_EQ(history.newest(), 9u);
    EXPECT_EQ(history.keyframe(), nullptr);
    const auto state = std::const_pointer_cast<EncodedRecord>(keyframe(9));
    state->header.hash = {9, 0};
    ASSERT_TRUE(history.add(state));
    ASSERT_TRUE(history.add(frame(9)));
    // A peer in one of these states goes on, if it is the same state.
    for (std::uint64_t s = 6; s < 9; ++s) {
        EXPECT_TRUE(history.continues(s, {s, 0})) << s;
        EXPECT_TRUE(history.continues(s, {})) << s;
        EXPECT_FALSE(history.continues(s, {s, 1})) << s;
    }
    EXPECT_TRUE(history.continues(5, {77, 7})) << "of the oldest nothing is known";
    EXPECT_FALSE(history.continues(4, {}));
    EXPECT_TRUE(history.continues(9, {9, 0}));
    EXPECT_FALSE(history.continues(9, {8, 0})) << "the frame that the origin has not got any more";
}

/// Frames may be much smaller than what it takes to keep one.
TEST(MirrorHistory, TheLimitIsOneOfMemoryNotOfBytesSent) {
    constexpr std::uint64_t kLimit = 1 << 20;
    MirrorHistory small(kLimit), coded(kLimit);
    small.add(keyframe(1));
    coded.add(keyframe(1));
    for (std::uint64_t s = 1; s < 20000; ++s) {
        ASSERT_TRUE(small.add(frame(s)));
        const auto both = frame(s);
        both->predicted = frame(s);
        ASSERT_TRUE(coded.add(both));
    }
    const std::size_t kept = small.framesFrom(small.newest() - 1000, 20000).size();
    EXPECT_EQ(kept, 1000u) << "a thousand small ones fit";
    EXPECT_FALSE(small.continues(small.newest() - kLimit / sizeof(EncodedRecord)));
    EXPECT_TRUE(coded.continues(coded.newest() - 500));
    EXPECT_FALSE(coded.continues(coded.newest() - kLimit / (2 * sizeof(EncodedRecord))));
}

/// A repair of the served replica: the state keeps its number, but what led there was wrong.
TEST(MirrorHistory, ARepairMakesEverythingBeforeItVoid) {
    MirrorHistory history(1 << 20);
    ASSERT_TRUE(history.add(keyframe(3)));
    ASSERT_TRUE(history.add(frame(3)));
    history.setKeyframe(keyframe(4));
    ASSERT_EQ(history.keyframe()->header.to, 4u);
    ASSERT_TRUE(history.add(record(RecordKind::frame, 4, 4)));
    EXPECT_EQ(history.keyframe(), nullptr) << "of the very state that was found to be wrong";
    EXPECT_FALSE(history.continues(3));
    EXPECT_TRUE(history.continues(4)) << "who is there finds out by the hash";
    ASSERT_TRUE(history.add(frame(4)));
    EXPECT_EQ(history.keyframe(), nullptr);
    history.setKeyframe(keyframe(5));
    EXPECT_EQ(history.keyframe()->header.to, 5u);
}

TEST(RecordPool, HasMemoryReadyForRecordsAsLongAsTheLast) {
    constexpr std::size_t kLong = 100000;
    const auto pool = std::make_shared<RecordPool>();
    EXPECT_EQ(pool->take()->bytes.capacity(), 0u);
    pool->keepReady(kLong);
    std::vector<std::shared_ptr<EncodedRecord>> taken;
    for (int i = 0; i < 4; ++i) {
        taken.push_back(pool->take());
        EXPECT_TRUE(taken.back()->bytes.empty());
    }
    // The first one that was there had been given back without any.
    EXPECT_EQ(std::ranges::count_if(taken, [](const auto& r) { return r->bytes.capacity() >= kLong; }), 3);
    pool->keepReady(1000);
    EXPECT_EQ(pool->take()->bytes.capacity(), 0u) << "short ones do without";
    const auto other = std::make_shared<RecordPool>();
    other->keepReady(std::size_t{5} << 20);
    EXPECT_EQ(other->take()->bytes.capacity(), 0u) << "so do those that would take much";
}

}  // namespace
}  // namespace rtsg
