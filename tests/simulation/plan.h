// Plan: what decides a simulated session: a seed, a number of steps, and the faults. The seed draws all but the faults,
// so that the same session can be run with fewer of them.
//
// Invariant: the same plan is the same run, event by event.
// Threading: values.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::simulation {

enum class FaultKind : std::uint8_t {
    cut,          // a connection ends, and what is under way is lost
    halfOpen,     // it carries nothing for a while, tells nobody, and then ends
    stall,        // what is sent from now on arrives later, all at once
    throttle,     // it carries few bytes a second for a while
    slow,         // its delay grows by this for the rest of the session
    refuse,       // attempts to connect fail for a while
    killMirror,   // a mirror's process is killed, and started again later
    leaveMirror,  // a mirror ends in order, and another one begins later
    killRelay,
    stop,         // a process is stopped and goes on later
    jump,         // a process's clock jumps forward
    drift,        // a process's clock goes at another rate
    killOrigin,   // the origin's process is killed; it goes on from its log, if it has one
    closeOrigin,  // it ends in order, and goes on from its log
    losePower,    // as killOrigin, and what was not flushed is lost
    diskFull,     // writes fail for a while
    tornWrite,    // the next write is cut short, and the process is killed in it
    noFlush,      // flushes fail for a while
    slowDisk,     // what is logged is acknowledged later
    noMemory,     // one allocation fails in a process
    forge,        // a stranger sends messages that make no sense
    meddle,       // somebody edits a replica behind its client's back
};
constexpr std::array<std::string_view, 22> kFaultNames = {
    "cut",        "half-open", "stall",     "throttle",  "slow",        "refuse",       "kill-mirror", "leave-mirror",
    "kill-relay", "stop",      "jump",      "drift",     "kill-origin", "close-origin", "lose-power",  "disk-full",
    "torn-write", "no-flush",  "slow-disk", "no-memory", "forge",       "meddle"};

struct Fault {
    std::uint32_t step = 0;  // before which it happens
    FaultKind kind = FaultKind::cut;
    std::uint32_t target = 0;  // taken modulo the number of connections or processes that it may hit
    std::uint32_t amount = 0;  // how much or how long: milliseconds, for most kinds
    friend bool operator==(const Fault&, const Fault&) = default;
};

struct Plan {
    std::uint64_t seed = 0;
    std::uint32_t steps = 0;
    std::vector<Fault> faults;  // in the order of their steps
    friend bool operator==(const Plan&, const Plan&) = default;
};

Plan drawPlan(std::uint64_t seed);
/// As lines: `seed N`, `steps N`, and a line for each fault. Lines with # are comments.
std::string textOf(const Plan& plan);
Result<Plan> readPlan(const std::filesystem::path& file);

}  // namespace rtsg::simulation
