// Deflated blocks: runs of a record's blocks as one deflate stream (PROTOCOL.md, "Deflated").
//
// Invariant: reading gives what was written, or a problem with its place. It allocates no more than the record's budget
// allows.
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/sync/byte_buffer.h>

#include "columns/wire.h"

namespace rtsg::wire {

/// Appends the blocks, as one deflated block if that is shorter. Returns the bytes that a reader inflates. The stream
/// may refer to `words` as if they had come before it.
std::size_t putDeflated(std::span<const std::byte> blocks, ByteBuffer& record, std::span<const std::byte> words = {});

/// The blocks of a payload, with deflated blocks replaced by their content; nothing if there are none. Inflated bytes
/// are charged. After a problem the result has no meaning. `words` must be those of the writer.
std::optional<std::vector<std::byte>> inflateBlocks(Reader& payload, std::span<const std::byte> words = {});

}  // namespace rtsg::wire
