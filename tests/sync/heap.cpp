// Replaces malloc and operator new of this test program, unless a sanitizer has them.
#include "sync/heap.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>

#include <malloc.h>
#include <pthread.h>

namespace {

thread_local bool counting = false;
thread_local long long held = 0, maximum = 0;
std::atomic<const char*> failing{nullptr};

[[maybe_unused]] void taken(void* block) {
    if (!counting || !block) return;
    held += static_cast<long long>(malloc_usable_size(block));
    maximum = std::max(maximum, held);
}
[[maybe_unused]] void given(void* block) {
    if (counting && block) held -= static_cast<long long>(malloc_usable_size(block));
}
[[maybe_unused]] bool fails() {
    const char* name = failing.load(std::memory_order_relaxed);
    char own[16] = {};
    return name && ::pthread_getname_np(::pthread_self(), own, sizeof(own)) == 0 && std::strcmp(own, name) == 0;
}

}  // namespace

#if RTSG_HEAP_IS_OURS
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void __libc_free(void* block);
void* malloc(std::size_t size) noexcept {
    void* block = __libc_malloc(size);
    taken(block);
    return block;
}
void* calloc(std::size_t count, std::size_t size) noexcept {
    void* block = __libc_calloc(count, size);
    taken(block);
    return block;
}
void* realloc(void* block, std::size_t size) noexcept {
    given(block);
    void* moved = __libc_realloc(block, size);
    taken(moved);
    return moved;
}
void free(void* block) noexcept {
    given(block);
    __libc_free(block);
}
}
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"  // all of them are malloc's and free's
void* operator new(std::size_t size) {
    if (fails()) throw std::bad_alloc();
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    return std::malloc(size ? size : 1);  // libzmq's own: it ends the process where there is none
}
void operator delete(void* memory) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}
#endif

namespace rtsg::test {

HeapCount::HeapCount() {
    held = maximum = 0;
    counting = true;
}
HeapCount::~HeapCount() {
    counting = false;
}
std::size_t HeapCount::peak() const {
    return static_cast<std::size_t>(maximum);
}

FailingHeap::FailingHeap(const char* thread) {
    failing = thread;
}
FailingHeap::~FailingHeap() {
    failing = nullptr;
}

}  // namespace rtsg::test
