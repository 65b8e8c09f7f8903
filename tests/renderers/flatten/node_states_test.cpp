// States by node number take memory for the existing nodes, however far apart the numbers lie.
#include <gtest/gtest.h>

#include "flatten/node_states.h"

namespace rtsg::flatten {
namespace {

struct NodeState {
    std::uint64_t value = 0;
    bool idle = false;
    bool isIdle() const { return idle; }
};

TEST(NodeStates, NumbersFarApartTakeNoMoreThanATreeNodeEach) {
    for (const std::uint32_t distance : {1u, 3u, 1024u, 40'000u}) {
        NodeStates<NodeState> states;
        constexpr std::uint32_t kNodes = 100'000;
        for (std::uint32_t i = 0; i < kNodes; ++i) states.at(i * distance, i + 1).value = i;
        for (std::uint32_t i = 0; i < kNodes; ++i) ASSERT_EQ(states.find(i * distance)->value, i);
        EXPECT_LT(states.bytes(), kNodes * 150u) << distance;
    }
}

TEST(NodeStates, WhatComesFromAfarMovesIntoTheArrayWhenThatGrows) {
    NodeStates<NodeState> states;
    states.at(20'000, 10).value = 7;  // far beyond the ten there are
    EXPECT_EQ(states.dense(20'000), nullptr);
    for (std::uint32_t i = 0; i < 20'000; ++i) states.at(i, 20'000);
    ASSERT_EQ(states.find(20'000)->value, 7u);
    states.at(20'001, 20'001);
    ASSERT_NE(states.dense(20'000), nullptr);
    EXPECT_EQ(states.dense(20'000)->value, 7u);
    EXPECT_EQ(states.find(3'000'000), nullptr);
}

TEST(NodeStates, ALongSessionForgetsThoseThatAreGone) {
    NodeStates<NodeState> states;
    for (std::uint32_t i = 0; i < 1'000'000; ++i) {
        states.at(i, 100).idle = i % 1000 != 0;
        if (i % 100 == 0) states.tidy();
    }
    EXPECT_LT(states.bytes(), 2'000'000u);
    for (std::uint32_t i = 0; i < 1'000'000; i += 1000) ASSERT_NE(states.find(i), nullptr) << i;
}

}  // namespace
}  // namespace rtsg::flatten
