// The Flattener: one instance a path, and small deltas for small changes.
#include "flattener_oracle.h"

namespace rtsg {
namespace {

using namespace test;

struct Fixture : testing::Test {
    Scene scene;
    Meshes meshes;
    std::unique_ptr<SharedWorld> world = std::make_unique<SharedWorld>(
        scene, SharedWorld::Options{.flattening = {.meshes = meshes.source()}, .rays = {}});
    SharedWorld& flat = *world;
    Watcher watcher;
    void SetUp() override { flat.add(watcher); }
    NodeId add(TypeIndex type, NodeId parent) {
        const NodeId id = scene.createNode(type);
        const FieldIndex field = scene.node(parent).type().findExact("children");
        EXPECT_TRUE(scene.insertChild(parent, field, id));
        return id;
    }
    NodeId addShape(NodeId parent, TypeIndex geometry = x3d::Box::type) {
        const NodeId shape = add(x3d::Shape::type, parent);
        EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, scene.createNode(geometry)));
        EXPECT_TRUE(scene.set(shape, x3d::Shape::appearance, scene.createNode(x3d::Appearance::type)));
        return shape;
    }
    const InstanceDelta& seal() {
        watcher.last.clear();
        scene.seal();
        return watcher.last;
    }
};
using FlattenerCase = Fixture;

TEST_F(FlattenerCase, AMoveTouchesNothingElse) {
    const NodeId mover = add(x3d::Transform::type, scene.root());
    addShape(mover);
    for (int i = 0; i < 100; ++i) addShape(scene.root());
    seal();
    EXPECT_TRUE(scene.set(mover, x3d::Transform::translation, Vec3f(1, 2, 3)));
    ASSERT_EQ(seal().rebound.size(), 1u) << "that it has been seen to move";
    EXPECT_TRUE(scene.set(mover, x3d::Transform::translation, Vec3f(1, 2, 4)));
    const InstanceDelta& delta = seal();
    ASSERT_EQ(delta.moved.size(), 1u);
    EXPECT_EQ(delta.moved[0].worldFromLocal[3], Vec3d(1, 2, 4));
    EXPECT_TRUE(delta.added.empty() && delta.removed.empty() && delta.rebound.empty() && delta.geometries.empty());
    EXPECT_EQ(meshes.created, 101);
}

// Found by a follower under load: one set in which a light comes into a group, and then what is above the group goes.
TEST_F(FlattenerCase, ALightMayComeBelowWhatTheSameSetDestroys) {
    const NodeId above = add(x3d::Group::type, scene.root()), group = add(x3d::Group::type, above);
    EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, group));
    addShape(group);
    EXPECT_EQ(seal().added.size(), 2u);
    const NodeId light = scene.createNode(x3d::PointLight::type);
    EXPECT_TRUE(scene.set(light, x3d::PointLight::global, true));
    Array<NodeId> children = scene.node(group).get(x3d::Group::children);
    children.push_back(light);
    EXPECT_TRUE(scene.set(group, x3d::Group::children, std::move(children)));
    EXPECT_TRUE(scene.set(scene.root(), x3d::RtsgScene::children, Array<NodeId>{group}));
    EXPECT_TRUE(scene.destroyNode(above));
    const InstanceDelta& delta = seal();
    EXPECT_EQ(flat.failure(), "");
    EXPECT_EQ(delta.removed.size(), 1u);
    expectSame(scene, flat.flattener(), watcher.follower);
}

