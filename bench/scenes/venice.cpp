// Venice: a canal between two rows of palaces, windows of mirrors and of glass, three statues on a quay, large
// textures.
#include <numbers>

#include <rtsg/renderers/picture.h>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
using Shading = SceneFile::Shading;

Vec3f brickAt(float u, float v) {
    const float row = std::floor(v * 48), x = u * 16 + (static_cast<int>(row) % 2 ? .5f : 0), y = v * 48 - row;
    const float fx = x - std::floor(x);
    const bool joint = fx < .04f || y < .1f;
    const float tone =
        .75f + .25f * noise(Vec3f(std::floor(x) * 3.7f, row * 5.3f, 1)) + .12f * noise(Vec3f(u * 300, v * 300, 2));
    return joint ? Vec3f(.55f, .5f, .44f) * (.8f + .2f * tone) : Vec3f(.5f, .2f, .13f) * tone;
}
Vec3f plasterAt(float u, float v) {
    const float patchy = noise(Vec3f(u * 5, v * 5, 3)) + .5f * noise(Vec3f(u * 17, v * 17, 4)),
                grain = noise(Vec3f(u * 400, v * 400, 5));
    const Vec3f colour = glm::mix(Vec3f(.72f, .5f, .3f), Vec3f(.8f, .66f, .48f), std::clamp(.5f + patchy, 0.0f, 1.0f)) *
                         (1 + .06f * grain);
    return patchy < -.75f ? brickAt(u, v) : colour;
}
Vec3f stoneAt(float u, float v) {
    const float x = u * 8, y = v * 8, fx = x - std::floor(x), fy = y - std::floor(y);
    const float tone = .7f + .15f * noise(Vec3f(std::floor(x) * 1.3f, std::floor(y) * 2.1f, 6)) +
                       .1f * noise(Vec3f(u * 90, v * 90, 7)) + .05f * noise(Vec3f(u * 500, v * 500, 8));
    return fx < .02f || fy < .02f ? Vec3f(.3f, .29f, .27f) : Vec3f(.8f, .77f, .7f) * tone;
}

Result<> writeTexture(const std::filesystem::path& file, int side, Vec3f (*colour)(float, float)) {
    Picture picture(side, side);
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const Vec3f c = colour(static_cast<float>(x) / static_cast<float>(side),
                                   static_cast<float>(y) / static_cast<float>(side));
            // The colours above are meant as seen; the picture is linear.
            picture.at(x, y) = {linearFromSrgb(c.x), linearFromSrgb(c.y), linearFromSrgb(c.z), 1};
        }
    return writePicture(picture, file);
}

/// A robed figure on a pedestal, about 2 nu nv triangles.
Surface statue(int nu, int nv, int kind) {
    const Profile robe = {{.001f, 0},    {.62f, 0},    {.66f, .1f},  {.52f, .5f},   {.42f, 1.1f},
                          {.36f, 1.55f}, {.44f, 2.0f}, {.46f, 2.3f}, {.3f, 2.5f},   {.13f, 2.6f},
                          {.12f, 2.7f},  {.2f, 2.85f}, {.22f, 3.0f}, {.16f, 3.18f}, {.001f, 3.24f}};
    std::vector<Vec3f> line;
    for (const Vec2f& p : robe) line.emplace_back(p.x, p.y, 0);
    const auto k = static_cast<float>(kind);
    Surface s = patch(nu, nv, [&](float u, float v) {
        const Vec3f p = along(line, u);
        const float a = 2 * kPi * v, cloth = std::clamp(2.5f - p.y, 0.0f, 1.0f);
        const float folds =
            .07f * cloth * std::sin(14 * a + 3 * std::sin(2.3f * p.y + k)) + .03f * cloth * std::sin(31 * a + 4 * p.y);
        const float fine = .012f * noise(Vec3f(9 * std::cos(a), 7 * p.y, 9 * std::sin(a)) + k * 10.0f);
        const float r = std::max(0.0f, p.x) * (1 + folds + fine * 3) * (1 + .18f * std::cos(2 * a));
        const float lean = .1f * std::sin(p.y * 1.3f + k);
        return Vec3f(r * std::cos(a) + lean, p.y, .85f * r * std::sin(a) + .05f * std::sin(2 * p.y));
    });
    for (const float side : {-1.0f, 1.0f}) {
        const float lift = side > 0 ? .35f * k : 0;
        const std::vector<Vec3f> arm = {{side * .3f, 2.4f, 0},
                                        {side * .56f, 2.1f + lift, .1f},
                                        {side * .6f, 1.75f + 2 * lift, .28f},
                                        {side * .3f, 1.7f + 2.5f * lift, .48f}};
        s.add(tube([&](float t) { return along(arm, t); },
                   [&](float t) { return (.15f - .08f * t) * (1 + .12f * std::sin(40 * t)); }, nu / 3, nv / 3));
    }
    return s;
}

