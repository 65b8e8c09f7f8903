// Deflated blocks: what stands for others is read as they are, and forged ones are refused with their place.
#include "codec/deflated_blocks.h"

#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/record.h>

#include "columns/blocks.h"

namespace rtsg {
namespace {

/// Many names and small nodes, and points; `many`: more than are deflated.
void fillScene(Scene& scene, bool many) {
    std::mt19937 random(7);
    for (int i = 0; i < 300; ++i) {
        const NodeId node = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.setName(node, "BOX" + std::to_string(i)));
        EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(i), 0, 1)));
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    }
    Array<std::int32_t> index;
    for (int i = 0; i < (many ? 400'000 : 400); ++i) index.push_back(static_cast<std::int32_t>(random()));
    const NodeId faces = scene.createNode(x3d::IndexedFaceSet::type);
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, index));
    scene.newFrame(0);
}

ByteBuffer smallRecord(const Scene& scene) {
    ByteBuffer record;
    ChangeEncoder encoder;
    encoder.makeSmall();
    encoder.encode(scene.snapshot(), record);
    return record;
}

std::vector<unsigned> blocksOf(const ByteBuffer& record) {
    std::vector<unsigned> kinds;
    wire::Reader in(record.bytes().subspan(kRecordHeaderSize), kRecordHeaderSize);
    while (in.left() && !in.problem) {
        kinds.push_back(in.number<std::uint8_t>());
        (void)in.varint();
        (void)in.part(in.count(1));
    }
    return kinds;
}

TEST(DeflatedBlocks, StandForTheBlocksInThem) {
    for (const bool many : {false, true}) {
        Scene scene;
        fillScene(scene, many);
        const ByteBuffer record = smallRecord(scene);
        ByteBuffer raw;
        ChangeEncoder().encode(scene.snapshot(), raw);
        EXPECT_LT(record.size(), raw.size());
        // Many random numbers stay beside what is deflated, before the names behind them.
        EXPECT_EQ(blocksOf(record), many ? (std::vector<unsigned>{14, 4, 14}) : (std::vector<unsigned>{14}));
        auto set = std::make_shared<ChangeSet>();
        ChangeDecoder decoder(builtinTypes());
        const auto ok = decoder.decode(record.bytes(), *set);
        ASSERT_TRUE(ok) << ok.error().text;
        Scene replica;
        ASSERT_TRUE(replica.apply(set));
        EXPECT_EQ(replica.hash(), scene.hash());
        EXPECT_EQ(replica.dump(), scene.dump());
    }
}

TEST(DeflatedBlocks, FewBytesStayAsTheyAre) {
    ByteBuffer out;
    const std::vector<std::byte> few(60);
    EXPECT_EQ(wire::putDeflated(few, out), 0u);
    EXPECT_EQ(out.size(), 60u);
    std::mt19937 random(7);
    std::vector<std::byte> noise(1000);
    for (std::byte& b : noise) b = std::byte(random());
    out.clear();
    EXPECT_EQ(wire::putDeflated(noise, out), 0u) << "what does not get shorter";
    EXPECT_EQ(out.size(), 1000u);
}

/// A payload of one deflated block, as somebody forges it.
struct Forged {
    std::vector<std::byte> bytes;
    explicit Forged(std::uint64_t size, std::span<const std::byte> stream) {
        ByteBuffer body, whole;
        body.putVarint(size);
        body.append(stream);
        whole.put(static_cast<std::uint8_t>(wire::kDeflated));
        whole.putVarint(0);
        whole.putVarint(body.size());
        whole.append(body.bytes());
        bytes.assign(whole.data(), whole.data() + whole.size());
    }
    std::string problem() const {
        wire::Reader in(bytes);
        wire::Budget budget(bytes.size());
        in.budget = &budget;
        const auto blocks = wire::inflateBlocks(in);
        EXPECT_TRUE(blocks || in.problem);
        return in.problem ? in.problem : "";
    }
};

TEST(DeflatedBlocks, ForgedOnesAreRefused) {
    const std::vector<std::byte> zeros(100'000);
    ByteBuffer good;
    ASSERT_EQ(wire::putDeflated(zeros, good), zeros.size());
    wire::Reader in(good.bytes());
    (void)in.number<std::uint8_t>();
    (void)in.varint();
    wire::Reader body = in.part(in.count(1));
    (void)body.varint();
    const std::span<const std::byte> stream(body.at, body.left());
    EXPECT_EQ(Forged(zeros.size(), stream).problem(), "");
    EXPECT_EQ(Forged(zeros.size() - 1, stream).problem(), "a deflated block is damaged");
    EXPECT_EQ(Forged(zeros.size() + 1, stream).problem(), "a deflated block is damaged");
    EXPECT_EQ(Forged(zeros.size(), stream.first(stream.size() - 1)).problem(), "a deflated block is damaged");
    std::vector<std::byte> longer(stream.begin(), stream.end());
    longer.push_back({});
    EXPECT_EQ(Forged(zeros.size(), longer).problem(), "a deflated block is damaged");
    // A stream that claims to unpack to a gigabyte takes no memory.
    EXPECT_EQ(Forged(std::uint64_t{1} << 30, stream).problem(), "takes more memory than a record of this length may");
    EXPECT_EQ(Forged(std::uint64_t{1} << 40, stream).problem(), "more blocks in a deflated one than can be");
}

/// One within another is a block that this version does not know.
TEST(DeflatedBlocks, HoldNoOthers) {
    Scene scene;
    fillScene(scene, false);
    const ByteBuffer record = smallRecord(scene);
    ByteBuffer nested;
    nested.room(2 * record.size());
    nested.advance(kRecordHeaderSize);
    std::vector<std::byte> inner(record.data() + kRecordHeaderSize, record.data() + record.size());
    while (inner.size() < 100'000) {  // fillers, so that it gets shorter
        inner.push_back(std::byte(wire::kFiller));
        inner.insert(inner.end(), 2, std::byte(0));
    }
    ASSERT_GT(wire::putDeflated(inner, nested), 0u);
    sealRecord(nested, *parseRecordHeader(record.bytes()));
    ChangeSet set;
    ChangeDecoder decoder(builtinTypes());
    ASSERT_TRUE(decoder.decode(nested.bytes(), set));
    EXPECT_TRUE(set.changes.empty());
    EXPECT_EQ(decoder.losses().blocks, 1u);
}

TEST(DeflatedBlocks, DamageIsAnErrorAndNothingElse) {
    Scene scene;
    fillScene(scene, false);
    const ByteBuffer record = smallRecord(scene);
    std::mt19937 random(20261121);
    int refused = 0;
    for (int round = 0; round < 400; ++round) {
        SCOPED_TRACE(testing::Message() << "seed 20261121, round " << round);
        std::vector<std::byte> bytes(record.data(), record.data() + record.size());
        bytes[kRecordHeaderSize + random() % (bytes.size() - kRecordHeaderSize)] ^= std::byte(1u << random() % 8);
        ChangeSet set;
        ChangeDecoder decoder(builtinTypes());
        refused += !decoder.decode(bytes, set);
    }
    EXPECT_GT(refused, 100) << "a record has a sum of its own, which finds the others";
}

}  // namespace
}  // namespace rtsg
