// The newest of something from one thread to others: nobody sees older after newer, and nothing is kept for longer than
// somebody holds it.
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "world/hand_over.h"

namespace rtsg {
namespace {

struct Counted {
    static inline std::atomic<int> alive{0};
    explicit Counted(int n) : number(n), again(n) { ++alive; }
    ~Counted() {
        again = number = -1;
        --alive;
    }
    Counted(const Counted&) = delete;
    Counted& operator=(const Counted&) = delete;
    int number, again;
};

TEST(HandOver, GivesTheNewestAndKeepsNoOther) {
    HandOver<Counted> handOver;
    EXPECT_EQ(handOver.get(), nullptr);
    for (int i = 0; i < 100; ++i) {
        ASSERT_TRUE(handOver.put(std::make_shared<const Counted>(i)));
        EXPECT_EQ(handOver.get()->number, i);
        EXPECT_EQ(Counted::alive, 1);
    }
    const auto held = handOver.get();
    ASSERT_TRUE(handOver.put(nullptr));
    EXPECT_EQ(handOver.get(), nullptr);
    EXPECT_EQ(Counted::alive, 1) << "that which is held";
    EXPECT_EQ(held->number, 99);
}

TEST(HandOver, AReaderThatStopsOnItsWayKeepsItsPlaceAndHoldsUpNobody) {
    using Handing = HandOver<Counted>;
    {
        Handing handOver;
        ASSERT_TRUE(handOver.put(std::make_shared<const Counted>(0)));
        std::vector<std::unique_ptr<Handing::Visit>> stopped;
        stopped.push_back(std::make_unique<Handing::Visit>(handOver));
        for (int i = 1; i < 100; ++i) {
            ASSERT_TRUE(handOver.put(std::make_shared<const Counted>(i)));
            EXPECT_EQ(handOver.get()->number, i);
            EXPECT_EQ(stopped[0]->value()->number, 0);
            EXPECT_EQ(Counted::alive, 2);
        }
        // One at each place there is: then nothing can be put, and the newest stays.
        int last = 99;
        while (stopped.size() < Handing::kEntries) {
            stopped.push_back(std::make_unique<Handing::Visit>(handOver));
            if (stopped.size() == Handing::kEntries) break;
            ASSERT_TRUE(handOver.put(std::make_shared<const Counted>(++last)));
        }
        EXPECT_FALSE(handOver.put(std::make_shared<const Counted>(1000)));
        EXPECT_EQ(handOver.get()->number, last);
        stopped.erase(stopped.begin() + 3);
        EXPECT_TRUE(handOver.put(std::make_shared<const Counted>(1001)));
        EXPECT_EQ(handOver.get()->number, 1001);
        EXPECT_EQ(stopped[0]->value()->number, 0);
    }
    EXPECT_EQ(Counted::alive, 0);
}

TEST(HandOver, ReadersOnThreeThreadsSeeWholeOnesInOrder) {
    constexpr int kLast = 20'000;
    {
        HandOver<Counted> handOver;
        std::atomic<int> wrong{0};
        std::vector<std::thread> readers;
        for (int r = 0; r < 3; ++r)
            readers.emplace_back([&] {
                for (int before = -1; before != kLast;) {
                    const auto one = handOver.get();
                    if (!one) continue;
                    wrong += one->number < before || one->number != one->again;
                    before = one->number;
                }
            });
        for (int i = 0; i <= kLast; ++i)
            while (!handOver.put(std::make_shared<const Counted>(i))) std::this_thread::yield();
        for (std::thread& reader : readers) reader.join();
        EXPECT_EQ(wrong, 0);
    }
    EXPECT_EQ(Counted::alive, 0);
}

}  // namespace
}  // namespace rtsg
