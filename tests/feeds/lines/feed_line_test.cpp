// Lines of feeds: what they say, what is wrong with them, and that values come back with the same bits.
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <rtsg/core/field_text.h>

#include "lines/feed_line.h"
#include "lines/line_splitter.h"

namespace rtsg::feeds {

namespace {

FeedLine lineOf(std::string_view text) {
    FeedReader reader;
    auto line = reader.read(text);
    if (!line) ADD_FAILURE() << text << ": " << line.error().text;
    if (!line || !*line) return {};
    return **line;
}
std::string faultIn(std::string_view text) {
    FeedReader reader;
    const auto line = reader.read(text);
    return line ? "" : line.error().text;
}
std::string textOf(std::string_view text, FieldType type) {
    const auto value = valueOf(lineOf(text), type);
    return value ? printFieldText(*value) : "wrong: " + value.error().text;
}
std::string asLine(const Value& value) {
    return R"({"node":"A","field":"f","value":)" + printFieldText(value, TextSyntax::json) + "}";
}

}  // namespace

TEST(FeedLine, ValuesOfTypesFromOutsideAreNumbersOrTexts) {
    const auto before = fieldTypeRegistry();
    CustomFunctions named;
    named.print = [](const CustomValue& value) { return customNumbers(value)[0] > 0 ? "on" : "off"; };
    named.parse = [](const CustomType& type, std::string_view text) -> Result<CustomValue> {
        const double numbers[] = {text == "on" ? 1.0 : 0.0, 0};
        if (text != "on" && text != "off") return fail("neither on nor off");
        return type.value(numbers);
    };
    const auto type = registerFieldType("SFState", {CustomLayout::Of::float64, 2}, named).value();
    const auto read = [&](std::string_view line, FieldType many) {
        const auto value = valueOf(lineOf(line), many, type.get());
        return value ? printFieldText(*value) : "wrong: " + value.error().text;
    };
    EXPECT_EQ(read(R"({"node":"A","field":"f","value":"on"})", FieldType::SFCustom), "\"on\"");
    EXPECT_EQ(read(R"({"node":"A","field":"f","value":[1,0]})", FieldType::SFCustom), "\"on\"");
    EXPECT_EQ(read(R"({"node":"A","field":"f","value":["on","off"]})", FieldType::MFCustom), "[\"on\", \"off\"]");
    EXPECT_EQ(read(R"({"node":"A","field":"f","value":[[1,0],[0,0]]})", FieldType::MFCustom), "[\"on\", \"off\"]");
    EXPECT_EQ(read("A,f,on", FieldType::SFCustom), "\"on\"");
    EXPECT_EQ(read("A,f,1 0", FieldType::SFCustom), "\"on\"");
    EXPECT_EQ(read("A,f,1 0 0 0", FieldType::MFCustom), "[\"on\", \"off\"]");
    EXPECT_EQ(read("A,f,maybe", FieldType::SFCustom), "wrong: neither on nor off");
    EXPECT_EQ(read(R"({"node":"A","field":"f","value":[[1,0]]})", FieldType::SFCustom), "wrong: expected SFState");
    restoreFieldTypes(before);
}

TEST(FeedLine, JsonHasNodeFieldValueAndPerhapsTimeAndAuthor) {
    const FeedLine line = lineOf(
        R"( {"t":1.5, "more":{"a":[1,{"b":"}"}],"c":null}, "node":"HALL\/DOOR","field":"set_x","author":"\u00c9mile \ud83d\ude00","value":[1,2.50,-3e-2]} )");
    EXPECT_EQ(line.node, "HALL/DOOR");
    EXPECT_EQ(line.field, "set_x");
    EXPECT_EQ(line.author, "Émile 😀");
    EXPECT_EQ(line.time, 1.5);
    EXPECT_EQ(line.value, "1 2.50 -3e-2");
    EXPECT_EQ(line.shape.depth, 1);
    EXPECT_EQ(line.shape.count, 3u);
    EXPECT_FALSE(lineOf(R"({"node":"A","field":"f","value":true})").time);
}

