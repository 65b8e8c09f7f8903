// Change sets through the codec and back, and damage to records.
#include <rtsg/sync/change_codec.h>

#include <algorithm>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/x3d.h>

#include "random_sets.h"

namespace rtsg {
namespace {

using test::RandomSets;

Change valueChange(std::uint32_t node, FieldIndex field, Value value, bool external = true) {
    Change change;
    change.node = NodeId{node};
    change.field = field;
    change.external = external;
    change.value = std::move(value);
    return change;
}

bool isColumnValue(const Change& c) {
    return c.kind == ChangeKind::setField && sf(c.value.type()) != FieldType::SFNode;
}

/// The order the codec promises, built the slow way: links before values, values grouped by first appearance.
std::vector<Change> canonical(const std::vector<Change>& changes) {
    std::vector<std::tuple<FieldIndex, FieldType, bool>> keys;
    const auto keyOf = [](const Change& c) { return std::tuple(c.field, c.value.type(), bool{c.external}); };
    for (const Change& c : changes)
        if (isColumnValue(c) && std::ranges::find(keys, keyOf(c)) == keys.end()) keys.push_back(keyOf(c));
    const auto rank = [&](const Change& c) -> std::size_t {
        if (isColumnValue(c)) return 1000 + static_cast<std::size_t>(std::ranges::find(keys, keyOf(c)) - keys.begin());
        if (c.kind <= ChangeKind::createNode) return static_cast<std::size_t>(c.kind);
        return c.kind <= ChangeKind::removeChild ? 2
               : c.kind == ChangeKind::setName   ? 100000
               : c.kind == ChangeKind::addRoute || c.kind == ChangeKind::removeRoute
                   ? 100001
                   : 100002 + static_cast<std::size_t>(c.kind);
    };
    std::vector<Change> result = changes;
    std::ranges::stable_sort(result, {}, rank);
    return result;
}

void expectSame(const NodeType& a, const NodeType& b) {
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.component, b.component);
    EXPECT_EQ(a.level, b.level);
    EXPECT_EQ(a.kind, b.kind);
    EXPECT_EQ(a.containerField, b.containerField);
    EXPECT_EQ(a.implements, b.implements);
    EXPECT_EQ(a.declaration, b.declaration);
    ASSERT_EQ(a.fields.size(), b.fields.size());
    EXPECT_EQ(a.blockSize(), b.blockSize());
    for (std::size_t i = 0; i < a.fields.size(); ++i) {
        const FieldDef &x = a.fields[i], &y = b.fields[i];
        EXPECT_EQ(x.name, y.name);
        EXPECT_EQ(x.type, y.type);
        EXPECT_EQ(x.access, y.access);
        EXPECT_EQ(x.aspect, y.aspect);
        EXPECT_TRUE(x.defaultValue == y.defaultValue);
        EXPECT_EQ(std::bit_cast<std::uint64_t>(x.min), std::bit_cast<std::uint64_t>(y.min));
        EXPECT_EQ(x.max, y.max);
        EXPECT_EQ(x.exclusiveMin, y.exclusiveMin);
        EXPECT_EQ(x.hidden, y.hidden);
        EXPECT_EQ(x.allowed, y.allowed);
        EXPECT_EQ(x.accepts, y.accepts);
        EXPECT_EQ(x.offset, y.offset);
    }
}

void expectSame(const ChangeSet& expected, const ChangeSet& found) {
    EXPECT_EQ(expected.from, found.from);
    EXPECT_EQ(expected.to, found.to);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(expected.time), std::bit_cast<std::uint64_t>(found.time));
    EXPECT_EQ(expected.hash, found.hash);
    const std::vector<Change> wanted = canonical(expected.changes);
    ASSERT_EQ(wanted.size(), found.changes.size());
    for (std::size_t i = 0; i < wanted.size(); ++i)
        ASSERT_TRUE(wanted[i] == found.changes[i]) << "change " << i << " of kind " << int(wanted[i].kind);
    ASSERT_EQ(expected.types.size(), found.types.size());
    for (std::size_t i = 0; i < expected.types.size(); ++i) {
        EXPECT_EQ(expected.types[i].index, found.types[i].index);
        expectSame(*expected.types[i].type, *found.types[i].type);
    }
}

