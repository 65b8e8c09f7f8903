// Values of every type: copying, comparing, zero, names.
#include <rtsg/core/value.h>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

using namespace rtsg;

namespace {

std::vector<FieldType> allTypes() {
    std::vector<FieldType> result;
    for (int i = 0; i < kFieldTypeCount; ++i) result.push_back(static_cast<FieldType>(i));
    return result;
}

/// A value of type T that is not the zero of the type.
template <class T>
T sample() {
    T result{};
    if constexpr (std::is_same_v<T, String>)
        result = String("text");
    else if constexpr (std::is_same_v<T, Image>)
        result.words = {1, 1, 1, 0xFF};
    else if constexpr (std::is_same_v<T, CustomValue>)
        result.box = {'b', 'o', 'x'};
    else
        std::memset(static_cast<void*>(&result), 1, sizeof(T));
    return result;
}

}  // namespace

TEST(FieldType, NamesRoundTrip) {
    for (const FieldType type : allTypes()) {
        FieldType found{};
        if (sf(type) == FieldType::SFCustom) {  // no type's own name
            EXPECT_FALSE(fieldTypeFromName(info(type).name, found));
            continue;
        }
        ASSERT_TRUE(fieldTypeFromName(info(type).name, found)) << info(type).name;
        EXPECT_EQ(found, type);
        EXPECT_EQ(isMF(type), info(type).name.starts_with("MF"));
        EXPECT_EQ(mf(sf(type)), mf(type));
    }
    FieldType untouched = FieldType::MFNode;
    EXPECT_FALSE(fieldTypeFromName("SFVec5f", untouched));
    EXPECT_FALSE(fieldTypeFromName("", untouched));
    EXPECT_EQ(untouched, FieldType::MFNode);
}

TEST(FieldType, SizesAreThoseOfTheCppTypes) {
    EXPECT_EQ(info(FieldType::SFVec3f).size, 12);
    EXPECT_EQ(info(FieldType::SFVec3f).components, 3);
    EXPECT_EQ(info(FieldType::SFVec3d).size, 24);
    EXPECT_EQ(info(FieldType::SFMatrix4d).size, 128);
    EXPECT_EQ(info(FieldType::SFMatrix4d).components, 16);
    for (const FieldType type : allTypes()) {
        EXPECT_EQ(info(type).elementSize, info(sf(type)).size) << info(type).name;
        const bool shared =
            isMF(type) || type == FieldType::SFString || type == FieldType::SFImage || type == FieldType::SFCustom;
        EXPECT_EQ(info(type).shared, shared) << info(type).name;
        if (shared) {
            EXPECT_EQ(info(type).size, sizeof(void*));
        }
    }
}

TEST(Value, EveryTypeKeepsCopiesAndReleasesItsValue){
#define RTSG_X(suffix, T)                                                               \
    {                                                                                   \
        SCOPED_TRACE(#suffix);                                                          \
        const T one = sample<T>();                                                      \
        const Array<T> many{one, T{}, one};                                             \
        const Value single(one), array(many);                                           \
        EXPECT_EQ(single.type(), FieldType::SF##suffix);                                \
        EXPECT_EQ(array.type(), FieldType::MF##suffix);                                 \
        EXPECT_TRUE(single.holds<T>());                                                 \
        EXPECT_FALSE(single.holds<Array<T>>());                                         \
        EXPECT_TRUE(array.as<Array<T>>().sameStorage(many));                            \
        Value copy = single;                                                            \
        EXPECT_EQ(copy, single);                                                        \
        EXPECT_FALSE(copy == Value::zero(FieldType::SF##suffix));                       \
        Value moved = std::move(copy);                                                  \
        EXPECT_EQ(moved, single);                                                       \
        moved = array;                                                                  \
        EXPECT_EQ(moved, array);                                                        \
        EXPECT_EQ(many.header()->owners.load(), 3u);                                    \
        moved = single;                                                                 \
        EXPECT_EQ(many.header()->owners.load(), 2u);                                    \
        EXPECT_EQ(Value::fromStorage(FieldType::SF##suffix, single.storage()), single); \
        EXPECT_EQ(Value::fromStorage(FieldType::MF##suffix, array.storage()), array);   \
        EXPECT_EQ(many.header()->owners.load(), 2u);                                    \
    }
    RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
}

TEST(Value, ZeroIsTheTypesDefault) {
    for (const FieldType type : allTypes()) EXPECT_EQ(Value::zero(type).type(), type);
    EXPECT_EQ(Value::zero(FieldType::SFRotation).as<Rotation>(), (Rotation{0, 0, 1, 0}));
    EXPECT_EQ(Value::zero(FieldType::SFVec3f).as<Vec3f>(), Vec3f(0, 0, 0));
    EXPECT_EQ(Value::zero(FieldType::SFMatrix3d).as<Matrix3d>().elements[4], 1.0);
    EXPECT_TRUE(Value::zero(FieldType::MFString).as<Array<String>>().empty());
    EXPECT_EQ(Value(), Value(false));
}

TEST(Value, EqualityIsBitForBit) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(Value(nan), Value(nan));
    EXPECT_FALSE(Value(0.f) == Value(-0.f));
    EXPECT_FALSE(Value(Array<float>{0.f}) == Value(Array<float>{-0.f}));
    EXPECT_EQ(Value(Array<float>{nan}), Value(Array<float>{nan}));
    EXPECT_FALSE(Value(0.f) == Value(std::int32_t{0}));
    EXPECT_EQ(Value(Array<String>{"a", "b"}), Value(Array<String>{"a", "b"}));
    EXPECT_FALSE(Value(Array<String>{"a", "b"}) == Value(Array<String>{"a", "c"}));
    EXPECT_FALSE(Value(String("a")) == Value(String("ab")));
    EXPECT_FALSE(Value(Array<Image>{sample<Image>()}) == Value(Array<Image>{Image{}}));
    EXPECT_FALSE(Value(Matrix4d()) == Value(sample<Matrix4d>()));
}

TEST(Storage, CopyReleasesTheOldAndSurvivesSelfAssignment) {
    const Value a(Array<Vec3f>{{1, 2, 3}}), b(Array<Vec3f>{{4, 5, 6}});
    detail::ArrayHeader* slot = nullptr;
    copyStorage(FieldType::MFVec3f, &slot, a.storage());
    EXPECT_EQ(slot->owners.load(), 2u);
    copyStorage(FieldType::MFVec3f, &slot, &slot);
    EXPECT_EQ(slot->owners.load(), 2u);
    EXPECT_TRUE(equalStorage(FieldType::MFVec3f, &slot, a.storage()));
    copyStorage(FieldType::MFVec3f, &slot, b.storage());
    EXPECT_EQ(a.as<Array<Vec3f>>().header()->owners.load(), 1u);
    EXPECT_FALSE(equalStorage(FieldType::MFVec3f, &slot, a.storage()));
    destroyStorage(FieldType::MFVec3f, &slot);
    EXPECT_EQ(slot, nullptr);
    EXPECT_EQ(b.as<Array<Vec3f>>().header()->owners.load(), 1u);
}
