// A session taken up again from its log, after the process that ran it has ended, in whatever way.
//
// The scene is brought to the last state in the log, with the node numbers, types and routes it had, and its behaviours
// go on from there. A MirrorServer and a LogWriter that are given the same epoch continue what their predecessors were.
// What no log holds is lost: variables of scripts (they are initialised again), requests of peers that had no verdict
// yet. Threading: the scene's thread.

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
    double start = 0, end = 0;  // scene times of the session's first state, in whatever piece, and its last; seconds
    std::uint64_t damaged = 0;  // places of the log that could not be read
    std::uint64_t gaps = 0;     // times that states were missing
    bool closed = false;        // it had been ended in order
    /// The file that its last state was in: the log, or the piece before it if that was cut before its first state.
    std::filesystem::path file;
    /// The last sets before the present state, oldest first: for MirrorServerOptions::before.
    std::vector<std::shared_ptr<const ChangeSet>> before;
};

struct ResumeOptions {
    /// Of `before`: at most so many changes, and sets.
    std::size_t mostChanges = std::size_t{1} << 20, mostSets = 4096;
    std::function<void(std::uint64_t, std::uint64_t)> progress;  // bytes read, and all there are
};

/// Precondition: `scene` is empty, as constructed. Errors: nothing intact in the log; a last state whose hash is not
/// the one that its origin had: then going on would be going on with something else.
Result<ResumedSession> resumeSession(const std::filesystem::path& log, Scene& scene, const ResumeOptions& options = {});

}  // namespace rtsg
