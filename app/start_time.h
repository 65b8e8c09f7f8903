// --at and --clip: where a scene's clock stands when a verb begins to run it, and which of its animations plays.
//
// A scene's time is seconds since 1970 (ISO/IEC 19775-1 V4.0, 8.2.2); what people type and read counts from the start.
// Threading: none of its own.
#pragma once

#include <string>

#include "command.h"

namespace rtsg::app {

/// The start of simulated time unless --at says otherwise: 2000-01-01, the same in every run. It is a whole number of
/// days after 1970, so a loop that divides a day (1 s, 2.5 s, 12 s …) is at its beginning when it starts at 0.
inline constexpr double kSimulatedStart = 946'684'800;

struct StartTime {
    enum class Kind : std::uint8_t { simulated, live } kind = Kind::simulated;
    std::string at, clip;

    void addTo(Command& command);
    /// Seconds since 1970. Throws UsageError.
    double seconds() const;
};

/// Of verbs that read a scene without running it.
void addClip(Command& command, std::string& clip);

/// "2026-11-20T12:00:00Z" for seconds since 1970, with as many decimals as it has, to a microsecond. What is no date
/// (before 1970, after 9999) is left as a number: "1e+20 s".
std::string dateText(double secondsSince1970);
/// Seconds since 1970 of "1234.5", "2026-11-20", "2026-11-20T12:00:00Z" or "now". Throws UsageError.
double parseDate(const std::string& text);

}  // namespace rtsg::app
