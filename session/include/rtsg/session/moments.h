// Moments: durations, dates and moments of a scene as people type them.
//
// A scene's time is in seconds since 1970 (ISO/IEC 19775-1 V4.0, 8.2.2). People type and read times from the start.
// Errors have the code kUsageCode (notices.h) and begin with the text. Threading: none.
#pragma once

#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// "2s", "500ms", "1.5" (seconds), "10min", "1h", "1:30" (minutes and seconds), "1:02:03.5".
Result<double> secondsIn(const std::string& text);
/// "1234.5", "2026-11-20", "2026-11-20T12:00:00Z" or "now", as seconds since 1970.
Result<double> dateIn(const std::string& text);
/// A moment of something that begins at `start`, in seconds since 1970: a duration or a date. Returns seconds from the
/// start. A date before it is an error, too.
Result<double> momentIn(const std::string& text, double start);
/// Formats seconds since 1970 as "2026-11-20T12:00:00Z", with the decimals that it has, to a microsecond. Times before
/// 1970 or after 9999 stay numbers: "1e+20 s".
std::string dateText(double secondsSince1970);
/// The present time in seconds since 1970.
double systemTime();

}  // namespace rtsg
