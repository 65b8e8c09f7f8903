// Head: opens a stream and names its writer, its mode and its built-in types. Type and field numbers are described
// where a type is first used (block 0, "descriptions"), and again with every keyframe. So a reader of another version
// can start at any keyframe, map by name, and keep or skip what it does not know.
//
// Invariant: equal hashes mean equal numbers, names and defaults of all built-in types; then no descriptions are
// needed.
// Threading: values and free functions without shared state.
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

/// The format written, the oldest format whose readers understand it (apart from what they skip), and the oldest format
/// read here. In format 2, state hashes counted fields by their position in the node tables.
constexpr std::uint16_t kFormatVersion = 3, kOldestReader = 3, kOldestFormat = 2;

using TypeTable = std::span<const std::unique_ptr<NodeType>>;

struct StreamHead {
    std::uint16_t formatVersion = kFormatVersion;
    /// Names one run of one scene. State numbers of different epochs are unrelated.
    std::uint64_t epoch = 0;
    std::uint64_t dictionaryHash = 0;  // hash of the writer's built-in types
    std::uint16_t builtinTypes = 0;    // their number; types that the scene defines are numbered from there on
    StreamMode mode;
    std::string creator;
    std::optional<double> start;  // scene time in seconds at which the session began, if the stream begins later
    /// With `start`: the scene time, in seconds, of the oldest state that earlier pieces still held when this one was
    /// begun. It is later than `start` if older pieces had been deleted.
    std::optional<double> keptFrom;
};

/// XXH3-64 of the encoded types. It visits every type.
std::uint64_t dictionaryHash(TypeTable types);

/// `record` is cleared and becomes a head record. `types` gives the meaning of the stream's TypeIndex numbers.
void encodeHead(std::uint64_t epoch, std::string_view creator, TypeTable types, const StreamMode& mode,
                ByteBuffer& record, std::optional<double> start = {}, std::optional<double> keptFrom = {});

/// `record` must be an intact head record (checkRecord).
Result<StreamHead> decodeHead(std::span<const std::byte> record);

}  // namespace rtsg
