// --at and --clip: the time of a scene's clock when a verb begins to run it, and which of its animations plays.
//
// A scene's time is in seconds since 1970 (ISO/IEC 19775-1 V4.0, 8.2.2). Users type and read times from the start.
// Threading: none of its own.
#pragma once

#include <string>

#include <rtsg/session/moments.h>
#include <rtsg/session/running_scene.h>

#include "command.h"

namespace rtsg::app {

/// The default start of simulated time: 2000-01-01, the same in every run. It is a whole number of days after 1970. So
/// a loop whose length divides a day (1 s, 2.5 s, 12 s …) is at its beginning then.
inline constexpr double kSimulatedStart = 946'684'800;

struct StartTime {
    enum class Kind : std::uint8_t { simulated, live } kind = Kind::simulated;
    std::string at, clip;

    void addTo(Command& command);
    /// Throws UsageError.
    SceneStart options() const;
    double seconds() const { return options().time; }
};

/// For verbs that read a scene without running it.
void addClip(Command& command, std::string& clip);

/// As dateIn() and momentIn(). Throw UsageError.
double parseDate(const std::string& text);
double parseMoment(const std::string& text, double start);

}  // namespace rtsg::app
