// Lines and points with normals, which are lit: the equations of 17.2.2 and of glTF's metallic-roughness model in
// double precision, at the middles of pixels, and what shadows, mirrors, skies and changes make of them.
#include <array>
#include <random>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/tessellate.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// 41 x 41 pixels of .05 m: the middle of pixel (x, y) is at ((x - 20) / 20, (20 - y) / 20) times 1.
struct LitScene : LightScene {
    explicit LitScene(const std::string& body, Integrator integrator = Integrator::whitted)
        : LightScene("OrthoViewpoint { fieldOfView [ -1.025 -1.025 1.025 1.025 ] } " + body, 41, 41) {
        options.settings.integrator = integrator;
        options.settings.colorSpace = ColorSpace::linear;
        options.settings.samplesPerPixel = 1;
    }
    static Vec3d position(int x, int y) { return {(x - 20) / 20., (20 - y) / 20., 10}; }
};

/// In linear light, as in Material.
struct Numbers {
    Vec3d diffuse{0}, specular{0}, emissive{0};
    double ambient = 0, exponent = 0;
};
struct Lamp {
    Vec3d towards{0};    // unit
    Vec3d color{1};      // with intensity and attenuation
    double ambient = 0;  // over intensity
};
/// 17.2.2.4.
Vec3d reflectedBy(const Numbers& m, Vec3d normal, Vec3d view, std::initializer_list<Lamp> lamps) {
    Vec3d sum = m.emissive;
    normal = glm::normalize(normal);
    for (const Lamp& lamp : lamps) {
        const double cosine = glm::dot(normal, lamp.towards);
        sum += lamp.color * lamp.ambient * m.ambient * m.diffuse;
        if (cosine <= 0) continue;
        const double half = std::max(glm::dot(normal, glm::normalize(lamp.towards + view)), 0.);
        sum += lamp.color * (m.diffuse * cosine + m.specular * std::pow(half, m.exponent));
    }
    return sum;
}
double linear(double c) {
    return c <= .04045 ? c / 12.92 : std::pow((c + .055) / 1.055, 2.4);
}
std::string spelled(const Vec3d& v) {
    return fmt::format("{} {} {}", v.x, v.y, v.z);
}
std::string style(double width) {
    return fmt::format(
        "lineProperties LineProperties {{ linewidthScaleFactor {0} }} pointProperties PointProperties {{ "
        "pointSizeScaleFactor {0} }} ",
        width);
}
std::string line(const std::string& material, const Vec3d& a, const Vec3d& b, const Vec3d& normalA,
                 const Vec3d& normalB, double width = 7, const std::string& more = "") {
    return fmt::format(
        "Shape {{ appearance Appearance {{ material {} {} }} geometry DEF G LineSet {{ vertexCount 2 coord Coordinate "
        "{{ point [ {}, {} ] }} normal DEF N Normal {{ vector [ {}, {} ] }} {} }} }}\n",
        material, style(width), spelled(a), spelled(b), spelled(normalA), spelled(normalB), more);
}
const std::string kLamp = "DirectionalLight { direction 0 0 -1 shadows TRUE } ";
const std::string kWhiteMatte = "Material { diffuseColor 1 1 1 ambientIntensity 0 }";
const Vec3d kView(0, 0, 1);

