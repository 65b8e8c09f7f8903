// The figures of a report, in order, and their formats.
//
// Threading: constants and pure functions.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include <rtsg/audio/room_report.h>

namespace rtsg {

struct ReportFigure {
    std::string_view key, name, unit;
    Bands RoomMetrics::* values;
    int digits;
    /// Octaves whose mean is its single number, the first and the last (ISO 3382-1:2009, table A.1; Hidaka et al. 1995
    /// for IACC).
    int first = kBand1k - 1, last = kBand1k;

    std::string title() const {
        return unit.empty() ? std::string(name) : std::string(name) + ", " + std::string(unit);
    }
    double single(const RoomMetrics& metrics) const {
        double sum = 0;
        for (int b = first; b <= last; ++b) sum += (metrics.*values)[static_cast<std::size_t>(b)];
        return sum / (last - first + 1);
    }
};

inline constexpr std::array<ReportFigure, 11> kReportFigures{
    {{"EDT_s", "EDT", "s", &RoomMetrics::edt, 3},
     {"T20_s", "T20", "s", &RoomMetrics::t20, 3},
     {"T30_s", "T30", "s", &RoomMetrics::t30, 3},
     {"C50_db", "C50", "dB", &RoomMetrics::c50, 2},
     {"C80_db", "C80", "dB", &RoomMetrics::c80, 2},
     {"D50", "D50", "", &RoomMetrics::d50, 3},
     {"Ts_s", "Ts", "s", &RoomMetrics::ts, 4},
     {"G_db", "G", "dB", &RoomMetrics::g, 2},
     {"LF", "LF", "", &RoomMetrics::lf, 3, kBand1k - 3, kBand1k},
     {"IACC_early", "IACC E", "", &RoomMetrics::iaccEarly, 3, kBand1k - 1, kBand1k + 1},
     {"IACC_late", "IACC L", "", &RoomMetrics::iaccLate, 3, kBand1k - 1, kBand1k + 1}}};

/// A dash for a value that is not finite.
std::string reportNumber(double value, int digits);

/// How many bands were computed, in words.
std::string bandsText(const RoomReport& report);

/// The bands that decay with more than one slope, in words; empty if there are none.
std::string slopesText(const MetricsEstimate& metrics);

/// Why a pair has no reverberation time at 1 kHz; empty if it has one, or for other reasons.
std::string escapeText(const RoomReport::Pair& pair);

/// How loud speech is, and what noise there is, in words.
std::string speechText(const SpeechOptions& speech);

/// Shows characters that would control a terminal or break a page as question marks.
inline std::string printable(std::string_view text) {
    std::string result(text);
    for (char& c : result)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
    return result;
}

}  // namespace rtsg
