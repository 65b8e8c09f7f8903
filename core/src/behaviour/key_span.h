// Where among its keys an interpolator's fraction lies. ISO/IEC 19775-1 V4.0, 19.3.1.
#pragma once

#include <algorithm>

#include <rtsg/core/array.h>

namespace rtsg::behaviours {

/// Which two keys a fraction lies between, and how far.
struct Span {
    std::size_t from = 0, to = 0;
    float weight = 0;
};

/// 19.3.1: outside the keys the end values hold; among equal keys the last one counts, so a step is a step.
inline Span locate(const Array<float>& key, std::size_t count, float fraction) {
    const float* begin = key.data();
    const float* end = begin + count;
    const float* after = std::upper_bound(begin, end, fraction);
    if (after == begin) return {0, 0, 0};
    if (after == end) return {count - 1, count - 1, 0};
    const auto from = static_cast<std::size_t>(after - begin) - 1;
    const float width = key[from + 1] - key[from];
    return {from, from + 1, width > 0 ? (fraction - key[from]) / width : 0};
}

}  // namespace rtsg::behaviours
