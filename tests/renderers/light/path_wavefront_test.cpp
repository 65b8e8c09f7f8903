// Paths in stages: what they show is what the same paths show one packet after the other.
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lighting/path_parts.h"
#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// The same picture in stages and by packets.
struct BothPaths {
    Picture stages, packets;
    RenderStats stagesStats, packetsStats;
    explicit BothPaths(const std::string& body, int samples = 16, float error = 0, int side = 37) {
        const trace::PathParts before = trace::pathParts();
        for (const bool inStages : {true, false}) {
            trace::pathParts().wavefronts = inStages;
            LightScene s(body, side, side - 2);
            s.options.settings.integrator = Integrator::path;
            s.options.settings.samplesPerPixel = samples, s.options.settings.error = error;
            (inStages ? stages : packets) = s.picture();
            (inStages ? stagesStats : packetsStats) = s.stats;
        }
        trace::pathParts() = before;
    }
    /// The share of numbers that differ by more than roundings.
    double apart() const {
        int count = 0;
        for (std::size_t i = 0; i < stages.pixels.size(); ++i)
            for (int c = 0; c < 4; ++c) {
                const float a = stages.pixels[i][c], b = packets.pixels[i][c];
                count += std::abs(a - b) > 1e-4f * std::max(std::abs(b), .01f);
            }
        return count / (4.0 * static_cast<double>(stages.pixels.size()));
    }
    double mean(const Picture& picture) const {
        double sum = 0;
        for (const Vec4f& pixel : picture.pixels) sum += double{pixel.g};
        return sum / static_cast<double>(picture.pixels.size());
    }
};

std::string room(const std::string& more, const std::string& lamp =
                                              "IndexedFaceSet { coordIndex [0 1 2 3 -1] coord "
                                              "Coordinate { point [-1 0 -1, 1 0 -1, 1 0 1, -1 0 "
                                              "1] } }") {
    return "Viewpoint { position 0 0 1.4 }\n"
           "Shape { appearance Appearance { material Material { diffuseColor .8 .7 .6 } } geometry Box { size 3 3 3 "
           "solid FALSE } }\n"
           "Transform { translation -.4 -.3 0 children Shape { appearance Appearance { material Material { "
           "diffuseColor .8 .3 .2 specularColor .2 .2 .2 shininess .3 } } geometry Sphere { radius .4 } } }\n"
           "Transform { translation .6 -.9 0 rotation 0 1 0 .4 children Shape { appearance Appearance { material "
           "PhysicalMaterial { baseColor .2 .5 .8 roughness .4 metallic .5 } } geometry Box { size .8 1 .8 } } }\n"
           "Transform { translation 0 1.2 0 scale .5 1 .5 children Shape { appearance Appearance { material Material { "
           "diffuseColor 0 0 0 emissiveColor 1 1 1 } } geometry " +
           lamp + " } }\n" + more;
}

// A path's numbers are the same either way, so the pictures are, but where a rounding sends a ray past an edge.
TEST(Wavefront, ShowsWhatPacketsShow) {
    const struct {
        const char* name;
        std::string body;
    } scenes[] = {
        {"panel", room("")},
        {"lamp that is met from all sides", room("", "Sphere { radius .2 }")},
        {"shining sheets one over the other",
         room("Transform { translation 0 1.1 0 children " + square(.3, unlit("1 .5 0"), "solid TRUE") + "}")},
        {"glass, a mirror, a texture, a clear sheet",
         room("Transform { translation .3 .3 .3 scale .2 .2 .2 children [ Shape { appearance Appearance { material "
              "Material { diffuseColor 0 0 0 transparency 1 metadata MetadataFloat { name \"refractiveIndex\" "
              "reference \"RTSG\" value 1.5 } } } geometry Sphere { } } ] }\n"
              "Transform { translation -.9 .2 -.9 rotation 0 1 0 .7 children " +
              square(.4, mirror(".8")) +
              "}\nTransform { translation .9 .4 -.9 children Shape { appearance Appearance { material Material { } "
              "texture PixelTexture { image 2 2 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF } } geometry Box { size .3 .3 "
              ".3 } } }\nTransform { translation 0 .8 0 rotation 1 0 0 1.5708 children " +
              square(.4, "material Material { diffuseColor .2 .9 .2 transparency .6 }") + "}")},
        {"backs of solids", room("Transform { translation 0 .9 0 rotation 1 0 0 1.5708 children " +
                                 square(.5, matte(".5 .5 .5"), "solid TRUE") +
                                 "}\nTransform { translation 0 .7 0 rotation 1 0 0 -1.5708 "
                                 "children " +
                                 square(.2, matte(".5 .5 .5"), "solid TRUE") + "}")},
        {"even sky",
         "Viewpoint { position 0 1 6 }\nBackground { skyColor .3 .4 .5 }\n"
         "Shape { appearance Appearance { material Material { diffuseColor .8 .7 .6 } } geometry Sphere { } }\n"
         "Transform { translation 0 -1.2 0 children Shape { appearance Appearance { material Material { diffuseColor "
         ".5 .5 .5 specularColor .3 .3 .3 } } geometry Box { size 6 .2 6 } } }"},
        {"sky of two colours",
         "Viewpoint { position 0 1 6 }\nBackground { skyColor [.3 .4 .5, .9 .5 .4] skyAngle 1.57 }\n"
         "Shape { appearance Appearance { material Material { diffuseColor .8 .7 .6 } } geometry Sphere { } }\n"
         "Transform { translation 0 -1.2 0 children Shape { appearance Appearance { material Material { diffuseColor "
         ".5 .5 .5 } } geometry Box { size 6 .2 6 } } }"},
    };
    for (const auto& [name, body] : scenes) {
        SCOPED_TRACE(name);
        const BothPaths both(body);
        EXPECT_LT(both.apart(), .03);
        EXPECT_NEAR(both.mean(both.stages), both.mean(both.packets), .002 * both.mean(both.packets));
        EXPECT_GT(both.mean(both.stages), .002);
        // They are two ways: sums of other orders differ in some bits.
        EXPECT_NE(both.stages.pixels, both.packets.pixels);
        EXPECT_EQ(both.stagesStats.primaryRays, both.packetsStats.primaryRays);
        EXPECT_NEAR(static_cast<double>(both.stagesStats.secondaryRays),
                    static_cast<double>(both.packetsStats.secondaryRays),
                    .002 * static_cast<double>(both.packetsStats.secondaryRays));
    }
}

