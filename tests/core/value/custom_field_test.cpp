// Field types from outside: what a value consists of, the registry, their text, and what functions of others may do.
#include <rtsg/core/custom_field.h>

#include <cstdio>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/hash_terms.h>
#include <rtsg/core/scene.h>

using namespace rtsg;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

using Of = CustomLayout::Of;

/// Metres and a power of them, as "3.5 m^1"; a negative zero counts as zero.
CustomFunctions lengthText() {
    CustomFunctions functions;
    functions.print = [](const CustomValue& value) {
        const auto numbers = customNumbers(value);
        char text[80];
        std::snprintf(text, sizeof(text), "%.17g m^%g", numbers[0], numbers[1]);
        return std::string(text);
    };
    functions.parse = [](const CustomType& type, std::string_view text) -> Result<CustomValue> {
        double numbers[2] = {};
        const std::string copy(text);
        if (std::sscanf(copy.c_str(), "%lf m^%lf", numbers, numbers + 1) != 2) return fail("no length");
        return type.value(numbers);
    };
    functions.normalised = [](const CustomType& type, const CustomValue& value) -> Result<CustomValue> {
        auto numbers = customNumbers(value);
        if (numbers[1] > 9) return fail("too high a power");
        if (numbers[0] == 0) numbers[0] = 0;
        return type.value(numbers);
    };
    functions.between = [](const CustomValue& a, const CustomValue& b, double t) {
        const auto p = customNumbers(a), q = customNumbers(b);
        const double numbers[] = {p[0] + (q[0] - p[0]) * t, p[1]};
        return CustomType::of(a)->value(numbers).value();
    };
    return functions;
}

class CustomFields : public testing::Test {
  protected:
    CustomFields() : before_(fieldTypeRegistry()) {}
    ~CustomFields() override { restoreFieldTypes(before_); }

    static std::shared_ptr<const CustomType> length() {
        return registerFieldType("SFLength", {Of::float64, 2}, lengthText()).value();
    }
    static CustomValue metres(double number) {
        const double numbers[] = {number, 1};
        return length()->value(numbers).value();
    }
    static std::string complaint(const Result<Value>& result) { return result ? "accepted" : result.error().format(); }

  private:
    std::shared_ptr<const FieldTypeRegistry> before_;
};

TEST_F(CustomFields, AValueSaysItsTypeItsLayoutAndItsNumbers) {
    const auto type = CustomType::make("MFBasis", {Of::float32, 3}).value();
    EXPECT_EQ(type->name(), "Basis");
    const double numbers[] = {1, -2.5, 3};
    const CustomValue value = type->value(numbers).value();
    EXPECT_THAT(customNumbers(value), ElementsAre(1, -2.5, 3));
    EXPECT_EQ(customBits(value).size(), 12u);
    const auto known = CustomType::of(value);
    ASSERT_NE(known, nullptr);
    EXPECT_EQ(*known, *type);
    EXPECT_EQ(known->layout(), (CustomLayout{Of::float32, 3}));
    EXPECT_TRUE(type->holds(value));
    EXPECT_TRUE(type->holds(type->zero()));
    EXPECT_FALSE(CustomType::make("SFBasis", {Of::float64, 3}).value()->holds(value));
    EXPECT_FALSE(CustomType::make("SFBases", {Of::float32, 3}).value()->holds(value));
    EXPECT_EQ(CustomType::of(CustomValue()), nullptr);
    EXPECT_TRUE(customBits(CustomValue()).empty());
    EXPECT_TRUE(customNumbers(CustomValue()).empty());
}

