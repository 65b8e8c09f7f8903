// Cuts chunks for small scenes from huge pages that all scenes of the process share.
#include "chunk_pool.h"

#include <cstdint>
#include <cstdlib>
#include <new>
#include <optional>

#include <sys/mman.h>

namespace rtsg {

namespace {

constexpr std::size_t slotsOf(std::size_t bytes) {
    return (bytes + ChunkPool::kSmallest - 1) / ChunkPool::kSmallest;
}

/// Finds the first `count` free slots in a row that start at a multiple of the power of two that holds so many, so that
/// freed slots fit again.
template <std::size_t size>
std::optional<std::size_t> firstFree(const std::bitset<size>& used, std::size_t count) {
    const std::bitset<size> row = ~std::bitset<size>() >> (size - count);
    std::size_t step = 1;
    while (step < count) step *= 2;
    for (std::size_t first = 0; first + count <= size; first += step)
        if ((used >> first & row).none()) return first;
    return std::nullopt;
}

std::byte* newPage() {
    auto* page = static_cast<std::byte*>(std::aligned_alloc(ChunkPool::kPage, ChunkPool::kPage));
    if (!page) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
    (void)madvise(page, ChunkPool::kPage, MADV_HUGEPAGE);  // advice: without it all is well, only slower
#endif
    return page;
}

}  // namespace

ChunkPool& ChunkPool::ofProcess() {
    static auto* pool = new ChunkPool;
    return *pool;
}

ChunkPool::~ChunkPool() {
    for (const Pages* pages : {&open_, &full_})
        for (const auto& [page, used] : *pages) std::free(page);
}

std::byte* ChunkPool::takeFrom(Pages::iterator page, std::size_t slots) {
    const std::optional<std::size_t> first = firstFree(page->second, slots);
    if (!first) return nullptr;
    std::byte* const chunk = page->first + *first * kSmallest;
    for (std::size_t i = 0; i < slots; ++i) page->second.set(*first + i);
    if (page->second.all()) full_.insert(open_.extract(page));
    return chunk;
}

std::byte* ChunkPool::take(std::size_t bytes) {
    const std::size_t slots = slotsOf(bytes);
    const std::lock_guard lock(mutex_);
    for (auto page = open_.begin(); page != open_.end(); ++page)
        if (std::byte* chunk = takeFrom(page, slots)) return chunk;
    return takeFrom(open_.emplace(newPage(), Slots()).first, slots);
}

/// The last page stays, for scenes that come and go.
void ChunkPool::giveBack(std::byte* chunk, std::size_t bytes) {
    const std::size_t offset = reinterpret_cast<std::uintptr_t>(chunk) % kPage;
    std::byte* const begin = chunk - offset;
    const std::lock_guard lock(mutex_);
    if (const auto full = full_.find(begin); full != full_.end()) open_.insert(full_.extract(full));
    const auto page = open_.find(begin);
    for (std::size_t i = 0; i < slotsOf(bytes); ++i) page->second.reset(offset / kSmallest + i);
    if (page->second.any() || open_.size() + full_.size() == 1) return;
    open_.erase(page);
    std::free(begin);
}

std::size_t ChunkPool::pages() const {
    const std::lock_guard lock(mutex_);
    return open_.size() + full_.size();
}

}  // namespace rtsg
