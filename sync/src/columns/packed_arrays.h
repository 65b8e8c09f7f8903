// Arrays of 32-bit numbers in few bytes: the coding 3 of columns (PROTOCOL.md, "Arrays").
//
// What files hold is seldom random: indices count up, points lie in order, and numbers that came from decimal text have
// few digits. Each block of numbers says how it is foretold, and holds the differences in as many bits as they need.
// Invariant: what is read is bit for bit what was written, negative zeros and payloads of NaN too. Threading: pure
// functions.
#pragma once

#include <rtsg/core/value.h>
#include <rtsg/sync/byte_buffer.h>

#include "wire.h"

namespace rtsg::wire {

// clang-format off
/// X is given the name of each type that this coding takes, as MF type, and the type of its elements.
#define RTSG_PACKED_TYPES(X) \
    X(Int32, std::int32_t) X(Float, float) X(Vec2f, Vec2f) X(Vec3f, Vec3f) X(Color, Color) X(Vec4f, Vec4f) \
    X(ColorRGBA, ColorRGBA) X(Rotation, Rotation)
// clang-format on

/// 32-bit numbers of an element; 0 for all types that this coding does not take.
constexpr unsigned packedLanes(FieldType type) {
    switch (type) {
#define RTSG_X(name, T)       \
    case FieldType::MF##name: \
        return sizeof(T) / sizeof(std::uint32_t);
        RTSG_PACKED_TYPES(RTSG_X)
#undef RTSG_X
        default:
            return 0;
    }
}

/// Precondition: packedLanes(value.type()) > 0.
void putPacked(ByteBuffer& out, const Value& value);
/// An empty value after a problem. Precondition: packedLanes(type) > 0.
Value readPacked(Reader& in, FieldType type);

}  // namespace rtsg::wire
