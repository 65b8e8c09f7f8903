// The index record at a log's end (PROTOCOL.md, "Index").
#pragma once

#include <string_view>
#include <vector>

#include <rtsg/sync/log.h>

namespace rtsg {

/// A log with an index ends with the index record's offset (8 bytes) and this.
constexpr std::string_view kIndexMagic = "RTSGidx1";
constexpr std::size_t kIndexTail = 16;

/// `offset`: where in the file the record will go.
void encodeLogIndex(const std::vector<LogKeyframe>& keyframes, std::uint64_t offset, ByteBuffer& record);
/// `record`: an intact index record. False when its content makes no sense.
bool decodeLogIndex(std::span<const std::byte> record, std::uint64_t offset, std::vector<LogKeyframe>& keyframes);

/// Reads `log` from where it is to its end.
std::vector<LogKeyframe> scanLogKeyframes(LogReader& log);

}  // namespace rtsg
