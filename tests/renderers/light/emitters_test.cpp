// Shining triangles as paths find them: the tree's probabilities, and that what is looked for is what bounces find.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lighting/emitters.h"
#include "renderers/light/light_scene.h"
#include "tables/light_tables.h"

namespace rtsg {
namespace {

using namespace test;
using trace::Emitters;

/// The emitters of a scene, with all that they read.
struct Table {
    LightScene s;
    LightTracer tracer;
    std::shared_ptr<const LightState> state;
    trace::TraceScene traced;
    Emitters emitters;
    explicit Table(const std::string& body) : s(body) {
        s.world->add(tracer);
        state = tracer.latest();
        traced.world = &s.world->rays();
        traced.materials = trace::MaterialList(state->materials);
        traced.slots = trace::SlotPages(state->slots);
        emitters = Emitters(traced);
    }
};

std::string lampsAndItems(int seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::uniform_real_distribution<double> at(-5, 5), rotation(0, 6.28), size(0.05, 0.8);
    std::string body = "Viewpoint { }\n";
    for (int i = 0; i < 12; ++i)
        body += fmt::format(
            "Transform {{ translation {} {} {} rotation {} {} scale {} 1 -1 children Shape {{ appearance "
            "Appearance {{ material Material {{ emissiveColor {} .5 0 }} }} geometry {} }} }}\n",
            at(random), at(random), at(random), i % 2 ? "0.6 0.8 0" : "0 -0.8 0.6", rotation(random), size(random),
            size(random),
            i % 3 == 0   ? "Box { }"
            : i % 3 == 1 ? "Sphere { radius 0.4 }"
                         : "IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] coord Coordinate { point [-1 -1 0, 1 "
                           "-1 0, 1 1 0, -1 1 0] } }");
    return body + "Shape { geometry Box { } appearance Appearance { material Material { } } }";
}

TEST(Emitters, AreThoseThatShineAndCannotBeSeenThrough) {
    const auto count = [](const std::string& appearance) {
        return Table("Shape { appearance Appearance { " + appearance + " } geometry Box { } }").emitters.size();
    };
    EXPECT_EQ(count("material Material { }"), 0u);
    EXPECT_EQ(count("material Material { emissiveColor 0 .1 0 }"), 12u);
    EXPECT_EQ(count("material UnlitMaterial { emissiveColor 0 .1 0 }"), 12u);
    EXPECT_EQ(count("material UnlitMaterial { emissiveColor 0 0 0 }"), 0u);
    EXPECT_EQ(count("material PhysicalMaterial { emissiveColor 1 1 0 }"), 12u);
    EXPECT_EQ(count("material Material { emissiveColor 0 .1 0 transparency .5 }"), 0u);
    EXPECT_EQ(count("material Material { emissiveColor 0 .1 0 } backMaterial Material { }"), 12u);
    EXPECT_EQ(count(mirror(".5")), 0u);
}

// The probabilities of all emitters sum to one, and agree with sample(): 10^5 draws at each of twenty places lie within
// five standard deviations. Emitters that are never chosen cannot send light there.
TEST(Emitters, AreChosenWithTheProbabilityThatIsTold) {
    const int seed = 7;
    const Table t(lampsAndItems(seed));
    ASSERT_GT(t.emitters.size(), 100u);
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::uniform_real_distribution<float> at(-7, 7), unit(0, 1);
    for (int lane = 0; lane < 20; ++lane) {
        const Vec3f point(at(random), at(random), at(random)),
            up = glm::normalize(Vec3f(normal(random), normal(random), normal(random)));
        SCOPED_TRACE(fmt::format("seed {}, place {}", seed, lane));
        double sum = 0;
        std::vector<double> expected(t.emitters.size());
        for (std::uint32_t e = 0; e < t.emitters.size(); ++e) {
            sum += expected[e] = double{t.emitters.density(e, point, up)};
            if (expected[e] > 0) continue;
            const Emitters::Emitter& emitter = t.emitters[e];
            for (const Vec3f& corner : {emitter.corner, emitter.corner + emitter.ab, emitter.corner + emitter.ac}) {
                const Vec3f displacement = corner - point;
                const bool lights = glm::dot(displacement, up) > 1e-4f &&
                                    (emitter.bothSides || glm::dot(displacement, emitter.normal) < -1e-4f) &&
                                    emitter.area > 0;
                EXPECT_FALSE(lights) << "emitter " << e << " is never chosen";
            }
        }
        constexpr int kDraws = 100'000;
        std::vector<int> drawn(t.emitters.size());
        int none = 0;
        for (int i = 0; i < kDraws; ++i) {
            const auto choice = t.emitters.sample(point, up, unit(random));
            if (choice.emitter == Emitters::kNone) {
                ++none;
                continue;
            }
            ++drawn[choice.emitter];
            ASSERT_NEAR(choice.probability, expected[choice.emitter], 1e-5 * expected[choice.emitter]);
        }
        EXPECT_NEAR(sum + double(none) / kDraws, 1, 5 * std::sqrt(0.25 / kDraws));
        for (std::size_t e = 0; e < drawn.size(); ++e)
            EXPECT_NEAR(drawn[e], kDraws * expected[e], 5 * std::sqrt(kDraws * expected[e]) + 5) << e;
    }
}

// Eight surfaces at once: bit for bit what each alone chooses, also where some see no light, at a root that holds the
// emitters and above a tree of them.
TEST(Emitters, AreChosenByEightAsByOne) {
    constexpr int kSeed = 11;
    for (const bool many : {false, true}) {
        const Table t(many ? lampsAndItems(kSeed)
                           : "Viewpoint { } Transform { translation 1 2 3 children Shape { appearance Appearance { "
                             "material Material { emissiveColor 1 1 0 } } geometry IndexedFaceSet { coordIndex [0 1 2 "
                             "3 -1] coord Coordinate { point [-1 0 -1, 1 0 -1, 1 0 1, -1 0 1] } } } }");
        ASSERT_EQ(t.emitters.size() > 8, many);
        std::mt19937 random(kSeed);
        std::normal_distribution<float> normal;
        std::uniform_real_distribution<float> at(-7, 7), unit(0, 1);
        int none = 0, some = 0;
        for (int round = 0; round < 500; ++round) {
            alignas(32) float x[3][8], n[3][8], u[8];
            for (int lane = 0; lane < 8; ++lane) {
                const Vec3f up = glm::normalize(Vec3f(normal(random), normal(random), normal(random)));
                for (int c = 0; c < 3; ++c) x[c][lane] = at(random), n[c][lane] = up[c];
                u[lane] = unit(random);
            }
            const auto lanes = static_cast<std::uint32_t>(random() & 0xFFu);
            const auto choices =
                t.emitters.sample({simd::load(x[0]), simd::load(x[1]), simd::load(x[2])},
                                  {simd::load(n[0]), simd::load(n[1]), simd::load(n[2])}, simd::load(u), lanes);
            for (int lane = 0; lane < 8; ++lane) {
                if (!(lanes >> lane & 1u)) {
                    EXPECT_EQ(choices.emitter[lane], Emitters::kNone);
                    continue;
                }
                const auto alone = t.emitters.sample({x[0][lane], x[1][lane], x[2][lane]},
                                                     {n[0][lane], n[1][lane], n[2][lane]}, u[lane]);
                EXPECT_EQ(choices.emitter[lane], alone.emitter) << many << ' ' << round << ' ' << lane;
                if (alone.emitter == Emitters::kNone) {
                    ++none;
                    continue;
                }
                ++some;
                EXPECT_EQ(choices.probability[lane], alone.probability) << many << ' ' << round << ' ' << lane;
            }
        }
        EXPECT_GT(some, 500);
        if (!many) {
            EXPECT_GT(none, 100);
        }
    }
}

TEST(Emitters, AreFoundByWhatARayHits) {
    const Table t(lampsAndItems(3));
    for (std::uint32_t e = 0; e < t.emitters.size(); ++e) {
        const Emitters::Emitter& emitter = t.emitters[e];
        EXPECT_EQ(t.emitters.find(emitter.instance, emitter.triangle), e);
        const Vec3f middle = emitter.corner + (emitter.ab + emitter.ac) / 3.0f;
        Ray ray;
        ray.origin = middle + 0.01f * emitter.normal, ray.direction = -emitter.normal;
        const Hit hit = t.traced.world->intersect(ray);
        if (hit.instance != emitter.instance || hit.triangle != emitter.triangle) continue;  // something lies before it
        EXPECT_GT(glm::dot(hit.normal, emitter.normal), 0.999f) << "the side that is shown";
    }
    EXPECT_EQ(t.emitters.find(1'000'000, 0), Emitters::kNone);
}

/// Mean colour over the pixels of a picture by paths, and its standard error, of one colour.
struct EmitterMean {
    double value = 0, error = 0;
};
EmitterMean emitterMean(const std::string& body, int samples, int side = 16) {
    LightScene s(body, side, side);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = samples;
    EmitterMean result;
    double squares = 0;
    const Picture p = s.picture();
    for (const Vec4f& pixel : p.pixels) result.value += double{pixel.g}, squares += double{pixel.g} * double{pixel.g};
    const auto n = double(p.pixels.size());
    result.value /= n;
    result.error = std::sqrt(std::max(squares / n - result.value * result.value, 0.0) / n);
    return result;
}

/// A panel of `half` metres to each side, `height` above the floor, that shines downwards with radiance 1 in green.
/// `hidden`: it mirrors a trace of light, which leaves it to bounces alone.
std::string panel(double half, double height, bool hidden = false, const char* solid = "TRUE") {
    return fmt::format(
        "Transform {{ translation 0 {1} 0 children Shape {{ appearance Appearance {{ material Material {{ diffuseColor "
        "0 0 0 emissiveColor 0 1 0 {2} }} }} geometry IndexedFaceSet {{ solid {3} coordIndex [0 1 2 3 -1] coord "
        "Coordinate {{ point [-{0} 0 -{0}, {0} 0 -{0}, {0} 0 {0}, -{0} 0 {0}] }} }} }} }}\n",
        half, height, hidden ? "metadata MetadataFloat { name \"reflectivity\" reference \"RTSG\" value 1e-7 }" : "",
        solid);
}
std::string floorOf(const std::string& material, const char* more = "solid FALSE") {
    return fmt::format(
        "Shape {{ appearance Appearance {{ material {} }} geometry IndexedFaceSet {{ {} coordIndex [0 1 2 3 -1] coord "
        "Coordinate {{ point [-9 0 9, 9 0 9, 9 0 -9, -9 0 -9] }} }} }}\n",
        material, more);
}
const char* const kLookDown = "Viewpoint { position 0.3 1.2 0.2 orientation 1 0 0 -1.5707963 fieldOfView 0.02 }\n";

// The irradiance of a square by its corners (Lambert 1760), in double: 5 cm wide and two metres away. A single sample
// a pixel is within .1 of it; bounces alone find the panel once in 5,000.
TEST(PathEmitters, ASmallLampIsFoundAtOnce) {
    const double half = 0.025, height = 2, x = 0.3, z = 0.2;
    Vec3d corners[4] = {{-half - x, height, -half - z},
                        {half - x, height, -half - z},
                        {half - x, height, half - z},
                        {-half - x, height, half - z}};
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
        const Vec3d a = glm::normalize(corners[i]), b = glm::normalize(corners[(i + 1) % 4]), n = glm::cross(a, b);
        sum += std::acos(glm::dot(a, b)) * glm::normalize(n).y;
    }
    const double expected = 0.5 * std::abs(sum) / (2 * kPi);  // of a white floor's half
    const double srgb = double{srgbFromLinear(0.5f)};
    const std::string scene =
        kLookDown + floorOf(fmt::format("Material {{ diffuseColor {0} {0} {0} }}", srgb)) + panel(half, height);
    const EmitterMean one = emitterMean(scene, 1, 32);
    EXPECT_NEAR(one.value, expected, 4 * one.error + 0.005 * expected);
    EXPECT_LT(one.error * 32, 0.1 * expected) << "standard deviation of one sample";
}

// Each scene twice: its panel looked for, and left to bounces. Both means agree within their errors, whatever lies
// between and however the floor sends light on; and looking for it never makes the error much larger.
TEST(PathEmitters, WhatIsLookedForIsWhatBouncesFind) {
    const struct {
        const char* name;
        std::string items;
    } scenes[] = {
        {"matte", floorOf("Material { diffuseColor .8 .8 .8 }")},
        {"highlight", floorOf("Material { diffuseColor .5 .5 .5 specularColor .6 .6 .6 shininess .2 }")},
        {"rough metal", floorOf("PhysicalMaterial { metallic 1 roughness .4 baseColor .9 .9 .9 }")},
        {"dielectric", floorOf("PhysicalMaterial { metallic 0 roughness .3 baseColor .7 .7 .7 }")},
        {"fog", floorOf("Material { diffuseColor .8 .8 .8 }") + "Fog { color 0 0 0 visibilityRange 4 }"},
        {"clear pane", floorOf("Material { diffuseColor .8 .8 .8 }") + "Transform { translation 0 .8 0 children " +
                           floorOf("Material { diffuseColor 0 0 0 transparency .5 }") + "}"},
        {"back of a solid", floorOf("Material { diffuseColor .8 .8 .8 }") + "Transform { translation 0 .8 0 children " +
                                floorOf("Material { diffuseColor .2 .2 .2 }", "solid TRUE") + "}"},
        {"glass", floorOf("Material { diffuseColor .8 .8 .8 }") +
                      "Transform { translation 0 .8 0 children Shape { "
                      "geometry Box { size 9 .1 9 } appearance "
                      "Appearance { " +
                      glass(1.5) + " } } }"},
        {"smooth normals",
         "Shape { appearance Appearance { material Material { diffuseColor .8 .8 .8 } } geometry IndexedFaceSet { "
         "solid "
         "FALSE normalPerVertex FALSE coordIndex [0 1 2 3 -1] coord Coordinate { point [-9 0 9, 9 0 9, 9 0 -9, -9 0 "
         "-9] } normal Normal { vector [.6 .6 .52915] } } }"},
        {"a wall that is lit too", floorOf("Material { diffuseColor .8 .8 .8 }") +
                                       "Transform { translation -1 0 0 rotation 0 0 1 -1.5707963 children " +
                                       floorOf("Material { diffuseColor .8 .8 .8 }") + "}"},
        {"a plane that cuts the lamp", "ClipPlane { plane 1 0 0 0 }\n" + floorOf("Material { diffuseColor .8 .8 .8 }")},
        {"partly covered", floorOf("Material { diffuseColor .8 .8 .8 transparency .4 }")},
    };
    for (const auto& scene : scenes) {
        SCOPED_TRACE(scene.name);
        const EmitterMean found = emitterMean(kLookDown + scene.items + panel(1, 1.5), 256);
        const EmitterMean bounced = emitterMean(kLookDown + scene.items + panel(1, 1.5, true), 1024);
        EXPECT_NEAR(found.value, bounced.value, 4 * std::hypot(found.error, bounced.error) + 1e-6);
        EXPECT_GT(bounced.value, 1e-3);
        // For a quarter of the samples, half of which a plane may cut away.
        EXPECT_LT(found.error, 4 * bounced.error + 1e-6);
    }
}

// A ray there hits one of them, and so the light comes from one.
TEST(PathEmitters, WhatShinesTwiceInOnePlaceShinesOnce) {
    const std::string eye = kLookDown + floorOf("Material { diffuseColor .8 .8 .8 }");
    const auto moved = [&](const char* how, const std::string& what) {
        return fmt::format("Transform {{ {} children {} }}\n", how, what);
    };
    const EmitterMean one = emitterMean(eye + panel(1, 1.5), 256);
    const auto expectOne = [&](const char* name, const std::string& more, double fraction) {
        const EmitterMean two = emitterMean(eye + panel(1, 1.5) + more, 256);
        EXPECT_NEAR(two.value, fraction * one.value, 4 * std::hypot(two.error, fraction * one.error)) << name;
    };
    expectOne("the same panel", panel(1, 1.5), 1);
    expectOne("a part of it", moved("center 0 1.5 0 scale .5 1 .7 rotation 0 1 0 .6", panel(1, 1.5)), 1);
    expectOne("thrice", panel(1, 1.5) + panel(1, 1.5), 1);
    expectOne("one behind it", moved("translation 0 .01 0", panel(1, 1.5)), 1);
    // Beside it, corner to corner in one plane: nothing is shared.
    const EmitterMean far = emitterMean(eye + moved("translation 2 0 2", panel(1, 1.5)), 256);
    expectOne("one beside it", moved("translation 2 0 2", panel(1, 1.5)), 1 + far.value / one.value);
}

TEST(Emitters, AreContestedWhereTheyShareAPlane) {
    const auto contested = [](const std::string& body) {
        const Table table("Viewpoint { }\n" + body);
        std::vector<bool> result;
        for (std::uint32_t i = 0; i < table.emitters.size(); ++i) result.push_back(table.emitters[i].contested);
        return result;
    };
    using Answer = std::vector<bool>;
    EXPECT_EQ(contested(panel(1, 1.5)), Answer({false, false})) << "neighbours share an edge";
    EXPECT_EQ(contested(panel(1, 1.5) + panel(1, 1.5)), Answer({true, true, true, true}));
    // Above each other along y, so that y is what they are sorted by, and a rounding apart in one of the planes.
    EXPECT_EQ(contested(panel(1, 1.5) + panel(1, 1.5000001) + panel(1, 9)),
              Answer({true, true, true, true, false, false}));
    EXPECT_EQ(contested(panel(1, 1.5) + panel(1, 1.6)), Answer({false, false, false, false}));
    EXPECT_EQ(contested(panel(1, 1.5) + "Transform { translation 2 0 0 children " + panel(1, 1.5) + "}"),
              Answer({false, false, false, false}))
        << "beside each other";
    const Answer corner =
        contested(panel(1, 1.5) + "Transform { translation 1.9 0 -1.9 children " + panel(1, 1.5) + "}");
    EXPECT_EQ(std::ranges::count(corner, true), 2) << "the triangle of each that has that corner";
}

// A level of detail that only sound meets lights nothing.
TEST(PathEmitters, WhatIsNotSeenDoesNotShine) {
    const std::string matteFloor = floorOf("Material { diffuseColor .8 .8 .8 }");
    const auto leveled = [&](const std::string& near, const std::string& far) {
        return emitterMean(kLookDown + matteFloor + "LOD { range [ .01 ] children [ " + near + " " + far + " ] }", 16)
            .value;
    };
    EXPECT_EQ(leveled(panel(1, 1.5), "Group { }"), 0);
    EXPECT_GT(leveled("Group { }", panel(1, 1.5)), 0.1);
}

// One-sided panels shine to their front only, two-sided ones to both, textured and coloured ones with what is there.
TEST(PathEmitters, SidesTexturesAndColorsShineAsTheyShow) {
    const std::string matteFloor = floorOf("Material { diffuseColor .8 .8 .8 }");
    const double below = emitterMean(kLookDown + matteFloor + panel(1, 1.5), 64).value;
    EXPECT_GT(below, 0.1);
    const std::string turned = "Transform { rotation 1 0 0 3.1415927 center 0 1.5 0 children " + panel(1, 1.5) + "}";
    EXPECT_NEAR(emitterMean(kLookDown + matteFloor + turned, 64).value, 0, 1e-7);
    const std::string both =
        "Transform { rotation 1 0 0 3.1415927 center 0 1.5 0 children " + panel(1, 1.5, false, "FALSE") + "}";
    EXPECT_NEAR(emitterMean(kLookDown + matteFloor + both, 64).value, below, 0.01 * below);
    // Half of the texels shine; of the vertex colours' green the mean over the panel is .5 as light, too.
    const auto painted = [&](const std::string& appearance, const std::string& more) {
        return emitterMean(
                   kLookDown + matteFloor +
                       fmt::format("Transform {{ translation 0 1.5 0 children Shape {{ appearance Appearance {{ {} }} "
                                   "geometry IndexedFaceSet {{ {} coordIndex [0 1 2 3 -1] coord Coordinate {{ point "
                                   "[-1 0 -1, 1 0 -1, 1 0 1, -1 0 1] }} }} }} }}",
                                   appearance, more),
                   256)
            .value;
    };
    const char* const texture = "texture PixelTexture { image 2 1 3 0x00FF00 0x000000 }";
    const double looked =
        painted(std::string("material UnlitMaterial { emissiveColor 1 1 1 } ") + texture, "solid TRUE");
    EXPECT_GT(looked, 0.3 * below);
    EXPECT_LT(looked, 0.7 * below);
    const double colored =
        painted("material UnlitMaterial { }", "colorPerVertex FALSE color Color { color [0 1 0] } colorIndex [0]");
    EXPECT_NEAR(colored, below, 0.02 * below);
}

// Listed anew only when something that shines changes: its place, its colour, its shape; or what shines.
TEST(EmitterTable, StaysWhileTheSameThingsShineInTheSamePlaces) {
    LightScene s(
        "DEF EYE Viewpoint { } DEF T Transform { children DEF S Shape { appearance Appearance { material DEF M "
        "Material { emissiveColor 1 1 1 } } geometry DEF B Box { } } } DEF OTHER Transform { translation 5 0 0 "
        "children Shape { appearance Appearance { material DEF DARK Material { } } geometry Box { } } }");
    LightTracer tracer;
    s.world->add(tracer);
    double time = 0;
    std::shared_ptr<const Emitters> last;
    const auto isAnew = [&] {
        s.scene.newFrame(time += 1);
        EXPECT_TRUE(s.world->update());
        const auto state = tracer.latest();
        trace::TraceScene scene;
        scene.world = &s.world->rays();
        scene.materials = trace::MaterialList(state->materials);
        scene.slots = trace::SlotPages(state->slots);
        const auto now = state->emitterTable->of(scene);
        EXPECT_EQ(now->size(), Emitters(scene).size());
        return std::exchange(last, now) != now;
    };
    EXPECT_TRUE(isAnew());
    EXPECT_EQ(last->size(), 12u);
    EXPECT_FALSE(isAnew());
    ASSERT_TRUE(s.scene.set(s.node("EYE"), x3d::Viewpoint::position, Vec3f(0, 0, 20)));
    EXPECT_FALSE(isAnew());
    ASSERT_TRUE(s.scene.set(s.node("OTHER"), x3d::Transform::translation, Vec3f(6, 0, 0)));
    EXPECT_FALSE(isAnew()) << "it does not shine";
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(0, 1, 0)));
    EXPECT_TRUE(isAnew());
    EXPECT_NEAR((*last)[0].corner.y, 1, 1.001);
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::Material::emissiveColor, Color{.5f, 1, 1}));
    EXPECT_TRUE(isAnew());
    ASSERT_TRUE(s.scene.set(s.node("B"), x3d::Box::size, Vec3f(1, 2, 3)));
    EXPECT_TRUE(isAnew());
    ASSERT_TRUE(s.scene.set(s.node("DARK"), x3d::Material::emissiveColor, Color{1, 1, 1}));
    EXPECT_TRUE(isAnew());
    EXPECT_EQ(last->size(), 24u);
    EXPECT_FALSE(isAnew());
}

}  // namespace
}  // namespace rtsg
