// Skinned humanoids against a closed form in double: an arm of two bones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {
namespace {

/// About z, in the plane.
Vec3d turned(Vec3d p, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return {c * p.x - s * p.y, s * p.x + c * p.y, p.z};
}

/// Upper arm from 0 to 1 along y, forearm from 1 to 2; a tube around both, blended across the elbow.
struct Arm final : Subscriber {
    Scene scene;
    NodeId humanoid, upper, fore, coordinate, faces;
    Array<Vec3f> rest;
    std::vector<double> foreWeight;
    Flattener flattener;
    RayWorld world{{.buildThreads = 1}};
    std::shared_ptr<const Mesh> mesh;
    Attachment attachment;
    double time = 0;

    Arm() {
        humanoid = scene.createNode(x3d::HAnimHumanoid::type);
        upper = scene.createNode(x3d::HAnimJoint::type), fore = scene.createNode(x3d::HAnimJoint::type);
        coordinate = scene.createNode(x3d::Coordinate::type), faces = scene.createNode(x3d::IndexedFaceSet::type);
        const NodeId shape = scene.createNode(x3d::Shape::type);
        Array<std::int32_t> index, upperIndex, foreIndex;
        Array<float> upperWeights, foreWeights;
        constexpr int kRings = 21, kAround = 8;
        for (int ring = 0; ring < kRings; ++ring)
            for (int k = 0; k < kAround; ++k) {
                const float y = 2.f * static_cast<float>(ring) / (kRings - 1),
                            a = 6.2831853f * static_cast<float>(k) / kAround;
                const auto i = static_cast<std::int32_t>(rest.size());
                rest.push_back({.2f * std::cos(a), y, .2f * std::sin(a)});
                const float w = std::clamp((y - .7f) / .6f, 0.f, 1.f);
                foreWeight.push_back(double{w});
                if (w < 1) upperIndex.push_back(i), upperWeights.push_back(1 - w);
                if (w > 0) foreIndex.push_back(i), foreWeights.push_back(w);
                if (ring + 1 == kRings) continue;
                const std::int32_t b = ring * kAround + (k + 1) % kAround;
                for (const std::int32_t v : {i, i + kAround, b, -1, b, i + kAround, b + kAround, -1})
                    index.push_back(v);
            }
        const auto set = [&](NodeId node, auto field, auto value) { EXPECT_TRUE(scene.set(node, field, value)); };
        set(coordinate, x3d::Coordinate::point, rest);
        set(faces, x3d::IndexedFaceSet::coordIndex, index);
        set(faces, x3d::IndexedFaceSet::coord, coordinate);
        set(shape, x3d::Shape::geometry, faces);
        set(upper, x3d::HAnimJoint::skinCoordIndex, upperIndex);
        set(upper, x3d::HAnimJoint::skinCoordWeight, upperWeights);
        set(fore, x3d::HAnimJoint::skinCoordIndex, foreIndex);
        set(fore, x3d::HAnimJoint::skinCoordWeight, foreWeights);
        set(fore, x3d::HAnimJoint::center, Vec3f(0, 1, 0));
        set(humanoid, x3d::HAnimHumanoid::skinCoord, coordinate);
        set(humanoid, x3d::HAnimHumanoid::translation, Vec3f(5, 0, 0));
        EXPECT_TRUE(scene.insertChild(upper, x3d::HAnimJoint::children, fore));
        EXPECT_TRUE(scene.insertChild(humanoid, x3d::HAnimHumanoid::skeleton, upper));
        for (const NodeId joint : {upper, fore})
            EXPECT_TRUE(scene.insertChild(humanoid, x3d::HAnimHumanoid::joints, joint));
        EXPECT_TRUE(scene.insertChild(humanoid, x3d::HAnimHumanoid::skin, shape));
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, humanoid));
        attachment = scene.bus().attach(*this);
    }
    Result<> apply(const Scene& s, const ChangeSet& changes) override {
        const InstanceDelta& delta = flattener.apply(s, changes);
        for (const InstanceDelta::Geometry& geometry : delta.geometries) mesh = geometry.mesh;
        world.apply(delta);
        return {};
    }
    void pose(float shoulder, float elbow) {
        EXPECT_TRUE(scene.set(upper, x3d::HAnimJoint::rotation, Rotation{0, 0, 1, shoulder}));
        EXPECT_TRUE(scene.set(fore, x3d::HAnimJoint::rotation, Rotation{0, 0, 1, elbow}));
        frame();
    }
    void frame() { scene.newFrame(time += .01); }

    Vec3d expected(std::size_t i, double shoulder, double elbow) const {
        const Vec3d p(rest[i]), joint(0, 1, 0);
        const Vec3d byUpper = turned(p, shoulder), byFore = turned(joint + turned(p - joint, elbow), shoulder);
        return (1 - foreWeight[i]) * byUpper + foreWeight[i] * byFore;
    }
    void expectPose(double shoulder, double elbow, double tolerance = 1e-6) const {
        ASSERT_TRUE(mesh);
        ASSERT_EQ(mesh->positions.size(), rest.size());
        for (std::size_t i = 0; i < rest.size(); ++i)
            EXPECT_LT(glm::length(Vec3d(mesh->positions[i]) - expected(i, shoulder, elbow)), tolerance)
                << "point " << i;
    }
};

