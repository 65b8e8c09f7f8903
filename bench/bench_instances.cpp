// Instances: rays through a hundred thousand things that may all move, and through one that moves before many at rest,
// beside the same triangles in one Embree scene, and beside Embree's own scene of instances.
#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>
#include "embree/embree.h"

#include <rtsg/renderers/tessellate.h>

#include "bare_embree.h"
#include "bench.h"

namespace rtsg::bench {

namespace {

Instance sphereAt(std::uint32_t slot, Vec3d position, double radius, bool moving) {
    Instance instance;
    instance.id = {slot, 1};
    instance.shape = NodeId{slot + 10};
    instance.geometry = NodeId{moving ? 1u : 2u};
    instance.motion = moving ? rtsg::Motion::moving : rtsg::Motion::unknown;
    for (int i = 0; i < 3; ++i) instance.worldFromLocal[i][i] = radius;
    instance.worldFromLocal[3] = position;
    return instance;
}

/// `moving` spheres that may move and `resting` that rest, in a cube of side 2, evenly dense.
InstanceDelta cloud(std::uint32_t moving, std::uint32_t resting) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> unit(-1, 1);
    const double radius = .4 / std::cbrt(moving + resting);
    InstanceDelta delta;
    const auto mesh = std::make_shared<Mesh>(tessellate(SphereParams{}, {.segments = 8}));
    delta.geometries.push_back({NodeId{1}, mesh});
    delta.geometries.push_back({NodeId{2}, std::make_shared<Mesh>(*mesh)});
    for (std::uint32_t slot = 0; slot < moving + resting; ++slot)
        delta.added.push_back(sphereAt(slot, {unit(random), unit(random), unit(random)},
                                       radius * (slot < moving && moving == 1 ? 8 : 1), slot < moving));
    return delta;
}

/// Embree's own two levels: a scene of instances of one mesh.
class EmbreeInstances {
  public:
    explicit EmbreeInstances(const RayWorld& world) : device_(rtcNewDevice("threads=1")) {
        const Mesh* mesh = nullptr;
        for (const RayInstance& instance : world.instances())
            if (instance.mesh) mesh = instance.mesh.get();
        bottom_ = newScene();
        RTCGeometry triangles = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh->positions.data(), 0,
                                   sizeof(Vec3f), mesh->positions.size());
        rtcSetSharedGeometryBuffer(triangles, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh->triangles.data(), 0,
                                   mesh->triangleStride * sizeof(std::int32_t), mesh->triangleCount);
        rtcCommitGeometry(triangles);
        rtcAttachGeometry(bottom_, triangles);
        rtcReleaseGeometry(triangles);
        rtcCommitScene(bottom_);
        top_ = newScene();
        for (const RayInstance& instance : world.instances()) {
            if (!instance.mesh) continue;
            RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
            rtcSetGeometryInstancedScene(geometry, bottom_);
            rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &instance.rayFromLocal[0].x);
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(top_, geometry);
            rtcReleaseGeometry(geometry);
        }
        rtcCommitScene(top_);
    }
    ~EmbreeInstances() {
        rtcReleaseScene(top_);
        rtcReleaseScene(bottom_);
        rtcReleaseDevice(device_);
    }
    EmbreeInstances(const EmbreeInstances&) = delete;
    EmbreeInstances& operator=(const EmbreeInstances&) = delete;
    RTCScene scene() const { return top_; }

  private:
    RTCScene newScene() const {
        RTCScene scene = rtcNewScene(device_);
        rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
        return scene;
    }
    RTCDevice device_;
    RTCScene bottom_ = nullptr, top_ = nullptr;
};

Camera cameraAt(double distance) {
    return Camera::perspective(identityTransform(), {0, 0, distance}, Rotation{0, 0, 1, 0}, .7854, 16.0 / 9);
}

