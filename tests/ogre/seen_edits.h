// A scene of thirty things to see, and seeded edits of them: places, materials, textures, geometry, lights, choices,
// sharing.
#pragma once

#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg::test {

class SeenEdits {
  public:
    static constexpr int kItems = 30;
    SeenEdits(Scene& scene, std::uint64_t seed) : scene_(scene), random_(seed) {
        std::string text = "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 0 25 }\nDEF Sky Background { }\n";
        const char* const geometries[] = {
            "Box { }", "Sphere { }", "Cone { }",
            "IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 ] coord DEF P{} Coordinate { point [ 0 0 0, 2 0 0, 0 2 0 "
            "] } }",
            "IndexedLineSet { coordIndex [ 0 1 2 ] coord DEF P{} Coordinate { point [ 0 0 0, 2 0 0, 0 2 1 ] } }"};
        for (int i = 0; i < kItems; ++i) {
            std::string geometry = geometries[i % 5];
            if (const auto at = geometry.find("{}"); at != geometry.npos) geometry.replace(at, 2, std::to_string(i));
            text += fmt::format(
                "DEF G{0} Transform {{ translation 0 0 {4} children [ DEF L{0} PointLight {{ global FALSE location 0 0 "
                "3 }} DEF W{0} Switch {{ "
                "whichChoice "
                "0 children DEF T{0} Transform {{ translation {1} {2} 0 children DEF S{0} Shape {{ appearance DEF A{0} "
                "Appearance "
                "{{ material DEF M{0} Material {{ }} texture DEF X{0} PixelTexture {{ image 1 1 3 0xFF8040 }} }} "
                "geometry DEF B{0} "
                "{3} }} }} }} ] }}\n",
                i, i % 6 * 4 - 10, i / 6 * 4 - 8, geometry, .11 * i);
        }
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    }

    void step() {
        switch (pick(12)) {
            case 0:
            case 1:
                set(node('T'), x3d::Transform::translation, Vec3f(number() * 10, number() * 8, number() * 5));
                break;
            case 2:
                set(node('T'), x3d::Transform::scale, Vec3f(number() * 2, 1, pick(9) ? 1.0f : 0.0f));
                break;
            case 3:
                set(node('M'), x3d::Material::diffuseColor, Color{fraction(), fraction(), fraction()});
                break;
            case 4:
                set(node('M'), x3d::Material::transparency, pick(2) ? 0.0f : .5f);
                break;
            case 5: {
                Image image;
                image.words = Array<std::int32_t>{1, 1, 3, static_cast<std::int32_t>(random_() & 0xFFFFFF)};
                set(node('X'), x3d::PixelTexture::image, image);
                break;
            }
            case 6:
                set(node('L'), x3d::PointLight::on, pick(2) == 0);
                break;
            case 7:
                set(node('W'), x3d::Switch::whichChoice, pick(3) ? 0 : -1);
                break;
            case 8:
                (void)scene_.setField(node('S'), x3d::Shape::geometry.index, pick(5) ? node('B') : NodeId());
                break;
            case 9:
                (void)scene_.setField(node('S'), x3d::Shape::appearance.index, pick(5) ? node('A') : NodeId());
                break;
            case 10:
                (void)scene_.insertChild(node('G'), x3d::Transform::children, node('T'));
                break;
            default:
                deform();
                break;
        }
    }

  private:
    template <class F, class V>
    void set(NodeId id, F field, V value) {
        EXPECT_TRUE(scene_.set(id, field, value));
    }
    void deform() {
        const auto number3 = [&] { return Vec3f(number() * 2, number() * 2, number()); };
        const NodeId points = scene_.findName(fmt::format("P{}", pick(kItems) / 5 * 5 + 3 + pick(2)));
        Array<Vec3f> value{number3(), number3(), number3()};
        if (pick(8) == 0) value = {};
        set(points, x3d::Coordinate::point, value);
    }
    std::size_t pick(std::size_t n) { return random_() % n; }
    float fraction() { return static_cast<float>(pick(256)) / 255; }
    float number() { return 2 * fraction() - 1; }
    NodeId node(char kind) { return scene_.findName(fmt::format("{}{}", kind, pick(kItems))); }
    Scene& scene_;
    std::mt19937_64 random_;
};

}  // namespace rtsg::test
