// Writes a room's report as one HTML page that needs nothing else: numbers, tables and drawings.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/audio/room_report.h>

#include "opening_text.h"
#include "report_charts.h"
#include "report_figures.h"

namespace rtsg {
namespace {

/// Openings below this share of the surface are rays that slipped through a seam.
constexpr double kNoOpening = 1e-3;

constexpr std::string_view kStyle = R"(
:root{--ink:#1b2430;--soft:#5d6875;--line:#d5dae0;--accent:#2c4b8e}
body{font:14px/1.45 system-ui,"Segoe UI",Helvetica,Arial,sans-serif;color:var(--ink);margin:2.2em auto;max-width:1080px;padding:0 1em}
h1{font-size:26px;margin:0 0 .1em;font-weight:650}h2{font-size:18px;margin:2em 0 .5em;padding-top:.7em;border-top:2px solid var(--ink)}
h3{font-size:14px;margin:1.3em 0 .3em}p{margin:.3em 0 .6em}.soft,p.lead{color:var(--soft)}
.cards{display:flex;flex-wrap:wrap;gap:10px;margin:1.2em 0}
.card{border:1px solid var(--line);border-radius:6px;padding:8px 14px;min-width:82px}
.card b{display:block;font-size:22px;font-weight:600}.card span{color:var(--soft);font-size:12px}
.side{display:flex;flex-wrap:wrap;gap:28px;align-items:flex-start}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;margin:.3em 0 .6em}
th,td{border:1px solid var(--line);padding:3px 8px;text-align:right}
th{background:#f2f4f7;font-weight:600;white-space:nowrap}td i{display:block;font-style:normal;font-size:11px;color:var(--soft)}
td.text,th.text{text-align:left}
.q1{background:#e6f3e6}.q2{background:#fdf3cf}.q3{background:#f9dcd4}
.l2{background:#dbe8f8}.l3{background:#b5d0f0}.h2{background:#fbe6cf}.h3{background:#f5c99b}
td.low,th.low{color:#8d96a1;background:repeating-linear-gradient(135deg,#f4f5f7 0 4px,#e9ebee 4px 6px)}td.low i{color:#a3abb4}
.key span{display:inline-block;border:1px solid var(--line);padding:0 8px;margin-right:6px;font-size:12px}
svg{display:block;max-width:100%;height:auto;margin:.3em 0}svg text{font-size:11px;fill:#3c4652}
.end{text-anchor:end}.mid{text-anchor:middle}.name{font-weight:600}
.frame{fill:none;stroke:#9aa3ad}.grid{stroke:#e3e7eb}.below{fill:#eceef1}.early{fill:#f3f6fb}
.decay{fill:none;stroke:#b4c0d2;stroke-width:4}.fit{stroke-width:1.4}
.edt{stroke:#c2571a;stroke-dasharray:2 3}.t20{stroke:#2c6fbb;stroke-dasharray:7 4}.t30{stroke:#3c9a57;stroke-dasharray:12 3 2 3}
.late{fill:#c9d3df;stroke:none}
.o0{stroke:#b3122a;fill:#b3122a;stroke-width:2}.o1{stroke:#d8701a;fill:#d8701a}.o2{stroke:#3f8f4f;fill:#3f8f4f}
.o3{stroke:#2c6fbb;fill:#2c6fbb}.o4{stroke:#8a93a0;fill:#8a93a0}
.wall{stroke:#39424d;stroke-width:1.1;fill:none}.rule{stroke:#1b2430;stroke-width:2}
.source{fill:#b3122a;stroke:#fff;stroke-width:1.5}.listener{fill:#2c4b8e;stroke:#fff;stroke-width:1.5}
svg text.mark{fill:#fff;text-anchor:middle;font-size:10px;font-weight:600}
.times{fill:none;stroke-width:1.7}.times.sabine{stroke:#8a93a0}.times.eyring{stroke:#8a93a0;stroke-dasharray:4 3}
section{break-inside:auto}table,svg,.card,h2,h3{break-inside:avoid}h2,h3{break-after:avoid}
p.key,h2+p{break-after:avoid}
@page{size:A4;margin:11mm 12mm}
@media print{body{margin:0;padding:0;max-width:none;font-size:10px}*{-webkit-print-color-adjust:exact;print-color-adjust:exact}
h1{font-size:20px}h2{font-size:14px;margin-top:1.2em}h3{font-size:11px;margin-top:.8em}th,td{padding:1px 5px}td i{font-size:8px}
.cards{gap:5px;margin:.6em 0}.card{padding:3px 8px;min-width:56px}.card b{font-size:15px}.card span{font-size:9px}
.side{gap:14px}.plan svg{max-height:105mm;max-width:105mm}.pair{break-before:page}
table{line-height:1.22}.key span{font-size:9px;padding:0 4px}.pair h2{border:0;margin:0;padding:0}h3{font-weight:600}}
)";

/// The class and other attributes of a cell; nothing for an ordinary one.
std::string cellOf(std::string_view tag, std::string_view kind, std::string_view content) {
    return kind.empty() ? fmt::format("<{0}>{1}</{0}>", tag, content)
                        : fmt::format("<{0} class=\"{1}\">{2}</{0}>", tag, kind, content);
}

std::string octavesHead(std::string_view first, double schroederHz) {
    std::string row = fmt::format("<tr><th>{}</th>", first);
    for (const double hz : kBandHz) row += cellOf("th", hz < schroederHz ? "low" : "", octaveText(hz));
    return row + "</tr>\n";
}

/// How well a figure is known, by its interval in just noticeable differences: a half, one, more.
std::string_view certainty(double half, double noticeable) {
    if (!std::isfinite(half) || !(noticeable > 0)) return "";
    const double fraction = half / noticeable;
    return fraction <= 0.5 ? "q1" : fraction <= 1 ? "q2" : "q3";
}

/// How far a value is from the mean of all, in just noticeable differences: within one, two, more.
std::string_view departure(double difference, double noticeable) {
    if (!std::isfinite(difference) || !(noticeable > 0) || std::abs(difference) <= noticeable) return "";
    const bool far = std::abs(difference) > 2 * noticeable;
    return difference < 0 ? (far ? "l3" : "l2") : far ? "h3" : "h2";
}

enum class Around : bool { interval, deviation };

/// A row for each figure: the value, and its half width after the plus-minus sign; colours show the width.
std::string figuresTable(const RoomMetrics& values, const RoomMetrics& around, double schroederHz, Around kind) {
    std::string table = "<table>\n" + octavesHead("Hz", schroederHz);
    for (const ReportFigure& figure : kReportFigures) {
        table += fmt::format("<tr><th>{}</th>", escapedText(figure.title()));
        for (std::size_t b = 0; b < kBandCount; ++b) {
            const double value = (values.*figure.values)[b], half = (around.*figure.values)[b];
            std::string text = reportNumber(value, figure.digits);
            if (std::isfinite(half)) text += fmt::format("<i>&#177;{:.{}f}</i>", half, figure.digits);
            const bool low = kBandHz[b] < schroederHz;
            const std::string_view known =
                kind == Around::interval ? certainty(half, noticeableDifference(figure.values, value)) : "";
            table += cellOf("td", low ? "low" : known, text);
        }
        table += "</tr>\n";
    }
    return table + "</table>\n";
}

std::string cards(const RoomReport& report, const RoomMetrics& mean) {
    std::string text = "<div class=\"cards\">\n";
    const auto card = [&](std::string_view name, const std::string& value, std::string_view unit) {
        text += fmt::format("<div class=\"card\"><span>{}</span><b>{}</b><span>{}</span></div>\n", name, value, unit);
    };
    for (const ReportFigure& figure : kReportFigures)
        if (const double value = figure.single(mean); std::isfinite(value))
            card(figure.name, fmt::format("{:.{}f}", value, figure.unit == "dB" ? 1 : std::min(figure.digits - 1, 3)),
                 figure.unit.empty() ? std::string_view("&#160;") : figure.unit);
    if (const double speech = report.meanSpeech(); std::isfinite(speech))
        card("STI", fmt::format("{:.2f}", speech), fmt::format("rated {}", speechRating(speech)));
    if (report.room.known()) {
        card("Volume", fmt::format("{:.4g}", report.room.volume), "m&#179;");
        card("Surface", fmt::format("{:.4g}", report.room.surface), "m&#178;");
    }
    return text +
           "</div>\n<p class=\"soft\">Means over all pairs of source and listener. Octaves of 500 and 1000 Hz; LF 125 "
           "to "
           "1000 Hz; IACC 500 to 2000 Hz.</p>\n";
}

/// Names of the marks of the plan.
std::string planKey(const RoomReport& report) {
    constexpr std::size_t kMaxNamed = 40;
    std::vector<std::string> sources, listeners;
    const auto add = [](std::vector<std::string>& into, const std::string& name, const glm::dvec3& at) {
        std::string text =
            fmt::format("{} <span class=\"soft\">{:.2f} {:.2f} {:.2f}</span>", escapedText(name), at.x, at.y, at.z);
        if (std::ranges::find(into, text) == into.end()) into.push_back(std::move(text));
    };
    for (const RoomReport::Pair& pair : report.pairs)
        add(sources, pair.source, pair.sourceAt), add(listeners, pair.listener, pair.listenerAt);
    std::string rows;
    for (std::size_t i = 0; i < sources.size() && i < kMaxNamed; ++i)
        rows += fmt::format("<tr><th>S{}</th><td class=\"text\">{}</td></tr>\n", i + 1, sources[i]);
    for (std::size_t i = 0; i < listeners.size() && i < kMaxNamed; ++i)
        rows += fmt::format("<tr><th>{}</th><td class=\"text\">{}</td></tr>\n", i + 1, listeners[i]);
    return "<table>\n" + rows + "</table>\n";
}

std::string roomSection(const RoomReport& report) {
    std::string text = "<h2>The room</h2>\n<div class=\"side\"><div class=\"plan\">" + planChart(report);
    text += fmt::format(
        "<p class=\"soft\">Cut at a height of {:.2f} m, seen from above: x to the right, z down.{}</p></div>\n<div>",
        report.plan.height, report.plan.leftOut > 0 ? fmt::format(" {} lines are left out.", report.plan.leftOut) : "");
    text += planKey(report) + "</div></div>\n";
    const RoomSize& room = report.room;
    if (!room.known())
        return text +
               "<p>Volume and surface are not known: what is around the first source is open to more than a quarter of "
               "all "
               "directions.</p>\n";
    text += fmt::format(
        "<p>Around the first source: volume {:.4g} m&#179;, surface {:.4g} m&#178;{}, mean free path {:.3g} m.",
        room.volume, room.surface,
        room.openings > kNoOpening * room.surface ? fmt::format(", of which {:.3g} m&#178; are open", room.openings)
                                                  : "",
        room.meanFreePath());
    if (const double hz = report.schroederHz(); std::isfinite(hz))
        text += fmt::format(
            " Below {:.0f} Hz, Schroeder's frequency, single modes make the sound of the room, and rays are no model "
            "of it: octaves below are grey.",
            hz);
    return text + "</p>\n";
}

std::string materialsSection(const RoomReport& report) {
    if (report.materials.empty()) return "";
    std::string text =
        "<h3>What its surfaces absorb</h3>\n<table>\n<tr><th "
        "class=\"text\">Material</th><th>m&#178;</th><th>share</th>";
    for (const double hz : kBandHz) text += fmt::format("<th>{}</th>", octaveText(hz));
    text += "<th>scatters, 1k</th></tr>\n";
    Bands all{};
    for (const RoomReport::Material& one : report.materials) {
        text += fmt::format("<tr><td class=\"text\">{}</td><td>{:.1f}</td><td>{:.0f} %</td>", escapedText(one.name),
                            one.area, 100 * one.area / report.room.surface);
        for (std::size_t b = 0; b < kBandCount; ++b) {
            const double taken = one.material.absorption[b] + one.material.transmission[b];
            all[b] += one.area * taken;
            text += fmt::format("<td>{:.2f}</td>", taken);
        }
        text += fmt::format("<td>{:.2f}</td></tr>\n", one.material.scattering[kBand1k]);
    }
    text += fmt::format("<tr><th class=\"text\">Absorption area, m&#178;</th><th>{:.1f}</th><th></th>",
                        report.room.surface);
    for (const double area : all) text += fmt::format("<th>{:.1f}</th>", area + report.room.openings);
    return text + "<th></th></tr>\n</table>\n";
}

/// The section that shows traced times beside those of formulas.
std::string timesSection(const RoomReport& report, const RoomReport::Average& all, double schroederHz) {
    std::string text = "<h3>Reverberation times</h3>\n<div class=\"side\"><div>" + timesChart(report) +
                       "</div><div><table>\n" + "<tr><th>s</th>";
    struct Row {
        std::string_view name;
        const Bands& values;
    };
    const Row rows[] = {
        {"Sabine", report.sabine}, {"Eyring", report.eyring}, {"T20", all.mean.t20}, {"T30", all.mean.t30}};
    for (const Row& row : rows) text += fmt::format("<th>{}</th>", row.name);
    text += "</tr>\n";
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const bool low = kBandHz[b] < schroederHz;
        text += "<tr>" + cellOf("th", low ? "low" : "", hertzText(kBandHz[b]));
        for (const Row& row : rows) text += cellOf("td", low ? "low" : "", reportNumber(row.values[b], 2));
        text += "</tr>\n";
    }
    return text + "</table></div></div>\n";
}

/// All pairs, a row each, with the colours of how far they are from the mean.
std::string positionsSection(const RoomReport& report, const RoomMetrics& mean) {
    constexpr double kNoticeableSpeech = 0.03;
    if (report.pairs.size() < 2) return "";
    std::string text =
        "<h2>Place by place</h2>\n<p class=\"key\"><span class=\"l3\">lower by over 2</span><span class=\"l2\">over "
        "1</span><span>within 1 noticeable difference of the mean</span><span class=\"h2\">over 1</span><span "
        "class=\"h3\">higher by over 2</span></p>\n<table>\n<tr><th class=\"text\">Source, listener</th><th>m</th>";
    for (const ReportFigure& figure : kReportFigures) text += fmt::format("<th>{}</th>", escapedText(figure.title()));
    text += "<th>STI</th></tr>\n";
    for (const RoomReport::Pair& pair : report.pairs) {
        text += fmt::format("<tr><td class=\"text\">{}, {}</td><td>{:.1f}</td>", escapedText(pair.source),
                            escapedText(pair.listener), glm::distance(pair.sourceAt, pair.listenerAt));
        for (const ReportFigure& figure : kReportFigures) {
            const double value = figure.single(pair.metrics.value), usual = figure.single(mean);
            text += cellOf("td", departure(value - usual, noticeableDifference(figure.values, usual)),
                           reportNumber(value, figure.digits));
        }
        text += cellOf("td", departure(pair.speech.sti - report.meanSpeech(), kNoticeableSpeech),
                       reportNumber(pair.speech.sti, 2)) +
                "</tr>\n";
    }
    return text + "</table>\n";
}

std::string pairSection(const RoomReport::Pair& pair) {
    const std::string slopes = slopesText(pair.metrics);
    std::string text = fmt::format(
        "<section class=\"pair\"><h2>{} heard from {}</h2>\n<p>Source at {:.2f} {:.2f} {:.2f} m, listener at {:.2f} "
        "{:.2f} {:.2f} m, "
        "{:.2f} m apart.",
        escapedText(pair.source), escapedText(pair.listener), pair.sourceAt.x, pair.sourceAt.y, pair.sourceAt.z,
        pair.listenerAt.x, pair.listenerAt.y, pair.listenerAt.z, glm::distance(pair.sourceAt, pair.listenerAt));
    if (std::isfinite(pair.speech.sti))
        text += fmt::format(" <b>STI {:.3f}</b> &#177;{} ({}).", pair.speech.sti, reportNumber(pair.speech.ci95, 3),
                            speechRating(pair.speech.sti));
    text +=
        "</p>\n<p class=\"key\">95 % intervals: <span class=\"q1\">up to half a noticeable difference</span><span "
        "class=\"q2\">up to one</span><span class=\"q3\">more</span>";
    if (pair.schroederHz > kBandHz[0])
        text += fmt::format("<span class=\"low\">below {:.0f} Hz (Schroeder)</span>", pair.schroederHz);
    text += "</p>\n" + figuresTable(pair.metrics.value, pair.metrics.ci95, pair.schroederHz, Around::interval);
    if (!slopes.empty()) text += "<p>Decays with " + slopes + ".</p>\n";
    if (const std::string escapes = escapeText(pair); !escapes.empty()) text += "<p>There is " + escapes + ".</p>\n";
    return text +
           "<h3>Decay curves, dB over s, with what was fitted: <span class=\"soft\">EDT dotted, T20 dashed, T30 dash "
           "and dot" +
           std::string(pair.schroederHz > kBandHz[0] ? "; * below Schroeder's frequency" : "") + "</span></h3>\n" +
           decayChart(pair) +
           "<h3>Reflectogram at 1 kHz, dB over ms from the first sound: <span class=\"soft\">red direct; orange, "
           "green, "
           "blue reflected or bent once, twice, three times, grey more often; the area is what rays bring in each "
           "millisecond</span></h3>\n" +
           reflectogram(pair) +
           "<h3>Energogram, Hz over s: <span class=\"soft\">60 dB from dark to light</span></h3>\n" + energogram(pair) +
           "</section>\n";
}

}  // namespace

std::string RoomReport::toHtml() const {
    const Average all = average();
    const double low = schroederHz();
    std::string page =
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" "
        "content=\"width=device-width\"/><title>" +
        escapedText(title) + "</title>\n<style>" + std::string(kStyle) + "</style>\n</head><body>\n<h1>" +
        escapedText(title) + "</h1>\n";
    page += fmt::format(
        "<p class=\"lead\">Room-acoustic figures by ISO 3382-1; pairs of source and listener: {}; rays: {}. ",
        pairs.size(), rays);
    page += air.absorbs
                ? fmt::format("Air of {:.1f} &#176;C and {:.0f} % humidity. ", air.celsius, air.relativeHumidity)
                : std::string("Air takes nothing. ");
    page += "STI for " + escapedText(speechText(speech)) + ".</p>\n";
    page += cards(*this, all.mean) + roomSection(*this) + materialsSection(*this) + timesSection(*this, all, low) +
            positionsSection(*this, all.mean);
    if (pairs.size() > 1)
        page += "<h2>Mean over places</h2>\n<p>With the standard deviation among them.</p>\n" +
                figuresTable(all.mean, all.deviation, low, Around::deviation);
    page += "<p class=\"soft\">" + escapedText(bandsText(*this)) + ".</p>\n";
    for (const Losses& lost : losses)
        if (const std::string loss = lossText(lost.openings, printable(lost.source), namesBeside(lost.openings));
            !loss.empty())
            page += "<p>" + escapedText(loss) + ".</p>\n";
    for (const Pair& pair : pairs) page += pairSection(pair);
    return page + "</body></html>\n";
}

}  // namespace rtsg
