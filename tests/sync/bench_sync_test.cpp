// The benchmarks must keep running and keep verifying; what they measure is not judged here.
#include <gtest/gtest.h>

#include "bench/bench_sync.h"

namespace rtsg {
namespace {

TEST(BenchSync, RunsAndVerifiesAtASmallSize) {
    bench::SyncSizes sizes;
    sizes.transforms = 200;
    sizes.frames = 20;
    sizes.roundTrips = 20;
    sizes.hourFrames = 600;
    sizes.joinNodes = 1000;
    sizes.peers = 4;
    int lines = 0;
    EXPECT_TRUE(bench::sync(sizes, [&](const bench::Line& line) {
        ++lines;
        EXPECT_GT(line.value, 0) << line.name << " " << line.metric;
    }));
    EXPECT_GE(lines, 27);
}

}  // namespace
}  // namespace rtsg
