// Rays: shaded primary rays against bare Embree on the same triangles and the same rays, made beforehand, with
// whichever of its flags are the fastest. One thread.
#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <span>
#include <vector>

#include <fmt/format.h>
#include "embree/embree.h"

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/image.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

constexpr int kRaysWidth = 1280, kHeight = 720;

struct RoomTriangles {
    Array<Vec3f> points;
    Array<std::int32_t> indices;
    /// A row of rings of `sides` points each, of which those from `base` on are there already.
    void joinRings(std::int32_t base, int rings, int sides) {
        for (int i = 0; i < rings; ++i)
            for (int k = 0; k < sides; ++k) {
                const std::int32_t a = base + i * (sides + 1) + k, b = a + 1, c = a + sides + 1, d = c + 1;
                for (const std::int32_t v : {a, b, c, b, d, c}) indices.push_back(v);
            }
    }
    void addBox(const Vec3f& low, const Vec3f& high) {
        const auto corner = static_cast<std::int32_t>(points.size());
        for (int i = 0; i < 8; ++i)
            points.push_back(Vec3f(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z));
        for (const int v : {0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1,
                            2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3})
            indices.push_back(corner + v);
    }
    /// A rod with as many sides, each of two triangles from end to end.
    void addRod(const Vec3f& from, const Vec3f& to, float radius, int sides) {
        const Vec3f axis = glm::normalize(to - from);
        const Vec3f side = glm::normalize(glm::cross(axis, std::abs(axis.y) < .9f ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0)));
        const Vec3f other = glm::cross(axis, side);
        const auto base = static_cast<std::int32_t>(points.size());
        for (const Vec3f& end : {from, to})
            for (int k = 0; k <= sides; ++k) {
                const float angle = 6.2831853f * static_cast<float>(k) / static_cast<float>(sides);
                points.push_back(end + radius * (std::cos(angle) * side + std::sin(angle) * other));
            }
        joinRings(base, 1, sides);
    }
};

constexpr Vec3f kRoomLow(-8, -4, -15), kRoomHigh(8, 4, 9);  // so that every ray hits something

/// A room full of bumpy spheres, seen from inside: about `triangles` of them.
RoomTriangles spheresRoom(int triangles) {
    RoomTriangles result;
    const int objects = 40;
    const int rings = std::max(4, static_cast<int>(std::sqrt(triangles / objects / 4)));
    std::mt19937 random(7);
    std::uniform_real_distribution<float> coordinate(-6, 6);
    for (int object = 0; object < objects; ++object) {
        const Vec3f centre(coordinate(random), coordinate(random) * .4f, coordinate(random) - 6);
        const auto base = static_cast<std::int32_t>(result.points.size());
        for (int i = 0; i <= rings; ++i)
            for (int k = 0; k <= 2 * rings; ++k) {
                const float theta = 3.14159265f * static_cast<float>(i) / static_cast<float>(rings);
                const float phi = 3.14159265f * static_cast<float>(k) / static_cast<float>(rings);
                const float radius = .8f + .05f * std::sin(9 * theta) * std::cos(7 * phi);
                result.points.push_back(centre + radius * Vec3f(std::sin(theta) * std::cos(phi), std::cos(theta),
                                                                std::sin(theta) * std::sin(phi)));
            }
        result.joinRings(base, rings, 2 * rings);
    }
    result.addBox(kRoomLow, kRoomHigh);
    return result;
}

/// A hall as architects draw it: fluted columns and slanting rods of triangles as long as they are.
RoomTriangles hall(int triangles) {
    RoomTriangles result;
    const int columns = 96, rods = 200, sides = std::max(4, triangles / 2 / columns);
    for (int i = 0; i < columns; ++i) {
        const Vec3f foot(static_cast<float>(i % 8) * 2 - 7, kRoomLow.y, 3 - static_cast<float>(i / 8) * 1.5f);
        result.addRod(foot, foot + Vec3f(0, kRoomHigh.y - kRoomLow.y, 0), .2f, sides);
    }
    std::mt19937 random(11);
    std::uniform_real_distribution<float> unit(0, 1);
    for (int i = 0; i < rods; ++i) {
        const auto end = [&](float y) {
            return Vec3f(16 * unit(random) - 8, y + unit(random), 18 * unit(random) - 15);
        };
        const Vec3f from = end(1), to = end(3);
        result.addRod(from, to, .03f, 6);
    }
    result.addBox(kRoomLow, kRoomHigh);
    return result;
}

