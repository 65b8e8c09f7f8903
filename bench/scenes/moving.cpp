// Troopers: 48 figures of rigid parts that march, every joint turned by an interpolator of its own. Escherknot: a knot
// that flows along itself, by a CoordinateInterpolator of two keys.
#include <numbers>
#include <vector>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
using Shading = SceneFile::Shading;

Surface limb(float length, float thick, int n) {
    return lathe({{.001f, 0}, {thick, -.02f}, {thick * .8f, -length}, {.001f, -length - .02f}}, n, 2);
}

/// A part of a figure.
struct Part {
    const char* joint;
    const char* parent;  // joint
    Vec3f at;            // in the parent's frame
    float swing;         // rad, about x
    float bend;          // rad, mean
    Surface surface;
    const char* look;
};

std::vector<Part> figureParts() {
    const int n = 5;
    return {
        {"HIPS", "", {0, .95f, 0}, .03f, 0, ellipsoid({0, 0, 0}, {.17f, .11f, .12f}, 6, 4, .7f), "ARMOUR"},
        {"CHEST", "HIPS", {0, .1f, 0}, .06f, .04f, ellipsoid({0, .25f, 0}, {.22f, .3f, .15f}, 8, 5, .6f), "ARMOUR"},
        {"HEAD",
         "CHEST",
         {0, .58f, 0},
         .05f,
         0,
         ellipsoid({0, .12f, 0}, {.13f, .17f, .15f}, 7, 5, .75f).add(boxAt({0, .13f, .13f}, {.2f, .05f, .04f})),
         "ARMOUR"},
        {"ARM_L", "CHEST", {.28f, .45f, 0}, .5f, 0, limb(.3f, .075f, n), "ARMOUR"},
        {"FORE_L", "ARM_L", {0, -.32f, 0}, .2f, -.5f, limb(.28f, .06f, n), "ARMOUR"},
        {"ARM_R", "CHEST", {-.28f, .45f, 0}, -.5f, 0, limb(.3f, .075f, n), "ARMOUR"},
        {"FORE_R",
         "ARM_R",
         {0, -.32f, 0},
         -.2f,
         -.5f,
         limb(.28f, .06f, n).add(boxAt({0, -.3f, .15f}, {.05f, .06f, .5f})),
         "BLACK"},
        {"THIGH_L", "HIPS", {.1f, -.05f, 0}, -.5f, 0, limb(.4f, .09f, n), "ARMOUR"},
        {"SHIN_L", "THIGH_L", {0, -.43f, 0}, .35f, .4f, limb(.38f, .08f, n), "ARMOUR"},
        {"FOOT_L", "SHIN_L", {0, -.4f, .05f}, .15f, 0, boxAt({0, -.04f, .02f}, {.11f, .1f, .27f}), "BLACK"},
        {"THIGH_R", "HIPS", {-.1f, -.05f, 0}, .5f, 0, limb(.4f, .09f, n), "ARMOUR"},
        {"SHIN_R", "THIGH_R", {0, -.43f, 0}, -.35f, .4f, limb(.38f, .08f, n), "ARMOUR"},
        {"FOOT_R", "SHIN_R", {0, -.4f, .05f}, -.15f, 0, boxAt({0, -.04f, .02f}, {.11f, .1f, .27f}), "BLACK"},
    };
}

/// One figure as a PROTO. `at` is where it stands, `start` its phase.
void writeTrooper(SceneFile& file) {
    const std::vector<Part> parts = figureParts();
    file.raw("PROTO Trooper [ initializeOnly SFVec3f at 0 0 0 initializeOnly SFTime start 0 ] {{\n");
    file.raw("Transform {{ translation IS at children [\n");
    // Looks are defined outside, where a PROTO cannot see them: once more in here.
    file.look("ARMOUR", {.diffuse = Vec3f(.86f), .specular = .6f, .shininess = .6f, .mirror = .05f});
    file.look("BLACK", {.diffuse = Vec3f(.04f), .specular = .3f});
    const auto write = [&](const auto& self, const Part& part) -> void {
        file.open({.translation = part.at}, part.joint);
        file.shape(part.surface, part.look);
        for (const Part& child : parts)
            if (std::string_view(child.parent) == part.joint) self(self, child);
        file.close();
    };
    write(write, parts[0]);
    file.raw("] }}\nDEF CLOCK TimeSensor {{ cycleInterval 1.2 loop TRUE startTime IS start stopTime -1 }}\n");
    for (const Part& part : parts) {
        std::string values;
        for (int i = 0; i <= 8; ++i)
            values +=
                fmt::format("1 0 0 {:.4f} ", part.bend + part.swing * std::sin(2 * kPi * static_cast<float>(i) / 8));
        file.raw(
            "DEF {0}_TURN OrientationInterpolator {{ key [ 0 .125 .25 .375 .5 .625 .75 .875 1 ] keyValue [ {1}] }}\n"
            "ROUTE CLOCK.fraction_changed TO {0}_TURN.set_fraction\n"
            "ROUTE {0}_TURN.value_changed TO {0}.rotation\n",
            part.joint, values);
    }
    file.raw("}}\n");
}

}  // namespace

