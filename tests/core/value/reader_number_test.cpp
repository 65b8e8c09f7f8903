// The number scanner against strtod and strtof, which round correctly.
#include <cmath>
#include <cstdlib>
#include <random>

#include <gtest/gtest.h>

#include "text/number_text.h"

namespace rtsg::detail {
namespace {

template <class S>
S reference(const std::string& text) {
    if constexpr (std::is_same_v<S, float>)
        return std::strtof(text.c_str(), nullptr);
    else
        return std::strtod(text.c_str(), nullptr);
}

template <class S>
void expectRoundedCorrectly(const std::string& text) {
    for (const std::string& padded : {text, text + ",", text + " 1", text + "]"}) {
        const char* p = padded.data();
        S value = 42;
        const NumberStatus status = scanReal(p, padded.data() + padded.size(), value);
        const S expected = reference<S>(text);
        if (std::isinf(expected)) {
            EXPECT_EQ(status, NumberStatus::notFinite) << text;
            EXPECT_EQ(value, 0) << text;
        } else {
            EXPECT_EQ(status, NumberStatus::ok) << text;
            EXPECT_EQ(value, expected) << text;
        }
        EXPECT_EQ(p, padded.data() + text.size()) << text;
    }
}

void expectBoth(const std::string& text) {
    expectRoundedCorrectly<float>(text);
    expectRoundedCorrectly<double>(text);
}

TEST(ReaderNumber, SpellingsOfReals) {
    for (const char* text : {"0",
                             "-0",
                             "+1",
                             "1.",
                             ".5",
                             "-.5e1",
                             "1e5",
                             "1E+05",
                             "1e-5",
                             "00012.50",
                             "123456789012345678",
                             "1234567890123456789012345",
                             "0.1",
                             "3.4028235e38",
                             "3.4028236e38",
                             "1e39",
                             "-1e400",
                             "1e-46",
                             "1.17549435e-38",
                             "1e-45",
                             "7e-46",
                             "4.9e-324",
                             "2e-324",
                             "1e-400",
                             "1.7976931348623157e308",
                             "1.7976931348623159e308",
                             "0e999999",
                             "0.00000000000000000000000000000000000000000001e44"})
        expectBoth(text);
    expectBoth("0." + std::string(400, '0') + "1");
    expectBoth(std::string(400, '9'));
    expectBoth(std::string(400, '9') + "e-390");
    expectBoth("1e99999999999999999999");
    expectBoth("1e-99999999999999999999");
}

// Decimals half way between two floats, or one digit off it, are where rounding twice goes wrong.
TEST(ReaderNumber, HalvesBetweenFloats) {
    const unsigned seed = 20240229;
    std::mt19937 random(seed);
    for (int i = 0; i < 3000; ++i) {
        const auto bits = static_cast<std::uint32_t>(random() % 0x7F000000u);
        const float a = std::bit_cast<float>(bits), b = std::bit_cast<float>(bits + 1);
        const double middle = (static_cast<double>(a) + static_cast<double>(b)) / 2;
        for (const int digits : {9, 12, 17, 25, 120}) {
            char text[200];
            std::snprintf(text, sizeof(text), "%.*g", digits, middle);
            expectRoundedCorrectly<float>(text);
        }
    }
}

TEST(ReaderNumber, RandomDecimals) {
    const unsigned seed = 7;
    SCOPED_TRACE(seed);
    std::mt19937_64 random(seed);
    for (int i = 0; i < 20000; ++i) {
        std::string text = random() % 2 ? "-" : "";
        const auto digits = [&](std::uint64_t maximum) {
            for (std::uint64_t n = random() % maximum; n > 0; --n) text += static_cast<char>('0' + random() % 10);
        };
        text += static_cast<char>('0' + random() % 10);
        digits(12);
        if (random() % 4) {
            text += '.';
            digits(14);
        }
        if (random() % 3 == 0) text += "e" + std::to_string(static_cast<int>(random() % 100) - 50);
        expectBoth(text);
    }
}

TEST(ReaderNumber, Malformed) {
    for (const char* text : {"", "-", "+", ".", "e5", "1e", "1e+", "1.5.2", "1-2", "0x10", "abc", "1f", "--1", "+-1",
                             "-.", "1,5x", "TRUE", "1e5e5"}) {
        const std::string word = std::string(text).substr(0, std::string(text).find(','));
        if (word == "1") continue;
        const std::string padded = word + " ";
        const char* p = padded.data();
        float value = 0;
        EXPECT_EQ(scanReal(p, padded.data() + padded.size(), value), NumberStatus::malformed) << text;
    }
}

TEST(ReaderNumber, NotANumberInEverySpelling) {
    for (const char* text : {"nan", "NaN", "-nan", "inf", "-INF", "infinity", "1.#QNAN", "-1.#IND", "1.#INF"}) {
        const std::string padded = std::string(text) + " 1";
        const char* p = padded.data();
        double value = 1;
        EXPECT_EQ(scanReal(p, padded.data() + padded.size(), value), NumberStatus::notFinite) << text;
        EXPECT_EQ(value, 0) << text;
        EXPECT_EQ(*p, ' ') << text;
    }
}

TEST(ReaderNumber, Integers) {
    struct Case {
        const char* text;
        NumberStatus status;
        std::int32_t value;
    };
    for (const Case& c :
         {Case{"0", NumberStatus::ok, 0}, Case{"-1", NumberStatus::ok, -1}, Case{"+7", NumberStatus::ok, 7},
          Case{"2147483647", NumberStatus::ok, 2147483647}, Case{"2147483648", NumberStatus::notFinite, 0},
          Case{"-2147483648", NumberStatus::ok, -2147483647 - 1}, Case{"-2147483649", NumberStatus::notFinite, 0},
          Case{"0xFF", NumberStatus::ok, 255}, Case{"0XffFFffFF", NumberStatus::ok, -1},
          Case{"0x1FFFFFFFF", NumberStatus::notFinite, 0}, Case{"99999999999999999999999", NumberStatus::notFinite, 0},
          Case{"1.0", NumberStatus::malformed, 0}, Case{"0x", NumberStatus::malformed, 0},
          Case{"0xG", NumberStatus::malformed, 0}, Case{"-", NumberStatus::malformed, 0}}) {
        const std::string padded = std::string(c.text) + ",";
        const char* p = padded.data();
        std::int32_t value = 0;
        EXPECT_EQ(scanInteger(p, padded.data() + padded.size(), value), c.status) << c.text;
        EXPECT_EQ(value, c.value) << c.text;
        EXPECT_EQ(*p, ',') << c.text;
    }
    const std::string pixel = "4294967295";
    const char* p = pixel.data();
    std::int32_t value = 0;
    EXPECT_EQ(scanInteger(p, pixel.data() + pixel.size(), value, true), NumberStatus::ok);
    EXPECT_EQ(value, -1);
}

}  // namespace
}  // namespace rtsg::detail
