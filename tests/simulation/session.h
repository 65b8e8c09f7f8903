// Session: runs a plan: an origin, relays, mirrors, editors and a log, on one thread and in virtual time, and looks
// after every step whether all that was promised holds.
//
// What it looks at: a replica's hash is one that the origin had in that state; an edit that was acknowledged is there,
// and once; the log leads to the last state that it acknowledged; what is on its way is within the window; and after
// the last fault all are equal within kQuiet. docs/simulation.md has the model.
// Threading: one thread; one session at a time, as its System stands in for the kernel.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "network.h"
#include "plan.h"

namespace rtsg::simulation {

/// After the last fault, until all are equal.
constexpr Nanoseconds kQuiet = 150 * kSecond;

/// How the session as a whole stood at some moment; the first that is true.
enum class Phase : std::uint8_t { originDown, joining, lost, behind, inStep };
constexpr std::array<std::string_view, 5> kPhaseNames = {"origin-down", "joining", "lost", "behind", "in-step"};
constexpr std::size_t kMessageTypes = 24;

/// How often a message came, and a fault happened, in each phase.
struct Coverage {
    std::array<std::array<std::uint64_t, kPhaseNames.size()>, kMessageTypes> messages{};
    std::array<std::array<std::uint64_t, kPhaseNames.size()>, kFaultNames.size()> faults{};
    void add(const Coverage& other);
    std::string text() const;
};

struct Outcome {
    std::string failure;  // what did not hold; empty if all did
    std::uint32_t step = 0;
    std::uint64_t digest = 0, events = 0, messages = 0, frames = 0, faults = 0, edits = 0, resumed = 0;
    double seconds = 0;  // of the session's time
    Coverage coverage;
};

/// What a session is like. Drawn by the seed, or given for measurements.
struct Shape {
    std::uint32_t mirrors = 0;  // 0: drawn
    Nanoseconds interval = 0;   // between frames; 0: drawn
    bool plain = false;         // whole mirrors that only follow
};

/// `folder` is for the log, and is emptied. `trace` prints what happens.
Outcome runSession(const Plan& plan, const std::filesystem::path& folder, const Shape& shape = {}, bool trace = false);

/// The plan with as few faults as still lead to a failure. `fails` runs one, and is called at most so often; the plan
/// that is given has to fail.
Plan shrink(const Plan& plan, const std::function<bool(const Plan&)>& fails, int runs = 300);

}  // namespace rtsg::simulation
