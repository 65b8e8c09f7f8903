// Memory for nodes: blocks lie apart, are used again by their size, and are the same whether they were expected or not.
#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "storage/node_arena.h"
#include "support/no_threads.h"

namespace rtsg {
namespace {

constexpr std::size_t kBlock = 160, kMany = 400'000;  // 64 MB: expected by a thread of its own

/// Each filled with its number.
std::vector<std::byte*> filled(NodeArena& arena, std::size_t count) {
    std::vector<std::byte*> blocks;
    for (std::size_t i = 0; i < count; ++i) {
        blocks.push_back(static_cast<std::byte*>(arena.allocate(kBlock)));
        std::memset(blocks.back(), static_cast<int>(i % 251), kBlock);
    }
    return blocks;
}

void expectTheirNumbers(const std::vector<std::byte*>& blocks) {
    for (std::size_t i = 0; i < blocks.size(); ++i)
        for (const std::size_t at : {std::size_t{0}, kBlock - 1})
            ASSERT_EQ(std::to_integer<std::size_t>(blocks[i][at]), i % 251) << "block " << i;
}

TEST(NodeArena, WhatIsExpectedIsWrittenWhileItIsMadeReady) {
    NodeArena arena;
    arena.expect(kBlock * kMany);
    expectTheirNumbers(filled(arena, kMany));
}

TEST(NodeArena, MoreAndLessThanExpectedMayCome) {
    for (const std::size_t count : {std::size_t{0}, std::size_t{1}, kMany + kMany / 2}) {
        NodeArena arena;
        const auto before = filled(arena, 1000);
        arena.expect(kBlock * kMany);
        const auto after = filled(arena, count);
        expectTheirNumbers(before);
        expectTheirNumbers(after);
        arena.expect(kBlock * kMany);  // again, while the first may not be ready yet
        expectTheirNumbers(filled(arena, 1000));
        expectTheirNumbers(after);
    }
}

TEST(NodeArena, WhatIsExpectedWithoutAThreadIsThereAllTheSame) {
    const test::NoThreads none;
    NodeArena arena;
    arena.expect(kBlock * kMany);
    expectTheirNumbers(filled(arena, kMany));
}

TEST(NodeArena, AFreedBlockIsUsedAgainByItsSize) {
    NodeArena arena;
    void* const small = arena.allocate(32);
    void* const large = arena.allocate(kBlock);
    arena.deallocate(small, 32);
    arena.deallocate(large, kBlock);
    EXPECT_EQ(arena.allocate(kBlock), large);
    EXPECT_EQ(arena.allocate(32), small);
    EXPECT_NE(arena.allocate(32), small);
}

TEST(NodeArena, LittleThatIsExpectedTakesNoMemoryOfItsOwn) {
    NodeArena arena;
    arena.expect(1000);
    auto* const first = static_cast<std::byte*>(arena.allocate(kBlock));
    EXPECT_EQ(static_cast<std::byte*>(arena.allocate(kBlock)) - first, std::ptrdiff_t{kBlock});
}

TEST(NodeArena, WhatIsExpectedAgainAndNotNeededIsThereOnce) {
    NodeArena arena;
    const std::size_t much = std::size_t{20} << 20;
    arena.expect(much);
    auto* const first = static_cast<std::byte*>(arena.allocate(kBlock));
    // In a scene where many nodes go and as many come, new ones take freed blocks.
    for (int i = 0; i < 10; ++i) {
        arena.expect(much - (std::size_t{4} << 20));
        EXPECT_EQ(static_cast<std::byte*>(arena.allocate(kBlock)) - first, (i + 1) * std::ptrdiff_t{kBlock});
    }
}

}  // namespace
}  // namespace rtsg
