// Draws a room's report as one HTML page: tables, decay curves and energograms in SVG.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/audio/room_report.h>

#include "opening_text.h"
#include "report_figures.h"

namespace rtsg {
namespace {

constexpr double kLowestDb = -60;
constexpr int kWidth = 640, kHeight = 260, kLeft = 48, kTop = 10;
constexpr const char* kBandColors[kBandCount] = {"#440154", "#482878", "#3e4989", "#31688e", "#26828e",
                                                 "#1f9e89", "#35b779", "#6ece58", "#b5c31a", "#d8a50a"};

std::string escaped(std::string_view text) {
    std::string result;
    for (const char c : printable(text)) switch (c) {
            case '<':
                result += "&lt;";
                break;
            case '>':
                result += "&gt;";
                break;
            case '&':
                result += "&amp;";
                break;
            case '"':
                result += "&quot;";
                break;
            default:
                result += c;
        }
    return result;
}

std::string bandsHead() {
    std::string row = "<tr><th>Hz</th>";
    for (const double hz : kBandHz) row += fmt::format("<th>{}</th>", hz);
    return row + "</tr>\n";
}

/// A row a figure: value, and what goes behind the plus-minus.
std::string figuresTable(const RoomMetrics& values, const RoomMetrics& around) {
    std::string table = "<table>\n" + bandsHead();
    for (const ReportFigure& figure : kReportFigures) {
        table += fmt::format("<tr><th>{}</th>", escaped(figure.title()));
        for (std::size_t b = 0; b < kBandCount; ++b) {
            const double half = (around.*figure.values)[b];
            table += fmt::format("<td>{}{}</td>", reportNumber((values.*figure.values)[b], figure.digits),
                                 std::isfinite(half) ? fmt::format(" <i>&#177;{:.{}f}</i>", half, figure.digits) : "");
        }
        table += "</tr>\n";
    }
    return table + "</table>\n";
}

/// Axes of time and the frame around what is drawn.
std::string openChart(double seconds, std::string_view title) {
    std::string svg = fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\"><title>{2}</title>\n"
        "<rect x=\"{3}\" y=\"{4}\" width=\"{5}\" height=\"{6}\" fill=\"none\" stroke=\"#999\"/>\n",
        kWidth + kLeft + 20, kHeight + kTop + 34, escaped(title), kLeft, kTop, kWidth, kHeight);
    for (int i = 0; i <= 5; ++i)
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:.2f} s</text>\n",
                           kLeft + kWidth * i / 5.0, kTop + kHeight + 18, seconds * i / 5);
    return svg;
}

/// Each band from its onset on.
std::string decayChart(const Echogram& echogram, double first, double seconds) {
    std::string svg = openChart(seconds, "decay curves");
    for (int db = 0; db >= static_cast<int>(kLowestDb); db -= 10)
        svg += fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", kLeft - 4,
                           kTop + 4 + kHeight * db / kLowestDb, db);
    constexpr int kSteps = 320;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        std::string points;
        const std::vector<double> curve = decayCurveDb(echogram, b, seconds / kSteps);
        const double begin = (onset(echogram, b) - first) / seconds * kSteps;
        for (std::size_t k = 0; k < curve.size() && curve[k] >= kLowestDb; ++k) {
            const double step = begin + static_cast<double>(k);
            if (step > kSteps) break;
            points +=
                fmt::format("{:.1f},{:.1f} ", kLeft + kWidth * step / kSteps, kTop + kHeight * curve[k] / kLowestDb);
        }
        svg += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\"/>\n", points, kBandColors[b]);
        svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"{}\">{} Hz</text>\n", kLeft + kWidth - 6,
                           kTop + 16 + 14 * b, kBandColors[b], kBandHz[b]);
    }
    return svg + "</svg>\n";
}

/// From dark to light.
std::string heatColor(double share) {
    constexpr double kStops[5][3] = {{13, 8, 60}, {94, 18, 110}, {188, 55, 84}, {249, 142, 9}, {252, 255, 164}};
    const double at = 4 * std::clamp(share, 0.0, 1.0);
    const auto i = static_cast<std::size_t>(std::min(3.0, at));
    const double w = at - static_cast<double>(i);
    int rgb[3];
    for (std::size_t c = 0; c < 3; ++c)
        rgb[c] = static_cast<int>(std::lround(kStops[i][c] * (1 - w) + kStops[i + 1][c] * w));
    return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

/// Energy over time and frequency.
std::string energogram(const Echogram& echogram, double first, double seconds) {
    constexpr int kColumns = 128;
    std::vector<Bands> cells(kColumns, Bands{});
    const auto add = [&](double t, const Bands& energy) {
        const double column = (t - first) / seconds * kColumns;
        if (!(column >= 0 && column < kColumns)) return;
        for (std::size_t b = 0; b < kBandCount; ++b) cells[static_cast<std::size_t>(column)][b] += energy[b];
    };
    for (const Arrival& arrival : echogram.arrivals) add(arrival.seconds, arrival.energy);
    for (std::size_t i = 0; i < echogram.late.bins.size(); ++i)
        add(echogram.late.startOf(i) + 0.5 / echogram.late.binsPerSecond, echogram.late.bins[i]);
    double most = 0;
    for (const Bands& cell : cells)
        for (const double energy : cell) most = std::max(most, energy);
    std::string svg = openChart(seconds, "energogram");
    constexpr double kCellHeight = double{kHeight} / kBandCount, kCellWidth = double{kWidth} / kColumns;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double y = kTop + kHeight - kCellHeight * static_cast<double>(b + 1);
        svg += fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", kLeft - 4,
                           y + kCellHeight / 2 + 4, kBandHz[b]);
        for (std::size_t k = 0; k < kColumns; ++k) {
            if (!(cells[k][b] > 0)) continue;
            const double db = 10 * std::log10(cells[k][b] / most);
            if (db < kLowestDb) continue;
            svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n",
                               kLeft + kCellWidth * static_cast<double>(k), y, kCellWidth + 0.1, kCellHeight,
                               heatColor(1 - db / kLowestDb));
        }
    }
    return svg + "</svg>\n";
}