TEST(FeedLine, CsvHasThreeToFiveCellsOrThoseOfAHeader) {
    EXPECT_EQ(lineOf("A,f,1 2 3").value, "1 2 3");
    EXPECT_EQ(lineOf("0.5,A,f,TRUE").time, 0.5);
    EXPECT_EQ(lineOf(",A,f,TRUE").time, std::nullopt);
    EXPECT_EQ(lineOf(R"(1,A,f,"say ""yes"", now",Ann)").value, R"(say "yes", now)");
    EXPECT_EQ(lineOf("1,A,f,0,Ann\r").author, "Ann");
    FeedReader reader;
    EXPECT_FALSE(*reader.read("value,unit,node,field"));
    const auto line = reader.read("7,m,A,f");
    ASSERT_TRUE(line && *line);
    EXPECT_EQ((*line)->value, "7");
    EXPECT_EQ((*line)->node, "A");
    EXPECT_EQ(reader.read("A,f,7").error().text, "3 cells, and the header has 4");
}

TEST(FeedLine, EmptyLinesAndCommentsSayNothing) {
    for (const char* text : {"", "  ", "\r", "# node,field,value"}) EXPECT_FALSE(*FeedReader().read(text)) << text;
}

TEST(FeedLine, WhatIsWrongIsSaid) {
    EXPECT_EQ(faultIn("{"), "expected a string");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f"})"), "there is no \"value\"");
    EXPECT_EQ(faultIn(R"({"field":"f","value":1})"), "there is no \"node\"");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":[1,2})"), "expected ',' or ']'");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":null})"), "null is no value of a field");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":[[[1]]]})"),
              "arrays are nested deeper than values of fields are");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":[1,[2]]})"), "numbers and arrays stand side by side");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":{"x":1}})"), "an object is no value of a field");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":01})"), "'01' is no value of JSON");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":1} x)"), "more follows after the object");
    EXPECT_EQ(faultIn(std::string_view("{\"node\":\"A\",\"field\":\"f\",\"value\":1}\0x", 36)),
              "more follows after the object");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"\ud800","value":1})"), "half of a surrogate pair");
    EXPECT_EQ(faultIn(R"({"node":"A","field":"f","value":1,"t":"now"})"), "t: expected a number of seconds");
    EXPECT_EQ(faultIn("A,f"), "2 cells: expected [t,]node,field,value[,author], or JSON");
    EXPECT_EQ(faultIn("A,f,\"x"), "a quoted cell without an end");
    EXPECT_EQ(faultIn("soon,A,f,1"), "t: 'soon' is no time in seconds");
    EXPECT_EQ(faultIn("inf,A,f,1"), "t: 'inf' is no time in seconds");
    EXPECT_EQ(faultIn("A,f,\xff"), "a byte that is no UTF-8");
    FeedReader reader;
    EXPECT_EQ(reader.read(R"({"node":"A",,)").error().where.column, 13u);
}

TEST(FeedLine, NestingCostsNoStack) {
    const std::string deep(kLongestLine / 2, '[');
    EXPECT_NE(faultIn(R"({"x":)" + deep), "");
    EXPECT_NE(faultIn(R"({"node":"A","field":"f","value":)" + deep), "");
}

