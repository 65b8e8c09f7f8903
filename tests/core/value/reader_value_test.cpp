// One value of every field type, through every syntax.
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>

namespace rtsg {
namespace {

using testing::HasSubstr;

class RandomValues {
  public:
    explicit RandomValues(unsigned seed) : random_(seed) {}

    template <class T>
    T one() {
        if constexpr (std::is_same_v<T, bool>) {
            return random_() % 2 == 0;
        } else if constexpr (std::is_same_v<T, std::int32_t>) {
            return static_cast<std::int32_t>(random_());
        } else if constexpr (std::is_same_v<T, NodeId>) {
            return {};
        } else if constexpr (std::is_same_v<T, CustomValue>) {
            double numbers[2];
            fill<double>(numbers, sizeof(numbers));
            return CustomType::make("SFPair", {CustomLayout::Of::float64, 2}).value()->value(numbers).value();
        } else if constexpr (std::is_same_v<T, String>) {
            constexpr std::string_view letters[] = {"a", "\"",       "\\", " ", "\n", "'",  "&",
                                                    "<", "\xC3\xA4", "#",  "]", "\t", "]]>"};
            std::string text;
            for (auto n = random_() % 8; n > 0; --n) text += letters[random_() % std::size(letters)];
            return text;
        } else if constexpr (std::is_same_v<T, Image>) {
            Image image;
            const auto width = static_cast<std::int32_t>(random_() % 4 + 1),
                       height = static_cast<std::int32_t>(random_() % 4);
            image.words = {width, height, static_cast<std::int32_t>(random_() % 4 + 1)};
            for (int i = 0; i < width * height; ++i) image.words.push_back(static_cast<std::int32_t>(random_()));
            return image;
        } else {
            T value;
            constexpr std::size_t size = sizeof(T);
            constexpr bool wide = std::is_same_v<T, double> || std::is_same_v<T, Time> || std::is_same_v<T, Vec2d> ||
                                  std::is_same_v<T, Vec3d> || std::is_same_v<T, Vec4d> || std::is_same_v<T, Matrix3d> ||
                                  std::is_same_v<T, Matrix4d>;
            fill<std::conditional_t<wide, double, float>>(&value, size);
            return value;
        }
    }
    template <class T>
    Array<T> many() {
        Array<T> values;
        for (auto n = random_() % 7; n > 0; --n) values.push_back(one<T>());
        return values;
    }

