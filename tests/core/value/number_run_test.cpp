// Runs of numbers against strtof, strtod and strtol, and against the scanner that takes one number at a time.
#include <algorithm>
#include <bit>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>

#include "text/number_run.h"

namespace rtsg::detail {
namespace {

template <class S>
S valueOf(const std::string& word) {
    if constexpr (std::is_same_v<S, float>)
        return std::strtof(word.c_str(), nullptr);
    else if constexpr (std::is_same_v<S, double>)
        return std::strtod(word.c_str(), nullptr);
    else
        return static_cast<S>(std::strtol(word.c_str(), nullptr, word.starts_with("0x") ? 16 : 10));
}

class Words {
  public:
    explicit Words(unsigned seed) : random_(seed) {}
    std::size_t below(std::size_t count) { return random_() % count; }
    std::string digits(std::size_t minimum, std::size_t maximum) {
        std::string text;
        for (std::size_t n = minimum + below(maximum - minimum + 1); n > 0; --n)
            text += static_cast<char>('0' + below(10));
        return text;
    }
    std::string sign() { return below(3) == 0 ? "-" : below(12) == 0 ? "+" : ""; }
    /// A number as files hold them; now and then one that is longer than runs like.
    template <class S>
    std::string number() {
        if constexpr (std::is_same_v<S, std::int32_t>) {
            if (below(40) == 0) return "0x" + digits(1, 7);
            return sign() + (below(10) == 0 ? "00000000" : "") + digits(1, 9);
        }
        std::string text = sign();
        switch (below(8)) {
            case 0:
                return text + digits(1, 17);
            case 1:
                return text + digits(1, 3) + ".";
            case 2:
                return text + "." + digits(1, 15);
            case 3:
                return text + digits(1, 2) + "." + digits(0, 9) + "e" + (below(2) ? "-" : "+") + digits(1, 1);
            case 4:
                return text + digits(1, 12) + "." + digits(0, 12);
            default:
                return text + digits(1, 4) + "." + digits(0, 7);
        }
    }
    std::string space() {
        static constexpr std::string_view kinds[] = {" ", ",", "\n", "\t", "\r", ", ", "\r\n", " ,\n\t"};
        if (below(50) == 0) return std::string(below(90) + 1, ' ');
        return std::string(below(3) ? " " : kinds[below(std::size(kinds))]);
    }

