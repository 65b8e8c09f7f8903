// Textures looked up for many lanes at once: each gets what it gets alone, bit for bit.
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "surface/texture_lanes.h"

namespace rtsg::trace {
namespace {

bool isSame(float a, float b) {
    return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

Texture noise(std::mt19937& random, int width, int height, int channels, Texture::Content content) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(width * height * channels));
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    return Texture::fromBytes(bytes, width, height, channels, content).value();
}
Texture brightNoise(std::mt19937& random, int width, int height) {
    std::vector<Vec4f> pixels(static_cast<std::size_t>(width * height));
    std::uniform_real_distribution<float> number(0, 9);
    for (Vec4f& pixel : pixels) pixel = {number(random), number(random), number(random), number(random) / 9};
    return Texture::fromFloats(std::move(pixels), width, height, 4, Texture::Content::color).value();
}

TEST(TextureLanes, EightPlacesAreLookedUpAsOne) {
    std::mt19937 random(7);
    std::vector<Texture> textures;
    for (const int width : {1, 2, 7, 64})
        for (const int height : {1, 5, 32})
            for (const auto content : {Texture::Content::color, Texture::Content::data})
                textures.push_back(noise(random, width, height, width == 7 ? 3 : 4, content));
    textures.push_back(brightNoise(random, 9, 4));
    const float odd[] = {0, -0.0f, 1, 2, -1, 3e20f, -3e20f, -1e-9f, HUGE_VALF, std::nanf(""), .99999994f, 1.9999999f};
    std::uniform_real_distribution<float> coordinate(-3, 3), width(0, 1);
    for (const Texture& texture : textures)
        for (int round = 0; round < 400; ++round) {
            TextureAccess access;
            access.wrapS = static_cast<TextureWrap>(random() % 4),
            access.wrapT = static_cast<TextureWrap>(random() % 4);
            access.smooth = random() % 4 != 0, access.smoothFar = random() % 4 != 0;
            access.levels = static_cast<TextureLevels>(random() % 3);
            access.border = {.2f, .4f, .6f, .8f};
            const ColorSpace space = random() % 2 ? ColorSpace::linear : ColorSpace::display;
            float s[8], t[8], footprints[8];
            for (int i = 0; i < 8; ++i) {
                s[i] = random() % 4 ? coordinate(random) : odd[random() % std::size(odd)];
                t[i] = random() % 4 ? coordinate(random) : odd[random() % std::size(odd)];
                const float size = std::pow(width(random), 4.0f);
                footprints[i] = random() % 8 ? size : random() % 2 ? 0 : odd[random() % std::size(odd)];
            }
            const std::uint32_t lanes = random() % 3 ? 0xFF : static_cast<std::uint32_t>(random() % 256);
            Texture::Lanes found{};
            texture.sampleLanes(s, t, footprints, lanes, access, space, found);
            for (int i = 0; i < 8; ++i) {
                if (!(lanes >> i & 1u)) continue;
                const Vec4f alone = texture.sample(s[i], t[i], footprints[i], access, space);
                EXPECT_TRUE(isSame(found.r[i], alone.r) && isSame(found.g[i], alone.g) && isSame(found.b[i], alone.b) &&
                            isSame(found.a[i], alone.a))
                    << texture.width() << " x " << texture.height() << " at " << s[i] << ", " << t[i] << " over "
                    << footprints[i] << ": " << found.r[i] << " in place of " << alone.r;
            }
        }
}

/// Triangles with (s, t), and hits on them.
class Surface {
  public:
    Surface() {
        auto created = std::make_shared<Mesh>();
        std::vector<Vec3f> positions;
        std::vector<Vec2f> points;
        std::vector<std::int32_t> corners;
        for (int i = 0; i < 3 * kTriangles; ++i) {
            positions.push_back({number(9), number(9), number(9)}), points.push_back({number(4), number(4)});
            corners.push_back(i * 7 % (3 * kTriangles));
        }
        points[3] = points[4];  // a triangle that has no size in the picture
        created->positions = Array<Vec3f>(positions);
        created->triangles = Array<std::int32_t>(corners);
        created->triangleCount = kTriangles;
        TexCoords given;
        given.values = MeshAttribute(Array<Vec2f>(points), MeshAttribute::Binding::vertex, created->triangles, 3);
        given.authored = true;
        TexCoords flat;
        flat.sFromPosition = {.1f, .2f, .3f, .4f}, flat.tFromPosition = {.3f, -.2f, .1f, 0};
        created->texCoords = {given, flat};
        instance.mesh = created;
        instance.rayFromLocal = {Vec3f(2, .1f, 0), Vec3f(-.3f, 1, .2f), Vec3f(0, .4f, 3), Vec3f(5, 6, 7)};
        scene.pixelSpread = .002f, scene.sampleFraction = .5f;
    }
    float number(float far) { return std::uniform_real_distribution<float>(-far, far)(random); }
    /// `few`: on the first so many triangles.
    void hit(int few) {
        for (int lane = 0; lane < 16; ++lane) {
            const Vec3f n = glm::normalize(Vec3f(number(1), number(1), number(1)));
            s.hits.normalX[lane] = n.x, s.hits.normalY[lane] = n.y, s.hits.normalZ[lane] = n.z;
            s.view.set(lane, lane == 4 ? glm::cross(n, Vec3f(n.y, n.z, n.x)) : n);
            s.hits.u[lane] = std::abs(number(.5f)), s.hits.v[lane] = std::abs(number(.5f));
            s.hits.triangle[lane] = static_cast<std::uint32_t>(random()) % static_cast<std::uint32_t>(few);
            s.distance[lane] = std::exp(number(6));
            tasks[lane].travelled = std::abs(number(5));
        }
    }

