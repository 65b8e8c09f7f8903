// Beetles: a car park full of one kind of car, whose parts are shared (DEF/USE) and whose paint is not.
#include <numbers>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// Height over x by points, joined smoothly.
float heightAt(const std::vector<Vec3f>& line, float x) {
    for (std::size_t i = 1; i < line.size(); ++i)
        if (x <= line[i].x || i + 1 == line.size()) {
            const float f = std::clamp((x - line[i - 1].x) / (line[i].x - line[i - 1].x), 0.0f, 1.0f);
            return glm::mix(line[i - 1].y, line[i].y, f * f * (3 - 2 * f));
        }
    return line.back().y;
}

Vec3f bodyAt(float u, float v) {
    static const std::vector<Vec3f> top = {{-2.04f, .5f, 0}, {-1.5f, .9f, 0},  {-.8f, .98f, 0}, {.8f, .98f, 0},
                                           {1.4f, .88f, 0},  {1.85f, .62f, 0}, {2.04f, .48f, 0}};
    const float x = -2.02f * std::cos(kPi * u), s = x / 2.05f;
    const float width = .66f * std::sqrt(std::max(0.0f, 1 - s * s * s * s)), angle = kPi * v;
    const float height = (heightAt(top, x) - .26f) * std::sqrt(std::max(0.0f, 1 - std::pow(s, 8.0f)));
    return {x, .26f + height * std::pow(std::max(0.0f, std::sin(angle)), .55f),
            width * signedPower(std::cos(angle), .55f)};
}

Vec3f cabinAt(float u, float v) {
    static const std::vector<Vec3f> roof = {{-1.75f, .72f, 0}, {-1.2f, 1.16f, 0}, {-.55f, 1.46f, 0},
                                            {.1f, 1.5f, 0},    {.5f, 1.38f, 0},   {.95f, .8f, 0}};
    const float x = -.4f - 1.35f * std::cos(kPi * u), angle = kPi * v;
    const float s = (x + .4f) / 1.36f, rise = std::pow(std::max(0.0f, std::sin(angle)), .7f);
    const float width = (.64f - .1f * rise) * std::sqrt(std::max(0.0f, 1 - s * s * s * s));
    return {x, .6f + (heightAt(roof, x) - .6f) * rise, width * signedPower(std::cos(angle), .7f)};
}

/// A part of the cabin, a little outside it.
Surface window(int n, float u0, float u1, float v0, float v1) {
    return patch(n, n, [=](float u, float v) {
        const Vec3f p = cabinAt(glm::mix(u0, u1, u), glm::mix(v0, v1, v)), centre(-.4f, .8f, 0);
        return centre + (p - centre) * 1.012f;
    });
}

}  // namespace

BeetleCar beetleCar(const Detail& detail) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    BeetleCar car;
    car.body = patch(n(200), n(84), bodyAt);
    car.body.add(patch(n(100), n(52), cabinAt));
    for (const float z : {-.62f, .62f}) {
        car.body.add(ellipsoid({1.27f, .46f, z}, {.52f, .36f, .19f}, n(44), n(22), .85f));
        car.body.add(ellipsoid({-1.27f, .46f, z}, {.5f, .38f, .19f}, n(44), n(22), .85f));
        car.rubber.add(boxAt({0, .26f, z * 1.1f}, {1.6f, .06f, .2f}));
        for (const float x : {-1.27f, 1.27f}) {
            car.rubber.add(torus({x, .31f, z * 1.12f}, .22f, .09f, n(44, 6), n(18)));
            car.chrome.add(ellipsoid({x, .31f, z * 1.2f}, {.16f, .16f, .05f}, n(24), n(10)));
        }
        car.chrome.add(ellipsoid({1.68f, .66f, z * .93f}, {.09f, .14f, .14f}, n(24), n(12)));
        car.rubber.add(ellipsoid({-1.7f, .62f, z * .95f}, {.05f, .1f, .08f}, n(16), n(8)));
    }
    for (const float x : {-1, 1})
        car.chrome.add(
            tube([=](float t) { return Vec3f(x * (2.12f - .5f * std::pow(2 * t - 1, 4.0f)), .38f, 1.5f * t - .75f); },
                 [](float) { return .045f; }, n(60), n(12)));
    for (const auto& [v0, v1] : {std::pair{.07f, .22f}, {.78f, .93f}}) {
        car.glass.add(window(n(20), .36f, .56f, v0, v1));
        car.glass.add(window(n(20), .585f, .76f, v0, v1));
    }
    car.glass.add(window(n(24), .8f, .9f, .24f, .76f));
    car.glass.add(window(n(16), .17f, .26f, .33f, .67f));
    return car;
}

