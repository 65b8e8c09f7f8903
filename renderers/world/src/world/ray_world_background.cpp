// Merges instances that have rested, and rebuilds merged BVHs without those that were taken out, on a thread of its
// own.
//
// apply() lists the members, a worker copies and builds, and a later apply() takes the result; members that have
// changed meanwhile are hidden in it. Listing and taking cost apply() some tens of nanoseconds a member; building costs
// it nothing. RayWorld::Options::restFrames says how often.
#include <algorithm>
#include <utility>

#include "ray_world_impl.h"

namespace rtsg {

namespace {

/// So many that wait are looked at in one apply().
constexpr int kLooks = 256;
/// An instance that is known to be able to move must rest longer, since merging it is more likely to be wrong.
constexpr int kForeseenDoublings = 4;
/// Whether to merge is considered in one apply() of so many.
constexpr std::uint32_t kEvery = 8;
/// Resting ones that are worth a BVH of their own while the larger ones may not be rebuilt yet.
constexpr std::size_t kWorthwhile = 16;

bool later(const auto& a, const auto& b) {
    return a.due > b.due;
}

}  // namespace

struct RayWorld::Impl::Merge {
    struct Piece {
        InstanceId id;
        std::uint32_t changes, kinds;
        bvh::Triangles triangles;
        bool isPlaced;  // `triangles` are in ray space already
        WorldFromLocal rayFromLocal;
    };
    std::vector<Piece> pieces;
    std::vector<Cluster*> sources;
    std::unique_ptr<bvh::Group> group;
    std::shared_ptr<const Worker::Job> job;