TEST(ChangeCodec, RoundTripsRandomSetsOfEveryKindAndType) {
    const std::uint64_t seed = 20090616;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    RandomSets random(seed);
    ChangeEncoder encoder({}, {});  // nothing to describe: bytes depend on the set alone
    ChangeDecoder decoder({});
    ByteBuffer record, again;
    ChangeSet found;
    std::uint64_t kinds = 0, types = 0;
    for (int round = 0; round < 300; ++round) {
        SCOPED_TRACE(testing::Message() << "round " << round);
        const ChangeSet set = random.set(1 + random.below(40));
        encoder.encode(set, record);
        ASSERT_TRUE(checkRecord(record.bytes()));
        const Result<> decoded = decoder.decode(record.bytes(), found);
        ASSERT_TRUE(decoded) << decoded.error().text;
        expectSame(set, found);
        if (HasFatalFailure()) return;
        encoder.encode(found, again);
        ASSERT_TRUE(std::ranges::equal(record.bytes(), again.bytes()));
        for (const Change& change : set.changes) {
            kinds |= std::uint64_t{1} << static_cast<unsigned>(change.kind);
            types |= std::uint64_t{1} << static_cast<unsigned>(change.value.type());
        }
    }
    EXPECT_EQ(kinds, (std::uint64_t{1} << 10) - 1);
    EXPECT_EQ(types, (std::uint64_t{1} << kFieldTypeCount) - 1);
}

/// Records are read over what a set held before: nothing of that stays, be it more, less, or of another kind.
TEST(ChangeCodec, ASetThatIsReadOverKeepsNothingOfWhatItHeld) {
    std::mt19937 random(5);
    ChangeSet filled = RandomSets(3).set(200), found;
    filled.changes.resize(40);
    for (std::uint32_t round = 0; round < 60; ++round) {
        ChangeSet set;
        set.from = 1;
        set.to = 2;
        for (std::uint32_t i = 0, count = random() % 1000; i < count; ++i) {
            if (round % 2)
                set.changes.push_back(valueChange(100 + i, 3, Vec3f(float(i), 0, float(round))));
            else
                set.changes.push_back(valueChange(100 + i, i > count / 2 ? 7 : 3, Rotation{0, 1, 0, float(i)}));
        }
        if (round % 5 == 0) found = filled;
        if (round % 7 == 0) set.changes.push_back(valueChange(9, 11, String("of any length")));
        ByteBuffer record;
        ChangeEncoder({}, {}).encode(set, record);
        ASSERT_TRUE(ChangeDecoder({}).decode(record.bytes(), found)) << round;
        expectSame(set, found);
        if (HasFatalFailure()) return;
    }
}

/// At most the part up to the damage was read.
TEST(ChangeCodec, ADamagedRecordLeavesNothingOfTheOneBefore) {
    ChangeSet set, found;
    set.from = 1;
    set.to = 2;
    for (std::uint32_t i = 0; i < 100; ++i) set.changes.push_back(valueChange(100 + i, 3, Vec3f(1, 2, 3)));
    ByteBuffer record;
    ChangeEncoder({}, {}).encode(set, record);
    ASSERT_TRUE(ChangeDecoder({}).decode(record.bytes(), found));
    ASSERT_EQ(found.changes.size(), 100u);
    std::vector<std::byte> damaged(record.bytes().begin(), record.bytes().end());
    damaged[kRecordHeaderSize + 5] = std::byte{99};  // behind kind, count, length and coding: no flags there are
    EXPECT_FALSE(ChangeDecoder({}).decode(damaged, found));
    EXPECT_TRUE(found.changes.empty());
}

