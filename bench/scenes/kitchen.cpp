// Kitchen: cupboards, a table, things of steel and of glass, and a toy car that drives around the floor.
#include <numbers>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
using Shading = SceneFile::Shading;

/// A door or drawer front in the plane z = 0 from the origin, with a rounded rim and a knob.
void front(Surface& wood, Surface& steel, Vec3f at, float w, float h, int n) {
    wood.add(box(at, at + Vec3f(w, h, .02f)));
    const Vec3f in(.05f, .05f, .02f);
    const Vec3f corners[] = {at + in, at + Vec3f(w - in.x, in.y, in.z), at + Vec3f(w - in.x, h - in.y, in.z),
                             at + Vec3f(in.x, h - in.y, in.z)};
    for (int i = 0; i < 4; ++i)
        wood.add(tube([&](float t) { return glm::mix(corners[i], corners[(i + 1) % 4], t); },
                      [](float) { return .01f; }, n, std::max(4, n / 2)));
    steel.add(ellipsoid(at + Vec3f(w * .5f, h * .85f, .045f), Vec3f(.018f), n, std::max(4, n / 2)));
}

void chair(SceneFile& file, Vec3f at, float angle, int n) {
    file.open({.translation = at, .rotation = {0, 1, 0, angle}});
    Surface s = ellipsoid({0, .46f, 0}, {.21f, .02f, .21f}, n * 2, n, .5f);
    for (const float x : {-.17f, .17f})
        for (const float z : {-.17f, .17f}) s.add(rod({x, 0, z * 1.1f}, {x, z < 0 ? .95f : .46f, z}, .018f, n, 2));
    for (int i = 0; i < 3; ++i)
        s.add(rod({-.17f, .62f + .14f * static_cast<float>(i), -.17f},
                  {.17f, .62f + .14f * static_cast<float>(i), -.17f}, .02f, n, 6));
    file.shape(s, "PINE", Shading::smooth);
    file.close();
}

/// Adds materials, lights and the viewpoint.
void addLooks(SceneFile& file) {
    file.look("TILE0", {.diffuse = {.78f, .76f, .7f}, .specular = .4f, .shininess = .7f, .mirror = .1f});
    file.look("TILE1", {.diffuse = {.3f, .42f, .48f}, .specular = .4f, .shininess = .7f, .mirror = .1f});
    file.look("WALL", {.diffuse = {.85f, .78f, .6f}});
    file.look("WHITE", {.diffuse = Vec3f(.85f)});
    file.look("WOOD", {.diffuse = {.55f, .33f, .16f}, .specular = .2f, .shininess = .4f});
    file.look("PINE", {.diffuse = {.72f, .52f, .28f}, .specular = .2f, .shininess = .4f});
    file.look("STEEL", {.diffuse = Vec3f(.18f), .specular = .9f, .shininess = .9f, .mirror = .65f});
    file.look("GRANITE", {.diffuse = Vec3f(.12f, .13f, .13f), .specular = .6f, .shininess = .8f, .mirror = .15f});
    file.look("CLEAR",
              {.diffuse = Vec3f(.01f), .specular = .8f, .shininess = .95f, .refraction = 1.5f, .transparency = .97f});
    file.look("ORANGE", {.diffuse = {.9f, .45f, .05f}, .specular = .3f});
    file.look("APPLE", {.diffuse = {.6f, .08f, .05f}, .specular = .6f, .shininess = .7f});
    file.look("TOY", {.diffuse = {.8f, .07f, .06f}, .specular = .8f, .shininess = .8f, .mirror = .15f});
    file.look("GLASS", {.diffuse = Vec3f(.03f), .specular = .9f, .shininess = .9f, .mirror = .3f});
    file.look("RUBBER", {.diffuse = Vec3f(.03f)});
    file.look("CHROME", {.diffuse = Vec3f(.25f), .specular = .9f, .shininess = .9f, .mirror = .6f});
    file.look("LAMP", {.diffuse = Vec3f(0), .emissive = Vec3f(1, .95f, .8f)});
    file.raw(
        "NavigationInfo {{ headlight FALSE }}\n"
        "PointLight {{ location .4 2.3 .3 intensity .7 attenuation 1 .03 .02 radius 30 ambientIntensity .3 }}\n"
        "PointLight {{ location -1.8 2.4 1.9 intensity .35 attenuation 1 .03 .02 radius 30 }}\n"
        "Viewpoint {{ position -1.75 1.75 2.65 orientation -.48 -.86 -.16 .72 fieldOfView .95 description \"Door\" "
        "}}\n");
}

