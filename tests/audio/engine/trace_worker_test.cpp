// How much of the time tracing takes beside live sound.
#include <gtest/gtest.h>

#include "engine/trace_worker.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

TEST(TraceWorker, LeavesSoundItsCoreAndAlwaysTracesSome) {
    EXPECT_EQ(tracingShare(0), .5);
    EXPECT_EQ(tracingShare(.3), .5);
    EXPECT_NEAR(tracingShare(.5), .3, 1e-12);
    EXPECT_EQ(tracingShare(.65), .2);
    EXPECT_EQ(tracingShare(3), .2);
}

TEST(TraceWorker, RestsAsLongAsItsShareSaysButNotForLong) {
    EXPECT_EQ(restAfter(40ms, .5), 40ms);
    EXPECT_NEAR(std::chrono::duration<double>(restAfter(40ms, .2)).count(), .16, 1e-6);
    EXPECT_EQ(restAfter(2s, .5), 1s);
    EXPECT_EQ(restAfter(0ms, .2), 0ms);
}

}  // namespace
}  // namespace rtsg
