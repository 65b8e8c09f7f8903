// A log played in time: every state once, at its time; paused, stepped, sought, looped; and what is not understood.
#include <rtsg/sync/log_player.h>

#include <cmath>

#include <gtest/gtest.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

/// Notes the states that a subscriber sees.
struct States : Subscriber {
    std::vector<std::uint64_t> seen;
    Result<> apply(const Scene&, const ChangeSet& set) override {
        seen.push_back(set.to);
        return {};
    }
};

class LogPlayers : public LogFolder {
  protected:
    /// Thirty frames, a tenth of a second apart: states 1 to 30, 2.9 s long.
    void SetUp() override {
        recorded = record(file(), 30, 7, denseKeyframes());
        auto opened = LogPlayer::open(file());
        ASSERT_TRUE(opened) << opened.error().format();
        player = std::move(*opened);
    }
    void expectRecorded() const {
        const std::uint64_t state = player->scene().sequence();
        EXPECT_EQ(player->scene().dump(), recorded.dumps.at(state)) << "state " << state;
    }

    Recorded recorded;
    std::unique_ptr<LogPlayer> player;
};

TEST_F(LogPlayers, EveryStateComesAtItsTime) {
    EXPECT_NEAR(player->length(), 2.9, 1e-9);
    EXPECT_EQ(player->time(), 0);
    States states;
    const Attachment attachment = player->scene().bus().attach(states);
    states.seen.clear();
    const std::uint64_t first = player->scene().sequence();
    for (int i = 1; i <= 100; ++i) {
        ASSERT_TRUE(player->advance(.03));
        const double t = player->scene().now(), expected = std::min(i * .03, 2.9);
        EXPECT_LE(t, expected + 1e-9);
        EXPECT_GT(t, expected - .1 - 1e-9);
        expectRecorded();
    }
    ASSERT_EQ(states.seen.size(), recorded.last - first);
    for (std::size_t i = 0; i < states.seen.size(); ++i) EXPECT_EQ(states.seen[i], first + 1 + i);
    EXPECT_TRUE(player->ended());
    EXPECT_EQ(player->time(), player->length());
}

TEST_F(LogPlayers, ItSaysWhenTheNextStateIsDue) {
    EXPECT_NEAR(player->dueIn(), .1, 1e-9);
    ASSERT_TRUE(player->advance(.03));
    EXPECT_NEAR(player->dueIn(), .07, 1e-9);
    ASSERT_TRUE(player->advance(player->dueIn() + 1e-9));
    EXPECT_NEAR(player->scene().now(), .1, 1e-9);
    player->setRate(4);
    ASSERT_TRUE(player->seek(.55));
    EXPECT_NEAR(player->dueIn(), .05 / 4, 1e-9);
    player->pause(true);
    EXPECT_TRUE(std::isinf(player->dueIn()));
    player->pause(false);
    ASSERT_TRUE(player->advance(1));
    EXPECT_TRUE(player->ended());
    EXPECT_TRUE(std::isinf(player->dueIn()));
    player->setLoop(true);
    EXPECT_EQ(player->dueIn(), 0);
}

