// The baseline: the same triangles in Embree, without anything around it.
#include "bare_embree.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <unordered_set>

#include "embree/embree.h"

#include "bench.h"

namespace rtsg::bench {

namespace {

bool countBytes(void* total, ssize_t bytes, bool) {
    *static_cast<ssize_t*>(total) += bytes;
    return true;
}

struct Device {
    Device() : device(rtcNewDevice("threads=1")) { rtcSetDeviceMemoryMonitorFunction(device, countBytes, &bytes); }
    ~Device() { rtcReleaseDevice(device); }
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;
    ssize_t bytes = 0;
    RTCDevice device;
};

/// Triangles in arrays of Embree's kind, each with room behind the last as Embree wants it.
struct Triangles {
    std::vector<Vec3f> points;
    std::vector<std::uint32_t> indices;

    void add(const Mesh& mesh, const glm::mat4x3& worldFromLocal) {
        const auto base = static_cast<std::uint32_t>(points.size());
        for (const Vec3f& p : mesh.positions) points.push_back(worldFromLocal * glm::vec4(p, 1));
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
            for (std::uint32_t c = 0; c < 3; ++c) indices.push_back(base + mesh.vertexIndex(t, c));
    }
    RTCGeometry geometry(RTCDevice device, RTCBuildQuality quality) {
        points.reserve(points.size() + 1);
        RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetGeometryBuildQuality(g, quality);
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, points.data(), 0, sizeof(Vec3f),
                                   points.size());
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices.data(), 0, 12,
                                   indices.size() / 3);
        rtcCommitGeometry(g);
        return g;
    }
};

void attach(RTCScene scene, RTCGeometry geometry) {
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
}

template <class Trace>
void forPackets(const std::vector<Vec3f>& directions, const Trace& trace) {
    for (std::size_t i = 0; i < directions.size(); i += 16) trace(&directions[i], i);
}

}  // namespace

AskedPacket::AskedPacket(const RayPacket16& rays) {
    const auto copy = [](float* to, const float* from) { std::memcpy(to, from, 16 * sizeof(float)); };
    copy(origin[0], rays.originX), copy(origin[1], rays.originY), copy(origin[2], rays.originZ);
    copy(direction[0], rays.directionX), copy(direction[1], rays.directionY), copy(direction[2], rays.directionZ);
    copy(tMin, rays.tMin), copy(tMax, rays.tMax);
    std::memcpy(active, rays.active, sizeof active);
}
Ray AskedPacket::ray(int lane) const {
    return {{origin[0][lane], origin[1][lane], origin[2][lane]},
            tMin[lane],
            {direction[0][lane], direction[1][lane], direction[2][lane]},
            tMax[lane]};
}

struct FlatScene::Impl {
    Device device;
    RTCScene scene = nullptr;
    Triangles triangles;
    double seconds = 0;
};

