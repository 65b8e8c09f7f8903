// Merging: writes one log of two, with their scenes side by side in one scene.
//
// The merged scene has two Transforms at its root, A and B, which hold the root nodes of the two logs. Names at the top
// level of the first log get the prefix A_, those of the second B_; names inside of Inlines and PROTO instances are
// unchanged. Bound nodes, and all other fields of the root, are those of the first log. Invariant: a state of the
// merged log holds the states that both logs had at its time. Threading: the calling thread.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <rtsg/sync/log.h>

namespace rtsg {

struct MergeOptions {
    /// True: the logs are aligned by scene time, for two recordings of the same event. False: both begin at time 0.
    bool bySceneTime = false;
    /// The distance of B from A, in metres along x.
    float apart = 0;
    LogOptions log;  // for the new log
    /// Called with the bytes read of both logs, and their total; if it returns false, merging stops and nothing is
    /// written.
    std::function<bool(std::uint64_t, std::uint64_t)> progress{};
};

struct MergeReport {
    std::uint64_t statesRead = 0, statesWritten = 0;
    /// The first place where one of the logs is incomplete; the new log is incomplete there, too. Empty if both are
    /// complete.
    std::string lacks{};
};

/// Writes `out` in one step at the end. Errors: a file cannot be read or written; `out` exists and must be kept, or is
/// one of the logs; a state does not have the recorded hash; a log has missing frames or several sessions.
Result<MergeReport> mergeLogs(const std::filesystem::path& a, const std::filesystem::path& b,
                              const std::filesystem::path& out, const MergeOptions& options = {});

}  // namespace rtsg
