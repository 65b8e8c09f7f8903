// Predicted columns: codings 1 (packed) and 2 (ranged) of PROTOCOL.md, "Prediction".
//
// Invariant: writer and reader go through the same rows in the same order and learn the same from them. A predicted
// column has only fields that came before in the stream. New fields go in a raw column, from which both learn, too.
// Threading: one thread an object.
#pragma once

#include <span>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/stream_mode.h>

#include "value_history.h"
#include "wire.h"

namespace rtsg::wire {

/// The properties of a column that stand before its nodes.
struct ColumnHead {
    FieldIndex field = 0;
    FieldType type = FieldType::SFFloat;
    bool external = false;
};

void putColumnHead(ByteBuffer& out, unsigned coding, const ColumnHead& head);

class ColumnWriter {
  public:
    explicit ColumnWriter(const StreamMode& mode) : mode_(mode) {}

    ValueHistory& history() { return history_; }
    void begin(std::uint8_t flags) {
        history_.begin(flags);
        lastNodes_.clear();
    }
    /// Appends up to three blocks. `values` has lanesOf(type) floats for each node.
    void write(const ColumnHead& head, std::span<const std::uint32_t> nodes, const float* values, ByteBuffer& record);

  private:
    struct Row {
        std::uint32_t node, slot, index;
    };
    void writeRaw(const ColumnHead& head, Table& table, const float* values, ByteBuffer& record);
    void writeCoded(const ColumnHead& head, Table& table, bool grid, const std::vector<Row>& rows, const float* values,
                    ByteBuffer& record);
    void putNodes(const std::vector<Row>& rows, unsigned& form);
    template <int Lanes, bool Grid>
    void putRows(Table& table, const std::vector<Row>& rows, const float* values, bool gaps);

    StreamMode mode_;
    ValueHistory history_;
    std::vector<Row> coded_[2], raw_;
    std::vector<std::uint32_t> lastNodes_;
    ByteBuffer body_, nodes_, ranged_, bits_;
};

class ColumnReader {
  public:
    ValueHistory& history() { return history_; }
    const ValueHistory& history() const { return history_; }
    void begin(std::uint8_t flags) {
        history_.begin(flags);
        lastNodes_.clear();
    }
    /// `in` stands behind the column's head; `coding` is 1 or 2.
    void read(Reader& in, std::size_t count, unsigned coding, const ColumnHead& head, ChangeSet& set);
    /// Learns from a raw column, which has the changes from `first` on.
    void remember(const ColumnHead& head, const ChangeSet& set, std::size_t first);

  private:
    bool readNodes(Reader& in, std::size_t count, unsigned form);
    template <class T, bool Grid, class Source>
    void readRows(Reader& in, Source& source, std::size_t count, const ColumnHead& head, Table& table, ChangeSet& set);

    ValueHistory history_;
    std::vector<std::uint32_t> lastNodes_;
};

}  // namespace rtsg::wire