  private:
    /// Any finite bit pattern: subnormal, tiny and huge numbers alike.
    template <class S>
    void fill(void* target, std::size_t bytes) {
        for (std::size_t at = 0; at < bytes; at += sizeof(S)) {
            S number;
            do {
                const std::uint64_t bits = random_();
                std::memcpy(&number, &bits, sizeof(S));
            } while (!std::isfinite(number));
            std::memcpy(static_cast<std::byte*>(target) + at, &number, sizeof(S));
        }
    }
    std::mt19937_64 random_;
};

void expectRoundTrip(const Value& value) {
    for (const TextSyntax syntax : {TextSyntax::classicVrml, TextSyntax::xml}) {
        const std::string text = printFieldText(value, syntax);
        const auto pair = CustomType::make("SFPair", {CustomLayout::Of::float64, 2}).value();
        const Result<Value> back = parseFieldText(value.type(), text, syntax, pair.get());
        ASSERT_TRUE(back) << info(value.type()).name << " " << text << ": " << back.error().format();
        EXPECT_TRUE(*back == value) << info(value.type()).name << " " << text << " became " << printFieldText(*back);
    }
}

TEST(FieldText, EveryTypeReadsBackAsTheSameBits) {
    constexpr unsigned seed = 4711;
    SCOPED_TRACE(seed);
    RandomValues random(seed);
    for (int i = 0; i < 200; ++i) {
#define RTSG_X(suffix, T)                    \
    expectRoundTrip(Value(random.one<T>())); \
    if constexpr (!std::is_same_v<T, NodeId>) expectRoundTrip(Value(random.many<T>()));
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    for (int t = 0; t < kFieldTypeCount; ++t)
        if (static_cast<FieldType>(t) != FieldType::SFCustom) expectRoundTrip(Value::zero(static_cast<FieldType>(t)));
}

TEST(FieldText, ClassicPrintsAndParses) {
    EXPECT_EQ(printFieldText(Value(Vec3f(1, 0.1f, -2e20f))), "1 0.1 -2e+20");
    EXPECT_EQ(printFieldText(Value(Array<Vec2f>{Vec2f(1, 2), Vec2f(3, 4)})), "[1 2, 3 4]");
    EXPECT_EQ(printFieldText(Value(true)), "TRUE");
    EXPECT_EQ(printFieldText(Value(String("a\"b"))), "\"a\\\"b\"");
    EXPECT_EQ(parseFieldText(FieldType::MFVec3f, "1 2 3")->as<Array<Vec3f>>().size(), 1u);
    EXPECT_EQ(parseFieldText(FieldType::MFInt32, " [ 1, 2 3 # four\n 5 ] ")->as<Array<std::int32_t>>(),
              (Array<std::int32_t>{1, 2, 3, 5}));
    EXPECT_EQ(parseFieldText(FieldType::MFString, "\"only\"")->as<Array<String>>()[0], String("only"));
    EXPECT_FALSE(parseFieldText(FieldType::SFNode, "NULL")->as<NodeId>());
}

TEST(FieldText, JsonHasVectorsAsArrays) {
    const auto json = [](const Value& value) { return printFieldText(value, TextSyntax::json); };
    EXPECT_EQ(json(Value(Vec3f(1, 0.5f, 3))), "[1,0.5,3]");
    EXPECT_EQ(json(Value(Array<Vec2f>{Vec2f(1, 2), Vec2f(3, 4)})), "[[1,2], [3,4]]");
    EXPECT_EQ(json(Value(2.5)), "2.5");
    EXPECT_EQ(json(Value(std::numeric_limits<float>::quiet_NaN())), "null");
    EXPECT_EQ(json(Value(String("a\"\n\x01"))), "\"a\\\"\\n\\u0001\"");
    EXPECT_EQ(json(Value(false)), "false");
    EXPECT_EQ(json(Value(NodeId{7})), "7");
    EXPECT_EQ(json(Value(NodeId{})), "null");
}

TEST(FieldText, ErrorsSayWhatAndWhere) {
    const auto complaint = [](FieldType type, std::string_view text, TextSyntax syntax = TextSyntax::classicVrml) {
        const Result<Value> result = parseFieldText(type, text, syntax);
        return result ? std::string("accepted") : result.error().format();
    };
    EXPECT_EQ(complaint(FieldType::SFVec3f, "1 2"),
              "1:4: error: expected 3 numbers (SFVec3f), found the end [value-text]");
    EXPECT_EQ(complaint(FieldType::SFVec3f, "1 2 3 4"), "1:7: error: there is more than one SFVec3f [value-text]");
    EXPECT_EQ(complaint(FieldType::SFInt32, "1.5"),
              "1:1: error: expected an integer (SFInt32), found '1.5' [value-text]");
    EXPECT_THAT(complaint(FieldType::MFVec3f, "[ 1 2 3 4 ]"), HasSubstr("do not make a whole SFVec3f"));
    EXPECT_THAT(complaint(FieldType::MFFloat, "[ 1 2"), HasSubstr("']' is missing"));
    EXPECT_THAT(complaint(FieldType::SFFloat, "nan"), HasSubstr("not finite"));
    EXPECT_THAT(complaint(FieldType::SFFloat, "1e39"), HasSubstr("not finite or too large"));
    EXPECT_EQ(complaint(FieldType::SFDouble, "1e39"), "accepted");
    EXPECT_THAT(complaint(FieldType::SFString, "abc"), HasSubstr("double quotes"));
    EXPECT_THAT(complaint(FieldType::SFString, "\"abc"), HasSubstr("not closed"));
    EXPECT_THAT(complaint(FieldType::SFBool, "yes"), HasSubstr("TRUE or FALSE"));
    EXPECT_THAT(complaint(FieldType::SFBool, "yes", TextSyntax::xml), HasSubstr("true or false"));
    EXPECT_THAT(complaint(FieldType::SFImage, "2 2 1 0 0 0"), HasSubstr("3 of 2 x 2 pixels"));
    EXPECT_THAT(complaint(FieldType::SFImage, "2147483647 2147483647 4 0"), HasSubstr("pixels"));
    EXPECT_THAT(complaint(FieldType::SFImage, "-1 2 1"), HasSubstr("width, height"));
    EXPECT_THAT(complaint(FieldType::SFImage, "1 1 1 0 7", TextSyntax::xml), HasSubstr("more than"));
    EXPECT_NE(complaint(FieldType::SFFloat, "1", TextSyntax::json), "accepted");
}

}  // namespace
}  // namespace rtsg
