// Chunks of pages that scenes share: they lie apart, come back, and pages go when nothing of them is in use.
#include <cstdint>
#include <cstring>
#include <random>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "storage/chunk_pool.h"
#include "storage/node_arena.h"

namespace rtsg {
namespace {

constexpr std::size_t kSlot = ChunkPool::kSmallest, kSlots = ChunkPool::kPage / kSlot;

struct Chunk {
    std::byte* at = nullptr;
    std::size_t bytes = 0;
    unsigned char mark = 0;
};

/// Its first and last byte, which no other chunk has written.
bool isComplete(const Chunk& chunk) {
    return std::to_integer<unsigned char>(chunk.at[0]) == chunk.mark &&
           std::to_integer<unsigned char>(chunk.at[chunk.bytes - 1]) == chunk.mark;
}

Chunk marked(ChunkPool& pool, std::size_t bytes, unsigned char mark) {
    const Chunk result{pool.take(bytes), bytes, mark};
    std::memset(result.at, mark, bytes);
    return result;
}

TEST(ChunkPool, ChunksOfAllSizesLieApart) {
    std::mt19937 random(20261128);
    ChunkPool pool;
    std::vector<Chunk> chunks;
    for (int i = 0; i < 3000; ++i) {
        if (chunks.size() > 60 || (!chunks.empty() && random() % 3 == 0)) {
            const std::size_t which = random() % chunks.size();
            ASSERT_TRUE(isComplete(chunks[which])) << "step " << i;
            pool.giveBack(chunks[which].at, chunks[which].bytes);
            chunks.erase(chunks.begin() + static_cast<std::ptrdiff_t>(which));
            continue;
        }
        const std::size_t bytes = 1 + random() % (random() % 8 == 0 ? ChunkPool::kPage : 6 * kSlot);
        chunks.push_back(marked(pool, bytes, static_cast<unsigned char>(i)));
        ASSERT_EQ(reinterpret_cast<std::uintptr_t>(chunks.back().at) % 64, 0U);
    }
    for (const Chunk& chunk : chunks) {
        EXPECT_TRUE(isComplete(chunk));
        pool.giveBack(chunk.at, chunk.bytes);
    }
    EXPECT_EQ(pool.pages(), 1U);
}

TEST(ChunkPool, APageIsFilledBeforeTheNextOneComes) {
    ChunkPool pool;
    std::vector<std::byte*> chunks;
    for (std::size_t i = 0; i < kSlots; ++i) chunks.push_back(pool.take(kSlot));
    EXPECT_EQ(pool.pages(), 1U);
    chunks.push_back(pool.take(1));
    EXPECT_EQ(pool.pages(), 2U);
    // A chunk given back to a full page is used again.
    pool.giveBack(chunks[5], kSlot);
    std::byte* const again = pool.take(kSlot);
    EXPECT_TRUE(again == chunks[5] || again == chunks.back() + kSlot);
    for (std::size_t i = 0; i < kSlots - 2; ++i) pool.take(kSlot);
    EXPECT_EQ(pool.pages(), 2U);
}

TEST(ChunkPool, TheLastPageStaysAndTheOthersGo) {
    ChunkPool pool;
    std::byte* const first = pool.take(ChunkPool::kPage);
    std::byte* const second = pool.take(ChunkPool::kPage / 2 + 1);
    EXPECT_EQ(pool.pages(), 2U);
    pool.giveBack(first, ChunkPool::kPage);
    EXPECT_EQ(pool.pages(), 1U);
    pool.giveBack(second, ChunkPool::kPage / 2 + 1);
    EXPECT_EQ(pool.pages(), 1U);
    EXPECT_EQ(pool.take(ChunkPool::kPage), second);  // all of it
}

TEST(ChunkPool, ScenesOfManyThreadsShareIt) {
    std::vector<std::jthread> threads;
    std::vector<int> wrong(4);
    for (std::size_t t = 0; t < wrong.size(); ++t)
        threads.emplace_back([&wrong, t] {
            for (int round = 0; round < 50; ++round) {
                NodeArena arena;
                std::vector<std::byte*> blocks;
                for (int i = 0; i < 1500; ++i) {
                    blocks.push_back(static_cast<std::byte*>(arena.allocate(176)));
                    std::memset(blocks.back(), static_cast<int>(t + 1), 176);
                }
                for (const std::byte* block : blocks)
                    if (std::to_integer<std::size_t>(block[100]) != t + 1) ++wrong[t];
            }
        });
    threads.clear();
    for (const int count : wrong) EXPECT_EQ(count, 0);
}

TEST(ChunkPool, AnArenaGivesBackWhatItTook) {
    ChunkPool& pool = ChunkPool::ofProcess();
    const std::size_t before = pool.pages();
    for (int i = 0; i < 100; ++i) {
        NodeArena arena;
        for (int n = 0; n < 6000; ++n) arena.allocate(160);
    }
    EXPECT_LE(pool.pages(), before + 1);
}

}  // namespace
}  // namespace rtsg
