// Reads and prints dates in UTC.
#include "start_time.h"

#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "cli.h"

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
    if (!good) throw UsageError(text, "expected seconds since 1970, a date such as 2026-11-20T12:00:00Z, or now");
    return static_cast<double>(sys_days(date).time_since_epoch().count()) * 86400 + hour * 3600 + minute * 60 + second;
}

double parseMoment(const std::string& text, double start) {
    const bool isDate = text.size() >= 10 && text[4] == '-' && text[7] == '-';
    if (!isDate) return parseSeconds(text);
    const double moment = parseDate(text) - start;
    if (moment < 0) throw UsageError(text, "that is before the start, " + dateText(start));
    return moment;
}

std::string dateText(double secondsSince1970) {
    using namespace std::chrono;
    constexpr double kLast = 253'402'300'799;  // the end of 9999
    if (!(secondsSince1970 >= 0 && secondsSince1970 <= kLast)) return fmt::format("{} s", secondsSince1970);
    const auto all = static_cast<std::int64_t>(std::round(secondsSince1970 * 1e6));
    const std::int64_t whole = all / 1'000'000, micro = all % 1'000'000;
    const year_month_day date{sys_days(days(whole / 86400))};
    std::string text = fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}", static_cast<int>(date.year()),
                                   static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                                   whole / 3600 % 24, whole / 60 % 60, whole % 60);
    if (micro != 0) {
        text += fmt::format(".{:06}", micro);
        text.erase(text.find_last_not_of('0') + 1);
    }
    return text + "Z";
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
