// The figures that a report has, in order, and how they are written.
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

    std::string title() const {
        return unit.empty() ? std::string(name) : std::string(name) + ", " + std::string(unit);
    }
};

inline constexpr std::array<ReportFigure, 8> kReportFigures{{{"EDT_s", "EDT", "s", &RoomMetrics::edt, 3},
                                                             {"T20_s", "T20", "s", &RoomMetrics::t20, 3},
                                                             {"T30_s", "T30", "s", &RoomMetrics::t30, 3},
                                                             {"C50_db", "C50", "dB", &RoomMetrics::c50, 2},
                                                             {"C80_db", "C80", "dB", &RoomMetrics::c80, 2},
                                                             {"D50", "D50", "", &RoomMetrics::d50, 3},
                                                             {"Ts_s", "Ts", "s", &RoomMetrics::ts, 4},
                                                             {"G_db", "G", "dB", &RoomMetrics::g, 2}}};

/// A dash for what is no number.
std::string reportNumber(double value, int digits);

/// How many bands were computed, in words.
std::string bandsText(const RoomReport& report);

/// The bands that decay with more than one slope, in words; empty if there are none.
std::string slopesText(const MetricsEstimate& metrics);

/// With what would steer a terminal or break a page shown as a question mark.
inline std::string printable(std::string_view text) {
    std::string result(text);
    for (char& c : result)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
    return result;
}

}  // namespace rtsg