/// When the slowest band has fallen to the lowest level drawn, at least a tenth of a second.
double drawnSeconds(const Echogram& echogram, double first) {
    constexpr double kGrid = 0.01;
    double longest = 0.1;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const std::vector<double> curve = decayCurveDb(echogram, b, kGrid);
        const auto end = std::find_if(curve.begin(), curve.end(), [](double level) { return level < kLowestDb; });
        if (curve.empty()) continue;
        longest = std::max(longest, onset(echogram, b) - first + kGrid * static_cast<double>(end - curve.begin()));
    }
    return longest;
}

/// When anything comes at all: where both charts begin.
double firstOf(const Echogram& echogram) {
    double first = std::numeric_limits<double>::infinity();
    if (!echogram.arrivals.empty()) first = echogram.arrivals.front().seconds;
    for (std::size_t i = 0; i < echogram.late.bins.size(); ++i)
        if (*std::max_element(echogram.late.bins[i].begin(), echogram.late.bins[i].end()) > 0)
            return std::min(first, echogram.late.startOf(i));
    return std::isfinite(first) ? first : 0;
}

std::string pairSection(const RoomReport::Pair& pair) {
    const double first = firstOf(pair.echogram), seconds = drawnSeconds(pair.echogram, first);
    const std::string slopes = slopesText(pair.metrics);
    return fmt::format(
               "<h2>{} heard from {}</h2>\n<p>Source at {:.2f} {:.2f} {:.2f} m, listener at {:.2f} {:.2f} {:.2f} m; "
               "with 95 % intervals.</p>\n",
               escaped(pair.source), escaped(pair.listener), pair.sourceAt.x, pair.sourceAt.y, pair.sourceAt.z,
               pair.listenerAt.x, pair.listenerAt.y, pair.listenerAt.z) +
           figuresTable(pair.metrics.value, pair.metrics.ci95) +
           (slopes.empty() ? slopes : "<p>Decays with " + slopes + ".</p>\n") + "<h3>Decay curves, dB</h3>\n" +
           decayChart(pair.echogram, first, seconds) +
           fmt::format("<h3>Energogram, Hz; {} dB from dark to light</h3>\n", -kLowestDb) +
           energogram(pair.echogram, first, seconds);
}

}  // namespace

std::string RoomReport::toHtml() const {
    const Average all = average();
    std::string page =
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><title>" + escaped(title) +
        "</title>\n<style>body{font:15px sans-serif;margin:2em auto;max-width:72em;color:#222}"
        "table{border-collapse:collapse}th,td{border:1px solid #ccc;padding:.2em .5em;text-align:right}"
        "th{background:#f3f3f3;white-space:nowrap}i{color:#888;font-size:80%;font-style:normal}svg text{font:11px "
        "sans-serif}</style>\n"
        "</head><body>\n<h1>" +
        escaped(title) +
        fmt::format("</h1>\n<p>Room-acoustic figures by ISO 3382-1; pairs of source and listener: {}; rays: {}. ",
                    pairs.size(), rays);
    page += air.absorbs
                ? fmt::format("Air of {:.1f} &#176;C and {:.0f} % humidity.</p>\n", air.celsius, air.relativeHumidity)
                : std::string("Air takes nothing.</p>\n");
    page += "<p>" + escaped(bandsText(*this)) + ".</p>\n";
    page += "<h2>Single numbers (500 and 1000 Hz)</h2>\n<table>\n<tr>";
    for (const ReportFigure& figure : kReportFigures) page += "<th>" + escaped(figure.title()) + "</th>";
    page += "</tr>\n<tr>";
    for (const ReportFigure& figure : kReportFigures)
        page += "<td>" + reportNumber(single(all.mean.*figure.values), figure.digits) + "</td>";
    page += "</tr>\n</table>\n<h2>Mean over places</h2>\n<p>With the standard deviation among them.</p>\n" +
            figuresTable(all.mean, all.deviation);
    page += lossesHtml(*this);
    for (const Pair& pair : pairs) page += pairSection(pair);
    return page + "</body></html>\n";
}

}  // namespace rtsg
