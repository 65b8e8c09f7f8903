// Merging: writes one log of two, whose scenes stand side by side in one.
//
// The scene has two Transforms at its root, A and B, with what stands at the roots of the two logs. Names at the top
// level of the first log begin with A_, those of the second with B_; names inside of Inlines and PROTO instances stay,
// as do the scopes that they are in. What is bound, and all else that the root itself has, is the first log's.
// Invariant: a state of the merged log holds the states that both logs had at its time. Threading: the calling thread.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <rtsg/sync/log.h>

namespace rtsg {

struct MergeOptions {
    /// Logs are laid beside each other by their scenes' own times, as of two recordings of one evening; else from the
    /// start of each.
    bool bySceneTime = false;
    /// Where B is beside A, in metres along x.
    float apart = 0;
    LogOptions log;  // for the new log
    /// Told the bytes read of both logs, and their total; false ends it, and nothing is written.
    std::function<bool(std::uint64_t, std::uint64_t)> progress{};
};

struct MergeReport {
    std::uint64_t statesRead = 0, statesWritten = 0;
    /// What one of the logs lacks; the new log lacks it, too. Empty if both are whole.
    std::string lacks{};
};

/// Writes `out` in one step at the end. Errors: a file cannot be read or written, `out` exists and must be kept or is
/// one of the logs, a state does not have the recorded hash, a log begins anew within itself: frames are missing in it,
/// or it has several sessions.
Result<MergeReport> mergeLogs(const std::filesystem::path& a, const std::filesystem::path& b,
                              const std::filesystem::path& out, const MergeOptions& options = {});

}  // namespace rtsg
