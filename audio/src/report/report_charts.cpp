// Draws decays, reflectograms and energograms of one source at one listener.
#include "report_charts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "heat_color.h"
#include "report_figures.h"

namespace rtsg {
namespace {

constexpr double kLowestDb = -60;
constexpr double kCurveStep = 0.001;  // s

/// When anything comes at all: where charts begin.
double firstOf(const Echogram& echogram) {
    double first = std::numeric_limits<double>::infinity();
    if (!echogram.arrivals.empty()) first = echogram.arrivals.front().seconds;
    for (std::size_t i = 0; i < echogram.late.bins.size(); ++i)
        if (*std::max_element(echogram.late.bins[i].begin(), echogram.late.bins[i].end()) > 0)
            return std::min(first, echogram.late.startOf(i));
    return std::isfinite(first) ? first : 0;
}

/// A frame with lines of a grid and numbers, in which times and levels have places.
struct ChartFrame {
    double x, y, width, height;  // pixels
    double seconds;              // along x, from 0
    double lowest;               // dB along y, from 0 down

    double atTime(double t) const { return x + width * t / seconds; }
    double atLevel(double db) const { return y + height * db / lowest; }

    std::string draw(double levelStep, bool levels, bool milliseconds) const {
        std::string svg =
            fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" class=\"frame\"/>\n", x, y,
                        width, height);
        for (double db = 0; db >= lowest - 1e-9; db -= levelStep) {
            svg += fmt::format("<line x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\" class=\"grid\"/>\n", x,
                               x + width, atLevel(db), atLevel(db));
            if (levels)
                svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"end\">{}</text>\n", x - 5,
                                   atLevel(db) + 3.5, db == 0 ? 0 : db);
        }
        const double step = niceStep(seconds, width / 70);
        for (double t = 0; t <= seconds * (1 + 1e-9); t += step) {
            svg += fmt::format("<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\" class=\"grid\"/>\n",
                               atTime(t), y, y + height);
            svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"mid\">{:g}</text>\n", atTime(t),
                               y + height + 13, milliseconds ? std::round(1e5 * t) / 100 : std::round(1e6 * t) / 1e6);
        }
        return svg;
    }
};

std::string openSvg(double width, double height, std::string_view title) {
    return fmt::format("<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\"><title>{2}</title>\n",
                       width, height, title);
}

/// Level of the fitted line at the middle of its times; the reverberation time alone does not give it.
struct FittedLine {
    double time = 0, level = 0;  // s after the onset, dB
    bool known = false;

    FittedLine(const std::vector<double>& curve, double from, double to) {
        double count = 0;
        for (std::size_t k = 0; k < curve.size(); ++k)
            if (curve[k] <= from && curve[k] >= to) {
                time += static_cast<double>(k) * kCurveStep, level += curve[k], count += 1;
            }
        if (!(count > 1)) return;
        time /= count, level /= count;
        known = true;
    }
};

std::string fitLine(const ChartFrame& frame, const std::vector<double>& curve, double late, double time, double from,
                    double to, std::string_view name) {
    const FittedLine line(curve, from, to);
    if (!line.known || !(time > 0)) return "";
    // Drawn on for as far again, as it is extrapolated.
    const double begin = std::min(0.0, from + 5), end = std::max(kLowestDb, to - 15);
    const auto at = [&](double db) { return frame.atTime(late + line.time + (line.level - db) * time / 60); };
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" class=\"fit {}\"/>\n", at(begin),
                       frame.atLevel(begin), at(end), frame.atLevel(end), name);
}

