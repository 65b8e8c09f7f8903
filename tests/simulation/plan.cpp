// Draws plans, and writes and reads them.
#include "plan.h"

#include <algorithm>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

#include "random.h"

namespace rtsg::simulation {

namespace {

/// How often a kind is drawn, and the greatest amount.
struct Frequency {
    FaultKind kind;
    std::uint32_t weight, amount;
};
constexpr Frequency kFrequencies[] = {
    {FaultKind::cut, 300, 1000},       {FaultKind::halfOpen, 40, 14000},  {FaultKind::stall, 200, 3000},
    {FaultKind::throttle, 100, 3000},  {FaultKind::slow, 40, 300},        {FaultKind::refuse, 60, 6000},
    {FaultKind::killMirror, 40, 2000}, {FaultKind::leaveMirror, 20, 500}, {FaultKind::killRelay, 15, 2000},
    {FaultKind::stop, 60, 12000},      {FaultKind::jump, 60, 20000},      {FaultKind::drift, 30, 2000},
    {FaultKind::killOrigin, 10, 3000}, {FaultKind::closeOrigin, 5, 3000}, {FaultKind::losePower, 5, 3000},
    {FaultKind::diskFull, 10, 3000},   {FaultKind::tornWrite, 8, 1000},   {FaultKind::noFlush, 10, 3000},
    {FaultKind::slowDisk, 60, 3000},   {FaultKind::noMemory, 15, 400},    {FaultKind::forge, 60, 60},
    {FaultKind::meddle, 40, 4000}};

}  // namespace

Plan drawPlan(std::uint64_t seed) {
    Random random(seed, 1);
    Plan plan{seed, 20 + random.below(random.chance(100) ? 1000 : 200), {}};
    std::uint32_t total = 0;
    for (const Frequency& f : kFrequencies) total += f.weight;
    // Some sessions are quiet, some have several faults a step.
    const std::uint32_t perMille[] = {5, 50, 300, 1000, 3000};
    const std::uint32_t density = perMille[random.below(5)];
    for (std::uint32_t step = 1; step < plan.steps; ++step) {
        const std::uint32_t count = density / 1000 + random.chance(density % 1000);
        for (std::uint32_t i = 0; i < count; ++i) {
            std::uint32_t at = random.below(total);
            const Frequency* drawn = kFrequencies;
            for (; at >= drawn->weight; ++drawn) at -= drawn->weight;
            plan.faults.push_back({step, drawn->kind, random.below(1 << 16), 1 + random.below(drawn->amount)});
        }
    }
    return plan;
}

std::string textOf(const Plan& plan) {
    std::string text = fmt::format("seed {}\nsteps {}\n", plan.seed, plan.steps);
    for (const Fault& f : plan.faults)
        text += fmt::format("{} {} {} {}\n", f.step, kFaultNames[static_cast<std::size_t>(f.kind)], f.target, f.amount);
    return text;
}

Result<Plan> readPlan(const std::filesystem::path& file) {
    std::ifstream in(file);
    if (!in) return fail("cannot read", {}, file.string());
    Plan plan;
    std::string line;
    for (std::uint32_t number = 1; std::getline(in, line); ++number) {
        std::istringstream words(line.substr(0, line.find('#')));
        std::string first, kind;
        if (!(words >> first)) continue;
        bool good = false;
        if (first == "seed") {
            good = static_cast<bool>(words >> plan.seed);
        } else if (first == "steps") {
            good = static_cast<bool>(words >> plan.steps);
        } else if (Fault fault; words >> kind >> fault.target >> fault.amount) {
            const auto* const found = std::ranges::find(kFaultNames, kind);
            good = found != kFaultNames.end() && std::istringstream(first) >> fault.step;
            fault.kind = static_cast<FaultKind>(found - kFaultNames.begin());
            good = good && (plan.faults.empty() || plan.faults.back().step <= fault.step);
            plan.faults.push_back(fault);
        }
        if (!good || words >> first)
            return fail("no line of a plan: seed N, steps N, or STEP FAULT TARGET AMOUNT in the order of steps",
                        {number, 1}, file.string());
    }
    if (plan.steps == 0) return fail("the plan has no steps", {}, file.string());
    return plan;
}

}  // namespace rtsg::simulation
