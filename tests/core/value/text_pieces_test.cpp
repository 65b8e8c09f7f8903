// Texts that several threads look at in pieces: what one thread finds, wherever it is, and no further.
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "text/text_pieces.h"
#include "text/utf8.h"

namespace rtsg {
namespace {

using detail::PieceWalk;
using detail::Splitting;
using detail::TextPiece;

constexpr Splitting kSmallPieces{.threads = 3, .from = 1000, .piece = 50};

const char* anywhere(const char*, const char* maximum) {
    return maximum;
}

/// Where a walk over the text stops that looks for `wanted`.
std::size_t walkTo(const std::string& text, char wanted) {
    const char* p = text.data();
    const char* const end = p + text.size();
    PieceWalk walk(p, kSmallPieces, &anywhere, [wanted](TextPiece& piece) {
        while (piece.stop != piece.end && *piece.stop != wanted) ++piece.stop;
    });
    for (walk.add(end); walk.next(p); walk.add(end)) {
    }
    return static_cast<std::size_t>(p - text.data());
}

TEST(PieceWalk, StopsAtTheFirstOfSeveralPlaces) {
    for (const std::size_t at : {0u, 1u, 199u, 200u, 201u, 4321u, 9999u}) {
        std::string text(10'000, '.');
        for (std::size_t i = at; i < text.size(); i += 777) text[i] = 'x';
        EXPECT_EQ(walkTo(text, 'x'), at);
    }
}

TEST(PieceWalk, LeavesTheRestThatMakesNoPiece) {
    EXPECT_EQ(walkTo(std::string(10'050, '.'), 'x'), 10'000u);
    EXPECT_EQ(walkTo(std::string(199, '.'), 'x'), 0u);
}

TEST(PieceWalk, TakesNoPieceWhereNoneCanBeCut) {
    const std::string text(10'000, '.');
    const char* p = text.data();
    PieceWalk walk(
        p, kSmallPieces, [](const char* begin, const char*) { return begin; },
        [](TextPiece&) { FAIL() << "there is no piece"; });
    EXPECT_FALSE(walk.add(text.data() + text.size()));
    EXPECT_FALSE(walk.next(p));
    EXPECT_EQ(p, text.data());
}

TEST(Utf8InPieces, IsWhatOneThreadFinds) {
    std::mt19937 random(20261121);
    static constexpr const char* good[] = {"a", "7", "\xC3\xA4", "\xE2\x82\xAC", "\xF0\x9F\x98\x80"};
    static constexpr const char* bad[] = {"\xC3", "\xE2\x82", "\xF0\x9F\x98", "\x80", "\xED\xA0\x80", "\xFF"};
    for (int round = 0; round < 300; ++round) {
        std::string text;
        while (text.size() < 3000) text += good[random() % std::size(good)];
        for (int i = round % 3; i > 0; --i) {
            const std::size_t at = random() % text.size();
            text.insert(at, i == 2 ? std::string(1, '\0') : bad[random() % std::size(bad)]);
        }
        EXPECT_EQ(detail::findInvalidUtf8(text, kSmallPieces), detail::findInvalidUtf8(text)) << round;
    }
}

}  // namespace
}  // namespace rtsg
