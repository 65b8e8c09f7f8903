// The index record at a log's end (PROTOCOL.md, "Index").
#pragma once

#include <string_view>
#include <vector>

#include <rtsg/sync/log.h>

namespace rtsg {

/// A log with an index ends with the index record's offset (8 bytes) and this.
constexpr std::string_view kIndexMagic = "RTSGidx1";
constexpr std::size_t kIndexTail = 16;

/// `offset`: where in the file the record will go. `next`: of a piece that another follows, the state, time and hash
/// that the next one begins with.
void encodeLogIndex(const std::vector<LogKeyframe>& keyframes, std::uint64_t offset, ByteBuffer& record,
                    RecordHeader next = {});
/// The session that a log ends with goes on in another piece.
inline bool saysGoesOn(const RecordHeader& header) {
    return header.kind == RecordKind::index && header.to != 0;
}
/// It has come to its end.
inline bool saysEnd(const RecordHeader& header) {
    return header.kind == RecordKind::index && header.to == 0;
}
/// `record`: an intact index record. False when its content makes no sense.
bool decodeLogIndex(std::span<const std::byte> record, std::uint64_t offset, std::vector<LogKeyframe>& keyframes);

/// Reads `log` from where it is to its end.
std::vector<LogKeyframe> scanLogKeyframes(LogReader& log);

}  // namespace rtsg