    void run(const bvh::Device& embree) {
        auto result = std::make_unique<bvh::Group>(embree);
        for (Piece& piece : pieces) {
            if (!piece.isPlaced) piece.triangles = transformedTriangles(piece.triangles.mesh, piece.rayFromLocal);
            result->attach(embree, piece.id.slot, piece.triangles, piece.kinds);
        }
        result->commit(embree);
        group = std::move(result);
    }
};

std::uint32_t RayWorld::Impl::patience(std::uint32_t slot) const {
    const bool foreseen = instances[slot].info.motion == Motion::moving;
    return std::max(1u, options.restFrames) << (states[slot].splits + (foreseen ? kForeseenDoublings : 0));
}

void RayWorld::Impl::watchRest(std::uint32_t slot) {
    InstanceState& state = states[slot];
    if (options.mapping != Mapping::hybrid || state.waiting || state.kind == Kind::none || state.kind == Kind::resting)
        return;
    const Instance& info = instances[slot].info;
    if (!canMerge(slot)) return;
    state.waiting = true;
    rests.push_back({state.movedAt + patience(slot), info.id});
    std::push_heap(rests.begin(), rests.end(), later<Rest, Rest>);
}

void RayWorld::Impl::findRested() {
    for (int looks = 0; looks < kLooks && !rests.empty() && rests.front().due <= now; ++looks) {
        const InstanceId id = rests.front().id;
        std::pop_heap(rests.begin(), rests.end(), later<Rest, Rest>);
        rests.pop_back();
        if (!isLive(id)) continue;
        InstanceState& state = states[id.slot];
        state.waiting = false;
        if (now - state.movedAt < patience(id.slot)) {
            watchRest(id.slot);
        } else if (canRestMerged(id.slot)) {
            state.waiting = true;
            rested.push_back(id);
        }
    }
}

bool RayWorld::Impl::canRestMerged(std::uint32_t slot) const {
    const InstanceState& state = states[slot];
    std::string reason;
    return (state.kind == Kind::instanced || state.kind == Kind::body) && canMerge(slot) &&
           fitness(slot, reason) != Fitness::none;
}

void RayWorld::Impl::startMerge() {
    if (merge || options.mapping != Mapping::hybrid || now % kEvery != 0) return;
    if (!rests.empty() && rests.front().due <= now) return;  // more are coming
    if (rested.empty() && resting.empty()) return;
    std::size_t triangles = 0;
    std::erase_if(rested, [&](InstanceId id) {
        if (!isLive(id)) return true;
        InstanceState& state = states[id.slot];
        const bool stays = now - state.movedAt >= patience(id.slot) && canRestMerged(id.slot);
        if (stays) {
            triangles += state.mesh->mesh->triangleCount;
        } else {
            state.waiting = false;
            watchRest(id.slot);
        }
        return !stays;
    });
    std::vector<Cluster*>& sources = ripe;
    sources.clear();
    for (const auto& cluster : resting) sources.push_back(cluster.get());
    std::sort(sources.begin(), sources.end(), [](const Cluster* a, const Cluster* b) {
        const std::size_t m = a->group->triangles(), n = b->group->triangles();
        return m != n ? m < n : a->index < b->index;
    });
    bool urgent = false;
    std::erase_if(sources, [&](const Cluster* cluster) {
        const bvh::Group& group = *cluster->group;
        const std::size_t size = group.triangles();
        const bool spoilt = group.hiddenTriangles() * 2 > size;
        const double age = now - cluster->builtAt;
        const bool isRipe = age >= options.restFrames * (1 + static_cast<double>(size) * 1e-5);
        urgent = urgent || spoilt || (isRipe && group.hiddenTriangles() * 16 > size);
        const bool takePart = spoilt || isRipe || size <= 2 * triangles;
        if (takePart) triangles += size - group.hiddenTriangles();
        return !takePart;
    });
    const bool worthwhile =
        urgent || sources.size() > 1 || (!sources.empty() && !rested.empty()) || rested.size() >= kWorthwhile;
    if (!worthwhile) return;

    merge = std::make_shared<Merge>();
    const auto add = [&](std::uint32_t slot, bvh::Triangles created, bool isPlaced) {
        const Instance& info = instances[slot].info;
        merge->pieces.push_back(
            {info.id, states[slot].changes, kindsOf(info), std::move(created), isPlaced, rayFromLocal(info)});
    };
    for (Cluster* source : sources)
        source->group->forEach(
            [&](std::uint32_t slot) { add(slot, source->group->triangles(states[slot].local), true); });
    for (const InstanceId id : rested) {
        const std::shared_ptr<const Mesh>& mesh = states[id.slot].mesh->mesh;
        states[id.slot].waiting = false;
        add(id.slot, {mesh, mesh->positions}, false);
    }
    rested.clear();
    merge->sources = sources;
    merge->job = worker->start([job = merge, this] { job->run(device); });
}

void RayWorld::Impl::takeMerge(bool wait) {
    if (!merge) return;
    if (wait) worker->wait(*merge->job);
    if (!merge->job->done()) return;
    const std::shared_ptr<Merge> done = std::exchange(merge, nullptr);
    if (!done->group) {
        diagnostics.error({}, "ray world: merging what rests has failed; it stays as it is");
        for (const Merge::Piece& piece : done->pieces)
            if (isLive(piece.id)) watchRest(piece.id.slot);
        return;
    }
    ++stats.merges;
    ++swaps;
    Cluster& cluster = newCluster(std::move(done->group), false);
    for (std::uint32_t local = 0; local < done->pieces.size(); ++local) {
        const Merge::Piece& piece = done->pieces[local];
        const std::uint32_t slot = piece.id.slot;
        if (!isLive(piece.id) || states[slot].changes != piece.changes) {
            cluster.group->hide(local, 0);
            if (!std::exchange(cluster.thinned, true)) thinned.push_back(&cluster);
            if (isLive(piece.id)) watchRest(slot);
            continue;
        }
        InstanceState& state = states[slot];
        if (state.kind != Kind::resting) lift(slot);  // the sources of those at rest go as a whole
        state.cluster = &cluster;
        state.local = local;
        state.kind = Kind::resting;
        state.moves = state.loose = false;
        instances.write(slot).mesh = piece.triangles.mesh;
        top.setOwner(slot, cluster.object);
        if (const std::uint32_t kinds = kindsOf(instances[slot].info); kinds != piece.kinds)
            cluster.group->setKinds(local, kinds, 0);
    }
    for (Cluster* source : std::exchange(done->sources, {})) dropCluster(*source);
    top.setGroup(cluster.object, *cluster.group);
}

void RayWorld::Impl::forgetSource(const Cluster& cluster) {
    if (merge) std::erase(merge->sources, &cluster);
}

void RayWorld::Impl::discard(Cluster& cluster) {
    const std::shared_ptr<bvh::Group> group = std::move(cluster.group);
    versions.retire(cluster.stamp, versions.serial(), group);
    // Letting go of a large BVH takes a while, too.
    if (options.background) worker->start([group] {});
}

}  // namespace rtsg
