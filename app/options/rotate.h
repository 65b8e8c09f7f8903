// --rotate, --keep and --free: divide logs into pieces, for verbs that write long ones.
#pragma once

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <rtsg/sync/log.h>

#include "cli.h"

namespace rtsg::app {

struct RotateArguments {
    std::string rotate, keep, free;

    void addTo(Command& command) {
        const Command::Section section(command, "Log");
        command.addOption("--rotate", rotate,
                          "begin a new file after this much, such as 1GB, 10min, 30s or 500ms; earlier ones become "
                          "NAME.0001.rlog and so on");
        command.addOption("--keep", keep,
                          "keep only the newest files: this much in all, such as 100GB (--rotate is then a twentieth "
                          "by default), or, with --rotate, those of the last 1h, 10min or 30s");
        command.addOption("--free", free,
                          "keep only the newest files, so that this share of the disk stays free, such as 5%; with "
                          "--rotate or --keep");
    }
    /// Throws UsageError if the name of the log is empty. What its store can do is said by checkLogUse().
    void check(const std::string& log) const {
        if (wanted() && log.empty()) throw UsageError(asked(""), "needs --record: there is no log");
    }
    /// Throws UsageError.
    void setIn(LogOptions& options) const {
        const std::optional<double> maximum = keep.empty() ? std::nullopt : bytesIn("--keep", keep);
        if (!keep.empty() && !maximum && rotate.empty())
            throw UsageError("--keep", "a time needs --rotate: whole files are let go");
        if (maximum) {
            constexpr double kFiles = 20;
            options.keepBytes = static_cast<std::uint64_t>(std::max(1.0, *maximum));
            options.rotateBytes = static_cast<std::uint64_t>(std::max(1.0, *maximum / kFiles));
        } else if (!keep.empty()) {
            options.keepSeconds = seconds("--keep", keep, "a size or a time, as 100GB or 1h");
        }
        if (!free.empty()) {
            if (rotate.empty() && !maximum) throw UsageError("--free", "needs --rotate: whole files are let go");
            if (!free.ends_with('%')) throw UsageError("--free", free + ": expected a share of the disk, as 5%");
            options.keepFree = number("--free", free, 1, "a share of the disk, as 5%") / 100;
            if (options.keepFree >= 1) throw UsageError("--free", free + ": less than all of it");
        }
        if (rotate.empty()) return;
        options.rotateBytes = 0;
        if (const auto size = bytesIn("--rotate", rotate))
            options.rotateBytes = static_cast<std::uint64_t>(std::max(1.0, *size));
        else
            options.rotateSeconds = seconds("--rotate", rotate, "a size or a time, as 1GB or 10min");
    }
    bool wanted() const { return !rotate.empty() || !keep.empty(); }
    /// The option that asks for pieces; `none` if none does.
    const char* asked(const char* none) const { return !rotate.empty() ? "--rotate" : !keep.empty() ? "--keep" : none; }

    /// Refuses to add to the pieces of another recording.
    Result<> checkPieces(const std::string& log, bool force) const {
        if (log.empty() || !wanted() || force) return {};
        const auto pieces = recordedPieces(log);
        if (pieces.empty()) return {};
        return fail(fmt::format("a piece of an earlier recording is there already{}; --force replaces {}",
                                pieces.size() > 1 ? fmt::format(", and {} more to {}", pieces.size() - 1,
                                                                pieces.back().filename().string())
                                                  : "",
                                pieces.size() > 1 ? "them" : "it"),
                    {}, pieces.front().string());
    }

  private:
    /// "1GB" as bytes; nothing for a time.
    static std::optional<double> bytesIn(const char* option, const std::string& text) {
        for (const auto& [unit, bytes] : {std::pair{"kB", 1e3}, std::pair{"MB", 1e6}, std::pair{"GB", 1e9},
                                          std::pair{"TB", 1e12}, std::pair{"B", 1.}})
            if (text.ends_with(unit))
                return bytes * number(option, text, std::string_view(unit).size(), "a size or a time, as 1GB or 10min");
        return std::nullopt;
    }
    static double number(const char* option, const std::string& text, std::size_t unit, const char* expected) {
        double value = 0;
        const char* const last = text.data() + text.size() - unit;
        const auto [end, problem] = std::from_chars(text.data(), last, value);
        if (problem != std::errc() || end != last || !(value > 0 && value < 1e12))
            throw UsageError(option, text + ": expected " + expected);
        return value;
    }
    static double seconds(const char* option, const std::string& text, const char* expected) {
        if (text.ends_with("ms")) return number(option, text, 2, expected) / 1000;
        if (text.ends_with("min")) return 60 * number(option, text, 3, expected);
        if (text.ends_with("h")) return 3600 * number(option, text, 1, expected);
        return number(option, text, text.ends_with("s") ? 1 : 0, expected);
    }
};

}  // namespace rtsg::app
