// How much of the time tracing takes beside live sound, and how energy is kept from one trace to the next.
#include <cmath>

#include <gtest/gtest.h>

#include "audio/trace/walled.h"
#include "engine/trace_worker.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

TEST(TraceWorker, LeavesSoundItsCoreAndAlwaysTracesSome) {
    EXPECT_EQ(tracingFraction(0), .5);
    EXPECT_EQ(tracingFraction(.3), .5);
    EXPECT_NEAR(tracingFraction(.5), .3, 1e-12);
    EXPECT_EQ(tracingFraction(.65), .2);
    EXPECT_EQ(tracingFraction(3), .2);
}

TEST(TraceWorker, RestsAsLongAsItsShareSaysButNotForLong) {
    EXPECT_EQ(restAfter(40ms, .5), 40ms);
    EXPECT_NEAR(std::chrono::duration<double>(restAfter(40ms, .2)).count(), .16, 1e-6);
    EXPECT_EQ(restAfter(2s, .5), 1s);
    EXPECT_EQ(restAfter(0ms, .2), 0ms);
}

/// A room of 8 x 6 x 4 m without images, so that rays bring all.
test::Walled roomThatTakes(double absorption) {
    return {
        {{0, 0, 0}, {8, 0, 0}, {8, 6, 0}, {0, 6, 0}, {0, 0, 4}, {8, 0, 4}, {8, 6, 4}, {0, 6, 4}},
        {0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6, 0, 5, 1, 0, 4, 5, 3, 2, 6, 3, 6, 7, 0, 3, 7, 0, 7, 4, 1, 5, 6, 1, 6, 2},
        absorption,
        {WorldFromLocal(1.0)},
        false};
}

TraceJob jobOf(std::uint64_t rays) {
    TraceJob job;
    job.source = {2, 2, 1.5};
    job.listener = {6, 4, 1.2};
    job.tracing.rays = rays;
    job.tracing.imageOrder = 0;
    job.tracing.diffractionOrder = 0;
    job.tracing.maxSeconds = .6;
    job.longest = 206;
    return job;
}

/// By 20 ms, dB rms off.
double offBy(const Echogram& is, const Echogram& truth) {
    double sum = 0;
    int count = 0;
    for (std::size_t from = 40; from + 20 <= std::min<std::size_t>(400, truth.late.bins.size()); from += 20, ++count) {
        double a = 0, b = 0;
        for (std::size_t k = from; k < from + 20; ++k) {
            a += k < is.late.bins.size() ? is.late.bins[k][kBand1k] : 0;
            b += truth.late.bins[k][kBand1k];
        }
        sum += std::pow(10 * std::log10(a / b), 2);
    }
    return std::sqrt(sum / count);
}

TEST(TraceWorker, EnergyThatIsKeptIsNearerThanAnewWithEightTimesTheRays) {
    const test::Walled room = roomThatTakes(.15);
    const TracedResponse truth = traceResponse(jobOf(100'000), room.geometry);
    TraceJob job = jobOf(2000);
    double kept = 0, anew = 0;
    int count = 0;
    for (int i = 0; i < 40; ++i) {
        job.tracing.seed = 100 + static_cast<std::uint64_t>(i);
        const TracedResponse next = traceResponse(job, room.geometry);
        EXPECT_EQ(next.rays, i == 0 ? 2000u : 256u) << "in batches of 16 that are whole";
        job.kept = next.kept;
        if (i < 16 || i % 4 != 0) continue;
        kept += offBy(*next.traced, *truth.traced);
        TraceJob fresh = job;
        fresh.kept = {};
        anew += offBy(*traceResponse(fresh, room.geometry).traced, *truth.traced);
        ++count;
    }
    EXPECT_LT(kept, 1.1 * anew) << kept / count << " and " << anew / count << " dB";
    // Doors that open, walls that come: another room is not heard by and by.
    const test::Walled dull = roomThatTakes(.8);
    const TracedResponse other = traceResponse(job, dull.geometry);
    EXPECT_EQ(other.rays, 2000u);
    EXPECT_LT(other.traced->total()[kBand1k], .3 * job.kept.traced->total()[kBand1k]);
    // Nor where the source is put somewhere else.
    job.source = {7.5, 5.5, 3};
    job.listener = {.5, .5, .5};
    EXPECT_EQ(traceResponse(job, room.geometry).rays, 2000u);
}

}  // namespace
}  // namespace rtsg
