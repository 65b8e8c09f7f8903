// Head: opens a stream and says by whom, in which mode and with which built-in types it is written. What type and field
// numbers mean is told where a type is first used (block 0, "descriptions"), and again with every keyframe, so that a
// reader of another version can start at any of them, map by name and keep or skip what it does not know.
//
// Invariant: equal hashes mean equal numbers, names and defaults of all built-in types; descriptions are then not
// needed. Threading: values and free functions without shared state.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/stream_mode.h>

namespace rtsg {

/// What is written, the oldest format whose readers understand it but for what they skip, and the oldest that is read
/// here. In format 2, state hashes counted fields by their place in the node tables.
constexpr std::uint16_t kFormatVersion = 3, kOldestReader = 3, kOldestFormat = 2;

using TypeTable = std::span<const std::unique_ptr<NodeType>>;

struct StreamHead {
    std::uint16_t formatVersion = kFormatVersion;
    /// Names one run of one scene: sequence numbers of different epochs have nothing to do with each other.
    std::uint64_t epoch = 0;
    std::uint64_t dictionaryHash = 0;  // of the writer's built-in types
    std::uint16_t builtinTypes = 0;    // how many of them: the scene's own are numbered from there
    StreamMode mode;
    std::string creator;
    std::optional<double> start;  // scene time at which the session began, seconds, where the stream begins later
    /// With `start`: scene time of the oldest state that the pieces before this one still held when it was begun,
    /// seconds. Later than `start` where a ring has let older ones go.
    std::optional<double> keptFrom;
};

/// XXH3-64 of the encoded types, all of which it looks at.
std::uint64_t dictionaryHash(TypeTable types);

/// Appends to nothing: `record` becomes a head record. `types`: what the stream's TypeIndex numbers mean.
void encodeHead(std::uint64_t epoch, std::string_view creator, TypeTable types, const StreamMode& mode,
                ByteBuffer& record, std::optional<double> start = {}, std::optional<double> keptFrom = {});

/// `record`: an intact head record (checkRecord).
Result<StreamHead> decodeHead(std::span<const std::byte> record);

}  // namespace rtsg
