#include "embree_bvh.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

namespace rtsg::bvh {

namespace {

/// After so many refits the BVH is built anew: refits keep the tree's shape, and a shape that has moved on costs rays
/// up to half their speed (a build costs about ten refits).
constexpr unsigned kRefitsBeforeRebuild = 64;

RTCBounds emptyBounds() {
    constexpr float inf = std::numeric_limits<float>::infinity();
    return {inf, inf, inf, 0, -inf, -inf, -inf, 0};
}

void setTransform(RTCGeometry geometry, const glm::mat4x3& rayFromLocal) {
    static_assert(sizeof(glm::mat4x3) == 12 * sizeof(float));
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &rayFromLocal);
}

}  // namespace

struct Device::Watch {
    std::atomic<std::int64_t> bytes{0};
    std::mutex mutex;
    std::string error;

    static void onError(void* self, RTCError code, const char* text) {
        auto* watch = static_cast<Watch*>(self);
        const std::lock_guard lock(watch->mutex);
        if (watch->error.empty()) watch->error = "Embree error " + std::to_string(code) + ": " + (text ? text : "");
    }
    static bool onMemory(void* self, ssize_t bytes, bool) {
        static_cast<Watch*>(self)->bytes.fetch_add(bytes, std::memory_order_relaxed);
        return true;
    }
};

Device::Device(unsigned buildThreads, bool robust)
    : watch_(std::make_unique<Watch>()),
      handle_(rtcNewDevice(("threads=" + std::to_string(buildThreads)).c_str())),
      robust_(robust) {
    if (!handle_)
        throw std::runtime_error("Embree gave no device, error " + std::to_string(rtcGetDeviceError(nullptr)));
    rtcSetDeviceErrorFunction(handle_.get(), &Watch::onError, watch_.get());
    rtcSetDeviceMemoryMonitorFunction(handle_.get(), &Watch::onMemory, watch_.get());
}

Device::~Device() = default;

SceneHandle Device::newScene(RTCBuildQuality quality) const {
    SceneHandle scene(rtcNewScene(handle_.get()));
    unsigned flags = RTC_SCENE_FLAG_NONE;
    if (robust_) flags |= RTC_SCENE_FLAG_ROBUST;
    if (quality == RTC_BUILD_QUALITY_LOW) flags |= RTC_SCENE_FLAG_DYNAMIC;
    rtcSetSceneFlags(scene.get(), static_cast<RTCSceneFlags>(flags));
    rtcSetSceneBuildQuality(scene.get(), quality);
    return scene;
}

std::size_t Device::bytes() const {
    return static_cast<std::size_t>(std::max<std::int64_t>(0, watch_->bytes.load(std::memory_order_relaxed)));
}

std::string Device::takeError() {
    const std::lock_guard lock(watch_->mutex);
    return std::exchange(watch_->error, {});
}

GeometryHandle makeTriangles(const Device& device, const Triangles& triangles, RTCBuildQuality quality) {
    const Mesh& mesh = *triangles.mesh;
    GeometryHandle geometry(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, triangles.positions.data(),
                               0, sizeof(Vec3f), triangles.positions.size());
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                               mesh.triangleStride * sizeof(std::int32_t), mesh.triangleCount);
    rtcSetGeometryBuildQuality(geometry.get(), quality);
    rtcSetGeometryMask(geometry.get(), ~0u);
    rtcCommitGeometry(geometry.get());
    return geometry;
}

// ---- MeshBvh ------------------------------------------------------------------------------------------------------

MeshBvh::MeshBvh(const Device& device, std::shared_ptr<const Mesh> mesh)
    : mesh_(std::move(mesh)), indexInUse_(mesh_->triangles), scene_(device.newScene(RTC_BUILD_QUALITY_MEDIUM)) {
    geometry_ = makeTriangles(device, {mesh_, mesh_->positions}, RTC_BUILD_QUALITY_MEDIUM);
    rtcAttachGeometryByID(scene_.get(), geometry_.get(), 0);
}

void MeshBvh::commit() {
    if (built_) return;
    rtcCommitScene(scene_.get());
    built_ = true;
}

void MeshBvh::update(const Device& device, std::shared_ptr<const Mesh> mesh) {
    const bool sameTriangles = mesh->triangles == mesh_->triangles && mesh->triangleCount == mesh_->triangleCount &&
                               mesh->triangleStride == mesh_->triangleStride &&
                               mesh->positions.size() == mesh_->positions.size();
    if (!sameTriangles || !deforming_) {
        // Embree refits only in scenes of low build quality; the geometry in it is built by the full method all the
        // same.
        SceneHandle scene = device.newScene(sameTriangles ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM);
        GeometryHandle geometry = makeTriangles(device, {mesh, mesh->positions}, RTC_BUILD_QUALITY_MEDIUM);
        rtcAttachGeometryByID(scene.get(), geometry.get(), 0);
        scene_ = std::move(scene);
        geometry_ = std::move(geometry);
        indexInUse_ = mesh->triangles;
        deforming_ = sameTriangles;
        refitted_ = false;
        refitsSinceBuild_ = 0;
    } else {
        refitted_ = ++refitsSinceBuild_ < kRefitsBeforeRebuild;
        if (!refitted_) refitsSinceBuild_ = 0;
        rtcSetGeometryBuildQuality(geometry_.get(), refitted_ ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
        rtcSetSharedGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                   mesh->positions.data(), 0, sizeof(Vec3f), mesh->positions.size());
        rtcUpdateGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry_.get());
    }
    // A refit reads the index it was built with, which may be equal to the new one and yet lie elsewhere.
    mesh_ = std::move(mesh);
    built_ = false;
}

