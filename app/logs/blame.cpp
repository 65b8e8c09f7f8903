// Prints the history of a field. Each value that somebody set has a line, and so has each run of changes with the same
// cause in the scene.
#include "blame.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/terminal.h>
#include <rtsg/sync/blame.h>

#include "cli.h"
#include "replay_test.h"
#include "say.h"

namespace rtsg::app {

namespace {

constexpr std::size_t kLongestValue = 40;  // characters of a value in the table

std::string byWhom(const FieldStep& step) {
    if (step.cause.empty()) return step.author;
    return step.author.empty() ? step.cause : fmt::format("{} ({})", step.author, step.cause);
}

std::string shortened(std::string text) {
    if (text.size() <= kLongestValue) return text;
    std::size_t end = kLongestValue - 3;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // do not cut within a character
    return text.substr(0, end) + "...";
}

void printTable(const std::vector<FieldStep>& steps, const std::string& path, double start) {
    fmt::print("{:>15} {:>17}  {:<{}}  {}\n", "states", "t (s)", terminalText(path), kLongestValue, "by");
    for (std::size_t first = 0, last = 0; first < steps.size(); first = last + 1) {
        last = first;
        // Changes that the scene itself makes in the same way share a line.
        while (last + 1 < steps.size() && !steps[first].wasSet && byWhom(steps[last + 1]) == byWhom(steps[first]))
            ++last;
        const auto range = [&](const std::string& a, const std::string& b) {
            return a == b ? a : fmt::format("{}-{}", a, b);
        };
        const auto seconds = [&](const FieldStep& s) { return fmt::format("{:.6g}", s.time - start); };
        const std::string more = last > first ? fmt::format(" ({} changes)", last - first + 1) : std::string();
        fmt::print("{:>15} {:>17}  {:<{}}  {}{}\n",
                   range(std::to_string(steps[first].state), std::to_string(steps[last].state)),
                   range(seconds(steps[first]), seconds(steps[last])), terminalText(shortened(steps[last].value)),
                   kLongestValue, terminalText(byWhom(steps[first])), more);
    }
}

void printJson(const std::vector<FieldStep>& steps, const std::string& path, double start, bool complete,
               const LaterPiece& piece) {
    std::string text = fmt::format("{{\"field\":{},\"steps\":[", jsonString(path));
    for (const FieldStep& s : steps)
        text += fmt::format("{}{{\"state\":{},\"t\":{},\"value\":{},\"author\":{},\"cause\":{}}}",
                            &s == steps.data() ? "" : ",", s.state, std::round((s.time - start) * 1e6) / 1e6,
                            jsonString(s.value), jsonString(s.author), jsonString(s.cause));
    fmt::print("{}],\"complete\":{},\"before_s\":{},\"let_go_s\":{}}}\n", text, complete,
               std::round(piece.begins * 1e6) / 1e6, std::round(piece.letGo * 1e6) / 1e6);
}

}  // namespace

int blame(const std::string& log, const std::string& path, bool json) {
    const Progress bar = progressBar("reading " + log);
    std::optional<Divergence> lacks;
    std::optional<LaterPiece> piece;
    const auto steps = rtsg::blame(
        log, path,
        [&](std::uint64_t done, std::uint64_t total) {
            if (bar) bar(done, total);
            return !interrupted();
        },
        &lacks, &piece);
    if (bar) bar(1, 1);
    if (!steps) return printError(steps.error()), kBad;
    if (interrupted()) return printError("interrupted: this is not all of it"), kBad;
    const double start = logStart(log);
    json ? printJson(*steps, path, start, !lacks, piece.value_or(LaterPiece{})) : printTable(*steps, path, start);
    if (piece)
        reportError("{}: note: it begins {} s into its session: {}\n", terminalText(log),
                    std::round(piece->begins * 1e6) / 1e6, piece->format());
    if (!lacks) return kDone;
    printError(fmt::format("{}: this is not all of it: {}", log, fromStart(lacks, start)->format()));
    return kBad;
}

}  // namespace rtsg::app
