// Separates the targets of a frame's values from the values, and compares targets.
#include "plain_columns.h"

#include <algorithm>
#include <cstring>

#include "blocks.h"
#include "column_rows.h"

namespace rtsg::wire {

RawColumn readRawColumn(Reader& blocks) {
    const auto kind = blocks.number<std::uint8_t>();
    const std::uint64_t count = blocks.varint();
    Reader block = blocks.part(blocks.count(1));
    const std::byte* const begin = block.at;
    const auto coding = block.number<std::uint8_t>();
    block.number<std::uint8_t>();  // flags
    const FieldType type = readFieldType(block);
    const auto field = static_cast<FieldIndex>(block.bounded(0xFFFF));
    if (blocks.problem || block.problem || kind != kValues || coding != kCodingRaw || !fixedSize(type)) return {};
    const std::size_t size = info(type).elementSize;
    if (count > block.left() / size) return {};
    const std::byte* const values = block.end - count * size;
    return {{begin, values}, {field, type, static_cast<std::size_t>(count), values}};
}

bool areSame(std::span<const std::byte> a, std::span<const std::byte> b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size()) == 0;
}

/// Reads the columns. Returns false if the record has anything else, or is coded.
bool RepeatedColumns::readAll(std::span<const std::byte> record, const RecordHeader& header) {
    read_.clear();
    if (header.kind != RecordKind::frame || header.from == header.to || header.flags != 0) return false;
    Reader blocks(record.subspan(kRecordHeaderSize, header.length));
    while (blocks.left()) {
        const RawColumn& one = read_.emplace_back(readRawColumn(blocks));
        if (one.keys.empty() || info(one.column.type).size > sizeof(Vec4f)) return false;
        const auto isNone = [](std::byte b) { return std::to_integer<unsigned>(b) > 1; };
        if (one.column.type == FieldType::SFBool &&
            std::any_of(one.column.values, one.column.values + one.column.count, isNone))
            return false;
    }
    return true;
}

void RepeatedColumns::remember(std::span<const std::byte> record, const RecordHeader& header) {
    targets_.clear();
    if (!readAll(record, header)) return;
    for (const RawColumn& one : read_) {
        targets_.put(static_cast<std::uint64_t>(one.column.count));
        targets_.append(one.keys);
    }
}

std::optional<std::span<const PlainColumn>> RepeatedColumns::match(std::span<const std::byte> record,
                                                                   const RecordHeader& header) {
    if (targets_.empty() || !readAll(record, header)) return std::nullopt;
    columns_.clear();
    std::span<const std::byte> known = targets_.bytes();
    for (const RawColumn& one : read_) {
        std::uint64_t count = 0;
        if (known.size() < sizeof(count) + one.keys.size()) return std::nullopt;
        std::memcpy(&count, known.data(), sizeof(count));
        known = known.subspan(sizeof(count));
        if (count != one.column.count || !areSame(known.first(one.keys.size()), one.keys)) return std::nullopt;
        known = known.subspan(one.keys.size());
        columns_.push_back(one.column);
    }
    if (!known.empty()) return std::nullopt;
    return columns_;
}

}  // namespace rtsg::wire
