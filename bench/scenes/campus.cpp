// Campus: buildings down to their blinds, trees down to their leaves, every triangle once; and City: towers by the
// hundred thousand, all shared through three levels of DEF and USE.
#include <numbers>

#include "models.h"

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
using Shading = SceneFile::Shading;

void daylight(SceneFile& file, const char* ground) {
    file.raw(
        "Background {{ skyColor [ .16 .36 .72, .5 .68 .88, .86 .9 .92 ] skyAngle [ 1, 1.57 ] groundColor [ {} ] }}\n"
        "NavigationInfo {{ headlight FALSE }}\n"
        "DirectionalLight {{ direction -.6 -1 -.45 intensity .85 ambientIntensity .35 }}\n",
        ground);
}

/// A bay of a facade in the plane z = 0 around x = 0 from y = 0: wall with a hole, frame, blinds. 3.2 m wide and high.
struct Bay {
    Surface wall, frame;
};
Bay bay(Dice& dice) {
    Bay b;
    const float w = 1.6f, sill = .9f, top = 2.7f, half = 1.1f;
    b.wall = box({-w, 0, -.3f}, {w, sill, 0});
    b.wall.add(box({-w, top, -.3f}, {w, 3.2f, 0}))
        .add(box({-w, sill, -.3f}, {-half, top, 0}))
        .add(box({half, sill, -.3f}, {w, top, 0}));
    b.wall.add(box({-half - .1f, sill - .06f, 0}, {half + .1f, sill, .12f}));
    for (const float x : {-half, -.03f, half - .06f}) b.frame.add(box({x, sill, -.2f}, {x + .06f, top, -.14f}));
    for (const float y : {sill, 2.1f, top - .06f}) b.frame.add(box({-half, y, -.2f}, {half, y + .06f, -.14f}));
    const int blinds = 10;
    const float drawn = dice.in(.2f, 1);
    for (int i = 0; i < blinds; ++i) {
        const float y = top - .06f - drawn * (top - sill) * static_cast<float>(i) / static_cast<float>(blinds);
        b.frame.add(box({-half, y - .012f, -.29f}, {half, y, -.22f}));
    }
    return b;
}

void building(SceneFile& file, Vec3f at, int wide, int deep, int floors, int style, Dice& dice) {
    const float w = 3.2f * static_cast<float>(wide), d = 3.2f * static_cast<float>(deep),
                h = 3.2f * static_cast<float>(floors);
    file.open({.translation = at});
    const std::string stone = fmt::format("STONE{}", style);
    Surface core = box({-w / 2, 0, -d / 2}, {w / 2, h, d / 2});
    core.scale({1 - 1.2f / w, 1, 1 - 1.2f / d});
    file.shape(core, "DARK");
    file.shape(boxAt({0, h + .25f, 0}, {w + .8f, .5f, d + .8f}), "ROOF");
    Surface plant = boxAt({w * .2f, h + 1.4f, 0}, {w * .25f, 2, d * .3f});
    for (int i = 0; i < 6; ++i)
        plant.add(rod({-w * .3f + 1.5f * static_cast<float>(i), h, 0},
                      {-w * .3f + 1.5f * static_cast<float>(i), h + 1.6f, 0}, .25f, 10));
    file.shape(plant, "METAL");
    for (int side = 0; side < 4; ++side) {
        const int bays = side % 2 ? deep : wide;
        const float distance = side % 2 ? w / 2 : d / 2, angle = kPi / 2 * static_cast<float>(side);
        file.open({.rotation = {0, 1, 0, angle}});
        Surface glass;
        for (int floor = 0; floor < floors; ++floor)
            for (int i = 0; i < bays; ++i) {
                const Vec3f position(3.2f * (static_cast<float>(i) - static_cast<float>(bays - 1) / 2),
                                     3.2f * static_cast<float>(floor), distance);
                const Bay b = bay(dice);
                file.open({.translation = position});
                file.shape(b.wall, stone);
                file.shape(b.frame, "FRAME");
                file.close();
                glass.add(patch(
                    1, 1, [=](float u, float v) { return position + Vec3f(2.2f * u - 1.1f, .9f + 1.8f * v, -.17f); }));
            }
        file.shape(glass, "GLASS");
        file.close();
    }
    file.close();
}

