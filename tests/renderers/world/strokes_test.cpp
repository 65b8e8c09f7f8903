// Lines and points among rays: against all of them one by one in double precision, for many eyes, while they change;
// and that sound and versions are left alone.
#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>

#include <rtsg/renderers/tessellate.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

/// One stroke in world space.
struct Exact {
    Vec3d a, b;
    double width;
    std::uint32_t slot, number;
};
struct ExactHit {
    double t = std::numeric_limits<double>::infinity(), margin = 0;  // margin: how surely it is met
    const Exact* stroke = nullptr;
};

double span(double x) {
    return std::clamp(x, 0.0, 1.0);
}

/// A point as the square that it is to the picture's own rays, in the eye's space.
ExactHit meetSquare(const Exact& s, const Vec3d& o, const Vec3d& d, const PixelLens& lens) {
    const Vec3d from = s.a - Vec3d(lens.eye), start = o - Vec3d(lens.eye);
    const double t = (from.z - start.z) / d.z, half = .5 * s.width * lens.spread * -from.z;
    const Vec3d beside = start + t * d - from;
    ExactHit hit;
    hit.margin = (half - std::max(std::abs(beside.x), std::abs(beside.y))) / half;
    if (hit.margin >= 0) hit.t = t, hit.stroke = &s;
    return hit;
}

/// The place on the axis that is nearest to the ray's line, by golden sections of a distance that has one least value:
/// in metres, or, where the axis lies before a perspective eye, over its depth there.
ExactHit meet(const Exact& s, const Vec3d& o, const Vec3d& d, const PixelLens& lens) {
    const auto offsetAt = [&](double u) {
        const Vec3d p = s.a + u * (s.b - s.a) - o;
        return glm::length(p - d * glm::dot(p, d));
    };
    double low = 0, high = 1;
    const auto depthAt = [&](double u) {
        return glm::dot(s.a + u * (s.b - s.a) - Vec3d(lens.eye), Vec3d(lens.forward));
    };
    const bool fromEye = glm::distance(o, Vec3d(lens.eye)) < 1e-5;
    const double minimum = 1e-4 * std::max(depthAt(0), depthAt(1));
    bool inPicture = lens.spread > 0 && depthAt(0) > 0 && depthAt(1) > 0;
    if (lens.spread > 0 && fromEye && minimum > 0) {
        inPicture = true;
        const double at = (minimum - depthAt(0)) / (depthAt(1) - depthAt(0));
        if (depthAt(0) < minimum) low = at;
        if (depthAt(1) < minimum) high = at;
    }
    const auto apartAt = [&](double u) { return inPicture ? offsetAt(u) / depthAt(u) : offsetAt(u); };
    for (int i = 0; i < 90; ++i) {
        const double m1 = low + .381966 * (high - low), m2 = low + .618034 * (high - low);
        const bool left = apartAt(m1) < apartAt(m2);
        (left ? high : low) = left ? m2 : m1;
    }
    const double u = span(.5 * (low + high));
    const Vec3d p = s.a + u * (s.b - s.a), v = p - Vec3d(lens.eye);
    const double t = glm::dot(p - o, d);
    const Vec3d e = p - o - t * d;
    double radius = .5 * s.width * lens.size, offset = glm::length(e);
    if (lens.spread > 0) {
        const double far = glm::length(v), depth = std::max(std::abs(glm::dot(v, Vec3d(lens.forward))), far / 2);
        radius = .5 * s.width * lens.spread * depth;
        offset = std::sqrt(offset * offset + std::pow(glm::dot(e, Vec3d(lens.forward)) * far / depth, 2));
    }
    ExactHit hit;
    hit.margin = (radius - offset) / std::max(radius, 1e-300);
    // At the depth of the axis where the ray leads forwards or backwards, but no farther from it than it is wide.
    const double ahead = glm::dot(d, Vec3d(lens.forward)), apart = glm::length(e);
    const double maximum = std::sqrt(std::max(radius * radius - apart * apart, 0.0));
    double step = 0;
    if (std::abs(ahead) >= .5) step = std::clamp(glm::dot(e, Vec3d(lens.forward)) / ahead, -maximum, maximum);
    if (offset <= radius) hit.t = t + step, hit.stroke = &s;
    return hit;
}

std::shared_ptr<Mesh> randomStrokes(std::mt19937& random, int count, Mesh::Strokes kind, float length) {
    std::uniform_real_distribution<float> unit(-1, 1);
    StrokeParams p;
    p.kind = kind;
    std::vector<Vec3f> coord;
    std::vector<std::int32_t> counts;
    for (int i = 0; i < count; ++i) {
        const Vec3f a(unit(random), unit(random), unit(random));
        coord.push_back(a);
        if (kind == Mesh::Strokes::points) continue;
        coord.push_back(a + length * Vec3f(unit(random), unit(random), unit(random)));
        counts.push_back(2);
    }
    p.coord = Array<Vec3f>(std::span<const Vec3f>(coord));
    p.vertexCount = Array<std::int32_t>(std::span<const std::int32_t>(counts));
    return std::make_shared<Mesh>(tessellate(p));
}

