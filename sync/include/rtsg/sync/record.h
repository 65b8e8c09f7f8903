// Record: the unit of both wire and log. It has a header of 64 bytes, then the payload (PROTOCOL.md, "Records").
//
//   0 magic  8 checksum  16 kind, flags, length  24 from  32 to  40 time  48 state hash (16)  64 payload
//
// Invariant: the checksum is the XXH3-64 of everything from byte 16 to the end of the record, so magic and checksum
// together cover every byte. All numbers are little endian.
// Threading: free functions without state.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/byte_buffer.h>

namespace rtsg {

/// The numbers are part of the format. Readers skip kinds they do not know.
enum class RecordKind : std::uint8_t {
    head = 1,      // format version, epoch, dictionary of types
    frame = 2,     // a ChangeSet that leads from one state to a later one
    keyframe = 3,  // a ChangeSet that leads from the empty scene to a state
    index = 4,     // where a log's keyframes are
    input = 5,     // what came into a frame, for replicas that run the frame themselves (input_codec.h)
    request = 6,   // what a client asks of its origin (PROTOCOL.md, "Upstream")
    scene = 7,     // the record of a scene file: a state whose node types have the catalogue's numbers
};

/// Flags of frames; they say what predicted values refer to (PROTOCOL.md, "Prediction"). A reader that starts in the
/// middle of a stream needs a frame with kForget after a keyframe, and a frame with kSync or kForget after merged
/// frames. Otherwise it can go on only with the very next frame.
constexpr std::uint8_t kRemember = 1;  // later values are predicted from the values of this frame
constexpr std::uint8_t kSync = 2;      // this and later records refer only to the last values of earlier frames
constexpr std::uint8_t kForget = 4;    // this and later records refer to nothing of earlier frames
constexpr std::uint8_t kKnownFlags = kRemember | kSync | kForget;

constexpr std::size_t kRecordHeaderSize = 64;
constexpr std::string_view kRecordMagic = "RTSGrec1";
/// The longest payload, in bytes, that is read from a file or a peer unless an option says otherwise: some ten million
/// nodes.
constexpr std::uint64_t kMaxPayload = std::uint64_t{1} << 30;
/// No limit, for a record that is in memory already.
constexpr std::uint64_t kAnyPayload = UINT64_MAX;

struct RecordHeader {
    RecordKind kind = RecordKind::frame;
    std::uint8_t flags = 0;    // kRemember, kSync, kForget; a reader refuses others
    std::uint64_t length = 0;  // length of the payload, bytes
    std::uint64_t from = 0, to = 0;
    double time = 0;  // seconds
    Hash128 hash;
    std::uint64_t checksum = 0;

    std::uint64_t size() const { return kRecordHeaderSize + length; }
};

/// Writes the header and fills in length and checksum. `record` must begin with kRecordHeaderSize bytes of any content,
/// followed by the payload.
void sealRecord(ByteBuffer& record, RecordHeader header);

/// Parses a header. Checks magic, flags and `maxPayload`, but not the checksum. `bytes` may be longer than the header.
/// Errors name the byte counted from `offset`.
Result<RecordHeader> parseRecordHeader(std::span<const std::byte> bytes, std::uint64_t offset = 0,
                                       std::uint64_t maxPayload = kAnyPayload);

/// Does what parseRecordHeader does, and checks that the whole record is there and intact.
Result<RecordHeader> checkRecord(std::span<const std::byte> bytes, std::uint64_t offset = 0,
                                 std::uint64_t maxPayload = kAnyPayload);

inline std::span<const std::byte> recordPayload(std::span<const std::byte> record) {
    return record.subspan(kRecordHeaderSize);
}

/// The checksum of this format, XXH3-64.
std::uint64_t checksumOf(std::span<const std::byte> bytes);

}  // namespace rtsg