/// One octave of the decays.
std::string decayPanel(const RoomReport::Pair& pair, std::size_t band, double first, const ChartFrame& frame,
                       bool levels) {
    const bool low = kBandHz[band] < pair.schroederHz;
    std::string svg;
    if (low)
        svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" class=\"below\"/>\n",
                           frame.x, frame.y, frame.width, frame.height);
    svg += frame.draw(20, levels, false);
    const std::vector<double> curve = decayCurveDb(pair.echogram, band, kCurveStep);
    const double late = curve.empty() ? 0 : onset(pair.echogram, band) - first;
    const RoomMetrics& m = pair.metrics.value;
    std::string points;
    const auto step = std::max<std::size_t>(1, static_cast<std::size_t>(frame.seconds / kCurveStep / 200));
    for (std::size_t k = 0; k < curve.size() && curve[k] >= kLowestDb; k += step) {
        const double t = late + static_cast<double>(k) * kCurveStep;
        if (t > frame.seconds) break;
        points += fmt::format("{:.1f},{:.1f} ", frame.atTime(t), frame.atLevel(curve[k]));
    }
    if (!points.empty()) svg += fmt::format("<polyline points=\"{}\" class=\"decay\"/>\n", points);
    svg += fitLine(frame, curve, late, m.edt[band], 0, -10, "edt") +
           fitLine(frame, curve, late, m.t30[band], -5, -35, "t30") +
           fitLine(frame, curve, late, m.t20[band], -5, -25, "t20");
    const std::string time = std::isfinite(m.t20[band])   ? fmt::format("T20 {:.2f} s", m.t20[band])
                             : std::isfinite(m.edt[band]) ? fmt::format("EDT {:.2f} s", m.edt[band])
                                                          : std::string();
    return svg + fmt::format(
                     "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"name\">{}{}</text>\n<text x=\"{:.1f}\" y=\"{:.1f}\" "
                     "class=\"end\">{}</text>\n",
                     frame.x, frame.y - 6, hertzText(kBandHz[band]), low ? " *" : "", frame.x + frame.width,
                     frame.y - 6, time);
}

/// When the slowest band has fallen to the lowest level drawn, at least a tenth of a second.
double drawnSeconds(const Echogram& echogram, double first) {
    double longest = 0.1;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const std::vector<double> curve = decayCurveDb(echogram, b, kCurveStep);
        const auto end = std::find_if(curve.begin(), curve.end(), [](double level) { return level < kLowestDb; });
        if (curve.empty()) continue;
        longest = std::max(longest, onset(echogram, b) - first + kCurveStep * static_cast<double>(end - curve.begin()));
    }
    return longest;
}

}  // namespace

std::string escapedText(std::string_view text) {
    return escapeMarkup(printable(text));
}

std::string hertzText(double hz) {
    return hz < 1000 ? fmt::format("{} Hz", hz) : fmt::format("{} kHz", hz / 1000);
}

std::string octaveText(double hz) {
    return hz < 1000 ? fmt::format("{}", hz) : fmt::format("{}k", hz / 1000);
}

std::string decayChart(const RoomReport::Pair& pair) {
    constexpr int kColumns = 5;
    constexpr double kWidth = 186, kHeight = 112, kAcross = 208, kDown = 162, kLeft = 34, kTop = 24;
    const double first = firstOf(pair.echogram), seconds = drawnSeconds(pair.echogram, first);
    std::string svg = openSvg(kLeft + kAcross * kColumns, kTop + kDown * 2 - 8, "decay curves");
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const std::size_t across = b % kColumns, down = b / kColumns;
        const auto column = static_cast<double>(across), row = static_cast<double>(down);
        const ChartFrame frame{kLeft + kAcross * column, kTop + kDown * row, kWidth, kHeight, seconds, kLowestDb};
        svg += decayPanel(pair, b, first, frame, column == 0);
    }
    return svg + "</svg>\n";
}

