// The pace of what goes to a peer, on links that are computed: what arrives is never older than was asked for, and the
// link is used.
#include <chrono>
#include <deque>
#include <random>
#include <utility>

#include <gtest/gtest.h>

#include "sockets/pace.h"

namespace rtsg {
namespace {

using Steady = std::chrono::steady_clock;

struct Link {
    double rate = 0;      // bytes a second
    double delay = 0;     // s, one way
    double poll = .001;   // s between two looks of the receiver
    double stall = 0;     // s that the link stands still, each second: what lost packets do to TCP
    double frame = 13e3;  // bytes of a frame of the scene, and of any number of them merged
    double lag = .25;     // asked for
    double maximum = 0;
    double seconds = 20;
    double delayLater = 0;  // of the second half, if it is another
    bool keeps = false;     // the receiver keeps acknowledgements that can wait
};

struct Seen {
    double maxAge = 0;        // of frames in the last three quarters of the time, when they were there as a whole, s
    double bytesASecond = 0;  // in the same time
    std::size_t frames = 0, merged = 0, acknowledgements = 0;
    double delay = 0;  // in the end, as the sender knows it, there and back
};

/// A scene of 60 frames a second, a sender that asks the pace, a link with a queue without end, and a receiver.
Seen followLink(const Link& link) {
    constexpr double kStep = 1e-4;
    struct Chunk {
        double arrives, published;
        std::uint64_t total;
        bool last, awaited;
    };
    MirrorPace pace(link.lag, link.maximum);
    Seen seen;
    std::deque<double> waiting;                         // when frames that wait were published
    std::deque<Chunk> inFlight;                         // in order
    std::deque<std::pair<double, std::uint64_t>> acks;  // when they are back
    double linkFree = 0, nextFrame = 0, nextPoll = 0, sending = -1, left = 0, received = 0, awaitedAt = -1;
    std::uint64_t sent = 0, arrived = 0, awaitedTo = 0;
    bool awaited = false;
    for (double now = 0; now < link.seconds; now += kStep) {
        const auto time =
            Steady::time_point(std::chrono::duration_cast<Steady::duration>(MirrorPace::Seconds(now + 1)));
        const bool measured = now > link.seconds / 4;
        const double delay = link.delayLater > 0 && now > link.seconds / 2 ? link.delayLater : link.delay;
        if (now >= nextFrame) {
            waiting.push_back(nextFrame);
            nextFrame += 1 / 60.;
        }
        while (!acks.empty() && acks.front().first <= now) {
            pace.acknowledged(acks.front().second, time);
            acks.pop_front();
        }
        while (true) {
            if (left <= 0 && waiting.empty()) break;
            if (!pace.open(left > 0 ? std::uint64_t(link.frame) : 0, time)) {
                pace.held(time);
                // Like a server's ping that asks for an acknowledgement.
                if (awaitedTo != sent)
                    inFlight.push_back({std::max(linkFree, now) + delay, 0, awaitedTo = sent, false, true});
                break;
            }
            if (left <= 0) {
                if (pace.late(std::uint64_t(double(waiting.size()) * link.frame))) {
                    if (waiting.size() > 1 && measured) ++seen.merged;
                    waiting.erase(waiting.begin(), waiting.end() - 1);
                }
                sending = waiting.front();
                waiting.pop_front();
                left = link.frame;
            }
            const double part = std::min(left, double(pace.chunk(256 << 10, time)));
            const bool later = link.keeps && part == link.frame && now - awaitedAt < .5 &&
                               pace.spare(static_cast<std::uint64_t>(part), time);
            left -= part;
            sent += std::uint64_t(part);
            pace.sent(sent, time, !later);
            if (!later) awaitedAt = now, awaitedTo = sent;
            linkFree = std::max(linkFree, now);
            if (link.stall > 0 && std::fmod(linkFree, 1.) < link.stall) linkFree = std::floor(linkFree) + link.stall;
            linkFree += part / link.rate;
            inFlight.push_back({linkFree + delay, sending, sent, left < 1, !later});
        }
        if (now < nextPoll) continue;
        nextPoll = now + link.poll;
        for (; !inFlight.empty() && inFlight.front().arrives <= now; inFlight.pop_front()) {
            awaited = awaited || inFlight.front().awaited;
            if (measured) received += double(inFlight.front().total - arrived);
            arrived = inFlight.front().total;
            if (!inFlight.front().last) continue;
            ++seen.frames;
            if (measured) seen.maxAge = std::max(seen.maxAge, now - inFlight.front().published);
        }
        if (!std::exchange(awaited, false)) continue;
        acks.emplace_back(now + delay, arrived);
        if (measured) ++seen.acknowledgements;
    }
    seen.bytesASecond = received / (.75 * link.seconds);
    seen.delay = pace.delay();
    return seen;
}

TEST(MirrorPace, OnASlowLinkFramesComeMergedAndInTime) {
    // 1 Mbit/s and 4 Mbit/s for what makes 6 Mbit/s, near and far.
    for (const auto& [rate, keeps] : {std::pair(125e3, false), {125e3, true}, {500e3, false}, {500e3, true}})
        for (const double delay : {.001, .02, .1}) {
            SCOPED_TRACE(testing::Message() << rate << " bytes/s, " << delay << " s, keeps " << keeps);
            const Link link{.rate = rate, .delay = delay, .keeps = keeps};
            const Seen seen = followLink(link);
            EXPECT_LE(seen.maxAge, .25 + 2 * delay + link.frame / rate);
            EXPECT_GE(seen.bytesASecond, .75 * rate) << "the link is used";
            EXPECT_GT(seen.merged, 0u);
        }
}

TEST(MirrorPace, AtTheEndOfATelephoneLineAFrameTakesAsLongAsItTakes) {
    for (const bool keeps : {false, true}) {
        const Link link{.rate = 8e3, .delay = .05, .seconds = 60, .keeps = keeps};
        const Seen seen = followLink(link);
        const double own = link.frame / link.rate;
        EXPECT_LE(seen.maxAge, .25 + own + 2 * link.delay);
        EXPECT_GE(seen.bytesASecond, .75 * link.rate);
    }
}

/// The first part is measured while the rate is unknown, and its own time is most of what it takes.
TEST(MirrorPace, TheFirstDelayIsMeasuredAgainWhenTheRateIsKnown) {
    for (const auto& [rate, delay] : {std::pair(32e3, .005), {32e3, .02}, {64e3, .005}, {125e3, .001}})
        for (const bool keeps : {false, true}) {
            const Link link{.rate = rate, .delay = delay, .seconds = 3, .keeps = keeps};
            const Seen seen = followLink(link);
            EXPECT_GE(seen.delay, 2 * delay) << rate << " bytes/s";
            EXPECT_LE(seen.delay, 2 * delay + .003) << rate << " bytes/s, whose first part took " << 2048 / rate;
        }
}

TEST(MirrorPace, AnAcknowledgementThatComesAgainTellsNothing) {
    MirrorPace once(.25, 0), again(.25, 0);
    auto now = Steady::time_point(std::chrono::seconds(1));
    std::uint64_t sent = 0, before = 0;
    for (int i = 0; i < 200; ++i) {  // two parts are under way
        for (MirrorPace* pace : {&once, &again}) pace->sent(sent + 1000, now);
        now += std::chrono::milliseconds(4);
        for (MirrorPace* pace : {&once, &again}) pace->acknowledged(before, now);
        now += std::chrono::milliseconds(3);
        again.acknowledged(before, now);
        before = sent += 1000;
        now += std::chrono::milliseconds(1);
    }
    EXPECT_GT(once.rate(), 0);
    EXPECT_EQ(again.rate(), once.rate());
    EXPECT_EQ(again.delay(), once.delay());
}

/// 64 and 32 kbit/s for a scene that makes 9.5 kB/s, of small frames that merge to hardly more.
TEST(MirrorPace, SmallFramesDoNotPileUpOnATelephoneLine) {
    for (const auto& [rate, keeps] : {std::pair(8e3, false), {8e3, true}, {4e3, false}, {4e3, true}}) {
        const Link link{.rate = rate, .delay = .02, .frame = 160, .seconds = 40, .keeps = keeps};
        const Seen seen = followLink(link);
        EXPECT_LE(seen.maxAge, .25 + 2 * link.delay + link.frame / rate) << rate << keeps;
        EXPECT_GE(seen.bytesASecond, .7 * rate) << rate << keeps;
    }
}

TEST(MirrorPace, ALinkThatStumblesDoesNotPileUpWhatIsOld) {
    for (const bool keeps : {false, true}) {
        const Link link{.rate = 125e3, .delay = .02, .stall = .2, .keeps = keeps};
        const Seen seen = followLink(link);
        // A chunk may stand still on the way, and before it the frame that it is of.
        EXPECT_LE(seen.maxAge, .25 + 2 * link.delay + link.frame / link.rate + 2 * link.stall);
        EXPECT_GE(seen.bytesASecond, .5 * link.rate);
    }
}

TEST(MirrorPace, AWayThatGrowsLongerIsLearned) {
    for (const bool keeps : {false, true}) {
        const Link link{.rate = 125e3, .delay = .005, .seconds = 60, .delayLater = .2, .keeps = keeps};
        const Seen seen = followLink(link);
        EXPECT_LE(seen.maxAge, .25 + 2 * .2 + .1);
        EXPECT_GE(seen.bytesASecond, .6 * link.rate);
    }
}

TEST(MirrorPace, OnAFastLinkEveryFrameComesAtOnce) {
    for (const auto& [poll, keeps] :
         {std::pair(.0005, false), {.0005, true}, {.016, false}, {.016, true}, {.1, false}, {.1, true}}) {
        const Link link{.rate = 500e6, .delay = 1e-4, .poll = poll, .keeps = keeps};
        const Seen seen = followLink(link);
        EXPECT_EQ(seen.merged, 0u) << poll;
        EXPECT_GE(seen.frames, 60 * link.seconds - 40) << "all but some at the start";
        EXPECT_LE(seen.maxAge, poll + .02) << poll;
    }
}

TEST(MirrorPace, OnAFastLinkOneAcknowledgementDoesForManyFrames) {
    for (const double frame : {500., 13e3}) {
        const Link link{.rate = 100e6, .delay = .001, .frame = frame, .keeps = true};
        const Seen seen = followLink(link);
        EXPECT_EQ(seen.merged, 0u);
        EXPECT_LE(seen.maxAge, .02);
        EXPECT_GE(seen.frames, 60 * link.seconds - 40);
        EXPECT_LE(double(seen.acknowledgements), .75 * double(seen.frames) / 16) << "two a second and few more";
    }
}

TEST(MirrorPace, ALinkThatCollapsesIsNotedThoughAcknowledgementsWait) {
    // From 100 Mbit/s to 1 Mbit/s in between two of them.
    MirrorPace pace(.25, 0);
    auto now = Steady::time_point(std::chrono::seconds(1));
    std::uint64_t sent = 0;
    for (int i = 0; i < 100; ++i) {  // 13 kB within 2 ms
        while (pace.open(13000, now)) {
            const std::uint64_t part = std::min<std::uint64_t>(13000 - sent % 13000, pace.chunk(1 << 18, now));
            pace.sent(sent += part, now);
            if (sent % 13000 == 0) break;
        }
        now += std::chrono::milliseconds(2);
        pace.acknowledged(sent, now);
        now += std::chrono::milliseconds(14);
    }
    const std::uint64_t before = sent;
    for (int i = 0; i < 600; ++i, now += std::chrono::milliseconds(16)) {  // nothing comes back
        if (!pace.open(13000, now)) continue;
        const bool later = pace.spare(13000, now);
        pace.sent(sent += 13000, now, !later);
    }
    EXPECT_GT(sent - before, 26000u) << "what was kept held nothing back";
    EXPECT_LE(double(sent - before), pace.rate() * (.125 + 1.25 * (pace.delay() + .25 / 8)) + 2 * 13000)
        << "half of the lag without acknowledgement, and what may be under way in any case";
}

/// One of a thousand receivers on one machine: its frame is there after 35 ms, and the next one comes in 70 ms.
TEST(MirrorPace, InACrowdWhereFramesTakeLongTwoAcknowledgementsASecondDo) {
    MirrorPace pace(.25, 0);
    auto now = Steady::time_point(std::chrono::seconds(1));
    std::uint64_t sent = 0, asked = 0;
    for (int i = 0; i < 170; ++i) {
        bool awaited = false;
        for (std::uint64_t left = 13000; left > 0;) {
            if (!pace.open(13000, now)) {  // while the way is not known, after each part
                now += std::chrono::milliseconds(35);
                pace.acknowledged(sent, now);
                ASSERT_TRUE(pace.open(13000, now)) << "frame " << i;
            }
            const std::uint64_t part = std::min(left, pace.chunk(1 << 18, now));
            const bool later = i >= 20 && part == 13000 && pace.spare(part, now);
            awaited = awaited || !later;
            pace.sent(sent += part, now, !later);
            left -= part;
        }
        now += std::chrono::milliseconds(35);
        if (awaited) pace.acknowledged(sent, now);
        if (i >= 70) asked += awaited;
        now += std::chrono::milliseconds(35);
    }
    EXPECT_LE(asked, 14u) << "of 100 frames, seven seconds";
    EXPECT_GE(asked, 12u) << "none waits for longer than half a second";
}

TEST(MirrorPace, AReceiverThatSeldomLooksGetsAllThatFitsEachTime) {
    const Link link{.rate = 500e6, .delay = 1e-4, .poll = .3, .seconds = 40};
    const Seen seen = followLink(link);
    EXPECT_GE(double(seen.frames), .8 * link.seconds / link.poll) << "one at least each time";
    EXPECT_LE(seen.maxAge, 2 * link.poll + .25);
}

TEST(MirrorPace, ALimitOfTheRateIsKept) {
    const Link link{.rate = 500e6, .delay = .001, .maximum = 100e3};
    const Seen seen = followLink(link);
    EXPECT_LE(seen.bytesASecond, 105e3);
    EXPECT_GE(seen.bytesASecond, 80e3);
    EXPECT_LE(seen.maxAge, .25 + 13e3 / 100e3);
}

TEST(MirrorPace, WithoutALagNothingIsHeldBack) {
    const Link link{.rate = 125e3, .lag = 0, .seconds = 5};
    const Seen seen = followLink(link);
    EXPECT_EQ(seen.merged, 0u);
    EXPECT_GT(seen.maxAge, 2.) << "this is what the lag is for";
}

TEST(MirrorPace, WithoutALagAcknowledgementsMayWait) {
    MirrorPace pace(0, 0);
    auto now = Steady::time_point(std::chrono::seconds(1));
    std::uint64_t sent = 0;
    for (int i = 0; i < 1000; ++i, now += std::chrono::milliseconds(16)) {
        ASSERT_TRUE(pace.open(13000, now)) << i;
        ASSERT_TRUE(pace.spare(13000, now)) << i;
        ASSERT_EQ(pace.chunk(1 << 18, now), 1u << 18) << i;
        pace.sent(sent += 13000, now, i % 30 == 0);
        if (i % 30 == 7) pace.acknowledged(sent - 7 * std::uint64_t{13000}, now);
    }
}

/// A sender that leaves sends the last things whatever is under way; no more of them than a link takes in a second.
TEST(MirrorPace, LeavingLiftsTheLimitForWhatIsLeft) {
    for (const double rate : {0.0, 1e3, 1e5, 1e7}) {
        MirrorPace pace(.25, 0);
        auto now = Steady::time_point(std::chrono::seconds(1));
        std::uint64_t sent = 0;
        const auto send = [&] {
            sent += 1000;
            pace.sent(sent, now);
        };
        for (int i = 0; i < 20 && rate > 0; ++i) {
            send();
            now += std::chrono::duration_cast<Steady::duration>(MirrorPace::Seconds(1000 / rate));
            pace.acknowledged(sent, now);
        }
        while (pace.open(1000, now)) send();
        ASSERT_FALSE(pace.open(1000, now)) << rate;
        pace.lift();
        EXPECT_TRUE(pace.late(1)) << rate << ": what is left comes merged";
        const std::uint64_t before = sent;
        while (pace.open(1000, now)) send();
        EXPECT_GE(sent - before, 16'000u) << rate;
        EXPECT_LE(sent - before, 67'000u) << rate;
    }
}

}  // namespace
}  // namespace rtsg
