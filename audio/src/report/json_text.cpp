// Writes numbers and figures as JSON.
#include "json_text.h"

#include <cmath>

#include <fmt/format.h>

#include "report_figures.h"

namespace rtsg {

std::string jsonNumber(double value) {
    return std::isfinite(value) ? fmt::format("{:.7g}", value) : "null";
}

std::string jsonArray(const Bands& values) {
    std::string text = "[";
    for (std::size_t b = 0; b < kBandCount; ++b) text += (b ? "," : "") + jsonNumber(values[b]);
    return text + "]";
}

std::string jsonBandsComputed(int walls, int figures) {
    return fmt::format("{{\"walls\":{},\"figures\":{}}}", walls, figures);
}

std::string jsonFigures(const RoomMetrics& m) {
    std::string text;
    for (const ReportFigure& figure : kReportFigures)
        text += fmt::format("{}\"{}\":{}", text.empty() ? "" : ",", figure.key, jsonArray(m.*figure.values));
    return text;
}

std::string jsonSpeech(const SpeechEstimate& speech) {
    return fmt::format("\"STI\":{},\"STI_ci95\":{},\"MTI\":{},\"speech_level_db\":{}", jsonNumber(speech.sti),
                       jsonNumber(speech.ci95), jsonArray(speech.mti), jsonArray(speech.level));
}

std::string jsonSpeechOptions(const SpeechOptions& speech) {
    return fmt::format("{{\"standard\":\"IEC 60268-16:2011\",\"voice\":\"{}\",\"level_dba_1m\":{},\"noise_db\":{}}}",
                       speech.female ? "female" : "male", jsonNumber(speech.level),
                       speech.noise ? jsonArray(*speech.noise) : "null");
}

std::string jsonSlopes(const MetricsEstimate& m) {
    std::string slopes;
    Bands early, late;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        slopes += fmt::format("{}{}", b ? "," : "", hasTwoSlopes(m, b) ? "true" : "false");
        early[b] = m.slopes[b].early;
        late[b] = m.slopes[b].late;
    }
    return fmt::format("\"curvature_percent\":{},\"two_slopes\":[{}],\"early_slope_s\":{},\"late_slope_s\":{}",
                       jsonArray(curvature(m.value)), slopes, jsonArray(early), jsonArray(late));
}

}  // namespace rtsg
