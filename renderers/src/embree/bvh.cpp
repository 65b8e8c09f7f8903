#include "bvh.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

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

// ---- Group --------------------------------------------------------------------------------------------------------

Group::Group(const Device& device) : scene_(device.newScene(RTC_BUILD_QUALITY_MEDIUM)) {}

std::uint32_t Group::attach(const Device& device, std::uint32_t slot, Triangles triangles, std::uint32_t mask) {
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
    Entry& entry = entries_[local];
    entry.geometry = makeTriangles(device, triangles, RTC_BUILD_QUALITY_MEDIUM);
    rtcSetGeometryMask(entry.geometry.get(), mask);
    rtcCommitGeometry(entry.geometry.get());
    rtcAttachGeometryByID(scene_.get(), entry.geometry.get(), local);
    triangles_ += triangles.mesh->triangleCount;
    entry.triangles = std::move(triangles);
    ++live_;
    dirty_ = true;
    return local;
}

void Group::setMask(std::uint32_t local, std::uint32_t mask) {
    // Embree reads the mask while it traces, so no commit of the scene is needed.
    rtcSetGeometryMask(entries_[local].geometry.get(), mask);
    rtcCommitGeometry(entries_[local].geometry.get());
}

void Group::detach(std::uint32_t local) {
    Entry& entry = entries_[local];
    rtcDetachGeometry(scene_.get(), local);
    if (entry.isHidden) {
        --hidden_;
        hiddenTriangles_ -= entry.triangles.mesh->triangleCount;
    }
    triangles_ -= entry.triangles.mesh->triangleCount;
    retired_.push_back(std::move(entry.triangles));
    entry = {};
    slots_[local] = kNoInstance;
    free_.push_back(local);
    --live_;
    dirty_ = true;
}

void Group::hide(std::uint32_t local) {
    if (entries_[local].isHidden) return;
    setMask(local, 0);
    slots_[local] = kNoInstance;  // for queries that know no masks
    entries_[local].isHidden = true;
    ++hidden_;
    hiddenTriangles_ += entries_[local].triangles.mesh->triangleCount;
}

void Group::commit() {
    if (!dirty_) return;
    rtcCommitScene(scene_.get());
    retired_.clear();
    box_ = {};
    if (live_ > 0) {
        RTCBounds b;
        rtcGetSceneBounds(scene_.get(), &b);
        box_ = {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
    }
    dirty_ = false;
}

}  // namespace rtsg::bvh
