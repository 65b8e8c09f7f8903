// Session: resumes a session from its log after its process has ended, for whatever reason.
//
// resumeSession() brings the scene to the last state in the log, with the same node numbers, types and routes, and its
// behaviours go on from there. A MirrorServer and a LogWriter that get the same epoch continue those of the ended
// process. Lost is what no log holds: variables of scripts (scripts are initialised again), and requests of peers that
// had no verdict yet.
// Threading: the scene's thread.

// Example:
//     #include <rtsg/sync/log.h>
//     #include <rtsg/sync/mirror_server.h>
//     #include <rtsg/sync/session.h>
//     rtsg::Scene scene;
//     const auto session = rtsg::resumeSession("hall.rlog", scene);
//     if (!session) return;
//     rtsg::LogOptions log;
//     log.append = true, log.epoch = session->epoch;
//     rtsg::MirrorServerOptions server;
//     server.epoch = session->epoch, server.before = session->before;
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

struct ResumedSession {
    std::uint64_t epoch = 0;
    std::uint64_t states = 0;   // in the log
    double start = 0, end = 0;  // scene times in seconds: the session's first state, in whatever piece, and its last
    std::uint64_t damaged = 0;  // places of the log that could not be read
    std::uint64_t gaps = 0;     // times that states were missing
    bool closed = false;        // the session was ended in order
    /// The file with its last state: the log, or the piece before it if the log was cut before its first state.
    std::filesystem::path file;
    /// The last sets before the present state, oldest first: for MirrorServerOptions::before.
    std::vector<std::shared_ptr<const ChangeSet>> before;
};

struct ResumeOptions {
    /// Bounds of `before`: the most changes and the most sets.
    std::size_t maxChanges = std::size_t{1} << 20, maxSets = 4096;
    std::function<void(std::uint64_t, std::uint64_t)> progress;  // called with the bytes read and their total
};

/// Precondition: `scene` is empty, as constructed. Errors: nothing intact in the log; the last state does not have the
/// origin's hash, so the session could not be continued faithfully.
Result<ResumedSession> resumeSession(const std::filesystem::path& log, Scene& scene, const ResumeOptions& options = {});

}  // namespace rtsg