TEST(ChangeCodec, KeepsExtremeNodeNumbersInAnyOrder) {
    ChangeSet set;
    set.from = 1;
    set.to = 2;
    for (const std::uint32_t node : {0u, 0xFFFFFFFFu, 1u, 0x80000000u, 0x7FFFFFFFu, 0u})
        set.changes.push_back(valueChange(node, 3, Vec3f(1, 2, 3)));
    ByteBuffer record;
    ChangeEncoder().encode(set, record);
    ChangeSet found;
    ASSERT_TRUE(ChangeDecoder({}).decode(record.bytes(), found));
    expectSame(set, found);
}

TEST(ChangeCodec, TakesThirteenBytesForAMovedNeighbour) {
    ChangeSet set;
    set.from = 7;
    set.to = 8;
    for (std::uint32_t i = 0; i < 10000; ++i) set.changes.push_back(valueChange(100 + i, 5, Vec3f(float(i), 0, 0)));
    ByteBuffer record;
    ChangeEncoder().encode(set, record);
    EXPECT_LE(record.size(), 10000 * 13 + kRecordHeaderSize + 16);
}

/// A record whose checksum is right whatever its payload: what a hostile peer would send.
ByteBuffer resealed(std::span<const std::byte> record, RecordHeader header) {
    ByteBuffer result;
    result.append(record);
    sealRecord(result, header);
    return result;
}

/// No scene of ours sends such a record, but nothing forbids it to a peer.
TEST(ChangeCodec, AReplicaOfARecordThatNamesAFieldTwiceHasTheHashOfItsContents) {
    ChangeEncoder encoder;
    ChangeDecoder decoder({});
    Scene replica;
    const NodeId a = replica.createNode(x3d::Transform::type), b = replica.createNode(x3d::Transform::type);
    replica.seal();
    const auto at = [](NodeId node, float x) {
        return valueChange(node.value, x3d::Transform::translation.index, Vec3f(x, 0, 0));
    };
    for (const auto& changes : {std::vector{at(a, 1), at(b, 1), at(b, 2)}, std::vector{at(a, 2), at(b, 3)}}) {
        ChangeSet set;
        set.from = replica.sequence();
        set.to = set.from + 1;
        set.changes = changes;
        ByteBuffer record;
        encoder.encode(set, record);
        const auto decoded = std::make_shared<ChangeSet>();
        ASSERT_TRUE(decoder.decode(record.bytes(), *decoded));
        ASSERT_TRUE(replica.apply(decoded));
        Hash128 sum;
        replica.forEachNode([&](const Node& node) { sum = sum + hashOfNode(replica, node); });
        EXPECT_EQ(replica.hash(), sum);
    }
    EXPECT_EQ(replica.node(b).value(x3d::Transform::translation.index), Value(Vec3f(3, 0, 0)));
}

TEST(ChangeCodec, EveryTruncationAndBitFlipOfARecordIsDetected) {
    const std::uint64_t seed = 4;
    RandomSets random(seed);
    ByteBuffer record;
    ChangeEncoder().encode(random.set(8), record);
    for (std::size_t size = 0; size < record.size(); ++size) {
        const Result<RecordHeader> found = checkRecord(record.bytes().first(size));
        ASSERT_FALSE(found) << size;
        EXPECT_NE(found.error().text.find("at byte "), std::string::npos);
    }
    for (std::size_t bit = 0; bit < record.size() * 8; ++bit) {
        record.data()[bit / 8] ^= std::byte{1} << (bit % 8);
        ASSERT_FALSE(checkRecord(record.bytes())) << "bit " << bit;
        record.data()[bit / 8] ^= std::byte{1} << (bit % 8);
    }
    EXPECT_TRUE(checkRecord(record.bytes()));
}

