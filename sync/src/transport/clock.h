// Clock: what a mirror server and a client know of time, and how they wait. The ordinary one is the system's steady
// clock. A VirtualClock goes on only when its one user waits, or says so: then hours of a session pass in a moment, and
// in the same way each time.
//
// Invariant: time never goes back.
// Threading: the steady clock any thread; a virtual one belongs to one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>

struct pollfd;

namespace rtsg {

class Clock {
  public:
    // As those of std::chrono's clocks are called.
    // NOLINTBEGIN(readability-identifier-naming)
    using time_point = std::chrono::steady_clock::time_point;
    using duration = std::chrono::steady_clock::duration;
    // NOLINTEND(readability-identifier-naming)

    virtual ~Clock() = default;
    virtual time_point now() const = 0;
    /// Sleeps until a descriptor is ready, a signal comes, or so much time has passed. Returns what poll() returns.
    virtual int wait(std::span<pollfd> items, duration maximum) = 0;
    /// True if everything has to happen on the thread that waits, so that servers start no threads.
    virtual bool isStepped() const = 0;
    /// The time in ns. It has no meaning on other machines.
    std::uint64_t nanoseconds() const {
        return static_cast<std::uint64_t>(std::chrono::nanoseconds(now().time_since_epoch()).count());
    }
};

Clock& steadyClock();

class VirtualClock : public Clock {
  public:
    time_point now() const override { return now_; }
    /// Returns at once. If no descriptor is ready, `maximum` has passed.
    int wait(std::span<pollfd> items, duration maximum) override;
    bool isStepped() const override { return true; }
    void advance(duration time) { now_ += time; }

  private:
    time_point now_{std::chrono::hours(1)};  // so that time points of 0 are long past, as with the system's
};

}  // namespace rtsg
