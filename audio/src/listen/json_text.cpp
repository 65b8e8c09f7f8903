// Writes numbers and figures as JSON.
#include "json_text.h"

#include <cmath>

#include <fmt/format.h>

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
    return fmt::format(
        "\"EDT_s\":{},\"T20_s\":{},\"T30_s\":{},\"C50_db\":{},\"C80_db\":{},\"D50\":{},\"Ts_s\":{},\"G_db\":{}",
        jsonArray(m.edt), jsonArray(m.t20), jsonArray(m.t30), jsonArray(m.c50), jsonArray(m.c80), jsonArray(m.d50),
        jsonArray(m.ts), jsonArray(m.g));
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