void writeTroopers(SceneFile& file, const Detail& detail) {
    file.look("ARMOUR", {.diffuse = Vec3f(.86f), .specular = .6f, .shininess = .6f, .mirror = .05f});
    file.look("BLACK", {.diffuse = Vec3f(.04f), .specular = .3f});
    file.look("FLOOR", {.diffuse = Vec3f(.24f, .25f, .28f), .specular = .4f, .shininess = .8f, .mirror = .18f});
    file.look("HULL", {.diffuse = Vec3f(.38f, .4f, .44f)});
    file.raw(
        "Background {{ skyColor [ .04 .05 .08 ] }}\nNavigationInfo {{ headlight FALSE }}\n"
        "DirectionalLight {{ direction -.4 -1 -.5 intensity .8 ambientIntensity .3 }}\n"
        "Viewpoint {{ position -5.5 3.4 10.5 orientation -.43 -.88 -.2 .56 fieldOfView .8 description \"Gallery\" "
        "}}\n");
    file.shape(patch(1, 1, [](float u, float v) { return Vec3f(60 * v - 30, 0, 60 * u - 40); }), "FLOOR");
    Surface hull;
    for (int i = 0; i < 9; ++i) hull.add(boxAt({-14 + 3.5f * static_cast<float>(i), 3, -22}, {1.2f, 6, 1.2f}));
    file.shape(hull, "HULL");

    const std::uint64_t before = file.counted();
    writeTrooper(file);
    const std::uint64_t figure = file.counted() - before;
    const int figures = detail.count(48, 2);
    for (int i = 0; i < figures; ++i) {
        const int row = i / 8, column = i % 8;
        file.raw("Trooper {{ at {} 0 {} start {} }}\n", 1.15f * static_cast<float>(column) - 4,
                 5 - 1.7f * static_cast<float>(row), -.02 * static_cast<double>(column % 3 + row % 2));
        if (i > 0) file.count(figure);
    }
}

void writeEscherknot(SceneFile& file, const Detail& detail) {
    const int around = 3 * std::max(8, detail.lines(64, 8)), section = std::max(4, detail.lines(12, 4));
    // A trefoil whose four-sided tube twists; a third of the way along it looks as from the start, but turned.
    const auto knot = [](float u, float v) {
        const float t = 2 * kPi * u;
        const auto spine = [](float s) {
            return Vec3f((2 + std::cos(3 * s)) * std::cos(2 * s), (2 + std::cos(3 * s)) * std::sin(2 * s),
                         1.1f * std::sin(3 * s));
        };
        const Vec3f at = spine(t), ahead = glm::normalize(spine(t + .001f) - spine(t - .001f));
        const Vec3f out = glm::normalize(Vec3f(at.x, at.y, 0)), side = glm::normalize(glm::cross(ahead, out)),
                    up = glm::cross(side, ahead);
        const float a = 2 * kPi * v, twist = 3 * t / 4 * 1.3333333f;
        const float c = signedPower(std::cos(a), .55f), s = signedPower(std::sin(a), .55f);
        return at + .48f * ((c * std::cos(twist) - s * std::sin(twist)) * side +
                            (c * std::sin(twist) + s * std::cos(twist)) * up);
    };
    const Surface first = patch(around, section, knot);
    const Surface second = patch(around, section, [&](float u, float v) { return knot(u + 1.0f / 3, v); });
    file.look("KNOT", {.diffuse = {.25f, .42f, .66f}, .specular = .6f, .shininess = .6f});
    file.look("FLOOR", {.diffuse = Vec3f(.75f, .72f, .66f)});
    file.raw(
        "Background {{ skyColor [ .82 .85 .88 ] }}\nNavigationInfo {{ headlight FALSE }}\n"
        "DirectionalLight {{ direction -.4 -.5 -1 intensity .85 ambientIntensity .35 }}\n"
        "Viewpoint {{ position 0 0 10.5 description \"Front\" }}\n");
    file.raw(
        "Shape {{ appearance USE KNOT geometry DEF KNOT_FACES IndexedTriangleSet {{ solid FALSE\ncoord DEF KNOT_POINTS "
        "Coordinate {{ point [\n");
    file.points(first.points);
    file.raw("] }} index [ ");
    for (const std::int32_t i : first.triangles) file.raw("{} ", i);
    file.raw("] }} }}\n");
    file.count(first.triangleCount());
    file.raw(
        "DEF KNOT_CLOCK TimeSensor {{ cycleInterval 6 loop TRUE }}\nDEF KNOT_SHAPE CoordinateInterpolator {{ key [ 0 1 "
        "] keyValue [\n");
    file.points(first.points);
    file.points(second.points);
    file.raw(
        "] }}\nROUTE KNOT_CLOCK.fraction_changed TO KNOT_SHAPE.set_fraction\nROUTE KNOT_SHAPE.value_changed TO "
        "KNOT_POINTS.point\n");
}

}  // namespace rtsg::bench
