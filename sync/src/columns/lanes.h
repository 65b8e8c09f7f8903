// Lanes: values as whole numbers, by their f32 bits or on a grid (PROTOCOL.md, "Prediction" and "Grid"). All arithmetic
// is exact IEEE in a fixed order, so that every reader gets the same bits.
//
// Invariant: fromFloat and toFloat are inverse; toGrid(fromGrid(q)) == q for |q| < kGridLimit on a sane step.
// Threading: pure functions.
#pragma once

#include <bit>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <rtsg/core/value.h>

namespace rtsg::wire {

/// Number of f32 components for predicted types, 0 for all others.
constexpr int lanesOf(FieldType type) {
    switch (type) {
        case FieldType::SFFloat:
            return 1;
        case FieldType::SFVec2f:
            return 2;
        case FieldType::SFVec3f:
        case FieldType::SFColor:
            return 3;
        case FieldType::SFVec4f:
        case FieldType::SFColorRGBA:
        case FieldType::SFRotation:
            return 4;
        default:
            return 0;
    }
}
/// Number of components on a grid. Rotations are stored there as axis times angle.
constexpr int gridLanesOf(FieldType type) {
    return type == FieldType::SFRotation ? 3 : lanesOf(type);
}

/// Maps the bits of a float to a number that grows with it.
inline std::int32_t fromFloatBits(std::uint32_t bits) {
    const auto i = static_cast<std::int32_t>(bits);
    return i ^ (i >> 31 & 0x7FFFFFFF);
}
inline std::uint32_t toFloatBits(std::int32_t number) {
    return static_cast<std::uint32_t>(number ^ (number >> 31 & 0x7FFFFFFF));
}
inline std::int32_t fromFloat(float value) {
    return fromFloatBits(std::bit_cast<std::uint32_t>(value));
}
inline double toFloat(std::int32_t number) {
    return static_cast<double>(std::bit_cast<float>(toFloatBits(number)));
}

constexpr double kGridLimit = 1 << 21;

/// The nearest point of the grid, ties to even; 0 outside the limit.
inline std::int32_t toGrid(double value, double step) {
    const double point = std::nearbyint(value / step);
    return std::abs(point) < kGridLimit ? static_cast<std::int32_t>(point) : 0;
}

/// `floats` has lanesOf(type) values. Writes gridLanesOf(type) numbers.
inline void toGrid(FieldType type, const float* floats, double step, std::int32_t* grid) {
    const int lanes = gridLanesOf(type);
    const double scale = type == FieldType::SFRotation ? static_cast<double>(floats[3]) : 1.;
    for (int l = 0; l < lanes; ++l) grid[l] = toGrid(static_cast<double>(floats[l]) * scale, step);
}
inline void fromGrid(FieldType type, const std::int32_t* grid, double step, float* floats) {
    const int lanes = gridLanesOf(type);
    double r[4];
    for (int l = 0; l < lanes; ++l) r[l] = static_cast<double>(grid[l]) * step;
    if (type != FieldType::SFRotation) {
        for (int l = 0; l < lanes; ++l) floats[l] = static_cast<float>(r[l]);
        return;
    }
    const double angle = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    for (int l = 0; l < 3; ++l) floats[l] = angle > 0 ? static_cast<float>(r[l] / angle) : l == 2 ? 1.f : 0.f;
    floats[3] = static_cast<float>(angle);
}

/// The width of a grid on which every value is within `maxError` of a point (Euclidean distance for vectors, angle for
/// rotations). It is slightly smaller, for the rounding of floats.
inline double gridStep(FieldType type, double maxError) {
    return 2 * maxError / std::sqrt(static_cast<double>(gridLanesOf(type))) * (1 - 1. / 1024);
}

/// Order 0 repeats the last value, 1 takes the line through the last two, 2 the parabola through the last three.
inline std::int32_t extrapolateFloat(std::int32_t a, std::int32_t b, std::int32_t c, int order) {
    if (order == 0) return a;
    const double p = order == 1 ? 2 * toFloat(a) - toFloat(b) : 3 * (toFloat(a) - toFloat(b)) + toFloat(c);
    return std::abs(p) <= static_cast<double>(FLT_MAX) ? fromFloat(static_cast<float>(p)) : a;
}
inline std::int32_t extrapolateGrid(std::int32_t a, std::int32_t b, std::int32_t c, int order) {
    const auto x = static_cast<std::uint32_t>(a), y = static_cast<std::uint32_t>(b), z = static_cast<std::uint32_t>(c);
    return static_cast<std::int32_t>(order == 0 ? x : order == 1 ? 2 * x - y : 3 * (x - y) + z);
}

inline std::int32_t difference(std::int32_t a, std::int32_t b) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b));
}
inline std::int32_t sum(std::int32_t a, std::int32_t b) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}
inline std::uint32_t magnitude(std::int32_t number) {
    const auto bits = static_cast<std::uint32_t>(number);
    return number < 0 ? 0u - bits : bits;
}

}  // namespace rtsg::wire
