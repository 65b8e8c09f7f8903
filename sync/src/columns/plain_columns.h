// Plain columns: frames that have only raw columns of plain values. Their targets (fields of nodes) are separated from
// the values.
//
// Invariant: views point into the record that was read.
// Threading: none of its own.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/record.h>

#include "wire.h"

namespace rtsg::wire {

/// A block that is a raw column of values of one size.
struct RawColumn {
    std::span<const std::byte> keys;  // encoded fields and nodes of the values; empty for other blocks
    PlainColumn column;
};
/// Reads one block.
RawColumn readRawColumn(Reader& blocks);
/// Compares bytes. Standard algorithms would compare bytes of this type one by one.
bool areSame(std::span<const std::byte> a, std::span<const std::byte> b);

/// Finds frames that change the same fields as the last applied frame, as most frames of a scene in motion do.
class RepeatedColumns {
  public:
    /// Call it when Scene::apply() has applied an intact frame.
    void remember(std::span<const std::byte> record, const RecordHeader& header);
    /// Call it when anything else was applied.
    void forget() { targets_.clear(); }
    /// The columns of an intact frame, for Scene::applyAgain(), if it has the same fields of the same nodes as the
    /// frame remembered and nothing else. Otherwise empty.
    std::optional<std::span<const PlainColumn>> match(std::span<const std::byte> record, const RecordHeader& header);

  private:
    bool readAll(std::span<const std::byte> record, const RecordHeader& header);

    std::vector<RawColumn> read_;
    std::vector<PlainColumn> columns_;
    ByteBuffer targets_;  // for each column its count and its encoded targets
};

}  // namespace rtsg::wire
