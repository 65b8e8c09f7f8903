// rtsg top: shows the figures of a program that runs with --metrics-port, again and again on a terminal.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>
#include <rtsg/feeds/metrics_server.h>

#include "cli.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

struct TopArguments {
    std::string address, interval = "1s";
    bool once = false, json = false;
};

/// The figures of one moment, in the order in which they came.
struct Figures {
    std::vector<std::pair<std::string, double>> all;  // name with its labels, value
    Clock::time_point at;

    const double* find(std::string_view name) const {
        const auto found = std::ranges::find(all, name, &std::pair<std::string, double>::first);
        return found == all.end() ? nullptr : &found->second;
    }
};

/// Lines that are no figures are left out.
Figures figuresFrom(std::string_view text) {
    Figures figures{{}, Clock::now()};
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        const std::string_view line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        const std::size_t space = line.rfind(' ');
        double value = 0;
        if (line.starts_with('#') || space == line.npos) continue;
        const auto [at, problem] = std::from_chars(line.data() + space + 1, line.data() + line.size(), value);
        if (problem == std::errc() && at == line.data() + line.size())
            figures.all.emplace_back(line.substr(0, space), value);
    }
    return figures;
}

/// The time below which so large a share of frames was, from the histogram's counts; of those since `before`.
double frameTime(const Figures& now, const Figures* before, double fraction) {
    constexpr std::string_view kBucket = "rtsg_frame_seconds_bucket{le=\"";
    std::vector<std::pair<double, double>> counts;  // bound and how many were below
    for (const auto& [name, value] : now.all) {
        if (!name.starts_with(kBucket)) continue;
        double bound = 0;
        std::from_chars(name.data() + kBucket.size(), name.data() + name.size(), bound);
        const double* earlier = before ? before->find(name) : nullptr;
        counts.emplace_back(bound, value - (earlier ? *earlier : 0));
    }
    if (counts.empty() || counts.back().second <= 0) return 0;
    for (const auto& [bound, count] : counts)
        if (count >= fraction * counts.back().second) return bound;
    return 0;
}

/// "rtsg_sent_bytes_total" as "sent bytes", with the labels.
std::string readable(std::string name) {
    std::string labels;
    if (const std::size_t brace = name.find('{'); brace != name.npos) {
        const std::size_t quote = name.find('"'), end = name.rfind('"');
        if (end > quote) labels = " " + name.substr(quote + 1, end - quote - 1);
        name.resize(brace);
    }
    if (name.starts_with("rtsg_")) name.erase(0, 5);
    if (name.ends_with("_total")) name.resize(name.size() - 6);
    std::ranges::replace(name, '_', ' ');
    return terminalText(name + labels);
}

std::string numberText(const std::string& name, double value) {
    if (!name.contains("bytes")) return fmt::format("{:.6g}", value);
    for (const char* unit : {"B", "kB", "MB", "GB"}) {
        if (value < 1000) return fmt::format("{:.4g} {}", value, unit);
        value /= 1000;
    }
    return fmt::format("{:.4g} TB", value);
}

std::string tableOf(const Figures& now, const Figures* before) {
    std::string text = fmt::format("{:<34} {:>14} {:>14}\n", "", "now", before ? "a second" : "");
    for (const auto& [name, value] : now.all) {
        if (name.contains("_bucket{") || name.contains("_frame_seconds")) continue;
        const double* earlier = before && name.contains("_total") ? before->find(name) : nullptr;
        const double seconds = before ? std::chrono::duration<double>(now.at - before->at).count() : 1;
        const std::string rate = earlier ? numberText(name, std::max(0.0, value - *earlier) / seconds) : "";
        text += fmt::format("{:<34} {:>14} {:>14}\n", readable(name), numberText(name, value), rate);
    }
    const double* frames = now.find("rtsg_frame_seconds_count");
    if (!frames) return text;
    const double* earlier = before ? before->find("rtsg_frame_seconds_count") : nullptr;
    const double seconds = before ? std::chrono::duration<double>(now.at - before->at).count() : 1;
    text += fmt::format("{:<34} {:>14.6g} {:>14}\n", "frames", *frames,
                        earlier ? fmt::format("{:.4g}", (*frames - *earlier) / seconds) : "");
    for (const double fraction : {.5, .99}) {
        const double bound = 1000 * frameTime(now, before, fraction);
        if (bound > 0)
            text += fmt::format("{:<34} {:>11}{:.3g} ms\n", fmt::format("frame time, {} of 100 below", 100 * fraction),
                                "", bound);
    }
    return text;
}

std::string jsonOf(const Figures& now) {
    std::string text = "{";
    for (const auto& [name, value] : now.all)
        text += fmt::format("{}{}:{}", text.size() > 1 ? "," : "", jsonString(name), value);
    return text + "}\n";
}

int top(const TopArguments& options) {
    const double interval = parseSeconds(options.interval);
    if (interval < .01) throw UsageError("--interval", "at least 10ms");
    const bool terminal = ::isatty(STDOUT_FILENO) != 0 && !options.json;
    Figures before;
    for (bool first = true; !interrupted(); first = false) {
        const auto text = fetchMetrics(options.address);
        if (!text) {
            // One that has been there has ended: that is the end.
            if (!first && !options.once) return kDone;
            return printError(text.error()), kBad;
        }
        Figures now = figuresFrom(*text);
        if (now.all.empty()) return printError(options.address + ": it serves no figures"), kBad;
        if (terminal && !options.once) fmt::print("\033[H\033[2J{}\n", terminalText(options.address));
        fmt::print("{}", options.json ? jsonOf(now) : tableOf(now, first ? nullptr : &before));
        if (!options.json && !terminal && !options.once) fmt::print("\n");
        std::fflush(stdout);
        if (options.once) return kDone;
        before = std::move(now);
        sleepUntil(Clock::now() + std::chrono::ceil<Clock::duration>(std::chrono::duration<double>(interval)));
    }
    return kDone;
}

}  // namespace

Verb addTop(Command& program) {
    auto options = std::make_shared<TopArguments>();
    Command* command = program.addVerb("top", "Show the metrics of a running program in the terminal");
    command->addOption("ADDRESS", options->address, "PORT on this machine, or HOST:PORT")->required();
    command->addOption("--interval", options->interval, "time between two updates")->preset();
    command->addFlag("--once", options->once, "print once");
    command->addFlag("--json", options->json, "one line of JSON for each update");
    command->footer("Example: rtsg top 9100 --once\nIt ends with the program that it looks at.");
    return {command, [options] { return top(*options); }};
}

}  // namespace rtsg::app
