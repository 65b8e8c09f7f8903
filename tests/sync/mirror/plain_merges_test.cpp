// Frames merged by what they say of places: the state that they lead to one by one, and only where it is so easy.
#include "server/plain_merges.h"

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg {
namespace {

/// A scene whose frames are recorded one by one.
struct FramesMergedPlainly : testing::Test {
    Scene scene;
    std::vector<NodeId> nodes;
    std::shared_ptr<RecordPool> pool = std::make_shared<RecordPool>();
    PlainMerges merges{pool};
    ChangeEncoder encoder;
    ChangeSet first;

    FramesMergedPlainly() {
        for (int i = 0; i < 30; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
        scene.newFrame(0);
        first = scene.snapshot();
    }
    SharedRecord recordOf(const ChangeSet& set) {
        const std::shared_ptr<EncodedRecord> record = pool->take();
        encoder.encode(set, record->bytes);
        record->header = *parseRecordHeader(record->bytes.bytes());
        record->published = set.to;
        return record;
    }
    SharedRecord frame(std::size_t moving) {
        for (std::size_t i = 0; i < moving; ++i)
            EXPECT_TRUE(scene.set(nodes[i], x3d::Transform::translation, Vec3f(float(i), float(scene.sequence()), 1)));
        return recordOf(*scene.newFrame(double(scene.sequence())));
    }
};

TEST_F(FramesMergedPlainly, AreTheLastOneFromTheFirstOnesStateOn) {
    std::vector<SharedRecord> frames;
    for (int i = 0; i < 5; ++i) frames.push_back(frame(30));
    const SharedRecord merged = merges.merge(0, frames);
    ASSERT_TRUE(merged);
    EXPECT_EQ(merged->header.from, frames.front()->header.from);
    EXPECT_EQ(merged->header.to, frames.back()->header.to);
    EXPECT_EQ(merged->header.time, frames.back()->header.time);
    EXPECT_EQ(merged->published, frames.back()->published);
    ASSERT_TRUE(checkRecord(merged->bytes.bytes()));
    EXPECT_EQ(frames.back()->header.from + 1, frames.back()->header.to) << "the frame itself is as it was";
    ASSERT_TRUE(checkRecord(frames.back()->bytes.bytes()));
    Scene replica;
    ChangeDecoder decoder(builtinTypes());
    const auto set = std::make_shared<ChangeSet>();
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(first)));
    ASSERT_TRUE(decoder.decode(merged->bytes.bytes(), *set));
    ASSERT_TRUE(replica.apply(set));
    EXPECT_EQ(replica.hash(), merged->header.hash);
    EXPECT_EQ(replica.hash(), scene.hash());
    EXPECT_EQ(replica.dump(), scene.dump());
}

TEST_F(FramesMergedPlainly, OfTheSameStatesAreMadeOnce) {
    std::vector<SharedRecord> frames;
    for (int i = 0; i < 3; ++i) frames.push_back(frame(30));
    const SharedRecord merged = merges.merge(0, frames);
    EXPECT_EQ(merges.merge(0, frames), merged);
    EXPECT_NE(merges.merge(1, frames), merged) << "of another stream";
    EXPECT_NE(merges.merge(0, std::span(frames).subspan(1)), merged);
    merges.clear();
    EXPECT_NE(merges.merge(0, frames), merged);
}

TEST_F(FramesMergedPlainly, OfOtherFieldsAreLeftToOthers) {
    std::vector<SharedRecord> frames = {frame(30), frame(29)};
    EXPECT_FALSE(merges.merge(0, frames)) << "a value that the last does not give";
    frames = {frame(29), frame(30)};
    EXPECT_FALSE(merges.merge(0, frames)) << "a value more";
    EXPECT_FALSE(merges.merge(0, {}));
    ASSERT_TRUE(scene.setName(nodes[0], "A"));
    frames = {frame(30), frame(30)};
    EXPECT_FALSE(merges.merge(0, frames)) << "a name";
    // A cached result for the same nodes with a name must not be used for those without, and the other way round.
    frames = {frame(30), frame(30)};
    EXPECT_TRUE(merges.merge(0, frames));
}

TEST_F(FramesMergedPlainly, ThatReferToEachOtherAreLeftToOthers) {
    ChangeEncoder predicting({.mode = Mode::state, .coding = Coding::compact});
    std::vector<SharedRecord> frames;
    for (int i = 0; i < 3; ++i) {
        for (const NodeId id : nodes)
            ASSERT_TRUE(scene.set(id, x3d::Transform::translation, Vec3f(float(scene.sequence()), 0, 1)));
        const std::shared_ptr<EncodedRecord> record = pool->take();
        predicting.encode(*scene.newFrame(double(scene.sequence())), record->bytes);
        record->header = *parseRecordHeader(record->bytes.bytes());
        frames.push_back(record);
    }
    EXPECT_FALSE(merges.merge(0, frames));
}

/// Each peer that is late by the same frames would have them compared again, to be told the same.
TEST_F(FramesMergedPlainly, ThatAreNotSoEasyAreTriedOnce) {
    const std::vector<SharedRecord> hard = {frame(29), frame(30)};
    EXPECT_FALSE(merges.merge(0, hard));
    // From the same state to the same state, by frames that would do: not looked at.
    const auto easier = std::make_shared<EncodedRecord>();
    easier->bytes.append(hard[1]->bytes.bytes());
    easier->header = hard[0]->header;
    const std::vector<SharedRecord> easy = {easier, hard[1]};
    EXPECT_FALSE(merges.merge(0, easy));
    EXPECT_TRUE(merges.merge(1, easy)) << "of another stream";
    merges.clear();
    EXPECT_TRUE(merges.merge(0, easy));
}

}  // namespace
}  // namespace rtsg