TEST(LitStrokes, FollowTheLightingEquation) {
    std::mt19937 random(401);
    std::uniform_real_distribution<double> any(-1, 1), some(.2, .9);
    const std::string material =
        "Material { diffuseColor .8 .5 .2 specularColor .4 .6 .3 emissiveColor .1 0 .05 ambientIntensity .3 shininess "
        ".1 }";
    Numbers m;
    m.diffuse = {linear(.8), linear(.5), linear(.2)}, m.specular = {linear(.4), linear(.6), linear(.3)};
    m.emissive = {linear(.1), 0, linear(.05)}, m.ambient = .3, m.exponent = 12.8;
    for (int i = 0; i < 40; ++i) {
        SCOPED_TRACE(i);
        const Vec3d a(-some(random), any(random) * .6, any(random)), b(some(random), any(random) * .6, any(random));
        const Vec3d na(any(random), any(random), some(random)), nb(any(random), any(random), some(random));
        const Vec3d lamp(any(random), any(random), 3), from(any(random) * .5, any(random) * .5, -1);
        LitScene s(fmt::format("PointLight {{ location {} radius 100 color 1 .5 1 intensity .7 attenuation 1 .1 .2 "
                               "ambientIntensity .2 }} DirectionalLight {{ direction {} color .2 .4 1 }} ",
                               spelled(lamp), spelled(from)) +
                   line(material, a, b, na, nb));
        const Picture p = s.picture();
        int checked = 0;
        for (int x = 0; x < 41; ++x)
            for (int y = 0; y < 41; ++y) {
                const Vec3d eye = LitScene::position(x, y);
                const Vec2d along(b - a), apart = Vec2d(eye) - Vec2d(a);
                const double u = glm::dot(apart, along) / glm::dot(along, along);
                if (u < .02 || u > .98 || glm::length(apart - along * u) > 3.2 * .05) continue;
                const Vec3d position(eye.x, eye.y, glm::mix(a.z, b.z, u)), displacement = lamp - position;
                const double far = glm::length(displacement);
                const Vec3d point = Vec3d(1, .5, 1) * .7 / (1 + .1 * far + .2 * far * far);
                const Vec3d sun(.2, .4, 1);  // lights' colours are light
                const Vec3d right = reflectedBy(m, glm::mix(na, nb, u), kView,
                                                {{displacement / far, point, .2 / .7}, {-glm::normalize(from), sun}});
                expectColor(Vec3f(p.at(x, y)), right, 2e-4 + 2e-3 * glm::length(right));
                ++checked;
            }
        EXPECT_GT(checked, 40);
    }
}

// The inverse transpose of the place's matrix, mirrored ones included, as surfaces have it.
TEST(LitStrokes, NormalsTurnWithTheirPlace) {
    const Vec3d normal(.5, .3, .4);
    for (const Vec3d scale : {Vec3d(1, 1, 1), Vec3d(2, 1, .5), Vec3d(-1, 1, 1), Vec3d(1, -2, -1), Vec3d(-1, -1, -3)}) {
        SCOPED_TRACE(spelled(scale));
        LitScene s(kLamp + "Transform { rotation 0 1 0 .6 scale " + spelled(scale) + " children [ " +
                   line(kWhiteMatte, {-.5, 0, 0}, {.5, 0, 0}, normal, normal) + "] }");
        const Vec3d scaled = glm::normalize(normal / scale);
        const double z = scaled.z * std::cos(.6) - scaled.x * std::sin(.6);
        EXPECT_NEAR(s.center().g, std::max(z, 0.), 1e-5);
    }
}

TEST(LitStrokes, HaveOneSide) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const auto seen = [&](const char* towards, const Vec3d& normal) {
            return LitScene(fmt::format("DirectionalLight {{ direction {} shadows TRUE }} ", towards) +
                                line(kWhiteMatte, {-1, 0, 0}, {1, 0, 0}, normal, normal),
                            integrator)
                .center()
                .g;
        };
        EXPECT_NEAR(seen("0 0 -1", {0, 0, 1}), 1, 1e-5);
        EXPECT_EQ(seen("0 0 -1", {0, 0, -1}), 0) << "turned away from the light, and from the eye";
        EXPECT_NEAR(seen("0 0 1", {0, 0, -1}), 1, 1e-5) << "from behind";
        EXPECT_EQ(seen("0 0 1", {0, 0, 1}), 0);
        EXPECT_NEAR(seen("0 -1 1", {0, 1, 0}), std::sqrt(.5), 1e-5);
    }
}

