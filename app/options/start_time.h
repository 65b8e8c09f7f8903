// --at and --clip: the time of a scene's clock when a verb begins to run it, and which of its animations plays.
//
// A scene's time is in seconds since 1970 (ISO/IEC 19775-1 V4.0, 8.2.2). Users type and read times from the start.
// Threading: none of its own.
#pragma once

#include <string>

#include "command.h"

namespace rtsg::app {

/// The default start of simulated time: 2000-01-01, the same in every run. It is a whole number of days after 1970. So
/// a loop whose length divides a day (1 s, 2.5 s, 12 s …) is at its beginning then.
inline constexpr double kSimulatedStart = 946'684'800;

struct StartTime {
    enum class Kind : std::uint8_t { simulated, live } kind = Kind::simulated;
    std::string at, clip;

    void addTo(Command& command);
    /// Seconds since 1970. Throws UsageError.
    double seconds() const;
};

/// For verbs that read a scene without running it.
void addClip(Command& command, std::string& clip);

/// Formats seconds since 1970 as "2026-11-20T12:00:00Z", with the decimals that it has, to a microsecond. Times before
/// 1970 or after 9999 stay numbers: "1e+20 s".
std::string dateText(double secondsSince1970);
/// Parses "1234.5", "2026-11-20", "2026-11-20T12:00:00Z" or "now" to seconds since 1970. Throws UsageError.
double parseDate(const std::string& text);
/// A moment of something that begins at `start`, in seconds since 1970: as parseSeconds() has it, or a date. Returns
/// seconds from the start. Throws UsageError, also for a date before it.
double parseMoment(const std::string& text, double start);

}  // namespace rtsg::app