struct Strokes {
    RayWorld world;
    InstanceDelta delta;
    std::vector<Instance> instances;
    std::vector<std::shared_ptr<const Mesh>> meshes;

    void add(std::shared_ptr<const Mesh> mesh, const WorldFromLocal& m, float width) {
        Instance i;
        i.id = {static_cast<std::uint32_t>(instances.size()), 0};
        i.shape = i.geometry = NodeId{static_cast<std::uint32_t>(instances.size()) + 1};
        i.worldFromLocal = m;
        auto style = std::make_shared<StrokeStyle>();
        style->lineWidth = style->pointSize = width;
        i.strokes = style;
        instances.push_back(i);
        meshes.push_back(mesh);
        delta.geometries.push_back({i.geometry, mesh});
        delta.added.push_back(i);
    }
    void apply() {
        world.apply(delta);
        delta.clear();
    }
    std::vector<Exact> exact() const {
        std::vector<Exact> all;
        for (const Instance& i : instances) {
            const Mesh& mesh = *meshes[i.id.slot];
            for (std::uint32_t s = 0; s < mesh.strokeCount; ++s)
                all.push_back({i.worldFromLocal * glm::dvec4(Vec3d(mesh.vertex(s, 0)), 1),
                               i.worldFromLocal * glm::dvec4(Vec3d(mesh.vertex(s, 1)), 1), i.strokes->lineWidth,
                               i.id.slot, s});
        }
        return all;
    }
};

WorldFromLocal randomPosition(std::mt19937& random) {
    std::uniform_real_distribution<double> unit(-1, 1);
    WorldFromLocal m;
    for (int i = 0; i < 3; ++i) m[i] = {unit(random), unit(random), unit(random)};
    m[0] *= 2;
    m[3] = {2 * unit(random), 2 * unit(random), 2 * unit(random)};
    return m;
}

/// Every query of rays from and beside the eye, against the list. Returns how many hit something.
int expectAsListed(const Strokes& strokes, const PixelLens& lens, std::mt19937& random, const char* what) {
    std::vector<Exact> all = strokes.exact();
    const glm::dmat3 toSquare = lens.toSquare ? glm::dmat3(*lens.toSquare) : glm::dmat3(1.0);
    for (Exact& s : all) s.a = toSquare * s.a, s.b = toSquare * s.b;
    PixelLens square = lens;
    square.eye = Vec3f(toSquare * Vec3d(lens.eye)), square.toSquare.reset();
    const LensedView view(strokes.world, lens);
    std::normal_distribution<float> normal;
    int hits = 0;
    for (int packet = 0; packet < 24; ++packet) {
        RayPacket16 rays;
        const bool together = packet % 3 != 2, fromEye = packet % 3 == 0;
        const Vec3f aim = glm::normalize(Vec3f(normal(random), normal(random), normal(random)) - lens.eye);
        Vec3f start = lens.eye;
        if (!fromEye) start = 4.0f * Vec3f(normal(random), normal(random), normal(random));
        for (int lane = 0; lane < 16; ++lane) {
            Ray ray;
            ray.origin = start + (together ? .01f : 1.0f) *
                                     (fromEye ? Vec3f(0) : Vec3f(normal(random), normal(random), normal(random)));
            const Vec3f to = fromEye ? aim : glm::normalize(-start);
            ray.direction = to + (together ? .01f : 1.0f) * Vec3f(normal(random), normal(random), normal(random));
            if (lane % 4 != 0) ray.direction = glm::normalize(ray.direction);
            if (lane % 5 == 0) ray.tMax = 3;
            rays.set(lane, ray);
        }
        rays.skip(7);
        RayPacket16 shadows = rays, traced = rays;
        const std::uint32_t found = view.intersect(traced, together), blocked = view.occluded(shadows);
        EXPECT_FALSE(found >> 7 & 1u);
        for (int lane = 0; lane < 16; ++lane) {
            if (lane == 7) continue;
            Ray ray;
            ray.origin = {rays.originX[lane], rays.originY[lane], rays.originZ[lane]};
            ray.direction = {rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]};
            ray.tMax = rays.tMax[lane];
            const Vec3d o = toSquare * Vec3d(ray.origin), d = toSquare * Vec3d(ray.direction);
            const double length = glm::length(d), end = double{ray.tMax} * length;
            ExactHit best;
            bool doubtful = false;
            const auto isOwn = [&](const Exact& s) {
                return lens.toSquare && lens.spread > 0 && s.a == s.b && d.z < 0 && s.a.z < square.eye.z &&
                       glm::distance(o, Vec3d(square.eye)) < 1e-5;
            };
            const auto exactly = [&](const Exact& s) {
                return isOwn(s) ? meetSquare(s, o, d / length, square) : meet(s, o, d / length, square);
            };
            for (const Exact& s : all) {
                const ExactHit hit = exactly(s);
                // At its edge a float may say otherwise; also where it begins at the ray's own ends.
                doubtful |= std::abs(hit.margin) < (isOwn(s) ? 6e-3 : 2e-3);
                if (hit.stroke) doubtful |= std::abs(hit.t) < 1e-4 || std::abs(hit.t - end) < 1e-4;
                if (hit.stroke && hit.t >= 0 && hit.t <= end && hit.t < best.t) best = hit;
            }
            if (doubtful) continue;
            const Hit single = view.intersect(ray);
            const Hit inPacket = view.hit(traced, lane);
            EXPECT_EQ(static_cast<bool>(single), best.stroke != nullptr)
                << what << " lane " << lane << " packet " << packet;
            EXPECT_EQ(static_cast<bool>(found >> lane & 1u), best.stroke != nullptr) << what << lane;
            EXPECT_EQ(static_cast<bool>(blocked >> lane & 1u), best.stroke != nullptr) << what << lane;
            EXPECT_EQ(view.occluded(ray), best.stroke != nullptr) << what << lane;
            if (!best.stroke || !single) continue;
            ++hits;
            EXPECT_NEAR(single.t * length, best.t, 1e-3 + 2e-3 * best.t) << what;
            EXPECT_NEAR(inPacket.t, single.t, 1e-3 * single.t);
            // Where two are as near as each other either may be named.
            const ExactHit named = exactly(*std::find_if(all.begin(), all.end(), [&](const Exact& s) {
                return s.slot == single.instance && s.number == single.triangle;
            }));
            EXPECT_NEAR(named.t, best.t, 1e-3 + 2e-3 * best.t);
            EXPECT_NEAR(glm::dot(single.normal, glm::normalize(ray.direction)), -1, 1e-5);
        }
    }
    return hits;
}

