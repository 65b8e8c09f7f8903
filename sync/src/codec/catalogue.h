// Catalogue: descriptions of built-in node types under numbers that never change, so that a scene file need not hold
// them (PROTOCOL.md, "Catalogue"). Its bytes are sync/catalogue.bin.
//
// Invariant: an entry that was given out stays what it is; a type that has changed since has one more at the end.
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

/// How many entries this program knows.
std::size_t catalogueSize();
/// Null beyond the last one.
std::unique_ptr<NodeType> catalogueType(std::size_t number);
/// Of words.bin: what deflated blocks of scene records may refer to.
std::span<const std::byte> sceneWords();
/// The newest entry that describes the type just as it is; nothing if there is none.
std::optional<std::uint16_t> catalogueNumber(const NodeType& type);
/// The catalogue's bytes with an entry more for each of `types` that it does not have as it is.
ByteBuffer catalogueWith(TypeTable types);

}  // namespace rtsg::wire
