// Compaction: a log again, shorter: from and to a time, frames merged, damage left out, keyframes and codings as asked.
//
// Invariant: every state that is kept has its number, time and hash, and verifies; diffLogs() of the two finds nothing
// but where the shorter one ends. What is lost are the states between, and with merged frames the order of events
// inside them, so that a rerun (replay_test.h) needs the original. Threading: the calling thread.
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <string>

#include <rtsg/sync/log.h>

namespace rtsg {

struct CompactOptions {
    /// Seconds. The first state kept is the last one not after `from`, the last one not after `to`.
    double from = -std::numeric_limits<double>::infinity(), to = std::numeric_limits<double>::infinity();
    /// So many frames become one.
    std::uint64_t every = 1;
    /// Frames that lie less than this apart in scene time become one, seconds.
    double interval = 0;
    LogOptions log;  // of the new one
    /// Called now and then with the bytes read and all there are; false stops, and nothing is written.
    std::function<bool(std::uint64_t, std::uint64_t)> progress{};
};

struct CompactReport {
    std::uint64_t statesRead = 0, statesWritten = 0;
    std::uint64_t bytesRead = 0, bytesWritten = 0;
    std::uint64_t damaged = 0;  // places in the old log that could not be read
    std::uint64_t gaps = 0;     // times that frames were missing in the part of it that was kept
    /// What the old log lacked first, in that part, and the new one does too; empty: nothing, it is complete.
    std::string lacks{};
};

/// Writes `out` in one step, at the end. Errors: `out` is there and to be kept, `out` is `in`, files that cannot be
/// read or written, a state that does not have the hash recorded.
Result<CompactReport> compactLog(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const CompactOptions& options = {});

}  // namespace rtsg