void writeBeetles(SceneFile& file, const Detail& detail) {
    // Half of the reduction in the number of cars, half in their detail.
    const Detail half{std::sqrt(detail.scale)};
    constexpr Vec3f colours[] = {{.72f, .05f, .04f}, {.85f, .62f, .1f}, {.07f, .22f, .5f}, {.75f, .75f, .7f},
                                 {.05f, .3f, .16f},  {.35f, .6f, .7f},  {.1f, .1f, .11f},  {.8f, .4f, .1f}};
    for (int i = 0; i < 8; ++i)
        file.look(fmt::format("PAINT{}", i),
                  {.diffuse = colours[i], .specular = .8f, .shininess = .8f, .mirror = .12f});
    file.look("GLASS", {.diffuse = Vec3f(.03f, .04f, .05f), .specular = .9f, .shininess = .9f, .mirror = .35f});
    file.look("RUBBER", {.diffuse = Vec3f(.03f), .specular = .1f});
    file.look("CHROME", {.diffuse = Vec3f(.25f), .specular = .9f, .shininess = .9f, .mirror = .6f});
    file.look("ASPHALT", {.diffuse = Vec3f(.23f, .23f, .24f)});
    file.look("LINE", {.diffuse = Vec3f(.85f)});
    file.look("WALL", {.diffuse = Vec3f(.62f, .5f, .4f)});
    file.raw(
        "Background {{ skyColor [ .2 .42 .75, .55 .7 .88, .85 .88 .9 ] skyAngle [ 1, 1.57 ] groundColor [ .3 .3 .3 ] "
        "}}\n"
        "NavigationInfo {{ headlight FALSE }}\n"
        "DirectionalLight {{ direction -.5 -1 -.35 intensity .85 ambientIntensity .35 }}\n"
        "Viewpoint {{ position 9.5 3.4 11 orientation -.24 .96 .11 .72 fieldOfView .75 description \"Car park\" }}\n");
    Surface ground = patch(1, 1, [](float u, float v) { return Vec3f(120 * v - 60, 0, 120 * u - 60); });
    file.shape(ground, "ASPHALT");
    file.shape(boxAt({-8, 1.6f, -21}, {60, 3.2f, .4f}), "WALL");

    const BeetleCar car = beetleCar(half);
    const int cars = half.count(35, 2);
    Surface lines;
    for (int i = 0; i < cars; ++i) {
        const int row = i / 8, column = i % 8;
        const Vec3f at(static_cast<float>(5 - 6 * row), 0, static_cast<float>(5 - 3 * column));
        lines.add(boxAt(at + Vec3f(0, .005f, 1.5f), {4.6f, .01f, .1f}));
        const float angle = row % 2 ? kPi : .05f * std::sin(7.0f * static_cast<float>(i));
        file.open({.translation = at, .rotation = {0, 1, 0, angle}});
        const std::string paint = fmt::format("PAINT{}", (i * 5 + row) % 8);
        if (i == 0) {
            file.shape(car.body, paint, SceneFile::Shading::smooth, "BODY");
            file.open({}, "TRIM");
            file.shape(car.glass, "GLASS", SceneFile::Shading::smooth);
            file.shape(car.rubber, "RUBBER", SceneFile::Shading::smooth);
            file.shape(car.chrome, "CHROME", SceneFile::Shading::smooth);
            file.close();
        } else {
            file.shapeOf("BODY", paint);
            file.use("TRIM");
        }
        file.close();
    }
    file.shape(lines, "LINE");
}

}  // namespace rtsg::bench