TEST(LitStrokes, ColoursStandInForTheDiffuseOne) {
    const char* const kGeometry =
        "IndexedLineSet { coordIndex [ 0 2 -1 1 2 ] colorPerVertex %s coord Coordinate { point [ -1 0 0, -1 .5 0, 1 0 "
        "0 ] } normal Normal { vector [ 0 0 1, 0 1 0, 0 .6 .8 ] } color %s }";
    const auto scene = [&](const char* perVertex, const char* colors) {
        std::string geometry = kGeometry;
        geometry.replace(geometry.find("%s"), 2, perVertex), geometry.replace(geometry.find("%s"), 2, colors);
        return LitScene(kLamp +
                        "Shape { appearance Appearance { material Material { diffuseColor .1 .2 .3 emissiveColor 0 0 "
                        ".5 transparency .9 } " +
                        style(5) + "} geometry " + geometry + " }")
            .center();
    };
    // Its normals are those of the points: (0, .3, .9) here.
    const double cosine = .9 / std::sqrt(.9), blue = linear(.5);
    expectColor(scene("TRUE", "ColorRGBA { color [ 1 0 0 1, 0 0 0 1, 0 1 0 1 ] }"),
                Vec3d(linear(.5) * cosine, linear(.5) * cosine, blue), 2e-3);
    expectColor(scene("FALSE", "ColorRGBA { color [ 1 .5 0 .25, 0 0 0 1 ] }"),
                .25 * Vec3d(cosine, linear(.5) * cosine, blue), 1e-4);
    expectColor(scene("FALSE", "Color { color [ 1 .5 0, 0 0 0 ] }"), .1 * Vec3d(cosine, linear(.5) * cosine, blue),
                1e-4);
}

// In all spaces in which light is added up.
TEST(LitStrokes, AColourOfTheirOwnIsAsOneOfTheMaterial) {
    for (const ColorSpace space : {ColorSpace::linear, ColorSpace::display, ColorSpace::automatic})
        for (const bool physical : {false, true}) {
            SCOPED_TRACE(testing::Message() << "space " << int(space) << ", physical " << physical);
            const auto seen = [&](const char* given, const std::string& own) {
                const std::string material =
                    fmt::format("material {} {{ {} {} }} ", physical ? "PhysicalMaterial" : "Material",
                                physical ? "baseColor" : "diffuseColor", given);
                LitScene s(
                    "DirectionalLight { direction 0 0 -1 ambientIntensity .5 shadows TRUE } "
                    "Shape { appearance Appearance { " +
                    material + style(5) +
                    "} geometry LineSet { vertexCount 2 coord Coordinate { point [ -1 0 0, 1 0 0 ] } normal Normal "
                    "{ vector [ 0 .6 .8, 0 .6 .8 ] } " +
                    own + "} }");
                s.options.settings.colorSpace = space;
                return s.center();
            };
            const auto asGiven = seen(".7 .4 .1", ""),
                       asOwn = seen("1 1 1", "color Color { color [ .7 .4 .1, .7 .4 .1 ] } ");
            EXPECT_GT(asGiven.r, asGiven.g);
            EXPECT_GT(asGiven.g, asGiven.b);
            EXPECT_GT(asGiven.b, 0);
            expectColor(asOwn, {asGiven.r, asGiven.g, asGiven.b}, 1e-5);
        }
}

TEST(LitStrokes, PointsHaveOneNormalEach) {
    LitScene s(
        kLamp + "Shape { appearance Appearance { material Material { diffuseColor 1 1 1 ambientIntensity 0 } " +
        style(5) +
        "} geometry PointSet { coord Coordinate { point [ -.5 0 0, 0 0 0, .5 0 0 ] } normal Normal { vector [ 0 0 "
        ".5, .6 0 .8, 1 0 0 ] } } }");
    const Picture p = s.picture();
    for (int dx = -2; dx <= 2; ++dx) {
        EXPECT_NEAR(p.at(10 + dx, 20).g, 1, 1e-5);
        EXPECT_NEAR(p.at(20 + dx, 21).g, .8, 1e-5);
        EXPECT_NEAR(p.at(30 + dx, 19).g, 0, 1e-5);
    }
}

