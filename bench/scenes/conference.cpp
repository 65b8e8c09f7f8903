// Conference: a room with a table, 22 chairs, panelled walls and lamps, nothing shared. And the teapot.
#include <numbers>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
using Shading = SceneFile::Shading;

struct Chair {
    Surface cushions, frame;
};

/// Looks towards +z; about 9,600 triangles.
Chair chair(const Detail& d) {
    const auto n = [&](int full, int minimum = 4) { return d.lines(full, minimum); };
    Chair c;
    c.cushions = ellipsoid({0, .48f, 0}, {.27f, .07f, .26f}, n(40), n(20), .4f);
    Surface back = ellipsoid({0, 0, 0}, {.25f, .33f, .055f}, n(38), n(20), .45f);
    back.transform([](Vec3f p) { return Vec3f(p.x, p.y + .88f, p.z - .25f - .25f * p.y * p.y + .25f * p.x * p.x); });
    c.cushions.add(back);
    for (const float side : {-1.0f, 1.0f}) {
        const std::vector<Vec3f> arm = {{side * .2f, .45f, -.2f}, {side * .31f, .5f, -.18f}, {side * .32f, .68f, -.16f},
                                        {side * .32f, .7f, .1f},  {side * .31f, .58f, .2f},  {side * .24f, .46f, .16f}};
        c.frame.add(tube([=](float t) { return along(arm, t); }, [](float) { return .018f; }, n(32), n(9)));
        c.cushions.add(ellipsoid({side * .32f, .71f, -.02f}, {.035f, .02f, .15f}, n(20), n(10), .6f));
    }
    c.frame.add(rod({0, .1f, 0}, {0, .44f, 0}, .03f, n(20), 2));
    for (int leg = 0; leg < 5; ++leg) {
        const float a = 2 * kPi * static_cast<float>(leg) / 5 + .3f;
        const Vec3f end(.3f * std::cos(a), .06f, .3f * std::sin(a));
        c.frame.add(tube([=](float t) { return glm::mix(Vec3f(0, .12f, 0), end, t); },
                         [](float t) { return .028f - .01f * t; }, n(10), n(12)));
        c.frame.add(ellipsoid(end - Vec3f(0, .03f, 0), {.03f, .03f, .03f}, n(14), n(8)));
    }
    return c;
}

/// A wall panel in the plane z = 0, w x h, with a moulded rim.
Surface panel(float w, float h, int n) {
    Surface out = patch(1, 1, [=](float u, float v) { return Vec3f(w * u, h * v, 0); });
    const Vec3f corners[] = {{0, 0, 0}, {w, 0, 0}, {w, h, 0}, {0, h, 0}};
    for (int i = 0; i < 4; ++i)
        out.add(tube([&](float t) { return glm::mix(corners[i], corners[(i + 1) % 4], t); }, [](float) { return .02f; },
                     n, std::max(4, n / 2)));
    return out;
}

void addLooks(SceneFile& file) {
    file.look("CARPET", {.diffuse = {.32f, .25f, .24f}});
    file.look("CEILING", {.diffuse = {.82f, .81f, .78f}});
    file.look("WALL", {.diffuse = {.72f, .68f, .58f}});
    file.look("WOOD", {.diffuse = {.42f, .24f, .12f}, .specular = .3f, .shininess = .4f});
    file.look("TABLE", {.diffuse = {.36f, .18f, .08f}, .specular = .5f, .shininess = .7f, .mirror = .1f});
    file.look("CUSHION", {.diffuse = {.55f, .12f, .1f}});
    file.look("FRAME", {.diffuse = Vec3f(.12f), .specular = .7f, .shininess = .7f, .mirror = .1f});
    file.look("LAMP", {.diffuse = Vec3f(0), .emissive = Vec3f(1, .98f, .9f)});
    file.look("PAPER", {.diffuse = Vec3f(.92f)});
    file.look("CHINA", {.diffuse = Vec3f(.85f, .85f, .9f), .specular = .6f, .shininess = .6f});
    file.look("LEAF", {.diffuse = {.1f, .35f, .08f}});
    file.look("CLAY", {.diffuse = {.55f, .28f, .16f}});
    file.raw(
        "NavigationInfo {{ headlight FALSE }}\n"
        "Viewpoint {{ position -5.1 2.15 3.1 orientation -.16 -.97 -.15 1.06 fieldOfView .95 description \"Door\" "
        "}}\n");
    for (const float x : {-3.6f, 0.0f, 3.6f})
        file.raw(
            "PointLight {{ location {} 2.75 0 intensity .5 ambientIntensity .25 attenuation 1 .04 .02 radius 30 }}\n",
            x);
}

