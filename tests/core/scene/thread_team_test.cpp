// A crew runs every part of a job once, whether its helpers are awake, asleep or about to fall asleep.
#include "storage/thread_team.h"

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

void expectEachPartOnce(ThreadTeam& team) {
    std::vector<std::atomic<int>> times(team.parts());
    team.run([&](unsigned part) { ++times[part]; });
    for (unsigned part = 0; part < team.parts(); ++part) ASSERT_EQ(times[part], 1) << "part " << part;
}

TEST(ThreadTeam, EveryPartRunsOnceWhoeverIsAwake) {
    for (const unsigned threads : {2U, 3U, 5U}) {
        ThreadTeam team(threads);
        for (int i = 0; i < 2000; ++i) {
            if (i % 500 == 100) letThemSleep();
            if (i % 7 == 0) team.attend();
            if (i % 11 == 0) team.dismiss();
            ASSERT_NO_FATAL_FAILURE(expectEachPartOnce(team)) << "job " << i;
        }
    }
}

TEST(ThreadTeam, WithoutHelpersTheCallerRunsAll) {
    const test::NoThreads none;
    ThreadTeam team(3);
    EXPECT_EQ(team.threads(), 1U);
    for (int i = 0; i < 3; ++i) expectEachPartOnce(team);
}

TEST(ThreadTeam, SleepersComeToAJobThatNeedsThem) {
    ThreadTeam team(2);
    for (const bool attends : {false, true}) {
        if (attends) team.attend();
        letThemSleep();
        // No part ends before another thread has taken one.
        std::mutex mutex;
        std::set<std::thread::id> who;
        std::atomic<std::size_t> count{0};
        team.run([&](unsigned) {
            {
                const std::lock_guard lock(mutex);
                who.insert(std::this_thread::get_id());
                count = who.size();
            }
            while (count < 2) std::this_thread::yield();
        });
        EXPECT_EQ(who.size(), 2U);
        team.dismiss();
    }
}

TEST(ThreadTeam, CallsWithoutAJobRunNothingAgain) {
    ThreadTeam team(3);
    std::atomic<int> runs{0};
    team.run([&](unsigned) { ++runs; });
    for (int i = 0; i < 100; ++i) team.attend();
    letThemSleep();
    EXPECT_EQ(runs, static_cast<int>(team.parts()));
    team.dismiss();
}

TEST(ThreadTeam, WhatAPartThrowsComesOutAndTheNextJobRuns) {
    ThreadTeam team(2);
    for (int i = 0; i < 20; ++i) {
        team.attend();
        EXPECT_THROW(team.run([](unsigned part) {
            if (part == 1) throw std::runtime_error("thrown");
        }),
                     std::runtime_error);
        ASSERT_NO_FATAL_FAILURE(expectEachPartOnce(team));
    }
}

}  // namespace
}  // namespace rtsg
