// Each kind of content in all the ways there are to look at it: pictures by `whitted` and `path`, picking through them,
// and the full traversal; as it is loaded, and after an edit that the world has followed.
#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>
#include <rtsg/renderers/picking.h>

#include "light_scene.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;

constexpr int kSide = 33;  // pixels; 16 is the middle
constexpr double kField = 0.7853982;

/// The colour at a pixel, and the pick there.
struct Seen {
    Vec3d color;  // as light
    const char* picked;
    int x = 16, y = 16;
};
struct Feature {
    const char* name;
    std::string body;
    std::vector<Seen> before;
    const char *node, *field, *value;  // the edit
    std::vector<Seen> after;
    bool traversed = true;  // the full traversal, which knows no eye, has it as well
};
std::ostream& operator<<(std::ostream& out, const Feature& feature) {
    return out << feature.name;
}

constexpr Vec3d kSeesBlack{0, 0, 0}, kSeesRed{1, 0, 0}, kSeesGreen{0, 1, 0}, kSeesBlue{0, 0, 1}, kSeesWhite{1, 1, 1};

/// An unlit Shape called S.
std::string unlitShape(const std::string& geometry, const std::string& more = "", const char* color = "1 0 0") {
    return fmt::format(
        "DEF S Shape {{ appearance Appearance {{ material UnlitMaterial {{ emissiveColor {} }} {} }} geometry "
        "{} }}",
        color, more, geometry);
}
std::string textured(const std::string& texture, const std::string& coordinates = "") {
    return "DEF S Shape { appearance Appearance { material UnlitMaterial { } texture " + texture +
           " } geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 3 ] coord Coordinate { point [ -2 -2 0, 2 -2 "
           "0, 2 2 "
           "0, -2 2 0 ] } " +
           coordinates + " } }";
}
std::string pixel(const char* color, const char* def = "") {
    return fmt::format("{} PixelTexture {{ image 1 1 3 {} }}", def, color);
}
std::string patch(const char* type, const std::string& more = "") {
    return fmt::format(
        "{} {{ {} solid FALSE uDimension 2 vDimension 2 uOrder 2 vOrder 2 controlPoint DEF E Coordinate {{ point "
        "[ -2 -2 0, 2 -2 0, -2 2 0, 2 2 0 ] }} }}",
        type, more);
}

const std::vector<Seen> kS{{kSeesRed, "S"}}, kNothing{{kSeesBlack, ""}};

