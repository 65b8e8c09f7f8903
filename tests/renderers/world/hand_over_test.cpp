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
    HandOver<Counted> places;
    EXPECT_EQ(places.get(), nullptr);
    for (int i = 0; i < 100; ++i) {
        ASSERT_TRUE(places.put(std::make_shared<const Counted>(i)));
        EXPECT_EQ(places.get()->number, i);
        EXPECT_EQ(Counted::alive, 1);
    }
    const auto held = places.get();
    ASSERT_TRUE(places.put(nullptr));
    EXPECT_EQ(places.get(), nullptr);
    EXPECT_EQ(Counted::alive, 1) << "that which is held";
    EXPECT_EQ(held->number, 99);
}

TEST(HandOver, AReaderThatStopsOnItsWayKeepsItsPlaceAndHoldsUpNobody) {
    using Places = HandOver<Counted>;
    {
        Places places;
        ASSERT_TRUE(places.put(std::make_shared<const Counted>(0)));
        std::vector<std::unique_ptr<Places::Visit>> stopped;
        stopped.push_back(std::make_unique<Places::Visit>(places));
        for (int i = 1; i < 100; ++i) {
            ASSERT_TRUE(places.put(std::make_shared<const Counted>(i)));
            EXPECT_EQ(places.get()->number, i);
            EXPECT_EQ(stopped[0]->value()->number, 0);
            EXPECT_EQ(Counted::alive, 2);
        }
        // One at each place there is: then nothing can be put, and the newest stays.
        int last = 99;
        while (stopped.size() < Places::kPlaces) {
            stopped.push_back(std::make_unique<Places::Visit>(places));
            if (stopped.size() == Places::kPlaces) break;
            ASSERT_TRUE(places.put(std::make_shared<const Counted>(++last)));
        }
        EXPECT_FALSE(places.put(std::make_shared<const Counted>(1000)));
        EXPECT_EQ(places.get()->number, last);
        stopped.erase(stopped.begin() + 3);
        EXPECT_TRUE(places.put(std::make_shared<const Counted>(1001)));
        EXPECT_EQ(places.get()->number, 1001);
        EXPECT_EQ(stopped[0]->value()->number, 0);
    }
    EXPECT_EQ(Counted::alive, 0);
}

TEST(HandOver, ReadersOnThreeThreadsSeeWholeOnesInOrder) {
    constexpr int kLast = 20'000;
    {
        HandOver<Counted> places;
        std::atomic<int> wrong{0};
        std::vector<std::thread> readers;
        for (int r = 0; r < 3; ++r)
            readers.emplace_back([&] {
                for (int before = -1; before != kLast;) {
                    const auto one = places.get();
                    if (!one) continue;
                    wrong += one->number < before || one->number != one->again;
                    before = one->number;
                }
            });
        for (int i = 0; i <= kLast; ++i)
            while (!places.put(std::make_shared<const Counted>(i))) std::this_thread::yield();
        for (std::thread& reader : readers) reader.join();
        EXPECT_EQ(wrong, 0);
    }
    EXPECT_EQ(Counted::alive, 0);
}

}  // namespace
}  // namespace rtsg
