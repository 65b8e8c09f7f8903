// Counts what one thread takes from the heap. It is malloc itself that counts, as arrays come from calloc, not from
// operator new: one source of a test program includes counting_malloc.h.
#pragma once

#include <cstddef>
#include <cstdlib>

#include "support/own_heap.h"

namespace rtsg::test {
inline thread_local bool countsHeap = false;
inline thread_local std::size_t takenFromHeap = 0;

/// How often a piece of work takes something from the heap. Precondition: RTSG_HEAP_IS_OURS.
template <class Work>
std::size_t allocationsOf(const Work& work) {
    takenFromHeap = 0;
    countsHeap = true;
    work();
    countsHeap = false;
    return takenFromHeap;
}
}  // namespace rtsg::test