TEST(FeedLine, ValuesHaveTheFormOfTheirField) {
    const auto json = [](std::string_view value) {
        return R"({"node":"A","field":"f","value":)" + std::string(value) + "}";
    };
    EXPECT_EQ(textOf(json("[1,2,3]"), FieldType::SFVec3f), "1 2 3");
    EXPECT_EQ(textOf(json("[[1,2,3],[4,5,6]]"), FieldType::MFVec3f), "[1 2 3, 4 5 6]");
    EXPECT_EQ(textOf(json("[1,2,3,4,5,6]"), FieldType::MFVec3f), "[1 2 3, 4 5 6]");
    EXPECT_EQ(textOf(json("[]"), FieldType::MFVec3f), "[]");
    EXPECT_EQ(textOf(json("true"), FieldType::SFBool), "TRUE");
    EXPECT_EQ(textOf(json(R"(["a\"b","c"])"), FieldType::MFString), R"(["a\"b", "c"])");
    EXPECT_EQ(textOf(json("[1,1,1,255]"), FieldType::SFImage), "1 1 1 0xff");
    EXPECT_EQ(textOf("A,f,1 2 3", FieldType::MFFloat), "[1, 2, 3]");
    EXPECT_EQ(textOf("A,f,say it", FieldType::SFString), "\"say it\"");
    for (const auto& [value, type] : {std::pair{"[1,2]", FieldType::SFVec3f},
                                      {"1", FieldType::SFVec3f},
                                      {"[1]", FieldType::SFFloat},
                                      {"[[1,2],[3,4,5,6]]", FieldType::MFVec3f},
                                      {"[[1,2],[3,4]]", FieldType::MFVec3f},
                                      {"[1,2]", FieldType::MFVec3f},
                                      {"[[1],[2]]", FieldType::MFFloat},
                                      {"1", FieldType::MFFloat},
                                      {"\"1\"", FieldType::SFFloat},
                                      {"1.5", FieldType::SFInt32},
                                      {"1", FieldType::SFBool},
                                      {"1", FieldType::SFNode},
                                      {"[3]", FieldType::MFNode}})
        EXPECT_TRUE(textOf(json(value), type).starts_with("wrong: ")) << value << ' ' << info(type).name;
}

TEST(FeedLine, PrintedValuesComeBackBitForBit) {
    std::mt19937 random(7);
    for (int i = 0; i < 20'000; ++i) {
        const auto number = [&] {
            const auto bits = static_cast<std::uint32_t>(random());
            const float value = std::bit_cast<float>(bits);
            return std::isfinite(value) ? value : -0.0f;
        };
        const Value one(Vec3f(number(), number(), -0.0f));
        const auto back = valueOf(lineOf(asLine(one)), FieldType::SFVec3f);
        ASSERT_TRUE(back) << asLine(one);
        ASSERT_EQ(std::memcmp(&back->as<Vec3f>(), &one.as<Vec3f>(), sizeof(Vec3f)), 0) << asLine(one);
    }
    const Value strings(Array<String>{String("a\n\"\\\x01é"), String("")});
    EXPECT_EQ(*valueOf(lineOf(asLine(strings)), FieldType::MFString), strings);
}

/// This reader accepts exactly the lines that another one accepts; lines are made by damaging good ones.
TEST(FeedLine, AgreesWithAnotherReaderOfJson) {
    std::mt19937 random(11);
    const std::string good = R"({"t":1.5,"node":"A\u00e9","field":"f","value":[1,-2.5,0],"x":{"y":[true,null,{}]}})";
    constexpr std::string_view kBytes = "{}[],:\"\\0123456789.+-trufalsn u\x01";
    int taken = 0;
    for (int i = 0; i < 50'000; ++i) {
        std::string line = good;
        for (unsigned edits = 1 + random() % 2; edits > 0; --edits) {
            const std::size_t at = random() % line.size();
            if (random() % 3 == 0)
                line.erase(at, 1);
            else
                line.replace(at, random() % 2, 1, kBytes[random() % kBytes.size()]);
        }
        if (line.front() != '{') continue;
        const bool valid = nlohmann::json::accept(line);
        const std::string fault = faultIn(line);
        if (fault.empty()) {
            EXPECT_TRUE(valid) << line;
            ++taken;
        }
        // It may refuse more: other values, and no node.
        if (fault.starts_with("expected '") || fault.ends_with("no value of JSON") || fault.contains("string")) {
            EXPECT_FALSE(valid) << line << ": " << fault;
        }
    }
    EXPECT_GT(taken, 1000);
}

TEST(LineSplitter, LinesAreTheSameHoweverTheyCome) {
    std::mt19937 random(3);
    for (int round = 0; round < 200; ++round) {
        std::string text;
        for (int i = 0; i < 100; ++i) text += "ab\n"[random() % 3];
        std::vector<std::string> whole, pieces;
        LineSplitter one, other;
        const auto into = [](std::vector<std::string>& lines) {
            return [&lines](std::string_view line, bool) { lines.emplace_back(line); };
        };
        one.add(text, into(whole));
        one.finish(into(whole));
        for (std::size_t at = 0; at < text.size();) {
            const std::size_t size = 1 + random() % 9;
            other.add(std::string_view(text).substr(at, size), into(pieces));
            at += size;
        }
        other.finish(into(pieces));
        EXPECT_EQ(whole, pieces) << text;
    }
}

TEST(LineSplitter, ALongLineIsNamedOnceAndNotKept) {
    LineSplitter splitter;
    std::vector<std::pair<std::size_t, bool>> lines;
    const auto take = [&](std::string_view line, bool tooLong) { lines.emplace_back(line.size(), tooLong); };
    const std::string piece(kLongestLine / 4, 'x');
    for (int i = 0; i < 40; ++i) splitter.add(piece, take);
    splitter.add("\nshort\n" + std::string(kLongestLine, 'y') + "\n" + std::string(kLongestLine + 1, 'z') + "\n", take);
    const std::vector<std::pair<std::size_t, bool>> expected = {
        {kLongestLine, true}, {5, false}, {kLongestLine, false}, {kLongestLine, true}};
    EXPECT_EQ(lines, expected);
}

}  // namespace rtsg::feeds
