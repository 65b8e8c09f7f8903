// Compares two frames' columns, all but the values: the fields of a scene in motion are the same in frame after frame.
#include "superseded.h"

#include <algorithm>

#include <rtsg/sync/record.h>

#include "codec/blocks.h"
#include "codec/column_rows.h"
#include "codec/wire.h"

namespace rtsg::mirror {

namespace {

/// What says which fields of which nodes a raw column of plain values is of; empty if the block is something else.
std::span<const std::byte> placesOf(wire::Reader& blocks) {
    const auto kind = blocks.number<std::uint8_t>();
    const std::uint64_t count = blocks.varint();
    wire::Reader block = blocks.part(blocks.count(1));
    const std::byte* const begin = block.at;
    const auto coding = block.number<std::uint8_t>();
    block.number<std::uint8_t>();  // flags
    const FieldType type = wire::readFieldType(block);
    if (blocks.problem || block.problem || kind != wire::kValues || coding != wire::kCodingRaw) return {};
    if (!wire::fixedSize(type)) return {};
    const std::size_t size = info(type).elementSize;
    if (count > block.left() / size) return {};
    return {begin, block.end - count * size};
}

}  // namespace

bool isSuperseded(std::span<const std::byte> frame, std::span<const std::byte> next) {
    wire::Reader a(frame.subspan(kRecordHeaderSize)), b(next.subspan(kRecordHeaderSize));
    while (a.left() && b.left()) {
        const std::span<const std::byte> first = placesOf(a), second = placesOf(b);
        if (first.empty() || !std::ranges::equal(first, second)) return false;
    }
    return !a.left() && !b.left();
}

}  // namespace rtsg::mirror
