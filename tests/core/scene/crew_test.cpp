// A crew runs every part of a job once, whether its helpers are awake, asleep or about to fall asleep.
#include "storage/crew.h"

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "support/no_threads.h"

namespace rtsg {
namespace {

/// Longer than helpers look out for a job before they sleep, attending or not.
void letThemSleep() {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

void expectEachPartOnce(Crew& crew) {
    std::vector<std::atomic<int>> times(crew.parts());
    crew.run([&](unsigned part) { ++times[part]; });
    for (unsigned part = 0; part < crew.parts(); ++part) ASSERT_EQ(times[part], 1) << "part " << part;
}

TEST(Crew, EveryPartRunsOnceWhoeverIsAwake) {
    for (const unsigned threads : {2U, 3U, 5U}) {
        Crew crew(threads);
        for (int i = 0; i < 2000; ++i) {
            if (i % 500 == 100) letThemSleep();
            if (i % 7 == 0) crew.attend();
            if (i % 11 == 0) crew.dismiss();
            ASSERT_NO_FATAL_FAILURE(expectEachPartOnce(crew)) << "job " << i;
        }
    }
}

TEST(Crew, WithoutHelpersTheCallerRunsAll) {
    const test::NoThreads none;
    Crew crew(3);
    EXPECT_EQ(crew.threads(), 1U);
    for (int i = 0; i < 3; ++i) expectEachPartOnce(crew);
}

TEST(Crew, SleepersComeToAJobThatNeedsThem) {
    Crew crew(2);
    for (const bool attends : {false, true}) {
        if (attends) crew.attend();
        letThemSleep();
        // No part ends before another thread has taken one.
        std::mutex mutex;
        std::set<std::thread::id> who;
        std::atomic<std::size_t> count{0};
        crew.run([&](unsigned) {
            {
                const std::lock_guard lock(mutex);
                who.insert(std::this_thread::get_id());
                count = who.size();
            }
            while (count < 2) std::this_thread::yield();
        });
        EXPECT_EQ(who.size(), 2U);
        crew.dismiss();
    }
}

TEST(Crew, CallsWithoutAJobRunNothingAgain) {
    Crew crew(3);
    std::atomic<int> runs{0};
    crew.run([&](unsigned) { ++runs; });
    for (int i = 0; i < 100; ++i) crew.attend();
    letThemSleep();
    EXPECT_EQ(runs, static_cast<int>(crew.parts()));
    crew.dismiss();
}

TEST(Crew, WhatAPartThrowsComesOutAndTheNextJobRuns) {
    Crew crew(2);
    for (int i = 0; i < 20; ++i) {
        crew.attend();
        EXPECT_THROW(crew.run([](unsigned part) {
            if (part == 1) throw std::runtime_error("thrown");
        }),
                     std::runtime_error);
        ASSERT_NO_FATAL_FAILURE(expectEachPartOnce(crew));
    }
}

}  // namespace
}  // namespace rtsg