std::vector<Feature> strokesAndSurfaces() {
    return {
        {"text",
         unlitShape("DEF E Text { string \"I\" fontStyle FontStyle { size 6 justify \"MIDDLE\" } }"),
         {{kSeesRed, "S", 16, 9}, {kSeesBlack, "", 4, 9}},
         "E",
         "string",
         "\"\"",
         kNothing},
        {"lines",
         unlitShape("LineSet { vertexCount 2 coord DEF E Coordinate { point [ -2 0 0, 2 0 0 ] } }",
                    "lineProperties LineProperties { linewidthScaleFactor 5 }"),
         kS, "E", "point", "[ -2 2 0, 2 2 0 ]", kNothing},
        {"lines that move",
         "DEF E Transform { children " +
             unlitShape("LineSet { vertexCount 2 coord Coordinate { point [ -2 0 0, 2 0 0 ] } }",
                        "lineProperties LineProperties { linewidthScaleFactor 5 }") +
             " }",
         kS,
         "E",
         "translation",
         "0 2 0",
         {{kSeesBlack, ""}, {kSeesRed, "S", 16, 8}}},
        {"indexed lines",
         unlitShape("IndexedLineSet { coordIndex [ 0 1 ] coord DEF E Coordinate { point [ -2 0 0, 2 0 0 ] } }",
                    "lineProperties LineProperties { linewidthScaleFactor 5 }"),
         kS, "E", "point", "[ -2 2 0, 2 2 0 ]", kNothing},
        {"lines in a plane",
         unlitShape("DEF E Polyline2D { lineSegments [ -2 0, 2 0 ] }"),
         {{kSeesRed, "S"}, {kSeesBlack, "", 16, 12}},
         "E",
         "lineSegments",
         "[ 0 -2, 0 2 ]",
         {{kSeesRed, "S"}, {kSeesRed, "S", 16, 12}}},
        {"points",
         unlitShape("PointSet { coord DEF E Coordinate { point 0 0 0 } }",
                    "pointProperties PointProperties { pointSizeScaleFactor 5 }"),
         kS, "E", "point", "0 2 0", kNothing},
        {"hatches",
         unlitShape("Rectangle2D { size 4 4 solid FALSE }",
                    "fillProperties DEF E FillProperties { filled FALSE hatched FALSE }"),
         {{kSeesBlack, ""}},
         "E",
         "filled",
         "TRUE",
         kS},
        {"NURBS patch", unlitShape(patch("NurbsPatchSurface")), kS, "E", "point", "[ -2 8 0, 2 8 0, -2 12 0, 2 12 0 ]",
         kNothing},
        {"NURBS swung",
         unlitShape("NurbsSwungSurface { solid FALSE profileCurve NurbsCurve2D { order 2 controlPoint [ 1 -2, 1 2 ] } "
                    "trajectoryCurve "
                    "DEF E NurbsCurve2D { order 2 controlPoint [ 1 0, 0 1, -1 0, 0 -1, 1 0 ] } }"),
         kS, "E", "controlPoint", "[ .1 9, .1 9.1 ]", kNothing},
        {"NURBS curve",
         unlitShape("NurbsCurve { order 2 controlPoint DEF E Coordinate { point [ -2 0 0, 2 0 0 ] } }",
                    "lineProperties LineProperties { linewidthScaleFactor 5 }"),
         kS, "E", "point", "[ -2 2 0, 2 2 0 ]", kNothing},
        {"NURBS trimmed",
         unlitShape(patch("NurbsTrimmedSurface",
                          "trimmingContour Contour2D { children ContourPolyline2D { controlPoint [ 0 0, .9 0, "
                          ".9 .9, 0 .9, 0 0 ] } }")),
         {{kSeesRed, "S"}, {kSeesBlack, "", 23, 9}},
         "E",
         "point",
         "[ -2 8 0, 2 8 0, -2 12 0, 2 12 0 ]",
         kNothing},
    };
}

std::vector<Feature> texturesAndLight() {
    return {
        {"MultiTexture",
         textured("DEF E MultiTexture { mode [ \"REPLACE\" \"MODULATE\" ] texture [ " + pixel("0xFFFF00") +
                  pixel("0x00FFFF") + " ] }"),
         {{kSeesGreen, "S"}},
         "E",
         "mode",
         "[ \"REPLACE\" \"ADD\" ]",
         {{kSeesWhite, "S"}}},
        {"cube map",
         textured("ComposedCubeMapTexture { frontTexture " + pixel("0xFF0000", "DEF E") + " backTexture USE E }",
                  "texCoord TextureCoordinateGenerator { mode \"CAMERASPACENORMAL\" }"),
         kS,
         "E",
         "image",
         "1 1 3 0xFF",
         {{kSeesBlue, "S"}}},
        {"texture in space",
         textured("PixelTexture3D { image [ 3 1 1 2 0xFF0000 0x00FF00 ] }",
                  "texCoord DEF E TextureCoordinate3D { point [ .5 .5 0, .5 .5 0, .5 .5 0, .5 .5 0 ] }"),
         kS,
         "E",
         "point",
         "[ .5 .5 1, .5 .5 1, .5 .5 1, .5 .5 1 ]",
         {{kSeesGreen, "S"}}},
        {"mapped texture",
         "DEF S Shape { appearance Appearance { material DEF E UnlitMaterial { emissiveTextureMapping \"A\" "
         "emissiveTexture "
         "PixelTexture { image 2 1 3 0xFF0000 0x0000FF } } } geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 "
         "3 ] coord "
         "Coordinate { point [ -2 -2 0, 2 -2 0, 2 2 0, -2 2 0 ] } texCoord MultiTextureCoordinate { texCoord [ "
         "TextureCoordinate { mapping \"A\" point [ .25 .5, .25 .5, .25 .5, .25 .5 ] } TextureCoordinate { mapping "
         "\"B\" point "
         "[ .75 .5, .75 .5, .75 .5, .75 .5 ] } ] } } }",
         kS,
         "E",
         "emissiveTextureMapping",
         "\"B\"",
         {{kSeesBlue, "S"}}},
        {"projector",
         "TextureProjectorParallel { fieldOfView -1 -1 1 1 location 0 0 1 direction 0 0 -1 texture " +
             pixel("0xFF0000", "DEF E") +
             " } DEF S Shape { appearance Appearance { material Material { diffuseColor 1 1 1 ambientIntensity 0 } } "
             "geometry "
             "Rectangle2D { size 8 8 solid FALSE } }",
         {{kSeesRed, "S"}, {kSeesBlack, "S", 4, 16}},
         "E",
         "image",
         "1 1 3 0xFF",
         {{kSeesBlue, "S"}, {kSeesBlack, "S", 4, 16}}},
        {"local fog",
         "Group { children [ DEF E LocalFog { color 0 0 1 visibilityRange 20 } " +
             unlitShape("Rectangle2D { size 4 4 solid FALSE }") + " ] }",
         {{{.5, 0, .5}, "S"}},
         "E",
         "visibilityRange",
         "0",
         kS},
        {"volumetric fog",
         "Transform { translation 0 0 2 children DEF E Fog { color 0 0 1 volumetric TRUE volumetricDirection 0 0 -1 "
         "visibilityRange 4 } } " +
             unlitShape("Rectangle2D { size 4 4 solid FALSE }"),
         {{{.5, 0, .5}, "S"}},
         "E",
         "volumetricVisibilityStart",
         "2",
         kS},
    };
}

