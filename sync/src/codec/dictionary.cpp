// Encodes and decodes the head of a stream: its writer, mode and built-in types.
#include <rtsg/sync/dictionary.h>

#include <cmath>

#include <rtsg/sync/record.h>

#include "columns/wire.h"

namespace rtsg {

std::uint64_t dictionaryHash(TypeTable types) {
    ByteBuffer bytes;
    bytes.putVarint(types.size());
    for (const auto& type : types) wire::putType(bytes, *type);
    return checksumOf(bytes.bytes());
}

void encodeHead(std::uint64_t epoch, std::string_view creator, TypeTable types, const StreamMode& mode,
                ByteBuffer& record, std::optional<double> start, std::optional<double> keptFrom) {
    record.clear();
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    record.put(kFormatVersion);
    record.put(kOldestReader);
    record.put(epoch);
    record.put(dictionaryHash(types));
    record.put(static_cast<std::uint16_t>(types.size()));
    record.put(static_cast<std::uint8_t>(mode.mode));
    record.put(static_cast<std::uint8_t>(mode.coding));
    record.put(mode.maxError);
    wire::putText(record, creator);
    if (start) record.put(*start);
    if (start && keptFrom) record.put(*keptFrom);
    RecordHeader header;
    header.kind = RecordKind::head;
    sealRecord(record, header);
}

Result<StreamHead> decodeHead(std::span<const std::byte> record) {
    wire::Reader in(recordPayload(record), kRecordHeaderSize);
    StreamHead head;
    head.formatVersion = in.number<std::uint16_t>();
    const auto oldest = in.number<std::uint16_t>();
    if (!in.problem && (head.formatVersion < kOldestFormat || oldest > kFormatVersion))
        in.refuse("format version unknown to this reader");
    head.epoch = in.number<std::uint64_t>();
    head.dictionaryHash = in.number<std::uint64_t>();
    head.builtinTypes = in.number<std::uint16_t>();
    const auto mode = in.number<std::uint8_t>(), coding = in.number<std::uint8_t>();
    head.mode.maxError = in.number<double>();
    if (mode > static_cast<unsigned>(Mode::lossy)) in.refuse("mode unknown to this reader");
    if (mode == static_cast<unsigned>(Mode::lossy) && !(head.mode.maxError > 0 && std::isfinite(head.mode.maxError)))
        in.refuse("lossy without a bound of the error");
    head.mode.mode = static_cast<Mode>(mode);
    // This is only the writer's preference; every column says how it is coded.
    head.mode.coding =
        coding <= static_cast<unsigned>(Coding::smallest) ? static_cast<Coding>(coding) : Coding::smallest;
    head.creator = in.text();
    if (!in.problem && in.left() >= sizeof(double)) {
        const auto start = in.number<double>();
        if (std::isfinite(start)) head.start = start;
    }
    if (!in.problem && head.start && in.left() >= sizeof(double)) {
        const auto from = in.number<double>();
        if (std::isfinite(from)) head.keptFrom = from;
    }
    // Anything that a later version appends is left unread.
    if (in.problem) return std::unexpected(wire::describe(in, "head"));
    return head;
}

}  // namespace rtsg
