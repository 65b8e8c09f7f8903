// The heap of this test program: counted for one thread, and failing on demand for another.
#pragma once

#include <cstddef>

#include "support/own_heap.h"

namespace rtsg::test {

/// While it lives, counts what the calling thread holds beyond what it held before. One at a time for each thread.
class HeapCount {
  public:
    HeapCount();
    ~HeapCount();
    HeapCount(const HeapCount&) = delete;
    HeapCount& operator=(const HeapCount&) = delete;
    /// The most at any time so far, bytes, as the allocator rounds them.
    std::size_t peak() const;
};

/// While it lives, operator new fails on all threads of this name (pthread_setname_np).
class FailingHeap {
  public:
    explicit FailingHeap(const char* thread);
    ~FailingHeap();
    FailingHeap(const FailingHeap&) = delete;
    FailingHeap& operator=(const FailingHeap&) = delete;
};

}  // namespace rtsg::test
