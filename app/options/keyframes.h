// --keyframe-bytes and --keyframe-seconds: the distance between keyframes, for verbs that write a log.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/sync/log.h>

#include "cli.h"

namespace rtsg::app {

struct KeyframeArguments {
    std::uint64_t bytes = LogOptions().keyframeBytes;
    std::string seconds = "10s";

    void addTo(Command& command) {
        const Command::Section section(command, "Log");
        command
            .addOption("--keyframe-bytes", bytes,
                       "write a keyframe once the frames since the last one take this much and twice its size, such as "
                       "1MB; damage to a log costs at most the frames between two")
            ->bytes()
            ->preset();
        command
            .addOption(
                "--keyframe-seconds", seconds,
                "and after this much scene time, less often if keyframes would take over 1 MiB a second; 0: never")
            ->preset();
    }
    /// Throws UsageError.
    void setIn(LogOptions& options) const {
        options.keyframeBytes = bytes;
        options.keyframeSeconds = parseSeconds(seconds);
    }
};

}  // namespace rtsg::app
