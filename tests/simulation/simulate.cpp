// The program behind `./dev simulate`: sessions of one seed after another, until the time is over or something fails.
#include <charconv>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>

#include <fmt/format.h>
#include <unistd.h>

#include "session.h"

namespace {

using namespace rtsg::simulation;

struct Arguments {
    double seconds = 60;
    std::optional<std::uint64_t> seed;
    std::filesystem::path replay, out = "simulation.plan";
    bool trace = false, speed = false, goesOn = false;
    std::uint64_t sessions = 0;
};

constexpr const char* kUsage =
    "usage: simulate [SECONDS] [--seed N] [--sessions N] [--out FILE] [--trace] [--keep-going] | --replay FILE "
    "[--trace] | --speed\n"
    "Runs simulated sessions: those of seed N, N + 1 and so on. A failure is shrunk, and written to FILE as a plan\n"
    "that --replay runs again; with --keep-going it is only printed. Status 1: something did not hold. Status 2: wrong "
    "usage.\n";

template <class T>
bool number(std::string_view text, T& value) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() && value >= 0;
}

bool parse(int count, char** words, Arguments& result) {
    for (int i = 1; i < count; ++i) {
        const std::string_view word = words[i];
        const std::string_view next = i + 1 < count ? words[i + 1] : "";
        if (word == "--trace") {
            result.trace = true;
        } else if (word == "--keep-going") {
            result.goesOn = true;
        } else if (word == "--speed") {
            result.speed = true;
        } else if (word == "--seed" || word == "--sessions") {
            std::uint64_t value = 0;
            if (!number(next, value)) return false;
            if (word == "--seed")
                result.seed = value;
            else
                result.sessions = value;
            ++i;
        } else if ((word == "--replay" || word == "--out") && !next.empty()) {
            (word == "--replay" ? result.replay : result.out) = next;
            ++i;
        } else if (!number(word, result.seconds)) {
            return false;
        }
    }
    return true;
}

double cpuSeconds() {
    return double(std::clock()) / CLOCKS_PER_SEC;
}

/// Where the logs are: in memory, if there is such a folder.
std::filesystem::path scratchFolder() {
    const std::filesystem::path memory = "/dev/shm";
    const auto base = ::access(memory.c_str(), W_OK) == 0 ? memory : std::filesystem::temp_directory_path();
    return base / fmt::format("rtsg-simulation-{}", ::getpid());
}

int replay(const Arguments& arguments, const std::filesystem::path& folder) {
    const auto plan = readPlan(arguments.replay);
    if (!plan) {
        fmt::print(stderr, "{}\n", plan.error().format());
        return 1;
    }
    const Outcome outcome = runSession(*plan, folder, {}, arguments.trace);
    fmt::print("seed {}: {} steps, {} faults, digest {:016x}\n", plan->seed, plan->steps, plan->faults.size(),
               outcome.digest);
    if (outcome.failure.empty()) return 0;
    fmt::print("step {}: {}\n", outcome.step, outcome.failure);
    return 1;
}

/// Ten mirrors of a small scene, without faults.
int speed(const std::filesystem::path& folder) {
    for (const Nanoseconds interval : {kSecond, 100 * kMillisecond, 33 * kMillisecond}) {
        const Plan plan{1, static_cast<std::uint32_t>(60 * kSecond / interval), {}};
        const double before = cpuSeconds();
        double seconds = 0;
        while (cpuSeconds() - before < 3) {
            const Outcome outcome = runSession(plan, folder, {10, interval, true});
            if (!outcome.failure.empty()) {
                fmt::print("{}\n", outcome.failure);
                return 1;
            }
            seconds += outcome.seconds;
        }
        fmt::print("ten mirrors, {:.0f} frames a second: {:.0f} seconds of the session in one of the processor\n",
                   double(kSecond) / double(interval), seconds / (cpuSeconds() - before));
    }
    return 0;
}

int simulate(const Arguments& arguments, const std::filesystem::path& folder) {
    const std::uint64_t first = arguments.seed.value_or(1);
    const double begin = cpuSeconds();
    Outcome total;
    std::uint64_t seed = first, failures = 0;
    const auto goesOn = [&] {
        return arguments.sessions > 0 ? seed < first + arguments.sessions : cpuSeconds() - begin < arguments.seconds;
    };
    for (; goesOn(); ++seed) {
        const Plan plan = drawPlan(seed);
        const Outcome outcome = runSession(plan, folder, {}, arguments.trace);
        total.faults += outcome.faults;
        total.frames += outcome.frames;
        total.messages += outcome.messages;
        total.edits += outcome.edits;
        total.resumed += outcome.resumed;
        total.seconds += outcome.seconds;
        total.digest = Random::mix(total.digest ^ outcome.digest);
        total.coverage.add(outcome.coverage);
        if (outcome.failure.empty()) continue;
        fmt::print("seed {}, step {}: {}\n", seed, outcome.step, outcome.failure);
        std::fflush(stdout);
        ++failures;
        if (arguments.goesOn) continue;
        const Plan small = shrink(plan, [&](const Plan& p) { return !runSession(p, folder).failure.empty(); });
        const Outcome again = runSession(small, folder);
        std::ofstream out(arguments.out);
        out << "# " << again.failure.substr(0, again.failure.find('\n')) << '\n' << textOf(small);
        fmt::print("shrunk from {} faults in {} steps to {} in {}: {}\n{}", plan.faults.size(), plan.steps,
                   small.faults.size(), small.steps, arguments.out.string(), textOf(small));
        if (!out.flush()) fmt::print(stderr, "cannot write {}\n", arguments.out.string());
        return 1;
    }
    fmt::print(
        "{} sessions, seeds {} to {}: {:.0f} s of session in {:.1f} s of processor, {} faults, {} frames, {} messages, "
        "{} edits, {} times gone on from a log, digest {:016x}\n{}\n",
        seed - first, first, seed - 1, total.seconds, cpuSeconds() - begin, total.faults, total.frames, total.messages,
        total.edits, total.resumed, total.digest, total.coverage.text());
    return failures > 0;
}

}  // namespace

int main(int count, char** words) {
    Arguments arguments;
    if (!parse(count, words, arguments)) {
        std::fputs(kUsage, stderr);
        return 2;
    }
    const std::filesystem::path folder = scratchFolder();
    const int status = arguments.speed             ? speed(folder)
                       : !arguments.replay.empty() ? replay(arguments, folder)
                                                   : simulate(arguments, folder);
    std::error_code error;
    std::filesystem::remove_all(folder, error);
    return status;
}
