// Seals and checks records: header and checksum.
#include <rtsg/sync/record.h>

#include <cmath>
#include <cstring>

#include <fmt/format.h>
#define XXH_INLINE_ALL
#include <xxhash.h>

namespace rtsg {

namespace {

constexpr std::size_t kChecksumAt = 8, kCoveredFrom = 16;

template <class T>
T read(std::span<const std::byte> bytes, std::size_t at) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof(T));
    return value;
}

}  // namespace

std::uint64_t checksumOf(std::span<const std::byte> bytes) {
    return XXH3_64bits(bytes.data(), bytes.size());
}

void sealRecord(ByteBuffer& record, RecordHeader header) {
    header.length = record.size() - kRecordHeaderSize;
    std::byte* at = record.data();
    const auto write = [&](std::size_t offset, const auto& value) { std::memcpy(at + offset, &value, sizeof(value)); };
    std::memcpy(at, kRecordMagic.data(), kRecordMagic.size());
    write(16, static_cast<std::uint64_t>(header.kind) | std::uint64_t{header.flags} << 8 | header.length << 16);
    write(24, header.from);
    write(32, header.to);
    write(40, header.time);
    write(48, header.hash.low);
    write(56, header.hash.high);
    write(kChecksumAt, checksumOf(record.bytes().subspan(kCoveredFrom)));
}

Result<RecordHeader> parseRecordHeader(std::span<const std::byte> bytes, std::uint64_t offset,
                                       std::uint64_t maxPayload) {
    if (bytes.size() < kRecordHeaderSize)
        return fail(fmt::format("at byte {}: record header truncated: {} of {} bytes", offset, bytes.size(),
                                kRecordHeaderSize));
    if (std::memcmp(bytes.data(), kRecordMagic.data(), kRecordMagic.size()) != 0)
        return fail(fmt::format("at byte {}: no record starts here (magic missing)", offset));
    RecordHeader header;
    const auto packed = read<std::uint64_t>(bytes, 16);
    header.kind = static_cast<RecordKind>(packed & 0xFF);
    header.flags = static_cast<std::uint8_t>(packed >> 8);
    header.length = packed >> 16;
    header.from = read<std::uint64_t>(bytes, 24);
    header.to = read<std::uint64_t>(bytes, 32);
    header.time = read<double>(bytes, 40);
    header.hash = {read<std::uint64_t>(bytes, 48), read<std::uint64_t>(bytes, 56)};
    header.checksum = read<std::uint64_t>(bytes, kChecksumAt);
    if (header.flags & ~kKnownFlags)
        return fail(fmt::format("at byte {}: record flags {:#x} unknown to this reader", offset + 17, header.flags));
    if (header.length > maxPayload)
        return fail(fmt::format("at byte {}: record of {} bytes exceeds the limit of {}", offset + 18, header.length,
                                maxPayload));
    if (!std::isfinite(header.time)) return fail(fmt::format("at byte {}: {} is no time", offset + 40, header.time));
    return header;
}

Result<RecordHeader> checkRecord(std::span<const std::byte> bytes, std::uint64_t offset, std::uint64_t maxPayload) {
    Result<RecordHeader> header = parseRecordHeader(bytes, offset, maxPayload);
    if (!header) return header;
    if (bytes.size() < header->size())
        return fail(fmt::format("at byte {}: record truncated: {} of {} bytes", offset, bytes.size(), header->size()));
    const std::uint64_t found = checksumOf(bytes.subspan(kCoveredFrom, header->size() - kCoveredFrom));
    if (found != header->checksum)
        return fail(fmt::format("at byte {}: record damaged: checksum {:016x}, expected {:016x}", offset, found,
                                header->checksum));
    return header;
}

}  // namespace rtsg