/// A window in the plane z = 0 whose sill is at the origin: 1.1 x 2.2 m with a round arch.
struct Window {
    Surface frame, pane;
};
Window window(const Detail& d, bool balcony) {
    const auto n = [&](int full, int minimum = 3) { return d.lines(full, minimum); };
    const auto rim = [](float t) {  // up, over and down
        if (t < .3f) return Vec3f(-.55f, 1.65f * t / .3f, 0);
        if (t > .7f) return Vec3f(.55f, 1.65f * (1 - t) / .3f, 0);
        const float a = kPi * (t - .3f) / .4f;
        return Vec3f(-.55f * std::cos(a), 1.65f + .55f * std::sin(a), 0);
    };
    Window w;
    w.frame = tube(rim, [](float) { return .07f; }, n(30, 6), n(8));
    w.frame.add(boxAt({0, -.06f, .1f}, {1.5f, .12f, .4f}));
    // A closed pane a centimetre thick, so that what refracts also lets out again.
    const auto pane = [&](float z) {
        return patch(n(16, 6), 1, [=](float u, float v) {
            const Vec3f p = rim(.5f * u);
            return Vec3f(glm::mix(p.x, -p.x, v), p.y, z);
        });
    };
    w.pane = pane(.005f).add(pane(-.005f));
    if (balcony) {
        for (int i = 0; i < 5; ++i)
            w.frame.add(lathe({{.05f, 0}, {.03f, .1f}, {.07f, .3f}, {.03f, .6f}, {.05f, .7f}}, n(10), n(12))
                            .move({-.6f + .3f * static_cast<float>(i), 0, .5f}));
        w.frame.add(boxAt({0, .74f, .5f}, {1.5f, .08f, .16f})).add(boxAt({0, -.08f, .35f}, {1.5f, .1f, .6f}));
    }
    return w;
}

void addLooks(SceneFile& file) {
    file.look("BRICK", {.diffuse = Vec3f(1), .texture = "venice-brick.jpg", .repeats = Vec2f(.25f)});
    file.look("PLASTER", {.diffuse = Vec3f(1), .texture = "venice-plaster.jpg", .repeats = Vec2f(.08f)});
    file.look("STONE", {.diffuse = Vec3f(1), .texture = "venice-stone.jpg", .repeats = Vec2f(.12f)});
    file.look("MARBLE", {.diffuse = {.82f, .8f, .75f}, .specular = .3f, .shininess = .4f});
    file.look("TRIM", {.diffuse = {.78f, .75f, .68f}});
    file.look("DARK", {.diffuse = {.06f, .05f, .05f}});
    file.look("ROOF", {.diffuse = {.55f, .25f, .14f}});
    file.look("MIRROR", {.diffuse = {.04f, .05f, .06f}, .specular = .8f, .shininess = .9f, .mirror = .7f});
    file.look("GLASS",
              {.diffuse = Vec3f(.02f), .specular = .8f, .shininess = .9f, .refraction = 1.5f, .transparency = .95f});
    file.look("WATER", {.diffuse = {.03f, .1f, .09f}, .specular = .7f, .shininess = .9f, .mirror = .5f});
    file.look("BOAT", {.diffuse = Vec3f(.02f), .specular = .6f, .shininess = .7f, .mirror = .1f});
    file.look("POLE", {.diffuse = {.15f, .25f, .5f}});
    file.raw(
        "Background {{ skyColor [ .22 .4 .72, .6 .7 .85, .95 .85 .7 ] skyAngle [ 1, 1.57 ] groundColor [ .2 .2 .2 ] "
        "}}\n"
        "NavigationInfo {{ headlight FALSE }}\n"
        "DirectionalLight {{ direction .75 -.8 -.45 intensity .9 color 1 .95 .85 ambientIntensity .35 }}\n"
        "Viewpoint {{ position 3.6 4.2 17 orientation -.25 .96 .03 .22 fieldOfView .85 description \"Canal\" }}\n");
}

void addPalaces(SceneFile& file, const Detail& detail) {
    for (int i = 0; i < 14; ++i) {
        const float right = i % 2 ? 1.0f : -1.0f, width = 11, z = 14 - 12.2f * static_cast<float>(i / 2);
        const int floors = 3 + (i * 5) % 7 / 3;
        const float height = 4.2f * static_cast<float>(floors) + 1.5f;
        file.open({.translation = {right * 13.5f, 0, z}, .rotation = {0, 1, 0, -right * kPi / 2}});
        file.shape(box({-width / 2, -1, -9}, {width / 2, height, 0}), i % 3 == 1 ? "BRICK" : "PLASTER");
        file.shape(boxAt({0, height + .15f, -4.4f}, {width + .8f, .3f, 9.8f}), "TRIM");
        file.shape(patch(1, 1,
                         [=](float u, float v) {
                             return Vec3f((v - .5f) * (width + .8f), height + .3f + 2 * u, .4f - 5 * u);
                         }),
                   "ROOF");
        for (int floor = 0; floor < floors; ++floor) {
            Surface frames, panes;
            file.shape(boxAt({0, 1 + 4.2f * static_cast<float>(floor), .05f}, {width, .18f, .2f}), "TRIM");
            for (int k = 0; k < 5; ++k) {
                const Vec3f at(2 * static_cast<float>(k) - 4, 1.7f + 4.2f * static_cast<float>(floor), .12f);
                Window w = window(detail, floor == 1);
                frames.add(w.frame.move(at));
                panes.add(w.pane.move(at - Vec3f(0, 0, .04f)));
                Surface hollow = boxAt(at + Vec3f(0, 1, -.11f), {1.1f, 2, .01f});
                file.shape(hollow, "DARK");
            }
            file.shape(frames, "TRIM", Shading::smooth);
            file.shape(panes, (i + floor) % 2 ? "MIRROR" : "GLASS");
        }
        file.close();
    }
}

