// The pace of what goes to a peer, on links that are computed: what arrives is never older than was asked for, and the
// link is used.
#include <deque>
#include <random>

#include <gtest/gtest.h>

#include "mirror/pace.h"

namespace rtsg {
namespace {

using Clock = MirrorPace::Clock;

struct Link {
    double rate = 0;      // bytes a second
    double delay = 0;     // s, one way
    double poll = .001;   // s between two looks of the receiver
    double stall = 0;     // s that the link stands still, each second: what lost packets do to TCP
    double frame = 13e3;  // bytes of a frame of the scene, and of any number of them merged
    double lag = .25;     // asked for
    double most = 0;
    double seconds = 20;
    double delayLater = 0;  // of the second half, if it is another
};

struct Seen {
    double mostAge = 0;       // of frames in the last three quarters of the time, when they were there as a whole, s
    double bytesASecond = 0;  // in the same time
    std::size_t frames = 0, merged = 0;
};

/// A scene of 60 frames a second, a sender that asks the pace, a link with a queue without end, and a receiver.
Seen followLink(const Link& link) {
    constexpr double kStep = 1e-4;
    struct Chunk {
        double arrives, published;
        std::uint64_t total;
        bool last;
    };
    MirrorPace pace(link.lag, link.most);
    Seen seen;
    std::deque<double> waiting;                         // when frames that wait were published
    std::deque<Chunk> way;                              // in order
    std::deque<std::pair<double, std::uint64_t>> acks;  // when they are back
    double linkFree = 0, nextFrame = 0, nextPoll = 0, sending = -1, left = 0, received = 0;
    std::uint64_t sent = 0, arrived = 0;
    for (double now = 0; now < link.seconds; now += kStep) {
        const auto time = Clock::time_point(std::chrono::duration_cast<Clock::duration>(MirrorPace::Seconds(now + 1)));
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
                pace.held();
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
            left -= part;
            sent += std::uint64_t(part);
            pace.sent(sent, time);
            linkFree = std::max(linkFree, now);
            if (link.stall > 0 && std::fmod(linkFree, 1.) < link.stall) linkFree = std::floor(linkFree) + link.stall;
            linkFree += part / link.rate;
            way.push_back({linkFree + delay, sending, sent, left < 1});
        }
        if (now < nextPoll) continue;
        nextPoll = now + link.poll;
        bool any = false;
        for (; !way.empty() && way.front().arrives <= now; way.pop_front()) {
            any = true;
            if (measured) received += double(way.front().total - arrived);
            arrived = way.front().total;
            if (!way.front().last) continue;
            ++seen.frames;
            if (measured) seen.mostAge = std::max(seen.mostAge, now - way.front().published);
        }
        if (any) acks.emplace_back(now + delay, arrived);
    }
    seen.bytesASecond = received / (.75 * link.seconds);
    return seen;
}

TEST(MirrorPace, OnASlowLinkFramesComeMergedAndInTime) {
    // 1 Mbit/s and 4 Mbit/s for what makes 6 Mbit/s, near and far.
    for (const double rate : {125e3, 500e3})
        for (const double delay : {.001, .02, .1}) {
            SCOPED_TRACE(testing::Message() << rate << " bytes/s, " << delay << " s");
            const Link link{.rate = rate, .delay = delay};
            const Seen seen = followLink(link);
            EXPECT_LE(seen.mostAge, .25 + 2 * delay + link.frame / rate);
            EXPECT_GE(seen.bytesASecond, .75 * rate) << "the link is used";
            EXPECT_GT(seen.merged, 0u);
        }
}

TEST(MirrorPace, AtTheEndOfATelephoneLineAFrameTakesAsLongAsItTakes) {
    const Link link{.rate = 8e3, .delay = .05, .seconds = 60};
    const Seen seen = followLink(link);
    const double own = link.frame / link.rate;
    EXPECT_LE(seen.mostAge, .25 + own + 2 * link.delay);
    EXPECT_GE(seen.bytesASecond, .75 * link.rate);
}

TEST(MirrorPace, ALinkThatStumblesDoesNotPileUpWhatIsOld) {
    const Link link{.rate = 125e3, .delay = .02, .stall = .2};
    const Seen seen = followLink(link);
    // A chunk may stand still on the way, and before it the frame that it is of.
    EXPECT_LE(seen.mostAge, .25 + 2 * link.delay + link.frame / link.rate + 2 * link.stall);
    EXPECT_GE(seen.bytesASecond, .5 * link.rate);
}

TEST(MirrorPace, AWayThatGrowsLongerIsLearned) {
    const Link link{.rate = 125e3, .delay = .005, .seconds = 60, .delayLater = .2};
    const Seen seen = followLink(link);
    EXPECT_LE(seen.mostAge, .25 + 2 * .2 + .1);
    EXPECT_GE(seen.bytesASecond, .6 * link.rate);
}

TEST(MirrorPace, OnAFastLinkEveryFrameComesAtOnce) {
    for (const double poll : {.0005, .016, .1}) {
        const Link link{.rate = 500e6, .delay = 1e-4, .poll = poll};
        const Seen seen = followLink(link);
        EXPECT_EQ(seen.merged, 0u) << poll;
        EXPECT_GE(seen.frames, 60 * link.seconds - 40) << "all but some at the start";
        EXPECT_LE(seen.mostAge, poll + .02) << poll;
    }
}

TEST(MirrorPace, AReceiverThatSeldomLooksGetsAllThatFitsEachTime) {
    const Link link{.rate = 500e6, .delay = 1e-4, .poll = .3, .seconds = 40};
    const Seen seen = followLink(link);
    EXPECT_GE(double(seen.frames), .8 * link.seconds / link.poll) << "one at least each time";
    EXPECT_LE(seen.mostAge, 2 * link.poll + .25);
}

TEST(MirrorPace, ALimitOfTheRateIsKept) {
    const Link link{.rate = 500e6, .delay = .001, .most = 100e3};
    const Seen seen = followLink(link);
    EXPECT_LE(seen.bytesASecond, 105e3);
    EXPECT_GE(seen.bytesASecond, 80e3);
    EXPECT_LE(seen.mostAge, .25 + 13e3 / 100e3);
}

TEST(MirrorPace, WithoutALagNothingIsHeldBack) {
    const Link link{.rate = 125e3, .lag = 0, .seconds = 5};
    const Seen seen = followLink(link);
    EXPECT_EQ(seen.merged, 0u);
    EXPECT_GT(seen.mostAge, 2.) << "this is what the lag is for";
}

/// A sender that leaves sends the last things whatever is under way; no more of them than a link takes in a second.
TEST(MirrorPace, LeavingLiftsTheLimitForWhatIsLeft) {
    for (const double rate : {0.0, 1e3, 1e5, 1e7}) {
        MirrorPace pace(.25, 0);
        auto now = Clock::time_point(std::chrono::seconds(1));
        std::uint64_t sent = 0;
        const auto send = [&] {
            sent += 1000;
            pace.sent(sent, now);
        };
        for (int i = 0; i < 20 && rate > 0; ++i) {
            send();
            now += std::chrono::duration_cast<Clock::duration>(MirrorPace::Seconds(1000 / rate));
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
