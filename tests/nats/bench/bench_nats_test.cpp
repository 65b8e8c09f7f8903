// The benchmark must keep running and keep verifying; what it measures is not judged here.
#include "bench/bench_nats.h"

#include "nats/nats_support.h"

namespace rtsg {
namespace {

class BenchNats : public test::WithNats {};

TEST_F(BenchNats, RunsAndVerifiesAtASmallSize) {
    bench::SyncSizes sizes;
    sizes.peers = 3;
    sizes.frames = 40;
    int lines = 0;
    EXPECT_TRUE(bench::natsCrowd(sizes, [&](const bench::Line& line) {
        ++lines;
        EXPECT_GT(line.value, 0) << line.name << " " << line.metric;
        EXPECT_GT(line.baseline, 0) << line.name << " " << line.metric;
    }));
    EXPECT_EQ(lines, 6);
}

}  // namespace
}  // namespace rtsg
