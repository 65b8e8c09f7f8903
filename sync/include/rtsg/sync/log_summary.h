// LogSummary: the content of a log: its size, its times, its nodes, and its damage.
//
// It reads every record once and applies only the last state, so it takes the memory of one scene for a log of any
// length.
// Threading: the calling thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include <rtsg/sync/log.h>

namespace rtsg {

struct LogSummary {
    std::uint64_t bytes = 0;
    std::uint64_t states = 0;     // that a replay goes through: each session's first, and one a frame
    std::uint64_t frames = 0;     // change sets, and inputs that replace one
    std::uint64_t keyframes = 0;  // whole states; one written twice counts once
    std::uint64_t inputs = 0;     // records with the input of a frame
    std::uint64_t sessions = 0;   // runs of a scene, one after the other
    std::uint64_t firstState = 0, lastState = 0;
    double start = 0, end = 0;  // seconds, as Replayer::time()
    std::uint64_t damaged = 0, damagedBytes = 0;
    std::uint64_t gaps = 0, missingFrames = 0;  // times that frames are missing, and how many frames
    std::uint64_t framesBehind = 0;             // Replayer::framesBehind(): pieces are in the wrong order
    bool closed = false;                        // it ends with its index, so its writer closed it
    bool goesOn = false;                        // it is a piece that has a later piece
    bool beingWritten = false;
    std::string creator, mode, coding;
    std::map<std::string, std::size_t> types;  // nodes of the last state
    std::size_t nodes = 0;
};

/// True if the file begins as a log does. False for files of writeSceneFile(), though they consist of the same records.
bool isLog(const std::filesystem::path& file);
/// Errors: there is no such file, or it has no intact record. Damage is not an error.
Result<LogSummary> summariseLog(const std::filesystem::path& file);

}  // namespace rtsg
