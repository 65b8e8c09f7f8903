// What is in a log: how much, of what, over which time, and what of it is damaged.
//
// Reads every record once, and applies the last state only; a log of any length takes the memory of its scene.
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
    std::uint64_t frames = 0;     // change sets, and inputs that stand in for one
    std::uint64_t keyframes = 0;  // whole states, those written twice counted once
    std::uint64_t inputs = 0;     // records of what came into a frame
    std::uint64_t sessions = 0;   // runs of a scene, one after the other
    std::uint64_t firstState = 0, lastState = 0;
    double start = 0, end = 0;  // seconds, as Replayer::time()
    std::uint64_t damaged = 0, damagedBytes = 0;
    std::uint64_t gaps = 0, missingFrames = 0;  // times that frames are missing, as Replayer::gaps(); how many
    std::uint64_t framesBehind = 0;             // as Replayer::framesBehind(): pieces in another order
    bool closed = false;                        // it ends with its index: the writer came to its end
    bool goesOn = false;                        // it is a piece that another one follows
    bool beingWritten = false;
    std::string creator, mode, coding;
    std::map<std::string, std::size_t> types;  // nodes of the last state
    std::size_t nodes = 0;
};

/// Whether the file begins as a log does; what writeSceneFile() writes is none, though it is made of the same records.
bool isLog(const std::filesystem::path& file);
/// Errors: no such file, or not one intact record in it. Damage is none.
Result<LogSummary> summariseLog(const std::filesystem::path& file);

}  // namespace rtsg