std::vector<Feature> positionsAndTimes() {
    return {
        {"clip plane",
         "Group { children [ DEF E ClipPlane { plane 1 0 0 -1 } " + unlitShape("Rectangle2D { size 4 4 solid FALSE }") +
             " ] } Transform { translation 0 0 -1 children DEF B Shape { appearance Appearance { material "
             "UnlitMaterial { emissiveColor 0 1 0 } } geometry Rectangle2D { size 9 9 solid FALSE } } }",
         {{kSeesGreen, "B"}, {kSeesRed, "S", 22, 16}},
         "E",
         "enabled",
         "FALSE",
         kS},
        {"billboard",
         "DEF E Transform { rotation 0 1 0 1.5707963 children Billboard { children " +
             unlitShape("Rectangle2D { size 4 4 }") + " } }",
         kS, "E", "translation", "0 9 0", kNothing, false},
        {"layers",
         "LayerSet { order [ 1 2 ] layers [ DEF A Layer { children [ Viewpoint { } Transform { translation 0 0 2 "
         "children "
         "DEF B Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 0 } } geometry Rectangle2D "
         "{ "
         "size 2 2 } } } ] } DEF E Layer { children [ Viewpoint { } " +
             unlitShape("Rectangle2D { size 2 2 }") + " ] } ] }",
         kS,
         "E",
         "visible",
         "FALSE",
         {{kSeesGreen, "B"}}},
        {"particles",
         "DEF S ParticleSystem { maxParticles 1 particleLifetime 1000 lifetimeVariation 0 geometryType \"QUAD\" "
         "particleSize 2 2 emitter PointEmitter { speed 0 } appearance DEF A Appearance { material DEF E UnlitMaterial "
         "{ "
         "emissiveColor 1 0 0 } } }",
         kS,
         "E",
         "emissiveColor",
         "0 0 1",
         {{kSeesBlue, "S"}}},
        {"switch", "DEF E Switch { whichChoice 0 children [ " + unlitShape("Rectangle2D { size 4 4 }") + " ] }", kS,
         "E", "whichChoice", "-1", kNothing},
        {"level of detail",
         "DEF E LOD { children [ " + unlitShape("Rectangle2D { size 4 4 }") +
             " DEF B Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 0 } } geometry "
             "Rectangle2D { size 4 4 } } ] range 20 }",
         kS,
         "E",
         "range",
         "5",
         {{kSeesGreen, "B"}},
         false},
    };
}

std::vector<Feature> features() {
    std::vector<Feature> all = strokesAndSurfaces();
    for (auto* more : {&texturesAndLight, &positionsAndTimes}) std::ranges::copy(more(), std::back_inserter(all));
    return all;
}