/// A bridge, boats and poles.
void addCanal(SceneFile& file, const Detail& detail) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    Dice dice(12);
    Surface bridge = patch(
        n(60), 6, [](float u, float v) { return Vec3f(30 * u - 15, .6f + 3.6f * std::sin(kPi * u), -32 + 4 * v); });
    for (const float z : {-32.0f, -28.0f})
        bridge.add(patch(n(60), 4, [=](float u, float v) {
            const float arch = std::max(.2f, 3.2f * std::sin(kPi * u) - 1.2f * std::abs(2 * u - 1));
            return Vec3f(30 * u - 15, glm::mix(arch, 1.6f + 3.6f * std::sin(kPi * u), v), z);
        }));
    file.shape(bridge, "MARBLE", Shading::smooth);
    for (int i = 0; i < 3; ++i) {
        Surface hull = patch(n(60), n(16), [](float u, float v) {
            const float t = 2 * u - 1, a = kPi * v, beam = .62f * std::sqrt(std::max(0.0f, 1 - t * t)),
                        rise = .9f * std::pow(t, 6.0f);
            return Vec3f(beam * std::cos(a), .5f + rise - .6f * std::sin(a) * (1 - t * t * .8f), 4.8f * t);
        });
        file.open({.translation = {i == 0   ? 3.4f
                                   : i == 1 ? -4.5f
                                            : 1.0f,
                                   0,
                                   i == 0   ? 4.0f
                                   : i == 1 ? -6.0f
                                            : -21.0f},
                   .rotation = {0, 1, 0, .2f * static_cast<float>(i) - .25f}});
        file.shape(hull, "BOAT", Shading::smooth);
        file.close();
    }
    for (int i = 0; i < 16; ++i) {
        const Vec3f at(i % 2 ? 8 : -12.2f, -1, 11 - 3.7f * static_cast<float>(i));
        file.shape(rod(at, at + Vec3f(dice.in(-.15f, .15f), 4, dice.in(-.15f, .15f)), .12f, n(16)), "POLE",
                   Shading::smooth);
    }
}

}  // namespace

Result<> writeVenice(SceneFile& file, const Detail& detail, const std::filesystem::path& folder) {
    const auto n = [&](int full, int minimum = 4) { return detail.lines(full, minimum); };
    const int side = std::max(64, static_cast<int>(4096 * std::sqrt(detail.scale)));
    struct Texture {
        const char* file;
        Vec3f (*colour)(float, float);
    };
    for (const Texture& t : {Texture{"venice-brick.jpg", brickAt}, Texture{"venice-plaster.jpg", plasterAt},
                             Texture{"venice-stone.jpg", stoneAt}})
        if (auto ok = writeTexture(folder / t.file, side, t.colour); !ok) return ok;
    addLooks(file);
    file.shape(patch(n(180), n(60),
                     [](float u, float v) {
                         const float x = 28 * v - 14, z = 40 - 160 * u;
                         return Vec3f(
                             x, .05f * noise(Vec3f(x * .5f, 0, z * .35f)) + .015f * noise(Vec3f(x * 2, 5, z * 1.6f)),
                             z);
                     }),
               "WATER", Shading::smooth);
    file.shape(box({8.5f, -1, -80}, {14, .9f, 40}), "STONE");  // the quay, on the right

    addPalaces(file, detail);
    for (int i = 0; i < 3; ++i) {
        const Vec3f at(9.7f, .9f, 8.5f - 5.2f * static_cast<float>(i));
        file.shape(
            boxAt(at + Vec3f(0, .5f, 0), {1.3f, 1, 1.3f}).add(boxAt(at + Vec3f(0, 1.06f, 0), {1.5f, .12f, 1.5f})),
            "STONE");
        file.open({.translation = at + Vec3f(0, 1.12f, 0), .rotation = {0, 1, 0, -1.2f}});
        file.shape(statue(n(500, 24), n(258, 18), i), "MARBLE", Shading::smooth);
        file.close();
    }
    addCanal(file, detail);
    return {};
}

}  // namespace rtsg::bench