TEST(Skin, FollowsTwoBones) {
    Arm arm;
    arm.frame();
    arm.expectPose(0, 0);
    for (int step = 0; step < 40; ++step) {
        const float shoulder = std::sin(.3f * static_cast<float>(step)),
                    elbow = 1.2f * std::sin(.5f * static_cast<float>(step));
        const std::shared_ptr<const Mesh> before = arm.mesh;
        arm.pose(shoulder, elbow);
        arm.expectPose(double{shoulder}, double{elbow});
        EXPECT_EQ(findDefect(*arm.mesh), "");
        EXPECT_TRUE(arm.mesh->triangles.sameStorage(before->triangles));
    }
    EXPECT_GT(arm.world.stats().meshRefits, 20u);
}

TEST(Skin, RaysMeetTheBentArm) {
    Arm arm;
    arm.frame();
    arm.pose(0, 1.5707963f);
    // The forearm now lies along -x at height 1, the humanoid stands at x = 5.
    const Hit hit = arm.world.intersect({.origin = {4.3f, 5, 0}, .direction = {0, -1, 0}});
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit.t, 3.8f, .02f);
    EXPECT_FALSE(arm.world.intersect({.origin = {5, 1.9f, 5}, .direction = {0, 0, -1}}));
}

TEST(Skin, FollowedEqualsFromScratch) {
    Arm arm;
    arm.frame();
    for (const float angle : {.3f, -.8f, 2.f}) {
        arm.pose(angle, -angle);
        Flattener fresh;
        std::shared_ptr<const Mesh> mesh;
        const ChangeSet snapshot = arm.scene.snapshot();
        for (const auto& geometry : fresh.apply(arm.scene, snapshot).geometries) mesh = geometry.mesh;
        ASSERT_TRUE(mesh);
        EXPECT_EQ(mesh->positions, arm.mesh->positions);
    }
}