TEST_F(FlattenerCase, WhatIsWhollyTransparentIsClear) {
    const NodeId shape = addShape(scene.root());
    const NodeId appearance = scene.node(shape).get(x3d::Shape::appearance);
    const NodeId material = scene.createNode(x3d::Material::type);
    EXPECT_TRUE(scene.set(appearance, x3d::Appearance::material, material));
    ASSERT_EQ(seal().added.size(), 1u);
    const auto rebound = [&](float transparency) {
        EXPECT_TRUE(scene.set(material, x3d::Material::transparency, transparency));
        const InstanceDelta& delta = seal();
        EXPECT_EQ(delta.appearanceChanged.size(), 1u);
        return delta.rebound.size();
    };
    const auto isClear = [&] { return flat.flattener().instances()[0].clear; };
    EXPECT_FALSE(isClear());
    EXPECT_EQ(rebound(.99f), 0u) << "it is still to be seen, and nobody need look at shapes";
    EXPECT_EQ(rebound(1), 1u);
    EXPECT_TRUE(isClear());
    EXPECT_EQ(rebound(1.5f), 0u);
    EXPECT_EQ(rebound(.5f), 1u);
    EXPECT_FALSE(isClear());
    EXPECT_EQ(rebound(1), 1u);
    EXPECT_TRUE(scene.set(appearance, x3d::Appearance::fillProperties, scene.createNode(x3d::FillProperties::type)));
    seal();
    EXPECT_FALSE(isClear()) << "hatches show";
    const NodeId fill = scene.node(appearance).get(x3d::Appearance::fillProperties);
    EXPECT_TRUE(scene.set(fill, x3d::FillProperties::filled, false));
    EXPECT_TRUE(scene.set(fill, x3d::FillProperties::hatched, false));
    seal();
    EXPECT_TRUE(isClear());
    EXPECT_TRUE(scene.set(material, x3d::Material::transparency, 0.0f));
    seal();
    EXPECT_TRUE(isClear()) << "neither filled nor hatched";
    EXPECT_TRUE(scene.set(fill, x3d::FillProperties::filled, true));
    seal();
    EXPECT_FALSE(isClear());
    EXPECT_TRUE(scene.set(material, x3d::Material::transparency, 1.0f));
    seal();
    EXPECT_TRUE(scene.set(appearance, x3d::Appearance::fillProperties, NodeId{}));
    seal();
    EXPECT_TRUE(isClear());
    // Colours with an alpha stand in for the transparency, those without do not.
    const NodeId faces = scene.createNode(x3d::IndexedFaceSet::type);
    EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, faces));
    seal();
    EXPECT_TRUE(isClear());
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::color, scene.createNode(x3d::ColorRGBA::type)));
    seal();
    EXPECT_FALSE(isClear());
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::color, scene.createNode(x3d::Color::type)));
    seal();
    EXPECT_TRUE(isClear());
    EXPECT_TRUE(scene.set(appearance, x3d::Appearance::material, scene.createNode(x3d::Material::type)));
    seal();
    EXPECT_FALSE(isClear());
}

// Their colours, which may have an alpha, are in a ramp of their own.
TEST_F(FlattenerCase, ParticlesAreNeverClear) {
    const NodeId particles = add(x3d::ParticleSystem::type, scene.root());
    const NodeId appearance = scene.createNode(x3d::Appearance::type), material = scene.createNode(x3d::Material::type);
    EXPECT_TRUE(scene.set(material, x3d::Material::transparency, 1.0f));
    EXPECT_TRUE(scene.set(appearance, x3d::Appearance::material, material));
    EXPECT_TRUE(scene.set(particles, x3d::ParticleSystem::appearance, appearance));
    ASSERT_EQ(seal().added.size(), 1u);
    EXPECT_FALSE(flat.flattener().instances()[0].clear);
}

TEST_F(FlattenerCase, SharedNodeHasOneInstanceAPathAndOneMesh) {
    const NodeId shape = addShape(scene.root());
    for (int i = 0; i < 9; ++i) {
        const NodeId t = add(x3d::Transform::type, scene.root());
        EXPECT_TRUE(scene.set(t, x3d::Transform::translation, Vec3f(static_cast<float>(i))));
        EXPECT_TRUE(scene.insertChild(t, x3d::Transform::children.index, shape));
    }
    const InstanceDelta& delta = seal();
    EXPECT_EQ(delta.added.size(), 10u);
    EXPECT_EQ(delta.geometries.size(), 1u);
    EXPECT_EQ(meshes.created, 1);
}

