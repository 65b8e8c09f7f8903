// Broken meshes, from the fields of the scene to the rays. Each case states its outcome: what is left out, what is
// said, and that the rest is hit as ever.
#include <limits>
#include <random>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>

#include "renderers/world/deform_support.h"

namespace rtsg {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

/// A scene of one shape, and a ray world behind it.
struct Stage final : Subscriber {
    Scene scene;
    NodeId shape, faces, coordinate;
    Flattener flattener;
    RayWorld world{{.buildThreads = 1}};
    Attachment attachment;
    double time = 0;

    Stage() {
        shape = scene.createNode(x3d::Shape::type), faces = scene.createNode(x3d::IndexedFaceSet::type);
        coordinate = scene.createNode(x3d::Coordinate::type);
        EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coord, coordinate));
        EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, faces));
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, shape));
        attachment = scene.bus().attach(*this);
    }
    Result<> apply(const Scene& s, const ChangeSet& changes) override {
        world.apply(flattener.apply(s, changes));
        return {};
    }
    void show(Array<Vec3f> points, Array<std::int32_t> index) {
        EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, std::move(index)));
        move(std::move(points));
    }
    void move(Array<Vec3f> points) {
        EXPECT_TRUE(scene.set(coordinate, x3d::Coordinate::point, std::move(points)));
        scene.newFrame(time += .01);
    }
    /// From above, straight down; misses are negative.
    float down(float x, float z) const {
        const Vec3f origin = world.fromWorld(Vec3d(x, 100, z));
        const Hit hit = world.intersect({.origin = origin, .direction = {0, -1, 0}});
        return hit ? hit.t : -1;
    }
    std::size_t warnings() const { return flattener.diagnostics().all().size(); }
};

/// Squares of side 1 side by side along x, at height 0, split in two.
void addSquares(int count, Array<Vec3f>& points, Array<std::int32_t>& index) {
    for (int i = 0; i < count; ++i) {
        const auto base = static_cast<std::int32_t>(points.size());
        const auto x = static_cast<float>(i);
        for (const Vec3f p : {Vec3f(x, 0, 0), Vec3f(x, 0, 1), Vec3f(x + 1, 0, 1), Vec3f(x + 1, 0, 0)})
            points.push_back(p);
        for (const int v : {0, 1, 2, -3, 0, 2, 3, -3}) index.push_back(v == -3 ? -1 : base + v);
    }
}

TEST(MeshGeometry, EmptyMeshesAreNotTraced) {
    Stage stage;
    stage.scene.newFrame(stage.time += .01);
    EXPECT_EQ(stage.world.stats().traced, 0u);
    const Array<Vec3f> one{{0, 0, 0}}, three{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}};
    const std::vector<std::pair<Array<Vec3f>, Array<std::int32_t>>> cases = {{{}, {}},
                                                                             {three, {}},
                                                                             {{}, {0, 1, 2, -1}},
                                                                             {three, {-1, -1, -1}},
                                                                             {three, {0, 1, -1, 2, -1}},
                                                                             {one, {0, 0, 0, -1}}};
    for (const auto& [points, index] : cases) {
        stage.show(points, index);
        // The last is a triangle, if a degenerate one, and stays.
        const bool isLast = points.size() == 1;
        EXPECT_EQ(stage.world.stats().traced, isLast ? 1u : 0u);
        EXPECT_LT(stage.down(.2f, .2f), 0);
    }
    stage.show(three, {0, 1, 2, -1});
    EXPECT_EQ(stage.world.stats().traced, 1u);
    EXPECT_FLOAT_EQ(stage.down(.2f, .2f), 100);
    ASSERT_TRUE(stage.scene.set(stage.faces, x3d::IndexedFaceSet::coord, NodeId{}));
    stage.scene.newFrame(stage.time += .01);
    EXPECT_EQ(stage.world.stats().traced, 0u);
}