const PixelLens kLenses[] = {{{0, 0, 5}, {0, 0, -1}, .02f, 0},
                             {{.5f, 3, -9}, {0, -.31622777f, .9486833f}, .004f, 0},
                             {{0, 0, 5}, {0, 0, -1}, 0, .05f},
                             {{0, 0, 0}, {1, 0, 0}, .05f, 0},
                             {{0, 0, 5}, {0, 0, -1}, .02f, 0, glm::mat3(4, 0, 0, .3f, .5f, 0, 0, 0, 1)},
                             {{0, 1, 5}, {0, 0, -1}, 0, .05f, glm::mat3(.2f, 0, 0, 0, 3, .6f, 0, 0, 1)}};

TEST(Strokes, AsAListOfThemAllSays) {
    std::mt19937 random(7);
    for (const auto kind : {Mesh::Strokes::lines, Mesh::Strokes::points}) {
        Strokes s;
        for (int i = 0; i < 6; ++i)
            s.add(randomStrokes(random, i == 0 ? 300 : 5 * i, kind, i % 2 ? 1.5f : .2f),
                  i < 2 ? identityTransform() : randomPosition(random), static_cast<float>(1 + 2 * i));
        s.apply();
        int hits = 0;
        for (const PixelLens& lens : kLenses) hits += expectAsListed(s, lens, random, "as built");
        EXPECT_GT(hits, 200);
    }
}

// A point of a metre's width: what starts within that meets it where its middle is, if that lies ahead.
TEST(Strokes, HaveNoThickness) {
    for (const float z : {-.2f, .2f}) {
        StrokeParams p;
        p.kind = Mesh::Strokes::points;
        const Vec3f position(0, 0, z);
        p.coord = Array<Vec3f>(std::span<const Vec3f>(&position, 1));
        Strokes strokes;
        strokes.add(std::make_shared<Mesh>(tessellate(p)), WorldFromLocal(1.0), 20);
        strokes.apply();
        const LensedView view(strokes.world, {{0, 0, 0}, {0, 0, -1}, 0, .05f});
        for (const float side : {-1.0f, 1.0f})
            for (const float start : {0.0f, .1f, .25f}) {
                const bool met = side * z > start;
                const Ray ray{{.1f, 0, 0}, start, {0, 0, side}};
                const Hit hit = view.intersect(ray);
                EXPECT_EQ(static_cast<bool>(hit), met) << z << ' ' << side << ' ' << start;
                EXPECT_EQ(view.occluded(ray), met);
                if (!met) continue;
                EXPECT_NEAR(hit.t, .2f, 1e-5f);
            }
    }
}

