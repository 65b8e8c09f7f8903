// Meshes that change in ways that are bad for a refitted BVH. The tree's quality is measured without a clock: a query
// for the triangles near a point is shown all those in the leaves it comes to.
#include <random>

#include "embree/mesh_bvh.h"
#include "renderers/world/deform_support.h"

namespace rtsg {
namespace {

using test::moved, test::twist;

/// Triangles that queries at random points of the mesh are shown: those whose leaf's box is met.
std::size_t visits(RTCScene scene, const Mesh& mesh, unsigned seed) {
    std::mt19937 random(seed);
    std::size_t count = 0;
    for (int i = 0; i < 400; ++i) {
        const std::uint32_t t = random() % mesh.triangleCount;
        const Vec3f p = (mesh.vertex(t, 0) + mesh.vertex(t, 1) + mesh.vertex(t, 2)) / 3.0f;
        RTCPointQuery query{};
        query.x = p.x, query.y = p.y, query.z = p.z, query.radius = 1e-4f;
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        rtcPointQuery(
            scene, &query, &context,
            [](RTCPointQueryFunctionArguments* arguments) {
                ++*static_cast<std::size_t*>(arguments->userPtr);
                return false;
            },
            &count);
    }
    return count;
}

struct Bvhs {
    bvh::Device device{1, true};
    Worker worker{"test"};
    std::unique_ptr<bvh::MeshBvh> followed;

    void show(const std::shared_ptr<const Mesh>& mesh) {
        if (!followed)
            followed = std::make_unique<bvh::MeshBvh>(device, worker, mesh);
        else
            followed->wait(), followed->update(mesh);
        followed->commit();
    }
    /// Work of the followed tree in parts of a new one's.
    double work(const std::shared_ptr<const Mesh>& mesh) {
        bvh::MeshBvh fresh(device, worker, mesh);
        fresh.commit();
        return static_cast<double>(visits(followed->scene(), *mesh, 4)) /
               static_cast<double>(visits(fresh.scene(), *mesh, 4));
    }
    ~Bvhs() { followed.reset(); }
};

TEST(MeshRefit, ThousandsOfRefitsKeepHitsAndQuality) {
    const auto rest = test::makeSphere(5);
    std::mt19937 random(2);
    Bvhs bvhs;
    test::OneShape shape;
    double worst = 0;
    for (int step = 0; step < 3000; ++step) {
        const auto t = static_cast<float>(step) * .01f;
        const auto mesh =
            moved(*rest, [&](Vec3f p) { return twist(p * Vec3f(1, 2 + std::sin(t), .4f), 3 * std::sin(.7f * t)); });
        bvhs.show(mesh);
        shape.show(mesh);
        if (step % 100 != 99) continue;
        worst = std::max(worst, bvhs.work(mesh));
        test::OneShape fresh;
        fresh.show(mesh);
        ASSERT_TRUE(test::sameHits(shape.world, fresh.world, random, 200)) << "step " << step;
    }
    EXPECT_LT(worst, 1.6);
    EXPECT_GT(bvhs.followed->counts().refits, 2500u);
    EXPECT_GT(bvhs.followed->counts().rebuilds, 5u);
    EXPECT_LT(bvhs.followed->counts().rebuilds, 600u);
}

TEST(MeshRefit, RebuiltBehindTheFramesItIsSound) {
    // Nobody waits: refits and rays go on while the worker builds.
    const auto rest = test::makeSphere(6);
    std::mt19937 random(8);
    RayWorld world({.buildThreads = 1});
    InstanceDelta delta;
    delta.added.push_back(test::makeInstance(0, NodeId{1}));
    delta.added[0].motion = Motion::moving;
    std::shared_ptr<Mesh> mesh;
    for (int step = 0; step < 120; ++step) {
        const float t = .05f * static_cast<float>(step);
        mesh = moved(*rest, [&](Vec3f p) { return twist(p * Vec3f(1, 3, .4f), 3 * std::sin(t)); });
        delta.geometries.push_back({NodeId{1}, mesh});
        world.apply(delta);
        delta.clear();
        for (int i = 0; i < 20; ++i) {
            std::uniform_real_distribution<float> unit(-.1f, .1f);
            const Vec3f from = 6.f * glm::normalize(Vec3f(unit(random), unit(random), 1));
            ASSERT_TRUE(
                world.intersect({.origin = from, .direction = Vec3f(unit(random), unit(random), 0) * .1f - from}));
        }
    }
    world.finishBackgroundWork();
    test::OneShape fresh;
    fresh.show(mesh);
    EXPECT_TRUE(test::sameHits(world, fresh.world, random, 500));
}

TEST(MeshRefit, WithoutRebuildsTheSameWouldSpoilTheTree) {
    // For comparison with the bound above: one refit over the whole way.
    const auto rest = test::makeSphere(5);
    const bvh::Device device(1, true);
    const auto end = moved(*rest, [](Vec3f p) { return twist(p * Vec3f(1, 3, .4f), 3); });
    const bvh::SceneHandle scene = device.newScene(RTC_BUILD_QUALITY_LOW);
    const bvh::GeometryHandle geometry = bvh::makeTriangles(device, {rest, rest->positions}, RTC_BUILD_QUALITY_REFIT);
    rtcAttachGeometryByID(scene.get(), geometry.get(), 0);
    rtcCommitScene(scene.get());
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, end->positions.data(), 0,
                               sizeof(Vec3f), end->positions.size());
    rtcUpdateGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry.get());
    rtcCommitScene(scene.get());
    Worker worker("test");
    bvh::MeshBvh fresh(device, worker, end);
    fresh.commit();
    EXPECT_GT(static_cast<double>(visits(scene.get(), *end, 4)),
              1.6 * static_cast<double>(visits(fresh.scene(), *end, 4)));
}

