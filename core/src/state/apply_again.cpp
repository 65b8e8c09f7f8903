// Applies a set that changes exactly the fields of the last set, if nobody reads sets: the path of a replica that is
// only looked at.
//
// What is the same in set after set is found once, from the entries of the first: where each value goes, and the seed
// of its term. Then a value costs its term and its copy, and reads a quarter of the memory that a set and its entries
// take, which is what counts where many replicas take turns. Terms are not kept one by one: all are replaced together.
#include <cstring>

#include "scene/plain_term.h"
#include "writing.h"

namespace rtsg {

void Scene::State::Targets::clear() {
    state = 0;
    if (all.capacity() > kEntriesKept) all = {};
    all.clear();
    runs.clear();
}

/// Whether they are of as many fields of these types, in this order.
bool Scene::State::areTargets(std::span<const PlainColumn> columns) const {
    if (targets.state == 0 || targets.state != sequence) return false;
    std::size_t run = 0;
    for (const PlainColumn& column : columns) {
        std::size_t count = 0;
        while (count < column.count && run < targets.runs.size()) {
            const Targets::Run& one = targets.runs[run++];
            if (one.field != column.field || one.type != column.type) return false;
            count += one.count;
        }
        if (count != column.count) return false;
    }
    return run == targets.runs.size();
}

bool Scene::State::addTarget(const WrittenField& entry, const PlainColumn& column, bool beginsColumn) {
    Node* const node = entry.node ? find(entry.node) : nullptr;
    if (!node || entry.nodeType == TypeIndex{} || entry.nodeType != node->typeIndex_ || entry.field != column.field ||
        entry.type != column.type || !entry.hashed)
        return false;
    const FieldSlot slot = node->type_->slot(entry.field);
    const std::byte* const fallback = node->type_->defaults() + slot.offset;
    if (beginsColumn || targets.runs.back().fallback != fallback)
        targets.runs.push_back(
            {.count = 0, .field = entry.field, .type = entry.type, .size = slot.size, .fallback = fallback});
    ++targets.runs.back().count;
    targets.all.push_back(
        {node->block() + slot.offset, hashSeed(entry.node, keyOf(*node, entry.field), HashTerm::field)});
    return true;
}

bool Scene::State::findTargets(std::span<const PlainColumn> columns) {
    std::size_t count = 0;
    for (const PlainColumn& column : columns) count += column.count;
    if (count == 0 || sealed->size() != count) return false;
    targets.clear();
    detail::TermSum sum;
    auto column = columns.begin();
    std::size_t inColumn = 0;
    for (const WrittenFields::Piece& piece : sealed->pieces())
        for (std::uint32_t i = 0; i < piece.count; ++i) {
            while (inColumn == column->count) ++column, inColumn = 0;
            const WrittenField& entry = piece.begin[i];
            if (!addTarget(entry, *column, inColumn++ == 0)) return false;
            sum.add(entry.term());
        }
    targets.terms = sum.value();
    targets.state = sequence;
    forgetTerms();  // they will be those of values of before
    return true;
}

[[gnu::flatten]] void Scene::State::writeTargets(std::span<const PlainColumn> columns) {
    detail::TermSum sum;
    const Targets::Target* target = targets.all.data();
    const Targets::Target* const end = target + targets.all.size();
    auto run = targets.runs.begin();
    const auto write = [&]<std::size_t size>(const std::byte* values) {
        constexpr std::ptrdiff_t kAhead = 24;
        const std::byte* const fallback = run->fallback;
        for (std::size_t i = 0; i < run->count; ++i, ++target, values += size) {
            if (end - target > kAhead) __builtin_prefetch(target[kAhead].at, 1);
            if (std::memcmp(values, fallback, size) != 0) sum.add(detail::hashOfSize<size>(values, target->seed));
            std::memcpy(target->at, values, size);
        }
        return values;
    };
    for (const PlainColumn& column : columns) {
        const std::byte* values = column.values;
        for (const std::byte* const last = values + column.count * info(column.type).size; values != last; ++run)
            values = detail::withPlainSize(run->size,
                                           [&]<std::size_t size>() { return write.template operator()<size>(values); });
    }
    hash.replace(targets.terms, sum.value());
    targets.terms = sum.value();
}

bool Scene::applyAgain(std::uint64_t to, double time, std::span<const PlainColumn> columns) {
    State& s = *state_;
    if (!s.checkOutsideFrame() || to <= s.sequence || s.hasPending() || s.recording || s.behavioursEnabled ||
        s.worldTransforms.watchesAny() || bus_->inDelivery() > 0 || bus_->subscribers() > 0)
        return false;
    if (!s.areTargets(columns) && !s.findTargets(columns)) return false;
    s.touched = UINT32_MAX;
    s.writeTargets(columns);
    s.sequence = s.targets.state = to;
    s.now = time;
    return true;
}

}  // namespace rtsg
