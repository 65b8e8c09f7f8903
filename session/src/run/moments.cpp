// Reads durations and dates as people type them, and prints dates in UTC.
#include <rtsg/session/moments.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include <rtsg/session/notices.h>

namespace rtsg {

namespace {

std::unexpected<Diagnostic> wrong(const std::string& text, const std::string& why) {
    return fail(kUsageCode, text + ": " + why);
}

/// Parses minutes:seconds or hours:minutes:seconds; returns nothing for other texts.
std::optional<double> clockSeconds(const std::string& text) {
    if (text.find(':') == text.npos || text.find_first_not_of("0123456789:.") != text.npos) return std::nullopt;
    const char *at = text.data(), *const last = at + text.size();
    double seconds = 0;
    for (int parts = 1; parts <= 3; ++parts) {
        double part = 0;
        const auto [end, error] = std::from_chars(at, last, part, std::chars_format::fixed);
        const bool whole = std::find(at, end, '.') == end;
        if (error != std::errc() || (parts > 1 && part >= 60)) return std::nullopt;
        seconds = 60 * seconds + part;
        if (end == last) return parts > 1 && seconds <= 1e9 ? std::optional(seconds) : std::nullopt;
        if (*end != ':' || !whole) return std::nullopt;
        at = end + 1;
    }
    return std::nullopt;
}

}  // namespace

double systemTime() {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Result<double> secondsIn(const std::string& text) {
    if (const auto clock = clockSeconds(text)) return *clock;
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
    const double scale = unit == "ms"                  ? 1e-3
                         : unit.empty() || unit == "s" ? 1
                         : unit == "min"               ? 60
                         : unit == "h"                 ? 3600
                                                       : 0;
    if (error != std::errc() || scale == 0 || !(value >= 0) || value > 1e9)
        return wrong(text, "expected a duration such as 2s, 500ms, 1.5, 10min, 1h or 1:30");
    return value * scale;
}

Result<double> dateIn(const std::string& text) {
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
    if (!good) return wrong(text, "expected seconds since 1970, a date such as 2026-11-20T12:00:00Z, or now");
    return static_cast<double>(sys_days(date).time_since_epoch().count()) * 86400 + hour * 3600 + minute * 60 + second;
}

Result<double> momentIn(const std::string& text, double start) {
    const bool isDate = text.size() >= 10 && text[4] == '-' && text[7] == '-';
    if (!isDate) return secondsIn(text);
    const auto date = dateIn(text);
    if (date && *date < start) return wrong(text, "that is before the start, " + dateText(start));
    return date ? Result<double>(*date - start) : date;
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

}  // namespace rtsg
