// Follows one mesh with an Embree scene: builds, refits, and rebuilds in the background.
#include "mesh_bvh.h"

#include <algorithm>
#include <utility>

namespace rtsg::bvh {

namespace {

/// The change of boxes at which a tree is rebuilt: the first value, and the range in which it adapts. Rays then run at
/// .9, and at worst .8, of a rebuilt tree's speed.
constexpr double kLimit = .12, kLowestLimit = .06, kHighestLimit = .5;
/// Meshes up to this many triangles are built anew at once: it takes no longer than a few refits.
constexpr std::uint32_t kTiny = 1024;
/// So are those up to this many whose tree a single update has ruined: waiting would cost the rays more.
constexpr std::uint32_t kSmall = 32768;
constexpr double kRuined = 1;
/// Looks that read more positions than this (a refit takes ten times as long) are taken in the background, and those
/// that read more than a million not after every update.
constexpr std::size_t kLongLook = 1 << 16, kVeryLongLook = 1 << 20;

GeometryHandle attach(const Device& device, RTCScene scene, const Triangles& triangles, bool deforming) {
    // Embree refits only in scenes of low build quality, and only geometries that were of quality REFIT from their
    // first commit on, which builds them by the full method.
    GeometryHandle geometry =
        makeTriangles(device, triangles, deforming ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
    rtcAttachGeometryByID(scene, geometry.get(), 0);
    return geometry;
}

SceneHandle newMeshScene(const Device& device, bool deforming) {
    return device.newScene(deforming ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM);
}

bool sameTriangles(const Mesh& a, const Mesh& b) {
    return a.triangleCount == b.triangleCount && a.triangleStride == b.triangleStride &&
           a.positions.size() == b.positions.size() && a.triangles == b.triangles;
}

}  // namespace

/// The worker's job for a mesh. Both share it, so that either may end first.
struct MeshBvh::Work {
    const Device& device;
    std::shared_ptr<const Mesh> mesh;
    std::shared_ptr<const BvhWatch> oldWatch;
    double limit;
    BvhWatch::Look before;
    Task task;
    // Results, as far as there are any:
    std::shared_ptr<BvhWatch> watch;
    std::unique_ptr<Tree> tree;
    std::shared_ptr<const Worker::Job> job;

    Work(const Device& d, std::shared_ptr<const Mesh> m, std::shared_ptr<const BvhWatch> old, double maximum,
         BvhWatch::Look look, Task t)
        : device(d), mesh(std::move(m)), oldWatch(std::move(old)), limit(maximum), before(look), task(t) {}

