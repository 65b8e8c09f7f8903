// Rows in columns: what is put in for some of eight lanes is what comes out, in their order.
#include <bit>
#include <cstring>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "lighting/lane_gather.h"
#include "path/lane_queue.h"

namespace rtsg::trace {
namespace {

using simd::F8;

TEST(LaneQueue, PacksEverySetOfLanesInItsOrder) {
    const F8 numbers{10, 11, 12, 13, 14, 15, 16, 17};
    for (std::uint32_t lanes = 0; lanes < 256; ++lanes) {
        const F8 packed = Packing(lanes)(numbers);
        int to = 0;
        for (int lane = 0; lane < 8; ++lane)
            if (lanes >> lane & 1u) {
                EXPECT_EQ(packed[to++], numbers[lane]) << lanes;
            }
    }
}

TEST(LaneQueue, KeepsRowsWhileItGrowsAndGivesThemBack) {
    constexpr std::size_t kQueueColumns = 5;
    LaneQueue queue(kQueueColumns);
    std::vector<std::vector<float>> expected(kQueueColumns);
    std::mt19937 random(3);
    for (int round = 0; round < 4000; ++round) {
        const std::uint32_t lanes = random() & 0xFFu;
        queue.reserve(8);
        const auto rows = queue.add(lanes);
        for (std::size_t c = 0; c < kQueueColumns; ++c) {
            F8 numbers;
            for (int lane = 0; lane < 8; ++lane) {
                numbers[lane] = static_cast<float>(random() % 100'000);
                if (lanes >> lane & 1u) expected[c].push_back(numbers[lane]);
            }
            rows.put(c, numbers);
        }
        if (round % 3 == 0) {
            queue.reserve(1);
            const std::size_t row = queue.addOne();
            for (std::size_t c = 0; c < kQueueColumns; ++c) {
                expected[c].push_back(static_cast<float>(round));
                queue.set(c, row, static_cast<float>(round));
            }
        }
        if (round % 7 == 0 && queue.size() > 3) {
            queue.drop(3);
            for (auto& column : expected) column.resize(column.size() - 3);
        }
        ASSERT_EQ(queue.size(), expected[0].size());
    }
    ASSERT_GT(queue.size(), 10'000u);
    for (std::size_t c = 0; c < kQueueColumns; ++c)
        for (std::size_t row = 0; row < queue.size(); ++row) ASSERT_EQ(queue.number(c, row), expected[c][row]);
}

TEST(LaneQueue, KeepsBitsThatAreNoNumbers) {
    LaneQueue queue(1);
    queue.reserve(1);
    const std::size_t row = queue.addOne();
    queue.set(0, row, 0x7f800001u);  // a NaN that signals
    EXPECT_EQ(queue.bits(0, row), 0x7f800001u);
}

TEST(LaneGather, ReadsFourNumbersAtEachPlaceAndAddsToThem) {
    std::vector<float> memory(100);
    for (std::size_t i = 0; i < memory.size(); ++i) memory[i] = static_cast<float>(i);
    const int starts[8] = {40, 3, 0, 96, 17, 60, 8, 75};
    const float* positions[8];
    for (int i = 0; i < 8; ++i) positions[i] = &memory[static_cast<std::size_t>(starts[i])];
    const simd::Q8 q = simd::gather4(positions);
    for (int i = 0; i < 8; ++i) {
        const auto first = static_cast<float>(starts[i]);
        EXPECT_EQ(q.x[i], first);
        EXPECT_EQ(q.y[i], first + 1);
        EXPECT_EQ(q.z[i], first + 2);
        EXPECT_EQ(q.w[i], first + 3);
    }
    // Two lanes may add to one place; what is left out is not looked at.
    std::vector<float> sums(8, 1.0f);
    float* targets[8] = {&sums[0], nullptr, &sums[4], &sums[0], nullptr, nullptr, nullptr, &sums[4]};
    simd::addTo(targets, 0x8D, {q.x, q.y, q.z, q.w});
    EXPECT_EQ(sums[0], 1 + 40 + 96);
    EXPECT_EQ(sums[3], 1 + 43 + 99);
    EXPECT_EQ(sums[4], 1 + 0 + 75);
    EXPECT_EQ(sums[7], 1 + 3 + 78);
}

}  // namespace
}  // namespace rtsg::trace