// ---- Group --------------------------------------------------------------------------------------------------------

Group::Group(const Device& device, bool resting)
    : scene_(device.newScene(RTC_BUILD_QUALITY_MEDIUM)), resting_(resting), bounds_(emptyBounds()) {}

std::uint32_t Group::place(std::uint32_t slot, Entry entry) {
    std::uint32_t local;
    if (free_.empty()) {
        local = static_cast<std::uint32_t>(entries_.size());
        entries_.emplace_back();
        slots_.push_back(slot);
    } else {
        local = free_.back();
        free_.pop_back();
        slots_[local] = slot;
    }
    rtcCommitGeometry(entry.geometry.get());
    rtcAttachGeometryByID(scene_.get(), entry.geometry.get(), local);
    entries_[local] = std::move(entry);
    ++live_;
    dirty_ = true;
    return local;
}

std::uint32_t Group::attachInstance(const Device& device, std::uint32_t slot, const MeshBvh& mesh,
                                    const glm::mat4x3& rayFromLocal, std::uint32_t mask) {
    Entry entry;
    entry.geometry.reset(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(entry.geometry.get(), mesh.scene());
    rtcSetGeometryTimeStepCount(entry.geometry.get(), 1);
    setTransform(entry.geometry.get(), rayFromLocal);
    rtcSetGeometryMask(entry.geometry.get(), mask);
    return place(slot, std::move(entry));
}

std::uint32_t Group::attachTriangles(const Device& device, std::uint32_t slot, Triangles triangles,
                                     std::uint32_t mask) {
    Entry entry;
    entry.geometry = makeTriangles(device, triangles, RTC_BUILD_QUALITY_MEDIUM);
    rtcSetGeometryMask(entry.geometry.get(), mask);
    entry.triangles = std::move(triangles);
    triangles_ += entry.triangles.mesh->triangleCount;
    return place(slot, std::move(entry));
}

void Group::move(std::uint32_t local, const glm::mat4x3& rayFromLocal) {
    setTransform(entries_[local].geometry.get(), rayFromLocal);
    rtcCommitGeometry(entries_[local].geometry.get());
    dirty_ = true;
}

void Group::touch(std::uint32_t local, const MeshBvh& mesh) {
    rtcSetGeometryInstancedScene(entries_[local].geometry.get(), mesh.scene());
    rtcCommitGeometry(entries_[local].geometry.get());
    dirty_ = true;
}

void Group::setMask(std::uint32_t local, std::uint32_t mask) {
    rtcSetGeometryMask(entries_[local].geometry.get(), mask);
    rtcCommitGeometry(entries_[local].geometry.get());
}

void Group::detach(std::uint32_t local) {
    Entry& entry = entries_[local];
    rtcDetachGeometry(scene_.get(), local);
    if (entry.isHidden) --hidden_;
    if (entry.triangles.mesh) triangles_ -= entry.triangles.mesh->triangleCount;
    if (entry.triangles.mesh) retired_.push_back(std::move(entry.triangles));
    entry = {};
    slots_[local] = kNoInstance;
    free_.push_back(local);
    --live_;
    dirty_ = true;
}

void Group::hide(std::uint32_t local) {
    if (entries_[local].isHidden) return;
    setMask(local, 0);
    entries_[local].isHidden = true;
    ++hidden_;
}

void Group::drop() {
    for (std::uint32_t local = 0; local < entries_.size(); ++local)
        if (entries_[local].geometry) detach(local);
}

void Group::commit() {
    if (!dirty_) return;
    rtcCommitScene(scene_.get());
    retired_.clear();
    bounds_ = emptyBounds();
    if (live_ > 0) rtcGetSceneBounds(scene_.get(), &bounds_);
    dirty_ = false;
}

// ---- Root ---------------------------------------------------------------------------------------------------------

namespace {

void groupBounds(const RTCBoundsFunctionArguments* args) {
    const auto* groups = static_cast<const Group* const*>(args->geometryUserPtr);
    *args->bounds_o = groups[args->primID]->bounds();
}

/// Turns the group's numbering of the hits just found into slots.
inline void mapHits(const Group& group, RTCRayHitN* rayhit, unsigned width) {
    // Structure of arrays: 12 members of the ray, then Ng x y z, u, v, primID, geomID, instID.
    auto* members = reinterpret_cast<std::uint32_t*>(rayhit);
    std::uint32_t* geomId = members + 18 * width;
    std::uint32_t* instId = members + 19 * width;
    std::uint32_t fresh = 0;
    for (unsigned i = 0; i < width; ++i) fresh |= (geomId[i] >> 31 ^ 1u) << i;
    while (fresh) {
        const unsigned i = static_cast<unsigned>(__builtin_ctz(fresh));
        fresh &= fresh - 1;
        instId[i] = group.slots()[instId[i] != RTC_INVALID_GEOMETRY_ID ? instId[i] : geomId[i]];
        geomId[i] = Root::kMapped;
    }
}

void intersectGroup(const RTCIntersectFunctionNArguments* args) {
    const Group& group = *static_cast<const Group* const*>(args->geometryUserPtr)[args->primID];
    switch (args->N) {
        case 1:
            if (!args->valid[0]) return;
            rtcIntersect1(group.scene(), args->context, reinterpret_cast<RTCRayHit*>(args->rayhit));
            break;
        case 4:
            rtcIntersect4(args->valid, group.scene(), args->context, reinterpret_cast<RTCRayHit4*>(args->rayhit));
            break;
        case 8:
            rtcIntersect8(args->valid, group.scene(), args->context, reinterpret_cast<RTCRayHit8*>(args->rayhit));
            break;
        case 16:
            rtcIntersect16(args->valid, group.scene(), args->context, reinterpret_cast<RTCRayHit16*>(args->rayhit));
            break;
        default:
            return;  // streams, which RayWorld does not use
    }
    mapHits(group, args->rayhit, args->N);
}

void occludedGroup(const RTCOccludedFunctionNArguments* args) {
    const Group& group = *static_cast<const Group* const*>(args->geometryUserPtr)[args->primID];
    switch (args->N) {
        case 1:
            if (!args->valid[0]) return;
            rtcOccluded1(group.scene(), args->context, reinterpret_cast<RTCRay*>(args->ray));
            break;
        case 4:
            rtcOccluded4(args->valid, group.scene(), args->context, reinterpret_cast<RTCRay4*>(args->ray));
            break;
        case 8:
            rtcOccluded8(args->valid, group.scene(), args->context, reinterpret_cast<RTCRay8*>(args->ray));
            break;
        case 16:
            rtcOccluded16(args->valid, group.scene(), args->context, reinterpret_cast<RTCRay16*>(args->ray));
            break;
        default:
            break;
    }
}

}  // namespace

Root::Root(const Device& device) : over_(device.newScene(RTC_BUILD_QUALITY_MEDIUM)), bounds_(emptyBounds()) {
    rtcCommitScene(over_.get());
    scene_ = over_.get();
}

void Root::commit(const Device& device, const std::vector<std::unique_ptr<Group>>& groups) {
    std::size_t count = 0;
    bounds_ = emptyBounds();
    for (const auto& group : groups) {
        if (!group || group->live() == group->hidden() || !(group->bounds().lower_x <= group->bounds().upper_x))
            continue;
        if (count == groups_.size()) groups_.push_back(nullptr);
        groups_[count++] = group.get();
        const RTCBounds& b = group->bounds();
        bounds_.lower_x = std::min(bounds_.lower_x, b.lower_x), bounds_.upper_x = std::max(bounds_.upper_x, b.upper_x);
        bounds_.lower_y = std::min(bounds_.lower_y, b.lower_y), bounds_.upper_y = std::max(bounds_.upper_y, b.upper_y);
        bounds_.lower_z = std::min(bounds_.lower_z, b.lower_z), bounds_.upper_z = std::max(bounds_.upper_z, b.upper_z);
    }
    groups_.resize(count);
    if (count == 1) {
        direct_ = groups_[0];
        scene_ = direct_->scene();
        return;
    }
    direct_ = nullptr;
    scene_ = over_.get();
    if (geometry_ && count == 0) {
        rtcDetachGeometry(over_.get(), 0);
        geometry_.reset();
    }
    if (count > 0 && !geometry_) {
        geometry_.reset(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_USER));
        rtcSetGeometryBoundsFunction(geometry_.get(), &groupBounds, nullptr);
        rtcSetGeometryIntersectFunction(geometry_.get(), &intersectGroup);
        rtcSetGeometryOccludedFunction(geometry_.get(), &occludedGroup);
        rtcSetGeometryMask(geometry_.get(), ~0u);
        rtcAttachGeometryByID(over_.get(), geometry_.get(), 0);
    }
    if (geometry_) {
        rtcSetGeometryUserPrimitiveCount(geometry_.get(), static_cast<unsigned>(count));
        rtcSetGeometryUserData(geometry_.get(), groups_.data());
        rtcCommitGeometry(geometry_.get());
    }
    rtcCommitScene(over_.get());
}

}  // namespace rtsg::bvh
