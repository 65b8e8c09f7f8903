// How much may be under way to a peer, so that what it gets is never older than it asked for.
//
// A window in bytes is too little for a fast link or far too much for a slow one. So the pace is measured, as
// congestion control by rate and delay does it (Cardwell et al., BBR, 2016; other constants, and the delay's bound is
// given): the rate at which bytes are acknowledged, as the most of the last seconds in which there was more to send;
// the delay, as the least since the way was last empty. Under way may be what the link carries in that delay and
// an eighth of the lag that is allowed, and one record at least. Where nothing empties the way by itself it is let run
// empty every ten seconds. Invariant: without a lag and a rate nothing is limited. Threading: one thread.
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

    /// `lag`: seconds, 0 for any. `most`: bytes a second, 0 for any.
    MirrorPace(double lag, double most) : lag_(lag), most_(most) {}
    MirrorPace() = default;

    /// `total`: all bytes sent, these included. `awaited`: they are acknowledged as soon as they have been read.
    void sent(std::uint64_t total, Clock::time_point now, bool awaited = true);
    /// All bytes acknowledged.
    void acknowledged(std::uint64_t total, Clock::time_point now);
    /// There is more to send than may be: what is under way tells the link's rate, not the sender's.
    void held(Clock::time_point now) {
        heldUpTo_ = sentTotal_;
        heldAt_ = now;
    }

    /// The sender leaves: what is held back so that newer things are not late is the newest there will be.
    void lift() {
        lifted_ = true;
        liftedAt_ = sentTotal_;
        draining_ = false;
    }

    /// Whether something may be sent now; `record`: bytes of the one that it belongs to.
    bool open(std::uint64_t record, Clock::time_point now);
    /// Whether so many bytes more may go without being acknowledged at once: the way is known and not full, and takes
    /// what has gone so, as fast as it is known to be, in half of the lag. They hold nothing back. Lest a way that has
    /// become slower is found out late, none waits for longer than twice the lag, nor are they many.
    bool spare(std::uint64_t size, Clock::time_point now) const;
    /// What to send at once at most.
    std::uint64_t chunk(std::uint64_t most, Clock::time_point now) const;
    /// So many bytes that wait would be too old before they arrive: better to send what came of them.
    bool late(std::uint64_t waiting) const {
        return lag_ > 0 && (lifted_ || (rate() > 0 && double(waiting) > rate() * lag_ / 2));
    }
    /// As many as would not be, as far as that is known.
    std::uint64_t inTime() const { return static_cast<std::uint64_t>(rate() * lag_ / 4); }
    /// Until a limit of the rate lets something through; 0 if that is not what is waited for.
    Clock::duration wait(Clock::time_point now) const {
        return most_ > 0 && next_ > now ? next_ - now : Clock::duration{};
    }

    /// Bytes a second and seconds, as measured; 0 while unknown.
    double rate() const;
    double delay() const;

  private:
    struct Sent {
        std::uint64_t total = 0, acknowledgedThen = 0;
        Clock::time_point at, since;  // since: when what was acknowledged then had been
        bool tells = false;           // of the way's delay: nothing else was under way
        std::uint64_t spared = 0;     // bytes, if it is not acknowledged at once
    };
    /// The most or least of the last two spans of time.
    struct Spans {
        double now = 0, before = 0;
        Clock::time_point began{};
    };
    double limit(std::uint64_t record) const;
    double onTheWay(Clock::time_point now) const;
    double mostSpared() const;
    bool settled(Clock::time_point now) const;
    void learnDelay(const Sent& sent, std::uint64_t size, Clock::time_point now);
    void judgeFirstDelay();
    void learnRate(const Sent& sent, Clock::time_point now);

    double lag_ = 0, most_ = 0;
    std::uint64_t sentTotal_ = 0, acknowledgedTotal_ = 0, heldUpTo_ = 0, liftedAt_ = 0;
    std::uint64_t spared_ = 0;  // under way without being awaited
    double onTheWay_ = 0;       // bytes that a way of the known rate had not brought at `onTheWayAt_`
    Clock::time_point acknowledgedAt_{}, next_{}, heldAt_{}, onTheWayAt_{};
    std::deque<Sent> sent_;
    Spans rate_, delay_;
    bool draining_ = false, lifted_ = false;
    double unjudged_ = 0;  // bytes by which the first delay was measured, without their own time taken off
    int judged_ = 0;       // acknowledgements since
};

}  // namespace rtsg
