// Draws a room from above, and its reverberation times over frequency.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "heat_color.h"
#include "report_charts.h"
#include "report_figures.h"

namespace rtsg {
namespace {

/// Metres of the plan as pixels.
struct PlanScale {
    glm::dvec2 low{std::numeric_limits<double>::infinity()}, high{-low};
    double pixels = 1;  // a metre
    static constexpr double kMargin = 26, kWidth = 560, kHeight = 460;

    void extend(const glm::dvec2& at) {
        low = glm::min(low, at);
        high = glm::max(high, at);
    }
    void settle() {
        const glm::dvec2 size = glm::max(high - low, glm::dvec2(1e-3));
        pixels = std::min((kWidth - 2 * kMargin) / size.x, (kHeight - 2 * kMargin) / size.y);
    }
    glm::dvec2 at(const glm::dvec2& point) const { return (point - low) * pixels + kMargin; }
    glm::dvec2 at(const glm::dvec3& position) const { return at(glm::dvec2(position.x, position.z)); }
    glm::dvec2 size() const { return (high - low) * pixels + 2 * kMargin; }
};

/// Places and their numbers, those of one name and place once.
struct PlanMarks {
    std::vector<std::pair<std::string, glm::dvec3>> listeners;

    void add(const std::string& name, const glm::dvec3& at) {
        const std::pair mark(name, at);
        if (std::ranges::find(listeners, mark) == listeners.end()) listeners.push_back(mark);
    }
};

std::string markText(const PlanScale& scale, const PlanMarks& marks, std::string_view kind, std::string_view letter) {
    constexpr std::size_t kMaxNumbered = 40;
    std::string svg;
    for (std::size_t i = 0; i < marks.listeners.size(); ++i) {
        const glm::dvec2 at = scale.at(marks.listeners[i].second);
        svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" class=\"{}\"><title>{}</title></circle>\n",
                           at.x, at.y, marks.listeners.size() <= kMaxNumbered ? 9 : 3, kind,
                           escapedText(marks.listeners[i].first));
        if (marks.listeners.size() <= kMaxNumbered)
            svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"mark\">{}{}</text>\n", at.x, at.y + 3.5, letter,
                               i + 1);
    }
    return svg;
}

}  // namespace

std::string planChart(const RoomReport& report) {
    PlanScale scale;
    PlanMarks sources, listeners;
    for (const RoomReport::Pair& pair : report.pairs) {
        sources.add(pair.source, pair.sourceAt), listeners.add(pair.listener, pair.listenerAt);
        scale.extend({pair.sourceAt.x, pair.sourceAt.z}), scale.extend({pair.listenerAt.x, pair.listenerAt.z});
    }
    if (!report.room.box.empty())
        scale.extend({report.room.box.low.x, report.room.box.low.z}),
            scale.extend({report.room.box.high.x, report.room.box.high.z});
    if (report.pairs.empty()) return "";
    scale.settle();
    const glm::dvec2 size = scale.size();
    std::string svg = fmt::format(
        "<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
        "role=\"img\"><title>plan</title>\n",
        size.x, size.y + 22);
    std::string path;
    for (const RoomPlan::Line& line : report.plan.lines) {
        const glm::dvec2 a = scale.at(line[0]), b = scale.at(line[1]);
        path += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x, a.y, b.x, b.y);
    }
    svg += fmt::format("<path d=\"{}\" class=\"wall\"/>\n", path);
    svg += markText(scale, listeners, "listener", "") + markText(scale, sources, "source", "S");
    const double length = niceStep((scale.high - scale.low).x, 4), y = size.y + 8;
    svg += fmt::format(
        "<line x1=\"{0:.1f}\" x2=\"{1:.1f}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\" class=\"rule\"/><text x=\"{3:.1f}\" "
        "y=\"{4:.1f}\">{5:g} m</text>\n",
        PlanScale::kMargin, PlanScale::kMargin + length * scale.pixels, y,
        PlanScale::kMargin + length * scale.pixels + 6, y + 4, length);
    return svg + "</svg>\n";
}

std::string timesChart(const RoomReport& report) {
    constexpr double kLeft = 40, kTop = 12, kWidth = 420, kHeight = 210;
    const RoomMetrics mean = report.average().mean;
    struct Row {
        const Bands& values;
        std::string_view name, text;
    };
    const Row rows[] = {{report.sabine, "sabine", "Sabine"},
                        {report.eyring, "eyring", "Eyring"},
                        {mean.edt, "edt", "EDT"},
                        {mean.t20, "t20", "T20"},
                        {mean.t30, "t30", "T30"}};
    double maximum = 0;
    for (const Row& row : rows)
        for (const double value : row.values)
            if (std::isfinite(value)) maximum = std::max(maximum, value);
    if (!(maximum > 0)) return "";
    const double step = niceStep(1.08 * maximum, 5), high = std::ceil(1.02 * maximum / step) * step;
    const auto atBand = [&](double octave) { return kLeft + kWidth * (octave + 0.5) / kBandCount; };
    const auto atTime = [&](double seconds) { return kTop + kHeight * (1 - seconds / high); };
    std::string svg = fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\"><title>reverberation "
        "times</title>\n",
        kLeft + kWidth + 66, kTop + kHeight + 36);
    const double schroeder = std::log2(report.schroederHz() / 1000) + kBand1k;
    if (schroeder > -0.5)
        svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{:.1f}\" height=\"{}\" class=\"below\"/>\n", kLeft, kTop,
                           std::min(kWidth, atBand(schroeder) - kLeft), kHeight);
    svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" class=\"frame\"/>\n", kLeft, kTop, kWidth,
                       kHeight);
    for (double t = 0; t <= high * (1 + 1e-9); t += step)
        svg += fmt::format(
            "<line x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\" class=\"grid\"/><text x=\"{3}\" y=\"{4:.1f}\" "
            "class=\"end\">{5:g}</text>\n",
            kLeft, kLeft + kWidth, atTime(t), kLeft - 5, atTime(t) + 3.5, std::round(1e6 * t) / 1e6);
    for (std::size_t b = 0; b < kBandCount; ++b)
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" class=\"mid\">{}</text>\n", atBand(static_cast<double>(b)),
                           kTop + kHeight + 15, octaveText(kBandHz[b]));
    int written = 0;
    for (const Row& row : rows) {
        std::string points;
        for (std::size_t b = 0; b < kBandCount; ++b)
            if (std::isfinite(row.values[b]))
                points += fmt::format("{:.1f},{:.1f} ", atBand(static_cast<double>(b)), atTime(row.values[b]));
        if (points.empty()) continue;
        const double y = kTop + 14 + 18 * written++;
        svg += fmt::format("<polyline points=\"{}\" class=\"times {}\"/>\n", points, row.name);
        svg += fmt::format(
            "<line x1=\"{0}\" x2=\"{1}\" y1=\"{2}\" y2=\"{2}\" class=\"times {3}\"/><text x=\"{4}\" "
            "y=\"{5}\">{6}</text>\n",
            kLeft + kWidth + 6, kLeft + kWidth + 24, y, row.name, kLeft + kWidth + 28, y + 4, row.text);
    }
    return svg + fmt::format("<text x=\"{}\" y=\"{}\" class=\"mid\">Hz</text></svg>\n", kLeft + kWidth / 2,
                             kTop + kHeight + 31);
}

}  // namespace rtsg
