// Head and dictionary: what the type and field numbers of a stream mean, so that a reader of another version maps
// them by name and keeps or skips what it does not know (PROTOCOL.md, "Head").
//
// Invariant: a dictionary lists the writer's built-in types in TypeIndex order; equal hashes mean equal numbers,
// names and defaults. Threading: values and free functions without shared state.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>
#include <rtsg/sync/byte_buffer.h>

namespace rtsg {

constexpr std::uint32_t kFormatVersion = 1;

using TypeTable = std::span<const std::unique_ptr<NodeType>>;

struct StreamHead {
    std::uint32_t formatVersion = kFormatVersion;
    /// Names one run of one scene: sequence numbers of different epochs have nothing to do with each other.
    std::uint64_t epoch = 0;
    std::uint64_t dictionaryHash = 0;
    std::string creator;
    /// Empty when left out, or not unpacked, because the reader has the same one.
    std::vector<std::unique_ptr<NodeType>> types;
};

/// XXH3-64 of the encoded dictionary.
std::uint64_t dictionaryHash(TypeTable types);

/// Appends to nothing: `record` becomes a head record.
void encodeHead(std::uint64_t epoch, std::string_view creator, TypeTable types, bool withDictionary,
                ByteBuffer& record);

/// `record`: an intact head record (checkRecord). A dictionary whose hash is `known` is not unpacked: `types` stays
/// empty.
Result<StreamHead> decodeHead(std::span<const std::byte> record, std::uint64_t known = 0);

}  // namespace rtsg
