// Remembers predicted values: finds a field, learns a value, forgets.
#include "value_history.h"

#include <algorithm>
#include <random>

#include <rtsg/sync/record.h>

namespace rtsg::wire {

namespace {

/// A random salt, so that nobody can choose node numbers that collide in the hash table.
std::uint32_t freshSalt() {
    static thread_local std::minstd_rand random(std::random_device{}());
    return static_cast<std::uint32_t>(random());
}

}  // namespace

std::uint32_t Table::search(std::uint32_t node) {
    if (index_.empty()) return kNoSlot;
    const std::size_t mask = index_.size() - 1;
    for (std::size_t at = home(node);; at = (at + 1) & mask) {
        const std::uint32_t slot = index_[at];
        if (slot == kNoSlot) return kNoSlot;
        if (slots[slot].node != node) continue;
        next_ = slot + 1;
        return slot;
    }
}

void Table::grow() {
    const std::size_t size = std::max<std::size_t>(64, index_.size() * 2);
    if (index_.empty()) salt_ = freshSalt();
    shift_ = 64 - std::countr_zero(size);
    index_.assign(size, kNoSlot);
    for (std::uint32_t i = 0; i < slots.size(); ++i) {
        std::size_t at = home(slots[i].node);
        while (index_[at] != kNoSlot) at = (at + 1) & (size - 1);
        index_[at] = i;
    }
}

std::uint32_t Table::findOrAdd(std::uint32_t node) {
    if (const std::uint32_t found = find(node); found != kNoSlot) return found;
    if (slots.size() * 2 >= index_.size()) grow();
    std::size_t at = home(node);
    while (index_[at] != kNoSlot) at = (at + 1) & (index_.size() - 1);
    const auto slot = static_cast<std::uint32_t>(slots.size());
    index_[at] = slot;
    slots.emplace_back().node = node;
    next_ = slot + 1;
    return slot;
}

ValueHistory::ValueHistory() = default;

void ValueHistory::begin(std::uint8_t flags) {
    ++stamp_;
    if (flags & kForget) tables_.clear();
    if (flags & (kForget | kSync)) sync_ = stamp_;
}

void ValueHistory::clear() {
    tables_.clear();
    sync_ = stamp_;
}

ValueHistory ValueHistory::clone() const {
    ValueHistory copy;
    copy.stamp_ = stamp_;
    copy.sync_ = sync_;
    for (const Entry& entry : tables_) {
        auto table = std::make_unique<Table>();
        table->type = entry.table->type;
        table->step = entry.table->step;
        for (const Slot& slot : entry.table->slots) table->slots[table->findOrAdd(slot.node)] = slot;
        table->modelsSince = entry.table->modelsSince;
        for (std::size_t i = 0; i < table->models.size(); ++i)
            if (entry.table->models[i])
                table->models[i] = std::make_unique<std::array<NumberModel, 5>>(*entry.table->models[i]);
        copy.tables_.push_back({entry.field, std::move(table)});
    }
    return copy;
}

Table& ValueHistory::table(FieldIndex field, FieldType type) {
    for (const Entry& entry : tables_)
        if (entry.field == field && entry.table->type == type) return *entry.table;
    Table& table = *tables_.emplace_back(Entry{field, std::make_unique<Table>()}).table;
    table.type = type;
    return table;
}

NumberModel* ValueHistory::models(Table& table, bool grid) {
    auto& models = table.models[grid];
    if (!models || table.modelsSince[grid] != sync_) {
        models = std::make_unique<std::array<NumberModel, 5>>();
        table.modelsSince[grid] = sync_;
    }
    return models->data();
}

std::size_t ValueHistory::slots() const {
    std::size_t count = 0;
    for (const Entry& entry : tables_) count += entry.table->slots.size();
    return count;
}

void ValueHistory::bring(Table& table, Slot& slot, bool grid) const {
    if (slot.onGrid == grid) return;
    slot.onGrid = grid;
    const auto lanes = static_cast<std::size_t>(lanesOf(table.type));
    for (auto& value : slot.past) {
        float floats[4] = {};
        if (grid) {
            for (std::size_t l = 0; l < lanes; ++l) floats[l] = std::bit_cast<float>(toFloatBits(value[l]));
            toGrid(table.type, floats, table.step, value.data());
        } else {
            fromGrid(table.type, value.data(), table.step, floats);
            for (std::size_t l = 0; l < lanes; ++l) value[l] = fromFloat(floats[l]);
        }
    }
}

void ValueHistory::setStep(Table& table, double step) const {
    if (table.step == step) return;
    for (Slot& slot : table.slots) bring(table, slot, false);
    table.step = step;
}

void ValueHistory::learnRaw(Table& table, std::uint32_t node, const float* floats) {
    Slot& slot = table.slots[table.findOrAdd(node)];
    bring(table, slot, false);
    std::int32_t now[4] = {}, residuals[4];
    const int lanes = lanesOf(table.type);
    for (int l = 0; l < lanes; ++l) now[l] = fromFloat(floats[l]);
    if (slot.depth == 0) {
        for (std::size_t l = 0; l < 4; ++l) slot.past[0][l] = now[l];
        slot.depth = 1;
        slot.sizes.fill(kUnknownSize);
        slot.stamp = stamp_;
        return;
    }
    const Forecast f = forecast<4>(slot, false);
    for (int l = 0; l < 4; ++l) residuals[l] = difference(now[l], chosen(slot, f, l));
    learn<4>(slot, f, now, residuals);
}

}  // namespace rtsg::wire
