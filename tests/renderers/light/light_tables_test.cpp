// Light's tables follow a scene at the cost of what changed, and hold what reading it anew would give.
#include <fstream>
#include <random>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/filters.h>
#include <rtsg/documents/writer.h>

#include "renderers/light/light_scene.h"
#include "support/temp_folder.h"
#include "tables/light_tables.h"

namespace rtsg {
namespace {

using namespace test;

/// Entries on pages that differ between two versions.
template <class Array>
std::size_t differing(const Array& a, const Array& b) {
    std::size_t count = 0;
    Array::differences(a, b, [&](std::size_t, const auto&, const auto&) { ++count; });
    return count;
}

TEST(LightTables, ALightThatIsSwitchedOrMovedTouchesItsOwnListAlone) {
    constexpr int kLamps = 2000;
    std::string body;
    for (int i = 0; i < kLamps; ++i)
        body += fmt::format(
            "DEF T{0} Transform {{ translation {1} 0 0 children [ DEF L{0} PointLight {{ global FALSE }} Shape {{ "
            "appearance DEF A{0} Appearance {{ material DEF M{0} Material {{ }} }} geometry Box {{ }} }} ] }}\n",
            i, 3 * i);
    LightScene s(body);
    LightTracer tracer;
    s.world->add(tracer);
    const auto before = tracer.latest();
    EXPECT_EQ(tracer.latest(), before);
    ASSERT_TRUE(s.scene.set(s.node("L700"), x3d::PointLight::on, false));
    s.scene.newFrame(1);
    const auto off = tracer.latest();
    EXPECT_EQ(differing(before->slots, off->slots), 0u);
    EXPECT_EQ(differing(before->materials, off->materials), 0u);
    EXPECT_LE(differing(before->scopes, off->scopes), 16u) << "a page";
    EXPECT_LE(differing(before->placed, off->placed), 16u);
    ASSERT_TRUE(s.scene.set(s.node("T900"), x3d::Transform::translation, Vec3f(0, 9, 0)));
    s.scene.newFrame(2);
    const auto moved = tracer.latest();
    EXPECT_EQ(differing(off->slots, moved->slots), 0u);
    EXPECT_EQ(differing(off->scopes, moved->scopes), 0u) << "it is on as before";
    EXPECT_LE(differing(off->placed, moved->placed), 16u);
    ASSERT_TRUE(s.scene.set(s.node("M100"), x3d::Material::shininess, .7f));
    s.scene.newFrame(3);
    const auto painted = tracer.latest();
    EXPECT_EQ(differing(moved->slots, painted->slots), 0u);
    EXPECT_LE(differing(moved->materials, painted->materials), 16u);
    EXPECT_EQ(tracer.counts().lights, static_cast<std::size_t>(kLamps));
    // Changes that do not concern light make no new version.
    s.scene.newFrame(4);
    EXPECT_EQ(tracer.latest(), painted);
}

TEST(LightTables, ManyLightsOfOneScopeComeAndGoAtOnce) {
    std::string body = "DEF G Group { children [ ";
    for (int i = 0; i < 60; ++i)
        body += fmt::format("DEF L{} DirectionalLight {{ global FALSE intensity {} }} ", i, 1 / 64.0);
    LightScene s(body +
                 "Shape { appearance Appearance { material Material { diffuseColor 1 1 1 } } geometry Box { } } ] }");
    expectColor(s.center(), Vec3d(60 / 64.0), 1e-5);
    for (const int stride : {2, 3, 1}) {  // 30 at once, 20, all of them
        for (int i = 0; i < 60; i += stride)
            ASSERT_TRUE(s.scene.set(s.node(fmt::format("L{}", i).c_str()), x3d::DirectionalLight::on, stride == 3));
        s.scene.newFrame(stride);
        // After 2: the odd ones; after 3: those and every sixth; then none.
        const int lit = stride == 2 ? 30 : stride == 3 ? 40 : 0;
        expectColor(s.center(), Vec3d(lit / 64.0), 1e-5);
    }
}

/// Red where coordinates "A" are used, green where "B".
const char* const kMapped = R"(
Shape {
  appearance Appearance { material DEF M UnlitMaterial {
    emissiveTexture PixelTexture { image 2 1 3 0xFF0000 0x00FF00 } } }
  geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1]
    coord Coordinate { point [-9 -9 0, 9 -9 0, 9 9 0, -9 9 0] }
    texCoord MultiTextureCoordinate { texCoord [
      DEF FIRST TextureCoordinate { mapping "A" point [.25 .5, .25 .5, .25 .5, .25 .5] }
      DEF SECOND TextureCoordinate { mapping "B" point [.75 .5, .75 .5, .75 .5, .75 .5] } ] } } }
)";