/// glTF 2.0, appendix B.3, times pi: an intensity of 1 is an irradiance of pi for PhysicalMaterial.
double physical(double base, double metallic, double roughness, Vec3d n, Vec3d l, Vec3d v) {
    n = glm::normalize(n);
    const Vec3d h = glm::normalize(l + v);
    const double nl = glm::dot(n, l), nv = glm::dot(n, v), nh = glm::dot(n, h), vh = glm::dot(v, h);
    if (nl <= 0) return 0;
    const double a2 = std::pow(roughness, 4), d = a2 / (kPi * std::pow(nh * nh * (a2 - 1) + 1, 2));
    const double g = .5 / (nl * std::sqrt(nv * nv * (1 - a2) + a2) + nv * std::sqrt(nl * nl * (1 - a2) + a2));
    const double f0 = .04 + (base - .04) * metallic, f = f0 + (1 - f0) * std::pow(1 - vh, 5);
    return nl * ((1 - f) * (1 - metallic) * base / kPi + f * g * d);
}

TEST(LitStrokes, PhysicalMaterialIsGltfs) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const double metallic : {0., .4, 1.}) {
            const Vec3d normal(.2, .3, .9), towards = glm::normalize(Vec3d(1, -.5, 2));
            LitScene s(
                "DirectionalLight { direction -1 .5 -2 shadows TRUE } " +
                    line(fmt::format("PhysicalMaterial {{ baseColor .6 .6 .6 metallic {} roughness .5 }}", metallic),
                         {-1, 0, 0}, {1, 0, 0}, normal, normal),
                integrator);
            const double unit = physical(1, 0, 1, kView, kView, kView), seen = s.center().g;
            // A surface shows the value of an intensity of 1.
            LitScene surface("DirectionalLight { direction 0 0 -1 shadows TRUE } " +
                                 square(.5, "material PhysicalMaterial { metallic 0 roughness 1 }"),
                             integrator);
            const double right = physical(.6, metallic, .5, normal, towards, kView) * surface.center().g / unit;
            EXPECT_NEAR(seen, right, 2e-3 * right) << metallic;
        }
}

TEST(LitStrokes, WithoutNormalsOrWithUnlitMaterialTheyShine) {
    const std::string bare = "geometry LineSet { vertexCount 2 coord Coordinate { point [ -1 0 0, 1 0 0 ] } } }";
    LitScene without(kLamp +
                     "Shape { appearance Appearance { material Material { diffuseColor 1 1 1 emissiveColor .5 0 "
                     "0 } " +
                     style(3) + "} " + bare);
    expectColor(without.center(), {linear(.5), 0, 0}, 1e-5);
    LitScene unlit(kLamp + line("UnlitMaterial { emissiveColor 0 .5 0 }", {-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}));
    expectColor(unlit.center(), {0, linear(.5), 0}, 1e-5);
}

// Many short pieces under grazing light, and points side by side, throw no shadows upon each other; other things do.
TEST(LitStrokes, AreInTheShadowOfOthersAlone) {
    std::string positions, normals, index;
    for (int i = 0; i <= 200; ++i) positions += fmt::format("{} 0 0, ", i / 100. - 1), normals += "0 0 1, ";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const char* kind : {"LineSet { vertexCount 201", "PointSet {"})
            for (const double slant : {0., 1., 5., 20.})
                for (const bool hidden : {false, true}) {
                    SCOPED_TRACE(fmt::format("{} {} {}", kind, slant, hidden));
                    std::string body = fmt::format(
                        "DirectionalLight {{ direction {} 0 -1 shadows TRUE }} Shape {{ appearance Appearance {{ "
                        "material {} {} }} geometry {} coord Coordinate {{ point [ {} ] }} normal Normal {{ vector [ "
                        "{} ] }} }} }}",
                        slant, kWhiteMatte, style(hidden ? 3 : 9), kind, positions, normals);
                    // Beside the line, so that it does not hide it from the eye.
                    if (hidden && slant == 0) continue;
                    if (hidden)
                        body += fmt::format(
                            "Transform {{ translation {} 0 1 rotation 0 1 0 {} children Shape {{ "
                            "appearance Appearance {{ material UnlitMaterial {{ emissiveColor 0 0 0 }} }} geometry "
                            "Rectangle2D {{ size 1 1 }} }} }}",
                            -slant, -std::atan(slant));
                    LitScene s(body, integrator);
                    const double right = hidden ? 0 : 1 / std::sqrt(1 + slant * slant);
                    const Picture p = s.picture();
                    for (int y = hidden ? 19 : 17; y <= (hidden ? 21 : 23); ++y)
                        EXPECT_NEAR(p.at(20, y).g, right, 1e-5) << y;
                }
}

