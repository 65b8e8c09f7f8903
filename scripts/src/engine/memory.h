// Measures the memory that the programs of one context hold: objects on the engine's heap, their contents outside of it
// (of arrays, strings and names), and compiled code.
//
// The engine's gauges lack objects that it has not looked at since they were made, and programs' code. The memory of
// the process lacks nothing, but includes other threads and garbage. So the gauges show where scripts certainly hold
// too much, the process where they may; then a collection and the engine's own count of everything decide. Invariant:
// no program is ended without that count. Threading: the context's thread.
#pragma once

#include <time.h>

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "values.h"

namespace rtsg::script {

/// Nanoseconds of a clock that never goes back.
inline std::int64_t steadyNow() {
    return std::chrono::steady_clock::now().time_since_epoch().count();
}
/// The CPU time of this thread in nanoseconds, which does not depend on other load of the machine.
inline std::int64_t ownTime() {
    timespec now{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

class Memory {
  public:
    /// Inside a realm of the context whose memory this is.
    explicit Memory(JSContext* cx);
    /// Whether the memory that is held stays within `limit` bytes.
    bool within(std::size_t limit);
    /// Does what within() does, but only if the last look was some milliseconds before `now`; for the end of short
    /// calls.
    bool withinForNow(std::size_t limit, std::int64_t now);

  private:
    std::size_t gauged();
    void count();

    JSContext* cx_;
    JS::PersistentRootedObject gauge_;
    JS::PersistentRootedId outside_;  // the name of the gauge of the memory outside the heap
    std::size_t compiled_ = 0;        // programs' code, as of the last count
    std::size_t counted_ = 0;         // all of it, then
    std::size_t resident_ = 0;        // of the process, then, or the least since
    std::int64_t lookedAt_ = 0;
};

}  // namespace rtsg::script