TEST(MeshGeometry, DegenerateTrianglesAreNeverHitAndHarmNoOthers) {
    Array<Vec3f> points;
    Array<std::int32_t> index;
    addSquares(4, points, index);
    const auto base = static_cast<std::int32_t>(points.size());
    // A point, a line, and a needle of length 1e6, all above the squares.
    for (const Vec3f p :
         {Vec3f(.5f, 1, .5f), Vec3f(.5f, 1, .5f), Vec3f(.5f, 1, .5f), Vec3f(0, 1, .25f), Vec3f(2, 1, .25f),
          Vec3f(4, 1, .25f), Vec3f(-1e6f, 1, .6f), Vec3f(1e6f, 1, .6f), Vec3f(0, 1, .6f)})
        points.push_back(p);
    for (int i = 0; i < 3; ++i)
        for (const int k : {0, 1, 2, -1}) index.push_back(k < 0 ? -1 : base + 3 * i + k);
    Stage stage;
    stage.show(points, index);
    for (float x = .05f; x < 4; x += .1f)
        for (float z = .05f; z < 1; z += .1f) EXPECT_NEAR(stage.down(x, z), 100, 1e-3) << x << ' ' << z;
}

TEST(MeshGeometry, IndicesOutOfRangeTakeTheirFacesOnly) {
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::uniform_int_distribution<std::int32_t> any(std::numeric_limits<std::int32_t>::min());
    Array<Vec3f> points;
    Array<std::int32_t> good;
    addSquares(8, points, good);
    for (int round = 0; round < 50; ++round) {
        // The last face's first corner, in one of the last squares, refers to something that is not there.
        Array<std::int32_t> index = good;
        std::int32_t wild;
        do wild = any(random);
        while (wild >= -1 && wild < static_cast<std::int32_t>(points.size()));
        index.mutableData()[index.size() - 4] = wild;
        Stage stage;
        stage.show(points, index);
        for (int i = 0; i < 7; ++i) EXPECT_FLOAT_EQ(stage.down(static_cast<float>(i) + .3f, .6f), 100);
        EXPECT_GE(stage.warnings(), 1u) << wild;
    }
    for (int round = 0; round < 200; ++round) {
        Array<std::int32_t> index;
        for (int i = 0; i < 60; ++i)
            index.push_back(random() % 3 ? static_cast<std::int32_t>(random() % 40) - 2 : any(random));
        Stage stage;
        stage.show(points, index);
        for (const RayInstance& instance : stage.world.instances())
            if (instance.mesh) {
                EXPECT_EQ(findDefect(*instance.mesh), "");
            }
        (void)stage.down(.5f, .5f);
    }
}

TEST(MeshGeometry, AMillionCoincidentTrianglesAreTracedInLinearSpace) {
    // No tree can tell them apart: a ray that meets them looks at all. The memory grows with their number and no
    // faster.
    double bytesPerTriangle[2];
    for (const int round : {0, 1}) {
        const std::uint32_t count = round == 0 ? 250'000 : 1'000'000;
        Array<std::int32_t> index = Array<std::int32_t>::ofSize(std::size_t{count} * 4);
        std::int32_t* out = index.mutableData();
        for (std::uint32_t t = 0; t < count; ++t)
            for (int c = 0; c < 4; ++c) *out++ = c < 3 ? c : -1;
        Stage stage;
        stage.show({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}}, index);
        EXPECT_FLOAT_EQ(stage.down(.2f, .2f), 100);
        EXPECT_LT(stage.down(.7f, .7f), 0);
        bytesPerTriangle[round] = static_cast<double>(stage.world.stats().bvhBytes) / count;
        // Refitted, they are as many.
        stage.move({{0, 1, 0}, {0, 1, 1}, {1, 1, 0}});
        stage.move({{0, 2, 0}, {0, 2, 1}, {1, 2, 0}});
        EXPECT_FLOAT_EQ(stage.down(.2f, .2f), 98);
    }
    EXPECT_LT(bytesPerTriangle[1], 1.5 * bytesPerTriangle[0]);
    EXPECT_LT(bytesPerTriangle[1], 400);
}

