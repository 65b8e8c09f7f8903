// What the program that joins tiles asks of mirrors, as mirrors of bare messages see it: who draws what, what becomes
// of tiles that are late, lost or of another state, and that nothing is asked for while nothing changes.
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/socket_line.h"

namespace rtsg::test {

using testing::AnyOf;
using testing::StartsWith;

/// A mirror of pictures of 48 x 16 pixels, ten a second, of which the test says what it does.
class BareMirror {
  public:
    explicit BareMirror(int port) : line_(port) { line_.say("hello 1 48 16 10 looks\n"); }
    void have(int picture, int since, const std::string& state = {}) {
        line_.say(fmt::format("have {} {} {}\n", picture, since, state));
    }
    void gone(int picture, int column) { line_.say(fmt::format("gone {} {} 0\n", picture, column)); }
    void draw(int picture, int column, const std::string& hash = "aa", int state = 7) {
        constexpr int kBytes = 4 * 16 * 16;
        line_.say(fmt::format("tile {} {} 0 {} {} 0.5 {}\n", picture, column, state, hash, kBytes) +
                  std::string(kBytes, 'x'));
    }
    /// The next line that it is told; empty: none comes within a while.
    std::string nextLine(std::chrono::milliseconds patience = std::chrono::seconds(60)) {
        const auto end = std::chrono::steady_clock::now() + patience;
        while (line_.heard.find('\n') == std::string::npos)
            if (std::chrono::steady_clock::now() > end || !line_.more(std::chrono::milliseconds(10))) return {};
        const std::size_t length = line_.heard.find('\n');
        const std::string line = line_.heard.substr(0, length);
        line_.heard.erase(0, length + 1);
        return line;
    }
    bool hearsNothing() { return nextLine(std::chrono::milliseconds(300)).empty(); }

  private:
    Line line_;
};

class TileProtocol : public CommandLine {
  protected:
    void SetUp() override {
        assembler = std::make_unique<Program>(
            std::vector<std::string>{"assemble", "--live", "tcp://127.0.0.1:0", "--tiles", "3,1", "--json"}, streams());
        const std::string line = assembler->firstLine();
        ASSERT_NE(line, "");
        const std::string door = nlohmann::json::parse(line).at("endpoint");
        port = std::stoi(door.substr(door.rfind(':') + 1));
    }
    /// The mirrors have gone.
    nlohmann::json report() const {
        const Outcome joined = assembler->wait();
        EXPECT_EQ(joined.status, 0) << joined.err;
        return nlohmann::json::parse(lastLine(joined.out));
    }
    /// It is asked for all of a picture, and draws it.
    static void expectWhole(BareMirror& mirror, int picture) {
        for (int column = 0; column < 3; ++column) {
            ASSERT_EQ(mirror.nextLine(), fmt::format("draw {} {} 0 3 1", picture, column));
            mirror.draw(picture, column);
        }
    }

