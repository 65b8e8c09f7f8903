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
                       "a keyframe once the frames since the last take so much and twice its size, as 1MB; damage to a "
                       "log costs at most what is between two")
            ->bytes()
            ->preset();
        command
            .addOption("--keyframe-seconds", seconds,
                       "and after so much scene time, rarer only where keyframes would take over 1 MiB a second; 0: "
                       "not for that")
            ->preset();
    }
    /// Throws UsageError.
    void setIn(LogOptions& options) const {
        options.keyframeBytes = bytes;
        options.keyframeSeconds = parseSeconds(seconds);
    }
};

}  // namespace rtsg::app
