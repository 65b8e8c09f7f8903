// Log index: the record at the end of a log (PROTOCOL.md, "Index").
#pragma once

#include <string_view>
#include <vector>

#include <rtsg/sync/log.h>

namespace rtsg {

/// A log with an index ends with the index record's offset (8 bytes) and these bytes.
constexpr std::string_view kIndexMagic = "RTSGidx1";
constexpr std::size_t kIndexTail = 16;

/// `offset` is where the record will be in the file. If the file is a piece that another follows, `next` has the state,
/// time and hash with which that one begins.
void encodeLogIndex(const std::vector<LogKeyframe>& keyframes, std::uint64_t offset, ByteBuffer& record,
                    RecordHeader next = {});
/// True if the session goes on in another piece.
inline bool saysGoesOn(const RecordHeader& header) {
    return header.kind == RecordKind::index && header.to != 0;
}
/// True if the session ends here.
inline bool saysEnd(const RecordHeader& header) {
    return header.kind == RecordKind::index && header.to == 0;
}
/// `record` must be an intact index record. Returns false if its content makes no sense.
bool decodeLogIndex(std::span<const std::byte> record, std::uint64_t offset, std::vector<LogKeyframe>& keyframes);

/// Reads `log` from its position to its end.
std::vector<LogKeyframe> scanLogKeyframes(LogReader& log);

}  // namespace rtsg