const Vec3f kLamp(0, 3, 4);

void fillScene(Scene& scene, const RoomTriangles& triangles) {
    const NodeId coordinate = scene.createNode(x3d::Coordinate::type),
                 faces = scene.createNode(x3d::IndexedTriangleSet::type);
    const NodeId shape = scene.createNode(x3d::Shape::type), appearance = scene.createNode(x3d::Appearance::type);
    const NodeId material = scene.createNode(x3d::Material::type), light = scene.createNode(x3d::PointLight::type);
    const NodeId view = scene.createNode(x3d::Viewpoint::type);
    (void)scene.set(coordinate, x3d::Coordinate::point, triangles.points);
    (void)scene.set(faces, x3d::IndexedTriangleSet::index, triangles.indices);
    (void)scene.set(faces, x3d::IndexedTriangleSet::coord, coordinate);
    (void)scene.set(faces, x3d::IndexedTriangleSet::solid, false);
    (void)scene.set(material, x3d::Material::specularColor, Color{.5f, .5f, .5f});
    (void)scene.set(appearance, x3d::Appearance::material, material);
    (void)scene.set(shape, x3d::Shape::geometry, faces);
    (void)scene.set(shape, x3d::Shape::appearance, appearance);
    (void)scene.set(light, x3d::PointLight::location, kLamp);
    (void)scene.set(view, x3d::Viewpoint::position, Vec3f(0, 0, 8));
    for (const NodeId id : {shape, light, view}) (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, id);
}

/// Embree alone: the mesh in place.
class BareEmbree {
  public:
    BareEmbree(const Mesh& mesh, RTCSceneFlags flags, RTCBuildQuality quality) {
        const double start = cpuSeconds();
        device_ = rtcNewDevice("threads=1");
        scene_ = rtcNewScene(device_);
        rtcSetSceneFlags(scene_, flags);
        rtcSetSceneBuildQuality(scene_, quality);
        RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.positions.data(), 0,
                                   sizeof(Vec3f), mesh.positions.size());
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                                   mesh.triangleStride * sizeof(std::int32_t), mesh.triangleCount);
        rtcSetGeometryBuildQuality(geometry, quality);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene_);
        building_ = cpuSeconds() - start;
    }
    ~BareEmbree() {
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    BareEmbree(const BareEmbree&) = delete;
    BareEmbree& operator=(const BareEmbree&) = delete;

    RTCScene scene() const { return scene_; }
    /// Seconds of CPU time.
    double building() const { return building_; }

  private:
    RTCDevice device_ = nullptr;
    RTCScene scene_ = nullptr;
    double building_ = 0;
};

/// A picture's rays, made beforehand: blocks of 4 x 4 pixels, ready to be copied into packets.
struct Rays {
    struct Block {
        alignas(64) float x[16], y[16], z[16];
    };
    std::vector<Block> blocks;
    Vec3f eye;

    explicit Rays(const Vec3f& from) : eye(from) {
        const float scale = 2 * std::tan(.3927f) / kHeight;
        for (int y = 0; y < kHeight; y += 4)
            for (int x = 0; x < kRaysWidth; x += 4) {
                Block& block = blocks.emplace_back();
                for (int lane = 0; lane < 16; ++lane) {
                    const float px = (static_cast<float>(x + lane % 4) + .5f - kRaysWidth / 2) * scale;
                    const float py = (kHeight / 2 - static_cast<float>(y + lane / 4) - .5f) * scale;
                    const Vec3f d = glm::normalize(Vec3f(px, py, -1));
                    block.x[lane] = d.x, block.y[lane] = d.y, block.z[lane] = d.z;
                }
            }
    }
};