TEST(Skin, FollowsRestPointsWeightsAndDisplacers) {
    Arm arm;
    arm.frame();
    arm.pose(.4f, .6f);
    // The rest points move: so does the skin.
    Vec3f* points = arm.rest.mutableData();
    for (std::size_t i = 0; i < arm.rest.size(); ++i) points[i].z *= 2;
    ASSERT_TRUE(arm.scene.set(arm.coordinate, x3d::Coordinate::point, arm.rest));
    arm.frame();
    arm.expectPose(double{.4f}, double{.6f});
    // A displacer of the forearm, in its frame.
    const NodeId displacer = arm.scene.createNode(x3d::HAnimDisplacer::type);
    const auto last = static_cast<std::int32_t>(arm.rest.size() - 1);
    ASSERT_TRUE(arm.scene.set(displacer, x3d::HAnimDisplacer::coordIndex, Array<std::int32_t>{last, 99999, -7}));
    ASSERT_TRUE(
        arm.scene.set(displacer, x3d::HAnimDisplacer::displacements, Array<Vec3f>{{0, 1, 0}, {1, 1, 1}, {1, 1, 1}}));
    ASSERT_TRUE(arm.scene.insertChild(arm.fore, x3d::HAnimJoint::displacers, displacer));
    arm.frame();
    arm.expectPose(double{.4f}, double{.6f});
    ASSERT_TRUE(arm.scene.set(displacer, x3d::HAnimDisplacer::weight, .5f));
    arm.frame();
    const auto at = static_cast<std::size_t>(last);
    const Vec3d wanted = arm.expected(at, double{.4f}, double{.6f}) + turned({0, .5, 0}, double{.4f} + double{.6f});
    EXPECT_LT(glm::length(Vec3d(arm.mesh->positions[at]) - wanted), 1e-6);
    // Indices that are not there and weights that are none move nothing.
    ASSERT_TRUE(arm.scene.set(displacer, x3d::HAnimDisplacer::weight, 0.f));
    ASSERT_TRUE(arm.scene.set(arm.fore, x3d::HAnimJoint::skinCoordIndex, Array<std::int32_t>{-1, 1 << 30, 3}));
    ASSERT_TRUE(arm.scene.set(arm.fore, x3d::HAnimJoint::skinCoordWeight, Array<float>{1, 1, NAN}));
    arm.frame();
    EXPECT_EQ(findDefect(*arm.mesh), "");
}

// The normals of skinNormal turn as the joints turn the surface: by the transposed inverse, weighted as the points.
TEST(Skin, NormalsFollowTheJoints) {
    Arm arm;
    Array<Vec3f> normals;
    for (const Vec3f& p : arm.rest) normals.push_back(glm::normalize(Vec3f(p.x, .3f, p.z)));
    const NodeId normal = arm.scene.createNode(x3d::Normal::type);
    ASSERT_TRUE(arm.scene.set(normal, x3d::Normal::vector, normals));
    ASSERT_TRUE(arm.scene.set(arm.faces, x3d::IndexedFaceSet::normal, normal));
    ASSERT_TRUE(arm.scene.set(arm.humanoid, x3d::HAnimHumanoid::skinNormal, normal));
    arm.frame();
    const auto expectNormals = [&](double shoulder, double elbow, double scale) {
        ASSERT_TRUE(arm.mesh && arm.mesh->normals.present());
        for (std::uint32_t t = 0; t < arm.mesh->triangleCount; ++t)
            for (std::uint32_t c = 0; c < 3; ++c) {
                const auto i = arm.mesh->vertexIndex(t, c);
                const Vec3d n(normals[i]), byUpper = turned(n, shoulder);
                const Vec3d byFore = turned(turned(n / Vec3d(1, scale, 1), elbow), shoulder);
                const Vec3d wanted = (1 - arm.foreWeight[i]) * byUpper + arm.foreWeight[i] * byFore;
                EXPECT_LT(glm::length(Vec3d(arm.mesh->normals.value(t, c)) - wanted), 1e-6) << "point " << i;
            }
    };
    expectNormals(0, 0, 1);
    for (const float angle : {.5f, -1.1f}) {
        const std::shared_ptr<const Mesh> before = arm.mesh;
        arm.pose(angle, 2 * angle);
        expectNormals(double{angle}, 2 * double{angle}, 1);
        EXPECT_TRUE(arm.mesh->triangles.sameStorage(before->triangles)) << "bent, not made anew";
    }
    ASSERT_TRUE(arm.scene.set(arm.fore, x3d::HAnimJoint::scale, Vec3f(1, 2, 1)));
    arm.pose(.4f, .2f);
    expectNormals(double{.4f}, double{.2f}, 2);
    // At rest they may be others; a list of another length turns nothing.
    const NodeId binding = arm.scene.createNode(x3d::Normal::type);
    for (std::size_t i = 0; i < normals.size(); ++i) normals.mutableData()[i] = {0, 0, 1};
    ASSERT_TRUE(arm.scene.set(binding, x3d::Normal::vector, normals));
    ASSERT_TRUE(arm.scene.set(arm.humanoid, x3d::HAnimHumanoid::skinBindingNormals, binding));
    arm.frame();
    expectNormals(double{.4f}, double{.2f}, 2);
    ASSERT_TRUE(arm.scene.set(binding, x3d::Normal::vector, Array<Vec3f>{{1, 0, 0}}));
    arm.frame();
    EXPECT_EQ(Vec3f(arm.mesh->normals.value(0, 0)).y,
              arm.scene.node(normal).get(x3d::Normal::vector)[arm.mesh->vertexIndex(0, 0)].y);
}