    std::unique_ptr<Program> assembler;
    int port = 0;
};

TEST_F(TileProtocol, AMirrorOwesTwoTilesAndForEachGetsTheNext) {
    {
        BareMirror one(port);
        one.have(5, 6);
        EXPECT_EQ(one.nextLine(), "draw 5 0 0 3 1");
        EXPECT_EQ(one.nextLine(), "draw 5 1 0 3 1");
        EXPECT_TRUE(one.hearsNothing()) << "while one is drawn the other is on its way";
        one.have(7, 8);
        EXPECT_TRUE(one.hearsNothing());
        one.draw(5, 1);
        EXPECT_EQ(one.nextLine(), "draw 5 2 0 3 1");
        one.draw(5, 0);
        EXPECT_EQ(one.nextLine(), "draw 7 0 0 3 1") << "the next picture begins when all of this one is asked for";
        EXPECT_TRUE(one.hearsNothing());
        one.draw(5, 2);
        EXPECT_EQ(one.nextLine(), "draw 7 1 0 3 1");
    }
    const nlohmann::json counts = report();
    EXPECT_EQ(counts.at("pictures"), 1) << counts;
    EXPECT_EQ(counts.at("states"), nlohmann::json::array({7})) << counts;
    EXPECT_EQ(counts.at("tiles"), 3) << counts;
    EXPECT_EQ(counts.at("bytes"), 3 * 1024) << counts;
    EXPECT_GE(counts.at("delay_s"), .3) << counts;
    EXPECT_LT(counts.at("delay_s"), 60) << counts;
}

TEST_F(TileProtocol, ATileThatIsLateIsDrawnByAnother) {
    {
        BareMirror one(port), other(port);
        other.have(3, 4);
        EXPECT_TRUE(other.hearsNothing()) << "not all have the state";
        one.have(3, 4);
        EXPECT_THAT(one.nextLine(), StartsWith("draw 3"));
        EXPECT_THAT(other.nextLine(), StartsWith("draw 3"));
        // Of three tiles one of them has two. Whoever that is does nothing more.
        const std::string more = one.nextLine(std::chrono::milliseconds(300));
        BareMirror &lazy = more.empty() ? other : one, &busy = more.empty() ? one : other;
        const int left = &busy == &one ? 0 : 1;
        busy.draw(3, left);
        std::set<std::string> again{busy.nextLine(), busy.nextLine()};
        EXPECT_EQ(again.size(), 2u);
        EXPECT_FALSE(again.contains(fmt::format("draw 3 {} 0 3 1", left)));
        for (const int column : {0, 1, 2})
            if (column != left) busy.draw(3, column);
        while (!busy.nextLine(std::chrono::milliseconds(300)).empty());
        // A tile that comes too late changes nothing. On a loaded machine this mirror may have been asked for tiles
        // that were late, too, or the picture may still lack one, and this tile, of another state, is refused.
        lazy.draw(3, 1 - left, "bb");
        for (std::string line; !(line = lazy.nextLine(std::chrono::milliseconds(300))).empty();)
            EXPECT_THAT(line, AnyOf(StartsWith("draw 3"), StartsWith("refused a tile")));
    }
    const nlohmann::json counts = report();
    EXPECT_EQ(counts.at("pictures"), 1) << counts;
    EXPECT_GE(counts.at("again"), 2) << counts;
    EXPECT_EQ(counts.at("given_up"), 0) << counts;
}

TEST_F(TileProtocol, WhatNobodyHasIsGivenUpAndTheNextIsDrawn) {
    {
        BareMirror one(port);
        one.have(5, 6);
        EXPECT_EQ(one.nextLine(), "draw 5 0 0 3 1");
        EXPECT_EQ(one.nextLine(), "draw 5 1 0 3 1");
        one.have(8, 3);
        one.gone(5, 0);
        one.gone(5, 1);
        // All of them look alike since 3, but none has been drawn.
        expectWhole(one, 8);
        EXPECT_TRUE(one.hearsNothing());
    }
    const nlohmann::json counts = report();
    EXPECT_EQ(counts.at("pictures"), 1) << counts;
    EXPECT_EQ(counts.at("given_up"), 1) << counts;
}

TEST_F(TileProtocol, NothingIsAskedForWhileNothingChanges) {
    {
        BareMirror one(port);
        one.have(5, 6);
        expectWhole(one, 5);
        one.have(8, 6);
        EXPECT_EQ(one.nextLine(), "draw 8 0 0 3 1");
        EXPECT_EQ(one.nextLine(), "draw 8 1 0 3 1") << "it owes nothing any longer";
        for (const int column : {0, 1, 2}) one.draw(8, column);
        EXPECT_EQ(one.nextLine(), "draw 8 2 0 3 1");
        one.have(12, 6);
        one.have(20, 8);
        EXPECT_TRUE(one.hearsNothing()) << "picture 8 shows it";
        one.have(30, 9);
        expectWhole(one, 30);
        // The scene begins anew.
        one.have(2, 1);
        one.have(3, 1);
        expectWhole(one, 3);
        one.have(4, 1);
        EXPECT_TRUE(one.hearsNothing());
    }
    EXPECT_EQ(report().at("pictures"), 4);
}

/// Two servers have other states at one time. Of mirrors that contradict each other the later one goes, also where it
/// is the first to say what a picture shows.
TEST_F(TileProtocol, AMirrorOfAnotherSessionIsRefused) {
    for (const bool saysFirst : {false, true}) {
        if (saysFirst) SetUp();
        {
            BareMirror one(port);
            one.have(4, 5, "40 aa");
            expectWhole(one, 4);
            BareMirror other(port);
            if (saysFirst) other.have(6, 7, "61 cc");
            EXPECT_TRUE(one.hearsNothing());
            one.have(6, 7, "60 bb");
            if (!saysFirst) other.have(6, 7, "61 cc");
            EXPECT_EQ(other.nextLine(),
                      "refused a mirror of another session: picture 6 shows its state 61 cc, and state 60 bb "
                      "of the others");
            expectWhole(one, 6);
            BareMirror same(port);
            same.have(6, 7, "60 bb");
            EXPECT_TRUE(same.hearsNothing());
        }
        EXPECT_EQ(report().at("pictures"), 2);
    }
}

TEST_F(TileProtocol, ATileOfAnotherStateIsRefused) {
    for (const bool otherHash : {true, false}) {
        if (!otherHash) SetUp();
        {
            BareMirror one(port);
            one.have(4, 5);
            EXPECT_EQ(one.nextLine(), "draw 4 0 0 3 1");
            EXPECT_EQ(one.nextLine(), "draw 4 1 0 3 1");
            BareMirror other(port);
            other.have(4, 5);
            EXPECT_EQ(other.nextLine(), "draw 4 2 0 3 1");
            one.draw(4, 0);
            EXPECT_TRUE(one.hearsNothing());
            other.draw(4, 2, otherHash ? "bb" : "aa", otherHash ? 7 : 8);
            EXPECT_THAT(other.nextLine(), StartsWith("refused a tile of state"));
            EXPECT_EQ(one.nextLine(), "draw 4 2 0 3 1");
            one.draw(4, 1);
            one.draw(4, 2);
            EXPECT_TRUE(other.hearsNothing());
        }
        const Outcome joined = assembler->wait();
        EXPECT_EQ(joined.status, 0);
        EXPECT_THAT(joined.err, testing::HasSubstr(otherHash ? "state 7 bb" : "state 8 aa"));
        EXPECT_EQ(nlohmann::json::parse(lastLine(joined.out)).at("pictures"), 1);
    }
}

}  // namespace rtsg::test
