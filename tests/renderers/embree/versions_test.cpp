// The data that versions keep, those that they do not keep, and their mask bits.
#include "trees/versions.h"

#include <gtest/gtest.h>

#include "trees/paged.h"

namespace rtsg::bvh {
namespace {

TEST(Versions, WhatIsHeldIsCopiedBeforeItIsWritten) {
    Versions versions;
    Paged<int, 4> numbers(&versions);
    numbers.grow(10);
    for (int i = 0; i < 10; ++i) numbers.write(static_cast<std::size_t>(i)) = i;
    const int* const before = numbers.pages()[1];
    numbers.write(5) = 50;
    EXPECT_EQ(numbers.pages()[1], before) << "nobody looks: in place";

    const std::size_t one = versions.hold();
    std::vector<const int*> frozen;
    numbers.freezeInto(frozen);
    numbers.write(5) = 51;
    numbers.write(6) = 61;
    EXPECT_EQ(frozen[1][1], 50);
    EXPECT_EQ(frozen[1][2], 6);
    EXPECT_EQ(numbers[5], 51);
    EXPECT_EQ(numbers[6], 61);
    EXPECT_EQ(numbers.pages()[0], frozen[0]) << "what is not written is shared";
    const int* const copied = numbers.pages()[1];
    numbers.write(5) = 52;
    EXPECT_EQ(numbers.pages()[1], copied) << "once";

    versions.release(one);
    EXPECT_TRUE(versions.refresh());
    EXPECT_FALSE(versions.anyHeld());
    numbers.sweep();
    const std::size_t two = versions.hold();
    numbers.write(5) = 53;
    EXPECT_EQ(numbers.pages()[1], before) << "the page that nobody sees any more is used again";
    versions.release(two);
}

TEST(Versions, OneThatStallsPinsNothingThatCameAfterIt) {
    Versions versions;
    versions.hold();  // stalls for good
    const std::uint64_t stamp = versions.serial();
    const std::size_t next = versions.hold();
    auto object = std::make_shared<int>(7);
    const std::weak_ptr<int> watch = object;
    versions.retire(stamp, versions.serial(), std::move(object));
    EXPECT_FALSE(watch.expired()) << "the second one sees it";
    versions.release(next);
    EXPECT_TRUE(versions.refresh());
    EXPECT_EQ(versions.takeUnseen().size(), 1u);
    EXPECT_TRUE(watch.expired());
    versions.retire(versions.serial(), versions.serial(), std::make_shared<int>(8));
    EXPECT_TRUE(versions.takeUnseen().empty()) << "nobody has seen that";
}

TEST(Versions, ThereIsAlwaysAnEpochThatNobodyHolds) {
    Versions versions;
    std::vector<unsigned> shifts;
    for (std::size_t i = 0; i < Versions::kMax; ++i) {
        shifts.push_back(versions.maskShift());
        EXPECT_EQ(versions.hold(), i);
        versions.leaveHeldEpoch();
        EXPECT_EQ(versions.heldBits() >> versions.maskShift() & 15u, 0u);
    }
    std::sort(shifts.begin(), shifts.end());
    EXPECT_EQ(std::unique(shifts.begin(), shifts.end()), shifts.end()) << "each has bits of its own";
    EXPECT_EQ(versions.hold(), Versions::kMax) << "no more than that";
    EXPECT_EQ(versions.heldBits() | 15u << versions.maskShift(), Versions::inAllEpochs(15));
    versions.release(4);
    EXPECT_TRUE(versions.refresh());
    EXPECT_EQ(versions.hold(), 4u);
}

}  // namespace
}  // namespace rtsg::bvh
