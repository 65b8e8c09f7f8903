// Counts what one thread takes from the heap. For one source of a test program: it is malloc itself that counts, as
// arrays come from calloc, not from operator new.
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

#if RTSG_HEAP_IS_OURS
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* malloc(std::size_t size) noexcept {
    if (rtsg::test::countsHeap) ++rtsg::test::takenFromHeap;
    return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
    if (rtsg::test::countsHeap) ++rtsg::test::takenFromHeap;
    return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
    if (rtsg::test::countsHeap) ++rtsg::test::takenFromHeap;
    return __libc_realloc(block, size);
}
}
#endif