TEST(ChangeCodec, HostilePayloadsAreRefusedOrDecodedNeverWorse) {
    const std::uint64_t seed = 99;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    RandomSets random(seed);
    ChangeDecoder decoder({});
    ChangeSet found;
    std::size_t refused = 0, tries = 0;
    for (int round = 0; round < 60; ++round) {
        ByteBuffer record;
        ChangeEncoder().encode(random.set(6), record);
        const Result<RecordHeader> header = parseRecordHeader(record.bytes());
        ASSERT_TRUE(header);
        for (std::size_t size = kRecordHeaderSize; size < record.size(); ++size) {
            const ByteBuffer cut = resealed(record.bytes().first(size), *header);
            ++tries;
            refused += !decoder.decode(cut.bytes(), found);
        }
        for (int flips = 0; flips < 300; ++flips) {
            ByteBuffer bent = resealed(record.bytes(), *header);
            for (std::uint32_t n = 1 + random.below(3); n > 0 && bent.size() > kRecordHeaderSize; --n)
                bent.data()[kRecordHeaderSize + random.below(std::uint32_t(bent.size() - kRecordHeaderSize))] =
                    static_cast<std::byte>(random.below(256));
            ++tries;
            const Result<> decoded = decoder.decode(bent.bytes(), found);
            refused += !decoded;
            if (!decoded) {
                EXPECT_NE(decoded.error().text.find("at byte "), std::string::npos) << decoded.error().text;
            }
            // Each change takes a byte at least, so what was decoded cannot outgrow what came in.
            EXPECT_LE(found.changes.size(), bent.size());
        }
    }
    EXPECT_GT(refused, tries / 4);
}

TEST(ChangeCodec, RefusesACountThatTheBytesCannotHold) {
    ByteBuffer record;
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    record.put(std::uint8_t{7});  // destroy
    record.putVarint(std::uint64_t{1} << 60);
    record.putVarint(1);
    record.put(std::uint8_t{0});
    RecordHeader header;
    header.from = 1;
    header.to = 2;
    sealRecord(record, header);
    ChangeSet found;
    const Result<> decoded = ChangeDecoder({}).decode(record.bytes(), found);
    ASSERT_FALSE(decoded);
    EXPECT_NE(decoded.error().text.find("count exceeds"), std::string::npos) << decoded.error().text;
}

TEST(ChangeCodec, SkipsBlocksAndCodingsOfALaterFormat) {
    ByteBuffer record;
    ChangeSet set;
    set.from = 1;
    set.to = 2;
    set.changes.push_back(valueChange(3, 4, 2.5f));
    ChangeEncoder().encode(set, record);
    record.put(std::uint8_t{4});  // a column ...
    record.putVarint(1);
    record.putVarint(3);
    record.put(std::uint8_t{77});  // ... in an unknown coding
    record.put(std::uint16_t{0});
    record.put(std::uint8_t{200});  // an unknown block
    record.putVarint(1);
    record.putVarint(2);
    record.put(std::uint16_t{0});
    RecordHeader header;
    header.from = 1;
    header.to = 2;
    sealRecord(record, header);
    ChangeDecoder decoder({});
    ChangeSet found;
    const Result<> decoded = decoder.decode(record.bytes(), found);
    ASSERT_TRUE(decoded) << decoded.error().text;
    ASSERT_EQ(found.changes.size(), 1u);
    EXPECT_TRUE(found.changes[0] == set.changes[0]);
    EXPECT_EQ(decoder.losses().blocks, 2u);
}

