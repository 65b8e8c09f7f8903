// Packed arrays: arrays of 32-bit numbers in few bytes, coding 3 of columns (PROTOCOL.md, "Arrays").
//
// Numbers in files are rarely random: indices count up, points follow each other, and decimals have few digits. Each
// block states how its numbers are predicted, and has the differences in as many bits as they need.
// Invariant: reading gives exactly the bits that were written, with negative zeros and payloads of NaN.
// Threading: pure functions.
#pragma once

#include <rtsg/core/value.h>
#include <rtsg/sync/byte_buffer.h>

#include "wire.h"

namespace rtsg::wire {

// clang-format off
/// Calls X with the name of each packed MF type, and the type of its elements.
#define RTSG_PACKED_TYPES(X) \
    X(Int32, std::int32_t) X(Float, float) X(Vec2f, Vec2f) X(Vec3f, Vec3f) X(Color, Color) X(Vec4f, Vec4f) \
    X(ColorRGBA, ColorRGBA) X(Rotation, Rotation)
// clang-format on

/// Number of 32-bit numbers in an element; 0 for types that are not packed.
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
/// Returns an empty value after a problem. Precondition: packedLanes(type) > 0.
Value readPacked(Reader& in, FieldType type);

}  // namespace rtsg::wire