    void run() {
        if (task == Task::lookAndRebuild) {
            before = oldWatch->look(mesh->positions);
            if (before.change <= limit) return;
        }
        if (task != Task::watch) {
            tree = newTree(device, mesh, true);
            device.commit(tree->scene.get());
        }
        watch = std::make_shared<BvhWatch>(device.get(), *mesh);
    }
};

MeshBvh::MeshBvh(const Device& device, Worker& worker, std::shared_ptr<const Mesh> mesh, bool deforming,
                 Versions* versions)
    : device_(device), worker_(worker), versions_(versions), limit_(kLimit) {
    build(std::move(mesh), deforming);
}

MeshBvh::~MeshBvh() {
    setTree(nullptr);
}

std::unique_ptr<MeshBvh::Tree> MeshBvh::newTree(const Device& device, const std::shared_ptr<const Mesh>& mesh,
                                                bool deforming) {
    auto tree = std::make_unique<Tree>();
    tree->scene = newMeshScene(device, deforming);
    // Refits read the mesh's own points, and a triangle that is long now may be short then.
    if (!deforming) tree->cut = cutLongTriangles(*mesh, mesh->positions);
    tree->cutInUse = tree->cut.get();
    tree->geometry = attach(device, tree->scene.get(), {mesh, mesh->positions, tree->cut}, deforming);
    tree->positions = mesh->positions;
    tree->index = mesh->triangles;
    return tree;
}

void MeshBvh::retire(std::unique_ptr<Tree> tree, std::uint64_t until) {
    if (!tree || !versions_) return;
    const std::uint64_t since = tree->stamp;
    versions_->retire(since, until, std::shared_ptr<Tree>(std::move(tree)));
}

void MeshBvh::setTree(std::unique_ptr<Tree> tree) {
    retire(std::exchange(tree_, std::move(tree)), versions_ ? versions_->serial() : 0);
    for (Spare& spare : spares_) retire(std::move(spare.tree), spare.until);
    spares_.clear();
    if (tree_ && versions_) tree_->stamp = versions_->serial();
}

void MeshBvh::alternate() {
    const auto isFree = [&](const Spare& spare) { return !versions_->sees(spare.tree->stamp, spare.until); };
    const auto found = std::find_if(spares_.begin(), spares_.end(), isFree);
    std::unique_ptr<Tree> next;
    if (found != spares_.end()) {
        next = std::move(found->tree);
        spares_.erase(found);
    } else {
        next = newTree(device_, mesh_, true);
    }
    spares_.push_back({std::exchange(tree_, std::move(next)), versions_->serial()});
}

bool MeshBvh::ready() const {
    return work_ && work_->job->done();
}

void MeshBvh::wait() const {
    if (work_) worker_.wait(*work_->job);
}

void MeshBvh::commit() {
    if (committed_) return;
    device_.commit(tree_->scene.get());
    RTCBounds b;
    rtcGetSceneBounds(tree_->scene.get(), &b);
    bounds_.min = {b.lower_x, b.lower_y, b.lower_z};
    bounds_.max = {b.upper_x, b.upper_y, b.upper_z};
    committed_ = true;
}

void MeshBvh::build(std::shared_ptr<const Mesh> mesh, bool deforming) {
    setTree(newTree(device_, mesh, deforming));
    mesh_ = std::move(mesh);
    deforming_ = deforming;
    committed_ = refitted_ = false;
    updatesSinceLook_ = 0;
    ++counts_.builds;
}

void MeshBvh::update(std::shared_ptr<const Mesh> mesh) {
    if (!sameTriangles(*mesh, *mesh_)) {
        work_.reset();
        watch_.reset();
        build(std::move(mesh), deforming_);
        return;
    }
    if (ready()) take();
    // Only once it is refitted: a mesh whose triangles change each frame needs no watch.
    if (deforming_ && !watch_ && !work_ && committed_) start(Task::watch, {}, mesh_->triangleCount <= kTiny);
    mesh_ = std::move(mesh);
    if (mesh_->positions.sameStorage(tree_->positions)) return;
    if (!deforming_) {
        build(mesh_, true);
        return;
    }
    if (watch_ && !work_ && watch_->size() > kLongLook) {
        if (++updatesSinceLook_ > watch_->size() / kVeryLongLook) start(Task::lookAndRebuild, {}, false);
    } else if (watch_ && !work_) {
        const BvhWatch::Look look = watch_->look(mesh_->positions);
        const bool atOnce = mesh_->triangleCount <= (look.change > kRuined ? kSmall : kTiny);
        if (look.change > limit_) start(Task::rebuild, look, atOnce);
        if (tree_->positions.sameStorage(mesh_->positions)) return;  // that was at once
    }
    refit();
}

void MeshBvh::refit() {
    if (isSeen())
        alternate();
    else if (versions_ && !versions_->anyHeld())
        spares_.clear();
    RTCGeometry geometry = tree_->geometry.get();
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh_->positions.data(), 0,
                               sizeof(Vec3f), mesh_->positions.size());
    rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry);
    tree_->positions = mesh_->positions;
    if (versions_) tree_->stamp = versions_->serial();
    committed_ = false;
    refitted_ = true;
    ++counts_.refits;
}

void MeshBvh::start(Task task, const BvhWatch::Look& look, bool atOnce) {
    updatesSinceLook_ = 0;
    work_ = std::make_shared<Work>(device_, mesh_, watch_, limit_, look, task);
    if (atOnce) {
        work_->run();
        take();
        return;
    }
    work_->job = worker_.start([work = work_] { work->run(); });
}

void MeshBvh::take() {
    const std::shared_ptr<Work> work = std::exchange(work_, nullptr);
    if (!work->watch) return;
    watch_ = work->watch;
    if (!work->tree) return;
    setTree(std::move(work->tree));
    committed_ = refitted_ = false;
    ++counts_.rebuilds;
    // The gain shows whether the rebuild came too early or too late, unless the mesh jumped.
    if (work->before.change > 2 * work->limit) return;
    const double gain = watch_->builtCost() / work->before.cost;
    if (gain > .95) limit_ = std::min(limit_ * 1.25, kHighestLimit);
    if (gain < .88) limit_ = std::max(limit_ * .75, kLowestLimit);
}

}  // namespace rtsg::bvh