TEST(Head, RoundTripsAndDetectsDamage) {
    const std::uint64_t seed = 17;
    RandomSets random(seed);
    std::vector<std::unique_ptr<NodeType>> types;
    for (int i = 0; i < 20; ++i) types.push_back(random.type("Type" + std::to_string(i)));
    const StreamMode mode{Mode::lossy, Coding::smallest, 1e-3};
    ByteBuffer record;
    encodeHead(0x1234567890ABCDEF, "a test", types, mode, record);
    ASSERT_TRUE(checkRecord(record.bytes()));
    EXPECT_LT(record.size(), 128u);
    const Result<StreamHead> head = decodeHead(record.bytes());
    ASSERT_TRUE(head) << head.error().text;
    EXPECT_EQ(head->epoch, 0x1234567890ABCDEFu);
    EXPECT_EQ(head->creator, "a test");
    EXPECT_EQ(head->dictionaryHash, dictionaryHash(types));
    EXPECT_EQ(head->builtinTypes, 20u);
    EXPECT_TRUE(head->mode == mode);
    const Result<RecordHeader> header = parseRecordHeader(record.bytes());
    for (std::size_t size = kRecordHeaderSize; size < record.size(); ++size)
        ASSERT_FALSE(decodeHead(resealed(record.bytes().first(size), *header).bytes())) << size;
    record.put(std::uint64_t{7});  // what a later version may append
    EXPECT_TRUE(decodeHead(resealed(record.bytes(), *header).bytes()));
    for (const auto& [at, byte] :
         {std::pair{2, kFormatVersion + 1}, {22, 3}}) {  // readers too old for it; a mode of later
        ByteBuffer bent;
        bent.append(record.bytes());
        bent.data()[kRecordHeaderSize + static_cast<std::size_t>(at)] = static_cast<std::byte>(byte);
        EXPECT_EQ(bool(decodeHead(resealed(bent.bytes(), *header).bytes())), false) << at;
    }
}

/// `name(field:type=default, ...)` in the order given.
std::unique_ptr<NodeType> makeType(std::string name, std::vector<std::pair<std::string, Value>> fields) {
    auto type = std::make_unique<NodeType>();
    type->name = std::move(name);
    for (auto& [fieldName, value] : fields) {
        FieldDef field;
        field.name = fieldName;
        field.type = value.type();
        field.defaultValue = value;
        type->fields.push_back(std::move(field));
    }
    if (!type->finish()) std::abort();
    return type;
}

TEST(Dictionary, AReaderOfAnotherVersionMapsByNameAndKeepsUnknownTypes) {
    std::vector<std::unique_ptr<NodeType>> origin, local;
    origin.push_back(makeType("Group", {{"children", Array<NodeId>{}}}));
    origin.push_back(makeType("Novel", {{"power", 1.f}}));
    origin.push_back(makeType("Transform", {{"bend", 0.f}, {"scale", Vec3f(1)}, {"translation", Vec3f(0)}}));
    local.push_back(makeType("Transform", {{"translation", Vec3f(0)}, {"scale", Vec3f(2)}}));
    local.push_back(makeType("Group", {{"bboxSize", Vec3f(-1)}, {"children", Array<NodeId>{}}}));

    ChangeSet set;
    set.to = 5;
    const auto create = [&](std::uint32_t node, std::uint32_t type) {
        Change change;
        change.kind = ChangeKind::createNode;
        change.node = NodeId{node};
        change.index = type;
        set.changes.push_back(change);
    };
    Change define;
    define.kind = ChangeKind::defineType;
    define.index = 3;
    set.changes.push_back(define);
    set.types.push_back({TypeIndex{3}, makeType("MyProto", {{"p", 0.5f}})});
    create(2, 0);
    create(3, 1);
    create(4, 2);
    create(5, 3);
    set.changes.push_back(valueChange(2, 0, Array<NodeId>{NodeId{3}, NodeId{4}}));
    set.changes.push_back(valueChange(3, 0, 9.f));
    set.changes.push_back(valueChange(4, 0, 1.f));             // bend: unknown here
    set.changes.push_back(valueChange(4, 2, Vec3f(4, 5, 6)));  // translation
    set.changes.push_back(valueChange(5, 0, 0.75f));

    ByteBuffer headRecord, record;
    encodeHead(1, "newer", origin, {}, headRecord);
    const Result<StreamHead> head = decodeHead(headRecord.bytes());
    ASSERT_TRUE(head);
    ChangeDecoder decoder(local);
    ASSERT_TRUE(decoder.setHead(*head));
    EXPECT_FALSE(decoder.exact());
    ChangeEncoder({}, origin).encode(set, record);
    for (int pass = 0; pass < 2; ++pass) {  // a second snapshot starts over
        ChangeSet found;
        const Result<> decoded = decoder.decode(record.bytes(), found);
        ASSERT_TRUE(decoded) << decoded.error().text;
        EXPECT_EQ(decoder.losses().changes, 1u + static_cast<unsigned>(pass));
        ASSERT_EQ(found.types.size(), 2u);
        std::map<std::string, std::uint32_t> indexOf{{"Transform", 0}, {"Group", 1}};
        for (const DefinedType& type : found.types) indexOf[type.type->name] = type.index.value;
        EXPECT_EQ(indexOf.at("MyProto") + indexOf.at("Novel"), 2u + 3u);
        std::map<std::uint32_t, std::uint32_t> typeOf;
        std::map<std::pair<std::uint32_t, FieldIndex>, Value> values;
        for (const Change& change : found.changes) {
            if (change.kind == ChangeKind::createNode) typeOf[change.node.value] = change.index;
            if (change.kind == ChangeKind::setField) values[{change.node.value, change.field}] = change.value;
        }
        EXPECT_EQ(typeOf.at(2), 1u);
        EXPECT_EQ(typeOf.at(3), indexOf.at("Novel"));
        EXPECT_EQ(typeOf.at(4), 0u);
        EXPECT_EQ(typeOf.at(5), indexOf.at("MyProto"));
        EXPECT_EQ(values.size(), 5u);
        EXPECT_TRUE(values.at({2, 1}) == Value(Array<NodeId>{NodeId{3}, NodeId{4}}));
        EXPECT_TRUE(values.at({3, 0}) == Value(9.f));
        EXPECT_TRUE(values.at({4, 0}) == Value(Vec3f(4, 5, 6)));
        EXPECT_TRUE(values.at({4, 1}) == Value(Vec3f(1))) << "the origin's default, which differs here";
        EXPECT_TRUE(values.at({5, 0}) == Value(0.75f));
    }
}

