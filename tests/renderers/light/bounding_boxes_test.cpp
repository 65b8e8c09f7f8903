// Displayed bounding boxes in pictures: white lines one pixel wide where projection puts their twelve edges.
#include <array>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

constexpr int kSize = 200;

/// In pixels from the left and the top; for the default Viewpoint, 10 m before the origin.
glm::dvec2 projected(const Vec3d& p) {
    const double scale = kSize / (2 * std::tan(.785398 / 2)) / (10 - p.z);
    return {kSize * .5 + p.x * scale, kSize * .5 - p.y * scale};
}
std::vector<std::array<Vec3d, 2>> edgesOf(const Vec3d& center, const Vec3d& size) {
    std::vector<std::array<Vec3d, 2>> edges;
    const auto corner = [&](int k) { return center + size * (Vec3d(k & 1, k >> 1 & 1, k >> 2) - .5); };
    for (int k = 0; k < 8; ++k)
        for (const int axis : {1, 2, 4})
            if (!(k & axis)) edges.push_back({corner(k), corner(k | axis)});
    return edges;
}
/// All of it, in white pixels.
double lightOf(const Picture& p) {
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel.g;
    return sum;
}
struct BoxPicture : LightScene {
    explicit BoxPicture(const std::string& body, Integrator integrator = Integrator::whitted)
        : LightScene(body, kSize, kSize) {
        options.settings.samplesPerPixel = 16;
        options.settings.integrator = integrator;
    }
};

/// Every edge is lit along all of its length, as much as a line one pixel wide covers, and nothing else is lit.
void expectEdges(const Picture& p, const Vec3d& center, const Vec3d& size) {
    double length = 0;
    std::vector<bool> near(p.pixels.size());
    for (const auto& [a, b] : edgesOf(center, size)) {
        const glm::dvec2 from = projected(a), to = projected(b);
        length += glm::length(to - from);
        const int steps = static_cast<int>(glm::length(to - from)) + 1;
        for (int i = 0; i <= steps; ++i) {
            const glm::dvec2 at = glm::mix(from, to, double(i) / steps);
            double sum = 0;
            for (int y = -1; y <= 1; ++y)
                for (int x = -1; x <= 1; ++x) {
                    const int px = static_cast<int>(at.x) + x, py = static_cast<int>(at.y) + y;
                    if (px < 0 || py < 0 || px >= kSize || py >= kSize) continue;
                    near[static_cast<std::size_t>(py * kSize + px)] = true;
                    sum += p.at(px, py).g;
                }
            EXPECT_GT(sum, .5) << at.x << " " << at.y;
        }
    }
    for (std::size_t i = 0; i < p.pixels.size(); ++i) EXPECT_TRUE(near[i] || p.pixels[i].g == 0) << i;
    EXPECT_NEAR(lightOf(p), length, .04 * length) << "what edges share near corners is lit once";
}

TEST(BoundingBoxesInPictures, AreTwelveLinesAlongTheWorldsAxes) {
    const double side = 2 * (std::cos(.6) + std::sin(.6));
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        BoxPicture s(
            "Transform { visible FALSE rotation 0 0 1 .6 translation .3 -.2 1 bboxDisplay TRUE children Shape { "
            "geometry Box { } } }",
            integrator);
        const Picture p = s.picture();
        expectEdges(p, {.3, -.2, 1}, {side, side, 2});
        float brightest = 0;
        for (const Vec4f& pixel : p.pixels) brightest = std::max(brightest, pixel.r);
        EXPECT_NEAR(brightest, 1, 1e-5);
    }
}

TEST(BoundingBoxesInPictures, LongAndFlatOnesAreAsThin) {
    BoxPicture s("Shape { visible FALSE bboxDisplay TRUE geometry Box { size 5 .5 .01 } }");
    const Picture p = s.picture();
    for (const auto& [a, b] : edgesOf({0, 0, 0}, {5, .5, .01})) {
        const glm::dvec2 at = (projected(a) + projected(b)) * .5;
        EXPECT_GT(p.at(static_cast<int>(at.x), static_cast<int>(at.y)).g +
                      p.at(static_cast<int>(at.x), static_cast<int>(at.y - .5)).g,
                  .3);
    }
    const double around = 2 * glm::length(projected({2.5, 0, 0}) - projected({-2.5, 0, 0}));
    EXPECT_NEAR(lightOf(p), around * 1.1, .05 * around) << "its front and back are nearly one";
    BoxPicture flat("Shape { visible FALSE bboxDisplay TRUE geometry Rectangle2D { size 5 .5 } }");
    EXPECT_NEAR(lightOf(flat.picture()), around * 1.1, .03 * around);
}

// Opaque content hides the edges behind it and leaves its own: of a ball in its box those in front are seen whole.
TEST(BoundingBoxesInPictures, AreHiddenByWhatIsBeforeThem) {
    BoxPicture s("Shape { bboxDisplay TRUE appearance Appearance { " + unlit("0 0 0") + " } geometry Box { } }");
    const Picture p = s.picture();
    const glm::dvec2 front = projected({1, 0, 1}), back = projected({1, 0, -1});
    const auto at = [&](const glm::dvec2& where) {
        return p.at(static_cast<int>(where.x), static_cast<int>(where.y)).g;
    };
    EXPECT_GT(at(front) + at(front - glm::dvec2(1, 0)), .3);
    EXPECT_EQ(at(back), 0);
}

TEST(BoundingBoxesInPictures, ShowInMirrorsAndCastNoShadow) {
    const std::string box =
        "Transform { visible FALSE translation 0 0 40 bboxDisplay TRUE children Shape { geometry Box { size 8 8 8 } } "
        "}";
    BoxPicture mirrored(box + square(6, mirror("1")));
    // Behind the eye, and so in the mirror alone; its lines are as wide as some 30 m from the eye, and 50 m off.
    double length = 0;
    for (const auto& [from, to] : edgesOf({0, 0, -40}, {8, 8, 8}))
        length += glm::length(projected(to) - projected(from));
    EXPECT_NEAR(lightOf(mirrored.picture()), .6 * length, .05 * length);
    const std::string lamp = "DirectionalLight { direction 0 0 -1 global TRUE } " + square(9, matte("1 1 1"));
    BoxPicture plain(lamp), withBox(box + lamp);
    const Picture a = plain.picture(), b = withBox.picture();
    for (std::size_t i = 0; i < a.pixels.size(); ++i) ASSERT_EQ(a.pixels[i], b.pixels[i]) << i;
}

}  // namespace
}  // namespace rtsg
