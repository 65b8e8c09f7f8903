// Plain surfaces: which instances are, and that what is fetched of eight hits side by side is what each is alone.
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "renderers/light/light_scene.h"
#include "surface/plain_surfaces.h"
#include "tables/light_tables.h"

namespace rtsg {
namespace {

using namespace test;
using trace::PlainSurfaces;

struct PlainScene {
    LightScene s;
    LightTracer tracer;
    std::shared_ptr<const LightState> state;
    trace::TraceScene traced;
    std::unique_ptr<PlainSurfaces> plain;
    explicit PlainScene(const std::string& body) : s(body) {
        s.world->add(tracer);
        state = tracer.latest();
        traced.world = &s.world->rays();
        traced.materials = trace::MaterialList(state->materials);
        traced.slots = trace::SlotPages(state->slots);
        plain = std::make_unique<PlainSurfaces>(traced);
    }
    /// Of the only instance.
    int kind() const {
        int found = 0;
        for (std::uint32_t slot = 0; slot < traced.world->instances().size(); ++slot) found |= plain->kindOf(slot);
        return found & ~PlainSurfaces::kSolid;
    }
};

TEST(PlainSurfaces, AreOpaqueAndOfOneMaterialWithoutTextures) {
    const auto kind = [](const std::string& appearance, const std::string& geometry = "Box { }") {
        return PlainScene("Shape { appearance Appearance { " + appearance + " } geometry " + geometry + " }").kind();
    };
    EXPECT_EQ(kind("material Material { }"), PlainSurfaces::matte);
    EXPECT_EQ(kind("material Material { specularColor 0 .1 0 }"), PlainSurfaces::glossy);
    EXPECT_EQ(kind("material PhysicalMaterial { }"), PlainSurfaces::glossy);
    EXPECT_EQ(kind("material Material { emissiveColor 0 .1 0 }"), PlainSurfaces::matte | PlainSurfaces::kShines);
    EXPECT_EQ(kind("material Material { diffuseColor 0 0 0 emissiveColor 0 .1 0 }"),
              PlainSurfaces::matte | PlainSurfaces::kShines | PlainSurfaces::kBlack);
    EXPECT_EQ(kind("material UnlitMaterial { }"), PlainSurfaces::other);
    EXPECT_EQ(kind("material Material { transparency .2 }"), PlainSurfaces::other);
    EXPECT_EQ(kind("material Material { } backMaterial Material { }"), PlainSurfaces::other);
    EXPECT_EQ(kind("material Material { } texture PixelTexture { image 1 1 3 0xFF0000 }"), PlainSurfaces::other);
    EXPECT_EQ(kind("material Material { } fillProperties FillProperties { hatched TRUE }"), PlainSurfaces::other);
    EXPECT_EQ(kind(mirror(".5")), PlainSurfaces::other);
    EXPECT_EQ(kind("material Material { }",
                   "IndexedFaceSet { coordIndex [0 1 2 -1] coord Coordinate { point [0 0 0, 1 0 0, 0 1 0] } color "
                   "Color { color [1 0 0, 0 1 0, 0 0 1] } }"),
              PlainSurfaces::other);
    EXPECT_EQ(kind("material Material { }", "PointSet { coord Coordinate { point [0 0 0, 1 0 0, 0 1 0] } }"),
              PlainSurfaces::other);
}

/// Things of all kinds of normals, some of them mirrored, flattened and far out.
std::string items() {
    std::string body;
    for (int i = 0; i < 9; ++i)
        body += fmt::format(
            "Transform {{ translation {} {} {} rotation .6 .8 0 {} scale {} 1 .5 children Shape {{ appearance "
            "Appearance {{ material {} }} geometry {} }} }}\n",
            (i % 3 - 1) * 3, (i / 3 - 1) * 3, i == 4 ? -400 : 0, i, i % 2 ? -1.5 : 1,
            i % 3 == 1 ? "PhysicalMaterial { baseColor .2 .5 .8 roughness .4 metallic .5 }"
                       : "Material { diffuseColor .8 .3 .2 specularColor .2 .2 .2 shininess .3 }",
            i % 3 == 0   ? "Box { }"
            : i % 3 == 1 ? "Sphere { }"
                         : "Cylinder { }");
    return body;
}

/// For rays about `middle`.
std::vector<std::pair<Ray, Hit>> shoot(const RayView& world, const Vec3f& middle, float far, std::size_t count) {
    std::mt19937 random(11);
    std::normal_distribution<float> normal;
    const auto vector = [&] { return Vec3f(normal(random), normal(random), normal(random)); };
    std::vector<std::pair<Ray, Hit>> found;
    for (int i = 0; i < 200'000 && found.size() < count; ++i) {
        const Ray ray{middle + far * glm::normalize(vector()), 0, glm::normalize(vector())};
        if (const Hit hit = world.intersect(ray)) found.emplace_back(ray, hit);
    }
    return found;
}

void expectAsAlone(const PlainScene& scene, const std::pair<Ray, Hit>* eight) {
    const RayView& world = *scene.traced.world;
    PlainSurfaces::Hits hits;
    for (int i = 0; i < 8; ++i) {
        const auto& [ray, hit] = eight[i];
        hits.instance[i] = hit.instance, hits.triangle[i] = hit.triangle, hits.u[i] = hit.u, hits.v[i] = hit.v;
        hits.outside.x[i] = hit.normal.x, hits.outside.y[i] = hit.normal.y, hits.outside.z[i] = hit.normal.z;
        hits.direction.x[i] = ray.direction.x, hits.direction.y[i] = ray.direction.y;
        hits.direction.z[i] = ray.direction.z;
    }
    PlainSurfaces::Surfaces s;
    scene.plain->fetch(hits, s);
    const auto expectNear = [](const simd::V8& seen, int lane, const Vec3f& expected, float tolerance) {
        EXPECT_NEAR(seen.x[lane], expected.x, tolerance);
        EXPECT_NEAR(seen.y[lane], expected.y, tolerance);
        EXPECT_NEAR(seen.z[lane], expected.z, tolerance);
    };
    const simd::V8 start = s.leave(s.normal);
    for (int i = 0; i < 8; ++i) {
        const auto& [ray, hit] = eight[i];
        const RayInstance& instance = world.instance(hit.instance);
        const HitPoint point = world.point(hit);
        const float side = glm::dot(ray.direction, hit.normal) > 0 ? -1.0f : 1.0f;
        expectNear(s.exact, i, point.position, 1e-6f * glm::length(point.position) + 1e-6f);
        expectNear(s.error, i, point.error, 1e-5f * glm::length(point.error));
        expectNear(s.facing, i, side * hit.normal, 0);
        const Vec3f own = instance.mesh->normals.present()
                              ? Vec3f(instance.normalFromLocal *
                                      Vec3f(instance.mesh->normals.interpolate(hit.triangle, hit.u, hit.v)))
                              : hit.normal;
        expectNear(s.normal, i, side * glm::normalize(own), 2e-6f);
        expectNear(start, i, RayView::leave(point, side * glm::normalize(own)), 2e-6f * glm::length(point.position));
        const Material& material = scene.traced.materials[scene.traced.slots[hit.instance].material].material;
        expectNear(s.base, i, material.linear.base, 0);
    }
}

TEST(PlainSurfaces, OfEightInstancesAreWhatEachIsAlone) {
    const PlainScene scene(items());
    const auto found = shoot(*scene.traced.world, Vec3f(0), 6, 800);
    ASSERT_EQ(found.size(), 800u);
    for (std::size_t first = 0; first < found.size(); first += 8) expectAsAlone(scene, &found[first]);
}

TEST(PlainSurfaces, OfOneInstanceAreWhatEachIsAlone) {
    const PlainScene scene(items());
    for (int item = 0; item < 9; ++item) {
        const Vec3f middle(static_cast<float>(item % 3 - 1) * 3, static_cast<float>(item / 3 - 1) * 3,
                           item == 4 ? -400.0f : 0.0f);
        // From within, all meet the same.
        const auto found = shoot(*scene.traced.world, middle, .1f, 80);
        ASSERT_EQ(found.size(), 80u);
        for (const auto& [ray, hit] : found) ASSERT_EQ(hit.instance, found[0].second.instance);
        for (std::size_t first = 0; first < found.size(); first += 8) expectAsAlone(scene, &found[first]);
    }
}

}  // namespace
}  // namespace rtsg
