// `rtsg bench structure --quick` comes to its end, with a line for each edit and each type.
#include <gtest/gtest.h>

#include "bench/bench.h"
#include "support/own_heap.h"

namespace rtsg::bench {
namespace {

TEST(BenchStructure, QuickGivesALineForEachEditAndType) {
    std::vector<Line> lines;
    structure([&](const Line& line) { lines.push_back(line); }, true);
    ASSERT_EQ(lines.size(), 2u * 5 + 4);
    for (const Line& line : lines) {
        if (line.unit == "bytes" && !RTSG_HEAP_IS_OURS) continue;
        EXPECT_GT(line.value, 0) << line.name;
    }
}

}  // namespace
}  // namespace rtsg::bench