/// 12 x 3 x 8 m.
void addRoom(SceneFile& file, const Detail& detail) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    file.shape(boxAt({0, -.05f, 0}, {12, .1f, 8}), "CARPET");
    file.shape(boxAt({0, 3.05f, 0}, {12, .1f, 8}), "CEILING");
    for (const float side : {-1.0f, 1.0f}) {
        file.shape(boxAt({0, 1.5f, side * 4.05f}, {12.2f, 3, .1f}), "WALL");
        file.shape(boxAt({side * 6.05f, 1.5f, 0}, {.1f, 3, 8}), "WALL");
        for (int i = 0; i < 12; ++i) {
            Surface p = panel(.86f, .9f, n(22));
            p.move({-.43f, .12f, 0}).rotate(side > 0 ? kPi : 0).move({-5.5f + static_cast<float>(i), 0, side * 3.985f});
            file.shape(p, "WOOD");
        }
        for (int i = 0; i < 8; ++i) {
            Surface p = panel(.86f, .9f, n(22));
            p.move({-.43f, .12f, 0}).rotate(-side * kPi / 2).move({side * 5.985f, 0, -3.5f + static_cast<float>(i)});
            file.shape(p, "WOOD");
        }
    }
    for (int x = 0; x < 5; ++x)
        for (int z = 0; z < 3; ++z) {
            const Vec3f at(2.3f * static_cast<float>(x - 2), 2.98f, 2.4f * static_cast<float>(z - 1));
            file.shape(boxAt(at, {1.2f, .03f, .6f}), "LAMP");
            Surface grille;
            for (int i = 0; i < 9; ++i)
                grille.add(boxAt(at + Vec3f(.13f * static_cast<float>(i - 4), -.04f, 0), {.012f, .06f, .6f}));
            file.shape(grille, "FRAME");
        }
    for (int i = 0; i < 4; ++i) {  // pictures on the far wall
        Surface p = panel(1.1f, .8f, n(24));
        p.move({-4.6f + 2.7f * static_cast<float>(i), 1.45f, -3.95f});
        file.shape(p, i % 2 ? "PAPER" : "CUSHION");
    }
}

/// The table, and who sits at it.
void addTable(SceneFile& file, const Detail& detail, Dice& dice) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    file.shape(ellipsoid({0, .73f, 0}, {3.6f, .035f, 1.15f}, n(120), n(18), .5f), "TABLE", Shading::smooth);
    for (const float x : {-2.0f, 0.0f, 2.0f})
        file.shape(ellipsoid({x, .35f, 0}, {.35f, .36f, .45f}, n(48), n(24), .3f), "WOOD", Shading::smooth);
    for (int i = 0; i < 22; ++i) {
        const bool end = i >= 20;
        const float side = i % 2 ? 1.0f : -1.0f, position = static_cast<float>(i / 2) * .62f - 2.8f;
        const Vec3f at = end ? Vec3f(side * 4.15f, 0, 0) : Vec3f(position, 0, side * 1.6f);
        const float facing = end ? -side * kPi / 2 : side > 0 ? kPi : 0.0f;
        Chair c = chair(detail);
        const float angle = facing + dice.in(-.35f, .35f);
        for (Surface* s : {&c.cushions, &c.frame}) s->rotate(angle).move(at);
        file.shape(c.cushions, "CUSHION", Shading::smooth);
        file.shape(c.frame, "FRAME", Shading::smooth);
        const Vec3f desk = end ? Vec3f(side * 2.9f, .77f, 0) : Vec3f(position * .97f, .77f, side * .72f);
        Surface sheet = boxAt({0, 0, 0}, {.21f, .004f, .3f});
        file.shape(sheet.rotate(dice.in(-.3f, .3f)).move(desk), "PAPER");
        const Vec3f cup = desk + Vec3f(.2f, -.005f, -side * .12f);
        Surface china =
            lathe({{.001f, 0}, {.025f, 0}, {.04f, .03f}, {.043f, .08f}, {.038f, .08f}, {.034f, .03f}, {.001f, .01f}},
                  n(24), n(14));
        file.shape(china.move(cup), "CHINA", Shading::smooth);
    }
}