// 26.3.5: a segment's displacers move the points of its coord, by weight times displacement.
TEST(Skin, DisplacersOfASegmentMoveItsPoints) {
    Arm arm;
    arm.frame();
    const NodeId segment = arm.scene.createNode(x3d::HAnimSegment::type),
                 shape = arm.scene.createNode(x3d::Shape::type);
    const NodeId faces = arm.scene.createNode(x3d::IndexedFaceSet::type);
    const NodeId coordinate = arm.scene.createNode(x3d::Coordinate::type);
    const Array<Vec3f> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    ASSERT_TRUE(arm.scene.set(coordinate, x3d::Coordinate::point, points));
    ASSERT_TRUE(arm.scene.set(faces, x3d::IndexedFaceSet::coord, coordinate));
    ASSERT_TRUE(arm.scene.set(faces, x3d::IndexedFaceSet::coordIndex, Array<std::int32_t>{0, 1, 2, -1}));
    ASSERT_TRUE(arm.scene.set(shape, x3d::Shape::geometry, faces));
    ASSERT_TRUE(arm.scene.set(segment, x3d::HAnimSegment::coord, coordinate));
    ASSERT_TRUE(arm.scene.insertChild(segment, x3d::HAnimSegment::children, shape));
    ASSERT_TRUE(arm.scene.insertChild(arm.fore, x3d::HAnimJoint::children, segment));
    NodeId displacers[2];
    for (NodeId& displacer : displacers) {
        displacer = arm.scene.createNode(x3d::HAnimDisplacer::type);
        ASSERT_TRUE(arm.scene.insertChild(segment, x3d::HAnimSegment::displacers, displacer));
    }
    ASSERT_TRUE(arm.scene.set(displacers[0], x3d::HAnimDisplacer::coordIndex, Array<std::int32_t>{1, 2}));
    ASSERT_TRUE(arm.scene.set(displacers[0], x3d::HAnimDisplacer::displacements, Array<Vec3f>{{2, 0, 0}, {0, 0, 1}}));
    ASSERT_TRUE(arm.scene.set(displacers[1], x3d::HAnimDisplacer::coordIndex, Array<std::int32_t>{2, -1, 9}));
    ASSERT_TRUE(arm.scene.set(displacers[1], x3d::HAnimDisplacer::displacements, Array<Vec3f>{{0, 4, 0}, {1, 1, 1}}));
    arm.frame();
    ASSERT_TRUE(arm.scene.set(displacers[0], x3d::HAnimDisplacer::weight, .5f));
    ASSERT_TRUE(arm.scene.set(displacers[1], x3d::HAnimDisplacer::weight, -.25f));
    arm.frame();
    EXPECT_EQ(arm.mesh->positions, (Array<Vec3f>{{0, 0, 0}, {2, 0, 0}, {0, 0, .5f}}));
    Flattener fresh;
    std::vector<std::shared_ptr<const Mesh>> meshes;
    for (const auto& geometry : fresh.apply(arm.scene, arm.scene.snapshot()).geometries)
        meshes.push_back(geometry.mesh);
    EXPECT_TRUE(std::ranges::any_of(meshes, [&](const auto& m) { return m->positions == arm.mesh->positions; }));
    for (const float weight : {0.f, .5f}) {
        for (const NodeId displacer : displacers)
            ASSERT_TRUE(arm.scene.set(displacer, x3d::HAnimDisplacer::weight, weight));
        arm.frame();
        EXPECT_EQ(arm.mesh->positions == points, weight == 0);
    }
    ASSERT_TRUE(arm.scene.set(segment, x3d::HAnimSegment::displacers, Array<NodeId>{}));
    arm.frame();
    EXPECT_EQ(arm.mesh->positions, points);
}

