// Frames merged by a mirror server's replica: one record for all peers that lack the same frames.
#include "server/shadow.h"

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

/// Frames in which one box moves along x, from a keyframe on.
struct MovingBox {
    Scene scene;
    NodeId box;
    ChangeEncoder encoder;
    std::vector<SharedRecord> frames;

    explicit MovingBox(float step, int count = 4) {
        box = scene.createNode(x3d::Transform::type);
        scene.newFrame(0);
        keyframe = encoded(scene.snapshot());
        for (int i = 1; i <= count; ++i) {
            EXPECT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(step * float(i), 0, 0)));
            frames.push_back(encoded(*scene.seal()));
        }
    }
    SharedRecord encoded(const ChangeSet& set) {
        auto record = std::make_shared<EncodedRecord>();
        encoder.encode(set, record->bytes);
        record->header = *parseRecordHeader(record->bytes.bytes());
        return record;
    }
    std::vector<SharedRecord> from(std::size_t first) const {
        return {frames.begin() + std::ptrdiff_t(first), frames.end()};
    }
    SharedRecord keyframe;
};

class MirrorShadows : public testing::Test {
  protected:
    SharedRecord merged(std::uint32_t part, std::vector<SharedRecord> frames) {
        MirrorShadow::Question question;
        question.kind = MirrorShadow::Question::Kind::merge;
        question.part = part;
        question.peer = "somebody";
        question.frames = std::move(frames);
        shadow_.ask(std::move(question));
        std::vector<MirrorShadow::Answer> answers;
        EXPECT_TRUE(test::eventually([&] {
            answers = shadow_.takeAnswers();
            return !answers.empty();
        }));
        return answers.empty() ? nullptr : answers.front().record;
    }
    Wakeup wake_;
    MirrorShadow shadow_{steadyClock(), std::make_shared<RecordPool>(), wake_, 64 << 20};
};

TEST_F(MirrorShadows, PeersThatLackTheSameGetTheSameRecord) {
    const MovingBox moving(1);
    ASSERT_TRUE(shadow_.post(moving.keyframe));
    const SharedRecord all = merged(0, moving.from(0)), some = merged(0, moving.from(2));
    ASSERT_TRUE(all && some);
    EXPECT_EQ(all->header.from, moving.frames[0]->header.from);
    EXPECT_EQ(some->header.from, moving.frames[2]->header.from);
    EXPECT_EQ(all->header.to, moving.frames[3]->header.to);
    EXPECT_EQ(all->header.hash, moving.scene.hash());
    EXPECT_EQ(merged(0, moving.from(0)), all) << "one record for all of them";
    EXPECT_EQ(merged(0, moving.from(2)), some);
}

// Earlier, followers of a part once got frames merged for followers of everything, because the states have the same
// numbers.
TEST_F(MirrorShadows, AnotherPartsFramesAreNotTakenForTheSame) {
    const MovingBox whole(1), other(2);
    ASSERT_TRUE(shadow_.post(whole.keyframe));
    const SharedRecord first = merged(0, whole.from(0)), second = merged(7, other.from(0));
    ASSERT_TRUE(first && second);
    ASSERT_EQ(first->header.to, second->header.to);
    EXPECT_NE(first, second);
    EXPECT_EQ(first->header.hash, whole.scene.hash());
    EXPECT_EQ(second->header.hash, other.scene.hash());
}

}  // namespace
}  // namespace rtsg
