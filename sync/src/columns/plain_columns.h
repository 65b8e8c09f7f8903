// Frames that are columns of plain values and nothing else: what says where the values go, apart from the values.
//
// Invariant: views point into the record that was read. Threading: none of its own.
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
    std::span<const std::byte> places;  // what says which field of which nodes; empty if the block is something else
    PlainColumn column;
};
/// Reads one block.
RawColumn readRawColumn(Reader& blocks);
/// Standard algorithms compare bytes of this type one by one.
bool areSame(std::span<const std::byte> a, std::span<const std::byte> b);

/// Finds out which frames give anew just what the last frame that was applied gave: most frames of a scene in motion.
class RepeatedColumns {
  public:
    /// An intact frame was applied to the scene by Scene::apply().
    void remember(std::span<const std::byte> record, const RecordHeader& header);
    /// Something else was.
    void forget() { places_.clear(); }
    /// The columns of an intact frame that has the same fields of the same nodes as the one remembered, for
    /// Scene::applyAgain(); nothing if it has others, or anything else.
    std::optional<std::span<const PlainColumn>> match(std::span<const std::byte> record, const RecordHeader& header);

  private:
    bool readAll(std::span<const std::byte> record, const RecordHeader& header);

    std::vector<RawColumn> read_;
    std::vector<PlainColumn> columns_;
    ByteBuffer places_;  // of each column its count and what says where its values go
};

}  // namespace rtsg::wire
