// Predicted columns: whatever the values and wherever a reader starts, what comes out is what went in.
#include <rtsg/core/change_composer.h>
#include <rtsg/sync/change_codec.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "random_sets.h"

namespace rtsg {
namespace {

using test::RandomSets;

std::vector<Change> sorted(std::vector<Change> changes) {
    std::ranges::stable_sort(changes, {}, [](const Change& c) { return std::pair(c.node.value, c.field); });
    return changes;
}
std::string text(const Result<>& result) {
    return result ? "" : result.error().text;
}

/// Values of every predicted type that move, rest, jump and are no numbers; nodes in and out of order.
class Moving {
  public:
    explicit Moving(std::uint64_t seed) : random(seed) {
        constexpr FieldType kTypes[] = {FieldType::SFFloat,   FieldType::SFVec2f, FieldType::SFVec3f,
                                        FieldType::SFColor,   FieldType::SFVec4f, FieldType::SFColorRGBA,
                                        FieldType::SFRotation};
        for (std::uint32_t i = 0; i < 160; ++i) {
            Body body;
            body.node = i < 80 ? 10 + 2 * i : 1 + random.below(1u << (8 + i % 24));
            body.field = static_cast<FieldIndex>(3 + i % 7);
            body.type = kTypes[i % 7];
            for (float& x : body.at) x = random.real();
            for (float& x : body.speed) x = random.real() * 1e-3f;
            if (std::ranges::none_of(bodies_,
                                     [&](const Body& b) { return b.node == body.node && b.field == body.field; }))
                bodies_.push_back(body);
        }
    }

    ChangeSet next() {
        ChangeSet set;
        set.from = ++frame_;
        set.to = frame_ + 1;
        for (Body& body : bodies_) {
            if (random.below(4) == 0) continue;
            for (int l = 0; l < 4; ++l) {
                body.at[l] += body.speed[l];
                if (random.below(30) == 0) body.speed[l] = random.real() * 1e-3f;
                if (random.below(60) == 0) body.at[l] = random.anyBits<float>();
                if (random.below(60) == 0) body.at[l] = -0.f;
                if (random.below(100) == 0) body.at[l] = std::numeric_limits<float>::max();
            }
            Change change;
            change.node = NodeId{body.node};
            change.field = body.field;
            change.external = body.node % 3 == 0;
            change.value = Value::fromStorage(body.type, body.at);
            set.changes.push_back(change);
        }
        return set;
    }
    RandomSets random;