TEST_F(CustomFields, NamesAndLayoutsHaveBounds) {
    for (const char* name : {"", "SF", "Quantity", "XFQuantity", "SFquantity", "SFVec3f", "MFNode", "SFCustom", "SF1",
                             "SFA b", "SF\xC3\xA4", "SFA.b"})
        EXPECT_FALSE(CustomType::make(name, {})) << name;
    EXPECT_TRUE(CustomType::make("SF" + std::string(64, 'A'), {}));
    EXPECT_FALSE(CustomType::make("SF" + std::string(65, 'A'), {}));
    EXPECT_FALSE(CustomType::make("SFA", {Of::float64, 0}));
    EXPECT_FALSE(CustomType::make("SFA", {Of::int32, 1025}));
    EXPECT_FALSE(CustomType::make("SFA", {static_cast<Of>(4), 1}));
    EXPECT_TRUE(CustomType::make("SFA", {Of::bytes, 0}));
    const double few[] = {1}, many[] = {1, 2}, half[] = {0.5}, high[] = {256}, wide[] = {2147483648.0},
                 nan[] = {std::numeric_limits<double>::quiet_NaN()};
    const auto one = CustomType::make("SFA", {Of::int32, 1}).value();
    EXPECT_TRUE(one->value(few));
    EXPECT_FALSE(one->value(many));
    EXPECT_FALSE(one->value(half));
    EXPECT_FALSE(one->value(wide));
    EXPECT_FALSE(one->value(nan));
    EXPECT_FALSE(CustomType::make("SFA", {Of::bytes, 1}).value()->value(high));
    EXPECT_FALSE(one->value(std::span<const std::byte>()));
}

/// Everything that is no value is none: bytes of others come this way.
TEST_F(CustomFields, BytesThatAreNoValueAreTold) {
    const auto type = CustomType::make("SFAb", {Of::float64, 2}).value();
    const std::string box(type->zero().box.data(), type->zero().box.size());
    EXPECT_NE(CustomType::ofBox(box), nullptr);
    for (std::size_t n = 0; n < box.size(); ++n) EXPECT_EQ(CustomType::ofBox(box.substr(0, n)), nullptr) << n;
    EXPECT_EQ(CustomType::ofBox(box + '\0'), nullptr);
    for (const auto& [at, byte] :
         {std::pair(0, '\4'), std::pair(0, '\377'), std::pair(1, '\0'), std::pair(1, '\3'), std::pair(2, '\17'),
          std::pair(3, '\0'), std::pair(3, '\377'), std::pair(4, 'a'), std::pair(5, ' ')}) {
        std::string wrong = box;
        wrong[static_cast<std::size_t>(at)] = byte;
        EXPECT_EQ(CustomType::ofBox(wrong), nullptr) << at;
    }
}

TEST_F(CustomFields, EqualityAndHashAreOfTheBits) {
    const Value a(metres(3.5)), b(metres(3.5)), c(metres(4));
    EXPECT_EQ(a, b);
    EXPECT_FALSE(a == c);
    const auto hash = [](const Value& value) { return hashOfValue(value.type(), value.storage(), 7); };
    EXPECT_EQ(hash(a), hash(b));
    EXPECT_FALSE(hash(a) == hash(c));
    const Value list(Array<CustomValue>{metres(1), metres(2)}), other(Array<CustomValue>{metres(1), metres(2)});
    EXPECT_EQ(list, other);
    EXPECT_EQ(hash(list), hash(other)) << "not of where they lie";
    const double numbers[] = {3.5, 1};
    const Value elsewhere(CustomType::make("SFWidth", {Of::float64, 2}).value()->value(numbers).value());
    EXPECT_FALSE(a == elsewhere);
    EXPECT_FALSE(hash(a) == hash(elsewhere));
}