class EachFeature : public testing::TestWithParam<Feature> {
  protected:
    static void check(LightScene& s, const std::vector<Seen>& expected) {
        SharedWorld anew(s.scene);
        LightRenderer fresh(anew);
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            SCOPED_TRACE(integrator == Integrator::path ? "path" : "whitted");
            s.options.settings.integrator = integrator;
            s.options.settings.colorSpace = ColorSpace::linear;
            const Picture picture = s.picture();
            for (const Seen& seen : expected) expectColor(Vec3f(picture.at(seen.x, seen.y)), seen.color, 1e-3);
            const auto other = fresh.picture(s.options);
            ASSERT_TRUE(other);
            for (std::size_t i = 0; i < picture.pixels.size(); ++i)
                for (int c = 0; c < 4; ++c)
                    ASSERT_NEAR(picture.pixels[i][c], other->pixels[i][c], 1e-4) << "a world made anew, at " << i;
        }
        const LightTracer& tracer = s.light->tracer();
        const RayWorld& world = s.world->rays();
        const auto camera = tracer.camera(world, 1);
        ASSERT_TRUE(camera);
        const auto views = tracer.layers(world, *camera, kSide, kSide);
        const Picker picker(world, s.world->flattener());
        for (const Seen& seen : expected) {
            const auto pick = tracer.pick(picker, world, views, seen.x + .5, seen.y + .5);
            ASSERT_TRUE(pick);
            EXPECT_EQ(pick->shape, *seen.picked ? s.node(seen.picked) : NodeId());
        }
    }
    /// Every ray through the picture meets the same in both.
    static void compare(const RayView& followed, const RayView& traversed) {
        PixelLens lens;
        lens.eye = Vec3f(0, 0, 10), lens.spread = static_cast<float>(2 * std::tan(kField / 2) / kSide);
        const LensedView one(followed, lens), other(traversed, lens);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x) {
                Ray ray;
                ray.origin = lens.eye, ray.direction = Vec3f(pixelDirection(x, y, kSide, kSide, kField));
                const Hit a = one.intersect(ray), b = other.intersect(ray);
                ASSERT_EQ(static_cast<bool>(a), static_cast<bool>(b)) << x << ' ' << y;
                if (!a) continue;
                EXPECT_EQ(one.instance(a.instance).info.shape, other.instance(b.instance).info.shape) << x << ' ' << y;
                EXPECT_NEAR(a.t, b.t, 1e-4) << x << ' ' << y;
            }
    }
};

TEST_P(EachFeature, IsTheSameInAllWaysAndAfterAnEdit) {
    const Feature& feature = GetParam();
    const bool own = feature.body.find("LayerSet") != std::string::npos;
    LightScene s((own ? "" : "Viewpoint { }\n") + feature.body, kSide, kSide);
    s.options.settings.samplesPerPixel = 1;
    FullTraversalRenderer full;
    ASSERT_TRUE(full.attachToScene(s.scene));
    const auto look = [&](const char* when, const std::vector<Seen>& expected) {
        SCOPED_TRACE(when);
        s.scene.newFrame(s.scene.now() + 1);
        check(s, expected);
        ASSERT_TRUE(full.renderFrame());
        if (feature.traversed) compare(s.world->rays(), full.world());
    };
    look("as it is loaded", feature.before);
    const Node& node = s.scene.node(s.node(feature.node));
    const FieldIndex field = node.type().findExact(feature.field);
    ASSERT_NE(field, kNoField);
    const auto value = parseFieldText(node.type().fields[field].type, feature.value);
    ASSERT_TRUE(value) << value.error().text;
    const Value before = node.value(field);
    ASSERT_TRUE(s.scene.setField(node.id(), field, *value));
    look("after an edit", feature.after);
    ASSERT_TRUE(s.scene.setField(node.id(), field, before));
    look("and back", feature.before);
}

INSTANTIATE_TEST_SUITE_P(All, EachFeature, testing::ValuesIn(features()), [](const auto& tested) {
    std::string name;
    for (const char c : std::string(tested.param.name)) name += c == ' ' ? '_' : c;
    return name;
});

}  // namespace
}  // namespace rtsg
