// Network: connections between the processes of one session, in virtual time. They keep the contract of transport.h:
// messages of a connection come whole, once and in order, or the connection ends.
//
// Invariant: a message arrives at a time that is fixed when it is sent, never before earlier ones of its connection.
// Threading: one thread.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <queue>
#include <string>
#include <vector>

#include "system.h"
#include "transport/transport.h"

namespace rtsg::simulation {

/// Nanoseconds since the session began.
using Nanoseconds = std::int64_t;
constexpr Nanoseconds kMillisecond = 1'000'000;
constexpr Nanoseconds kSecond = 1'000'000'000;
constexpr Nanoseconds kNever = INT64_MAX / 4;

/// Nanoseconds of the whole session, and what happened in it as a number: equal runs have equal ones.
struct World {
    Nanoseconds now = 0;
    std::uint64_t digest = 0xCBF29CE484222325, events = 0;
    void note(std::uint64_t what) {
        digest = Random::mix(digest ^ what);
        ++events;
    }
};

/// What a process knows of time. Its clock may have jumped, and goes at a rate of its own.
class ProcessClock : public Clock {
  public:
    ProcessClock(World& world, System& system) : world_(world), system_(system) {}
    time_point now() const override;
    /// A wait lets only this process's time go on: it is ahead of the others' until they catch up.
    int wait(std::span<pollfd> items, duration maximum) override;
    bool isStepped() const override { return true; }

    /// The session's time at which this process is.
    Nanoseconds at() const { return world_.now + ahead_; }
    /// Call it when the session's time has gone on.
    void catchUp(Nanoseconds before) { ahead_ = std::max<Nanoseconds>(0, ahead_ + before - world_.now); }
    Nanoseconds ahead() const { return ahead_; }
    void jump(Nanoseconds by);
    void setDrift(std::int64_t partsPerMillion);
    Nanoseconds worldFromLocal(duration local) const;

  private:
    Nanoseconds local() const;
    World& world_;
    System& system_;
    Nanoseconds ahead_ = 0, localBase_ = 0, worldBase_ = 0;
    std::int64_t drift_ = 0;  // parts in a million
};

/// One of those that send and receive. What arrives for it makes it due.
struct Process {
    Process(World& world, System& system) : clock(world, system) {}
    virtual ~Process() = default;
    ProcessClock clock;
    Nanoseconds due = 0;           // when it looks again
    Nanoseconds stoppedUntil = 0;  // it does nothing before
    void isDue(Nanoseconds time) { due = std::min(due, time); }
    Nanoseconds next() const { return std::max({due, stoppedUntil, clock.at()}); }
};

class Network {
  public:
    Network(World& world, System& system) : world_(world), system_(system) {}
    Network(const Network&) = delete;
    Network& operator=(const Network&) = delete;

    /// What `process` sends and listens by.
    std::shared_ptr<Transport> transportOf(Process& process);

    // ---- faults: of the connection with this number, modulo how many there are. False if there is none --------
    bool cut(std::uint32_t which);
    bool halfOpen(std::uint32_t which, Nanoseconds time);
    bool stall(std::uint32_t which, Nanoseconds time);
    bool throttle(std::uint32_t which, std::uint64_t bytesPerSecond, Nanoseconds time);
    bool slow(std::uint32_t which, Nanoseconds delay);
    bool refuse(std::uint32_t which, Nanoseconds time);
    /// The process is gone: nothing more is sent by its connections, and listeners are no longer there.
    void kill(Process& process, bool isSilent);
    /// Ends all faults but delays.
    void heal();
    std::size_t connections() const { return all_.size(); }

    std::uint64_t messages = 0;
    /// The greatest number of bytes of records on their way by one connection, beyond its client's window.
    std::uint64_t maximumUnread = 0;
    /// Called with the first part of each message when it is received, and whether a listener does.
    std::function<void(std::span<const std::byte>, bool atListener)> heard;

  private:
    class Port;
    class Line;
    class View;
    struct Message {
        Nanoseconds at = 0;
        std::uint64_t serial = 0;
        std::shared_ptr<bool> isLost;  // of the connection that it came by
        std::string from;
        std::vector<std::byte> first, copy;
        std::span<const std::byte> second;
        SharedBytes owner;
    };
    World& world_;
    System& system_;
    std::vector<Line*> all_;
    std::map<std::string, Port*, std::less<>> ports_;
    std::map<std::string, Line*, std::less<>> up_;
    std::uint64_t lastNumber_ = 0, serial_ = 0;
};

}  // namespace rtsg::simulation
