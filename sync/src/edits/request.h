// Requests as records: changes as a frame, all else as a record of its own kind (PROTOCOL.md, "Upstream").
//
// Invariant: what is read is within its limits; nothing is believed before that. Threading: pure functions.
#pragma once

#include <cstddef>
#include <span>

#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/mirror_request.h>

namespace rtsg::mirror {

/// `state`: any, above 0. The author is no part of the record.
void writeRequest(ChangeEncoder& encoder, MirrorRequest request, std::uint64_t state, ByteBuffer& record);
/// `describesTypes`: numbers of types and fields are those of the types that the record describes, which are found by
/// name.
Result<MirrorRequest> readRequest(std::span<const std::byte> record, bool describesTypes);

}  // namespace rtsg::mirror