TEST_F(CustomFields, TheRegistryKnowsOneLayoutForAName) {
    EXPECT_EQ(findFieldType("SFLength"), nullptr);
    const auto type = length();
    EXPECT_EQ(findFieldType("MFLength"), type);
    EXPECT_EQ(findFieldType("XFLength"), nullptr);
    EXPECT_TRUE(registerFieldType("SFLength", {Of::float64, 2}));
    EXPECT_TRUE(hasCustomText(*type)) << "what it can do stays when it is only named again";
    const auto other = registerFieldType("SFLength", {Of::float32, 2});
    ASSERT_FALSE(other);
    EXPECT_THAT(other.error().text, HasSubstr("another layout"));
    EXPECT_FALSE(registerFieldType("SFVec3f", {Of::float32, 3}));
    CustomFunctions half;
    half.print = [](const CustomValue&) { return std::string("x"); };
    EXPECT_FALSE(registerFieldType("SFHalf", {}, half));
    FieldType found{};
    std::shared_ptr<const CustomType> custom;
    ASSERT_TRUE(fieldTypeFromName("MFLength", found, custom));
    EXPECT_EQ(found, FieldType::MFCustom);
    EXPECT_EQ(custom, type);
    ASSERT_TRUE(fieldTypeFromName("SFVec3f", found, custom));
    EXPECT_EQ(custom, nullptr);
    EXPECT_FALSE(fieldTypeFromName("SFCustom", found, custom));
    {
        const auto inStream = CustomType::make("SFLength", {Of::int32, 1}).value();
        const FieldTypesInScope scope({inStream});
        EXPECT_EQ(findFieldType("SFLength"), inStream);
    }
    EXPECT_EQ(findFieldType("SFLength"), type);
}

TEST_F(CustomFields, TextIsTheTypesOwnInQuotesOrTheNumbers) {
    const auto type = length();
    const Value one(metres(3.5)), list(Array<CustomValue>{metres(1), metres(2.25)});
    EXPECT_EQ(printFieldText(one), "\"3.5 m^1\"");
    EXPECT_EQ(printFieldText(one, TextSyntax::xml), "3.5 m^1");
    EXPECT_EQ(printFieldText(one, TextSyntax::json), "\"3.5 m^1\"");
    EXPECT_EQ(printFieldText(list), "[\"1 m^1\", \"2.25 m^1\"]");
    EXPECT_EQ(printFieldText(list, TextSyntax::xml), "\"1 m^1\" \"2.25 m^1\"");
    for (const auto& [text, syntax] :
         {std::pair("\"3.5 m^1\"", TextSyntax::classicVrml), std::pair("3.5 1", TextSyntax::classicVrml),
          std::pair("3.5 m^1", TextSyntax::xml), std::pair(" 3.5, 1 ", TextSyntax::xml),
          std::pair("\"3.5 m^1\"", TextSyntax::xml)})
        EXPECT_EQ(parseFieldText(FieldType::SFCustom, text, syntax, type.get()), one) << text;
    EXPECT_EQ(parseFieldText(FieldType::MFCustom, "[ 1 1, \"2.25 m^1\" # two\n ]", TextSyntax::classicVrml, type.get()),
              list);
    EXPECT_EQ(parseFieldText(FieldType::MFCustom, "\"1 m^1\" 2.25 1", TextSyntax::xml, type.get()), list);
    EXPECT_EQ(parseFieldText(FieldType::MFCustom, "1 1", TextSyntax::classicVrml, type.get())
                  ->as<Array<CustomValue>>()
                  .size(),
              1u);
    const CustomNumbersOnly numbers;
    EXPECT_EQ(printFieldText(one), "3.5 1");
    EXPECT_EQ(printFieldText(one, TextSyntax::json), "[3.5,1]");
}

TEST_F(CustomFields, TheDefaultTextNeedsNoFunctions) {
    const auto text = [](const CustomType& type, std::span<const double> numbers, TextSyntax syntax) {
        return printFieldText(Value(type.value(numbers).value()), syntax);
    };
    const double tenth[] = {0.1f}, bytes[] = {10, 0, 255};
    const auto single = CustomType::make("SFA", {Of::float32, 1}).value(),
               tag = CustomType::make("SFB", {Of::bytes, 0}).value();
    EXPECT_EQ(text(*single, tenth, TextSyntax::classicVrml), "0.1");
    EXPECT_EQ(text(*single, tenth, TextSyntax::json), "0.1");
    EXPECT_EQ(text(*tag, bytes, TextSyntax::classicVrml), "0x0a00ff");
    EXPECT_EQ(text(*tag, {}, TextSyntax::xml), "0x");
    EXPECT_EQ(text(*tag, bytes, TextSyntax::json), "\"0x0a00ff\"");
    for (const char* given : {"0x0a00ff", "\"0x0A00FF\""})
        EXPECT_EQ(parseFieldText(FieldType::SFCustom, given, TextSyntax::xml, tag.get()),
                  Value(tag->value(bytes).value()));
    const double infinite[] = {std::numeric_limits<double>::infinity()};
    EXPECT_EQ(text(*single, infinite, TextSyntax::json), "null");
}

