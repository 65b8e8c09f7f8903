// NodeArena: memory for nodes, cut from chunks that grow with the scene; freed blocks are used again by their size.
//
// Chunks of 2 MiB and more ask for huge pages: a scene of a million nodes then needs hundreds of address translations
// instead of ten thousands, which is most of what a write at random costs. Blocks are 16-byte aligned. Threading: one.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace rtsg {

class NodeArena {
  public:
    void* allocate(std::size_t bytes);
    /// `bytes` as given to allocate.
    void deallocate(void* block, std::size_t bytes);

  private:
    static constexpr std::size_t kGrain = 16, kSmallest = std::size_t{1} << 14, kHugePage = std::size_t{1} << 21;
    struct Free {
        Free* next;
    };
    struct Release {
        void operator()(std::byte* chunk) const;
    };
    void grow(std::size_t bytes);

    std::vector<std::unique_ptr<std::byte, Release>> chunks_;
    std::vector<Free*> free_;  // by size in grains
    std::byte* next_ = nullptr;
    std::size_t left_ = 0, lastChunk_ = 0;
};

}  // namespace rtsg
