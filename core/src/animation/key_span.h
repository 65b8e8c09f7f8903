// Finds the two keys of an interpolator between which a fraction lies. ISO/IEC 19775-1 V4.0, 19.3.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>

#include <rtsg/core/array.h>
#include <rtsg/core/behaviour.h>

namespace rtsg::behaviours {

/// Which two keys a fraction lies between, and how far.
struct Span {
    std::size_t from = 0, to = 0;
    float weight = 0;
};

/// 19.3.1: outside the keys the end values hold; among equal keys the last one counts, so a step is a step.
inline Span locate(const Array<float>& key, std::size_t count, float fraction) {
    const float* const keys = key.data();
    // The comparisons of std::upper_bound, but without branches, since no processor could predict these.
    std::size_t after = 0;
    for (std::size_t left = count; left > 0;) {
        const std::size_t half = left / 2;
        const bool below = fraction < keys[after + half];
        after = below ? after : after + half + 1;
        left = below ? half : left - half - 1;
    }
    if (after == 0) return {0, 0, 0};
    if (after == count) return {count - 1, count - 1, 0};
    const std::size_t from = after - 1;
    const float width = keys[after] - keys[from];
    if (width > std::numeric_limits<float>::max()) [[unlikely]] {  // further apart than the largest float
        const double first = keys[from];
        const double weight = (double(fraction) - first) / (double(keys[after]) - first);
        return {from, after, std::isfinite(weight) ? static_cast<float>(weight) : 0};
    }
    return {from, after, width > 0 ? (fraction - keys[from]) / width : 0};
}

/// 19.2.2: from its first input on, an interpolator's output reads as the value that it sent last.
template <class N>
void noteInput(Cascade& cascade, const Node& node) {
    if (!node.get(N::_begun)) cascade.store(node, N::_begun, true);
}

/// One value a key: where the event's fraction lies among them, if it does.
template <class N>
std::optional<Span> spanAt(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    if (field != N::set_fraction.index) return std::nullopt;
    noteInput<N>(cascade, node);
    const float fraction = value.as<float>();
    const auto& key = node.get(N::key);
    const auto& values = node.get(N::keyValue);
    const std::size_t count = std::min(key.size(), values.size());
    if (key.size() != values.size())
        cascade.warn(node, std::to_string(values.size()) + " key values for " + std::to_string(key.size()) + " keys");
    if (count == 0 || std::isnan(fraction)) return std::nullopt;
    return locate(key, count, fraction);
}

}  // namespace rtsg::behaviours