TEST_F(LogPlayers, ItDoesWhatItIsTold) {
    const auto reported = [&](std::string_view text) {
        const auto status = player->command(text);
        EXPECT_TRUE(status) << text << ": " << status.error().text;
        expectRecorded();
    };
    reported("rate 4");
    ASSERT_TRUE(player->advance(.25));
    EXPECT_NEAR(player->scene().now(), 1, 1e-9);
    reported("pause");
    ASSERT_TRUE(player->advance(10));
    EXPECT_NEAR(player->scene().now(), 1, 1e-9);
    reported("step");
    EXPECT_NEAR(player->scene().now(), 1.1, 1e-9);
    reported("step 5");
    EXPECT_NEAR(player->scene().now(), 1.6, 1e-9);
    reported("seek 0.55s");
    EXPECT_NEAR(player->scene().now(), .5, 1e-9);
    reported("seek 2.5");
    EXPECT_NEAR(player->scene().now(), 2.5, 1e-9);
    reported("seek 1000");
    EXPECT_NEAR(player->scene().now(), 2.9, 1e-9);
    reported("play");
    reported("rate 1");
    ASSERT_TRUE(player->advance(1));
    EXPECT_TRUE(player->ended());
    reported("loop on");
    EXPECT_FALSE(player->ended());
    ASSERT_TRUE(player->advance(.35));
    EXPECT_NEAR(player->scene().now(), .3, 1e-9);
    expectRecorded();
    EXPECT_EQ(*player->command("status"),
              "{\"t\":0.350000,\"length\":2.900000,\"state\":4,\"paused\":false,\"rate\":1,\"loop\":true}");
}

/// Like a mirror's log of a log that is played in a loop: 2.9 s, and another 1.9 s whose times begin at 0 again.
TEST_F(LogPlayers, SessionsThatBeginEarlierAreAllPlayed) {
    const Recorded later = record(file("later.rlog"), 20, 9);
    writeAll(file("both.rlog"), readAll(file()) + readAll(file("later.rlog")));
    auto opened = LogPlayer::open(file("both.rlog"));
    ASSERT_TRUE(opened) << opened.error().format();
    LogPlayer& both = **opened;
    EXPECT_NEAR(both.length(), 2.9 + 1.9, 1e-9);
    const auto expectState = [&](const Recorded& session, double time) {
        const std::uint64_t state = both.scene().sequence();
        EXPECT_NEAR(both.scene().now(), time, 1e-9);
        EXPECT_EQ(both.scene().dump(), session.dumps.at(state)) << "state " << state;
    };
    expectState(recorded, 0);
    States states;
    const Attachment attachment = both.scene().bus().attach(states);
    states.seen.clear();
    std::vector<std::uint64_t> expected;
    for (std::uint64_t state = 2; state <= recorded.last; ++state) expected.push_back(state);
    for (std::uint64_t state = 1; state <= later.last; ++state) expected.push_back(state);
    for (int i = 0; i < 31; ++i) ASSERT_TRUE(both.advance(.05));
    expectState(recorded, 1.5);
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(both.advance(.05));
    expectState(later, .6);
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(both.advance(.05));
    EXPECT_TRUE(both.ended());
    std::erase(states.seen, 0u);  // a log begins with the empty scene
    EXPECT_EQ(states.seen, expected);
    ASSERT_TRUE(both.seek(1.05));
    expectState(recorded, 1);
    ASSERT_TRUE(both.seek(3.45));
    expectState(later, .5);
    ASSERT_TRUE(both.step(1));
    expectState(later, .6);
    EXPECT_NEAR(both.time(), 2.9 + .6, 1e-9);
    ASSERT_TRUE(both.seek(.2));
    expectState(recorded, .2);
    ASSERT_TRUE(both.seek(5));
    expectState(later, 1.9);
}

TEST_F(LogPlayers, WhatIsNotUnderstoodChangesNothing) {
    const std::string before = *player->command("status");
    for (const char* text :
         {"", "stop", "rate", "rate 0", "rate -1", "rate nan", "rate 1e9", "seek", "seek -1", "seek x", "seek inf",
          "step 0", "step -1", "step 1e9", "loop", "loop maybe", "pause now", "status 1", " pause"}) {
        EXPECT_FALSE(player->command(text)) << text;
        EXPECT_EQ(*player->command("status"), before) << text;
    }
}

TEST_F(LogPlayers, NoLogNoPlayer) {
    EXPECT_FALSE(LogPlayer::open(file("none.rlog")));
    writeAll(file("bad.rlog"), "no log at all");
    EXPECT_FALSE(LogPlayer::open(file("bad.rlog")));
}

}  // namespace
}  // namespace rtsg
