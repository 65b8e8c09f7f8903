// Dates as people write them, in UTC.
#include "start_time.h"

#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>

namespace rtsg::app {

namespace {

double systemTime() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace

double parseDate(const std::string& text) {
    using namespace std::chrono;
    if (text == "now") return systemTime();
    double seconds = 0;
    const char* const last = text.data() + text.size();
    if (const auto [end, error] = std::from_chars(text.data(), last, seconds);
        error == std::errc() && end == last && seconds >= 0 && seconds < 1e12)
        return seconds;
    int y = 0, hour = 0, minute = 0;
    unsigned month = 0, day = 0;
    double second = 0;
    int used = 0;
    const char* const given = text.c_str();
    bool good = std::sscanf(given, "%4d-%2u-%2u%n", &y, &month, &day, &used) == 3;
    if (good && given[used] == 'T') {
        int more = 0;
        good = std::sscanf(given + used, "T%2d:%2d%n", &hour, &minute, &more) == 2;
        used += more;
        if (good && given[used] == ':') {
            good = std::sscanf(given + used, ":%lf%n", &second, &more) == 1;
            used += more;
        }
        if (good && given[used] == 'Z') ++used;
    }
    const year_month_day date{year(y), std::chrono::month(month), std::chrono::day(day)};
    good = good && given[used] == 0 && date.ok() && y >= 1970 && hour >= 0 && hour < 24 && minute >= 0 && minute < 60 &&
           second >= 0 && second < 60;
    if (!good)
        throw UsageError("--at", text + ": expected seconds since 1970, a date such as 2026-11-20T12:00:00Z, or now");
    return static_cast<double>(sys_days(date).time_since_epoch().count()) * 86400 + hour * 3600 + minute * 60 + second;
}

void StartTime::addTo(Command& command) {
    command.addOption("--at", at,
                      kind == Kind::live ? "the scene's time at the start: seconds since 1970 or a date; else now"
                                         : "the scene's time at the start: seconds since 1970, a date, or now; else "
                                           "2000-01-01, always the same");
    addClip(command, clip);
}

void addClip(Command& command, std::string& clip) {
    command.addOption("--clip", clip, "the animation of a glTF file that plays, by its name; else the first");
}

double StartTime::seconds() const {
    if (!at.empty()) return parseDate(at);
    return kind == Kind::live ? systemTime() : kSimulatedStart;
}

}  // namespace rtsg::app