TEST(LightTables, TheCoordinatesOfATextureFollowMaterialAndMesh) {
    LightScene s(kMapped);
    const Vec3d red(1, 0, 0), green(0, 1, 0);
    const auto shows = [&](const Vec3d& color, const char* when) {
        SCOPED_TRACE(when);
        s.scene.newFrame(s.scene.now() + 1);
        expectColor(s.center(), color, 1e-5);
        SharedWorld anew(s.scene);
        LightRenderer fresh(anew);
        const auto picture = fresh.picture(s.options);
        ASSERT_TRUE(picture);
        expectColor(Vec3f(picture->at(picture->width / 2, picture->height / 2)), color, 1e-5);
    };
    shows(red, "no mapping: the first");
    const auto map = [&](const char* name) {
        ASSERT_TRUE(s.scene.set(s.node("M"), x3d::UnlitMaterial::emissiveTextureMapping, String(name)));
    };
    map("B");
    shows(green, "the material asks for B");
    ASSERT_TRUE(s.scene.set(s.node("SECOND"), x3d::TextureCoordinate::mapping, String("C")));
    shows(red, "the mesh has none of that name");
    map("C");
    shows(green, "both say C");
    map("");
    shows(red, "no mapping again");
    ASSERT_TRUE(s.scene.set(s.node("FIRST"), x3d::TextureCoordinate::mapping, String("C")));
    ASSERT_TRUE(s.scene.set(s.node("SECOND"), x3d::TextureCoordinate::mapping, String("A")));
    map("A");
    shows(green, "they have changed places");
}

TEST(LightTables, AMappingThatNoCoordinatesHaveIsNamedWithItsLine) {
    LightScene s(kMapped);
    const auto reported = [&] {
        std::string all;
        const Diagnostics found = s.light->diagnostics();
        for (const Diagnostic& d : found.all()) all += d.format() + "\n";
        return all;
    };
    const auto map = [&](const char* name) {
        ASSERT_TRUE(s.scene.set(s.node("M"), x3d::UnlitMaterial::emissiveTextureMapping, String(name)));
        s.scene.newFrame(s.scene.now() + 1);
    };
    map("B"), map("");
    // Both at once: what holds in between is nothing to tell of.
    ASSERT_TRUE(s.scene.set(s.node("SECOND"), x3d::TextureCoordinate::mapping, String("C")));
    map("C");
    EXPECT_EQ(reported(), "");
    map("uv2");
    EXPECT_THAT(reported(),
                testing::AllOf(testing::HasSubstr("7:36: "), testing::HasSubstr("warning: UnlitMaterial M"),
                               testing::HasSubstr("IndexedFaceSet has no texture coordinates of the mapping "
                                                  "\"uv2\"")));
    const std::string once = reported();
    map("C"), map("uv2");
    EXPECT_EQ(reported(), once);
}

// A Box's coordinates have no name that a file could give; the mapping says which transform is meant.
TEST(LightTables, AMappingOfATextureTransformIsEnough) {
    for (const char* named : {"uv2", "uv3"}) {
        LightScene s(fmt::format(R"(Shape {{ geometry Box {{ }} appearance Appearance {{
            textureTransform TextureTransform {{ mapping "{}" scale 2 2 }}
            material UnlitMaterial {{ emissiveTextureMapping "uv2" emissiveTexture PixelTexture {{ image 1 1 3 0xFF }} }} }} }})",
                                 named));
        EXPECT_EQ(s.light->diagnostics().warnings(), named == std::string("uv2") ? 0u : 1u) << named;
    }
}