/// Leaves of two triangles each around the ends of branches.
struct Tree {
    Surface wood, leaves;
};
Tree tree(int leaves, Dice& dice) {
    Tree t;
    const float height = dice.in(6, 11), spread = dice.in(2, 3.4f);
    t.wood = rod({0, 0, 0}, {0, height * .6f, 0}, .2f, 10, 4);
    std::vector<Vec3f> ends;
    for (int i = 0; i < 12; ++i) {
        const float a = dice.in(0, 2 * kPi), y = dice.in(.3f, .62f) * height;
        const Vec3f from(0, y, 0), to(spread * .7f * std::cos(a), y + dice.in(.8f, 2.6f), spread * .7f * std::sin(a));
        t.wood.add(
            tube([=](float s) { return glm::mix(from, to, s); }, [](float s) { return .09f * (1 - .7f * s); }, 3, 6));
        ends.push_back(to);
    }
    ends.push_back({0, height * .7f, 0});
    for (int i = 0; i < leaves; ++i) {
        const Vec3f centre = ends[static_cast<std::size_t>(dice.below(static_cast<int>(ends.size())))];
        Vec3f off;
        do off = Vec3f(dice.in(-1, 1), dice.in(-1, 1), dice.in(-1, 1));
        while (glm::dot(off, off) > 1);
        const Vec3f at = centre + off * Vec3f(spread * .45f, 1.3f, spread * .45f);
        const float a = dice.in(0, 2 * kPi), tilt = dice.in(-.9f, .9f), size = .13f;
        const Vec3f along(size * std::cos(a), size * tilt, size * std::sin(a)),
            side(-size * .6f * std::sin(a), size * .2f, size * .6f * std::cos(a));
        t.leaves.add(patch(1, 1, [&](float u, float v) { return at + (2 * u - 1) * along + (2 * v - 1) * side; }));
    }
    return t;
}

}  // namespace

void writeCampus(SceneFile& file, const Detail& detail) {
    daylight(file, ".3 .34 .25");
    file.raw(
        "Viewpoint {{ position -27 21 140 orientation -.6 -.79 -.07 .2 fieldOfView .8 description \"From the hill\" "
        "}}\n");
    file.look("STONE0", {.diffuse = {.62f, .45f, .34f}});
    file.look("STONE1", {.diffuse = {.74f, .71f, .64f}});
    file.look("STONE2", {.diffuse = {.5f, .52f, .55f}});
    file.look("DARK", {.diffuse = Vec3f(.07f)});
    file.look("ROOF", {.diffuse = {.3f, .3f, .31f}});
    file.look("METAL", {.diffuse = Vec3f(.5f), .specular = .4f});
    file.look("FRAME", {.diffuse = Vec3f(.85f)});
    file.look("GLASS",
              {.diffuse = {.05f, .07f, .09f}, .specular = .6f, .shininess = .8f, .mirror = .3f, .transparency = .5f});
    file.look("GRASS", {.diffuse = {.2f, .36f, .12f}});
    file.look("PAVING", {.diffuse = {.6f, .57f, .52f}});
    file.look("BARK", {.diffuse = {.25f, .17f, .11f}});
    for (int i = 0; i < 3; ++i)
        file.look(fmt::format("LEAVES{}", i),
                  {.diffuse = {.12f + .07f * static_cast<float>(i), .34f + .04f * static_cast<float>(i), .08f}});
    Dice dice(4);
    const int n = detail.lines(150, 8);
    file.shape(patch(n, n,
                     [](float u, float v) {
                         const float x = 700 * v - 350, z = 700 * u - 350,
                                     far = std::max(0.0f, std::max(std::abs(x), std::abs(z)) - 150);
                         return Vec3f(x, -.05f + far * .09f * (1 + noise(Vec3f(x * .02f, 0, z * .02f))), z);
                     }),
               "GRASS", Shading::smooth);
    for (int i = -2; i <= 2; ++i) {
        file.shape(boxAt({static_cast<float>(i) * 52 + 26, 0, 0}, {6, .06f, 300}), "PAVING");
        file.shape(boxAt({0, .01f, static_cast<float>(i) * 52 + 26}, {300, .06f, 6}), "PAVING");
    }
    // From the middle outwards, so that few of them still make a place.
    const int buildings = detail.count(36, 2), trees = detail.count(455, 4);
    int built = 0;
    for (int ring = 0; ring < 4 && built < buildings; ++ring)
        for (int x = -ring; x <= ring; ++x)
            for (int z = -ring; z <= ring; ++z) {
                if (std::max(std::abs(x), std::abs(z)) != ring || (x == 0 && z == 0) || built >= buildings) continue;
                building(file, {static_cast<float>(x) * 52, 0, static_cast<float>(z) * 52}, 9 + dice.below(4),
                         4 + dice.below(3), 4 + (built * 7) % 11 / 2, built % 3, dice);
                ++built;
            }
    for (int i = 0; i < trees; ++i) {
        // Along the paths and on the square in the middle.
        const float along = dice.in(-140, 140),
                    path = static_cast<float>(dice.below(5) - 2) * 52 + 26 + (i % 2 ? 6.0f : -6.0f);
        const bool square = i % 5 == 0;
        const Vec3f at = square      ? Vec3f(dice.in(-18, 18), 0, dice.in(-18, 18))
                         : i % 4 < 2 ? Vec3f(path, 0, along)
                                     : Vec3f(along, 0, path);
        const Tree t = tree(2450, dice);
        file.open({.translation = at});
        file.shape(t.wood, "BARK", Shading::smooth);
        file.shape(t.leaves, fmt::format("LEAVES{}", i % 3));
        file.close();
    }
}

