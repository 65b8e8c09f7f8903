// Operations on all lanes of a packet: correct numbers, the same for every width of the machine.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "surface/packet_kernels.h"
#include "surface/surface_packet.h"

namespace rtsg::trace {
namespace {

/// Numbers for every lane of everything that kernels read.
class Inputs {
  public:
    explicit Inputs(unsigned seed) : random_(seed) {
        for (int lane = 0; lane < 16; ++lane) {
            rays.set(lane, {position(9), 0, glm::normalize(position(1)), number(.1f, 20)});
            const Vec3f n = glm::normalize(position(1));
            s.hits.normalX[lane] = n.x, s.hits.normalY[lane] = n.y, s.hits.normalZ[lane] = n.z;
            s.hits.u[lane] = number(0, .5f), s.hits.v[lane] = number(0, .5f);
            s.hits.triangle[lane] = static_cast<std::uint32_t>(lane * 7 % kTriangles);
            s.hits.instance[lane] = 0;
            s.normal.set(lane, lane == 5 ? Vec3f(0) : number(.1f, 3) * position(1));
            s.base.set(lane, glm::abs(position(1))), s.specular.set(lane, glm::abs(position(1)));
            s.emissive.set(lane, glm::abs(position(1))), s.ambient.set(lane, glm::abs(position(1)));
            s.exponent[lane] = lane == 3 ? 0 : number(0, 128);
            s.metallic[lane] = number(0, 1), s.roughness[lane] = number(0, 1);
        }
        s.mask = 0xFFFF & ~0x0210u;
        s.unlit = 0x0041;
        for (Vec3f& v : values) v = position(2);
        for (std::int32_t& i : index) i = static_cast<std::int32_t>(random_() % std::size(values));
        instance.rayFromLocal = {position(2), position(2), position(2), position(50)};
        instance.errorScale = 1.5f, instance.errorFloor = glm::abs(position(1e-6f));
        normals.normalFromLocal = {position(2), position(2), position(2)};
        normals.values = &values[0].x, normals.index = index;
        normals.triangleStep = 3, normals.cornerStep = 1;
        light.color = glm::abs(position(2)), light.ambient = glm::abs(position(1));
        light.position = position(20), light.direction = glm::normalize(position(1));
        light.attenuation = {.5f, .1f, .02f};
        light.radius = 40, light.beamWidth = .8f, light.cutOffAngle = 2.5f;
    }
    float number(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }
    Vec3f position(float far) { return {number(-far, far), number(-far, far), number(-far, far)}; }

    static constexpr int kTriangles = 20;
    RayPacket16 rays{};
    SurfacePacket s{};
    Vec3f values[40 + 2];  // and what is read behind the last
    std::int32_t index[kTriangles * 3];
    RayInstance instance;
    NormalSource normals{};
    TraceLight light;

