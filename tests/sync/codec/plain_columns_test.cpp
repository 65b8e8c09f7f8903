// Frames that give anew what the last one gave are known by what they say of places; all others are not taken for such.
#include "columns/plain_columns.h"

#include <cstring>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg::wire {
namespace {

struct ColumnsAgain : testing::Test {
    RepeatedColumns repeated;
    ByteBuffer record;  // views point into it

    static Change valueOf(std::uint32_t node, FieldIndex field, Value value) {
        Change change;
        change.node = NodeId{node};
        change.field = field;
        change.value = std::move(value);
        return change;
    }

    std::optional<std::span<const PlainColumn>> match(const std::vector<Change>& changes, std::uint64_t from = 2,
                                                      std::uint64_t to = 3) {
        encode(changes, from, to);
        return repeated.match(record.bytes(), *parseRecordHeader(record.bytes()));
    }
    void remember(const std::vector<Change>& changes) {
        encode(changes, 1, 2);
        repeated.remember(record.bytes(), *parseRecordHeader(record.bytes()));
    }
    void encode(const std::vector<Change>& changes, std::uint64_t from, std::uint64_t to) {
        ChangeSet set;
        set.from = from;
        set.to = to;
        set.changes = changes;
        ChangeEncoder().encode(set, record);
    }
};

TEST_F(ColumnsAgain, TheSameFieldsOfTheSameNodesWithOtherValuesAre) {
    const std::vector<Change> last = {valueOf(300, 1, Vec3f(1, 2, 3)), valueOf(305, 1, Vec3f(4, 5, 6)),
                                      valueOf(300, 2, 1.5)};
    EXPECT_FALSE(match(last)) << "of the first one nothing is known";
    remember(last);
    const auto columns =
        match({valueOf(300, 1, Vec3f(7, 8, 9)), valueOf(305, 1, Vec3f()), valueOf(300, 2, -2.5)}, 2, 7);
    ASSERT_TRUE(columns);
    ASSERT_EQ(columns->size(), 2u);
    const PlainColumn &points = (*columns)[0], &numbers = (*columns)[1];
    EXPECT_EQ(points.field, 1);
    EXPECT_EQ(points.type, FieldType::SFVec3f);
    ASSERT_EQ(points.count, 2u);
    Vec3f point;
    std::memcpy(&point, points.values, sizeof(point));
    EXPECT_EQ(point, Vec3f(7, 8, 9));
    EXPECT_EQ(numbers.type, FieldType::SFDouble);
    ASSERT_EQ(numbers.count, 1u);
    double number = 0;
    std::memcpy(&number, numbers.values, sizeof(number));
    EXPECT_EQ(number, -2.5);
    repeated.forget();
    EXPECT_FALSE(match(last));
}

TEST_F(ColumnsAgain, NothingElseIs) {
    const std::vector<Change> last = {valueOf(300, 1, Vec3f(1, 2, 3)), valueOf(305, 1, Vec3f(4, 5, 6)),
                                      valueOf(300, 2, true)};
    const auto with = [&](std::size_t i, Change change) {
        std::vector<Change> other = last;
        other[i] = std::move(change);
        return other;
    };
    std::vector<Change> more = last, fewer = last, inner = last, named = last;
    more.push_back(valueOf(300, 3, 1.f));
    fewer.pop_back();
    inner[0].external = false;
    named.push_back(valueOf(300, kNoField, String("A")));
    named.back().kind = ChangeKind::setName;
    remember(last);
    EXPECT_TRUE(match(last));
    EXPECT_FALSE(match(with(1, valueOf(306, 1, Vec3f())))) << "another node";
    EXPECT_FALSE(match(with(2, valueOf(300, 4, true)))) << "another field";
    EXPECT_FALSE(match(with(2, valueOf(300, 2, 1.f)))) << "another type";
    EXPECT_FALSE(match(more)) << "a column more";
    EXPECT_FALSE(match(fewer)) << "a column less";
    EXPECT_FALSE(match(inner)) << "one of them is not from outside";
    EXPECT_FALSE(match(named)) << "a name";
    EXPECT_FALSE(match(last, 2, 2)) << "a repair";
    remember(named);
    EXPECT_FALSE(match(named)) << "names are no values of one size";
    const std::vector<Change> wide = {valueOf(300, 1, Vec3d(1, 2, 3))};
    remember(wide);
    EXPECT_FALSE(match(wide)) << "values that lie elsewhere";
}

TEST_F(ColumnsAgain, BooleansThatAreNoneAreLeftToTheReader) {
    const std::vector<Change> last = {valueOf(300, 2, true)};
    remember(last);
    ASSERT_TRUE(match(last));
    record.data()[record.size() - 1] = std::byte{2};
    EXPECT_FALSE(repeated.match(record.bytes(), *parseRecordHeader(record.bytes())));
}

TEST_F(ColumnsAgain, ABlockThatIsCutShortIsNone) {
    const std::vector<Change> last = {valueOf(300, 1, Vec3f(1, 2, 3)), valueOf(305, 1, Vec3f(4, 5, 6))};
    remember(last);
    ASSERT_TRUE(match(last));
    for (std::size_t cut = 1; cut < record.size() - kRecordHeaderSize; ++cut) {
        RecordHeader header = *parseRecordHeader(record.bytes());
        header.length -= cut;
        EXPECT_FALSE(repeated.match(record.bytes().first(record.size() - cut), header)) << cut;
    }
}

}  // namespace
}  // namespace rtsg::wire