TEST_F(CustomFields, FaultsOfTextSayWhatAndWhere) {
    const auto type = length();
    const auto said = [&](std::string_view text, TextSyntax syntax = TextSyntax::classicVrml) {
        return complaint(parseFieldText(FieldType::SFCustom, text, syntax, type.get()));
    };
    EXPECT_EQ(said("3.5"),
              "1:4: error: expected 2 numbers, or a text in double quotes (SFLength), found the end "
              "[value-text]");
    EXPECT_EQ(said("\"tall\""), "1:1: error: no length [value-text]");
    EXPECT_EQ(said("tall", TextSyntax::xml), "1:1: error: no length [value-text]");
    EXPECT_EQ(said("1 10"), "1:1: error: too high a power [value-text]");
    EXPECT_EQ(said("\"1 m^10\""), "1:1: error: too high a power [value-text]");
    EXPECT_THAT(said("1 2 3"), HasSubstr("1:5: error: there is more than one SFLength"));
    EXPECT_THAT(said("1e999 1"), HasSubstr("not finite"));
    EXPECT_THAT(said("\"3.5 m^1"), HasSubstr("not closed"));
    const auto tag = CustomType::make("SFTag", {Of::bytes, 2}).value();
    for (const char* text : {"0x0", "0xzz", "12", "0x010203", "0x01", "\"ab\""})
        EXPECT_FALSE(parseFieldText(FieldType::SFCustom, text, TextSyntax::classicVrml, tag.get())) << text;
    EXPECT_THAT(complaint(parseFieldText(FieldType::MFCustom, "[ 1 2", TextSyntax::classicVrml, type.get())),
                HasSubstr("']' is missing"));
    EXPECT_FALSE(parseFieldText(FieldType::SFCustom, "1 2")) << "which type it is must be said";
}

/// Bits are never lost, whatever a function makes of them.
TEST_F(CustomFields, FunctionsOfOthersCanDoNoHarm) {
    const auto text = [](auto print, auto parse) {
        CustomFunctions functions;
        functions.print = print;
        functions.parse = parse;
        const auto type = registerFieldType("SFOdd", {Of::int32, 1}, functions).value();
        const double five[] = {5};
        return printFieldText(Value(type->value(five).value()));
    };
    const auto five = [](const CustomType& type, std::string_view) -> Result<CustomValue> {
        const double number[] = {5};
        return type.value(number);
    };
    const auto six = [](const CustomType& type, std::string_view) -> Result<CustomValue> {
        const double number[] = {6};
        return type.value(number);
    };
    const auto other = [](const CustomType&, std::string_view) -> Result<CustomValue> { return CustomValue(); };
    const auto throws = [](const CustomType&, std::string_view) -> Result<CustomValue> {
        throw std::runtime_error("no");
    };
    const auto says = [](std::string what) { return [what](const CustomValue&) { return what; }; };
    EXPECT_EQ(text(says("five"), five), "\"five\"");
    EXPECT_EQ(text(says("five"), six), "5") << "it does not read back";
    EXPECT_EQ(text(says("five"), other), "5");
    EXPECT_EQ(text(says("five"), throws), "5");
    EXPECT_EQ(text([](const CustomValue&) -> std::string { throw 1; }, five), "5");
    for (const char* number : {"6", "+6", "-6.5e1", "0x6", " 6 ", "6,"})
        EXPECT_EQ(text(says(number), five), "5") << "it would read as another number: " << number;
    for (const char* unit : {"5 A", "5F", "0xG", "5 6", "fade", "five", "-"})
        EXPECT_EQ(text(says(unit), five), '"' + std::string(unit) + '"') << "an integer is something else";
    EXPECT_EQ(text(says("\xFF"), five), "5") << "no UTF-8";
    EXPECT_EQ(text(says(std::string("a\0b", 3)), five), "5");
    EXPECT_EQ(text(says("a\"b"), five), "\"a\\\"b\"");
    CustomFunctions functions;
    functions.normalised = [](const CustomType&, const CustomValue&) -> Result<CustomValue> { throw 1; };
    functions.between = [](const CustomValue&, const CustomValue&, double) { return CustomValue(); };
    const auto type = registerFieldType("SFOdd", {Of::int32, 1}, functions).value();
    EXPECT_THAT(complaint(parseFieldText(FieldType::SFCustom, "5", TextSyntax::xml, type.get())), HasSubstr("failed"));
    EXPECT_EQ(customBetween(type->zero(), type->zero(), .5), type->zero());
}

