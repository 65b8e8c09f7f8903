// Whether and how a long list of numbers is read by several threads.
//
// Threading: a value.
#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>

namespace rtsg::detail {

struct Splitting {
    unsigned threads = 1;                      // that work on it, the reader's own among them
    std::size_t from = std::size_t{4} << 20;   // bytes of text: a shorter list is read by one
    std::size_t piece = std::size_t{1} << 17;  // bytes of text that a thread takes at a time
};

/// Splitting for so many threads; 0: as many as the processor runs. More than 8 are useless, since one of them fetches
/// the text for all, and each takes memory for reading ahead.
inline Splitting splitting(unsigned threads) {
    constexpr unsigned maximum = 8;
    if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
    return {.threads = std::min(threads, maximum)};
}

}  // namespace rtsg::detail
