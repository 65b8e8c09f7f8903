// Blocks of a record in fewer bytes: runs of them as a deflate stream (PROTOCOL.md, "Deflated").
//
// Invariant: what is read is what was written, or a problem with its place; nothing is made that the record's budget
// does not allow. Threading: pure functions.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/sync/byte_buffer.h>

#include "columns/wire.h"

namespace rtsg::wire {

/// Appends the blocks, as one deflated block if that is shorter. Returns the bytes that a reader has to make of it.
/// `words`: what the stream may refer to as if it had come before.
std::size_t putDeflated(std::span<const std::byte> blocks, ByteBuffer& record, std::span<const std::byte> words = {});

/// The blocks of a payload with deflated ones replaced by what they hold; nothing if there are none. What is made is
/// charged; after a problem what is returned means nothing. `words`: as they were written with.
std::optional<std::vector<std::byte>> inflateBlocks(Reader& payload, std::span<const std::byte> words = {});

}  // namespace rtsg::wire
