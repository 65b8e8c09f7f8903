// Values of field types from outside in records: they say what they are, and what says nothing is refused.
#include <rtsg/core/custom_field.h>

#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/sync/change_codec.h>

#include "client/playout.h"

namespace rtsg {
namespace {

using Of = CustomLayout::Of;

std::shared_ptr<const CustomType> typeOf(const char* name, CustomLayout layout) {
    return CustomType::make(name, layout).value();
}

/// A type with fields of each kind of numbers, whose defaults are given or not.
std::shared_ptr<const NodeType> items() {
    auto type = std::make_shared<NodeType>();
    type->name = "Thing";
    type->component = "Test";
    type->kind = NodeType::Kind::user;
    type->implements = {"X3DNode", "X3DChildNode"};
    const auto add = [&](const char* name, FieldType of, const std::shared_ptr<const CustomType>& custom) -> FieldDef& {
        FieldDef& field = type->fields.emplace_back();
        field.name = name;
        field.type = of;
        field.custom = custom;
        return field;
    };
    const double one[] = {1, 2};
    const auto quantity = typeOf("SFQuantity", {Of::float64, 2});
    add("weight", FieldType::SFCustom, quantity);
    add("most", FieldType::SFCustom, quantity).defaultValue = Value(quantity->value(one).value());
    add("all", FieldType::MFCustom, quantity);
    add("tag", FieldType::SFCustom, typeOf("SFTag", {Of::bytes, 0}));
    add("tags", FieldType::MFCustom, typeOf("SFTag", {Of::bytes, 0}));
    add("basis", FieldType::SFCustom, typeOf("SFBasis", {Of::float32, 9}));
    EXPECT_TRUE(type->finish());
    return type;
}

ByteBuffer snapshotOf(Scene& scene) {
    const NodeId id = scene.createNode(scene.defineType(items()).value());
    const double numbers[] = {3.5, -1}, bytes[] = {0, 7, 255};
    const auto quantity = typeOf("SFQuantity", {Of::float64, 2}), tag = typeOf("SFTag", {Of::bytes, 0});
    const CustomValue one = quantity->value(numbers).value(), two = tag->value(bytes).value();
    EXPECT_TRUE(scene.setField(id, 0, Value(one)));
    EXPECT_TRUE(scene.setField(id, 2, Value(Array<CustomValue>{one, quantity->zero(), one})));
    EXPECT_TRUE(scene.setField(id, 3, Value(two)));
    EXPECT_TRUE(scene.setField(id, 4, Value(Array<CustomValue>{two, tag->zero()})));
    ChangeEncoder encoder({}, {});
    ByteBuffer record;
    encoder.encode(scene.snapshot(), record);
    return record;
}

TEST(CustomValues, AReplicaThatLacksTheTypesHasEqualBitsAndHash) {
    Scene origin, replica;
    const ByteBuffer record = snapshotOf(origin);
    ChangeDecoder decoder({});
    ChangeSet found;
    const Result<> decoded = decoder.decode(record.bytes(), found);
    ASSERT_TRUE(decoded) << decoded.error().text;
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(found)));
    EXPECT_EQ(replica.hash(), origin.hash());
    const NodeId id{2};
    for (FieldIndex i = 0; i < 6; ++i) EXPECT_EQ(replica.node(id).value(i), origin.node(id).value(i)) << i;
    EXPECT_EQ(replica.node(id).type().fields[5].typeName(), "SFBasis");
    EXPECT_TRUE(replica.node(id).isDefault(1));
}

/// Every byte changed, and every length: an error or a set, and no value in it that does not say what it is.
TEST(CustomValues, HostileRecordsAreRefusedOrHarmless) {
    Scene origin;
    const ByteBuffer record = snapshotOf(origin);
    const Result<RecordHeader> header = parseRecordHeader(record.bytes());
    ASSERT_TRUE(header);
    const std::span<const std::byte> payload = record.bytes().subspan(kRecordHeaderSize);
    const unsigned seed = 20;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::size_t refused = 0;
    for (std::size_t round = 0; round < 40 * payload.size(); ++round) {
        const std::size_t size = round % 7 == 0 ? random() % payload.size() : payload.size();
        ByteBuffer other;
        other.append(record.bytes().data(), kRecordHeaderSize + size);
        if (const std::size_t at = round % payload.size(); at < size)
            other.data()[kRecordHeaderSize + at] = static_cast<std::byte>(random());
        sealRecord(other, *header);
        ChangeDecoder decoder({});
        ChangeSet found;
        if (!decoder.decode(other.bytes(), found)) {
            ++refused;
            continue;
        }
        for (const Change& change : found.changes) {
            if (change.value.holds<CustomValue>()) {
                EXPECT_NE(CustomType::of(change.value.as<CustomValue>()), nullptr);
            }
            if (!change.value.holds<Array<CustomValue>>()) continue;
            for (const CustomValue& one : change.value.as<Array<CustomValue>>())
                EXPECT_NE(CustomType::of(one), nullptr);
        }
        Scene replica;
        (void)replica.apply(std::make_shared<const ChangeSet>(found));
    }
    EXPECT_GT(refused, 0u);
}

TEST(CustomValues, OfNoTypeAreRefused) {
    CustomValue nonsense;
    nonsense.box = {'n', 'o'};
    for (const Value& value : {Value(nonsense), Value(CustomValue()), Value(Array<CustomValue>{nonsense})}) {
        ChangeSet set;
        set.to = 1;
        Change& change = set.changes.emplace_back();
        change.node = NodeId{2};
        change.field = 0;
        change.value = value;
        ChangeEncoder encoder({}, {});
        ByteBuffer record;
        encoder.encode(set, record);
        ChangeDecoder decoder({});
        ChangeSet found;
        const Result<> decoded = decoder.decode(record.bytes(), found);
        ASSERT_FALSE(decoded);
        EXPECT_NE(decoded.error().text.find("does not say what it is"), std::string::npos) << decoded.error().text;
    }
}

TEST(CustomValues, PlayOutInBetweenWhereTheTypeSaysHow) {
    const auto before = fieldTypeRegistry();
    CustomFunctions functions;
    functions.between = [](const CustomValue& a, const CustomValue& b, double t) {
        const double number[] = {customNumbers(a)[0] * (1 - t) + customNumbers(b)[0] * t};
        return CustomType::of(a)->value(number).value();
    };
    const auto type = registerFieldType("SFMass", {Of::float64, 1}, functions).value();
    const double four[] = {4}, one[] = {1};
    const Value a(type->zero()), b(type->value(four).value());
    EXPECT_EQ(interpolate(a, b, .25), Value(type->value(one).value()));
    restoreFieldTypes(before);
    EXPECT_EQ(interpolate(a, b, .25), a);
}

}  // namespace
}  // namespace rtsg
