// Packets of rays in the sizes that Embree has: what each lane meets, against rays one by one.
#include "embree/embree.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>

namespace rtsg::bvh {
namespace {

constexpr unsigned kPacketSeed = 1278;

/// Triangles in a unit cube.
class Triangles1000 {
  public:
    Triangles1000() {
        const RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
        auto* corners = static_cast<float*>(
            rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3000));
        auto* indices = static_cast<unsigned*>(
            rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), 1000));
        std::mt19937 random(kPacketSeed);
        std::uniform_real_distribution<float> in(0, 1), aside(-.1f, .1f);
        for (int t = 0; t < 1000; ++t) {
            const float middle[] = {in(random), in(random), in(random)};
            for (int k = 0; k < 9; ++k) corners[9 * t + k] = middle[k % 3] + aside(random);
            for (unsigned k = 0; k < 3; ++k) indices[3 * t + k] = 3 * t + k;
        }
        rtcSetGeometryMask(geometry, ~0u);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_.get(), geometry);
        rtcReleaseGeometry(geometry);
        rtcSetSceneFlags(scene_.get(), static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | kAsksOfHits));
        rtcCommitScene(scene_.get());
    }
    RTCScene get() const { return scene_.get(); }

  private:
    struct Release {
        void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
        void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    };
    std::unique_ptr<RTCDeviceTy, Release> device_{rtcNewDevice("threads=1")};
    std::unique_ptr<RTCSceneTy, Release> scene_{rtcNewScene(device_.get())};
};

/// Some lanes valid, what would not end in the others.
struct Asked {
    RTCRayHit16 rays;
    alignas(64) int valid[16];

    explicit Asked(std::mt19937& random) {
        std::uniform_real_distribution<float> in(0, 1), any(-1, 1);
        std::memset(&rays, 0xff, sizeof rays);  // what was not filled in is NaN
        for (int i = 0; i < 16; ++i) {
            valid[i] = random() % 3 ? -1 : 0;
            if (!valid[i]) continue;
            rays.ray.org_x[i] = in(random), rays.ray.org_y[i] = in(random), rays.ray.org_z[i] = in(random);
            rays.ray.dir_x[i] = any(random), rays.ray.dir_y[i] = any(random), rays.ray.dir_z[i] = any(random);
            rays.ray.tnear[i] = 0, rays.ray.tfar[i] = i % 4 ? 10 : .2f, rays.ray.time[i] = 0;
            rays.ray.mask[i] = ~0u, rays.ray.id[i] = 0, rays.ray.flags[i] = 0;
        }
    }
    RTCRayHit one(int i) const {
        RTCRayHit r;
        r.ray = {rays.ray.org_x[i],
                 rays.ray.org_y[i],
                 rays.ray.org_z[i],
                 rays.ray.tnear[i],
                 rays.ray.dir_x[i],
                 rays.ray.dir_y[i],
                 rays.ray.dir_z[i],
                 0,
                 rays.ray.tfar[i],
                 ~0u,
                 0,
                 0};
        r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        return r;
    }
};

void expectUntouched(const Asked& before, const Asked& after, int lane) {
    const auto row = [lane](const Asked& asked, std::size_t k) {
        std::uint32_t bits = 0;
        std::memcpy(&bits, reinterpret_cast<const char*>(&asked.rays) + (16 * k + lane) * sizeof bits, sizeof bits);
        return bits;
    };
    for (std::size_t k = 0; k < sizeof(RTCRayHit16) / 64; ++k) EXPECT_EQ(row(before, k), row(after, k)) << "row " << k;
}

void expectAsOneByOne(const Asked& before, const Asked& after, const Triangles1000& world) {
    for (int i = 0; i < 16; ++i) {
        SCOPED_TRACE("lane " + std::to_string(i));
        if (!before.valid[i]) {
            expectUntouched(before, after, i);
            continue;
        }
        RTCRayHit one = before.one(i);
        RayCast(false).intersect(world.get(), one);
        ASSERT_EQ(after.rays.hit.geomID[i], one.hit.geomID);
        EXPECT_NEAR(after.rays.ray.tfar[i], one.ray.tfar, 1e-5f);
        if (one.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
            EXPECT_EQ(after.rays.hit.primID[i], one.hit.primID);
            EXPECT_NEAR(after.rays.hit.u[i], one.hit.u, 1e-3f);
        }
    }
}