std::string reflectogram(const RoomReport::Pair& pair) {
    constexpr std::size_t kBand = kBand1k, kMaxDrawn = 600;
    constexpr double kShown = 0.2, kLowest = -50;
    const Echogram& echogram = pair.echogram;
    const double first = firstOf(echogram);
    const ChartFrame frame{34, 10, 1000, 190, kShown, kLowest};
    std::string svg = openSvg(1074, 240, "reflectogram");
    const double early = frame.atTime(0.08);
    svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" class=\"early\"/>\n",
                       frame.x, frame.y, early - frame.x, frame.height);
    svg += frame.draw(10, true, true);
    double maximum = 0;
    for (const Arrival& arrival : echogram.arrivals) maximum = std::max(maximum, arrival.energy[kBand]);
    if (!(maximum > 0))
        for (const Bands& bin : echogram.late.bins) maximum = std::max(maximum, bin[kBand]);
    const auto level = [&](double energy) {
        return maximum > 0 && energy > 0 ? 10 * std::log10(energy / maximum) : 2 * kLowest;
    };
    // Energy of milliseconds of all that has no exact time.
    std::string area;
    for (std::size_t i = 0; i < echogram.late.bins.size(); ++i) {
        const double begin = echogram.late.startOf(i) - first, end = begin + 1 / echogram.late.binsPerSecond;
        if (begin < 0 || end > kShown) continue;
        const double y = frame.atLevel(std::clamp(level(echogram.late.bins[i][kBand]), kLowest, 0.0));
        area += fmt::format("{:.1f},{:.1f} {:.1f},{:.1f} ", frame.atTime(begin), y, frame.atTime(end), y);
    }
    if (!area.empty()) {
        const std::size_t comma = area.find(',');
        svg += fmt::format("<polygon points=\"{},{:.1f} {}{:.1f},{:.1f}\" class=\"late\"/>\n", area.substr(0, comma),
                           frame.atLevel(kLowest), area, frame.atTime(kShown), frame.atLevel(kLowest));
    }
    std::vector<const Arrival*> drawn;
    for (const Arrival& arrival : echogram.arrivals)
        if (arrival.seconds - first <= kShown && level(arrival.energy[kBand]) > kLowest) drawn.push_back(&arrival);
    std::ranges::stable_sort(drawn, std::greater(), [](const Arrival* one) { return one->energy[kBand]; });
    drawn.resize(std::min(drawn.size(), kMaxDrawn));
    std::ranges::reverse(drawn);
    for (const Arrival* arrival : drawn) {
        const double x = frame.atTime(arrival->seconds - first), y = frame.atLevel(level(arrival->energy[kBand]));
        svg += fmt::format(
            "<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\" class=\"o{3}\"/><circle cx=\"{0:.1f}\" "
            "cy=\"{1:.1f}\" r=\"2.4\" class=\"o{3}\"/>\n",
            x, y, frame.atLevel(kLowest), std::min(arrival->order, 4u));
    }
    return svg + fmt::format("<text x=\"{:.1f}\" y=\"12\" class=\"end\">80 ms</text>\n</svg>\n", early - 4);
}

std::string energogram(const RoomReport::Pair& pair) {
    constexpr std::size_t kColumns = 160;
    const Echogram& echogram = pair.echogram;
    const double first = firstOf(echogram), seconds = drawnSeconds(echogram, first);
    std::vector<Bands> cells(kColumns, Bands{});
    const auto add = [&](double t, const Bands& energy) {
        const double column = (t - first) / seconds * kColumns;
        if (!(column >= 0 && column < kColumns)) return;
        for (std::size_t b = 0; b < kBandCount; ++b) cells[static_cast<std::size_t>(column)][b] += energy[b];
    };
    for (const Arrival& arrival : echogram.arrivals) add(arrival.seconds, arrival.energy);
    for (std::size_t i = 0; i < echogram.late.bins.size(); ++i)
        add(echogram.late.startOf(i) + 0.5 / echogram.late.binsPerSecond, echogram.late.bins[i]);
    double maximum = 0;
    for (const Bands& cell : cells)
        for (const double energy : cell) maximum = std::max(maximum, energy);
    const ChartFrame frame{34, 6, 1000, 180, seconds, kLowestDb};
    std::string svg = openSvg(1074, 210, "energogram") + "<g shape-rendering=\"crispEdges\">\n";
    const double height = frame.height / kBandCount, width = frame.width / kColumns;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double y = frame.y + frame.height - height * static_cast<double>(b + 1);
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"end\">{}</text>\n", frame.x - 5,
                           y + height / 2 + 3.5, octaveText(kBandHz[b]));
        for (std::size_t k = 0; k < kColumns; ++k) {
            if (!(cells[k][b] > 0)) continue;
            const double db = 10 * std::log10(cells[k][b] / maximum);
            if (db < kLowestDb) continue;
            svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n",
                               frame.x + width * static_cast<double>(k), y, width + 0.2, height + 0.2,
                               cssColor(heatColor(1 - db / kLowestDb)));
        }
    }
    svg += "</g>\n";
    const double step = niceStep(seconds, frame.width / 70);
    for (double t = 0; t <= seconds * (1 + 1e-9); t += step)
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"mid\">{:g}</text>\n", frame.atTime(t),
                           frame.y + frame.height + 14, std::round(1e6 * t) / 1e6);
    return svg + "</svg>\n";
}

}  // namespace rtsg