TEST_F(FlattenerCase, ContentChangesNameTheNodesThatShapesReferTo) {
    const NodeId shape = addShape(scene.root(), x3d::IndexedFaceSet::type);
    const NodeId other = addShape(scene.root());
    const NodeId faces = scene.node(shape).get(x3d::Shape::geometry);
    const NodeId look = scene.node(shape).get(x3d::Shape::appearance);
    const NodeId coord = scene.createNode(x3d::Coordinate::type), material = scene.createNode(x3d::Material::type);
    const NodeId light = add(x3d::PointLight::type, scene.root());
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coord, coord));
    EXPECT_TRUE(scene.set(look, x3d::Appearance::material, material));
    seal();
    const int before = meshes.created;
    EXPECT_TRUE(scene.set(coord, x3d::Coordinate::point, Array<Vec3f>{{1, 2, 3}}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.geometries.size(), 1u);
        EXPECT_EQ(delta.geometries[0].node, faces);
        EXPECT_TRUE(delta.appearanceChanged.empty());
        EXPECT_EQ(meshes.created, before + 1);
    }
    EXPECT_TRUE(scene.set(material, x3d::Material::transparency, .5f));
    EXPECT_EQ(seal().appearanceChanged, std::vector<NodeId>{look});
    const NodeId acoustics = scene.createNode(x3d::AcousticProperties::type);
    EXPECT_TRUE(scene.set(look, x3d::Appearance::acousticProperties, acoustics));
    EXPECT_TRUE(
        scene.set(scene.node(other).get(x3d::Shape::appearance), x3d::Appearance::acousticProperties, acoustics));
    EXPECT_EQ(seal().rebound.size(), 2u);
    EXPECT_TRUE(scene.set(acoustics, x3d::AcousticProperties::absorption, .25f));
    {
        const InstanceDelta& delta = seal();
        EXPECT_EQ(delta.acousticsChanged, std::vector<NodeId>{acoustics});
        EXPECT_TRUE(delta.rebound.empty());
    }
    EXPECT_TRUE(scene.set(light, x3d::PointLight::intensity, .5f));
    EXPECT_EQ(seal().placedChanged, std::vector<NodeId>{light});
}

TEST_F(FlattenerCase, PrototypeShowsItsFirstNodeAndStandsForParts) {
    const auto makeProto = [&](const char* name) {
        auto type = std::make_shared<NodeType>();
        type->name = name;
        type->kind = NodeType::Kind::proto;
        type->implements = {"X3DChildNode", "X3DNode", "X3DPrototypeInstance", "X3DGeometryNode"};
        FieldDef body;
        body.name = "body";
        body.type = FieldType::MFNode;
        body.access = Access::inputOutput;
        body.aspect = Aspect::structure;
        body.hidden = true;
        body.defaultValue = Value::zero(FieldType::MFNode);
        type->fields.push_back(body);
        EXPECT_TRUE(type->finish());
        return *scene.defineType(type);
    };
    const TypeIndex type = makeProto("Pair");
    const NodeId pair = add(x3d::Group::type, scene.root());
    const NodeId proto = scene.createNode(type);
    EXPECT_TRUE(scene.insertChild(pair, x3d::Group::children.index, proto));
    const FieldIndex body = scene.node(proto).type().findExact("body");
    const NodeId first = scene.createNode(x3d::Shape::type), second = scene.createNode(x3d::Shape::type);
    EXPECT_TRUE(scene.setField(proto, body, Array<NodeId>{first, second}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.added.size(), 1u);
        EXPECT_EQ(delta.added[0].shape, first);
        EXPECT_EQ(flat.flattener().path(delta.added[0].id), (std::vector<NodeId>{pair, proto, first}));
    }
    // Used as a geometry, the shape refers to the instance's first node, also when that changes.
    const NodeId geometry = scene.createNode(type), box = scene.createNode(x3d::Box::type),
                 cone = scene.createNode(x3d::Cone::type);
    EXPECT_TRUE(scene.setField(geometry, body, Array<NodeId>{box}));
    ASSERT_TRUE(scene.setField(first, x3d::Shape::geometry.index, geometry));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.rebound.size(), 1u);
        EXPECT_EQ(delta.rebound[0].geometry, box);
    }
    EXPECT_TRUE(scene.setField(geometry, body, Array<NodeId>{cone}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.rebound.size(), 1u);
        EXPECT_EQ(delta.rebound[0].geometry, cone);
        EXPECT_EQ(delta.geometriesRemoved, std::vector<NodeId>{box});
    }
}