  private:
    std::mt19937 random_;
};

/// -0 is not 0.
template <class S>
bool same(S a, S b) {
    return std::memcmp(&a, &b, sizeof(S)) == 0;
}

template <class S>
void expectTheNumbersOf(unsigned seed) {
    SCOPED_TRACE(seed);
    Words words(seed);
    std::string text;
    std::vector<std::string> expected;
    for (std::size_t i = words.below(900); i > 0; --i) {
        expected.push_back(words.number<S>());
        text += expected.back() + words.space();
    }
    const char *p = text.data(), *const end = p + text.size();
    std::vector<S> numbers(expected.size() + kRunMax);
    const std::size_t count = scanRun(p, end, numbers.data(), numbers.size());
    ASSERT_LE(count, expected.size());
    for (std::size_t i = 0; i < count; ++i)
        ASSERT_TRUE(same(numbers[i], valueOf<S>(expected[i]))) << expected[i] << " is not " << numbers[i];
#if defined(__SSE4_1__)
    EXPECT_LT(end - p, kRunLook) << "a run takes all but the last bytes";
#endif
    // The rest begins with the next number.
    p = std::find_if_not(p, end, isSpace);
    for (std::size_t i = count; i < expected.size(); ++i) {
        ASSERT_TRUE(std::string_view(p, end).starts_with(expected[i]));
        p = std::find_if_not(p + expected[i].size(), end, isSpace);
    }
    EXPECT_EQ(p, end);
}

TEST(NumberRun, GivesTheNumbersOfTheText) {
    for (unsigned seed = 1; seed <= 300; ++seed) {
        expectTheNumbersOf<float>(seed);
        expectTheNumbersOf<double>(seed);
        expectTheNumbersOf<std::int32_t>(seed);
    }
}

/// Everything that is no number, or one that needs words: there the one scanner has to end where the other does.
TEST(NumberRun, EndsBeforeWhatIsNotPlain) {
    const std::string odd[] = {"x",
                               "-",
                               "+",
                               ".",
                               "1.2.3",
                               "1-2",
                               "--1",
                               "1e",
                               "1e+",
                               "#c",
                               "1#c",
                               "]",
                               "1]",
                               "\"",
                               "nan",
                               "-inf",
                               "1e9",
                               "1.#INF",
                               "0x",
                               "\xC3\xA4",
                               "1:2",
                               "1.5e99",
                               "99999999999999999999",
                               "1;",
                               "/",
                               std::string(1, '\0'),
                               "1[2",
                               "1{"};
    Words words(20261121);
    for (int round = 0; round < 2000; ++round) {
        std::string text;
        const std::size_t before = words.below(40);
        for (std::size_t i = 0; i < before; ++i) text += words.number<float>() + words.space();
        const std::string& word = odd[words.below(std::size(odd))];
        text += word;
        for (int i = 0; i < 30; ++i) text += words.space() + words.number<float>();
        const char *run = text.data(), *one = run, *const end = run + text.size();
        float numbers[256], number = 0;
        const std::size_t count = scanRun(run, end, numbers, std::size(numbers));
        for (std::size_t i = 0; i < count; ++i) {
            one = std::find_if_not(one, end, isSpace);
            ASSERT_EQ(scanReal(one, end, number), NumberStatus::ok) << text;
            ASSERT_TRUE(same(number, numbers[i])) << text;
        }
        ASSERT_EQ(std::find_if_not(run, end, isSpace), std::find_if_not(one, end, isSpace)) << text;
    }
}

TEST(NumberRun, KeepsToTheRoomAndToTheText) {
    std::string text;
    for (int i = 0; i < 400; ++i) text += "7 ";
    for (std::size_t maximum = 0; maximum < 200; ++maximum) {
        std::vector<std::int32_t> numbers(maximum + 1, -1);
        const char* p = text.data();
        const std::size_t count = scanRun(p, text.data() + text.size(), numbers.data(), maximum);
        EXPECT_LE(count, maximum);
        EXPECT_EQ(numbers.back(), -1);
        EXPECT_EQ(p, text.data() + 2 * count);
    }
    // In memory that ends with the text, so that a sanitizer sees what is read behind it.
    for (std::size_t size = 0; size < 300; ++size) {
        const std::vector<char> exact(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(size));
        std::vector<std::int32_t> numbers(200);
        const char* p = exact.data();
        const std::size_t count = scanRun(p, exact.data() + size, numbers.data(), numbers.size());
        EXPECT_EQ(p, exact.data() + 2 * count);
    }
}

/// Lists of every length about where they move from one memory to another, with the zeros behind them that Embree
/// needs.
template <class T>
void expectListsOfEveryLength(std::size_t each) {
    std::string text;
    for (std::size_t size = 0; size < 2200; ++size) {
        const bool looked = size < 40 || (size > 950 && size < 1100) || (size > 2000 && size < 2100);
        if (looked) {
            const std::string padded = text + std::string(200, ' ');
            const auto value = parseFieldText(FieldTypeOf<Array<T>>::value, padded, TextSyntax::xml);
            ASSERT_EQ(bool(value), size % each == 0) << size;
            if (value) {
                const auto& list = value->template as<Array<T>>();
                ASSERT_EQ(list.size(), size / each);
                std::vector<unsigned char> bytes(list.size() * sizeof(T) + kArrayPadding);
                if (!list.empty()) std::memcpy(bytes.data(), static_cast<const void*>(list.data()), bytes.size());
                EXPECT_TRUE(std::all_of(bytes.end() - kArrayPadding, bytes.end(), [](auto b) { return b == 0; }));
                for (std::size_t i = 0; i < list.size() * each; ++i) {
                    float number = 0;
                    std::memcpy(&number, bytes.data() + i * sizeof(float), sizeof(float));
                    ASSERT_EQ(number, static_cast<float>(i) + .5f);
                }
            }
        }
        text += std::to_string(size) + ".5 ";
    }
}

TEST(NumberRun, MakesListsOfEveryLength) {
    expectListsOfEveryLength<float>(1);
    expectListsOfEveryLength<Vec3f>(3);
    expectListsOfEveryLength<Vec4f>(4);
}

}  // namespace
}  // namespace rtsg::detail