/// 5 x 2.6 x 6 m; floor tiles with bevels.
void addRoom(SceneFile& file) {
    file.shape(box({-2.6f, 0, -3.1f}, {-2.5f, 2.6f, 3.1f}).add(box({2.5f, 0, -3.1f}, {2.6f, 2.6f, 3.1f})), "WALL");
    file.shape(box({-2.5f, 0, -3.1f}, {2.5f, 2.6f, -3}).add(box({-2.5f, 0, 3}, {2.5f, 2.6f, 3.1f})), "WALL");
    file.shape(box({-2.6f, 2.6f, -3.1f}, {2.6f, 2.7f, 3.1f}), "WHITE");
    Surface tiles[2];
    for (int x = 0; x < 10; ++x)
        for (int z = 0; z < 12; ++z)
            tiles[(x + z) % 2].add(
                boxAt({-2.25f + .5f * static_cast<float>(x), -.01f, -2.75f + .5f * static_cast<float>(z)},
                      {.494f, .02f, .494f}));
    for (int i = 0; i < 2; ++i) file.shape(tiles[i], fmt::format("TILE{}", i));
    file.shape(box({-2.5f, -.1f, -3}, {2.5f, -.012f, 3}), "GRANITE");
}

/// Along the far wall, below and above, with a worktop, a hob and a sink; pots of steel on the hob.
void addCupboards(SceneFile& file, const Detail& detail) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    Surface wood, steel;
    wood.add(box({-2.5f, .1f, -3}, {1.5f, .88f, -2.42f})).add(box({-2.5f, 1.5f, -3}, {1.5f, 2.3f, -2.65f}));
    for (int i = 0; i < 8; ++i) {
        const float x = -2.5f + .5f * static_cast<float>(i);
        front(wood, steel, {x + .01f, .12f, -2.42f}, .48f, .55f, n(11));
        front(wood, steel, {x + .01f, .69f, -2.42f}, .48f, .18f, n(11));
        if (i != 3) front(wood, steel, {x + .01f, 1.51f, -2.65f}, .48f, .78f, n(11));
    }
    file.shape(wood, "WOOD");
    file.shape(steel, "STEEL", Shading::smooth);
    file.shape(box({-2.5f, .88f, -3}, {1.5f, .92f, -2.38f}), "GRANITE");
    Surface plates;
    for (int i = 0; i < 4; ++i)
        plates.add(torus({0, 0, 0}, .09f, .012f, n(36), n(10)).transform([=](Vec3f p) {
            return Vec3f(-.85f + .28f * static_cast<float>(i % 2) + p.x, .935f + p.z,
                         -2.83f + .28f * static_cast<float>(i / 2) + p.y);
        }));
    file.shape(plates, "RUBBER", Shading::smooth);
    Surface sink = patch(n(36), n(24), [](float u, float v) {
        const float a = 2 * kPi * u, r = .21f * v;
        return Vec3f(.6f + 1.3f * r * signedPower(std::cos(a), .5f), .925f - .0f * r,
                     -2.7f + r * signedPower(std::sin(a), .5f));
    });
    const std::vector<Vec3f> tap = {
        {.6f, .92f, -2.93f}, {.6f, 1.12f, -2.94f}, {.6f, 1.24f, -2.86f}, {.6f, 1.2f, -2.74f}, {.6f, 1.12f, -2.72f}};
    sink.add(tube([&](float t) { return along(tap, t); }, [](float) { return .015f; }, n(40), n(14)));
    file.shape(sink, "STEEL", Shading::smooth);
    Surface fridge = ellipsoid({2.08f, 1.0f, -2.6f}, {.36f, .98f, .38f}, n(48), n(30), .12f);
    fridge.add(rod({1.8f, .9f, -2.18f}, {1.8f, 1.6f, -2.18f}, .018f, n(14), 4));
    file.shape(fridge, "STEEL", Shading::smooth);

    const Profile potLine = {{.001f, 0},     {.1f, 0},      {.115f, .02f}, {.12f, .13f},
                             {.128f, .135f}, {.114f, .13f}, {.108f, .02f}, {.001f, .012f}};
    for (int i = 0; i < 5; ++i) {
        Surface pot = lathe(potLine, n(60), n(32));
        pot.add(rod({.12f, .11f, 0}, {.3f, .12f, 0}, .012f, n(12), 3));
        const float size = .75f + .12f * static_cast<float>(i % 4);
        const Vec3f at = i < 2 ? Vec3f(-.85f + .28f * static_cast<float>(i), .95f, -2.55f)
                               : Vec3f(-2.2f + .38f * static_cast<float>(i - 2), .92f, -2.72f);
        file.shape(pot.scale(Vec3f(size)).rotate(.8f * static_cast<float>(i)).move(at), "STEEL", Shading::smooth);
    }
}

