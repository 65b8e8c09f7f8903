// A test may have two forms, which check the same. ./dev test runs the short one; ./dev long, which sets RTSG_LONG in
// the environment, runs the long one: more seeds, rounds or angles.
#pragma once

#include <cstdlib>

namespace rtsg::test {

inline bool isLongForm() {
    return std::getenv("RTSG_LONG") != nullptr;
}

template <class Number>
Number fewOrMany(Number few, Number many) {
    return isLongForm() ? many : few;
}

}  // namespace rtsg::test