// Weights need not sum to 1: each joint moves a point by its weight times the way it would go, and what no joint lists
// stays where it is. A joint's displacers turn with it, whatever the weights of the points.
TEST(Skin, WeightsThatDoNotSumToOneMoveBySharesOfTheWay) {
    Arm arm;
    ASSERT_TRUE(arm.scene.set(arm.upper, x3d::HAnimJoint::skinCoordIndex, Array<std::int32_t>{0, 1, 2}));
    ASSERT_TRUE(arm.scene.set(arm.upper, x3d::HAnimJoint::skinCoordWeight, Array<float>{.5f, 1.f, -.25f}));
    ASSERT_TRUE(arm.scene.set(arm.fore, x3d::HAnimJoint::skinCoordIndex, Array<std::int32_t>{1, 3}));
    ASSERT_TRUE(arm.scene.set(arm.fore, x3d::HAnimJoint::skinCoordWeight, Array<float>{.75f}));
    NodeId displacers[2];
    for (int i = 0; i < 2; ++i) {
        displacers[i] = arm.scene.createNode(x3d::HAnimDisplacer::type);
        ASSERT_TRUE(arm.scene.set(displacers[i], x3d::HAnimDisplacer::coordIndex, Array<std::int32_t>{0, 5}));
        ASSERT_TRUE(
            arm.scene.set(displacers[i], x3d::HAnimDisplacer::displacements, Array<Vec3f>{{1, 2, 3}, {0, 1, 0}}));
        ASSERT_TRUE(arm.scene.set(displacers[i], x3d::HAnimDisplacer::weight, i == 0 ? .5f : -1.5f));
        ASSERT_TRUE(arm.scene.insertChild(i == 0 ? arm.upper : arm.fore, x3d::HAnimJoint::displacers, displacers[i]));
    }
    arm.pose(.7f, -.4f);
    const double shoulder = double{.7f}, elbow = double{-.4f};
    const auto byUpper = [&](const Vec3d& p) { return turned(p, shoulder) - p; };
    const auto byFore = [&](const Vec3d& p) {
        const Vec3d joint(0, 1, 0);
        return turned(joint + turned(p - joint, elbow), shoulder) - p;
    };
    const auto displaced = [&](const Vec3d& by) {
        return .5 * turned(by, shoulder) - 1.5 * turned(by, shoulder + elbow);
    };
    const Vec3d p[] = {Vec3d(arm.rest[0]), Vec3d(arm.rest[1]), Vec3d(arm.rest[2]),
                       Vec3d(arm.rest[3]), Vec3d(arm.rest[4]), Vec3d(arm.rest[5])};
    const Vec3d wanted[] = {p[0] + .5 * byUpper(p[0]) + displaced({1, 2, 3}),
                            p[1] + byUpper(p[1]) + .75 * byFore(p[1]),
                            p[2] - .25 * byUpper(p[2]),
                            p[3] + byFore(p[3]),
                            p[4],
                            p[5] + displaced({0, 1, 0})};
    for (std::size_t i = 0; i < 6; ++i)
        EXPECT_LT(glm::length(Vec3d(arm.mesh->positions[i]) - wanted[i]), 1e-6) << "point " << i;
}