  private:
    std::mt19937 random_;
};

alignas(64) constexpr float kMiddles[16] = {.5f, .5f, .5f, .5f, .5f, .5f, .5f, .5f,
                                            .5f, .5f, .5f, .5f, .5f, .5f, .5f, .5f};
constexpr Light::Kind kKinds[] = {Light::Kind::directional, Light::Kind::point, Light::Kind::spot};

/// Everything that is done to a packet, one after the other; what pixels get in the end.
void runAll(const PacketKernels& k, Inputs& in, RayPacket16& created, RayPacket16& shadow, float* pixels) {
    k.makeRays({32, 48, -.7f, .01f, .4f, .012f, {1, 2, 3}, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}, 100}, 0xFF7F, kMiddles,
               kMiddles, created);
    k.fetchNormals(in.normals, 0x0F3C, in.s);
    k.finishGeometry(in.rays, in.s);
    k.findPoints(in.instance, in.values, in.index, 3, 0xFF0F, in.s);
    k.addOwn(in.s);
    for (const Light::Kind kind : kKinds) {
        in.light.kind = kind;
        k.shinePhong(in.light, in.s.mask & 0x7FFF, kind != Light::Kind::spot, in.s);
        Incoming incoming;
        if (!k.gather(in.light, in.s, incoming)) continue;
        const std::uint32_t faint = k.faint(in.light, incoming, in.s.coverage, .3f, true, in.s);
        for (int lane = 0; lane < 16; ++lane) in.s.opacity[lane] = static_cast<float>(faint >> lane & 1u);
        std::uint32_t behind = 0;
        (void)k.shadowRays(in.light, in.s, incoming, 0x7FFF, shadow, behind);
        incoming.visible.set(2, Vec3f(.25f, .5f, 0));
        // One half alone, and the other: eight lanes at a time may be none.
        for (const std::uint32_t half : {0x00FFu, 0x7F00u}) {
            k.shinePhong(in.light, half, true, in.s);
            k.addPhong(in.light, incoming, half, true, in.s);
            k.addPhysical(in.light, incoming, half, in.s);
        }
    }
    k.addToPixels(in.s, in.s.mask, pixels);
}

bool equal(const Lanes3& a, const Lanes3& b) {
    return std::memcmp(&a, &b, sizeof a) == 0;
}

TEST(PacketKernels, NumbersAreTheSameAtEitherWidth) {
    if (!packetKernels16()) GTEST_SKIP() << "no AVX-512 here";
    for (unsigned seed = 1; seed <= 200; ++seed) {
        SCOPED_TRACE(seed);
        auto narrow = std::make_unique<Inputs>(seed), wide = std::make_unique<Inputs>(seed);
        RayPacket16 created[2]{}, shadow[2]{};
        float pixels[2][4 * kTileSide * 4] = {};
        runAll(packetKernels8(), *narrow, created[0], shadow[0], pixels[0]);
        runAll(*packetKernels16(), *wide, created[1], shadow[1], pixels[1]);
        EXPECT_EQ(std::memcmp(&created[0], &created[1], sizeof created[0]), 0);
        EXPECT_EQ(std::memcmp(&shadow[0], &shadow[1], sizeof shadow[0]), 0);
        EXPECT_EQ(std::memcmp(pixels[0], pixels[1], sizeof pixels[0]), 0);
        EXPECT_EQ(narrow->s.back, wide->s.back);
        EXPECT_TRUE(equal(narrow->s.position, wide->s.position));
        EXPECT_TRUE(equal(narrow->s.normal, wide->s.normal));
        EXPECT_TRUE(equal(narrow->s.exact, wide->s.exact));
        EXPECT_TRUE(equal(narrow->s.error, wide->s.error));
        EXPECT_TRUE(equal(narrow->s.radiance, wide->s.radiance));
    }
}

/// Both widths that this machine has.
std::vector<const PacketKernels*> widths() {
    std::vector<const PacketKernels*> result{&packetKernels8()};
    if (packetKernels16()) result.push_back(packetKernels16());
    return result;
}

TEST(PacketKernels, RaysGoThroughPixelsMiddles) {
    for (const PacketKernels* k : widths()) {
        RayPacket16 rays{};
        const PixelBlock block{8, 4, -.8f, .05f, .6f, .04f, {1, 2, 3}, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}, 77};
        k->makeRays(block, 0x8001, kMiddles, kMiddles, rays);
        for (int lane = 0; lane < 16; ++lane) {
            const Vec3d d = glm::normalize(Vec3d(-.8 + .05 * (8 + lane % 4 + .5), .6 - .04 * (4 + lane / 4 + .5), -1));
            EXPECT_NEAR(rays.directionX[lane], d.x, 2e-7) << lane;
            EXPECT_NEAR(rays.directionY[lane], d.y, 2e-7) << lane;
            EXPECT_NEAR(rays.directionZ[lane], d.z, 2e-7) << lane;
            EXPECT_EQ(rays.tMax[lane], 77);
            EXPECT_EQ(rays.active[lane], lane == 0 || lane == 15 ? -1 : 0);
        }
        // And through other places than the middles.
        alignas(64) float u[16], v[16];
        for (int lane = 0; lane < 16; ++lane)
            u[lane] = static_cast<float>(lane) / 16, v[lane] = static_cast<float>(15 - lane) / 16;
        k->makeRays(block, 0xFFFF, u, v, rays);
        for (int lane = 0; lane < 16; ++lane) {
            const Vec3d d = glm::normalize(
                Vec3d(-.8 + .05 * (8 + lane % 4 + double{u[lane]}), .6 - .04 * (4 + lane / 4 + double{v[lane]}), -1));
            EXPECT_NEAR(rays.directionX[lane], d.x, 2e-7) << lane;
            EXPECT_NEAR(rays.directionY[lane], d.y, 2e-7) << lane;
        }
        // The middle of an odd number of pixels is the middle, to the last bit.
        k->makeRays({-.5f, -2.5f, 0, .01f, 0, .01f, {1, 2, 3}, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}, 77}, 0xFFFF, kMiddles,
                    kMiddles, rays);
        EXPECT_EQ(Vec3f(rays.directionX[8], rays.directionY[8], rays.directionZ[8]), Vec3f(0, 0, -1));
    }
}