// A surface under an even sky shows its own share of it; paths find as much on lines and points.
TEST(LitStrokes, PathsBringTheSkysLight) {
    for (const char* material : {"Material { diffuseColor .5 .5 .5 }",
                                 "PhysicalMaterial { baseColor .2140411 .2140411 "
                                 ".2140411 metallic 0 roughness 1 }"}) {
        const auto seen = [&](const std::string& shape) {
            LitScene s("Background { skyColor 1 1 1 } " + shape, Integrator::path);
            s.options.settings.samplesPerPixel = 4096;
            return s.center().g;
        };
        const double right = seen(square(.5, std::string("material ") + material));
        EXPECT_NEAR(seen(line(material, {-1, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 0, 1})), right, .01 * right) << material;
    }
}

TEST(LitStrokes, MirrorsAndLayersShowThemAsTheyAre) {
    // The eye looks along -z into a mirror that shows what lies along +x.
    const std::string there = line(kWhiteMatte, {3, -1, 0}, {3, 1, 0}, {-.6, 0, .8}, {-.6, 0, .8}, 20);
    LitScene mirrored(
        "DirectionalLight { direction 0 0 -1 shadows TRUE } Transform { rotation 0 1 0 .7853982 children " +
        square(.5, mirror("1")) + "} " + there);
    EXPECT_NEAR(mirrored.center().g, .8, 1e-4);
    LightScene layered(
        "NavigationInfo { headlight FALSE } LayerSet { order [ 0 1 ] layers Layer { children [ "
        "NavigationInfo { headlight FALSE } OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] } " +
            kLamp + line(kWhiteMatte, {-1, 0, 0}, {1, 0, 0}, {0, .6, .8}, {0, .6, .8}) + " ] } }",
        41, 41);
    layered.options.settings.colorSpace = ColorSpace::linear;
    EXPECT_NEAR(layered.center().g, .8, 1e-5);
}

// Things behind a transparent line are seen at their place, however wide the line, and the line once.
TEST(LitStrokes, ClearOnesShowWhatIsBehind) {
    std::string behind;
    for (int i = 0; i < 20; ++i)
        behind += fmt::format(
            "Transform {{ translation {} 0 -2 children Shape {{ appearance Appearance {{ {} }} geometry Rectangle2D {{ "
            "size .1 3 }} }} }} ",
            -.975 + i * .1, unlit(i % 2 ? ".2 .9 .4" : ".9 .1 .6"));
    const Picture plain = LitScene(behind).picture();
    for (const bool hasNormals : {true, false}) {
        std::string shape = line("Material { diffuseColor 1 1 1 emissiveColor 0 0 0 transparency .75 }", {-1, 0, 0},
                                 {1, 0, 0}, {0, .6, .8}, {0, .6, .8}, 13);
        if (!hasNormals) shape.replace(shape.find("normal"), shape.find("] }  }") + 3 - shape.find("normal"), "");
        LitScene s(behind + kLamp + shape);
        const Picture p = s.picture();
        for (int x = 4; x < 37; ++x)
            for (int y = 15; y <= 25; ++y)
                expectColor(Vec3f(p.at(x, y)), (hasNormals ? .2 : 0) + .75 * Vec3d(Vec3f(plain.at(x, y))), 1e-4);
    }
}

TEST(LitStrokes, FollowTheScene) {
    LitScene s(kLamp + line(kWhiteMatte, {-1, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 0, 1}));
    EXPECT_NEAR(s.center().g, 1, 1e-5);
    ASSERT_TRUE(s.scene.set(s.node("N"), x3d::Normal::vector, Array<Vec3f>{{0, .8f, .6f}, {0, .8f, .6f}}));
    s.scene.newFrame(1);
    EXPECT_NEAR(s.center().g, .6, 1e-5);
    ASSERT_TRUE(s.scene.set(s.node("N"), x3d::Normal::vector, Array<Vec3f>{{.6f, 0, .8f}}));
    s.scene.newFrame(2);
    EXPECT_NEAR(s.center().g, .8, 1e-5);
    ASSERT_TRUE(s.scene.set(s.node("G"), x3d::LineSet::normal, NodeId()));
    s.scene.newFrame(3);
    EXPECT_EQ(s.center().g, 0) << "no emissiveColor";
}

