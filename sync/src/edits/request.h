// Request codec: changes become a frame, other requests a record of their own kind (PROTOCOL.md, "Upstream").
//
// Invariant: a request that was read is within its limits; nothing is used before that.
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <span>

#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/mirror_request.h>

namespace rtsg::mirror {

/// `state` may be any number above 0. The author is not part of the record.
void writeRequest(ChangeEncoder& encoder, MirrorRequest request, std::uint64_t state, ByteBuffer& record);
/// With `describesTypes` the record has its own type and field numbers, with descriptions that are mapped by name.
Result<MirrorRequest> readRequest(std::span<const std::byte> record, bool describesTypes);

}  // namespace rtsg::mirror