/// Glasses and a carafe, and fruit in a bowl of glass.
void addTable(SceneFile& file, const Detail& detail, const Vec3f& table) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    file.shape(ellipsoid(table, {.62f, .025f, .95f}, n(72), n(16), .4f), "PINE", Shading::smooth);
    Surface legs;
    for (const float x : {-.48f, .48f})
        for (const float z : {-.78f, .78f})
            legs.add(rod(Vec3f(table.x + x, 0, table.z + z), Vec3f(table.x + x, .72f, table.z + z), .035f, n(16), 2));
    file.shape(legs, "PINE", Shading::smooth);
    const Profile glass = {{.001f, 0},    {.034f, 0},   {.036f, .01f}, {.008f, .016f}, {.007f, .07f},  {.03f, .1f},
                           {.042f, .15f}, {.038f, .2f}, {.035f, .2f},  {.039f, .15f},  {.027f, .104f}, {.001f, .085f}};
    for (int i = 0; i < 6; ++i) {
        const float a = kPi / 3 * static_cast<float>(i);
        file.shape(lathe(glass, n(52), n(40)).move(table + Vec3f(.4f * std::cos(a), .025f, .6f * std::sin(a))), "CLEAR",
                   Shading::smooth);
    }
    const Profile carafe = {{.001f, 0},    {.07f, 0},     {.085f, .04f}, {.06f, .16f},  {.03f, .22f},  {.045f, .29f},
                            {.041f, .29f}, {.026f, .22f}, {.055f, .16f}, {.079f, .04f}, {.001f, .012f}};
    file.shape(lathe(carafe, n(52), n(40)).move(table + Vec3f(-.12f, .025f, -.3f)), "CLEAR", Shading::smooth);
    const Profile bowl = {{.001f, 0},    {.07f, 0},      {.15f, .05f},   {.2f, .12f},
                          {.195f, .12f}, {.145f, .055f}, {.065f, .008f}, {.001f, .008f}};
    file.shape(lathe(bowl, n(64), n(40)).move(table + Vec3f(0, .025f, .15f)), "CLEAR", Shading::smooth);
    Dice dice(5);
    for (int i = 0; i < 7; ++i) {
        const float a = 2 * kPi * static_cast<float>(i) / 6;
        const Vec3f at =
            table + Vec3f(0, .08f, .15f) +
            (i == 6 ? Vec3f(0, .09f, 0) : Vec3f(.085f * std::cos(a), .005f * dice.in(0, 4), .085f * std::sin(a)));
        file.shape(ellipsoid(at, Vec3f(.045f), n(32), n(20)), i % 2 ? "ORANGE" : "APPLE", Shading::smooth);
    }
}

/// The beetle at a twelfth, driving an oval on the floor.
void addToy(SceneFile& file, const Detail& detail) {
    BeetleCar car = beetleCar(Detail{detail.scale * .24});
    file.open({.translation = {-1.7f, 0, -.3f}}, "TOY_CAR");
    file.open({.scale = Vec3f(.11f)});
    file.shape(car.body, "TOY", Shading::smooth);
    file.shape(car.glass, "GLASS", Shading::smooth);
    file.shape(car.rubber, "RUBBER", Shading::smooth);
    file.shape(car.chrome, "CHROME", Shading::smooth);
    file.close();
    file.close();
    std::string keys, positions, rotations;
    for (int i = 0; i <= 32; ++i) {
        const float t = static_cast<float>(i) / 32, a = 2 * kPi * t;
        keys += fmt::format("{} ", t);
        positions += fmt::format("{:.4f} 0 {:.4f} ", -.95f - .75f * std::cos(a), -.3f + 1.4f * std::sin(a));
        rotations += fmt::format("0 1 0 {:.4f} ", std::atan2(-1.4f * std::cos(a), .75f * std::sin(a)));
    }
    file.raw(
        "DEF TOY_CLOCK TimeSensor {{ cycleInterval 8 loop TRUE }}\n"
        "DEF TOY_PATH PositionInterpolator {{ key [ {0}] keyValue [ {1}] }}\n"
        "DEF TOY_TURN OrientationInterpolator {{ key [ {0}] keyValue [ {2}] }}\n"
        "ROUTE TOY_CLOCK.fraction_changed TO TOY_PATH.set_fraction\n"
        "ROUTE TOY_CLOCK.fraction_changed TO TOY_TURN.set_fraction\n"
        "ROUTE TOY_PATH.value_changed TO TOY_CAR.translation\n"
        "ROUTE TOY_TURN.value_changed TO TOY_CAR.rotation\n",
        keys, positions, rotations);
}

}  // namespace

void writeKitchen(SceneFile& file, const Detail& detail) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    addLooks(file);
    addRoom(file);
    addCupboards(file, detail);
    const Vec3f table(.75f, .74f, .2f);
    addTable(file, detail, table);
    chair(file, table + Vec3f(-.8f, -.74f, -.3f), kPi / 2, n(11));
    chair(file, table + Vec3f(-.85f, -.74f, .45f), kPi / 2 + .3f, n(11));
    chair(file, table + Vec3f(.8f, -.74f, -.35f), -kPi / 2, n(11));
    chair(file, table + Vec3f(.1f, -.74f, 1.25f), kPi, n(11));
    Surface lamp = lathe({{.02f, .22f}, {.06f, .2f}, {.2f, .04f}, {.26f, 0}, {.25f, 0}, {.19f, .04f}, {.001f, .19f}},
                         n(48), n(24));
    lamp.add(rod({0, .2f, 0}, {0, .75f, 0}, .008f, n(8)));
    file.shape(lamp.move(table + Vec3f(0, 1.1f, 0)), "STEEL", Shading::smooth);
    file.shape(ellipsoid(table + Vec3f(0, 1.16f, 0), Vec3f(.06f), n(24), n(14)), "LAMP", Shading::smooth);
    addToy(file, detail);
}

}  // namespace rtsg::bench