TEST(PacketKernels, NormalsAreInterpolatedWhereAskedFor) {
    for (const PacketKernels* k : widths())
        for (const std::uint32_t step : {1u, 0u}) {
            Inputs in(5);
            in.normals.cornerStep = step;
            const Lanes3 before = in.s.normal;
            const std::uint32_t lanes = step ? 0x3F08 : 0x3F00;  // of the first eight one, or none
            k->fetchNormals(in.normals, lanes, in.s);
            for (int lane = 0; lane < 16; ++lane) {
                if (!(lanes >> lane & 1u)) {
                    EXPECT_EQ(in.s.normal.get(lane), before.get(lane));
                    continue;
                }
                const std::int32_t* corner = in.index + 3 * in.s.hits.triangle[lane];
                const double u = step ? in.s.hits.u[lane] : 0, v = step ? in.s.hits.v[lane] : 0;
                const Vec3d local = (1 - u - v) * Vec3d(in.values[corner[0]]) + u * Vec3d(in.values[corner[step]]) +
                                    v * Vec3d(in.values[corner[2 * step]]);
                const Vec3d expected = glm::dmat3(in.normals.normalFromLocal) * local;
                EXPECT_LT(glm::length(Vec3d(in.s.normal.get(lane)) - expected), 1e-5) << lane;
            }
        }
}

/// 17.2.2.4 in double precision, of one light without a shadow.
Vec3d reference(const TraceLight& light, const SurfacePacket& s, int lane, bool shiny) {
    const Vec3d n(s.normal.get(lane)), view(s.view.get(lane));
    Vec3d towards = -Vec3d(light.direction);
    double factor = 1;
    if (light.kind != Light::Kind::directional) {
        const Vec3d displacement = Vec3d(light.position) - Vec3d(s.position.get(lane));
        const double distance = glm::length(displacement);
        towards = displacement / distance;
        const Vec3d a(light.attenuation);
        factor = distance > light.radius ? 0 : 1 / std::max(a.x + a.y * distance + a.z * distance * distance, 1.0);
        if (light.kind == Light::Kind::spot) {
            const double angle = std::acos(-glm::dot(towards, Vec3d(light.direction)));
            const double ramp = (angle - light.cutOffAngle) / (double{light.beamWidth} - light.cutOffAngle);
            factor *= angle >= light.cutOffAngle ? 0 : angle <= light.beamWidth ? 1 : ramp;
        }
    }
    const double cosine = std::max(glm::dot(n, towards), 0.0);
    Vec3d direct = Vec3d(s.base.get(lane)) * cosine;
    if (shiny && cosine > 0)
        direct += Vec3d(s.specular.get(lane)) *
                  std::pow(std::max(glm::dot(n, glm::normalize(towards + view)), 0.0), double{s.exponent[lane]});
    return factor * (Vec3d(light.color) * direct + Vec3d(light.ambient) * Vec3d(s.ambient.get(lane)));
}

TEST(PacketKernels, LightIsThatOfTheEquation) {
    double worst = 0;
    for (const PacketKernels* k : widths())
        for (unsigned seed = 1; seed <= 100; ++seed)
            for (const Light::Kind kind : kKinds)
                for (const bool shiny : {false, true}) {
                    Inputs in(seed);
                    in.light.kind = kind;
                    if (seed % 3 == 0) in.light.attenuation = {1, 0, 0};
                    k->finishGeometry(in.rays, in.s);
                    k->addOwn(in.s);
                    const Lanes3 own = in.s.radiance;
                    k->shinePhong(in.light, in.s.mask, shiny, in.s);
                    for (int lane = 0; lane < 16; ++lane) {
                        const Vec3d added = Vec3d(in.s.radiance.get(lane)) - Vec3d(own.get(lane));
                        if (!(in.s.mask >> lane & 1u)) {
                            EXPECT_EQ(added, Vec3d(0)) << lane;
                            continue;
                        }
                        const Vec3d expected = reference(in.light, in.s, lane, shiny);
                        const Vec3d off = glm::abs(added - expected);
                        worst = std::max({worst, off.x, off.y, off.z});
                    }
                }
    EXPECT_LT(worst, 2e-5);
}

TEST(PacketKernels, PixelsGetWhatTheirLaneHas) {
    for (const PacketKernels* k : widths()) {
        SurfacePacket s{};
        for (int lane = 0; lane < 16; ++lane)
            s.radiance.set(lane, lane == 6 ? Vec3f(NAN) : Vec3f(lane, 100 + lane, 200 + lane));
        float pixels[4 * kTileSide * 4];
        std::ranges::fill(pixels, 1.0f);
        k->addToPixels(s, 0xFFBE, pixels);
        for (int i = 0; i < 4 * kTileSide; ++i) {
            const int x = i % kTileSide, lane = i / kTileSide * 4 + x;
            const bool touched = x < 4 && (0xFFBEu >> lane & 1u);
            const Vec4f expected = touched ? Vec4f(lane, 100 + lane, 200 + lane, 1) : Vec4f(0);
            for (int c = 0; c < 4; ++c) EXPECT_EQ(pixels[4 * i + c], 1 + expected[c]) << i << ' ' << c;
        }
    }
}

}  // namespace
}  // namespace rtsg::trace