TEST(Wavefront, LeavesOutWhatTheEyesPlanesCut) {
    const auto seen = [](const std::string& planes) {
        std::string body = room("");
        const std::string eye = "Viewpoint { position 0 0 1.4";
        body.replace(body.find(eye), eye.size(), eye + " " + planes);
        return BothPaths(body, 4);
    };
    const BothPaths cut = seen("nearDistance 1.3"), whole = seen("");
    EXPECT_EQ(cut.stages.pixels, cut.packets.pixels);
    EXPECT_GT(std::abs(cut.mean(cut.stages) - whole.mean(whole.stages)), .01 * whole.mean(whole.stages));
}

TEST(Wavefront, StopsWherePacketsStop) {
    const BothPaths both(room(""), 1 << 12, .1f);
    EXPECT_NEAR(both.stagesStats.samples, both.packetsStats.samples, .01 * both.packetsStats.samples);
    EXPECT_NEAR(both.stagesStats.error, both.packetsStats.error, .01 * both.packetsStats.error);
}

// White walls send paths on for very long: more numbers than one sequence has calls.
TEST(Wavefront, FollowsPathsThroughThousandsOfBounces) {
    for (const bool largeFirst : {false, true}) {
        SCOPED_TRACE(largeFirst);
        const trace::PathParts before = trace::pathParts();
        trace::pathParts().roulette = 0x1p-20f, trace::pathParts().largeFirst = largeFirst;
        const BothPaths both(
            "Viewpoint { position 0 0 .4 } Shape { appearance Appearance { material Material { diffuseColor .995 .995 "
            ".995 emissiveColor .01 .01 .01 } } geometry Box { size 2 2 2 solid FALSE } }",
            2, 0, 13);
        trace::pathParts() = before;
        EXPECT_GT(both.stagesStats.secondaryRays, 13u * 11u * 2u * 700u);
        // The answers of large triangles differ in last bits, which many bounces amplify.
        EXPECT_LT(both.apart(), largeFirst ? 1 : .2);
        EXPECT_NEAR(both.mean(both.stages), both.mean(both.packets), .01 * both.mean(both.packets));
    }
}

// Few of a room's rays meet anything but its walls: most are answered by these alone.
TEST(Wavefront, ShowsTheSameByLargeTrianglesFirst) {
    const trace::PathParts before = trace::pathParts();
    const auto picture = [&](bool largeFirst, RenderStats& stats) {
        trace::pathParts().largeFirst = largeFirst;
        LightScene s(room(""), 37, 35);
        s.options.settings.integrator = Integrator::path, s.options.settings.samplesPerPixel = 16;
        const Picture created = s.picture();
        stats = s.stats, trace::pathParts() = before;
        return created;
    };
    RenderStats large, trees;
    const Picture a = picture(true, large), b = picture(false, trees);
    EXPECT_NE(a.pixels, b.pixels) << "they are two ways";
    int others = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
        others += std::abs(a.pixels[i].g - b.pixels[i].g) > 1e-4f * std::max(b.pixels[i].g, .01f);
    EXPECT_LT(others, 37 * 35 * .03);
    EXPECT_EQ(large.primaryRays, trees.primaryRays);
    EXPECT_NEAR(static_cast<double>(large.secondaryRays), static_cast<double>(trees.secondaryRays),
                .002 * static_cast<double>(trees.secondaryRays));
    EXPECT_NEAR(static_cast<double>(large.shadowRays), static_cast<double>(trees.shadowRays),
                .002 * static_cast<double>(trees.shadowRays));
}

}  // namespace
}  // namespace rtsg
