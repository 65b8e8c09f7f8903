// What the programs of one context hold: objects on the engine's heap, what hangs from them outside of it (the contents
// of arrays, strings and names), and what they have compiled.
//
// The engine's gauges leave out what it has not looked at since it was made, and programs' code. What the process takes
// in memory leaves out nothing, but other threads and rubbish are in it. So the first say where scripts certainly hold
// too much, the second where that may be; then a collection and the engine's own count of everything decide.
// Invariant: nobody is found guilty without that count. Threading: the context's thread.
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
/// Of this thread, in nanoseconds: what others do with the machine is no part of it.
inline std::int64_t ownTime() {
    timespec now{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

class Memory {
  public:
    /// Inside a realm of the context whose memory this is.
    explicit Memory(JSContext* cx);
    /// Whether what is held stays within `limit` bytes.
    bool within(std::size_t limit);
    /// As within(), but looks only if at `now` the last look is some milliseconds ago: for the end of short calls.
    bool withinForNow(std::size_t limit, std::int64_t now);

  private:
    std::size_t gauged();
    void count();

    JSContext* cx_;
    JS::PersistentRootedObject gauge_;
    JS::PersistentRootedId outside_;  // the name of the gauge of what lies outside of the heap
    std::size_t compiled_ = 0;        // programs' code, as of the last count
    std::size_t counted_ = 0;         // all of it, then
    std::size_t resident_ = 0;        // of the process, then, or the least since
    std::int64_t lookedAt_ = 0;
};

}  // namespace rtsg::script