namespace {

/// A tower of about 10,000 triangles on a footprint of 20 x 20 m; 1 m high a storey and then scaled.
Surface tower(int kind, int detail, Dice& dice) {
    Surface s;
    const int storeys = detail;
    float half = 10;
    for (int floor = 0; floor < storeys; ++floor) {
        const float y = static_cast<float>(floor) / static_cast<float>(storeys), h = 1 / static_cast<float>(storeys);
        if (kind % 3 == 1 && floor % std::max(1, storeys / 4) == 0) half *= .86f;
        if (kind % 4 == 3) half = 10 * std::sqrt(std::max(.06f, 1 - y * y * .8f));
        s.add(boxAt({0, y + h * .06f, 0}, {2 * half, h * .12f, 2 * half}));  // the slab
        for (int side = 0; side < 4; ++side)
            for (int i = 0; i < 4; ++i) {
                Surface pier = boxAt({half * (static_cast<float>(2 * i) - 3) / 4, y + h * .56f, half - .3f},
                                     {half * .42f, h * .88f, .3f - .1f * dice.in(0, 1)});
                s.add(pier.rotate(kPi / 2 * static_cast<float>(side)));
            }
        if (kind % 2 == 0) s.add(rod({0, y, 0}, {0, y + h, 0}, half * .96f, 16));
    }
    s.add(rod({0, 1, 0}, {0, 1.08f, 0}, .4f, 6));
    return s;
}

}  // namespace

void writeCity(SceneFile& file, const Detail& detail) {
    daylight(file, ".8 .86 .92");
    file.raw(
        "Viewpoint {{ position -300 520 1150 orientation -.62 -.77 -.13 .5 fieldOfView .8 description \"Approach\" }}\n"
        "Fog {{ fogType \"EXPONENTIAL\" color .8 .86 .92 visibilityRange 14000 }}\n");
    constexpr int kKinds = 8, kBlocks = 16;
    constexpr Vec3f colours[kKinds] = {{.66f, .62f, .55f}, {.45f, .5f, .56f}, {.6f, .42f, .33f}, {.72f, .72f, .7f},
                                       {.34f, .4f, .46f},  {.74f, .66f, .5f}, {.5f, .46f, .44f}, {.58f, .64f, .66f}};
    for (int k = 0; k < kKinds; ++k)
        file.look(fmt::format("FACADE{}", k),
                  {.diffuse = colours[k], .specular = .3f, .shininess = .6f, .mirror = k % 4 == 1 ? .2f : 0});
    file.look("STREET", {.diffuse = Vec3f(.2f)});
    Dice dice(9);
    // Never shown themselves: what is used must have been defined once.
    file.raw("Switch {{ children [\n");
    for (int k = 0; k < kKinds; ++k) {
        file.raw("Shape {{ appearance USE FACADE{} ", k);
        const Surface s = tower(k, 44 + 2 * (k % 3), dice);
        file.raw("geometry ");
        file.geometry(s, Shading::flat, fmt::format("TOWER{}", k));
        file.raw("}}\n");
    }
    file.raw("] }}\n");
    // Blocks of 16 towers, districts of 64 blocks, 100 districts: half of a reduction in districts, half in blocks.
    const Detail half{std::sqrt(detail.scale)};
    const int blockSide = std::max(1, half.lines(8, 1)), citySide = std::max(1, half.lines(10, 1));
    file.raw("Switch {{ children [\n");
    for (int b = 0; b < kBlocks; ++b) {
        file.open({}, fmt::format("BLOCK{}", b));
        file.shape(boxAt({0, -.5f, 0}, {116, 1, 116}), "STREET");
        for (int i = 0; i < 16; ++i) {
            const int kind = dice.below(kKinds);
            const float height = dice.in(18, 60) + (b % 5 == 0 ? dice.in(0, 130) : 0);
            file.open(
                {.translation = {28.0f * static_cast<float>(i % 4) - 42, 0, 28.0f * static_cast<float>(i / 4) - 42},
                 .scale = {1, height, 1}});
            file.shapeOf(fmt::format("TOWER{}", kind), fmt::format("FACADE{}", (kind + b) % kKinds));
            file.close();
        }
        file.close();
    }
    file.raw("] }}\nSwitch {{ children\n");
    file.open({}, "DISTRICT");
    for (int x = 0; x < blockSide; ++x)
        for (int z = 0; z < blockSide; ++z)
            file.useAt({.translation = {128.0f * static_cast<float>(x), 0, 128.0f * static_cast<float>(z)}},
                       fmt::format("BLOCK{}", dice.below(kBlocks)));
    file.close();
    file.raw("}}\n");
    file.resetCount();
    const float district = 128.0f * static_cast<float>(blockSide) + 24, city = district * static_cast<float>(citySide);
    file.shape(boxAt({0, -2, -city * .4f}, {city * 3, 1, city * 3}), "STREET");
    for (int x = 0; x < citySide; ++x)
        for (int z = 0; z < citySide; ++z)
            file.useAt(
                {.translation = {district * static_cast<float>(x) - city / 2, 0, -district * static_cast<float>(z)}},
                "DISTRICT");
}

}  // namespace rtsg::bench
