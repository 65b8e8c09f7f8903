// Averages the figures of a room over places, and writes them as text and as JSON.
#include <rtsg/audio/room_report.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "json_text.h"
#include "opening_text.h"
#include "report_figures.h"

namespace rtsg {

RoomReport::Average RoomReport::average() const {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    Average result;
    for (const ReportFigure& figure : kReportFigures)
        for (std::size_t b = 0; b < kBandCount; ++b) {
            double count = 0, sum = 0, squares = 0;
            const auto each = [&](const auto& take) {
                for (const Pair& pair : pairs)
                    if (const double value = (pair.metrics.value.*figure.values)[b]; std::isfinite(value)) take(value);
            };
            each([&](double value) { count += 1, sum += value; });
            const double mean = count > 0 ? sum / count : kNan;
            each([&](double value) { squares += (value - mean) * (value - mean); });
            (result.count.*figure.values)[b] = count;
            (result.mean.*figure.values)[b] = mean;
            (result.deviation.*figure.values)[b] = count > 1 ? std::sqrt(squares / (count - 1)) : kNan;
        }
    return result;
}

int RoomReport::bandsTraced() const {
    int maximum = 0;
    for (const Pair& pair : pairs) maximum = std::max(maximum, pair.bandsTraced);
    return maximum;
}

int RoomReport::bandsMeasured() const {
    int maximum = 0;
    for (const Pair& pair : pairs) maximum = std::max(maximum, pair.metrics.bandsApart);
    return maximum;
}

double RoomReport::meanSpeech() const {
    double sum = 0, count = 0;
    for (const Pair& pair : pairs)
        if (std::isfinite(pair.speech.sti)) sum += pair.speech.sti, count += 1;
    return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

double RoomReport::schroederHz() const {
    for (const Pair& pair : pairs)
        if (std::isfinite(pair.schroederHz)) return pair.schroederHz;
    return 2000 * std::sqrt(sabine[kBand1k] / room.volume);
}

std::string reportNumber(double value, int digits) {
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "-";
}

std::string bandsText(const RoomReport& report) {
    return fmt::format("Octave bands: {}; walls tell {} of them apart, figures {}: no others are computed", kBandCount,
                       report.bandsTraced(), report.bandsMeasured());
}

std::string speechText(const SpeechOptions& speech) {
    std::string noise = "no background noise";
    if (speech.noise) {
        noise = "background noise of";
        for (std::size_t b = kBand1k - 3; b <= kBand1k + 3; ++b)
            noise += fmt::format("{}{:.4g}", b == kBand1k - 3 ? " " : ", ", (*speech.noise)[b]);
        noise += " dB from 125 Hz to 8 kHz";
    }
    return fmt::format("{} speech of {:.4g} dB(A) at 1 m, {}; IEC 60268-16:2011", speech.female ? "female" : "male",
                       speech.level, noise);
}

std::string slopesText(const MetricsEstimate& metrics) {
    std::string bands;
    for (std::size_t b = 0; b < kBandCount; ++b)
        if (hasTwoSlopes(metrics, b)) {
            bands += fmt::format("{}{} Hz", bands.empty() ? "" : ", ", kBandHz[b]);
            const DecaySlopes& slopes = metrics.slopes[b];
            if (std::isfinite(slopes.late)) bands += fmt::format(" ({:.3g} and {:.3g} s)", slopes.early, slopes.late);
        }
    return bands.empty() ? bands : "more than one slope, as of coupled rooms, at " + bands;
}

std::string escapeText(const RoomReport::Pair& pair) {
    const double fraction = pair.escaped[kBand1k];
    if (fraction < 0.5 || std::isfinite(pair.metrics.value.t20[kBand1k])) return "";
    return fmt::format("no reverberation time: {} of the sound leaves, and what comes back is no decay",
                       percentText(fraction));
}

namespace {

std::string bandsLine(std::string_view name, const Bands& values, int digits) {
    std::string line = fmt::format("  {:<12}", name);
    for (const double value : values) line += fmt::format("{:>9}", reportNumber(value, digits));
    return line + "\n";
}

/// Size and materials of the room, and what formulas say.
std::string roomText(const RoomReport& report) {
    const RoomSize& room = report.room;
    if (!room.known()) return "";
    std::string text = fmt::format("\nroom around the first source: {:.4g} m3, {:.4g} m2, mean free path {:.3g} m",
                                   room.volume, room.surface, room.meanFreePath());
    if (room.openings > 1e-3 * room.surface) text += fmt::format(", {:.3g} m2 open", room.openings);
    text += fmt::format("; rays are no model of it below {:.0f} Hz (Schroeder)\n", report.schroederHz());
    text += bandsLine("Sabine, s", report.sabine, 3) + bandsLine("Eyring, s", report.eyring, 3);
    for (const RoomReport::Material& material : report.materials) {
        text += fmt::format("  {:.1f} m2 of {}\n", material.area, printable(material.name));
        text += bandsLine("  absorbs", material.material.absorption, 2);
        text += bandsLine("  scatters", material.material.scattering, 2);
    }
    return text;
}

std::string jsonRoom(const RoomReport& report) {
    std::string text = fmt::format(
        "\"room\":{{\"volume_m3\":{},\"surface_m2\":{},\"open_m2\":{},\"schroeder_hz\":{},\"sabine_s\":{},\"eyring_s\":"
        "{},"
        "\"materials\":[",
        jsonNumber(report.room.volume), jsonNumber(report.room.surface), jsonNumber(report.room.openings),
        jsonNumber(report.schroederHz()), jsonArray(report.sabine), jsonArray(report.eyring));
    for (const RoomReport::Material& material : report.materials)
        text += fmt::format("{}{{\"name\":{},\"area_m2\":{},\"absorption\":{},\"scattering\":{},\"transmission\":{}}}",
                            &material == report.materials.data() ? "" : ",", jsonString(material.name),
                            jsonNumber(material.area), jsonArray(material.material.absorption),
                            jsonArray(material.material.scattering), jsonArray(material.material.transmission));
    return text + "]}";
}

std::string positionText(const glm::dvec3& p) {
    return fmt::format("{:.2f} {:.2f} {:.2f}", p.x, p.y, p.z);
}

std::string jsonPosition(const glm::dvec3& p) {
    return fmt::format("[{},{},{}]", jsonNumber(p.x), jsonNumber(p.y), jsonNumber(p.z));
}

}  // namespace

std::string RoomReport::toText() const {
    std::string text = fmt::format("{}\nISO 3382-1; pairs of source and listener: {}; rays: {}\n{}\n", printable(title),
                                   pairs.size(), rays, bandsText(*this));
    std::string head = fmt::format("  {:<12}", "Hz");
    for (const double hz : kBandHz) head += fmt::format("{:>9}", hz);
    const Average all = average();
    text += "\nmean over the pairs, and the standard deviation among them\n" + head + "\n";
    for (const ReportFigure& figure : kReportFigures) {
        text += bandsLine(figure.title(), all.mean.*figure.values, figure.digits);
        if (pairs.size() > 1) text += bandsLine("  deviation", all.deviation.*figure.values, figure.digits);
    }
    text += "\nsingle numbers (500 and 1000 Hz; LF: 125 to 1000 Hz; IACC: 500 to 2000 Hz)\n";
    for (const ReportFigure& figure : kReportFigures)
        text += fmt::format("  {:<12}{:>9}\n", figure.title(), reportNumber(figure.single(all.mean), figure.digits));
    text += fmt::format("  {:<12}{:>9}  ({})\n", "STI", reportNumber(meanSpeech(), 3), speechText(speech));
    text += roomText(*this);
    for (const Losses& lost : losses)
        if (const std::string loss = lossText(lost.openings, printable(lost.source), namesBeside(lost.openings));
            !loss.empty())
            text += "\n" + loss + "\n";
    for (const Pair& pair : pairs) {
        text += fmt::format("\n{} at {}, heard from {} at {}\n{}\n", printable(pair.source),
                            positionText(pair.sourceAt), printable(pair.listener), positionText(pair.listenerAt), head);
        for (const ReportFigure& figure : kReportFigures) {
            text += bandsLine(figure.title(), pair.metrics.value.*figure.values, figure.digits);
            text += bandsLine("  95 % +-", pair.metrics.ci95.*figure.values, figure.digits);
        }
        text += fmt::format("  {:<12}{:>9} +- {} {}\n", "STI", reportNumber(pair.speech.sti, 3),
                            reportNumber(pair.speech.ci95, 3), speechRating(pair.speech.sti));
        text += bandsLine("curvature, %", curvature(pair.metrics.value), 1);
        for (const std::string& note : {slopesText(pair.metrics), escapeText(pair)})
            if (!note.empty()) text += "  " + note + "\n";
    }
    return text;
}

std::string RoomReport::toJson() const {
    std::string text =
        fmt::format("{{\"title\":{},\"standard\":\"ISO 3382-1:2009\",\"bands_hz\":{},\"bands_computed\":{},\"pairs\":[",
                    jsonString(title), jsonArray(kBandHz), jsonBandsComputed(bandsTraced(), bandsMeasured()));
    for (const Pair& pair : pairs)
        text += fmt::format(
            "{}{{\"source\":{},\"position\":{},\"listener\":{},\"listener_position\":{},{},\"ci95\":{{{}}},"
            "{},{},\"escaped\":{}}}",
            &pair == pairs.data() ? "" : ",", jsonString(pair.source), jsonPosition(pair.sourceAt),
            jsonString(pair.listener), jsonPosition(pair.listenerAt), jsonFigures(pair.metrics.value),
            jsonFigures(pair.metrics.ci95), jsonSlopes(pair.metrics), jsonSpeech(pair.speech), jsonArray(pair.escaped));
    const Average all = average();
    text += fmt::format("],\"average\":{{\"mean\":{{{}}},\"deviation\":{{{}}},\"count\":{{{}}}}},\"single\":{{",
                        jsonFigures(all.mean), jsonFigures(all.deviation), jsonFigures(all.count));
    for (const ReportFigure& figure : kReportFigures)
        text += fmt::format("{}\"{}\":{}", &figure == kReportFigures.data() ? "" : ",", figure.key,
                            jsonNumber(figure.single(all.mean)));
    text += fmt::format(",\"STI\":{}}},\"speech\":{},{}", jsonNumber(meanSpeech()), jsonSpeechOptions(speech),
                        jsonRoom(*this));
    text += ",\"losses\":[";
    for (const Losses& lost : losses)
        text += fmt::format("{}{{\"source\":{},{}", &lost == losses.data() ? "" : ",", jsonString(lost.source),
                            openingsJson(lost.openings).substr(1));
    return text + fmt::format("],\"rays\":{},\"seconds\":{}}}", rays, jsonNumber(seconds));
}

}  // namespace rtsg