TEST(MeshGeometry, CoordinatesFarOutAreAsExactAsFloats) {
    Array<Vec3f> points;
    Array<std::int32_t> index;
    // At 1e7 neighbouring floats lie 1 apart: a patch of 64 m, its corners exact.
    for (const Vec2f c : {Vec2f(0, 0), Vec2f(0, 64), Vec2f(64, 64), Vec2f(64, 0)})
        points.push_back({1e7f + c.x, 0, 1e7f + c.y});
    for (const int v : {0, 1, 2, -1, 0, 2, 3, -1}) index.push_back(v);
    Stage stage;
    stage.show(points, index);
    for (float x = 1; x < 64; x += 2)
        for (float z = 1; z < 64; z += 2) EXPECT_FLOAT_EQ(stage.down(1e7f + x, 1e7f + z), 100);
    EXPECT_LT(stage.down(1e7f - 2, 1e7f + 32), 0);
    // Beyond kMaxCoordinate an instance is left out, and said so; the world goes on.
    stage.move({{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {3e9f, 0, 0}});
    EXPECT_EQ(stage.world.stats().traced, 0u);
    EXPECT_FALSE(stage.world.diagnostics().all().empty());
    stage.move({{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}});
    EXPECT_FLOAT_EQ(stage.down(.5f, .5f), 100);
    // 1e30 is no coordinate that could be multiplied: its faces go, the others stay.
    stage.move({{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1e30f, 0, 0}});
    EXPECT_FLOAT_EQ(stage.down(.2f, .7f), 100);
    EXPECT_LT(stage.down(.7f, .2f), 0);
    EXPECT_GE(stage.warnings(), 1u);
}

TEST(MeshGeometry, OneBrokenVertexTakesItsFacesAndComesBack) {
    Array<Vec3f> points;
    Array<std::int32_t> index;
    addSquares(10, points, index);
    Stage stage;
    stage.show(points, index);
    for (const float bad : {kNan, kInfinity, -kInfinity, 3e38f}) {
        for (int axis = 0; axis < 3; ++axis) {
            Array<Vec3f> broken = points;
            broken.mutableData()[4 * 3 + 1][axis] = bad;  // of the first triangle of square 3 alone
            stage.move(broken);
            for (int i = 0; i < 10; ++i) {
                EXPECT_EQ(stage.down(static_cast<float>(i) + .3f, .6f) > 0, i != 3);
                EXPECT_GT(stage.down(static_cast<float>(i) + .6f, .3f), 0);
            }
            stage.move(points);
            EXPECT_FLOAT_EQ(stage.down(3.3f, .6f), 100);
        }
    }
}

TEST(MeshGeometry, WildTransformsNeverReachEmbree) {
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const double values[] = {
        0,        1,         -1,  1e-20,  1e-300, 1e20, 1e300, std::numeric_limits<double>::quiet_NaN(),
        HUGE_VAL, -HUGE_VAL, 1e9, 5e-324, 1e-9};
    const auto mesh = test::makeSphere(2);
    RayWorld world({.buildThreads = 1});
    InstanceDelta delta;
    delta.geometries.push_back({NodeId{1}, mesh});
    for (std::uint32_t slot = 0; slot < 8; ++slot) delta.added.push_back(test::makeInstance(slot, NodeId{1}));
    world.apply(delta);
    for (int step = 0; step < 2000; ++step) {
        delta.clear();
        // Slot 0 stays good.
        const auto slot = static_cast<std::uint32_t>(1 + random() % 7);
        WorldFromLocal m(1.0);
        for (int i = 0; i < 4; ++i)
            for (int k = 0; k < 3; ++k)
                if (random() % 3 == 0) m[i][k] = values[random() % std::size(values)];
        delta.moved.push_back({{slot, 0}, m});
        if (step % 5 == 0) delta.moved.push_back({{slot % 7 + 1, 0}, test::randomTransform(random, 3)});
        world.apply(delta);
        for (int i = 0; i < 10; ++i) {
            std::uniform_real_distribution<float> unit(-1, 1);
            const Vec3f from = 4.f * glm::normalize(Vec3f(unit(random), unit(random), unit(random)));
            const Ray ray{.origin = from, .direction = -from};
            EXPECT_TRUE(world.intersect(ray));
            RayPacket16 packet;
            for (int lane = 0; lane < 16; ++lane) packet.set(lane, ray);
            EXPECT_EQ(world.intersect(packet), 0xFFFFu);
            EXPECT_TRUE(world.occluded(ray));
        }
    }
    EXPECT_FALSE(world.diagnostics().all().empty());
}

}  // namespace
}  // namespace rtsg