  private:
    struct Body {
        std::uint32_t node = 0;
        FieldIndex field = 0;
        FieldType type = FieldType::SFFloat;
        float at[4], speed[4];
    };
    std::vector<Body> bodies_;
    std::uint64_t frame_ = 0;
};

/// A rotation whose axis has unit length, so that one component follows from the others.
Rotation turning(double t) {
    const double x = std::sin(t), y = std::cos(t) * .6, z = std::sqrt(std::max(0., 1 - x * x - y * y));
    return {float(x), float(y), float(std::fmod(t, 2) < 1 ? z : -z), float(t)};
}

StreamMode modeOf(Coding coding) {
    StreamMode mode;
    mode.coding = coding;
    return mode;
}

class PredictedColumns : public testing::TestWithParam<Coding> {};
INSTANTIATE_TEST_SUITE_P(Codings, PredictedColumns, testing::Values(Coding::compact, Coding::smallest),
                         [](const auto& p) { return std::string(nameOf(p.param)); });

TEST_P(PredictedColumns, CarryAnyValuesBitForBit) {
    const std::uint64_t seed = 4711;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Moving moving(seed);
    ChangeEncoder encoder(modeOf(GetParam()));
    ChangeDecoder decoder({});
    ByteBuffer record;
    ChangeSet found;
    for (int frame = 0; frame < 300; ++frame) {
        ChangeSet set = moving.next();
        if (frame % 17 == 3 && !set.changes.empty()) set.changes.push_back(set.changes[frame % 5]);  // set twice
        encoder.encode(set, record);
        const Result<> decoded = decoder.decode(record.bytes(), found);
        ASSERT_TRUE(decoded) << "frame " << frame << ": " << text(decoded);
        ASSERT_EQ(sorted(set.changes), sorted(found.changes)) << "frame " << frame;
    }
}

TEST_P(PredictedColumns, RotationsAboutAUnitAxisTakeFewBytes) {
    ChangeEncoder encoder(modeOf(GetParam()));
    ChangeDecoder decoder({});
    ByteBuffer record;
    ChangeSet found;
    std::size_t bytes = 0;
    for (int frame = 0; frame < 100; ++frame) {
        ChangeSet set;
        set.from = static_cast<std::uint64_t>(frame) + 1;
        set.to = set.from + 1;
        for (std::uint32_t i = 0; i < 500; ++i) {
            Change change;
            change.node = NodeId{5 + i};
            change.field = 4;
            change.value = turning(frame * .01 + i * .37);
            set.changes.push_back(change);
        }
        encoder.encode(set, record);
        ASSERT_TRUE(decoder.decode(record.bytes(), found));
        ASSERT_TRUE(found.changes == set.changes) << frame;
        if (frame >= 50) bytes += record.size();
    }
    EXPECT_LT(bytes / 25000., 8);
}

TEST_P(PredictedColumns, AReaderGoesOnFromWhereTheFlagsSay) {
    const std::uint64_t seed = 99;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Moving moving(seed);
    ChangeEncoder encoder(modeOf(GetParam())), merging(modeOf(GetParam()));
    std::vector<std::shared_ptr<const ChangeSet>> sets;
    std::vector<ByteBuffer> records;
    std::vector<std::uint8_t> flags;
    for (int frame = 0; frame < 200; ++frame) {
        sets.push_back(std::make_shared<ChangeSet>(moving.next()));
        if (frame == 120) encoder.restart();
        encoder.encode(*sets.back(), records.emplace_back());
        flags.push_back(parseRecordHeader(records.back().bytes())->flags);
    }
    EXPECT_TRUE(flags[0] & kForget);
    EXPECT_TRUE(flags[120] & kForget);
    EXPECT_EQ(std::ranges::count_if(flags, [](auto f) { return (f & kForget) != 0; }), 2);
    EXPECT_GE(std::ranges::count_if(flags, [](auto f) { return (f & kSync) != 0; }), 6);

    // Frames merged into one, at random; after that only from a frame with kSync on.
    RandomSets random(seed);
    ChangeDecoder decoder({});
    ChangeSet found;
    ByteBuffer merged;
    std::size_t merges = 0;
    for (std::size_t frame = 0; frame < records.size();) {
        std::size_t end = frame + 1 + random.below(9);
        while (end < records.size() && !(flags[end] & kSync)) ++end;
        if (random.coin() && end < records.size()) {
            const ChangeSet set = compose(std::span(sets).subspan(frame, end - frame));
            merging.encodeMerged(set, merged);
            const Result<> decoded = decoder.decode(merged.bytes(), found);
            ASSERT_TRUE(decoded) << text(decoded);
            ASSERT_EQ(sorted(set.changes), sorted(found.changes));
            frame = end;
            ++merges;
        } else {
            const Result<> decoded = decoder.decode(records[frame].bytes(), found);
            ASSERT_TRUE(decoded) << "frame " << frame << ": " << text(decoded);
            ASSERT_EQ(sorted(sets[frame]->changes), sorted(found.changes)) << "frame " << frame;
            ++frame;
        }
    }
    EXPECT_GT(merges, 1u);

    // From a keyframe: at the restart, and nowhere else.
    ChangeDecoder late({});
    for (std::size_t frame = 120; frame < records.size(); ++frame) {
        ASSERT_TRUE(late.decode(records[frame].bytes(), found)) << frame;
        ASSERT_EQ(sorted(sets[frame]->changes), sorted(found.changes)) << frame;
    }
    ChangeDecoder wrong({});
    const Result<> refused = wrong.decode(records[60].bytes(), found);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text.find("the stream has given"), std::string::npos) << refused.error().text;

