// NodeArena: memory for nodes, cut from chunks that grow with the scene; freed blocks are used again by their size.
//
// Chunks of 2 MiB and more ask for huge pages: a scene of a million nodes then needs hundreds of address translations
// instead of ten thousands, which is most of what a write at random costs. Smaller chunks are parts of such pages that
// the process's scenes share (chunk_pool.h). Blocks are 16-byte aligned. Threading: one.
// Beside it the arena has a thread of its own while it gets much memory at once, which the system fills with zeros: for
// a million nodes as much work as all else. Both take pages in turn: whoever comes to one that the other is at makes
// the next one ready meanwhile, as two that ask for the same page both fill one.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <thread>
#include <vector>

#include "chunk_pool.h"

namespace rtsg {

class NodeArena {
  public:
    void* allocate(std::size_t bytes) {
        const std::size_t grains = (bytes + kGrain - 1) / kGrain, size = grains * kGrain;
        if (size > left_ || (grains < free_.size() && free_[grains])) return allocateElsewhere(grains);
        void* block = next_;
        next_ += size;
        left_ -= size;
        return block;
    }
    /// `bytes` as given to allocate.
    void deallocate(void* block, std::size_t bytes);
    /// So much will be asked for soon: a lot of it is made ready meanwhile.
    void expect(std::size_t bytes);

  private:
    static constexpr std::size_t kGrain = 16, kHugePage = ChunkPool::kPage;
    struct Free {
        Free* next;
    };
    struct Release {
        std::size_t ofPool = 0;  // bytes; 0: of the system
        void operator()(std::byte* chunk) const;
    };
    /// A chunk of which pages are made ready as they are needed, and before.
    struct Expected {
        std::byte* chunk = nullptr;
        std::size_t pages = 0;
        std::unique_ptr<std::atomic<bool>[]> ready;
        std::atomic<std::size_t> next = 0;  // that nobody has taken
        std::atomic<bool> refused = false;  // systems before Linux 5.14 do
        /// The next one that is left; false if none is.
        bool makeReady();
    };
    void* allocateElsewhere(std::size_t grains);
    void grow(std::size_t bytes);
    std::byte* takeChunk(std::size_t size);
    bool enterPage();

    std::vector<std::unique_ptr<std::byte, Release>> chunks_;
    std::vector<Free*> free_;  // by size in grains
    std::byte* next_ = nullptr;
    std::size_t left_ = 0, lastChunk_ = 0;
    std::unique_ptr<Expected> expected_;
    std::size_t entered_ = 0;  // pages of it
    std::jthread filler_;      // the last member: it ends before its chunk goes
};

}  // namespace rtsg
