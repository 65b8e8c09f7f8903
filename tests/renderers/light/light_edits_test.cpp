// Pictures that follow a scene through edits: what is read again, law 2, and numbers that no scene should have.
#include <rtsg/renderers/light_tracer.h>

#include <cmath>
#include <optional>
#include <random>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "light_scene.h"
#include "support/long_form.h"

namespace rtsg {
namespace {

using namespace test;

TEST(LightTracer, ATransformNeverTouchesMaterials) {
    LightScene s(
        "DEF L PointLight { } DEF T Transform { children Shape { appearance DEF A Appearance { material DEF M Material "
        "{ } } geometry Box { } } }");
    const auto before = s.light->tracer().counts();
    for (int i = 1; i < 5; ++i) {
        ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(float(i), 0, 0)));
        s.scene.newFrame(i);
    }
    EXPECT_EQ(s.light->tracer().counts().materialsRead, before.materialsRead);
    EXPECT_EQ(s.light->tracer().counts().lightsRead, before.lightsRead);
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::Material::diffuseColor, Color{1, 0, 0}));
    s.scene.newFrame(6);
    EXPECT_EQ(s.light->tracer().counts().materialsRead, before.materialsRead + 1);
    ASSERT_TRUE(s.scene.set(s.node("L"), x3d::PointLight::intensity, 0.5f));
    s.scene.newFrame(7);
    EXPECT_EQ(s.light->tracer().counts().materialsRead, before.materialsRead + 1);
    EXPECT_EQ(s.light->tracer().counts().lightsRead, before.lightsRead + 1);
}

// Law 2 (no two surfaces may coincide, or which one is seen is open): after any run of edits the picture is the one
// that a renderer attached afresh gives, bit for bit.
TEST(LightTracer, IncrementalEqualsFromScratch) {
    const std::uint64_t seed = 20260721;
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> unit(0, 1);
    std::string body =
        "DEF L0 PointLight { location 5 5 5 } DEF G Transform { translation 0.1 0.1 -2.5 children [ DEF L1 "
        "DirectionalLight { direction 1 -1 -1 "
        "intensity 0.4 } ] }";
    for (int i = 0; i < 8; ++i)
        body += fmt::format(
            "DEF T{0} Transform {{ translation {1} {2} 0 children DEF S{0} Shape {{ appearance DEF A{0} Appearance {{ "
            "material DEF M{0} Material {{ }} }} geometry {3} }} }}",
            i, -3 + 2 * (i % 4), -1 + 2 * (i / 4), i % 2 ? "Sphere { radius 0.8 }" : "Box { }");
    LightScene s("Viewpoint { }" + body, 48, 32);
    for (int round = 1; round <= 25; ++round) {
        for (int edit = 0; edit < 3; ++edit) {
            const int i = static_cast<int>(random() % 8);
            const auto named = [&](const char* kind) { return s.node(fmt::format("{}{}", kind, i).c_str()); };
            switch (random() % 7) {
                case 0:
                    ASSERT_TRUE(s.scene.set(named("T"), x3d::Transform::translation,
                                            Vec3f(unit(random) * 6 - 3, unit(random) * 4 - 2, unit(random))));
                    break;
                case 1:
                    ASSERT_TRUE(s.scene.set(named("M"), x3d::Material::diffuseColor,
                                            Color{unit(random), unit(random), unit(random)}));
                    break;
                case 2:
                    ASSERT_TRUE(
                        s.scene.set(named("M"), x3d::Material::transparency, unit(random) < 0.5f ? 0.0f : 0.6f));
                    break;
                case 3:
                    ASSERT_TRUE(s.scene.set(s.node("L0"), x3d::PointLight::location, Vec3f(unit(random) * 9, 5, 5)));
                    break;
                case 4:
                    ASSERT_TRUE(s.scene.set(s.node("L1"), x3d::DirectionalLight::global, unit(random) < 0.5f));
                    break;
                case 5:
                    ASSERT_TRUE(s.scene.set(named("S"), x3d::Shape::appearance,
                                            s.node(fmt::format("A{}", random() % 8).c_str())));
                    break;
                case 6: {
                    const auto& children = s.scene.node(s.node("G")).get(x3d::Transform::children);
                    if (children.size() > 3)
                        ASSERT_TRUE(s.scene.removeChild(s.node("G"), x3d::Transform::children.index, 1));
                    else
                        ASSERT_TRUE(s.scene.insertChild(s.node("G"), x3d::Transform::children.index, named("T")));
                    break;
                }
            }
        }
        s.scene.newFrame(round);
        const Picture followed = s.picture();
        SharedWorld freshWorld(s.scene);
        LightRenderer fresh(freshWorld);
        const auto scratch = fresh.picture(s.options);
        ASSERT_TRUE(scratch);
        // A moved instance is traced through its transform, one from scratch perhaps in ray space: along silhouettes
        // and shadow edges a ray may fall on either side.
        int different = 0;
        for (std::size_t k = 0; k < followed.pixels.size(); ++k)
            different += glm::any(glm::greaterThan(glm::abs(followed.pixels[k] - scratch->pixels[k]), Vec4f(1e-4f)));
        ASSERT_LE(different, 6) << "seed " << seed << " round " << round;
    }
}