/// Sets what does not change from packet to packet.
template <int kLanes>
void fillPacket(auto& packet, float tMin) {
    for (int i = 0; i < kLanes; ++i) {
        packet.ray.tnear[i] = tMin, packet.ray.time[i] = 0;
        packet.ray.mask[i] = ~0u, packet.ray.flags[i] = 0, packet.ray.id[i] = 0;
        packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
}

template <int kLanes, class RayHits>
double bareSecondsIn(const BareEmbree& bare, const Rays& rays) {
    RayHits packet;
    alignas(64) int valid[kLanes];
    fillPacket<kLanes>(packet, 0);
    for (int i = 0; i < kLanes; ++i) {
        valid[i] = -1;
        packet.ray.org_x[i] = rays.eye.x, packet.ray.org_y[i] = rays.eye.y, packet.ray.org_z[i] = rays.eye.z;
    }
    bvh::RayCast cast(true);
    unsigned hits = 0;
    const double start = cpuSeconds();
    for (const Rays::Block& block : rays.blocks)
        for (int at = 0; at < 16; at += kLanes) {
            std::memcpy(packet.ray.dir_x, block.x + at, sizeof packet.ray.dir_x);
            std::memcpy(packet.ray.dir_y, block.y + at, sizeof packet.ray.dir_y);
            std::memcpy(packet.ray.dir_z, block.z + at, sizeof packet.ray.dir_z);
            for (int i = 0; i < kLanes; ++i)
                packet.ray.tfar[i] = INFINITY, packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
            cast.trace(valid, bare.scene(), packet);
            hits += packet.hit.geomID[0] != RTC_INVALID_GEOMETRY_ID;
        }
    keep(hits);
    return cpuSeconds() - start;
}
/// In the widest packets that Embree has on this machine.
double bareSeconds(const BareEmbree& bare, const Rays& rays) {
    switch (bvh::packetWidth()) {
        case 16:
            return bareSecondsIn<16, RTCRayHit16>(bare, rays);
        case 8:
            return bareSecondsIn<8, RTCRayHit8>(bare, rays);
        default:
            return bareSecondsIn<4, RTCRayHit4>(bare, rays);
    }
}
std::string embreesCall(const char* name) {
    return fmt::format("{}{}", name, bvh::packetWidth());
}

double worldSeconds(const RayWorld& world, const Rays& rays) {
    RayPacket16 packet;
    for (int i = 0; i < 16; ++i) packet.set(i, {.origin = rays.eye});
    std::uint32_t hits = 0;
    const double start = cpuSeconds();
    for (const Rays::Block& block : rays.blocks) {
        std::memcpy(packet.directionX, block.x, sizeof block.x);
        std::memcpy(packet.directionY, block.y, sizeof block.y);
        std::memcpy(packet.directionZ, block.z, sizeof block.z);
        for (float& t : packet.tMax) t = INFINITY;
        hits += world.intersect(packet, true) & 1;
    }
    keep(hits);
    return cpuSeconds() - start;
}

/// The rays that follow the primary rays, made beforehand, in the order of the pixels.
struct Followers {
    struct Block {
        alignas(64) float origin[3][16], direction[3][16];
        alignas(64) int active[16];
    };
    std::vector<Block> blocks;
    float tMax;
    std::size_t count = 0;

    /// `direction(point, direction of the ray)`: not 0, or there is none.
    template <class Direction>
    Followers(const RayWorld& world, const Rays& rays, float end, const Direction& direction) : tMax(end) {
        for (const Rays::Block& from : rays.blocks) {
            Block block{};
            RayPacket16 packet;
            for (int i = 0; i < 16; ++i) packet.set(i, {rays.eye, 0, {from.x[i], from.y[i], from.z[i]}});
            (void)world.intersect(packet, true);
            for (int i = 0; i < 16; ++i) {
                const Hit hit = world.hit(packet, i);
                if (!hit) continue;
                const Vec3f before(from.x[i], from.y[i], from.z[i]);
                const HitPoint point = world.point(hit);
                Vec3f towards = direction(point, before);
                if (towards == Vec3f(0)) continue;
                const Vec3f start = RayWorld::leave(point, towards);
                if (tMax == 1) towards = kLamp - start;
                block.active[i] = -1, ++count;
                for (int k = 0; k < 3; ++k) block.origin[k][i] = start[k], block.direction[k][i] = towards[k];
            }
            blocks.push_back(block);
        }
    }
    static Followers shadows(const RayWorld& world, const Rays& rays) {
        return {world, rays, 1, [](const HitPoint& point, const Vec3f& before) {
                    const Vec3f towards = kLamp - point.position;
                    // A point that sees the lamp from behind needs no shadow ray.
                    return glm::dot(point.normal, before) * glm::dot(point.normal, towards) < 0 ? towards : Vec3f(0);
                }};
    }
    static Followers reflections(const RayWorld& world, const Rays& rays) {
        return {world, rays, INFINITY, [](const HitPoint& point, const Vec3f& before) {
                    return before - 2 * glm::dot(before, point.normal) * point.normal;
                }};
    }

    double bareSeconds(const BareEmbree& bare, bool occlusion, bool coherent) const {
        switch (bvh::packetWidth()) {
            case 16:
                return bareSecondsIn<16, RTCRayHit16, RTCRay16>(bare, occlusion, coherent);
            case 8:
                return bareSecondsIn<8, RTCRayHit8, RTCRay8>(bare, occlusion, coherent);
            default:
                return bareSecondsIn<4, RTCRayHit4, RTCRay4>(bare, occlusion, coherent);
        }
    }
    template <int kLanes, class RayHits, class RaysAlone>
    double bareSecondsIn(const BareEmbree& bare, bool occlusion, bool coherent) const {
        RayHits packet;
        fillPacket<kLanes>(packet, 1e-30f);
        bvh::RayCast cast(coherent);
        float* const origins[] = {packet.ray.org_x, packet.ray.org_y, packet.ray.org_z};
        float* const directions[] = {packet.ray.dir_x, packet.ray.dir_y, packet.ray.dir_z};
        const double start = cpuSeconds();
        for (const Block& block : blocks)
            for (int at = 0; at < 16; at += kLanes) {
                for (int k = 0; k < 3; ++k) {
                    std::memcpy(origins[k], block.origin[k] + at, kLanes * sizeof(float));
                    std::memcpy(directions[k], block.direction[k] + at, kLanes * sizeof(float));
                }
                for (int i = 0; i < kLanes; ++i)
                    packet.ray.tfar[i] = tMax, packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
                if (occlusion)
                    cast.trace(block.active + at, bare.scene(), reinterpret_cast<RaysAlone&>(packet));
                else
                    cast.trace(block.active + at, bare.scene(), packet);
                keep(packet.ray.tfar[0]);
            }
        return cpuSeconds() - start;
    }
    double worldSeconds(const RayWorld& world) const {
        RayPacket16 packet;
        std::uint32_t hits = 0;
        for (float& t : packet.tMin) t = 1e-30f;
        const double start = cpuSeconds();
        for (const Block& block : blocks) {
            std::memcpy(packet.originX, block.origin[0], sizeof block.origin);
            std::memcpy(packet.directionX, block.direction[0], sizeof block.direction);
            std::memcpy(packet.active, block.active, sizeof block.active);
            for (float& t : packet.tMax) t = tMax;
            hits += world.intersect(packet) & 1;
        }
        keep(hits);
        return cpuSeconds() - start;
    }
    /// One after the other.
    double singleSeconds(const RayWorld& world) const {
        std::uint32_t hits = 0;
        const double start = cpuSeconds();
        for (const Block& block : blocks)
            for (int i = 0; i < 16; ++i)
                if (block.active[i])
                    hits += static_cast<bool>(
                        world.intersect({{block.origin[0][i], block.origin[1][i], block.origin[2][i]},
                                         1e-30f,
                                         {block.direction[0][i], block.direction[1][i], block.direction[2][i]},
                                         tMax}));
        keep(hits);
        return cpuSeconds() - start;
    }
};

/// The best that Embree can do on a mesh: the fastest of its flags and qualities.
struct Limit {
    struct Choice {
        const char* name;
        RTCSceneFlags flags;
        RTCBuildQuality quality;
    };
    static constexpr Choice kChoices[] = {{"robust, medium", RTC_SCENE_FLAG_ROBUST, RTC_BUILD_QUALITY_MEDIUM},
                                          {"fast, medium", RTC_SCENE_FLAG_NONE, RTC_BUILD_QUALITY_MEDIUM},
                                          {"fast, high", RTC_SCENE_FLAG_NONE, RTC_BUILD_QUALITY_HIGH}};
    std::vector<std::unique_ptr<BareEmbree>> scenes;
    std::vector<double> seconds[std::size(kChoices)];

    explicit Limit(const Mesh& mesh) {
        for (const Choice& choice : kChoices)
            scenes.push_back(std::make_unique<BareEmbree>(mesh, choice.flags, choice.quality));
    }
    void measure(const Rays& rays) {
        for (std::size_t i = 0; i < scenes.size(); ++i) seconds[i].push_back(bareSeconds(*scenes[i], rays));
    }
    std::size_t best() const { return bestOf(seconds); }
    /// The least of all flags for these, told to be coherent or not.
    double minimum(const Followers& rays, bool occlusion, int rounds) const {
        std::vector<double> times[2 * std::size(kChoices)];
        for (int round = 0; round < rounds; ++round)
            for (std::size_t i = 0; i < std::size(times); ++i)
                times[i].push_back(
                    rays.bareSeconds(*scenes[i / 2], occlusion, i % 2 && (bvh::kOccludesCoherently || !occlusion)));
        return median(times[bestOf(times)]);
    }

  private:
    static std::size_t bestOf(std::span<const std::vector<double>> times) {
        std::size_t result = 0;
        for (std::size_t i = 1; i < times.size(); ++i)
            if (median(times[i]) < median(times[result])) result = i;
        return result;
    }
};

/// One mesh, seen from within. Returns whether there was something to measure.
bool measureRays(const Report& report, const char* what, const RoomTriangles& triangles, int rounds) {
    Scene scene;
    fillScene(scene, triangles);
    scene.newFrame(0);
    const double before = cpuSeconds();
    SharedWorld shared(scene);
    const RayWorld& world = shared.rays();
    const double building = cpuSeconds() - before;
    LightRenderer light(shared);
    const Mesh* mesh = nullptr;
    for (const RayInstance& instance : world.instances())
        if (instance.mesh) mesh = instance.mesh.get();
    if (!mesh) return false;
    Limit bare(*mesh);
    const Rays rays(world.fromWorld(Vec3d(0, 0, 8)));
    const Followers shadowRays = Followers::shadows(world, rays), mirrored = Followers::reflections(world, rays);
    ImageOptions options;
    options.settings.width = kRaysWidth;
    options.settings.height = kHeight;
    options.settings.threads = 1;
    const auto shaded = [&](Shadows shadows) {
        options.settings.shadows = shadows;
        const double start = cpuSeconds();
        const auto picture = light.picture(options);
        return picture ? cpuSeconds() - start : -1;
    };
    std::vector<double> intersect, shade, shadow, batched, single;
    for (int i = 0; i < rounds; ++i) {
        bare.measure(rays);
        intersect.push_back(worldSeconds(world, rays));
        shade.push_back(shaded(Shadows::none));
        shadow.push_back(shaded(Shadows::all));
        batched.push_back(mirrored.worldSeconds(world));
        single.push_back(mirrored.singleSeconds(world));
    }
    const double count = kRaysWidth * kHeight / 1e6, mirroredCount = static_cast<double>(mirrored.count) / 1e6;
    const std::string name = fmt::format("{}{} triangles, {} x {}", what, mesh->triangleCount, kRaysWidth, kHeight);
    const std::size_t best = bare.best();
    const double minimum = median(bare.seconds[best]);
    const std::string limitName = fmt::format("{}, {}", embreesCall("rtcIntersect"), Limit::kChoices[best].name);
    const auto line = [&](const char* metric, const char* unit, const std::vector<double>& seconds) {
        report({"rays", name, metric, unit, count / median(seconds), "", 0, limitName, count / minimum});
    };
    line("RayWorld, hits only", "Mrays/s", intersect);
    line("shaded primary rays", "Mrays/s", shade);
    report({"rays", name, "shaded, one shadow ray each", "Mpixels/s", count / median(shadow), "", 0,
            fmt::format("{}, and {} of the same shadow rays", limitName, embreesCall("rtcOccluded")),
            count / (minimum + bare.minimum(shadowRays, true, rounds))});
    report({"rays", name, "reflections in packets", "Mrays/s", mirroredCount / median(batched), "one by one",
            mirroredCount / median(single), embreesCall("rtcIntersect") + " of the same rays",
            mirroredCount / bare.minimum(mirrored, false, rounds)});
    report({"rays", name, "the scene's triangles made ready", "ms", 1e3 * building, "", 0,
            fmt::format("rtcCommitScene, {}", Limit::kChoices[best].name), 1e3 * bare.scenes[best]->building()});
    return median(shade) >= 0;
}

}  // namespace

bool rays(const Report& report, bool quick) {
    const int rounds = quick ? 1 : 5;
    return measureRays(report, "", spheresRoom(100'000), rounds) &&
           measureRays(report, "hall of long triangles, ", hall(100'000), rounds) &&
           (quick || measureRays(report, "", spheresRoom(1'000'000), rounds));
}

}  // namespace rtsg::bench