TEST(Dictionary, TypesAreDescribedOnceAndAgainAfterAKeyframeOrARestart) {
    std::vector<std::unique_ptr<NodeType>> origin, local;
    origin.push_back(makeType("Group", {{"children", Array<NodeId>{}}}));
    origin.push_back(makeType("Shape", {{"geometry", NodeId{}}}));
    local.push_back(makeType("Shape", {{"geometry", NodeId{}}}));
    ChangeSet set;
    set.from = 4;
    set.to = 5;
    Change create;
    create.kind = ChangeKind::createNode;
    create.node = NodeId{7};
    create.index = 1;
    set.changes.push_back(create);
    ByteBuffer head, first, second, third;
    encodeHead(1, "", origin, {}, head);
    ChangeEncoder encoder({}, origin);
    encoder.encode(set, first);
    encoder.encode(set, second);
    encoder.restart();
    encoder.encode(set, third);
    EXPECT_LT(second.size(), first.size());
    EXPECT_TRUE(std::ranges::equal(first.bytes(), third.bytes()));
    ChangeSet snapshot = set;
    snapshot.from = 0;
    encoder.encode(snapshot, second);
    EXPECT_GE(second.size(), first.size());
    encoder.encode(set, second);
    EXPECT_LT(second.size(), first.size()) << "the keyframe told";

    ChangeDecoder decoder(local);
    ASSERT_TRUE(decoder.setHead(*decodeHead(head.bytes())));
    ChangeSet found;
    encoder.encode(set, second);
    const Result<> undescribed = decoder.decode(second.bytes(), found);
    ASSERT_FALSE(undescribed);
    EXPECT_NE(undescribed.error().text.find("not described"), std::string::npos) << undescribed.error().text;
    ASSERT_TRUE(decoder.decode(first.bytes(), found));
    EXPECT_EQ(found.changes.at(0).index, 0u);
    EXPECT_TRUE(decoder.decode(second.bytes(), found));
}

