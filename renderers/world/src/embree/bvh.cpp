// The Embree device, and the groups of triangles in it.
#include "bvh.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include <rtsg/renderers/parallel_for.h>

namespace rtsg::bvh {

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

namespace {

RTCDevice loadedDevice() {
    if (const auto loaded = delayed::embree.load(); !loaded) throw std::runtime_error(loaded.error().text);
    return newDevice();
}

}  // namespace

Device::Device(unsigned buildThreads, bool robust)
    : watch_(std::make_unique<Watch>()), handle_(loadedDevice()), buildThreads_(buildThreads), robust_(robust) {
    if (!handle_)
        throw std::runtime_error("Embree gave no device, error " + std::to_string(rtcGetDeviceError(nullptr)));
    rtcSetDeviceErrorFunction(handle_.get(), &Watch::onError, watch_.get());
    rtcSetDeviceMemoryMonitorFunction(handle_.get(), &Watch::onMemory, watch_.get());
}

Device::~Device() = default;

SceneHandle Device::newScene(RTCBuildQuality quality) const {
    SceneHandle scene(rtcNewScene(handle_.get()));
    unsigned flags = kAsksOfHits;
    if (robust_) flags |= RTC_SCENE_FLAG_ROBUST;
    if (quality == RTC_BUILD_QUALITY_LOW) flags |= RTC_SCENE_FLAG_DYNAMIC;
    rtcSetSceneFlags(scene.get(), static_cast<RTCSceneFlags>(flags));
    rtcSetSceneBuildQuality(scene.get(), quality);
    return scene;
}

void Device::commit(RTCScene scene) const {
    if (buildThreads_ == 0) return rtcCommitScene(scene);
    withThreads(buildThreads_, [scene] { rtcCommitScene(scene); });
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
    const LongTriangles* cut = triangles.cut.get();
    const Array<Vec3f>& positions = cut ? cut->positions : triangles.positions;
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions.data(), 0,
                               sizeof(Vec3f), positions.size());
    rtcSetSharedGeometryBuffer(
        geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, cut ? cut->corners.data() : mesh.triangles.data(),
        0, (cut ? 3 : mesh.triangleStride) * sizeof(std::int32_t), cut ? cut->count() : mesh.triangleCount);
    rtcSetGeometryBuildQuality(geometry.get(), quality);
    rtcSetGeometryMask(geometry.get(), ~0u);
    rtcCommitGeometry(geometry.get());
    return geometry;
}

// ---- Group --------------------------------------------------------------------------------------------------------

Group::Group(const Device& device) : scene_(device.newScene(RTC_BUILD_QUALITY_MEDIUM)) {}

std::unique_ptr<Group> Group::copy(const Device& device) const {
    auto other = std::make_unique<Group>(device);
    other->entries_.resize(entries_.size());
    for (std::uint32_t local = 0; local < entries_.size(); ++local) {
        const Entry& from = entries_[local];
        if (!from.geometry) continue;
        Entry& to = other->entries_[local];
        rtcRetainGeometry(from.geometry.get());
        to.geometry.reset(from.geometry.get());
        to.triangles = from.triangles;
        to.kinds = from.kinds, to.mask = from.mask;
        to.isHidden = from.isHidden, to.isUnsettled = from.isUnsettled;
        rtcAttachGeometryByID(other->scene_.get(), to.geometry.get(), local);
    }
    other->slots_ = slots_;
    other->cuts_ = cuts_, other->cutCount_ = cutCount_;
    other->free_ = free_;
    other->unsettled_ = unsettled_;
    other->live_ = live_, other->hidden_ = hidden_;
    other->triangles_ = triangles_, other->hiddenTriangles_ = hiddenTriangles_;
    other->dirty_ = true;
    return other;
}