TEST(Skin, WithoutJointsOrWithoutSkinItIsTheRestPose) {
    Arm arm;
    arm.frame();
    arm.pose(1, 1);
    ASSERT_TRUE(arm.scene.set(arm.humanoid, x3d::HAnimHumanoid::skinCoord, NodeId{}));
    arm.frame();
    EXPECT_EQ(arm.mesh->positions, arm.rest);
    ASSERT_TRUE(arm.scene.set(arm.humanoid, x3d::HAnimHumanoid::skinCoord, arm.coordinate));
    arm.frame();
    arm.expectPose(1, 1);
    ASSERT_TRUE(arm.scene.removeChild(arm.humanoid, x3d::HAnimHumanoid::skeleton.index, 0));
    arm.frame();
    EXPECT_EQ(arm.mesh->positions, arm.rest);
}

/// 26.3.2: what is drawn of skinCoord is where the joints have moved it, lines and points too.
TEST(Skin, LinesAndPointsGoWhereFacesGo) {
    const std::string skins[] = {"TriangleSet { coord USE C }", "LineSet { vertexCount 3 coord USE C }",
                                 "IndexedLineSet { coordIndex [ 0 1 2 0 -1 ] coord USE C }",
                                 "PointSet { coord USE C }"};
    for (const std::string& skin : skins) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nDEF H HAnimHumanoid { version \"2.0\" "
                             "skinCoord DEF C Coordinate { point [ 0 0 0 1 0 0 1 .5 0 ] } "
                             "skeleton DEF J HAnimJoint { rotation 0 0 1 1.5707963 skinCoordIndex [ 0 1 2 ] "
                             "skinCoordWeight [ 1 1 1 ] } joints USE J skin Shape { geometry " +
                                 skin + " } }",
                             diagnostics))
            << skin;
        Flattener flattener;
        std::shared_ptr<const Mesh> mesh;
        const auto take = [&](const InstanceDelta& delta) {
            for (const auto& g : delta.geometries) mesh = g.mesh;
        };
        const auto expectBox = [&](const Vec3f& low, const Vec3f& high) {
            ASSERT_TRUE(mesh) << skin;
            for (int axis = 0; axis < 3; ++axis) {
                EXPECT_NEAR(mesh->bounds.min[axis], low[axis], 1e-6) << skin << axis;
                EXPECT_NEAR(mesh->bounds.max[axis], high[axis], 1e-6) << skin << axis;
            }
        };
        take(flattener.apply(scene, scene.snapshot()));
        expectBox({-.5f, 0, 0}, {0, 1, 0});
        const auto rotation = [&](float angle) {
            ASSERT_TRUE(scene.set(scene.findName("J"), x3d::HAnimJoint::rotation, Rotation{0, 0, 1, angle}));
            take(flattener.apply(scene, *scene.seal()));
        };
        rotation(3.14159265f);
        expectBox({-1, -.5f, 0}, {0, 0, 0});
        rotation(0);
        expectBox({0, 0, 0}, {1, .5f, 0});
    }
}

TEST(Skin, IndicesBeyondThePointsAreTold) {
    Arm arm;
    EXPECT_TRUE(arm.flattener.diagnostics().all().empty());
    Array<std::int32_t> index = arm.scene.node(arm.fore).get(x3d::HAnimJoint::skinCoordIndex);
    const std::size_t last = index.size();
    index.push_back(168);  // 21 rings of 8
    for (int frame = 1; frame < 4; ++frame) {
        ASSERT_TRUE(arm.scene.set(arm.fore, x3d::HAnimJoint::skinCoordIndex, index));
        arm.scene.newFrame(frame);
    }
    ASSERT_EQ(arm.flattener.diagnostics().all().size(), 1u);
    EXPECT_EQ(arm.flattener.diagnostics().all()[0].text, "HAnimJoint: skinCoordIndex[" + std::to_string(last) +
                                                             "] is 168, but skinCoord has 168 points, counted "
                                                             "from 0");
}

}  // namespace
}  // namespace rtsg