// Moved, deformed, restyled, hidden and gone: what is left answers as if it had been built so.
TEST(Strokes, FollowTheirScene) {
    std::mt19937 random(11);
    Strokes s;
    for (int i = 0; i < 5; ++i) s.add(randomStrokes(random, 60, Mesh::Strokes::lines, .4f), randomPosition(random), 5);
    s.apply();
    for (int round = 0; round < 6; ++round) {
        Instance& moved = s.instances[static_cast<std::size_t>(round % 5)];
        moved.worldFromLocal = randomPosition(random);
        if (round == 3) moved.worldFromLocal[1] = Vec3d(0);  // flat
        s.delta.moved.push_back({moved.id, moved.worldFromLocal});
        const auto bent = static_cast<std::size_t>((round + 1) % 5);
        auto mesh = std::make_shared<Mesh>(*s.meshes[bent]);
        Vec3f* p = mesh->positions.mutableData();
        mesh->bounds = {};
        for (std::size_t i = 0; i < mesh->positions.size(); ++i) {
            p[i] = round % 2 ? Vec3f(p[i].y, -p[i].x, p[i].z) : 1.1f * p[i];
            mesh->bounds.extend(p[i]);
        }
        s.meshes[bent] = mesh;
        s.delta.geometries.push_back({s.instances[bent].geometry, mesh});
        Instance& restyled = s.instances[static_cast<std::size_t>((round + 2) % 5)];
        auto style = std::make_shared<StrokeStyle>();
        style->lineWidth = static_cast<float>(3 + round);
        restyled.strokes = style;
        s.delta.rebound.push_back(restyled);
        s.apply();
        expectAsListed(s, kLenses[round % 4], random, fmt::format("round {}", round).c_str());
    }
    for (const Instance& i : s.instances) s.delta.removed.push_back(i.id);
    s.apply();
    s.instances.clear();
    EXPECT_EQ(expectAsListed(s, kLenses[0], random, "gone"), 0);
    EXPECT_TRUE(s.world.bounds().empty());
}

TEST(Strokes, AreNothingToSoundNorWithoutALens) {
    std::mt19937 random(3);
    Strokes s;
    s.add(randomStrokes(random, 200, Mesh::Strokes::lines, 2), identityTransform(), 50);
    s.apply();
    Ray ray;
    ray.origin = {0, 0, 5};
    const LensedView view(s.world, kLenses[0]);
    EXPECT_TRUE(view.occluded(ray));
    EXPECT_FALSE(view.intersect(ray, RayKind::sound));
    EXPECT_FALSE(view.occluded(ray, RayKind::sound));
    EXPECT_FALSE(s.world.intersect(ray));
    view.visitNear({0, 0, 0}, 10, [](std::uint32_t, std::uint32_t) {
        ADD_FAILURE() << "no triangle is near";
        return 10.0f;
    });
    EXPECT_EQ(s.world.stats().instancedTriangles, 0u);
    s.instances[0].castShadow = false;
    s.delta.rebound.push_back(s.instances[0]);
    s.apply();
    const LensedView after(s.world, kLenses[0]);
    EXPECT_TRUE(after.intersect(ray));
    EXPECT_FALSE(after.occluded(ray)) << "castShadow FALSE";
}

TEST(Strokes, AVersionStaysAsItWas) {
    std::mt19937 random(5);
    Strokes s;
    for (int i = 0; i < 20; ++i) s.add(randomStrokes(random, 20, Mesh::Strokes::lines, .5f), randomPosition(random), 4);
    s.apply();
    const auto version = s.world.freeze();
    ASSERT_TRUE(version);
    std::vector<Ray> rays(200);
    std::vector<Hit> before;
    std::normal_distribution<float> normal;
    for (Ray& ray : rays) {
        ray.origin = kLenses[0].eye;
        ray.direction = glm::normalize(Vec3f(normal(random), normal(random), normal(random)) - ray.origin);
        before.push_back(LensedView(*version, kLenses[0]).intersect(ray));
    }
    EXPECT_GT(std::ranges::count_if(before, [](const Hit& h) { return static_cast<bool>(h); }), 20);
    for (int round = 0; round < 5; ++round) {
        for (Instance& i : s.instances) {
            i.worldFromLocal = randomPosition(random);
            s.delta.moved.push_back({i.id, i.worldFromLocal});
        }
        s.apply();
    }
    for (const Instance& i : s.instances) s.delta.removed.push_back(i.id);
    s.apply();
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Hit now = LensedView(*version, kLenses[0]).intersect(rays[i]);
        EXPECT_EQ(now.instance, before[i].instance);
        EXPECT_EQ(now.t, before[i].t);
    }
}

}  // namespace
}  // namespace rtsg
