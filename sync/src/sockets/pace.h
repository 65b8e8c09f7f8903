// MirrorPace: how much may be under way to a peer, so that what it gets is never older than it asked for.
//
// A window in bytes is too small for a fast link or too large for a slow one. So the pace is measured, as in congestion
// control by rate and delay (Cardwell et al., BBR, 2016; with other constants and a given bound of the delay). The rate
// is the greatest rate of acknowledged bytes in the last seconds in which there was more to send. The delay is the
// least since the link was last empty. Under way may be what the link carries in that delay and an eighth of the
// allowed lag, and at least one record. If nothing empties the link by itself, it is left to run empty every ten
// seconds.
// Invariant: without a lag and a rate nothing is limited.
// Threading: one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <limits>

namespace rtsg {

class MirrorPace {
  public:
    using Clock = std::chrono::steady_clock;
    using Seconds = std::chrono::duration<double>;

    /// `lag` in seconds and `most` in bytes a second; 0 for no limit.
    MirrorPace(double lag, double maximum) : lag_(lag), maximum_(maximum) {}
    MirrorPace() = default;

    /// Notes what was sent. `total`: all bytes so far, with these. `awaited`: the peer acknowledges them as soon as it
    /// has read them.
    void sent(std::uint64_t total, Clock::time_point now, bool awaited = true);
    /// Notes what was acknowledged; `total`: all bytes so far.
    void acknowledged(std::uint64_t total, Clock::time_point now);
    /// Notes that more is to be sent than may be. So the rate now shows what the link carries, not what the sender
    /// makes.
    void held(Clock::time_point now) {
        heldUpTo_ = sentTotal_;
        heldAt_ = now;
    }

    /// Call it when the sender leaves: nothing newer will come, so nothing needs to be held back for it.
    void lift() {
        lifted_ = true;
        liftedAt_ = sentTotal_;
        draining_ = false;
    }

    /// True if something may be sent now. `record` is the size of the record to which it belongs.
    bool open(std::uint64_t record, Clock::time_point now);
    /// True if so many more bytes may go without immediate acknowledgement. The link must be known, not full, and fast
    /// enough to carry all such bytes in half of the lag. They hold nothing back. Their number is bounded, and none
    /// waits longer than twice the lag, so that a link that has become slower is noticed in time.
    bool spare(std::uint64_t size, Clock::time_point now) const;
    /// The most to send at once.
    std::uint64_t chunk(std::uint64_t maximum, Clock::time_point now) const;
    /// True if so many waiting bytes would be too old on arrival. Then it is better to merge them.
    bool late(std::uint64_t waiting) const {
        return lag_ > 0 && (lifted_ || (rate() > 0 && double(waiting) > rate() * lag_ / 2));
    }
    /// The bytes that would not be late, as far as the rate is known.
    std::uint64_t inTime() const { return static_cast<std::uint64_t>(rate() * lag_ / 4); }
    /// The time until the limit of the rate lets something pass. 0 if nothing waits for that.
    Clock::duration wait(Clock::time_point now) const {
        return maximum_ > 0 && next_ > now ? next_ - now : Clock::duration{};
    }

    /// The measured rate in bytes a second, and the delay in seconds. 0 while unknown.
    double rate() const;
    double delay() const;

  private:
    struct Sent {
        std::uint64_t total = 0, acknowledgedThen = 0;
        Clock::time_point at, since;  // since: when the bytes acknowledged at `at` had been
        bool measures = false;        // nothing else was under way, so it measures the delay
        std::uint64_t spared = 0;     // bytes that are not acknowledged at once
    };
    /// The greatest or least value of the last two spans of time.
    struct Spans {
        double now = 0, before = 0;
        Clock::time_point began{};
    };
    double limit(std::uint64_t record) const;
    double inFlight(Clock::time_point now) const;
    double maxSpared() const;
    bool settled(Clock::time_point now) const;
    void learnDelay(const Sent& sent, std::uint64_t size, Clock::time_point now);
    void judgeFirstDelay();
    void learnRate(const Sent& sent, Clock::time_point now);

    double lag_ = 0, maximum_ = 0;
    std::uint64_t sentTotal_ = 0, acknowledgedTotal_ = 0, heldUpTo_ = 0, liftedAt_ = 0;
    std::uint64_t spared_ = 0;  // under way without immediate acknowledgement
    double inFlight_ = 0;       // bytes that had not arrived at `inFlightAt_`, by the known rate
    Clock::time_point acknowledgedAt_{}, next_{}, heldAt_{}, inFlightAt_{};
    std::deque<Sent> sent_;
    Spans rate_, delay_;
    bool draining_ = false, lifted_ = false;
    double unjudged_ = 0;  // bytes by which the first delay was measured, with their own time still in it
    int judged_ = 0;       // acknowledgements since
};

}  // namespace rtsg
