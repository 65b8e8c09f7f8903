// Compaction: writes a shorter log from a log: a span of time, merged frames, no damage, other keyframes and codings.
//
// Invariant: every state that is kept has its number, time and hash, and verifies. diffLogs() of both logs finds at
// most that the new one ends earlier. The states between are lost, and in merged frames the order of events, so a rerun
// (replay_test.h) needs the original. Where fields are left out, states have their numbers and times, and the hashes of
// scenes in which these fields never changed.
// Threading: the calling thread.
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <rtsg/sync/log.h>

namespace rtsg {

struct CompactOptions {
    /// Seconds. The first state kept is the last one not after `from`; the last state kept is the last one not after
    /// `to`.
    double from = -std::numeric_limits<double>::infinity(), to = std::numeric_limits<double>::infinity();
    /// Merges this many frames into one.
    std::uint64_t every = 1;
    /// Merges frames that are less than this apart in scene time, in seconds.
    double interval = 0;
    /// The fields whose changes are kept or left out: "DOOR.rotation", "DOOR.*", "*.rotation", "#12.translation";
    /// empty: all are kept. A field that is left out keeps the value of the first state, or of the state in which its
    /// node came. Nodes, their names, routes and lists of nodes are always kept.
    std::vector<std::string> only{}, without{};
    LogOptions log;  // for the new log
    /// Called from time to time with the bytes read and their total. If it returns false, compaction stops and nothing
    /// is written.
    std::function<bool(std::uint64_t, std::uint64_t)> progress{};
};

struct CompactReport {
    std::uint64_t statesRead = 0, statesWritten = 0;
    std::uint64_t bytesRead = 0, bytesWritten = 0;
    std::uint64_t damaged = 0;  // places in the old log that could not be read
    std::uint64_t gaps = 0;     // times that frames were missing in the part that was kept
    /// What the old log lacked first in that part; the new log lacks it, too. Empty if the log is complete.
    std::string lacks{};
};

/// Writes `out` in one step at the end. Errors: `out` exists and must be kept, `out` is `in`, a file cannot be read or
/// written, a state does not have the recorded hash, no state has a field that is named.
Result<CompactReport> compactLog(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const CompactOptions& options = {});

}  // namespace rtsg
