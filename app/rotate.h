// --rotate and --keep: logs in pieces, for the verbs that write long ones.
#pragma once

#include <charconv>
#include <string>
#include <utility>

#include <rtsg/sync/log.h>

#include "cli.h"

namespace rtsg::app {

struct RotateArguments {
    std::string rotate, keep;

    void addTo(Command& command) {
        command.addOption(
            "--rotate", rotate,
            "begin a new file after so much, as 1GB or 10min: NAME.0001.rlog and so on are the ones before");
        command.addOption("--keep", keep, "with --rotate: only what happened in the last so many seconds, as 1h");
    }
    /// Throws UsageError.
    void setIn(LogOptions& options) const {
        if (!keep.empty() && rotate.empty()) throw UsageError("--keep", "needs --rotate: whole files are let go");
        if (!keep.empty()) options.keepSeconds = seconds("--keep", keep);
        if (rotate.empty()) return;
        for (const auto& [unit, bytes] : {std::pair{"kB", 1e3}, std::pair{"MB", 1e6}, std::pair{"GB", 1e9}})
            if (rotate.ends_with(unit)) {
                options.rotateBytes = static_cast<std::uint64_t>(number("--rotate", rotate, 2) * bytes);
                return;
            }
        options.rotateSeconds = seconds("--rotate", rotate);
    }

  private:
    static double number(const char* option, const std::string& text, std::size_t unit) {
        double value = 0;
        const char* const last = text.data() + text.size() - unit;
        const auto [end, problem] = std::from_chars(text.data(), last, value);
        if (problem != std::errc() || end != last || !(value > 0 && value < 1e12))
            throw UsageError(option, text + ": expected a size or a time, as 1GB or 10min");
        return value;
    }
    static double seconds(const char* option, const std::string& text) {
        if (text.ends_with("min")) return 60 * number(option, text, 3);
        if (text.ends_with("h")) return 3600 * number(option, text, 1);
        return number(option, text, text.ends_with("s") ? 1 : 0);
    }
};

}  // namespace rtsg::app
