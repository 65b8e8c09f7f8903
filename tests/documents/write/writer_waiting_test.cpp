// Text that waits comes out in its order, whatever of it was in a file meanwhile.
#include <random>

#include <gtest/gtest.h>

#include "write/writer_common.h"
#include "write/writer_waiting.h"

namespace rtsg {
namespace {

using detail::Rope;
using detail::Waiting;
using detail::WaitingText;

Waiting::PrintList onLines() {
    return [](std::string& text, const WaitingText& piece, const std::function<void()>& full) {
        for (const std::int32_t number : piece.numbers.as<Array<std::int32_t>>()) {
            text += std::to_string(number) + "\n";
            if (text.size() > 100'000) full();
        }
    };
}

WaitingText listOf(std::int32_t count, std::string& expected) {
    Array<std::int32_t> numbers;
    WaitingText piece("<" + std::to_string(count) + ">");
    expected += piece.text;
    for (std::int32_t i = 0; i < count; ++i) {
        numbers.push_back(i);
        expected += std::to_string(i) + "\n";
    }
    piece.numbers = Value(std::move(numbers));
    return piece;
}

std::string sentText(Waiting& waiting, Rope& rope) {
    std::string text;
    for (WaitingText& piece : rope) EXPECT_TRUE(waiting.send(piece, [&](std::string_view part) { text += part; }));
    return text;
}

/// Bytes that the pieces hold themselves.
std::size_t heldBy(const Rope& rope) {
    std::size_t bytes = 0;
    for (const WaitingText& piece : rope)
        bytes += piece.text.size() +
                 (piece.numbers.holds<Array<std::int32_t>>() ? 4 * piece.numbers.as<Array<std::int32_t>>().size() : 0);
    return bytes;
}

TEST(Waiting, SmallPiecesAreJoinedAndKeepTheirOrder) {
    Waiting waiting(onLines());
    std::string expected;
    Rope rope;
    for (int i = 0; i < 100'000; ++i) {
        const std::string text = "<" + std::to_string(i) + ">";
        expected += text;
        waiting.add(rope, WaitingText(text));
    }
    EXPECT_LT(rope.size(), expected.size() / 8'000);
    EXPECT_EQ(sentText(waiting, rope), expected);
}

/// Trees of ropes, as of nodes in nodes, of several times what stays in memory.
TEST(Waiting, MuchOfItIsInAFileMeanwhile) {
    Waiting waiting(onLines());
    std::mt19937 random(7);
    std::string expected;
    Rope all;
    while (expected.size() < (std::size_t{100} << 20)) {
        Rope part;
        for (int i = 0; i < 20; ++i) {
            if (random() % 4 == 0) {
                waiting.add(part, listOf(static_cast<std::int32_t>(5'000 + random() % 25'000), expected));
            } else {
                const std::string text(random() % 40'000, static_cast<char>('a' + i));
                expected += text;
                waiting.add(part, WaitingText(text));
            }
        }
        waiting.add(all, std::move(part));
    }
    EXPECT_LT(heldBy(all), std::size_t{20} << 20);
    EXPECT_GT(heldBy(all), std::size_t{12} << 20);
    EXPECT_TRUE(sentText(waiting, all) == expected);
    // And once more, with nothing left of the first time.
    waiting.clear();
    Rope again;
    std::string little;
    waiting.add(again, listOf(10'000, little));
    EXPECT_GT(heldBy(again), 40'000u);
    EXPECT_EQ(sentText(waiting, again), little);
}

TEST(Waiting, TheLongestListStaysAsItIs) {
    Waiting waiting(onLines());
    std::string expected;
    Rope rope;
    waiting.add(rope, listOf(10'000'000, expected));
    EXPECT_GT(heldBy(rope), 40'000'000u);
    waiting.add(rope, listOf(5'000, expected));
    EXPECT_GT(heldBy(rope), 40'020'000u);
    EXPECT_TRUE(sentText(waiting, rope) == expected);
}

}  // namespace
}  // namespace rtsg