TEST_F(FlattenerCase, AnInlineGeometryStandsForWhatItHasLoaded) {
    const NodeId shape = addShape(scene.root(), x3d::InlineGeometry::type);
    const NodeId holder = scene.node(shape).get(x3d::Shape::geometry);
    const NodeId box = scene.createNode(x3d::Box::type, holder), cone = scene.createNode(x3d::Cone::type, holder);
    seal();
    EXPECT_TRUE(scene.set(holder, x3d::InlineGeometry::body, Array<NodeId>{box}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.added.size() + delta.rebound.size(), 1u);
        EXPECT_EQ((delta.added.empty() ? delta.rebound : delta.added)[0].geometry, box);
    }
    EXPECT_TRUE(scene.set(holder, x3d::InlineGeometry::body, Array<NodeId>{cone}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.rebound.size(), 1u);
        EXPECT_EQ(delta.rebound[0].geometry, cone);
        EXPECT_EQ(delta.geometriesRemoved, std::vector<NodeId>{box});
    }
    EXPECT_TRUE(scene.set(holder, x3d::InlineGeometry::body, Array<NodeId>{}));
    EXPECT_EQ(seal().geometriesRemoved, std::vector<NodeId>{cone});
}

TEST_F(FlattenerCase, LevelOfDetailFollowsTheViewer) {
    const NodeId lod = add(x3d::LOD::type, add(x3d::Transform::type, scene.root()));
    NodeId levels[3];
    for (NodeId& level : levels) level = addShape(lod);
    EXPECT_TRUE(scene.setField(lod, x3d::LOD::range.index, Array<float>{10, 20}));
    seal();
    const auto shown = [&] {
        NodeId seen, heard;
        for (const auto& [slot, instance] : watcher.follower.instances) {
            if (instance.seen) {
                EXPECT_FALSE(std::exchange(seen, instance.shape));
            }
            if (instance.heard) {
                EXPECT_FALSE(std::exchange(heard, instance.shape));
            }
        }
        EXPECT_EQ(heard, levels[0]) << "whatever is seen";
        return seen;
    };
    EXPECT_EQ(shown(), levels[0]);
    const NodeId expected[] = {levels[0], levels[1], levels[2], levels[1]};
    const double distances[] = {5, 15, 50, 10};
    for (int i = 0; i < 4; ++i) {
        ASSERT_TRUE(flat.setViewer(Vec3d(0, 0, distances[i])));
        EXPECT_EQ(shown(), expected[i]) << distances[i];
    }
    // The node moves instead of the viewer.
    const NodeId transform = scene.parents(lod)[0].node;
    EXPECT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(0, 0, 9)));
    seal();
    EXPECT_EQ(shown(), levels[0]);
}