TEST(LitStrokes, TellOfMissingNormals) {
    StrokeParams p;
    p.kind = Mesh::Strokes::points;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    p.normal = {{0, 0, 1}, {0, 1, 0}};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(mesh.normals.value(2, 0), Vec4f(0, 1, 0, 1));
    ASSERT_EQ(mesh.diagnostics.all().size(), 1u);
    EXPECT_NE(mesh.diagnostics.all()[0].text.find("normal has 2 vectors for 3 points"), std::string::npos);
    p.normal = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
    EXPECT_EQ(tessellate(p).diagnostics.all().size(), 0u) << "there is one for each";
    p.normal = {{0, 0, 1}, {0, 1, 0}};
    // For every end of every line, the first included.
    p.kind = Mesh::Strokes::lines;
    p.indexed = true;
    for (const auto& [from, to] : {std::pair(2, 0), {0, 2}, {2, 1}, {1, 2}}) {
        p.coordIndex = {from, to, -1, to, from, -1};
        const Mesh lines = tessellate(p);
        ASSERT_EQ(lines.strokeCount, 2u);
        for (std::uint32_t line = 0; line < 2; ++line)
            for (std::uint32_t end = 0; end < 2; ++end) {
                const int point = (line == 0) == (end == 0) ? from : to;
                EXPECT_EQ(lines.normals.valueIndex(line, end), static_cast<std::uint32_t>(std::min(point, 1)));
            }
    }
}

// Width is the eye's: in perspective, wherever it is turned.
TEST(LitStrokes, LeaveTheirWidthBeforeAnyEye) {
    std::mt19937 random(402);
    std::uniform_real_distribution<double> any(-1, 1);
    for (int i = 0; i < 60; ++i) {
        SCOPED_TRACE(i);
        std::string positions, normals;
        const Vec3d along = glm::normalize(Vec3d(1, any(random), any(random)));
        const Vec3d normal = glm::normalize(glm::cross(along, Vec3d(any(random), any(random), any(random))));
        Vec3d light = glm::normalize(Vec3d(any(random), any(random), any(random)));
        if (glm::dot(light, normal) < 0) light = -light;
        for (int k = 0; k <= 100; ++k)
            positions += spelled(along * (k / 50. - 1)) + ", ", normals += spelled(normal) + ", ";
        const std::string shape = fmt::format(
            "Shape {{ appearance Appearance {{ material {} {} }} geometry LineSet {{ vertexCount 101 coord "
            "Coordinate {{ point [ {} ] }} normal Normal {{ vector [ {} ] }} }} }}",
            kWhiteMatte, style(11), positions, normals);
        const std::string eye = fmt::format(
            "Viewpoint {{ position {0} {1} 4 fieldOfView .7 centerOfRotation 0 0 0 "
            "orientation 0 1 0 {2} }} ",
            4 * std::tan(.3 * (i % 3)), 0, .3 * (i % 3));
        LightScene s("Background { skyColor 0 0 1 } " + eye +
                         fmt::format("DirectionalLight {{ direction {} shadows TRUE }} ", spelled(-light)) + shape,
                     41, 41);
        s.options.settings.colorSpace = ColorSpace::linear;
        s.options.settings.samplesPerPixel = 1;
        const Picture p = s.picture();
        int seen = 0;
        for (const Vec4f& pixel : p.pixels) {
            if (Vec3f(pixel) == Vec3f(0, 0, 1)) continue;
            ++seen;
            EXPECT_NEAR(pixel.g, glm::dot(light, normal), 1e-4);
        }
        EXPECT_GT(seen, 40);
    }
}

}  // namespace
}  // namespace rtsg