TEST(MeshRefit, AMeshThatCollapsesToAPointReturnsWhole) {
    std::mt19937 random(6);
    for (const int levels : {2, 5}) {
        const auto rest = test::makeSphere(levels);
        test::OneShape shape;
        // Once it is built as a point, once it becomes one later.
        for (const float size : {0.f, 0.f, 1.f, 1.f, .5f, 0.f, 1e-20f, 0.f, 1.f, 2.f, 2.f}) {
            const auto mesh = moved(*rest, [&](Vec3f p) { return size * p + Vec3f(1, 2, 3); });
            shape.show(mesh);
            if (size < .1f) {
                EXPECT_FALSE(shape.world.intersect({.origin = {1.3f, 2.1f, 9}}));
                continue;
            }
            test::OneShape fresh;
            fresh.show(mesh);
            ASSERT_TRUE(test::sameHits(shape.world, fresh.world, random, 300)) << "size " << size;
        }
    }
}

TEST(MeshRefit, ATreeBuiltOfAPointIsReplaced) {
    const auto rest = test::makeSphere(5);
    Bvhs bvhs;
    const auto point = moved(*rest, [](Vec3f) { return Vec3f(1); });
    for (int i = 0; i < 3; ++i) bvhs.show(moved(*point, [](Vec3f p) { return p; }));
    for (int i = 0; i < 4; ++i) bvhs.show(moved(*rest, [](Vec3f p) { return p; }));
    EXPECT_LT(bvhs.work(rest), 1.2);
}

TEST(MeshRefit, ScatteredAndGatheredAtRandomItStaysSound) {
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto rest = test::makeSphere(4);
    test::OneShape shape;
    for (int step = 0; step < 60; ++step) {
        std::normal_distribution<float> normal(0, random() % 3 ? .01f : 5.f);
        const auto mesh =
            moved(*rest, [&](Vec3f p) { return p + Vec3f(normal(random), normal(random), normal(random)); });
        shape.show(mesh);
        if (step % 10 != 9) continue;
        test::OneShape fresh;
        fresh.show(mesh);
        ASSERT_TRUE(test::sameHits(shape.world, fresh.world, random, 300)) << "step " << step;
    }
}

}  // namespace
}  // namespace rtsg