// The z axis of what hangs below points to the eye, as far as the axis lets it.
TEST_F(FlattenerCase, BillboardsTurnToTheViewer) {
    const NodeId transform = add(x3d::Transform::type, scene.root()), board = add(x3d::Billboard::type, transform);
    addShape(board);
    EXPECT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(3, 0, 0)));
    seal();
    const auto placed = [&] { return watcher.follower.instances.begin()->second.worldFromLocal; };
    EXPECT_EQ(placed()[2], Vec3d(0, 0, 1)) << "nobody looks";
    EXPECT_FALSE(watcher.follower.instances.begin()->second.heard);
    ASSERT_TRUE(flat.setViewer(Vec3d(3 + 5, 7, 0)));
    EXPECT_NEAR(glm::distance(placed()[2], Vec3d(1, 0, 0)), 0, 1e-12);
    EXPECT_NEAR(glm::distance(placed()[1], Vec3d(0, 1, 0)), 0, 1e-12);
    EXPECT_EQ(placed()[3], Vec3d(3, 0, 0));
    // The place moves instead of the viewer; it leans, and the axis leans with it.
    EXPECT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(8, 0, -4)));
    EXPECT_TRUE(scene.set(transform, x3d::Transform::rotation, Rotation{1, 0, 0, 1.5707964f}));
    seal();
    EXPECT_NEAR(glm::distance(placed()[1], Vec3d(0, 0, 1)), 0, 1e-6);
    EXPECT_NEAR(glm::distance(placed()[2], Vec3d(0, 1, 0)), 0, 1e-6);
    // All axes: straight to the eye.
    EXPECT_TRUE(scene.set(board, x3d::Billboard::axisOfRotation, Vec3f(0)));
    seal();
    EXPECT_NEAR(glm::distance(placed()[2], glm::normalize(Vec3d(0, 7, 4))), 0, 1e-6);
    EXPECT_NEAR(placed()[0].y, 0, 1e-6) << "upright";
    EXPECT_GT(placed()[1].y, 0);
    // It leans with the eye (23.4.1): its x axis is level in the picture, its y axis up.
    const Vec3d lean = glm::normalize(Vec3d(1, .2, .3)), eye = Vec3d(3 + 5, 7, 0);
    ASSERT_TRUE(flat.setViewer(EyePosition(eye, lean)));
    const Vec3d z = placed()[2];
    EXPECT_NEAR(glm::dot(placed()[0], lean), 0, 1e-6);
    EXPECT_NEAR(glm::distance(placed()[1], glm::normalize(lean - z * glm::dot(lean, z))), 0, 1e-6);
    ASSERT_TRUE(flat.setViewer(eye));
    EXPECT_NEAR(placed()[0].y, 0, 1e-6) << "upright again";
    ASSERT_TRUE(flat.setViewer(std::nullopt));
    EXPECT_NEAR(glm::distance(placed()[1], Vec3d(0, 0, 1)), 0, 1e-6);
}

TEST_F(FlattenerCase, ALevelThatIsOnlyHeardHasItsLevelsHeard) {
    const NodeId outer = add(x3d::LOD::type, scene.root()), group = add(x3d::Group::type, outer);
    const NodeId inner = add(x3d::LOD::type, group);
    const NodeId first = addShape(inner), second = addShape(inner), far = addShape(outer);
    EXPECT_TRUE(scene.setField(outer, x3d::LOD::range.index, Array<float>{10}));
    EXPECT_TRUE(scene.setField(inner, x3d::LOD::range.index, Array<float>{4}));
    seal();
    const auto shown = [&](double distance) {
        const Vec3d eye(0, 0, distance);
        EXPECT_TRUE(flat.setViewer(eye));
        expectSame(scene, flat.flattener(), watcher.follower, eye);
        std::map<NodeId, std::pair<bool, bool>> senses;
        for (const auto& [slot, i] : watcher.follower.instances) senses[i.shape] = {i.seen, i.heard};
        return senses;
    };
    using Senses = std::map<NodeId, std::pair<bool, bool>>;  // seen, heard
    for (int round = 0; round < 2; ++round) {
        EXPECT_EQ(shown(1), (Senses{{first, {true, true}}}));
        EXPECT_EQ(shown(6), (Senses{{first, {false, true}}, {second, {true, false}}}));
        EXPECT_EQ(shown(50), (Senses{{first, {false, true}}, {far, {true, false}}}));
        EXPECT_EQ(shown(6), (Senses{{first, {false, true}}, {second, {true, false}}}));
    }
}