/// In the corners.
void addPlants(SceneFile& file, const Detail& detail, Dice& dice) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    for (const float x : {-5.4f, 5.4f}) {
        Surface pot = lathe({{.001f, 0}, {.16f, 0}, {.22f, .4f}, {.2f, .4f}, {.001f, .34f}}, n(32), n(12));
        file.shape(pot.move({x, 0, -3.4f}), "CLAY", Shading::smooth);
        Surface leaves;
        for (int i = 0; i < detail.count(90, 6); ++i) {
            const float a = dice.in(0, 2 * kPi), reach = dice.in(.2f, .55f), rise = dice.in(.3f, 1.1f);
            leaves.add(patch(6, 2, [=](float u, float v) {
                const float r = reach * u, w = .06f * std::sin(kPi * u) * (2 * v - 1);
                return Vec3f(r * std::cos(a) - w * std::sin(a), rise * u * (1.6f - .6f * u * u),
                             r * std::sin(a) + w * std::cos(a));
            }));
        }
        file.shape(leaves.move({x, .36f, -3.4f}), "LEAF", Shading::smooth);
    }
}

}  // namespace

void writeTeapot(SceneFile& file, const Placement& placement, const Detail& detail) {
    const auto n = [&](int full) { return detail.lines(full, 5); };
    file.look("TEAPOT", {.diffuse = {.62f, .3f, .12f}, .specular = .8f, .shininess = .7f, .mirror = .15f});
    Surface pot = lathe({{.001f, 0},
                         {.9f, 0},
                         {1.05f, .06f},
                         {1.45f, .45f},
                         {1.5f, .75f},
                         {1.38f, 1.15f},
                         {1.12f, 1.5f},
                         {1.0f, 1.58f}},
                        n(48), n(28));
    pot.add(lathe({{1.0f, 1.56f},
                   {.96f, 1.63f},
                   {.6f, 1.74f},
                   {.2f, 1.83f},
                   {.1f, 1.9f},
                   {.2f, 2.02f},
                   {.16f, 2.13f},
                   {.001f, 2.17f}},
                  n(40), n(22)));
    const std::vector<Vec3f> spout = {
        {1.25f, .55f, 0}, {1.75f, .7f, 0}, {2.0f, 1.05f, 0}, {2.25f, 1.45f, 0}, {2.6f, 1.58f, 0}};
    pot.add(tube([&](float t) { return along(spout, t); }, [](float t) { return .38f * (1 - t) * (1 - t) + .13f; },
                 n(26), n(16)));
    const std::vector<Vec3f> handle = {
        {-1.15f, 1.4f, 0}, {-1.75f, 1.42f, 0}, {-2.1f, 1.2f, 0}, {-1.95f, .75f, 0}, {-1.3f, .42f, 0}};
    pot.add(tube([&](float t) { return along(handle, t); }, [](float) { return .12f; }, n(24), n(12)));
    file.open(placement);
    file.open({}, "TEAPOT_TURN");
    file.shape(pot, "TEAPOT", Shading::smooth);
    file.close();
    file.close();
    file.raw(
        "DEF TEAPOT_CLOCK TimeSensor {{ cycleInterval 4 loop TRUE }}\n"
        "DEF TEAPOT_PATH OrientationInterpolator {{ key [ 0 .25 .5 .75 1 ] keyValue [ 0 1 0 0, 0 1 0 1.5708, "
        "0 1 0 3.14159, 0 1 0 4.71239, 0 1 0 6.28318 ] }}\n"
        "ROUTE TEAPOT_CLOCK.fraction_changed TO TEAPOT_PATH.set_fraction\n"
        "ROUTE TEAPOT_PATH.value_changed TO TEAPOT_TURN.rotation\n");
}

void writeConference(SceneFile& file, const Detail& detail) {
    addLooks(file);
    addRoom(file, detail);
    Dice dice(22);
    addTable(file, detail, dice);
    addPlants(file, detail, dice);
}

}  // namespace rtsg::bench
