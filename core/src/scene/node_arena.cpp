// Cuts blocks for nodes from growing chunks, and keeps what is freed by size.
#include "node_arena.h"

#include <algorithm>
#include <cstdlib>
#include <new>
#include <system_error>

#include <sys/mman.h>

namespace rtsg {

void NodeArena::Release::operator()(std::byte* chunk) const {
    std::free(chunk);
}

std::byte* NodeArena::takeChunk(std::size_t size, bool huge) {
    auto* chunk = static_cast<std::byte*>(std::aligned_alloc(huge ? kHugePage : std::size_t{64}, size));
    if (!chunk) throw std::bad_alloc();
    chunks_.emplace_back(chunk);
#ifdef MADV_HUGEPAGE
    if (huge) (void)madvise(chunk, size, MADV_HUGEPAGE);  // advice: without it all is well, only slower
#endif
    next_ = chunk;
    left_ = size;
    return chunk;
}

void NodeArena::grow(std::size_t bytes) {
    const std::size_t wanted = std::max({bytes, kSmallest, std::min(2 * lastChunk_, kHugePage)});
    const bool huge = wanted >= kHugePage;
    const std::size_t alignment = huge ? kHugePage : std::size_t{64};
    lastChunk_ = (wanted + alignment - 1) / alignment * alignment;
    takeChunk(lastChunk_, huge);
}

void NodeArena::expect(std::size_t bytes) {
#ifdef MADV_POPULATE_WRITE
    constexpr std::size_t kPays = 8 * kHugePage;  // for a thread
    if (bytes < left_ + kPays || std::thread::hardware_concurrency() < 2) return;
    const std::size_t size = (bytes + kHugePage - 1) / kHugePage * kHugePage;
    std::byte* const chunk = takeChunk(size, true);
    try {
        filler_ = std::jthread([chunk, size](const std::stop_token& stop) {
            // In steps, so that who writes there meanwhile waits for one at most. Systems before Linux 5.14 refuse.
            for (std::size_t done = 0; done < size && !stop.stop_requested(); done += kHugePage)
                if (madvise(chunk + done, kHugePage, MADV_POPULATE_WRITE) != 0) return;
        });
    } catch (const std::system_error&) {
        return;  // there are no more threads: who writes there waits for every page
    }
#else
    (void)bytes;
#endif
}

void* NodeArena::allocate(std::size_t bytes) {
    const std::size_t grains = (bytes + kGrain - 1) / kGrain;
    if (grains < free_.size() && free_[grains]) {
        Free* block = free_[grains];
        free_[grains] = block->next;
        return block;
    }
    const std::size_t size = grains * kGrain;
    if (size > left_) grow(size);
    void* block = next_;
    next_ += size;
    left_ -= size;
    return block;
}

void NodeArena::deallocate(void* block, std::size_t bytes) {
    const std::size_t grains = (bytes + kGrain - 1) / kGrain;
    if (grains >= free_.size()) free_.resize(grains + 1);
    free_[grains] = new (block) Free{free_[grains]};
}

}  // namespace rtsg
