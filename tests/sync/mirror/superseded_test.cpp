// Frames that the next one says anew: those of plain values of the very same fields, and no others.
#include "server/superseded.h"

#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>

#include "server/shadow.h"

namespace rtsg {
namespace {

Change plainOf(std::uint32_t node, FieldIndex field, Value value) {
    Change change;
    change.node = NodeId{node};
    change.field = field;
    change.value = std::move(value);
    return change;
}

ByteBuffer frameOf(std::vector<Change> changes) {
    ChangeSet set;
    set.from = 1;
    set.to = 2;
    set.changes = std::move(changes);
    ByteBuffer record;
    ChangeEncoder().encode(set, record);
    return record;
}

bool superseded(const std::vector<Change>& frame, const std::vector<Change>& next) {
    return mirror::isSuperseded(frameOf(frame).bytes(), frameOf(next).bytes());
}

TEST(Superseded, OnlyTheSameFieldsOfTheSameNodesAreSaidAnew) {
    const std::vector<Change> frame = {plainOf(300, 1, Vec3f(1, 2, 3)), plainOf(301, 1, Vec3f(4, 5, 6)),
                                       plainOf(300, 2, 1.5)};
    const auto with = [&](std::size_t i, Change change) {
        std::vector<Change> other = frame;
        other[i] = std::move(change);
        return other;
    };
    EXPECT_TRUE(superseded(frame, frame));
    EXPECT_TRUE(superseded(frame, with(1, plainOf(301, 1, Vec3f(-4, 0, 0)))));
    EXPECT_FALSE(superseded(frame, with(1, plainOf(302, 1, Vec3f(4, 5, 6))))) << "another node";
    EXPECT_FALSE(superseded(frame, with(2, plainOf(300, 3, 1.5)))) << "another field";
    EXPECT_FALSE(superseded(frame, with(2, plainOf(300, 2, 1.5f)))) << "another type";
    std::vector<Change> more = frame;
    more.push_back(plainOf(302, 1, Vec3f()));
    EXPECT_FALSE(superseded(frame, more)) << "one field more";
    EXPECT_FALSE(superseded(more, frame)) << "one field less";
    more = frame;
    more.push_back(plainOf(300, 4, true));
    EXPECT_FALSE(superseded(frame, more)) << "one column more";
    EXPECT_FALSE(superseded(more, frame)) << "one column less";
    EXPECT_TRUE(superseded(more, more));
}

TEST(Superseded, WhatIsNoPlainValueIsKept) {
    const std::vector<Change> frame = {plainOf(300, 1, Vec3f(1, 2, 3))};
    std::vector<Change> named = frame, listed = frame, event = frame;
    named.push_back(plainOf(300, kNoField, String("A")));
    named.back().kind = ChangeKind::setName;
    listed.push_back(plainOf(300, 5, Array<Vec3f>{Vec3f()}));
    event.push_back(plainOf(300, 1, Vec3f()));
    event.back().kind = ChangeKind::event;
    for (const std::vector<Change>& other : {named, listed, event}) {
        EXPECT_FALSE(superseded(other, frame));
        EXPECT_FALSE(superseded(frame, other));
        EXPECT_FALSE(superseded(other, other));
    }
}

/// Posts what a scene publishes, and asks for keyframes.
struct ShadowOfScene : testing::Test, Subscriber {
    Scene scene;
    std::shared_ptr<RecordPool> pool = std::make_shared<RecordPool>();
    const Wakeup wake;
    MirrorShadow shadow{steadyClock(), pool, wake, std::uint64_t{64} << 20};
    ChangeEncoder encoder;
    bool allPosted = true;

    Result<> apply(const Scene&, const ChangeSet& changes) override {
        post(changes);
        return {};
    }
    std::string subscriberName() const override { return "shadow of a scene"; }
    void post(const ChangeSet& changes) {
        const std::shared_ptr<EncodedRecord> record = pool->take();
        encoder.encode(changes, record->bytes);
        record->header = *parseRecordHeader(record->bytes.bytes());
        allPosted = shadow.post(record) && allPosted;
    }
    /// The hash of a scene made of a keyframe; it has all that was posted before.
    Hash128 hashOfKeyframe() {
        shadow.ask({});
        std::vector<MirrorShadow::Answer> answers;
        for (int i = 0; i < 6000 && answers.empty(); ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
            answers = shadow.takeAnswers();
        }
        Scene copy;
        const auto set = std::make_shared<ChangeSet>();
        ChangeDecoder decoder(builtinTypes());
        if (answers.empty() || !decoder.decode(answers[0].record->bytes.bytes(), *set) || !copy.apply(set)) return {};
        EXPECT_EQ(copy.sequence(), scene.sequence());
        return copy.hash();
    }
};

TEST_F(ShadowOfScene, IsWhereTheLastFrameLeadsWhateverItLeavesOut) {
    std::vector<NodeId> nodes;
    for (int i = 0; i < 40; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
    scene.newFrame(0);
    const Attachment attachment = scene.bus().attach(*this);
    for (int frame = 1; frame <= 60; ++frame) {
        // Now all of them, now every third; and once another node.
        for (std::size_t i = 0; i < nodes.size(); i += frame % 20 < 13 ? 1 : 3)
            ASSERT_TRUE(scene.set(nodes[i], x3d::Transform::translation, Vec3f(float(frame), float(i), 0)));
        if (frame == 30) nodes.push_back(scene.createNode(x3d::Transform::type));
        scene.newFrame(frame);
        if (frame % 25 == 0) {
            EXPECT_EQ(hashOfKeyframe(), scene.hash()) << frame;
        }
    }
    EXPECT_EQ(hashOfKeyframe(), scene.hash());
    EXPECT_TRUE(allPosted) << "it was given up";
}

}  // namespace
}  // namespace rtsg