    // A second reader takes over where another one is.
    ChangeDecoder first({});
    for (std::size_t frame = 0; frame < 77; ++frame) ASSERT_TRUE(first.decode(records[frame].bytes(), found));
    ChangeDecoder second({});
    second.goOnFrom(first);
    for (std::size_t frame = 77; frame < records.size(); ++frame) {
        ASSERT_TRUE(second.decode(records[frame].bytes(), found)) << frame;
        ASSERT_EQ(sorted(sets[frame]->changes), sorted(found.changes)) << frame;
    }
}

TEST_P(PredictedColumns, AKeyframeStartsAfresh) {
    Moving moving(5);
    ChangeEncoder encoder(modeOf(GetParam()));
    ChangeDecoder follower({}), late({});
    ByteBuffer record;
    ChangeSet found;
    for (int frame = 0; frame < 60; ++frame) {
        const ChangeSet set = moving.next();
        encoder.encode(set, record);
        ASSERT_TRUE(follower.decode(record.bytes(), found));
        ASSERT_EQ(sorted(set.changes), sorted(found.changes));
        if (frame > 30) {
            ASSERT_TRUE(late.decode(record.bytes(), found)) << frame;
            ASSERT_EQ(sorted(set.changes), sorted(found.changes));
        }
        if (frame != 30) continue;
        ChangeSet snapshot = set;
        snapshot.from = 0;
        encoder.encode(snapshot, record);
        ASSERT_EQ(parseRecordHeader(record.bytes())->flags, 0);
        ASSERT_TRUE(late.decode(record.bytes(), found));
        ASSERT_EQ(sorted(set.changes), sorted(found.changes)) << "keyframes predict nothing";
    }
}

TEST_P(PredictedColumns, CutAndBentRecordsAreRefusedOrDecodedNeverWorse) {
    const std::uint64_t seed = 12;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Moving moving(seed);
    ChangeEncoder encoder(modeOf(GetParam()));
    ChangeDecoder honest({});
    ByteBuffer record;
    ChangeSet found;
    for (int frame = 0; frame < 5; ++frame) {
        encoder.encode(moving.next(), record);
        ASSERT_TRUE(honest.decode(record.bytes(), found));
    }
    encoder.encode(moving.next(), record);
    const RecordHeader header = *parseRecordHeader(record.bytes());
    std::size_t refused = 0, tries = 0;
    const auto attempt = [&](ByteBuffer& bent) {
        sealRecord(bent, header);
        ChangeDecoder decoder({});
        decoder.goOnFrom(honest);
        const Result<> decoded = decoder.decode(bent.bytes(), found);
        ++tries;
        refused += !decoded;
        if (!decoded) {
            EXPECT_NE(decoded.error().text.find("at byte "), std::string::npos) << decoded.error().text;
        }
        EXPECT_LE(found.changes.size(), bent.size() + 1000);
    };
    for (std::size_t size = kRecordHeaderSize; size < record.size(); ++size) {
        ByteBuffer bent;
        bent.append(record.bytes().first(size));
        attempt(bent);
    }
    EXPECT_GT(refused, tries * 9 / 10) << "of cuts";
    for (std::size_t at = kRecordHeaderSize; at < record.size(); ++at) {
        for (int bit = 0; bit < 8; bit += GetParam() == Coding::smallest ? 1 : 3) {
            ByteBuffer bent;
            bent.append(record.bytes());
            bent.data()[at] ^= std::byte{1} << bit;
            attempt(bent);
        }
    }
    EXPECT_GT(refused, tries / 20);
}

TEST(PredictedColumns, FollowASteadyStreamWithoutRunningAway) {
    // Nodes come and go for ever; what is remembered stays bounded because the writer forgets.
    ChangeEncoder encoder(modeOf(Coding::compact));
    ByteBuffer record;
    ChangeSet set;
    Change change;
    change.value = Vec3f(1, 2, 3);
    change.field = 3;
    std::uint32_t node = 1;
    int forgotten = 0;
    for (std::uint64_t frame = 1; frame <= 60; ++frame) {
        set.from = frame;
        set.to = frame + 1;
        set.changes.clear();
        for (int i = 0; i < 50000; ++i) {
            change.node = NodeId{node++};
            set.changes.push_back(change);
        }
        encoder.encode(set, record);
        forgotten += (parseRecordHeader(record.bytes())->flags & kForget) != 0;
    }
    EXPECT_GE(forgotten, 2);
    EXPECT_LE(forgotten, 4);
}

TEST(PredictedColumns, RefuseForgedLists) {
    const auto decode = [](const ByteBuffer& payload) {
        ChangeEncoder encoder(modeOf(Coding::compact));
        ChangeDecoder decoder({});
        ChangeSet set, found;
        set.from = 1;
        set.to = 2;
        for (std::uint32_t i = 1; i <= 3; ++i) {
            Change change;
            change.node = NodeId{i};
            change.field = 3;
            change.value = 1.5f;
            set.changes.push_back(change);
        }
        ByteBuffer record;
        encoder.encode(set, record);
        EXPECT_TRUE(decoder.decode(record.bytes(), found));
        record.clear();
        record.room(kRecordHeaderSize);
        record.advance(kRecordHeaderSize);
        record.put(std::uint8_t{4});
        record.putVarint(3);
        record.putVarint(payload.size());
        record.append(payload.bytes());
        RecordHeader header;
        header.flags = kRemember;
        header.from = 2;
        header.to = 3;
        sealRecord(record, header);
        return text(decoder.decode(record.bytes(), found));
    };
    const auto column = [](std::initializer_list<int> bytes) {
        ByteBuffer result;
        for (const int byte : bytes) result.put(static_cast<std::uint8_t>(byte));
        return result;
    };
    constexpr int kFloat = 4;
    EXPECT_EQ(decode(column({1, 0, kFloat, 3, 2, 1, 2, 2, 2, 0, 0, 0, 0, 0})), "");  // a run: 1, 2, 3
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 2, 1, 2, 2, 0, 0, 0, 0, 0, 0})), "");  // three times the same
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 2, 1, 2, 9, 2, 0, 0, 0, 0, 0})), "");  // longer than the column
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 2, 1, 2, 1, 2, 0, 0, 0, 0, 0})), "");  // shorter
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 4, 0, 0, 0, 0, 0})), "");              // as before, but nothing was
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 6, 0, 0, 0, 0, 0})), "");              // gaps without a range coder
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 9, 0, 0, 0, 0, 0})), "");              // no such list
    EXPECT_NE(decode(column({1, 0, kFloat, 9, 2, 1, 2, 2, 2, 0, 0, 0, 0, 0})), "");  // a field never given
    EXPECT_NE(decode(column({1, 0, 10, 3, 2, 1, 2, 2, 2, 0, 0, 0, 0, 0})), "");      // strings are not predicted
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 3, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 2, 2, 0, 0, 0})),
              "");  // grid of width 0
    EXPECT_NE(decode(column({1, 0, kFloat, 3, 3, 0, 0, 0, 0, 0, 0, 0xF0, 0x7F, 1, 2, 2, 2, 0, 0, 0})), "");
}

}  // namespace
}  // namespace rtsg