std::uint32_t Group::attach(const Device& device, std::uint32_t slot, Triangles triangles, std::uint32_t kinds) {
    std::uint32_t local;
    if (free_.empty()) {
        local = static_cast<std::uint32_t>(entries_.size());
        entries_.emplace_back();
        slots_.push_back(slot);
        cuts_.push_back(nullptr);
    } else {
        local = free_.back();
        free_.pop_back();
        slots_[local] = slot;
    }
    Entry& entry = entries_[local];
    entry.geometry = makeTriangles(device, triangles, RTC_BUILD_QUALITY_MEDIUM);
    entry.kinds = kinds;
    entry.mask = Versions::inAllEpochs(kinds);
    rtcSetGeometryMask(entry.geometry.get(), entry.mask);
    rtcCommitGeometry(entry.geometry.get());
    rtcAttachGeometryByID(scene_.get(), entry.geometry.get(), local);
    triangles_ += triangles.mesh->triangleCount;
    cuts_[local] = triangles.cut.get();
    cutCount_ += triangles.cut != nullptr;
    entry.triangles = std::move(triangles);
    ++live_;
    dirty_ = true;
    return local;
}

bool Group::settle(Entry& entry, std::uint32_t heldBits) {
    const std::uint32_t all = Versions::inAllEpochs(entry.kinds);
    const std::uint32_t mask = (entry.mask & heldBits) | (all & ~heldBits);
    if (mask != entry.mask) {
        // Embree reads the mask while it traces, so no commit of the scene is needed.
        rtcSetGeometryMask(entry.geometry.get(), mask);
        rtcCommitGeometry(entry.geometry.get());
        std::atomic_ref(entry.mask).store(mask, std::memory_order_relaxed);
    }
    return mask == all;
}

void Group::setKinds(std::uint32_t local, std::uint32_t kinds, std::uint32_t heldBits) {
    Entry& entry = entries_[local];
    entry.kinds = kinds;
    if (!settle(entry, heldBits) && !std::exchange(entry.isUnsettled, true)) unsettled_.push_back(local);
}

bool Group::settle(std::uint32_t heldBits) {
    std::erase_if(unsettled_, [&](std::uint32_t local) {
        Entry& entry = entries_[local];
        if (entry.geometry && !settle(entry, heldBits)) return false;
        entry.isUnsettled = false;
        return true;
    });
    return unsettled_.empty();
}

void Group::detach(std::uint32_t local) {
    Entry& entry = entries_[local];
    rtcDetachGeometry(scene_.get(), local);
    if (entry.isHidden) {
        --hidden_;
        hiddenTriangles_ -= entry.triangles.mesh->triangleCount;
    }
    triangles_ -= entry.triangles.mesh->triangleCount;
    cutCount_ -= entry.triangles.cut != nullptr;
    retired_.push_back(std::move(entry.triangles));
    const bool isUnsettled = entry.isUnsettled;  // it stays in the list
    entry = {};
    entry.isUnsettled = isUnsettled;
    slots_[local] = kNoInstance;
    cuts_[local] = nullptr;
    free_.push_back(local);
    --live_;
    dirty_ = true;
}

void Group::hide(std::uint32_t local, std::uint32_t heldBits) {
    if (entries_[local].isHidden) return;
    setKinds(local, 0, heldBits);
    entries_[local].isHidden = true;
    ++hidden_;
    hiddenTriangles_ += entries_[local].triangles.mesh->triangleCount;
}

std::shared_ptr<const Clusters> Group::clusters() const {
    const std::lock_guard lock(clustersMutex_);
    if (!clusters_) clusters_ = std::make_shared<const Clusters>(*this);
    return clusters_;
}

std::size_t Group::clusterBytes() const {
    const std::lock_guard lock(clustersMutex_);
    if (!clusters_) return 0;
    return clusters_->all.capacity() * sizeof(Cluster) + clusters_->meshes.capacity() * sizeof(ClusteredMesh);
}

void Group::commit(const Device& device) {
    if (!dirty_) return;
    device.commit(scene_.get());
    retired_.clear();
    clusters_.reset();
    box_ = {};
    if (live_ > 0) {
        RTCBounds b;
        rtcGetSceneBounds(scene_.get(), &b);
        box_ = {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
    }
    dirty_ = false;
}

}  // namespace rtsg::bvh
