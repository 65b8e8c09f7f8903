// A worker runs its jobs in their order, on a thread with its name or, where there is none, for who waits for them.
#include <rtsg/core/worker.h>

#include <future>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <pthread.h>

#include "support/no_threads.h"

namespace rtsg {
namespace {

TEST(Worker, RunsJobsInTheirOrderOnOneThread) {
    Worker worker("test");
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
        Worker worker("test", asked);
        std::vector<int> order;
        const test::NoThreads none;
        const auto first = worker.start([&] { order.push_back(1); });
        const auto last = worker.start([&] { order.push_back(2); });
        EXPECT_FALSE(first->done());
        worker.wait(*last);
        EXPECT_TRUE(first->done() && last->done());
        EXPECT_EQ(order, (std::vector{1, 2}));
        worker.start([&] { order.push_back(3); });
        worker.finish();
        EXPECT_EQ(order, (std::vector{1, 2, 3}));
        EXPECT_TRUE(worker.idle());
    }
}

TEST(Worker, ThrowsWhereAJobHasToHaveAThreadAndThereIsNone) {
    Worker worker("test");
    const test::NoThreads none;
    EXPECT_THROW(worker.run([] {}), std::system_error);
    EXPECT_TRUE(worker.idle());  // the job is not kept
}

TEST(Worker, ItsThreadHasItsNameAsFarAsTheSystemKeepsIt) {
    for (const std::string name : {"rtsg short", "rtsg with a name of many letters"}) {
        char shown[32] = {};
        Worker worker(name);
        worker.wait(*worker.start([&] { ::pthread_getname_np(::pthread_self(), shown, sizeof(shown)); }));
        EXPECT_EQ(shown, name.substr(0, 15));
    }
}

TEST(Worker, ReportsTheFirstFailureAndGoesOn) {
    Worker worker("test");
    bool ran = false;
    EXPECT_TRUE(worker.failure("work ended"));
    worker.start([] { throw std::bad_alloc(); });
    worker.start([] { throw 7; });
    worker.start([&] { ran = true; });
    worker.finish();
    const Result<> failure = worker.failure("work ended");
    ASSERT_FALSE(failure);
    EXPECT_EQ(failure.error().text, "work ended: std::bad_alloc");
    EXPECT_TRUE(ran);
}

TEST(Worker, SaysThatWhatItCaughtHasNoText) {
    Worker worker("test");
    worker.start([] { throw 7; });
    worker.finish();
    EXPECT_EQ(worker.failure("work").error().text, "work: an exception without a text");
}

TEST(Worker, StopWaitsForTheJobUnderWayAndDropsThoseBehind) {
    Worker worker("test");
    std::promise<void> begun;
    bool ended = false;
    int later = 0;
    const auto shared = std::make_shared<int>();
    const auto first = worker.start([&] {
        begun.set_value();
        while (worker.pause(std::chrono::hours(1))) continue;
        ended = worker.stops();
    });
    std::vector<std::shared_ptr<const Worker::Job>> behind;
    for (int i = 0; i < 1000; ++i) behind.push_back(worker.start([&later, shared] { ++later; }));
    begun.get_future().wait();
    EXPECT_FALSE(worker.idle());
    worker.stop();
    EXPECT_TRUE(ended && first->done() && !first->failed());
    for (const auto& job : behind) EXPECT_TRUE(job->done() && job->failed());
    EXPECT_EQ(later, 0);
    EXPECT_EQ(shared.use_count(), 1);  // what they shared has gone with them
    EXPECT_TRUE(worker.failure("work"));

    const auto late = worker.start([&] { ++later; });
    worker.wait(*late);  // does not wait for ever
    EXPECT_TRUE(late->failed());
    EXPECT_EQ(later, 0);
    worker.stop();
}

TEST(Worker, AJobThatHasAThreadBeginsHoweverSoonItIsStopped) {
    for (int i = 0; i < 100; ++i) {
        bool ran = false, late = false;
        Worker worker("test");
        worker.run([&] { ran = true; });
        worker.startInstead([] {});
        worker.stop();
        EXPECT_TRUE(ran);
        worker.run([&] { late = true; });
        worker.stop();
        EXPECT_FALSE(late);
    }
}

TEST(Worker, WhatIsStartedInsteadDropsThoseThatHaveNotBegun) {
    Worker worker("test");
    std::promise<void> begun, mayEnd;
    std::vector<int> order;
    worker.start([&] {
        begun.set_value();
        mayEnd.get_future().wait();
        order.push_back(1);
    });
    begun.get_future().wait();
    const auto dropped = worker.start([&] { order.push_back(2); });
    const auto last = worker.startInstead([&] { order.push_back(3); });
    EXPECT_TRUE(dropped->done() && dropped->failed());
    worker.wait(*dropped);
    mayEnd.set_value();
    worker.wait(*last);
    EXPECT_EQ(order, (std::vector{1, 3}));
    EXPECT_FALSE(last->failed());
}

TEST(Worker, StopWakesAJobThatWaitsElsewhere) {
    std::promise<void> woken;
    bool ended = false;
    Worker worker("test");
    worker.run(
        [&] {
            woken.get_future().wait();
            ended = worker.stops();
        },
        [&] { woken.set_value(); });
    worker.stop();
    EXPECT_TRUE(ended);
    worker.stop();  // wakes nobody any more
}

/// An object that a job holds to the end, and that holds the worker.
TEST(Worker, MayBeDestroyedByItsOwnJob) {
    struct Owner {
        std::promise<void> released, gone;
        std::unique_ptr<Worker> worker = std::make_unique<Worker>("test");
    };
    const auto state = std::make_shared<Owner>();
    std::future<void> gone = state->gone.get_future();
    std::atomic<bool> later = false;
    state->worker->start([state] {
        state->released.get_future().wait();
        state->worker.reset();
        state->gone.set_value();
    });
    state->worker->start([&later] { later = true; });
    state->released.set_value();
    gone.wait();
    EXPECT_FALSE(state->worker);
    EXPECT_FALSE(later);
}

}  // namespace
}  // namespace rtsg
