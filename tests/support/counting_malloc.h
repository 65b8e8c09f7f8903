// The malloc that counts for counted_heap.h: for one source of a test program.
#pragma once

#include "support/counted_heap.h"

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
