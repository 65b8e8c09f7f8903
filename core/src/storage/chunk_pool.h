// ChunkPool: memory for the chunks of scenes that fill no huge page (2 MiB) by themselves, cut from pages that all
// scenes of the process share.
//
// The nodes of small scenes would otherwise lie in many small pages. Finding such a page takes the processor longer
// than the write if the scene was not used a moment ago: with a thousand replicas in turn, that is most of the cost of
// a write. Threading: any.
#pragma once

#include <bitset>
#include <cstddef>
#include <map>
#include <mutex>

namespace rtsg {

class ChunkPool {
  public:
    static constexpr std::size_t kPage = std::size_t{1} << 21;  // bytes
    static constexpr std::size_t kSmallest = std::size_t{1} << 14;

    /// The one of all scenes. It is never destroyed: scenes of static storage may end after anything else.
    static ChunkPool& ofProcess();

    ChunkPool() = default;
    ~ChunkPool();
    ChunkPool(const ChunkPool&) = delete;
    ChunkPool& operator=(const ChunkPool&) = delete;

    /// Aligned to 64 bytes; the content is undefined. `bytes`: 1 to kPage. Throws std::bad_alloc.
    std::byte* take(std::size_t bytes);
    /// `bytes` as given to take.
    void giveBack(std::byte* chunk, std::size_t bytes);
    /// The pages that it holds, in use or not.
    std::size_t pages() const;

  private:
    static constexpr std::size_t kSlots = kPage / kSmallest;
    using Slots = std::bitset<kSlots>;
    using Pages = std::map<std::byte*, Slots>;  // where each begins, and which of its slots are in use

    std::byte* takeFrom(Pages::iterator page, std::size_t slots);

    mutable std::mutex mutex_;
    Pages open_, full_;  // with a free slot, and without
};

}  // namespace rtsg
