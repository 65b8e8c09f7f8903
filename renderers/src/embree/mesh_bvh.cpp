#include "mesh_bvh.h"

#include <algorithm>
#include <utility>

namespace rtsg::bvh {

namespace {

/// Where the watch starts, and how far it may learn: rays at .9, and at worst .8, of a rebuilt tree's speed.
constexpr double kLimit = .12, kLowestLimit = .06, kHighestLimit = .5;
/// Meshes up to this many triangles are built anew at once: it takes no longer than a few refits.
constexpr std::uint32_t kTiny = 1024;
/// So are those up to this many whose tree a single update has ruined: waiting would cost the rays more.
constexpr std::uint32_t kSmall = 32768;
constexpr double kRuined = 1;
/// Looks that read more positions than this (a refit takes ten times as long) are taken in the background, and those
/// that read more than a million not after every update.
constexpr std::size_t kLongLook = 1 << 16, kVeryLongLook = 1 << 20;

GeometryHandle attach(const Device& device, RTCScene scene, const std::shared_ptr<const Mesh>& mesh, bool deforming) {
    // Embree refits only in scenes of low build quality, and only geometries that were of quality REFIT from their
    // first commit on, which builds them by the full method.
    GeometryHandle geometry =
        makeTriangles(device, {mesh, mesh->positions}, deforming ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
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

/// What the worker does for a mesh; shared by both, so that either may go first.
struct MeshBvh::Work {
    const Device& device;
    std::shared_ptr<const Mesh> mesh;
    std::shared_ptr<const BvhWatch> oldWatch;
    double limit;
    BvhWatch::Look before;
    Task task;
    // Results, as far as there are any:
    std::shared_ptr<BvhWatch> watch;
    SceneHandle scene;
    GeometryHandle geometry;
    std::shared_ptr<const Worker::Job> job;

    Work(const Device& d, std::shared_ptr<const Mesh> m, std::shared_ptr<const BvhWatch> old, double most,
         BvhWatch::Look look, Task t)
        : device(d), mesh(std::move(m)), oldWatch(std::move(old)), limit(most), before(look), task(t) {}

    void run() {
        if (task == Task::lookAndRebuild) {
            before = oldWatch->look(mesh->positions);
            if (before.change <= limit) return;
        }
        if (task != Task::watch) {
            scene = newMeshScene(device, true);
            geometry = attach(device, scene.get(), mesh, true);
            rtcCommitScene(scene.get());
        }
        watch = std::make_shared<BvhWatch>(device.get(), *mesh);
    }
};

MeshBvh::MeshBvh(const Device& device, Worker& worker, std::shared_ptr<const Mesh> mesh, bool deforming)
    : device_(device), worker_(worker), limit_(kLimit) {
    build(std::move(mesh), deforming);
}

MeshBvh::~MeshBvh() = default;

bool MeshBvh::ready() const {
    return work_ && work_->job->done();
}

void MeshBvh::wait() const {
    if (work_) worker_.wait(*work_->job);
}

void MeshBvh::commit() {
    if (committed_) return;
    rtcCommitScene(scene_.get());
    rtcGetSceneBounds(scene_.get(), &bounds_);
    committed_ = true;
}

void MeshBvh::build(std::shared_ptr<const Mesh> mesh, bool deforming) {
    scene_ = newMeshScene(device_, deforming);
    geometry_ = attach(device_, scene_.get(), mesh, deforming);
    mesh_ = std::move(mesh);
    positionsInUse_ = mesh_->positions;
    indexInUse_ = mesh_->triangles;
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
    if (mesh_->positions.sameStorage(positionsInUse_)) return;
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
        if (positionsInUse_.sameStorage(mesh_->positions)) return;  // that was at once
    }
    refit();
}

void MeshBvh::refit() {
    rtcSetSharedGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh_->positions.data(),
                               0, sizeof(Vec3f), mesh_->positions.size());
    rtcUpdateGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry_.get());
    positionsInUse_ = mesh_->positions;
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
    if (!work->scene) return;
    scene_ = std::move(work->scene);
    geometry_ = std::move(work->geometry);
    positionsInUse_ = work->mesh->positions;
    indexInUse_ = work->mesh->triangles;
    committed_ = refitted_ = false;
    ++counts_.rebuilds;
    // What it has gained shows whether it came too early or too late; not so after a jump.
    if (work->before.change > 2 * work->limit) return;
    const double gain = watch_->builtCost() / work->before.cost;
    if (gain > .95) limit_ = std::min(limit_ * 1.25, kHighestLimit);
    if (gain < .88) limit_ = std::max(limit_ * .75, kLowestLimit);
}

}  // namespace rtsg::bvh
