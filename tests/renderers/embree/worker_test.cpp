// A worker runs its jobs in their order, on a thread of its own or, where there is none, for who waits for them.
#include "trees/worker.h"

#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "support/no_threads.h"

namespace rtsg {
namespace {

TEST(Worker, RunsJobsInTheirOrderOnOneThread) {
    Worker worker;
    std::vector<int> order;
    std::vector<std::thread::id> where;
    const auto first = worker.start([&] { order.push_back(1), where.push_back(std::this_thread::get_id()); });
    const auto failing = worker.start([&] { throw std::runtime_error("2"); });
    const auto last = worker.start([&] { order.push_back(3), where.push_back(std::this_thread::get_id()); });
    worker.wait(*last);
    EXPECT_TRUE(first->done() && !first->failed());
    EXPECT_TRUE(failing->done() && failing->failed());
    EXPECT_EQ(order, (std::vector{1, 3}));
    EXPECT_EQ(where[0], where[1]);
    EXPECT_NE(where[0], std::this_thread::get_id());
}

TEST(Worker, WithoutAThreadRunsThemForWhoWaits) {
    for (const bool asked : {false, true}) {
        Worker worker(asked);
        std::vector<int> order;
        const test::NoThreads none;
        const auto first = worker.start([&] { order.push_back(1); });
        const auto last = worker.start([&] { order.push_back(2); });
        EXPECT_FALSE(first->done());
        worker.wait(*last);
        EXPECT_TRUE(first->done() && last->done());
        EXPECT_EQ(order, (std::vector{1, 2}));
    }
}

}  // namespace
}  // namespace rtsg
