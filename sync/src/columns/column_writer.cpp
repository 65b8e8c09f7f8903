// Writes columns: raw for fields that are new to the stream, predicted for the others.
#include <algorithm>

#include "blocks.h"
#include "column_codec.h"
#include "column_rows.h"

namespace rtsg::wire {

namespace {

/// Runs of nodes with a fixed step. Each has the delta to the last node of the run before, length - 1, and the step.
struct Runs {
    ByteBuffer& out;
    std::uint64_t count = 0;

    static std::uint64_t zigzag64(std::int64_t number) {
        return static_cast<std::uint64_t>(number) << 1 ^ static_cast<std::uint64_t>(number >> 63);
    }
    /// Returns false if they take more than a byte for each node.
    bool put(std::size_t rows, const auto& nodeAt) {
        std::uint32_t last = 0;
        for (std::size_t i = 0; i < rows;) {
            const std::uint32_t first = nodeAt(i);
            std::size_t end = i + 1;
            std::int64_t step = 0;
            if (end < rows) {
                step = std::int64_t{nodeAt(end)} - first;
                while (end < rows && std::int64_t{nodeAt(end)} - nodeAt(end - 1) == step) ++end;
                if (end - i < 3) end = i + 1;
            }
            out.putVarint(zigzag(first, last));
            out.putVarint(end - i - 1);
            if (end - i > 1) out.putVarint(zigzag64(step));
            last = nodeAt(end - 1);
            i = end;
            ++count;
            if (out.size() > rows) return false;
        }
        return true;
    }
};

void putBlock(ByteBuffer& record, std::uint64_t count, const ByteBuffer& body) {
    record.put(static_cast<std::uint8_t>(kValues));
    record.putVarint(count);
    record.putVarint(body.size());
    record.append(body.bytes());
}

}  // namespace

void putColumnHead(ByteBuffer& out, unsigned coding, const ColumnHead& head) {
    out.put(static_cast<std::uint8_t>(coding));
    out.put(static_cast<std::uint8_t>(head.external ? kValueExternal : 0));
    out.put(static_cast<std::uint8_t>(head.type));
    out.putVarint(head.field);
}

void ColumnWriter::write(const ColumnHead& head, std::span<const std::uint32_t> nodes, const float* values,
                         ByteBuffer& record) {
    Table& table = history_.table(head.field, head.type);
    const auto lanes = static_cast<std::size_t>(lanesOf(head.type));
    const double step = mode_.mode == Mode::lossy ? gridStep(head.type, mode_.maxError) : 0;
    for (auto& rows : coded_) rows.clear();
    raw_.clear();
    if (step > 0) history_.setStep(table, step);
    for (std::uint32_t i = 0; i < nodes.size(); ++i) {
        const Row row{nodes[i], table.find(nodes[i]), i};
        if (row.slot == kNoSlot || !table.claim(row.slot, history_.stamp())) {
            raw_.push_back(row);
            continue;
        }
        bool grid = false;
        if (step > 0) {
            std::int32_t numbers[4];
            float back[4];
            toGrid(head.type, values + i * lanes, step, numbers);
            fromGrid(head.type, numbers, step, back);
            grid = std::memcmp(back, values + i * lanes, lanes * sizeof(float)) == 0;
        }
        coded_[grid].push_back(row);
    }
    for (const bool grid : {true, false})
        if (!coded_[grid].empty()) writeCoded(head, table, grid, coded_[grid], values, record);
    if (!raw_.empty()) writeRaw(head, table, values, record);
}

void ColumnWriter::writeRaw(const ColumnHead& head, Table& table, const float* values, ByteBuffer& record) {
    const auto lanes = static_cast<std::size_t>(lanesOf(head.type));
    body_.clear();
    putColumnHead(body_, kCodingRaw, head);
    std::uint32_t last = 0;
    for (const Row& row : raw_) {
        body_.putVarint(zigzag(row.node, last));
        last = row.node;
    }
    for (const Row& row : raw_) {
        body_.append(values + row.index * lanes, lanes * sizeof(float));
        history_.learnRaw(table, row.node, values + row.index * lanes);
    }
    putBlock(record, raw_.size(), body_);
}

/// Writes the shortest list of nodes that needs no range coder, and sets `form` accordingly.
void ColumnWriter::putNodes(const std::vector<Row>& rows, unsigned& form) {
    nodes_.clear();
    if (std::ranges::equal(rows, lastNodes_, {}, &Row::node)) {
        form = kNodesSame;
        return;
    }
    lastNodes_.clear();
    for (const Row& row : rows) lastNodes_.push_back(row.node);
    bits_.clear();
    Runs runs{bits_};
    if (runs.put(rows.size(), [&](std::size_t i) { return rows[i].node; })) {
        form = kNodesRuns;
        nodes_.putVarint(runs.count);
        nodes_.append(bits_.bytes());
        return;
    }
    form = kNodesDeltas;
    if (mode_.coding == Coding::smallest) {
        std::uint32_t last = 0;
        bool near = true;
        for (const Row& row : rows) {
            near = near && (row.node > last ? row.node - last : last - row.node) < 1u << 30;
            last = row.node;
        }
        if (near) {
            form = kNodesGaps;
            return;
        }
    }
    std::uint32_t last = 0;
    for (const Row& row : rows) {
        nodes_.putVarint(zigzag(row.node, last));
        last = row.node;
    }
}

template <int Lanes, bool Grid>
void ColumnWriter::putRows(Table& table, const std::vector<Row>& rows, const float* values, bool gaps) {
    const bool rotation = table.type == FieldType::SFRotation;
    const auto lanes = static_cast<std::size_t>(lanesOf(table.type));
    const auto numbersOf = [&](const Row& row, std::int32_t* now) {
        const float* floats = values + row.index * lanes;
        if constexpr (Grid)
            toGrid(table.type, floats, table.step, now);
        else
            for (int l = 0; l < Lanes; ++l) now[l] = fromFloat(floats[l]);
    };
    ranged_.clear();
    bits_.clear();
    BitWriter bits(bits_);
    std::int32_t now[4];
    if (mode_.coding == Coding::smallest) {
        NumberModel* models = history_.models(table, Grid);
        RangeEncoder range(ranged_);
        std::uint32_t last = 0;
        unsigned gapSize = kUnknownSize;
        for (const Row& row : rows) {
            Slot& slot = table.slots[row.slot];
            history_.bring(table, slot, Grid);
            if (gaps) {
                gapSize = putNumber(range, bits, models[4], gapSize, static_cast<std::int32_t>(row.node - last));
                last = row.node;
            }
            numbersOf(row, now);
            codeRow<Lanes, Grid>(history_, slot, rotation, now,
                                 [&](int l, std::int32_t p, std::int32_t v, std::int32_t& residual) {
                                     residual = difference(v, p);
                                     putNumber(range, bits, models[l], history_.expectedSize(slot, l), residual);
                                 });
        }
        range.finish();
    } else {
        for (const Row& row : rows) {
            Slot& slot = table.slots[row.slot];
            history_.bring(table, slot, Grid);
            numbersOf(row, now);
            codeRow<Lanes, Grid>(history_, slot, rotation, now,
                                 [&](int l, std::int32_t p, std::int32_t v, std::int32_t& residual) {
                                     residual = difference(v, p);
                                     putPacked(bits, history_.expectedSize(slot, l), residual);
                                 });
        }
    }
    bits.finish();
}

void ColumnWriter::writeCoded(const ColumnHead& head, Table& table, bool grid, const std::vector<Row>& rows,
                              const float* values, ByteBuffer& record) {
    unsigned form = 0;
    putNodes(rows, form);
    const bool gaps = form == kNodesGaps;
    switch (grid ? 10 + gridLanesOf(head.type) : lanesOf(head.type)) {
#define RTSG_LANES(n)                                 \
    case n:                                           \
        putRows<n, false>(table, rows, values, gaps); \
        break;                                        \
    case 10 + n:                                      \
        putRows<n, true>(table, rows, values, gaps);  \
        break;
        RTSG_LANES(1)
        RTSG_LANES(2)
        RTSG_LANES(3)
        RTSG_LANES(4)
#undef RTSG_LANES
        default:
            return;
    }
    body_.clear();
    const bool ranged = mode_.coding == Coding::smallest;
    putColumnHead(body_, ranged ? kCodingRanged : kCodingPacked, head);
    body_.put(static_cast<std::uint8_t>((grid ? kFormGrid : 0) | form << 1));
    if (grid) body_.put(table.step);
    body_.append(nodes_.bytes());
    if (ranged) {
        body_.putVarint(ranged_.size());
        body_.append(ranged_.bytes());
    }
    body_.append(bits_.bytes());
    putBlock(record, rows.size(), body_);
}

}  // namespace rtsg::wire