/// Seconds for the picture's rays in packets of 16, straight into an Embree scene.
double packetSeconds(RTCScene scene, int width, int height, float distance) {
    const double start = cpuSeconds();
    RTCRayHit16 rays;
    alignas(64) int valid[16];
    std::fill_n(valid, 16, -1);
    bvh::RayCast cast(true);
    unsigned hits = 0;
    const float scale = 2 * std::tan(.3927f) / static_cast<float>(height);
    for (int y = 0; y < height; y += 4)
        for (int x = 0; x < width; x += 4) {
            for (int i = 0; i < 16; ++i) {
                const Vec3f d = glm::normalize(
                    Vec3f((static_cast<float>(x + i % 4) + .5f - static_cast<float>(width) / 2) * scale,
                          (static_cast<float>(height) / 2 - static_cast<float>(y + i / 4) - .5f) * scale, -1));
                rays.ray.org_x[i] = 0, rays.ray.org_y[i] = 0, rays.ray.org_z[i] = distance;
                rays.ray.dir_x[i] = d.x, rays.ray.dir_y[i] = d.y, rays.ray.dir_z[i] = d.z;
                rays.ray.tnear[i] = 0, rays.ray.tfar[i] = INFINITY, rays.ray.time[i] = 0;
                rays.ray.mask[i] = ~0u, rays.ray.flags[i] = 0, rays.ray.id[i] = 0;
                rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
            }
            cast.intersect(valid, scene, rays);
            hits += rays.hit.geomID[0] != RTC_INVALID_GEOMETRY_ID;
        }
    keep(hits);
    return cpuSeconds() - start;
}

double singleSeconds(const RayWorld& world, int count) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> unit(-1, 1);
    std::vector<Ray> rays;
    for (int i = 0; i < count; ++i)
        rays.push_back({.origin = {unit(random), unit(random), unit(random)},
                        .direction = {unit(random), unit(random), unit(random)}});
    const double start = cpuSeconds();
    std::size_t hits = 0;
    for (const Ray& ray : rays) hits += static_cast<bool>(world.intersect(ray));
    keep(hits);
    return cpuSeconds() - start;
}

}  // namespace

void instances(const Report& report, bool quick) {
    struct Case {
        const char* name;
        std::uint32_t moving, resting;
    };
    const std::uint32_t many = quick ? 10'000 : 100'000;
    constexpr int kWidth = 640, kHeight = 360;
    for (const Case& c : {Case{"all may move", many, 0}, Case{"one moves, the others rest", 1, many}}) {
        const InstanceDelta delta = cloud(c.moving, c.resting);
        RayWorld world({.buildThreads = 1});
        world.apply(delta);
        RayWorld flat({.mapping = RayWorld::Mapping::merged, .buildThreads = 1});
        flat.apply(delta);
        const EmbreeInstances embree(world);
        const ViewRays rays(world, cameraAt(4), kWidth, kHeight);
        std::vector<double> ours, merged, bare, ourSingles, mergedSingles;
        for (int i = 0; i < 7; ++i) {
            ours.push_back(rays.trace(world));
            merged.push_back(rays.trace(flat));
            bare.push_back(packetSeconds(embree.scene(), kWidth, kHeight, 4));
            ourSingles.push_back(singleSeconds(world, 100'000));
            mergedSingles.push_back(singleSeconds(flat, 100'000));
        }
        // The best of each: on a shared machine the rest is others' work.
        const auto rate = [](const std::vector<double>& seconds, double count) {
            return count / *std::min_element(seconds.begin(), seconds.end()) * 1e-6;
        };
        const auto pixels = static_cast<double>(rays.count());
        const std::string name = fmt::format("{} spheres of {} triangles, {}", c.moving + c.resting,
                                             world.stats().instancedTriangles / (c.moving + c.resting), c.name);
        report({"instances", name, "primary rays in packets", "Mrays/s", rate(ours, pixels), "Embree's own instances",
                rate(bare, pixels), "all triangles in one BVH", rate(merged, pixels)});
        report({"instances", name, "incoherent single rays", "Mrays/s", rate(ourSingles, 1e5), "", 0,
                "all triangles in one BVH", rate(mergedSingles, 1e5)});
    }
}

}  // namespace rtsg::bench
