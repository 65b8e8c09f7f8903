// The data that renderers without rays read of a scene are those of the light tracer.
#include <rtsg/renderers/surface_tables.h>

#include <array>
#include <utility>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;
using ::testing::ElementsAre;

/// A scene with these tables on it, and the slots of its instances.
struct Tabled : LightScene {
    explicit Tabled(const std::string& body) : LightScene(body) { world->add(tables); }
    ~Tabled() { world->remove(tables); }
    SurfaceState::Look lookOf(const char* shape) {
        const NodeId id = node(shape);
        for (const Instance& instance : world->flattener().instances())
            if (instance.id && instance.shape == id) return tables.latest().look(instance.id.slot);
        ADD_FAILURE() << shape << " has no instance";
        return {};
    }
    std::vector<Vec3f> lightsOf(const char* shape) {
        const SurfaceState state = tables.latest();
        const auto all = state.surroundings(Camera());
        std::vector<Vec3f> colors;
        for (const Light* light : all.at(lookOf(shape).surroundings).lights) colors.push_back(light->color);
        return colors;
    }
    SurfaceTables tables;
};

const char* const kShape =
    "Shape { appearance Appearance { material Material { diffuseColor 1 0 0 } } geometry Box { } }";

// 17.2.2: local lights reach what is below their own group; the nearest scope comes first.
TEST(SurfaceTables, LightsAreThoseOfTheScopesAroundAShape) {
    Tabled s(
        "PointLight { color 1 0 0 }\n"
        "Group { children [ PointLight { global FALSE color 0 1 0 } DEF In " +
        std::string(kShape) +
        " Group { children [ DEF Lamp PointLight { global FALSE color 0 0 1 } DEF Deep Shape { geometry Box { } } ] } "
        "] }\n"
        "DEF Out Shape { geometry Box { } }\n");
    EXPECT_THAT(s.lightsOf("Out"), ElementsAre(Vec3f(1, 0, 0)));
    EXPECT_THAT(s.lightsOf("In"), ElementsAre(Vec3f(0, 1, 0), Vec3f(1, 0, 0)));
    EXPECT_THAT(s.lightsOf("Deep"), ElementsAre(Vec3f(0, 0, 1), Vec3f(0, 1, 0), Vec3f(1, 0, 0)));
    ASSERT_TRUE(s.scene.set(s.node("Lamp"), x3d::PointLight::on, false));
    s.scene.newFrame(1);
    EXPECT_THAT(s.lightsOf("Deep"), ElementsAre(Vec3f(0, 1, 0), Vec3f(1, 0, 0)));
}

TEST(SurfaceTables, AMaterialIsTheSameObjectUntilItChanges) {
    Tabled s(
        "DEF A Shape { appearance Appearance { material DEF M Material { diffuseColor 1 0 0 } } geometry Box { } }\n"
        "DEF Plain Shape { geometry Box { } }\n");
    const SurfaceState first = s.tables.latest();
    const auto red = s.lookOf("A").material;
    EXPECT_EQ(red->base, Vec3f(1, 0, 0));
    EXPECT_EQ(s.lookOf("Plain").material->model, ShadingModel::unlit);
    EXPECT_EQ(s.lookOf("A").material, red);
    EXPECT_TRUE(s.tables.latest() == first);
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::Material::diffuseColor, Color{0, 1, 0}));
    s.scene.newFrame(1);
    EXPECT_FALSE(s.tables.latest() == first);
    EXPECT_EQ(s.lookOf("A").material->base, Vec3f(0, 1, 0));
    EXPECT_EQ(red->base, Vec3f(1, 0, 0)) << "a version does not change";
    EXPECT_EQ(first.look(12345).material->model, ShadingModel::unlit) << "an instance that is unknown";
}

TEST(SurfaceTables, FogsCutsSkyAndHeadlightAreThoseThatCount) {
    Tabled s(
        "Fog { visibilityRange 30 }\n"
        "Background { skyColor 0 0 1 }\n"
        "NavigationInfo { headlight FALSE }\n"
        "Group { children [ LocalFog { visibilityRange 5 } ClipPlane { plane 0 2 0 1 } DEF In Shape { geometry Box { } "
        "} ] }\n"
        "DEF Out Shape { geometry Box { } }\n");
    const SurfaceState state = s.tables.latest();
    const auto all = state.surroundings(Camera());
    const auto &in = all.at(s.lookOf("In").surroundings), &out = all.at(s.lookOf("Out").surroundings);
    EXPECT_FLOAT_EQ(in.fog.visibilityRange, 5);
    EXPECT_FLOAT_EQ(out.fog.visibilityRange, 30);
    EXPECT_TRUE(out.cuts.empty());
    ASSERT_EQ(in.cuts.size(), 1u);
    EXPECT_EQ(in.cuts[0].normal, Vec3d(0, 1, 0)) << "a unit vector";
    EXPECT_DOUBLE_EQ(in.cuts[0].offset, .5);
    EXPECT_FALSE(state.headlight(0));
    ASSERT_TRUE(state.sky(0));
    EXPECT_EQ(state.sky(0)->skyColors, std::vector<Vec3f>{Vec3f(0, 0, 1)});
}

