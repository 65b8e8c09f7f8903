// Parallel loops: every call once, what was written is seen, exceptions come out, threads are limited.
#include <rtsg/renderers/parallel_for.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/renderers/ray_world.h>

namespace rtsg {
namespace {

// Plain memory on both sides: ThreadSanitizer tells if the start or the end of a loop is not a meeting of threads.
TEST(ParallelFor, EveryCallComesOnceAndTheirResultsAreSeen) {
    std::vector<int> given(10'000), created(given.size());
    for (int round = 1; round <= 20; ++round) {
        std::iota(given.begin(), given.end(), round);
        parallelFor(given.size(), [&](std::size_t i) { created[i] += given[i]; });
        for (std::size_t i = 0; i < created.size(); ++i) {
            ASSERT_EQ(created[i], static_cast<int>(i) + round);
            created[i] = 0;
        }
    }
}

TEST(ParallelFor, NothingToDoCallsNothing) {
    parallelFor(0, [](std::size_t) { FAIL(); });
}

TEST(ParallelFor, AnExceptionComesOutAndTheNextLoopRuns) {
    EXPECT_THROW(parallelFor(100,
                             [](std::size_t i) {
                                 if (i == 40) throw std::runtime_error("forty");
                             }),
                 std::runtime_error);
    std::atomic<int> calls = 0;
    parallelFor(100, [&](std::size_t) { ++calls; });
    EXPECT_EQ(calls, 100);
}

TEST(ParallelFor, ALoopWithinALoopEnds) {
    std::vector<int> sums(16);
    parallelFor(sums.size(), [&](std::size_t i) {
        std::atomic<int> sum = 0;
        parallelFor(10, [&](std::size_t k) { sum += static_cast<int>(k); });
        sums[i] = sum;
    });
    for (const int sum : sums) EXPECT_EQ(sum, 45);
}

TEST(Apart, LoopsWithinEndAndExceptionsComeOut) {
    std::mutex mutex;
    std::atomic<int> calls = 0;
    // Under a lock that every outer call wants.
    parallelFor(16, [&](std::size_t) {
        const std::lock_guard lock(mutex);
        apart([&] { parallelFor(10, [&](std::size_t) { ++calls; }); });
    });
    EXPECT_EQ(calls, 160);
    EXPECT_THROW(apart([] { throw std::runtime_error("no"); }), std::runtime_error);
}

TEST(WithThreads, OneMeansOneThread) {
    std::mutex mutex;
    std::set<std::thread::id> threads;
    unsigned reported = 0;
    withThreads(1, [&] {
        reported = availableThreads();
        parallelFor(1000, [&](std::size_t) {
            const std::lock_guard lock(mutex);
            threads.insert(std::this_thread::get_id());
        });
    });
    EXPECT_EQ(reported, 1u);
    EXPECT_EQ(threads.size(), 1u);
}

TEST(WithThreads, NoneNamedAndTooManyNamedMeanAllThereAre) {
    const unsigned all = availableThreads();
    for (const unsigned named : {0u, all, all + 1, 4'000'000'000u}) {
        unsigned reported = 0;
        withThreads(named, [&] { reported = availableThreads(); });
        EXPECT_EQ(reported, all) << named;
    }
}

TEST(WithThreads, AnExceptionComesOut) {
    EXPECT_THROW(withThreads(1, [] { throw std::runtime_error("no"); }), std::runtime_error);
}

TEST(ParallelFor, AWorldThatIsBuiltByOneThreadTakesNoneFromOtherLoops) {
    if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "there is one core";
    const RayWorld world({.buildThreads = 1});
    std::atomic<int> here = 0;
    std::atomic<bool> met = false;
    withThreads(2, [&] {
        parallelFor(2, [&](std::size_t) {
            ++here;
            for (int i = 0; i < 1000 && !met; ++i) {  // 10 s at most
                met = met || here == 2;
                if (!met) std::this_thread::sleep_for(std::chrono::milliseconds(10));
            }
            --here;
        });
    });
    EXPECT_TRUE(met) << "two iterations never ran side by side";
}

}  // namespace
}  // namespace rtsg