TEST_F(CustomFields, ValuesInBetween) {
    EXPECT_EQ(customBetween(metres(1), metres(3), .25), metres(1.5));
    const auto plain = CustomType::make("SFPlain", {Of::float64, 1}).value();
    const double two[] = {2};
    EXPECT_EQ(customBetween(plain->zero(), plain->value(two).value(), .5), plain->zero());
}

std::shared_ptr<const NodeType> gauge() {
    auto type = std::make_shared<NodeType>();
    type->name = "Gauge";
    type->component = "Test";
    type->kind = NodeType::Kind::user;
    type->implements = {"X3DNode", "X3DChildNode"};
    const auto length = findFieldType("SFLength"), width = CustomType::make("SFWidth", {Of::float64, 2}).value();
    for (const auto& [name, of, custom] :
         {std::tuple("length", FieldType::SFCustom, length), std::tuple("lengths", FieldType::MFCustom, length),
          std::tuple("width", FieldType::SFCustom, width)}) {
        FieldDef& field = type->fields.emplace_back();
        field.name = name;
        field.type = of;
        field.custom = custom;
    }
    EXPECT_TRUE(type->finish());
    return type;
}

TEST_F(CustomFields, FieldsHoldTheirOwnTypeAndPassItOn) {
    const auto length = CustomFields::length();
    Scene scene;
    const TypeIndex type = scene.defineType(gauge()).value();
    const NodeId a = scene.createNode(type), b = scene.createNode(type);
    EXPECT_EQ(scene.node(a).value(0), Value(length->zero()));
    ASSERT_TRUE(scene.setField(a, 0, Value(metres(2))));
    const auto wrong = scene.setField(a, 2, Value(metres(2)));
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().text, "Gauge.width is SFWidth, not SFLength");
    EXPECT_FALSE(scene.setField(a, 0, Value(CustomValue())));
    EXPECT_FALSE(scene.sendEvent(a, 2, Value(metres(2))));
    EXPECT_FALSE(scene.setField(a, 1, Value(Array<CustomValue>{scene.node(a).value(2).as<CustomValue>()})));
    ASSERT_TRUE(scene.setField(a, 1, Value(Array<CustomValue>{metres(1), metres(2)})));
    ASSERT_TRUE(scene.addRoute(a, 0, b, 0));
    ASSERT_TRUE(scene.addRoute(a, 1, b, 1));
    const auto route = scene.addRoute(a, 0, b, 2);
    ASSERT_FALSE(route);
    EXPECT_EQ(route.error().text, "route from SFLength length to SFWidth width");
    ASSERT_TRUE(scene.sendEvent(a, 0, Value(metres(7))));
    ASSERT_TRUE(scene.sendEvent(a, 1, Value(Array<CustomValue>{metres(8)})));
    scene.newFrame(1);
    EXPECT_EQ(scene.node(b).value(0), Value(metres(7)));
    EXPECT_EQ(scene.node(b).value(1), Value(Array<CustomValue>{metres(8)}));
    auto unfinished = std::make_unique<NodeType>();
    unfinished->fields.emplace_back().type = FieldType::SFCustom;
    EXPECT_FALSE(unfinished->finish()) << "a field of a type from outside says which";
}

}  // namespace