/// A ray that hits something is in its shadow.
void expectShadowsOf(const Asked& before, const Asked& after, const Asked& shadow) {
    for (int i = 0; i < 16; ++i) {
        if (before.valid[i])
            EXPECT_EQ(shadow.rays.ray.tfar[i] < 0, after.rays.hit.geomID[i] == 0) << "lane " << i;
        else
            expectUntouched(before, shadow, i);
    }
}

TEST(RayPackets, LanesThatAreNotValidAreNeitherTracedNorWritten) {
    const Triangles1000 world;
    std::mt19937 random(kPacketSeed + 1);
    int hits = 0;
    for (int round = 0; round < 300; ++round) {
        const Asked before(random);
        Asked after = before;
        RayCast(round % 2).intersect(after.valid, world.get(), after.rays);
        expectAsOneByOne(before, after, world);
        for (int i = 0; i < 16; ++i) hits += before.valid[i] && after.rays.hit.geomID[i] == 0;

        Asked shadow = before;
        RayCast(round % 2).occluded(shadow.valid, world.get(), shadow.rays.ray);
        expectShadowsOf(before, after, shadow);
    }
    EXPECT_GT(hits, 1000);
}

// Packets of fewer lanes than this machine has are those of others; they must be right here, too.
template <int kLanes, class RayHits, class Rays>
void expectPartsRight() {
    if (kLanes > packetWidth()) return;
    const Triangles1000 world;
    RayCast cast(false);
    std::mt19937 random(kPacketSeed + kLanes);
    for (int round = 0; round < 300; ++round) {
        const Asked before(random);
        Asked after = before, shadow = before;
        traceParts<kLanes, RayHits>(after.valid, after.rays,
                                    [&](const int* lanes, RayHits& part) { cast.trace(lanes, world.get(), part); });
        expectAsOneByOne(before, after, world);
        traceParts<kLanes, Rays>(shadow.valid, shadow.rays.ray,
                                 [&](const int* lanes, Rays& part) { cast.trace(lanes, world.get(), part); });
        expectShadowsOf(before, after, shadow);
    }
    alignas(64) const int none[16] = {};
    Asked asked(random);
    traceParts<kLanes, RayHits>(none, asked.rays, [](const int*, RayHits&) { FAIL() << "no lane is valid"; });
}

/// Counts the hits of each ray, by its number, and has rays go on.
void countHits(const RTCFilterFunctionNArguments* asked) {
    for (unsigned i = 0; i < asked->N; ++i) {
        if (asked->valid[i] == 0) continue;
        ++static_cast<int*>(RayCast::contextOf(*asked))[RTCRayN_id(asked->ray, asked->N, i)];
        asked->valid[i] = 0;
    }
}

// A filter that decides about hits is told which rays they belong to, in packets of any width.
template <int kLanes, class Rays>
void expectNumbered() {
    if (kLanes > packetWidth()) return;
    const Triangles1000 world;
    std::mt19937 random(kPacketSeed + 2);
    int hits = 0;
    for (int round = 0; round < 100; ++round) {
        Asked asked(random);
        for (unsigned i = 0; i < 16; ++i) asked.rays.ray.id[i] = i;
        int counts[16] = {};
        RayCast cast(false);
        cast.ask(countHits, counts);
        Asked after = asked;
        traceParts<kLanes, Rays>(after.valid, after.rays.ray,
                                 [&](const int* lanes, Rays& part) { cast.trace(lanes, world.get(), part); });
        for (int i = 0; i < 16; ++i) {
            int alone[1] = {};
            if (asked.valid[i]) {
                RTCRay one = asked.one(i).ray;
                RayCast single(false);
                single.ask(countHits, alone);
                single.occluded(world.get(), one);
                EXPECT_EQ(after.rays.ray.tfar[i], asked.rays.ray.tfar[i]);
            }
            EXPECT_EQ(counts[i], alone[0]) << "lane " << i;
            hits += counts[i];
        }
    }
    EXPECT_GT(hits, 1000);
}

TEST(RayPackets, OfAnyLanesTellWhoseHitsAre) {
    expectNumbered<16, RTCRay16>();
    expectNumbered<8, RTCRay8>();
    expectNumbered<4, RTCRay4>();
}

TEST(RayPackets, OfFewerLanesMeetWhatRaysOneByOneMeet) {
    expectPartsRight<8, RTCRayHit8, RTCRay8>();
    expectPartsRight<4, RTCRayHit4, RTCRay4>();
}

}  // namespace
}  // namespace rtsg::bvh
