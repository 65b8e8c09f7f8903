// Reads predicted columns: the nodes, then each value from its forecast and its residual.
#include <type_traits>

#include "blocks.h"
#include "column_codec.h"
#include "column_rows.h"

namespace rtsg::wire {

namespace {

struct Packed {
    BitReader bits;
    std::int32_t get(int, unsigned expected, unsigned&) { return getPacked(bits, expected); }
};

struct Ranged {
    RangeDecoder range;
    BitReader bits;
    NumberModel* models;
    bool gaps;
    std::uint32_t last = 0;
    unsigned gapSize = kUnknownSize;

    std::int32_t get(int lane, unsigned expected, unsigned& size) {
        return getNumber(range, bits, models[lane], expected, size);
    }
    std::uint32_t node() {
        last += static_cast<std::uint32_t>(getNumber(range, bits, models[4], gapSize, gapSize));
        return last;
    }
};

}  // namespace

/// Fills lastNodes_. Returns false after a problem.
bool ColumnReader::readNodes(Reader& in, std::size_t count, unsigned form) {
    if (form == kNodesSame) {
        if (lastNodes_.size() != count) in.refuse("the nodes of a column before that is not there");
        return !in.problem;
    }
    lastNodes_.clear();
    std::uint32_t last = 0;
    if (form == kNodesDeltas) {
        if (count > in.left()) in.refuse("count exceeds the bytes that follow");
        for (std::size_t i = 0; i < count && !in.problem; ++i) lastNodes_.push_back(last = in.delta(last));
    } else if (form == kNodesRuns) {
        const std::size_t runs = in.count(2);
        for (std::size_t i = 0; i < runs && !in.problem; ++i) {
            last = in.delta(last);
            const std::uint64_t more = in.bounded(count);
            if (lastNodes_.size() + more + 1 > count) in.refuse("runs of more nodes than the column has");
            const std::uint64_t coded = more && !in.problem ? in.bounded(0x1FFFFFFFF) : 0;
            const auto step = static_cast<std::int64_t>(coded >> 1 ^ (~(coded & 1) + 1));
            const std::int64_t end = std::int64_t{last} + step * static_cast<std::int64_t>(in.problem ? 0 : more);
            if (end < 0 || end > 0xFFFFFFFF) in.refuse("node number out of range");
            if (in.problem) break;
            for (std::uint64_t k = 0; k <= more; ++k)
                lastNodes_.push_back(static_cast<std::uint32_t>(std::int64_t{last} + step * std::int64_t(k)));
            last = lastNodes_.back();
        }
        if (!in.problem && lastNodes_.size() != count) in.refuse("runs of fewer nodes than the column has");
    }
    return !in.problem;
}

template <class T, bool Grid, class Source>
void ColumnReader::readRows(Reader& in, Source& source, std::size_t count, const ColumnHead& head, Table& table,
                            ChangeSet& set) {
    constexpr int kLanes = Grid ? gridLanesOf(FieldTypeOf<T>::value) : lanesOf(FieldTypeOf<T>::value);
    constexpr bool kRotation = std::is_same_v<T, Rotation>;
    static_assert(sizeof(T) == lanesOf(FieldTypeOf<T>::value) * sizeof(float));
    for (std::size_t i = 0; i < count; ++i) {
        std::uint32_t node = 0;
        if constexpr (std::is_same_v<Source, Ranged>) {
            if (source.gaps) lastNodes_.push_back(source.node());
        }
        node = lastNodes_[i];
        const std::uint32_t at = table.find(node);
        if (at == kNoSlot) return in.refuse("predicted value of a field that the stream has not given before");
        Slot& slot = table.slots[at];
        if (!history_.fresh(slot)) return in.refuse("predicted value of a field that the record has set already");
        history_.bring(table, slot, Grid);
        std::int32_t now[4] = {};
        codeRow<kLanes, Grid>(history_, slot, kRotation, now,
                              [&](int l, std::int32_t p, std::int32_t& v, std::int32_t& residual) {
                                  unsigned size = 0;
                                  residual = source.get(l, history_.expectedSize(slot, l), size);
                                  v = sum(p, residual);
                              });
        float floats[4];
        if constexpr (Grid)
            fromGrid(FieldTypeOf<T>::value, now, table.step, floats);
        else
            for (int l = 0; l < kLanes; ++l) floats[l] = std::bit_cast<float>(toFloatBits(now[l]));
        T value;
        std::memcpy(static_cast<void*>(&value), floats, sizeof(T));
        Change& change = set.changes.emplace_back();
        change.node = NodeId{node};
        change.field = head.field;
        change.external = head.external;
        change.value = Value(value);
        if (source.bits.overrun()) return in.refuse("residuals cut short");
    }
}

void ColumnReader::read(Reader& in, std::size_t count, unsigned coding, const ColumnHead& head, ChangeSet& set) {
    const unsigned form = in.number<std::uint8_t>();
    const bool grid = form & kFormGrid;
    const unsigned list = form >> 1;
    if (lanesOf(head.type) == 0) return in.refuse("values of this type are not predicted");
    if (list > kNodesGaps || (list == kNodesGaps && coding != kCodingRanged)) return in.refuse("unknown list of nodes");
    Table& table = history_.table(head.field, head.type);
    if (count > table.slots.size()) return in.refuse("more predicted values than fields that the stream has given");
    if (grid) {
        const double step = in.number<double>();
        if (!(step > 0) || !std::isfinite(step)) return in.refuse("a grid without a width");
        history_.setStep(table, step);
    }
    if (list == kNodesGaps) {
        lastNodes_.clear();
    } else if (!readNodes(in, count, list)) {
        return;
    }
    const auto rows = [&](auto& source) {
        switch (head.type) {
#define RTSG_ROWS(suffix, T)                                         \
    case FieldType::SF##suffix:                                      \
        if (grid)                                                    \
            readRows<T, true>(in, source, count, head, table, set);  \
        else                                                         \
            readRows<T, false>(in, source, count, head, table, set); \
        break;
            RTSG_ROWS(Float, float)
            RTSG_ROWS(Vec2f, Vec2f)
            RTSG_ROWS(Vec3f, Vec3f)
            RTSG_ROWS(Color, Color)
            RTSG_ROWS(Vec4f, Vec4f)
            RTSG_ROWS(ColorRGBA, ColorRGBA)
            RTSG_ROWS(Rotation, Rotation)
#undef RTSG_ROWS
            default:
                break;
        }
        if (!in.problem && source.bits.left() > 0) in.refuse("bytes after a column's last value");
        in.at = in.end;
    };
    if (coding == kCodingRanged) {
        const std::size_t length = in.count(1);
        const std::span<const std::byte> bytes(in.at, length);
        in.at += length;
        Ranged source{RangeDecoder(bytes), BitReader({in.at, in.left()}), history_.models(table, grid),
                      list == kNodesGaps};
        rows(source);
    } else {
        Packed source{BitReader({in.at, in.left()})};
        rows(source);
    }
}

void ColumnReader::remember(const ColumnHead& head, const ChangeSet& set, std::size_t first) {
    const int lanes = lanesOf(head.type);
    if (lanes == 0) return;
    Table& table = history_.table(head.field, head.type);
    for (std::size_t i = first; i < set.changes.size(); ++i) {
        float floats[4];
        std::memcpy(floats, set.changes[i].value.storage(), static_cast<std::size_t>(lanes) * sizeof(float));
        history_.learnRaw(table, set.changes[i].node.value, floats);
    }
}

}  // namespace rtsg::wire
