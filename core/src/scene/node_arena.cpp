// Cuts blocks for nodes from growing chunks, and keeps what is freed by size.
#include "node_arena.h"

#include <algorithm>
#include <cstdlib>
#include <new>

#include <sys/mman.h>

namespace rtsg {

void NodeArena::Release::operator()(std::byte* chunk) const {
    std::free(chunk);
}

void NodeArena::grow(std::size_t bytes) {
    const std::size_t wanted = std::max({bytes, kSmallest, std::min(2 * lastChunk_, kHugePage)});
    const bool huge = wanted >= kHugePage;
    const std::size_t alignment = huge ? kHugePage : std::size_t{64};
    const std::size_t size = (wanted + alignment - 1) / alignment * alignment;
    auto* chunk = static_cast<std::byte*>(std::aligned_alloc(alignment, size));
    if (!chunk) throw std::bad_alloc();
    chunks_.emplace_back(chunk);
#ifdef MADV_HUGEPAGE
    if (huge) (void)madvise(chunk, size, MADV_HUGEPAGE);  // advice: without it all is well, only slower
#endif
    next_ = chunk;
    left_ = lastChunk_ = size;
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