TEST(LightTables, AllThatShareAMaterialFollowItWhoeverHasGone) {
    constexpr std::uint64_t kSeed = 7;
    SCOPED_TRACE(testing::Message() << "seed " << kSeed);
    std::string body = fmt::format("DEF T0 Transform {{ children DEF G Group {{ children [ {} ] }} }}\n", kMapped);
    for (int i = 1; i < 40; ++i) body += fmt::format("DEF T{} Transform {{ children USE G }}\n", i);
    LightScene s(body);
    LightTracer tracer;
    s.world->add(tracer);
    std::mt19937_64 random(kSeed);
    std::vector<NodeId> there, gone;
    for (int i = 0; i < 40; ++i) there.push_back(s.node(fmt::format("T{}", i).c_str()));
    const NodeId shapes = s.node("G");
    bool swapped = false;
    std::size_t name = 0;
    for (int step = 0; step < 200; ++step) {
        for (std::size_t moves = 1 + random() % 4; moves > 0; --moves) {
            auto& from = random() % 3 == 0 ? gone : there;
            auto& to = &from == &gone ? there : gone;
            if (from.empty()) continue;
            std::swap(from[random() % from.size()], from.back());
            const FieldIndex children = x3d::Transform::children.index;
            ASSERT_TRUE(&from == &there ? s.scene.removeChild(from.back(), children, 0)
                                        : s.scene.insertChild(from.back(), children, shapes));
            to.push_back(from.back());
            from.pop_back();
        }
        if (random() % 2) s.scene.newFrame(step + .5);
        // The mesh changes, or the material, or neither.
        const char* const names[] = {"", "A", "B"};
        if (random() % 2) {
            swapped = !swapped;
            ASSERT_TRUE(s.scene.set(s.node("FIRST"), x3d::TextureCoordinate::mapping, String(swapped ? "B" : "A")));
            ASSERT_TRUE(s.scene.set(s.node("SECOND"), x3d::TextureCoordinate::mapping, String(swapped ? "A" : "B")));
        } else if (random() % 4 == 0) {
            name = random() % 3;
            ASSERT_TRUE(s.scene.set(s.node("M"), x3d::UnlitMaterial::emissiveTextureMapping, String(names[name])));
        }
        const int channel = name == 0 || (name == 1) != swapped ? 0 : 1;
        s.scene.newFrame(step + 1);
        const auto tables = tracer.latest();
        std::size_t live = 0;
        for (const RayInstance& instance : s.world->rays().instances()) {
            if (!instance.info.id) continue;
            ++live;
            EXPECT_EQ(tables->slots[instance.info.id.slot].channels[0], channel) << "step " << step;
        }
        ASSERT_EQ(live, there.size());
        if (HasFailure()) return;
    }
}

TEST(LightTables, VertexColoursThatAreClearLetLightThrough) {
    const auto lit = [](const char* alpha) {
        LightScene s(fmt::format(
            "DirectionalLight {{ direction 0 -1 0 }} Viewpoint {{ position 0 3 10 orientation 1 0 0 -.29 }}\n"
            "Shape {{ appearance Appearance {{ material Material {{ diffuseColor 1 1 1 }} }} geometry Box {{ size 9 .1 "
            "9 }} }}\n"
            "Transform {{ translation 0 6 0 children Shape {{ appearance Appearance {{ material Material {{ }} }} "
            "geometry IndexedFaceSet {{ solid FALSE coordIndex [0 1 2 3 -1] coord Coordinate {{ point [-5 0 -5, 5 0 "
            "-5, "
            "5 0 5, -5 0 5] }} color ColorRGBA {{ color [1 1 1 {0}, 1 1 1 {0}, 1 1 1 {0}, 1 1 1 {0}] }} }} }} }}",
            alpha));
        return s.center();
    };
    expectColor(lit("1"), Vec3d(0), 1e-5);
    expectColor(lit("0"), Vec3d(1), 1e-5);
}

// 9.4.2: lights of an Inline shine within it unless its `global` says otherwise. A PROTO's light in an Inline in an
// Inline, with a square in each and one outside: x = 3, 0, -3.
TEST(LightTables, AnInlineLimitsTheLightsItBrings) {
    const TempFolder own;
    const auto write = [&](const char* name, const std::string& body) {
        std::ofstream(own.path() / name) << "#X3D V4.0 utf8\nPROFILE Immersive\n" + body;
    };
    const auto squareAt = [](int x) {
        return fmt::format("Transform {{ translation {} 0 0 children {} }}\n", x, square(1, matte("1 1 1")));
    };
    write("lamp.x3dv", "PROTO P [ ] { DirectionalLight { global TRUE } } P { }" + squareAt(3));
    write("middle.x3dv", squareAt(0) + "Inline { url \"lamp.x3dv\" }");
    write("outer.x3dv", "OrthoViewpoint { fieldOfView [ -4 -4 4 4 ] } NavigationInfo { headlight FALSE }" +
                            squareAt(-3) + "DEF OUTER Inline { url \"middle.x3dv\" }");
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, own.path() / "outer.x3dv", diagnostics));
    SharedWorld world(scene);
    LightRenderer light(world);
    double time = 0;
    /// Which of the squares are lit, from the left.
    const auto lit = [&] {
        scene.newFrame(++time);
        ImageOptions image;
        image.settings.width = image.settings.height = 80;
        const auto picture = light.picture(image);
        std::string result;
        for (const int x : {10, 40, 70}) result += picture && picture->at(x, 40).g > .5f ? "1" : "0";
        return result;
    };
    const NodeId outer = scene.findName("OUTER");
    NodeId inner;
    scene.forEachNode([&](const Node& node) {
        if (node.is(x3d::Inline::type) && node.id() != outer) inner = node.id();
    });
    ASSERT_TRUE(inner);
    const auto set = [&](NodeId inlined, bool global) { ASSERT_TRUE(scene.set(inlined, x3d::Inline::global, global)); };
    EXPECT_EQ(lit(), "001");
    set(outer, true);
    EXPECT_EQ(lit(), "001") << "the inner one limits it";
    set(inner, true);
    EXPECT_EQ(lit(), "111");
    set(outer, false);
    EXPECT_EQ(lit(), "011");
    // Another limit and no more lamp at once, and back.
    set(outer, true), set(inner, false);
    const auto index = static_cast<std::uint32_t>(scene.node(scene.root()).get(x3d::RtsgScene::children).size() - 1);
    ASSERT_TRUE(scene.removeChild(scene.root(), x3d::RtsgScene::children.index, index));
    EXPECT_EQ(lit(), "000");
    set(inner, true);
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, outer));
    EXPECT_EQ(lit(), "111");
}

