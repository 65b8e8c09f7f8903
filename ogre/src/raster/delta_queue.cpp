// Keeps deltas until they are taken, and merges old ones where they are too many.
#include "delta_queue.h"

#include <map>
#include <set>
#include <utility>

namespace rtsg {

void DeltaQueue::add(const InstanceDelta& delta) {
    const bool concerns = !delta.removed.empty() || !delta.added.empty() || !delta.moved.empty() ||
                          !delta.rebound.empty() || !delta.geometries.empty() || !delta.geometriesRemoved.empty() ||
                          !delta.appearanceChanged.empty();
    if (!concerns) return;
    Entry entry;
    entry.first = entry.last = ++newest_;
    entry.delta.removed = delta.removed, entry.delta.added = delta.added, entry.delta.moved = delta.moved;
    entry.delta.rebound = delta.rebound, entry.delta.geometries = delta.geometries;
    entry.delta.geometriesRemoved = delta.geometriesRemoved;
    entry.delta.appearanceChanged = delta.appearanceChanged;
    const std::scoped_lock lock(mutex_);
    entries_.push_back(std::move(entry));
    if (entries_.size() <= kMax) return;
    // The newest stay apart: a picture may just be about to be made of one of their states.
    std::vector<const InstanceDelta*> old;
    for (std::size_t i = 0; i < kMax / 2; ++i) old.push_back(&entries_[i].delta);
    Entry all{entries_[0].first, entries_[old.size() - 1].last, mergedDelta(old)};
    entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(old.size()));
    entries_.push_front(std::move(all));
}

std::optional<std::vector<InstanceDelta>> DeltaQueue::take(std::uint64_t last) {
    const std::scoped_lock lock(mutex_);
    if (taken_ > last || (!entries_.empty() && entries_.front().first <= last && entries_.front().last > last))
        return std::nullopt;
    std::vector<InstanceDelta> taken;
    while (!entries_.empty() && entries_.front().last <= last) {
        taken_ = entries_.front().last;
        taken.push_back(std::move(entries_.front().delta));
        entries_.pop_front();
    }
    return taken;
}

InstanceDelta mergedDelta(const std::vector<const InstanceDelta*>& deltas) {
    std::map<std::uint32_t, InstanceDelta::Geometry> geometries;
    std::map<std::uint32_t, std::pair<InstanceId, std::optional<Instance>>> instances;  // by slot; null: removed
    std::map<std::uint32_t, InstanceDelta::Moved> moved;                                // of those not among them
    std::set<std::uint32_t> appearances;
    const auto put = [&](const Instance& instance) {
        instances[instance.id.slot] = {instance.id, instance};
        moved.erase(instance.id.slot);
    };
    for (const InstanceDelta* delta : deltas) {
        for (const InstanceDelta::Geometry& geometry : delta->geometries) geometries[geometry.node.value] = geometry;
        for (const InstanceId& id : delta->removed) {
            instances[id.slot] = {id, std::nullopt};
            moved.erase(id.slot);
        }
        for (const Instance& instance : delta->added) put(instance);
        for (const Instance& instance : delta->rebound) put(instance);
        for (const InstanceDelta::Moved& move : delta->moved) {
            const auto found = instances.find(move.id.slot);
            if (found == instances.end())
                moved[move.id.slot] = move;
            else if (found->second.second)
                found->second.second->worldFromLocal = move.worldFromLocal;
        }
        for (const NodeId appearance : delta->appearanceChanged) appearances.insert(appearance.value);
        for (const NodeId node : delta->geometriesRemoved) geometries[node.value] = {node, nullptr};
    }
    InstanceDelta all;
    all.sequence = deltas.empty() ? 0 : deltas.back()->sequence;
    for (auto& [node, geometry] : geometries) all.geometries.push_back(std::move(geometry));
    for (auto& [slot, entry] : instances) {
        if (entry.second)
            all.added.push_back(std::move(*entry.second));
        else
            all.removed.push_back(entry.first);
    }
    for (const auto& [slot, move] : moved) all.moved.push_back(move);
    for (const std::uint32_t appearance : appearances) all.appearanceChanged.push_back(NodeId{appearance});
    return all;
}

}  // namespace rtsg