/// The box around the scene's triangles, without rays.
BoxOfLayer boxesWithoutRays(Tabled& s) {
    return [&s](std::uint16_t layer) {
        WorldBox box;
        const InstanceDelta all = s.world->flattener().snapshot();
        for (const Instance& instance : all.added)
            for (const InstanceDelta::Geometry& geometry : all.geometries) {
                if (geometry.node != instance.geometry || instance.layer != layer) continue;
                const Bounds& b = geometry.mesh->bounds;
                for (int k = 0; k < 8; ++k)
                    box.extend(instance.worldFromLocal * Vec4d((k & 1) != 0 ? b.max.x : b.min.x,
                                                               (k & 2) != 0 ? b.max.y : b.min.y,
                                                               (k & 4) != 0 ? b.max.z : b.min.z, 1));
            }
        return box;
    };
}

// 23.3.1 viewAll, no viewpoint at all, one by name, and the layers of a LayerSet: as the tracer finds them with rays.
TEST(SurfaceTables, CamerasNeedNoRays) {
    const char* const far = "Transform { translation 40 2 -7 children Shape { geometry Box { size 3 4 5 } } }\n";
    const std::string bodies[] = {
        std::string("Viewpoint { viewAll TRUE orientation 0 1 0 .5 }\n") + far, std::string("# frame\n") + far,
        std::string("Viewpoint { } DEF Other OrthoViewpoint { position 1 2 3 }\n") + far,
        std::string("Viewpoint { }\n") + far +
            "LayerSet { order [ 0 1 ] layers Layer { viewport Viewport { clipBoundary [ .5 1 0 .5 ] "
            "} children [ Viewpoint { "
            "viewAll TRUE } Shape { geometry Sphere { } } ] } }\n"};
    for (const std::string& body : bodies) {
        SCOPED_TRACE(body);
        Tabled s(body);
        const BoxOfLayer boxes = boxesWithoutRays(s);
        const std::string name = body.find("Other") != body.npos ? "Other" : "";
        const auto found = s.tables.latest().camera(boxes, 1.5, name);
        const auto traced = s.light->tracer().camera(s.world->rays(), 1.5, name);
        ASSERT_TRUE(found && traced);
        const auto expectSame = [](const Camera& a, const Camera& b) {
            EXPECT_LT(glm::distance(a.position, b.position), 1e-5);
            EXPECT_LT(glm::distance(a.forward, b.forward) + glm::distance(a.up, b.up), 1e-6);
            EXPECT_DOUBLE_EQ(a.top, b.top);
            EXPECT_EQ(a.viewpoint, b.viewpoint);
            EXPECT_EQ(a.layer, b.layer);
        };
        expectSame(*found, *traced);
        const auto views = s.tables.latest().layers(boxes, *found, 60, 40);
        const auto tracedViews = s.light->tracer().layers(s.world->rays(), *traced, 60, 40);
        ASSERT_EQ(views.size(), tracedViews.size());
        for (std::size_t i = 0; i < views.size(); ++i) {
            expectSame(views[i].camera, tracedViews[i].camera);
            EXPECT_EQ(std::pair(views[i].left, views[i].width), std::pair(tracedViews[i].left, tracedViews[i].width));
        }
        EXPECT_FALSE(s.tables.latest().camera(boxes, 1.5, "nobody"));
    }
}

TEST(SurfaceTables, TexturesGiveTheirPixelsLevelByLevel) {
    const std::array<std::uint8_t, 16> bytes{0, 0, 255, 255, 0, 0, 255, 255, 10, 20, 30, 40, 50, 60, 70, 80};
    const auto texture = Texture::fromBytes(bytes, 8, 2, 1);
    ASSERT_TRUE(texture);
    ASSERT_EQ(texture->levels(), 4);
    const auto finest = texture->level(0, ColorSpace::display);
    EXPECT_EQ(std::pair(finest.width, finest.height), std::pair(8, 2));
    ASSERT_EQ(finest.encoded.size(), 16u);
    EXPECT_EQ(finest.encoded[2], 0xFFFFFFFFu);
    EXPECT_EQ(finest.encoded[8], 0xFF0A0A0Au) << "the second row from below";
    const auto shown = texture->level(1, ColorSpace::display), light = texture->level(1, ColorSpace::linear);
    EXPECT_EQ(std::pair(shown.width, shown.height), std::pair(4, 1));
    EXPECT_EQ(shown.encoded[0] & 255u, 8u) << "the mean of 0, 0, 10 and 20";
    EXPECT_GT(light.encoded[1] & 255u, shown.encoded[1] & 255u) << "averaged as light";
    EXPECT_EQ(texture->level(3, ColorSpace::display).width, 1);
    const auto wide = Texture::fromFloats({Vec4f(2, 0, 0, 1), Vec4f(4, 0, 0, 1)}, 2, 1);
    ASSERT_TRUE(wide);
    EXPECT_TRUE(wide->level(0, ColorSpace::linear).encoded.empty());
    EXPECT_EQ(wide->level(1, ColorSpace::linear).linear[0], Vec4f(3, 0, 0, 1));
}

}  // namespace
}  // namespace rtsg