TEST_F(FlattenerCase, LevelsInLevelsOfAnyDepth) {
    // Each LOD's further level is the next LOD; all are too far away, so the last shape is seen and the first one
    // heard.
    NodeId lod = add(x3d::LOD::type, scene.root());
    NodeId nearest, last;
    for (int i = 0; i < 20'000; ++i) {
        EXPECT_TRUE(scene.setField(lod, x3d::LOD::range.index, Array<float>{10}));
        last = addShape(lod);
        if (i == 0) nearest = last;
        if (i < 19'999) lod = add(x3d::LOD::type, lod);
    }
    seal();
    const auto expectShown = [&](NodeId seen) {
        std::size_t others = 0;
        for (const auto& [slot, instance] : watcher.follower.instances) {
            EXPECT_EQ(instance.heard, instance.shape == nearest);
            EXPECT_EQ(instance.seen, instance.shape == seen);
            others += !instance.heard && !instance.seen;
        }
        EXPECT_EQ(others, 0u);
    };
    expectShown(nearest);
    ASSERT_TRUE(flat.setViewer(Vec3d(0, 0, 50)));
    expectShown(last);
    ASSERT_TRUE(flat.setViewer(Vec3d(0, 0, 5)));
    expectShown(nearest);
}

TEST_F(FlattenerCase, NestingOfAnyDepthAndManyParents) {
    NodeId parent = scene.root();
    for (int i = 0; i < 10000; ++i) {
        const NodeId t = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.set(t, x3d::Transform::translation, Vec3f(1, 0, 0)));
        EXPECT_TRUE(scene.insertChild(parent, scene.node(parent).type().findExact("children"), t));
        parent = t;
    }
    addShape(parent);
    const NodeId top = seal().added.empty() ? NodeId{} : flat.flattener().path(watcher.last.added[0].id)[0];
    ASSERT_EQ(watcher.last.added.size(), 1u);
    EXPECT_EQ(watcher.last.added[0].worldFromLocal[3].x, 10000);
    EXPECT_EQ(flat.flattener().path(watcher.last.added[0].id).size(), 10001u);
    EXPECT_TRUE(scene.set(top, x3d::Transform::translation, Vec3f(5, 0, 0)));
    ASSERT_EQ(seal().moved.size(), 1u);
    EXPECT_EQ(watcher.last.moved[0].worldFromLocal[3].x, 10004);

    const NodeId shared = addShape(scene.root());
    std::vector<NodeId> groups;
    for (int i = 0; i < 100000; ++i) {
        groups.push_back(scene.createNode(x3d::Group::type));
        ASSERT_TRUE(scene.insertChild(groups.back(), x3d::Group::children.index, shared));
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, groups.back()));
    }
    EXPECT_EQ(seal().added.size(), 100001u);
    EXPECT_TRUE(scene.setField(shared, x3d::Shape::castShadow.index, false));
    EXPECT_EQ(seal().rebound.size(), 100001u);
    for (int i = 0; i < 100000; i += 2)
        ASSERT_TRUE(scene.removeChild(groups[static_cast<std::size_t>(i)], x3d::Group::children.index, 0));
    EXPECT_EQ(seal().removed.size(), 50000u);
    EXPECT_TRUE(scene.removeChild(scene.root(), x3d::RtsgScene::children.index, 0));
    EXPECT_EQ(seal().removed.size(), 1u);
}

TEST_F(FlattenerCase, ExponentialSharingIsCutOffWithADiagnostic) {
    Flattener::Options options;
    options.maxOccurrences = 10000;
    Flattener small(options);
    NodeId below = scene.createNode(x3d::Shape::type);
    for (int i = 0; i < 40; ++i) {
        const NodeId group = scene.createNode(x3d::Group::type);
        EXPECT_TRUE(scene.setField(group, x3d::Group::children.index, Array<NodeId>{below, below}));
        below = group;
    }
    world.reset();
    EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, below));
    scene.seal();
    small.apply(scene, scene.snapshot());
    EXPECT_LE(small.instanceCount(), 10000u);
    EXPECT_GT(small.instanceCount(), 1000u);
    EXPECT_EQ(small.diagnostics().errors(), 1u);
}

TEST(InstanceDelta, DeterminantSigns) {
    const auto scaled = [](double x, double y, double z) {
        WorldFromLocal m(1.0);
        m[0].x = x, m[1].y = y, m[2].z = z;
        return m;
    };
    EXPECT_EQ(determinantSign(scaled(1, 2, 3)), 1);
    EXPECT_EQ(determinantSign(scaled(-1, 2, 3)), -1);
    EXPECT_EQ(determinantSign(scaled(1, 0, 3)), 0);
    EXPECT_EQ(determinantSign(scaled(1e-9, 1e-9, 1e-9)), 1) << "small is not singular";
    EXPECT_EQ(determinantSign(scaled(std::nan(""), 1, 1)), 0);
    EXPECT_EQ(determinantSign(scaled(HUGE_VAL, 1, 1)), 0);
}

}  // namespace
}  // namespace rtsg