    static constexpr int kTriangles = 20;
    std::mt19937 random{3};
    TraceScene scene;
    RayInstance instance;
    SurfacePacket s{};
    PathTask tasks[16];
};

TEST(TextureLanes, LanesFindWhatTheyFindAlone) {
    Surface surface;
    const auto picture = std::make_shared<const Texture>(noise(surface.random, 64, 16, 4, Texture::Content::color));
    int different = 0;
    for (int round = 0; round < 300; ++round) {
        surface.hit(round % 3 == 0 ? 1 : Surface::kTriangles);
        Material material;
        TextureUse& use = material.textures[static_cast<std::size_t>(TextureRole::base)];
        use.texture = picture;
        use.matrix = TextureMatrix::fromTransform({.1f, .2f}, .3f, {.5f, .7f}, {.2f, .1f});
        if (round % 5 == 4) use.matrix3 = std::make_shared<const glm::mat4>(glm::mat4(.25f));
        SlotShading slot;
        slot.channels.fill(round % 7 == 6 ? 1 : round % 11 == 10 ? 9 : 0);
        const std::uint32_t lanes = round % 2 ? 0xFFFF : surface.random() % 0xFFFF + 1;
        const PathTask* const tasks = round % 4 < 2 ? surface.tasks : nullptr;
        TextureLanes together(surface.scene, surface.instance, slot, ColorSpace::linear, tasks, lanes, surface.s);
        TextureLanes::Colors found{};
        together.look(material, TextureRole::base, found);
        for (int lane = 0; lane < 16; ++lane) {
            if (!(lanes >> lane & 1u)) continue;
            // The width of a pixel at the ray's hit; it grows on a surface that is turned away.
            const float cosine = std::max(std::abs(glm::dot(surface.s.view.get(lane), surface.s.outside(lane))), .05f);
            const float run = (tasks ? tasks[lane].travelled : 0) + surface.s.distance[lane];
            TextureLookup alone = together.lookup(lane, nullptr);
            alone.footprint = surface.scene.sampleWidth(run) / std::sqrt(cosine);
            const Vec4f one = alone.sample(material, TextureRole::base);
            EXPECT_TRUE(isSame(found.r[lane], one.r) && isSame(found.g[lane], one.g) && isSame(found.b[lane], one.b) &&
                        isSame(found.a[lane], one.a))
                << "round " << round << ", lane " << lane << ": " << found.r[lane] << " in place of " << one.r;
            different += found.r[lane] != found.r[0];
        }
    }
    EXPECT_GT(different, 2000);
}

}  // namespace
}  // namespace rtsg::trace