// An alpha that is no share shows what the nearest share shows: rays that go on with more than they came with would
// multiply without end.
TEST(LightTracer, AlphaThatIsNoShareCountsAsTheNearestOne) {
    const std::string coordinates = "coord Coordinate { point [-2 -2 0, 2 -2 0, 2 2 0, -2 2 0] }";
    const std::string glass =
        "metadata MetadataFloat { name \"reflectivity\" reference \"RTSG\" value 0.25 } emissiveColor 0.5 0.5 0.5";
    std::string body = "Background { skyColor 0.25 0.5 0.75 } Viewpoint { position 0 0 3 }";
    for (int i = 0; i < 3; ++i)
        body += fmt::format(
            "Transform {{ translation 0 0 {} children Shape {{ appearance Appearance {{ material Material {{ {} }} }} "
            "geometry IndexedFaceSet {{ solid FALSE coordIndex [0 1 2 3 -1] {} color {} ColorRGBA {{ color [ 1 1 1 1, "
            "1 1 1 1, 1 1 1 1, 1 1 1 1 ] }} }} }} }}",
            -i, glass, coordinates, fmt::format("DEF C{}", i));
    LightScene s(body, 9, 9);
    const auto shown = [&](float alpha) {
        for (int i = 0; i < 3; ++i) {
            const ColorRGBA c{1, 1, 1, alpha};
            EXPECT_TRUE(s.scene.set(s.node(fmt::format("C{}", i).c_str()), x3d::ColorRGBA::color,
                                    Array<ColorRGBA>{c, c, c, c}));
        }
        s.scene.newFrame(s.scene.now() + 1);
        return s.center();
    };
    const Vec3f opaque = shown(1), clear = shown(0);
    EXPECT_GT(glm::distance(opaque, clear), 0.1f);
    for (const float alpha : {1.5f, 3e38f, INFINITY, NAN}) EXPECT_EQ(shown(alpha), opaque) << alpha;
    for (const float alpha : {-0.0f, -1.0f, -3e38f}) EXPECT_EQ(shown(alpha), clear) << alpha;
    EXPECT_LT(s.stats.secondaryRays, 100'000u);
}

/// Values of some types that no scene should have.
std::optional<Value> wildValue(FieldType type, std::mt19937_64& random) {
    const float wild[] = {NAN, INFINITY, -INFINITY, 3e38f, -3e38f, -1, 0, 1e-45f, 1e-30f, 1e20f, 1};
    const auto number = [&] { return wild[random() % std::size(wild)]; };
    switch (type) {
        case FieldType::SFFloat:
            return Value(number());
        case FieldType::SFVec2f:
            return Value(Vec2f(number(), number()));
        case FieldType::SFVec3f:
            return Value(Vec3f(number(), number(), number()));
        case FieldType::SFColor:
            return Value(Color{number(), number(), number()});
        case FieldType::SFRotation:
            return Value(Rotation{number(), number(), number(), number()});
        case FieldType::MFFloat:
            return Value(Array<float>{number(), number(), number()});
        case FieldType::MFColor:
            return Value(Array<Color>{{number(), 0, 0}, {0, number(), 1}, {1, 1, number()}});
        case FieldType::MFVec2f:
            return Value(Array<Vec2f>{{number(), 1}, {0, number()}});
        case FieldType::MFVec3f:
            return Value(Array<Vec3f>{{number(), 0, 0}, {1, number(), 0}, {0, 1, number()}, {1, 1, 1}});
        case FieldType::MFColorRGBA:
            return Value(Array<ColorRGBA>{{1, number(), 0, number()}, {0, 0, 1, number()}});
        case FieldType::SFBool:
            return Value(random() % 2 == 0);
        case FieldType::SFString:
            return Value(String("nonsense"));
        default:
            return std::nullopt;
    }
}

// Whatever numbers a file or a script puts into fields, there is a picture and it is finite.
class WildNumbers : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(LightTracer, WildNumbers, testing::Range<std::uint64_t>(1, test::fewOrMany(13, 401)));
TEST_P(WildNumbers, InAnyFieldAreSurvived) {
    const std::uint64_t seed = GetParam();
    std::mt19937_64 random(seed);
    LightScene s(
        "Viewpoint { position 0 1 8 } NavigationInfo { visibilityLimit 50 } Background { skyColor [0 0 1, 1 1 1] "
        "skyAngle 1.57 groundColor [0 0 0, 0 1 0] groundAngle 1.5 }"
        "Fog { visibilityRange 40 } PointLight { location 3 3 3 ambientIntensity 0.1 } SpotLight { location -3 3 3 "
        "direction 1 -1 -1 } DirectionalLight { }"
        "Transform { children Shape { appearance Appearance { material Material { transparency 0.2 specularColor 1 1 1 "
        "metadata MetadataSet { name \"RTSG\" value [ "
        "MetadataFloat { name \"refractiveIndex\" value 1.5 } MetadataFloat { name \"absorption\" value 0.5 } "
        "MetadataFloat { name \"reflectivity\" value 0.1 } ] } } "
        "texture PixelTexture { image 2 2 4 0xFF0000FF 0x00FF0080 0x0000FFFF 0xFFFFFF00 } textureTransform "
        "TextureTransform { scale 2 2 } } geometry Sphere { } } }"
        "Transform { translation 0 -1 0 children Shape { appearance Appearance { material PhysicalMaterial { metallic "
        "0.5 roughness 0.2 } } geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] "
        "texCoord TextureCoordinate { point [0 0, 9 0, 9 9, 0 9] } normal Normal { vector [0 1 0, 0 1 0, 0 1 0, 0 1 0] "
        "} color ColorRGBA { color [1 1 1 1, 1 0 0 0.5, 0 1 0 1, 0 0 1 0.1] } "
        "coord Coordinate { point [-4 0 4, 4 0 4, 4 0 -4, -4 0 -4] } } } }",
        24, 16);
    std::vector<NodeId> nodes;
    s.scene.forEachNode([&](const Node& node) { nodes.push_back(node.id()); });
    if (seed % 4 == 0) s.options.settings.integrator = Integrator::path, s.options.settings.samplesPerPixel = 2;
    int edits = 0;
    for (int round = 1; round <= 400; ++round) {
        const NodeId id = nodes[random() % nodes.size()];
        const Node& node = s.scene.node(id);
        if (node.type().fields.empty()) continue;
        const auto field = static_cast<FieldIndex>(random() % node.type().fields.size());
        const FieldDef& def = node.type().fields[field];
        if (!def.readable() || def.hidden || def.access == Access::outputOnly) continue;
        const Value before = node.value(field);
        const std::optional<Value> value = wildValue(def.type, random);
        if (!value) continue;
        const std::string what = fmt::format("seed {} round {}: {}.{}", seed, round, node.type().name, def.name);
        if (!s.scene.setField(id, field, *value)) continue;
        ++edits;
        s.scene.newFrame(round);
        const Picture p = s.picture();
        for (const Vec4f& pixel : p.pixels)
            for (int c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(pixel[c])) << what;
        // Mostly put it back, so that the scene stays worth looking at.
        if (random() % 8 != 0) {
            ASSERT_TRUE(s.scene.setField(id, field, before)) << what;
        }
    }
    EXPECT_GT(edits, 150);
}

}  // namespace
}  // namespace rtsg
