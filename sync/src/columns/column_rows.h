// Column rows: what writer and reader do with one row of a predicted column.
#pragma once

#include <cmath>

#include "value_history.h"

namespace rtsg::wire {

// Codings of a column's values; readers skip columns in a coding they do not know.
constexpr unsigned kCodingRaw = 0, kCodingPacked = 1, kCodingRanged = 2, kCodingArrays = 3;
// Bits of the byte behind a predicted column's head: whether it is on a grid, and how its nodes are listed.
constexpr unsigned kFormGrid = 1, kNodesDeltas = 0, kNodesRuns = 1, kNodesSame = 2, kNodesGaps = 3;

inline std::uint32_t zigzag32(std::int32_t number) {
    return static_cast<std::uint32_t>(number) << 1 ^ static_cast<std::uint32_t>(number >> 31);
}
inline std::int32_t unzigzag32(std::uint32_t coded) {
    return static_cast<std::int32_t>(coded >> 1 ^ (0u - (coded & 1)));
}

/// Packed residuals have as many bits as the last one. In front is a 1 for every three bits more that are needed, then
/// a 0.
constexpr unsigned kMoreBits = 3, kUnknownWidth = 12;
inline unsigned packedWidth(unsigned expected) {
    return expected == kUnknownSize ? kUnknownWidth : expected > 0 ? expected + 1 : 0;
}
inline void putPacked(BitWriter& bits, unsigned expected, std::int32_t residual) {
    const std::uint32_t coded = zigzag32(residual);
    const auto length = static_cast<unsigned>(std::bit_width(coded));
    unsigned width = packedWidth(expected), steps = 0;
    for (; length > width; width += kMoreBits) ++steps;
    const bool full = width >= 32;  // no 0 follows then
    bits.put((1u << steps) - 1, full ? steps : steps + 1);
    bits.put(coded, full ? 32 : width);
}
inline std::int32_t getPacked(BitReader& bits, unsigned expected) {
    unsigned width = packedWidth(expected);
    while (width < 32 && bits.get(1)) width += kMoreBits;
    return unzigzag32(bits.get(width < 32 ? width : 32));
}

/// The component of a unit axis that follows from the other two: the largest one of the last value. -1 if that was no
/// unit vector.
inline int dependentLane(const Slot& slot) {
    const double x = toFloat(slot.past[0][0]), y = toFloat(slot.past[0][1]), z = toFloat(slot.past[0][2]);
    if (!(std::abs(x * x + y * y + z * z - 1) < 1e-5)) return -1;
    const double ax = std::abs(x), ay = std::abs(y), az = std::abs(z);
    return ax >= ay && ax >= az ? 0 : ay >= az ? 1 : 2;
}
/// The value of that component, with its former sign.
inline std::int32_t dependentValue(const Slot& slot, int lane, const std::int32_t* now) {
    const double a = toFloat(now[lane == 0 ? 1 : 0]), b = toFloat(now[lane == 2 ? 1 : 2]);
    const double square = 1 - a * a - b * b;
    const double size = square > 0 ? std::sqrt(square) : 0;
    const bool negative = toFloat(slot.past[0][static_cast<std::size_t>(lane)]) < 0;
    return fromFloat(static_cast<float>(negative ? -size : size));
}

/// Calls `lane(l, prediction, now, residual)` for each lane, which computes one of the last two from the other; then
/// learns. Off the grid the dependent lane of a rotation comes last.
template <int Lanes, bool Grid, class Each>
void codeRow(const ValueHistory& history, Slot& slot, bool rotation, std::int32_t* now, Each&& lane) {
    const Forecast f = history.forecast<Lanes>(slot, Grid);
    std::int32_t residuals[4];
    int last = -1;
    if constexpr (Lanes == 4 && !Grid)
        if (rotation) last = dependentLane(slot);
    for (int l = 0; l < Lanes; ++l)
        if (l != last) lane(l, ValueHistory::chosen(slot, f, l), now[l], residuals[l]);
    if constexpr (Lanes == 4 && !Grid)
        if (last >= 0) lane(last, dependentValue(slot, last, now), now[last], residuals[last]);
    history.learn<Lanes>(slot, f, now, residuals);
}

}  // namespace rtsg::wire