FlatScene::FlatScene(const RayWorld& world, bool robust) : impl_(std::make_unique<Impl>()) {
    Impl& i = *impl_;
    for (const RayInstance& instance : world.instances())
        if (instance.mesh) i.triangles.add(*instance.mesh, instance.rayFromLocal);
    const double start = cpuSeconds();
    i.scene = rtcNewScene(i.device.device);
    rtcSetSceneFlags(i.scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    attach(i.scene, i.triangles.geometry(i.device.device, RTC_BUILD_QUALITY_MEDIUM));
    rtcCommitScene(i.scene);
    i.seconds = cpuSeconds() - start;
}
FlatScene::~FlatScene() {
    rtcReleaseScene(impl_->scene);
}
double FlatScene::buildSeconds() const {
    return impl_->seconds;
}
std::size_t FlatScene::bvhBytes() const {
    return static_cast<std::size_t>(impl_->device.bytes);
}
double FlatScene::trace(std::span<const AskedRay> rays) const {
    bvh::RayCast cast(false);
    unsigned hits = 0;
    const double start = cpuSeconds();
    for (const AskedRay& asked : rays) {
        RTCRayHit r;
        r.ray.org_x = asked.ray.origin.x, r.ray.org_y = asked.ray.origin.y, r.ray.org_z = asked.ray.origin.z;
        r.ray.dir_x = asked.ray.direction.x, r.ray.dir_y = asked.ray.direction.y, r.ray.dir_z = asked.ray.direction.z;
        r.ray.tnear = asked.ray.tMin, r.ray.tfar = asked.ray.tMax, r.ray.time = 0;
        r.ray.mask = ~0u, r.ray.flags = 0, r.ray.id = 0;
        r.hit.geomID = RTC_INVALID_GEOMETRY_ID, r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        if (asked.any) {
            cast.occluded(impl_->scene, r.ray);
            hits += r.ray.tfar < 0;
        } else {
            cast.intersect(impl_->scene, r);
            hits += r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
        }
    }
    keep(hits);
    return cpuSeconds() - start;
}
double FlatScene::trace(std::span<const AskedPacket> packets, bool coherent, bool any) const {
    bvh::RayCast cast(coherent);
    RTCRayHit16 r;
    std::memset(&r, 0, sizeof r);
    std::memset(r.ray.mask, 0xff, sizeof r.ray.mask);
    float found = 0;
    const double start = cpuSeconds();
    for (const AskedPacket& p : packets) {
        std::memcpy(r.ray.org_x, p.origin, sizeof p.origin);  // three arrays in a row, in both
        std::memcpy(r.ray.dir_x, p.direction, sizeof p.direction);
        std::memcpy(r.ray.tnear, p.tMin, sizeof p.tMin), std::memcpy(r.ray.tfar, p.tMax, sizeof p.tMax);
        if (any) {
            cast.occluded(p.active, impl_->scene, r.ray);
        } else {
            std::memset(r.hit.geomID, 0xff, sizeof r.hit.geomID);
            std::memset(r.hit.instID, 0xff, sizeof r.hit.instID);
            cast.intersect(p.active, impl_->scene, r);
        }
        found += r.ray.tfar[0];
    }
    keep(found);
    return cpuSeconds() - start;
}
double FlatScene::traceInPackets(std::span<const AskedRay> rays) const {
    bvh::RayCast cast(false);
    unsigned hits = 0;
    RTCRayHit16 p;
    for (int i = 0; i < 16; ++i) p.ray.time[i] = 0, p.ray.mask[i] = ~0u, p.ray.flags[i] = 0, p.ray.id[i] = 0;
    const double start = cpuSeconds();
    for (std::size_t first = 0, count = 0; first < rays.size(); first += count) {
        for (count = 1; count < 16 && first + count < rays.size(); ++count)
            if (rays[first + count].any != rays[first].any) break;
        alignas(64) int valid[16] = {};
        for (std::size_t i = 0; i < count; ++i) {
            const Ray& ray = rays[first + i].ray;
            valid[i] = -1;
            p.ray.org_x[i] = ray.origin.x, p.ray.org_y[i] = ray.origin.y, p.ray.org_z[i] = ray.origin.z;
            p.ray.dir_x[i] = ray.direction.x, p.ray.dir_y[i] = ray.direction.y, p.ray.dir_z[i] = ray.direction.z;
            p.ray.tnear[i] = ray.tMin, p.ray.tfar[i] = ray.tMax;
            p.hit.geomID[i] = p.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
        if (rays[first].any)
            cast.occluded(valid, impl_->scene, reinterpret_cast<RTCRay16&>(p));
        else
            cast.intersect(valid, impl_->scene, p);
        for (std::size_t i = 0; i < count; ++i)
            hits += rays[first].any ? p.ray.tfar[i] < 0 : p.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    }
    keep(hits);
    return cpuSeconds() - start;
}
std::size_t FlatScene::triangles() const {
    return impl_->triangles.indices.size() / 3;
}

MetPosition::MetPosition(const RayWorld& world, const RayPacket16& rays, int lane) {
    constexpr float kOff = 1e-4f;  // m
    const Hit hit = world.hit(rays, lane);
    const Ray ray = rays.ray(lane);
    normal = glm::dot(hit.normal, ray.direction) < 0 ? hit.normal : -hit.normal;
    position = ray.origin + hit.t * ray.direction + kOff * normal;
}

double minPerRay(const FlatScene& scene, std::span<const AskedPacket> packets, bool any) {
    std::vector<AskedRay> single;
    for (const AskedPacket& p : packets)
        for (int lane = 0; lane < 16; ++lane)
            if (p.active[lane]) single.push_back({p.ray(lane), any});
    if (single.empty()) return 0;
    std::vector<double> alone, together, coherent;
    for (int run = 0; run < 5; ++run) {
        alone.push_back(scene.trace(single));
        together.push_back(scene.trace(packets, false, any));
        if (!any) coherent.push_back(scene.trace(packets, true, any));
    }
    double minimum = std::min(median(alone), median(together));
    if (!any) minimum = std::min(minimum, median(coherent));
    return minimum / static_cast<double>(single.size());
}

struct SmallestUpdate::Impl {
    struct Moving {
        RTCGeometry geometry = nullptr;  // the top scene's
        RTCScene scene = nullptr;
    };
    struct Deforming {
        Triangles triangles;
        RTCGeometry geometry = nullptr;
        RTCScene scene = nullptr;
    };
    Device device;
    RTCScene top = nullptr;
    std::vector<Triangles> meshes;                           // of moving instances and of what rests
    std::unordered_map<std::uint32_t, Moving> moving;        // by slot
    std::unordered_map<std::uint32_t, Deforming> deforming;  // by geometry node
    std::vector<RTCScene> scenes;

    RTCScene sceneOf(RTCGeometry geometry, bool refitted) {
        RTCScene scene = rtcNewScene(device.device);
        rtcSetSceneFlags(scene, refitted ? RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_ROBUST);
        if (refitted) rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_LOW);
        attach(scene, geometry);
        rtcCommitScene(scene);
        scenes.push_back(scene);
        return scene;
    }
    RTCGeometry attachMoving(RTCScene scene, const glm::mat4x3& transform) {
        RTCGeometry instance = rtcNewGeometry(device.device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(instance, scene);
        rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &transform);
        rtcCommitGeometry(instance);
        attach(top, instance);
        return instance;
    }
};

SmallestUpdate::SmallestUpdate(const RayWorld& world, const InstanceDelta& delta) : impl_(std::make_unique<Impl>()) {
    Impl& i = *impl_;
    i.top = rtcNewScene(i.device.device);
    std::unordered_set<std::uint32_t> moved, deformed;
    for (const InstanceDelta::Moved& m : delta.moved) moved.insert(m.id.slot);
    for (const InstanceDelta::Geometry& g : delta.geometries) deformed.insert(g.node.value);
    i.meshes.reserve(moved.size() + 1);
    Triangles& rest = i.meshes.emplace_back();
    for (const RayInstance& instance : world.instances()) {
        if (!instance.mesh) continue;
        if (deformed.contains(instance.info.geometry.value)) {
            Impl::Deforming& d = i.deforming[instance.info.geometry.value];
            if (!d.scene) {
                d.triangles.add(*instance.mesh, glm::mat4x3(1));
                d.geometry = d.triangles.geometry(i.device.device, RTC_BUILD_QUALITY_REFIT);
                d.scene = i.sceneOf(d.geometry, true);
            }
        } else if (moved.contains(instance.info.id.slot)) {
            Triangles& mesh = i.meshes.emplace_back();
            mesh.add(*instance.mesh, glm::mat4x3(1));
            const RTCScene scene = i.sceneOf(mesh.geometry(i.device.device, RTC_BUILD_QUALITY_MEDIUM), false);
            i.moving[instance.info.id.slot] = {i.attachMoving(scene, instance.rayFromLocal), scene};
        } else {
            rest.add(*instance.mesh, instance.rayFromLocal);
        }
    }
    if (i.deforming.empty()) {
        if (!rest.indices.empty())
            i.attachMoving(i.sceneOf(rest.geometry(i.device.device, RTC_BUILD_QUALITY_MEDIUM), false), glm::mat4x3(1));
        rtcCommitScene(i.top);
    }
}
SmallestUpdate::~SmallestUpdate() {
    rtcReleaseScene(impl_->top);
    for (RTCScene scene : impl_->scenes) rtcReleaseScene(scene);
}

double SmallestUpdate::follow(const RayWorld& world, const InstanceDelta& delta) {
    Impl& i = *impl_;
    const double start = threadSeconds();
    for (const InstanceDelta::Moved& m : delta.moved) {
        const auto found = i.moving.find(m.id.slot);
        if (found == i.moving.end()) continue;
        const glm::mat4x3& transform = world.instance(m.id.slot).rayFromLocal;
        rtcSetGeometryTransform(found->second.geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &transform);
        rtcCommitGeometry(found->second.geometry);
    }
    for (const InstanceDelta::Geometry& g : delta.geometries) {
        const auto found = i.deforming.find(g.node.value);
        if (found == i.deforming.end() || !g.mesh) continue;
        Impl::Deforming& d = found->second;
        if (g.mesh->positions.size() != d.triangles.points.size()) continue;
        std::memcpy(d.triangles.points.data(), g.mesh->positions.data(), g.mesh->positions.size() * sizeof(Vec3f));
        rtcUpdateGeometryBuffer(d.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(d.geometry);
        rtcCommitScene(d.scene);
    }
    if (i.deforming.empty()) rtcCommitScene(i.top);
    return threadSeconds() - start - cpuClockSeconds();
}

ViewRays::ViewRays(const RayWorld& world, const Camera& camera, int width, int height)
    : origin_(world.fromWorld(camera.position)) {
    directions_.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int y = 0; y + 4 <= height; y += 4)
        for (int x = 0; x + 4 <= width; x += 4)
            for (int lane = 0; lane < 16; ++lane)
                directions_.emplace_back(
                    camera.ray((x + lane % 4 + .5) / width, (y + lane / 4 + .5) / height).direction);
}

double ViewRays::trace(const RayWorld& world) const {
    const double start = cpuSeconds();
    RayPacket16 packet;
    std::uint32_t hits = 0;
    forPackets(directions_, [&](const Vec3f* directions, std::size_t) {
        for (int i = 0; i < 16; ++i) packet.set(i, {.origin = origin_, .direction = directions[i]});
        hits += world.intersect(packet, true) & 1;
    });
    keep(hits);
    return cpuSeconds() - start;
}

std::vector<float> ViewRays::distances(const RayWorld& world) const {
    std::vector<float> out(directions_.size());
    RayPacket16 packet;
    forPackets(directions_, [&](const Vec3f* directions, std::size_t first) {
        for (int i = 0; i < 16; ++i) packet.set(i, {.origin = origin_, .direction = directions[i]});
        const std::uint32_t hits = world.intersect(packet, true);
        for (int i = 0; i < 16; ++i)
            out[first + static_cast<std::size_t>(i)] =
                hits >> i & 1 ? packet.tMax[i] : std::numeric_limits<float>::infinity();
    });
    return out;
}

namespace {

template <class Take>
void traceFlat(RTCScene scene, const std::vector<Vec3f>& directions, const Vec3f& origin, const Take& take) {
    RTCRayHit16 rays;
    alignas(64) int valid[16];
    for (int& v : valid) v = -1;
    bvh::RayCast cast(true);
    forPackets(directions, [&](const Vec3f* d, std::size_t first) {
        for (int i = 0; i < 16; ++i) {
            rays.ray.org_x[i] = origin.x, rays.ray.org_y[i] = origin.y, rays.ray.org_z[i] = origin.z;
            rays.ray.dir_x[i] = d[i].x, rays.ray.dir_y[i] = d[i].y, rays.ray.dir_z[i] = d[i].z;
            rays.ray.tnear[i] = 0, rays.ray.tfar[i] = INFINITY, rays.ray.time[i] = 0;
            rays.ray.mask[i] = ~0u, rays.ray.flags[i] = 0, rays.ray.id[i] = 0;
            rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
        cast.intersect(valid, scene, rays);
        take(rays, first);
    });
}

}  // namespace

double ViewRays::trace(const FlatScene& scene) const {
    const double start = cpuSeconds();
    unsigned hits = 0;
    traceFlat(scene.impl().scene, directions_, origin_,
              [&](const RTCRayHit16& rays, std::size_t) { hits += rays.hit.geomID[0] != RTC_INVALID_GEOMETRY_ID; });
    keep(hits);
    return cpuSeconds() - start;
}

std::vector<float> ViewRays::distances(const FlatScene& scene) const {
    std::vector<float> out(directions_.size());
    traceFlat(scene.impl().scene, directions_, origin_, [&](const RTCRayHit16& rays, std::size_t first) {
        for (std::size_t i = 0; i < 16; ++i)
            out[first + i] = rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID ? rays.ray.tfar[i]
                                                                           : std::numeric_limits<float>::infinity();
    });
    return out;
}

double differing(std::span<const float> a, std::span<const float> b, float tolerance) {
    std::size_t count = a.size() > b.size() ? a.size() - b.size() : b.size() - a.size();
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        count += std::isinf(a[i]) != std::isinf(b[i]) ||
                 (!std::isinf(a[i]) && std::abs(a[i] - b[i]) > tolerance * std::max(1.0f, std::abs(a[i])));
    return static_cast<double>(count) / static_cast<double>(std::max<std::size_t>(1, std::max(a.size(), b.size())));
}

}  // namespace rtsg::bench
