// Cuts blocks for nodes from growing chunks, and keeps freed blocks by size.
#include "node_arena.h"

#include <algorithm>
#include <cstdlib>
#include <new>
#include <system_error>

#include <sys/mman.h>

namespace rtsg {

void NodeArena::Release::operator()(std::byte* chunk) const {
    if (ofPool > 0)
        ChunkPool::ofProcess().giveBack(chunk, ofPool);
    else
        std::free(chunk);
}

/// `size`: below that of a huge page, or a multiple of it.
std::byte* NodeArena::takeChunk(std::size_t size) {
    auto& owner = chunks_.emplace_back();
    if (size < kHugePage) {
        owner = {ChunkPool::ofProcess().take(size), Release{size}};
    } else {
        owner.reset(static_cast<std::byte*>(std::aligned_alloc(kHugePage, size)));
        if (!owner) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
        (void)madvise(owner.get(), size, MADV_HUGEPAGE);  // advice: without it all is well, only slower
#endif
    }
    next_ = owner.get();
    left_ = size;
    return next_;
}

void NodeArena::grow(std::size_t bytes) {
    const std::size_t wanted = std::max({bytes, ChunkPool::kSmallest, std::min(2 * lastChunk_, kHugePage)});
    const std::size_t unit = wanted < kHugePage ? ChunkPool::kSmallest : kHugePage;
    lastChunk_ = (wanted + unit - 1) / unit * unit;
    takeChunk(lastChunk_);
}

bool NodeArena::Expected::makeReady() {
#ifdef MADV_POPULATE_WRITE
    const std::size_t page = next.fetch_add(1, std::memory_order_relaxed);
    if (page >= pages) return false;
    if (madvise(chunk + page * kHugePage, kHugePage, MADV_POPULATE_WRITE) != 0) refused = true;
    ready[page].store(true, std::memory_order_release);
    return true;
#else
    return false;
#endif
}

void NodeArena::expect(std::size_t bytes) {
#ifdef MADV_POPULATE_WRITE
    constexpr std::size_t kPays = 8 * kHugePage;  // for a thread
    // Memory that was prepared earlier and has not been used counts.
    const std::size_t unentered = expected_ ? (expected_->pages - entered_) * kHugePage : 0;
    if (bytes < left_ + unentered + kPays || std::thread::hardware_concurrency() < 2) return;
    const std::size_t pages = (bytes + kHugePage - 1) / kHugePage;
    auto fresh = std::make_unique<Expected>();
    fresh->pages = pages;
    fresh->ready = std::make_unique<std::atomic<bool>[]>(pages);
    fresh->chunk = takeChunk(pages * kHugePage);
    left_ = 0;     // page by page
    filler_ = {};  // the memory expected before
    expected_ = std::move(fresh);
    entered_ = 0;
    try {
        filler_ = std::jthread([expected = expected_.get()](const std::stop_token& stop) {
            while (!stop.stop_requested() && !expected->refused && expected->makeReady()) continue;
        });
    } catch (const std::system_error&) {
        expected_->refused = true;  // there are no more threads: who writes there waits for every page
    }
#else
    (void)bytes;
#endif
}

/// The next page of the expected memory is about to be written to. False if there is none.
bool NodeArena::enterPage() {
    if (!expected_ || entered_ == expected_->pages) return false;
    const std::size_t page = entered_++;
    left_ += kHugePage;
    while (!expected_->refused && !expected_->ready[page].load(std::memory_order_acquire))
        if (!expected_->makeReady()) break;
    return true;
}

/// Takes a freed block, or memory of the next page or chunk.
void* NodeArena::allocateElsewhere(std::size_t grains) {
    if (grains < free_.size() && free_[grains]) {
        Free* block = free_[grains];
        free_[grains] = block->next;
        return block;
    }
    const std::size_t size = grains * kGrain;
    while (size > left_ && enterPage()) continue;
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