/// Documents of squares, lights, groups and Inlines at random; an Inline's document is written into a folder.
class RandomInlines {
  public:
    RandomInlines(const TempFolder& folder, unsigned seed) : folder_(folder), random_(seed) {}

    std::string nodes(int depth) {
        std::string text;
        const int count = 1 + below(3);
        for (int i = 0; i < count; ++i) text += node(depth);
        return text;
    }

  private:
    int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
    std::string node(int depth) {
        const int kind = below(depth > 0 ? 8 : 4);
        if (kind < 2)
            return fmt::format("Transform {{ translation {} {} 0 children {} }}\n", below(5) - 2, below(5) - 2,
                               square(.4, matte("1 1 1")));
        if (kind < 4)
            return fmt::format("PointLight {{ location {} {} 2 intensity .{} ambientIntensity 0 global {} }}\n",
                               below(5) - 2, below(5) - 2, 1 + below(4), below(3) > 0 ? "TRUE" : "FALSE");
        if (kind < 5) return "Group { children [ " + nodes(depth - 1) + " ] }\n";
        if (kind < 6)
            return fmt::format("Transform {{ translation 0 0 .{} children [ {} ] }}\n", below(9), nodes(depth - 1));
        const std::string name = fmt::format("part{}.x3dv", ++files_);
        const std::string text = nodes(depth - 1);
        std::ofstream(folder_.path() / name) << "#X3D V4.0 utf8\nPROFILE Immersive\n" << text;
        return fmt::format("Inline {{ global {} url \"{}\" }}\n", below(4) == 0 ? "TRUE" : "FALSE", name);
    }

    const TempFolder& folder_;
    std::mt19937 random_;
    int files_ = 0;
};

// Without a word, Groups in place of Inlines are lit as these were.
TEST(LightTables, WhatFlattenInlinesSaysNothingOfIsLitTheSame) {
    int silent = 0, reported = 0, dark = 0;
    for (unsigned seed = 0; seed < 300; ++seed) {
        const TempFolder own;
        const std::filesystem::path main = own.path() / "main.x3dv";
        const std::string body =
            "#X3D V4.0 utf8\nPROFILE Immersive\nOrthoViewpoint { fieldOfView [ -3 -3 3 3 ] } "
            "NavigationInfo { headlight FALSE }\n" +
            RandomInlines(own, seed).nodes(4);
        std::ofstream(main) << body;
        std::string flat;
        Diagnostics problems("main.x3dv");
        const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { flat += piece; }, problems);
        FilterContext context{problems};
        context.file = main;
        context.resources = Resources::ofFile(main);
        const auto filter = makeFilter("flatten-inlines", *writer, context);
        ASSERT_TRUE(filter);
        readDocument(body, **filter, problems);
        ASSERT_EQ(flat.find("Inline"), flat.npos);
        if (!problems.all().empty()) {
            EXPECT_NE(problems.all()[0].text.find("shines beyond"), std::string::npos) << problems.all()[0].format();
            ++reported;
            continue;
        }
        ++silent;
        std::ofstream(own.path() / "flat.x3dv") << flat;
        const auto picture = [&](const char* file) {
            Scene scene;
            Diagnostics diagnostics;
            EXPECT_TRUE(loadFile(scene, own.path() / file, diagnostics));
            SharedWorld world(scene);
            LightRenderer light(world);
            scene.newFrame(0);
            ImageOptions image;
            image.settings.width = image.settings.height = 30;
            auto result = light.picture(image);
            EXPECT_TRUE(result);
            return std::move(*result);
        };
        const Picture before = picture("main.x3dv"), after = picture("flat.x3dv");
        bool any = false;
        for (std::size_t i = 0; i < before.pixels.size(); ++i) {
            ASSERT_LT(glm::distance(Vec3f(before.pixels[i]), Vec3f(after.pixels[i])), 1e-5f) << seed << "\n" << flat;
            any = any || before.pixels[i].r > 0;
        }
        dark += any ? 0 : 1;
    }
    EXPECT_GT(silent - dark, 60);
    EXPECT_GT(reported, 10);
}

}  // namespace
}  // namespace rtsg
