// Versions of the world: made from lists of pages, and released when their readers are done.
#include <utility>

#include "ray_world_impl.h"

namespace rtsg {

std::shared_ptr<const WorldVersion> RayWorld::Impl::freeze(const std::shared_ptr<Impl>& self, const RayView& view) {
    if (auto last = newest.lock(); last && last->version() == view.version() && newestSwaps == swaps) return last;
    refresh();
    const std::size_t number = versions.hold();
    if (number == bvh::Versions::kMax) return nullptr;
    if (!snapshots[number]) snapshots[number] = std::make_unique<Snapshot>();
    Snapshot& snapshot = *snapshots[number];
    snapshot.tables.top = top.freeze(snapshot.top);
    snapshot.tables.strokes = strokes.freeze(snapshot.strokes);
    snapshot.tables.badRays.store(0, std::memory_order_relaxed);
    instances.freezeInto(snapshot.instances);
    snapshot.version.take(view, snapshot.tables, {snapshot.instances.data(), instances.size()});
    // The version keeps the world's memory alive, and no longer than somebody reads it: `newest` may outlive that.
    std::shared_ptr<const WorldVersion> frozen(&snapshot.version, [owner = self, number](const WorldVersion*) mutable {
        const std::shared_ptr<Impl> last = std::move(owner);
        last->versions.release(number);
    });
    newest = frozen;
    newestSwaps = swaps;
    return frozen;
}

void RayWorld::Impl::refresh() {
    if (!versions.anyHeld() || !versions.refresh()) return;
    instances.sweep();
    top.sweep();
    strokes.sweep();
    std::erase_if(unsettled, [&](Cluster* cluster) {
        cluster->unsettled = !cluster->group->settle(versions.sees(cluster->stamp) ? versions.heldBits() : 0);
        return !cluster->unsettled;
    });
    if (auto unseen = versions.takeUnseen(); !unseen.empty() && options.background)
        worker->start([gone = std::make_shared<decltype(unseen)>(std::move(unseen))] {});
}

std::uint32_t RayWorld::Impl::heldBits(const Cluster& cluster) {
    if (!versions.sees(cluster.stamp)) return 0;
    versions.leaveHeldEpoch();
    return versions.heldBits();
}

void RayWorld::Impl::noteUnsettled(Cluster& cluster) {
    if (versions.anyHeld() && !std::exchange(cluster.unsettled, true)) unsettled.push_back(&cluster);
}

void RayWorld::Impl::makeWritable(Cluster& cluster) {
    if (!versions.sees(cluster.stamp)) return;
    auto copy = cluster.group->copy(device);
    discard(cluster);
    cluster.group = std::move(copy);
    cluster.stamp = versions.serial();
    top.setGroup(cluster.object, *cluster.group);
}

}  // namespace rtsg
