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

/// 32-bit numbers of an element of these MF types; 0 for all others, which this coding does not take.
constexpr unsigned packedLanes(FieldType type) {
    switch (type) {
        case FieldType::MFInt32:
        case FieldType::MFFloat:
            return 1;
        case FieldType::MFVec2f:
            return 2;
        case FieldType::MFVec3f:
        case FieldType::MFColor:
            return 3;
        case FieldType::MFVec4f:
        case FieldType::MFColorRGBA:
        case FieldType::MFRotation:
            return 4;
        default:
            return 0;
    }
}

/// Precondition: packedLanes(value.type()) > 0.
void putPacked(ByteBuffer& out, const Value& value);
/// An empty value after a problem. Precondition: packedLanes(type) > 0.
Value readPacked(Reader& in, FieldType type);

}  // namespace rtsg::wire
