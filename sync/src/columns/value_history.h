// ValueHistory: the last values of every field in a stream, and how well they were predicted. It is the same on both
// sides (PROTOCOL.md, "Prediction").
//
// Invariant: its content depends on the records since the last kForget. Predictions depend on those since the last
// kSync, and on the last values before that. So a reader that got those values another way, as in merged frames, can go
// on from any kSync.
// Threading: one thread an object.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <rtsg/core/node_type.h>

#include "range_coder.h"

namespace rtsg::wire {

constexpr std::uint32_t kNoSlot = 0xFFFFFFFF;

/// One field of one node: up to three values, newest first, as numbers (lanes.h).
struct Slot {
    std::uint32_t node = 0;
    std::uint32_t stamp = 0;              // the record that wrote it last
    std::uint8_t depth = 0;               // values known, at most 3
    bool onGrid = false;                  // the numbers are on a grid; if not, they are bits of floats
    std::uint16_t orders = 0;             // 2 bits a lane: the extrapolation that was nearest last time
    std::array<std::uint8_t, 4> sizes{};  // bits of the last residual's magnitude
    std::array<std::array<std::int32_t, 4>, 3> past{};

    int order(int lane) const { return orders >> (2 * lane) & 3; }
};
static_assert(sizeof(Slot) == 64);

/// Forecasts of each lane's next value, by order of extrapolation.
struct Forecast {
    std::array<std::array<std::int32_t, 4>, 3> of{};
    int depth = 0;
};

/// All values of one field index and type.
struct Table {
    FieldType type = FieldType::SFFloat;
    double step = 0;  // width of the grid; 0: none yet
    std::vector<Slot> slots;
    std::array<std::unique_ptr<std::array<NumberModel, 5>>, 2>
        models;                                  // off and on the grid; the last model is for nodes
    std::array<std::uint32_t, 2> modelsSince{};  // the sync since which they are valid

    /// kNoSlot if the node is not here. Fast if nodes come in the same order as before.
    std::uint32_t find(std::uint32_t node) {
        if (next_ < slots.size() && slots[next_].node == node) return next_++;
        return search(node);
    }
    std::uint32_t findOrAdd(std::uint32_t node);
    /// Returns false if the slot was claimed with this stamp before. The writer detects by it a field that comes twice.
    bool claim(std::uint32_t slot, std::uint32_t stamp) {
        if (claims_.size() < slots.size()) claims_.resize(slots.size());
        return std::exchange(claims_[slot], stamp) != stamp;
    }

  private:
    std::uint32_t search(std::uint32_t node);
    void grow();
    std::size_t home(std::uint32_t node) const {
        return static_cast<std::uint64_t>(node ^ salt_) * 0x9E3779B97F4A7C15u >> shift_;
    }

    std::vector<std::uint32_t> claims_;
    std::vector<std::uint32_t> index_;  // open addressing; kNoSlot: free
    int shift_ = 64;
    std::uint32_t next_ = 0, salt_ = 0;
};

class ValueHistory {
  public:
    ValueHistory();
    /// Begins a record with these flags (record.h).
    void begin(std::uint8_t flags);
    void clear();
    ValueHistory clone() const;

    Table& table(FieldIndex field, FieldType type);
    NumberModel* models(Table& table, bool grid);
    std::size_t slots() const;

    /// From now on the slot's values are read as of this kind.
    void bring(Table& table, Slot& slot, bool grid) const;
    void setStep(Table& table, double step) const;
    std::uint32_t stamp() const { return stamp_; }
    bool fresh(const Slot& slot) const { return slot.stamp != stamp_; }
    /// True if more than the last value counts.
    bool current(const Slot& slot) const { return slot.stamp >= sync_; }
    unsigned expectedSize(const Slot& slot, int lane) const {
        return current(slot) ? slot.sizes[static_cast<std::size_t>(lane)] : kUnknownSize;
    }

    template <int Lanes>
    Forecast forecast(const Slot& slot, bool grid) const {
        Forecast f;
        f.depth = current(slot) ? slot.depth : 1;
        for (std::size_t l = 0; l < Lanes; ++l) {
            const std::int32_t a = slot.past[0][l], b = slot.past[1][l], c = slot.past[2][l];
            f.of[0][l] = a;
            if (f.depth > 1) f.of[1][l] = grid ? extrapolateGrid(a, b, c, 1) : extrapolateFloat(a, b, c, 1);
            if (f.depth > 2) f.of[2][l] = grid ? extrapolateGrid(a, b, c, 2) : extrapolateFloat(a, b, c, 2);
        }
        return f;
    }
    static std::int32_t chosen(const Slot& slot, const Forecast& f, int lane) {
        const int order = f.depth > 1 ? slot.order(lane) : 0;
        return f.of[static_cast<std::size_t>(order < f.depth ? order : f.depth - 1)][static_cast<std::size_t>(lane)];
    }
    /// `now` is the value, `residuals` its differences from the prediction.
    template <int Lanes>
    void learn(Slot& slot, const Forecast& f, const std::int32_t* now, const std::int32_t* residuals) const {
        unsigned orders = 0;
        for (std::size_t l = 0; l < Lanes; ++l) {
            unsigned best = 0;
            if (f.depth == 1) best = 1;  // there is nothing to compare yet, and motion mostly continues
            std::uint32_t minimum = magnitude(difference(now[l], f.of[0][l]));
            for (std::size_t o = 1; o < static_cast<std::size_t>(f.depth); ++o) {
                const std::uint32_t miss = magnitude(difference(now[l], f.of[o][l]));
                if (miss < minimum) {
                    minimum = miss;
                    best = static_cast<unsigned>(o);
                }
            }
            orders |= best << (2 * l);
            slot.sizes[l] = static_cast<std::uint8_t>(std::bit_width(magnitude(residuals[l])));
            slot.past[2][l] = slot.past[1][l];
            slot.past[1][l] = slot.past[0][l];
            slot.past[0][l] = now[l];
        }
        for (std::size_t l = Lanes; l < 4; ++l) slot.sizes[l] = kUnknownSize;
        slot.orders = static_cast<std::uint16_t>(orders);
        slot.depth = static_cast<std::uint8_t>(f.depth < 3 ? f.depth + 1 : 3);
        slot.stamp = stamp_;
    }
    /// Learns from a raw value.
    void learnRaw(Table& table, std::uint32_t node, const float* floats);

  private:
    struct Entry {
        FieldIndex field;
        std::unique_ptr<Table> table;
    };
    std::vector<Entry> tables_;
    std::uint32_t stamp_ = 0, sync_ = 0;
};

}  // namespace rtsg::wire
