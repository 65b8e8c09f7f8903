// Catalogue: descriptions of built-in node types under numbers that never change. So a scene file need not hold
// descriptions (PROTOCOL.md, "Catalogue"). Its bytes are sync/catalogue.bin.
//
// Invariant: an entry never changes once it is published; a type that has changed gets another entry at the end.
// Threading: constant data.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <rtsg/core/node_type.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/dictionary.h>

namespace rtsg::wire {

/// Number of entries that this program knows.
std::size_t catalogueSize();
/// Null if the number is beyond the last entry.
std::unique_ptr<NodeType> catalogueType(std::size_t number);
/// The bytes of words.bin, to which deflated blocks of scene records may refer.
std::span<const std::byte> sceneWords();
/// The number of the newest entry that describes the type exactly. Empty if there is none.
std::optional<std::uint16_t> catalogueNumber(const NodeType& type);
/// The catalogue's bytes, with a new entry for each of `types` that has no exact entry yet.
ByteBuffer catalogueWith(TypeTable types);

}  // namespace rtsg::wire