/// A raw column as PROTOCOL.md says it, byte by byte; its values are 3 f32 each.
std::vector<std::byte> columnOf(std::span<const Change> changes) {
    const auto put = [](std::vector<std::byte>& out, std::uint64_t number) {
        for (; number >= 0x80; number >>= 7) out.push_back(static_cast<std::byte>(number | 0x80));
        out.push_back(static_cast<std::byte>(number));
    };
    std::vector<std::byte> body = {std::byte{0}, std::byte{changes[0].external}, std::byte{24}};
    put(body, changes[0].field);
    std::int64_t last = 0;
    for (const Change& c : changes) {
        const std::int64_t step = c.node.value - std::exchange(last, c.node.value);
        put(body, static_cast<std::uint64_t>(step >= 0 ? 2 * step : -2 * step - 1));
    }
    for (const Change& c : changes) {
        const auto bytes = std::as_bytes(std::span(&c.value.as<Vec3f>(), 1));
        body.insert(body.end(), bytes.begin(), bytes.end());
    }
    std::vector<std::byte> block = {std::byte{4}};
    put(block, changes.size());
    put(block, body.size());
    block.insert(block.end(), body.begin(), body.end());
    return block;
}

/// The bytes before the values are longer or shorter than in the frame before, because there are more or fewer, or
/// their nodes are farther apart.
TEST(ChangeCodec, AFrameOfOneColumnIsWrittenInPlace) {
    static_assert(static_cast<int>(FieldType::SFVec3f) == 24);
    ChangeEncoder encoder;
    ByteBuffer record;
    const FieldIndex field = x3d::Transform::translation.index;
    for (const std::size_t count : {1, 1000, 1000, 999, 1, 127, 128, 255, 256, 257, 5000, 3, 5000})
        for (const std::uint32_t step : {1u, 100u, 1u, 70000u}) {
            ChangeSet set;
            set.from = 1;
            set.to = 2;
            for (std::size_t i = 0; i < count; ++i)
                set.changes.push_back(valueChange(2 + static_cast<std::uint32_t>(i) * step, field,
                                                  Vec3f(float(i), float(step), -1), count % 2 == 0));
            encoder.encode(set, record);
            ASSERT_TRUE(checkRecord(record.bytes()));
            const auto expected = columnOf(set.changes);
            ASSERT_TRUE(std::ranges::equal(record.bytes().subspan(kRecordHeaderSize), expected))
                << count << " values, nodes " << step << " apart";
        }
}

/// Others between the first and the last of one column.
TEST(ChangeCodec, AFrameThatOnlyBeginsAndEndsWithOneColumnIsWhole) {
    ChangeEncoder encoder;
    ChangeDecoder decoder(builtinTypes());
    const auto at = [](std::uint32_t node) {
        return valueChange(node, x3d::Transform::translation.index, Vec3f(float(node), 0, 1));
    };
    for (const std::uint32_t before : {1u, 255u, 300u}) {
        ChangeSet set;
        set.from = 1;
        set.to = 2;
        for (std::uint32_t i = 0; i < before; ++i) set.changes.push_back(at(10 + i));
        set.changes.push_back(valueChange(5, x3d::Transform::scale.index, Vec3f(2, 2, 2)));
        set.changes.push_back(valueChange(5, x3d::Transform::rotation.index, Rotation{0, 1, 0, 1}));
        for (std::uint32_t i = 0; i < before; ++i) set.changes.push_back(at(1000 + i));
        ByteBuffer record;
        encoder.encode(set, record);
        ChangeSet found;
        ASSERT_TRUE(decoder.decode(record.bytes(), found));
        const std::vector<Change> expected = canonical(set.changes);
        ASSERT_EQ(found.changes.size(), expected.size());
        for (std::size_t i = 0; i < expected.size(); ++i) {
            EXPECT_EQ(found.changes[i].node, expected[i].node);
            EXPECT_EQ(found.changes[i].field, expected[i].field);
            EXPECT_EQ(found.changes[i].value, expected[i].value);
        }
    }
}

}  // namespace
}  // namespace rtsg
