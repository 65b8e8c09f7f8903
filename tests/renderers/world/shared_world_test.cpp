// SharedWorld: several subscribers of one flattening and one RayWorld; one that fails harms nobody else, and whoever
// comes, comes late or goes, all are in the same state.
#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {
namespace {

/// Counts what it is told; fails at the `failAt`-th call.
struct Counter final : InstanceSubscriber {
    explicit Counter(std::string n, int at = 0, bool throws_ = false)
        : name(std::move(n)), failAt(at), throws(throws_) {}
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        ++calls;
        shapes += static_cast<int>(delta.added.size()) - static_cast<int>(delta.removed.size());
        if (calls != failAt) return {};
        if (throws) throw std::runtime_error("out of luck");
        return fail("out of ideas");
    }
    std::string subscriberName() const override { return name; }
    std::string name;
    int failAt;
    bool throws;
    int calls = 0, shapes = 0;
};

void addBox(Scene& scene) {
    const NodeId shape = scene.createNode(x3d::Shape::type), box = scene.createNode(x3d::Box::type);
    ASSERT_TRUE(scene.set(shape, x3d::Shape::geometry, box));
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, shape));
    scene.seal();
}

TEST(SharedWorld, OneThatFailsOrThrowsIsLeftOutAndNamedAndTheOthersGoOn) {
    for (const bool throws : {false, true}) {
        SCOPED_TRACE(throws);
        Scene scene;
        SharedWorld world(scene);
        Counter first("first"), bad("bad", 2, throws), last("last");
        for (Counter* c : {&first, &bad, &last}) world.add(*c);
        for (int i = 0; i < 4; ++i) addBox(scene);
        EXPECT_EQ(world.failure(), "");
        EXPECT_EQ(first.shapes, 4);
        EXPECT_EQ(last.shapes, 4);
        EXPECT_EQ(bad.calls, 2);
        EXPECT_EQ(world.failure(first), "");
        EXPECT_EQ(world.failure(bad), throws ? "out of luck" : "out of ideas");
        const Diagnostics diagnostics = world.diagnostics();
        ASSERT_EQ(diagnostics.all().size(), 1u);
        EXPECT_EQ(diagnostics.all()[0].text, throws ? "bad: out of luck" : "bad: out of ideas");
    }
}

TEST(SharedWorld, OneThatWasTakenOutAndAddedAgainStartsFromASnapshot) {
    Scene scene;
    SharedWorld world(scene);
    Counter bad("bad", 2);
    world.add(bad);
    for (int i = 0; i < 3; ++i) addBox(scene);
    world.remove(bad);
    bad.shapes = 0;
    world.add(bad);
    EXPECT_EQ(world.failure(bad), "");
    EXPECT_EQ(bad.shapes, 3) << "at once";
    addBox(scene);
    EXPECT_EQ(bad.shapes, 4);
}

/// Looks at the rays for every shape it is told of.
struct Looker final : InstanceSubscriber {
    explicit Looker(SharedWorld& w) : world(w) {}
    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override {
        for (const Instance& i : delta.added) {
            const auto all = world.rays().instances();
            if (i.id.slot >= all.size() || all[i.id.slot].info.id != i.id || !all[i.id.slot].mesh) ++missing;
            ++seen;
        }
        snapshots += changes.isSnapshot();
        EXPECT_EQ(changes.to, scene.sequence());
        EXPECT_EQ(world.sequence(), changes.to);
        return {};
    }
    SharedWorld& world;
    int seen = 0, missing = 0, snapshots = 0;
};

TEST(SharedWorld, RaysAreUpToDateBeforeAnyoneWhateverTheOrderOfComing) {
    Scene scene;
    addBox(scene);
    SharedWorld world(scene);
    Looker early(world);
    world.add(early);  // before anybody asked for rays, but within its first call
    addBox(scene);
    Looker late(world);
    world.add(late);
    addBox(scene);
    EXPECT_EQ(early.seen, 3);
    EXPECT_EQ(late.seen, 3);
    EXPECT_EQ(early.missing + late.missing, 0);
    EXPECT_EQ(early.snapshots, 1);
    EXPECT_EQ(late.snapshots, 1);
}

TEST(SharedWorld, OneFlatteningOneRayWorldAndOneCommitForEachSetThatTouchesGeometry) {
    Scene scene;
    const NodeId light = scene.createNode(x3d::PointLight::type), group = scene.createNode(x3d::Transform::type);
    for (const NodeId node : {light, group})
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    const std::uint64_t flatteners = Flattener::created(), rayWorlds = RayWorld::created();
    SharedWorld world(scene);
    Counter a("a"), b("b");
    world.add(a), world.add(b);
    EXPECT_EQ(world.counts().rayWorlds, rayWorlds) << "nobody has asked for rays";
    const RayWorld& rays = world.rays();
    EXPECT_EQ(&rays, &world.rays());
    EXPECT_EQ(world.counts().flatteners, flatteners + 1);
    EXPECT_EQ(world.counts().rayWorlds, rayWorlds + 1);
    const SharedWorld::Counts before = world.counts();
    addBox(scene);
    ASSERT_TRUE(scene.set(light, x3d::PointLight::intensity, .5f));
    scene.seal();
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(world.update());  // nothing happened
    EXPECT_EQ(world.counts().commits, before.commits + 1);
    EXPECT_EQ(world.counts().deliveries, before.deliveries + 2);
    EXPECT_EQ(world.sequence(), scene.sequence());
}

TEST(SharedWorld, WhoIsAddedOrRemovedDuringADeliveryIsTreatedAsBetweenTwo) {
    Scene scene;
    SharedWorld world(scene);
    Counter newcomer("newcomer"), leaving("leaving");
    struct Usher final : InstanceSubscriber {
        std::function<void()> next;
        Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta&) override {
            if (next) std::exchange(next, nullptr)();
            return {};
        }
    } usher;
    world.add(usher);
    world.add(leaving);
    usher.next = [&] { world.add(newcomer), world.remove(leaving); };
    addBox(scene);
    addBox(scene);
    EXPECT_EQ(newcomer.shapes, 2);
    EXPECT_EQ(leaving.shapes, 0);
    EXPECT_EQ(world.failure(), "");
}

TEST(SharedWorld, AnEyeThatMovesAmongEditsFindsThemSealed) {
    Scene scene;
    SharedWorld world(scene);
    Counter counter("counter");
    world.add(counter);
    const NodeId lod = scene.createNode(x3d::LOD::type), group = scene.createNode(x3d::Group::type);
    ASSERT_TRUE(scene.insertChild(group, x3d::Group::children, lod));
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, group));
    scene.seal();
    ASSERT_TRUE(scene.destroyNode(lod));  // and not sealed
    EXPECT_TRUE(world.setViewer(Vec3d(0, 0, 5)));
    EXPECT_EQ(world.sequence(), scene.sequence());
    addBox(scene);
    ASSERT_TRUE(scene.destroyNode(group));
    world.setMeshSource("Box", [](const Scene&, NodeId) { return std::make_shared<const Mesh>(); });
    EXPECT_EQ(world.failure(), "");
    EXPECT_EQ(counter.shapes, 1);
}

/// Data that several renderers share are made when nobody holds them, and freed with the last holder.
TEST(SharedWorld, WhatIsSharedIsMadeOnceForAllWhoHoldIt) {
    Scene scene;
    SharedWorld world(scene), other(scene);
    int created = 0;
    const auto make = [&]() -> std::shared_ptr<void> { return std::make_shared<int>(++created); };
    auto first = world.shared("pictures", make), second = world.shared("pictures", make);
    EXPECT_EQ(first, second);
    EXPECT_EQ(created, 1);
    EXPECT_NE(world.shared("sounds", make), first) << "another name is another thing";
    EXPECT_NE(other.shared("pictures", make), first) << "as is another world's";
    const std::weak_ptr<void> watched = first;
    first.reset(), second.reset();
    EXPECT_TRUE(watched.expired());
    EXPECT_EQ(*static_cast<const int*>(world.shared("pictures", make).get()), 4);
}

TEST(SharedWorld, NumbersOfThoseAddedAreGivenOnce) {
    Scene scene;
    SharedWorld world(scene);
    std::set<std::uint64_t> numbers;
    Counter one("one"), two("two");
    for (int i = 0; i < 5; ++i) {
        EXPECT_TRUE(numbers.insert(world.add(one)).second);
        EXPECT_TRUE(numbers.insert(world.add(two)).second);
        world.remove(one);
        world.remove(two);
    }
    EXPECT_EQ(world.failure(one), "") << "it is not there";
}

TEST(SharedWorld, PolledItTakesWhatHappenedMerged) {
    Scene scene;
    SharedWorld world(scene, {.flattening = {}, .rays = {}, .delivery = Delivery::polled});
    Counter counter("counter");
    world.add(counter);
    const int before = counter.calls;
    for (int i = 0; i < 5; ++i) addBox(scene);
    EXPECT_EQ(counter.shapes, 0);
    ASSERT_TRUE(world.update());
    EXPECT_EQ(counter.shapes, 5);
    EXPECT_EQ(counter.calls, before + 1);
}

/// A square of `half` to each side at z = 0.
std::shared_ptr<const Mesh> square(float half) {
    auto mesh = std::make_shared<Mesh>();
    mesh->positions = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
    mesh->triangles = {0, 1, 2, 0, 2, 3};
    mesh->triangleCount = 2;
    mesh->triangleStride = 3;
    mesh->solid = false;
    mesh->bounds = Bounds{};
    for (const Vec3f& p : mesh->positions) mesh->bounds.extend(p);
    return mesh;
}

TEST(SharedWorld, GeometryOfATypeOfOnesOwnIsMetByRaysAndFollowed) {
    Scene scene;
    auto type = std::make_shared<NodeType>();
    type->name = "Pane";
    type->implements = {"X3DGeometryNode", "X3DNode"};
    FieldDef size;
    size.name = "size";
    size.type = FieldType::SFFloat;
    size.access = Access::inputOutput;
    size.aspect = Aspect::geometry;
    size.defaultValue = Value(1.0f);
    type->fields.push_back(size);
    ASSERT_TRUE(type->finish());
    const auto index = scene.defineType(type);
    ASSERT_TRUE(index) << index.error().text;
    const NodeId pane = scene.createNode(*index), shape = scene.createNode(x3d::Shape::type);
    ASSERT_TRUE(scene.set(shape, x3d::Shape::geometry, pane));
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, shape));
    SharedWorld world(scene);
    const RayWorld& rays = world.rays();
    const auto meets = [&](float x) { return bool(rays.intersect({.origin = {x, .1f, 5}, .direction = {0, 0, -1}})); };
    EXPECT_FALSE(meets(.5f));
    const FieldIndex field = scene.node(pane).type().findExact("size");
    world.setMeshSource("Pane", [field](const Scene& s, NodeId node) {
        return square(*static_cast<const float*>(s.node(node).storage(field)));
    });
    EXPECT_TRUE(meets(.5f)) << "one that was there already";
    EXPECT_FALSE(meets(1.5f));
    ASSERT_TRUE(scene.setField(pane, field, Value(2.0f)));
    scene.seal();
    EXPECT_TRUE(meets(1.5f));
}

/// A renderer of one's own.
class ShapeCounter final : public WorldRenderer {
  public:
    static constexpr Operation kName{1};
    explicit ShapeCounter(SharedWorld& world) : WorldRenderer(world) {}
    Result<> renderFrame() override {
        if (auto ok = begin(); !ok) return ok;
        names.clear();
        return renderOwnNodes(kName);
    }
    int shapes = 0;
    std::vector<NodeId> names;

  protected:
    Result<> follow(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        if (!follows) return fail("it does not count");
        shapes += static_cast<int>(delta.added.size()) - static_cast<int>(delta.removed.size());
        return {};
    }

  public:
    bool follows = true;
};

TEST(SharedWorld, WhatIsNotTracedIsCalledByItsNameAndLine) {
    Scene scene;
    Diagnostics loading("flat.x3dv");
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Immersive
Transform { scale 1 0 0 children [
  DEF FLAT Shape { geometry Box { } }
  Shape { geometry Box { } }
  Shape { geometry Box { } } ] }
)",
                         loading));
    SharedWorld world(scene);
    world.rays();
    std::vector<std::string> reported;
    const Diagnostics found = world.diagnostics();
    for (const Diagnostic& d : found.all()) reported.push_back(d.format());
    ASSERT_EQ(reported.size(), 3u);
    EXPECT_TRUE(reported[0].starts_with("flat.x3dv:4:3: warning: Shape FLAT is not traced: its transform"))
        << reported[0];
    EXPECT_TRUE(reported[1].starts_with("flat.x3dv:5:3: warning: Shape#")) << reported[1];
    EXPECT_TRUE(reported[2].starts_with("flat.x3dv:6:3: warning: Shape#")) << reported[2];
}

TEST(WorldRenderer, FollowsItsWorldAndSendsOperationsToNodesOfTheTypesRegistered) {
    Scene scene, other;
    addBox(scene);
    SharedWorld world(scene);
    ShapeCounter counter(world);
    EXPECT_FALSE(counter.renderFrame()) << "not attached";
    EXPECT_FALSE(counter.attachToScene(other));
    ASSERT_TRUE(counter.attachToScene(scene));
    EXPECT_TRUE(counter.attached());
    EXPECT_EQ(counter.shapes, 1);
    counter.registerNodeRenderer(
        "X3DLightNode", nodeRendererFor<ShapeCounter>([](ShapeCounter& c, const Node& n, Operation) -> Result<> {
            c.names.push_back(n.id());
            return {};
        }));
    ASSERT_TRUE(counter.renderFrame());
    EXPECT_TRUE(counter.names.empty());
    std::vector<NodeId> lights;
    for (const TypeIndex type : {x3d::PointLight::type, x3d::SpotLight::type}) {
        lights.push_back(scene.createNode(type));
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, lights.back()));
        ASSERT_TRUE(counter.renderFrame());
        EXPECT_EQ(counter.names, lights);
    }
    ASSERT_TRUE(scene.destroyNode(lights[0]));
    ASSERT_TRUE(counter.renderFrame());
    EXPECT_EQ(counter.names, std::vector<NodeId>{lights[1]});
    counter.detachFromScene();
    addBox(scene);
    EXPECT_EQ(counter.shapes, 1);
}

TEST(SharedWorld, WaitsForWhatIsBuiltInTheBackground) {
    Scene scene;
    SharedWorld::Options options;
    options.rays.restFrames = 8;
    options.rays.background = false;  // then the waiting itself builds
    SharedWorld world(scene, options);
    world.finishBackgroundWork();  // nobody has asked for rays: nothing to wait for
    for (int i = 0; i < 40; ++i) addBox(scene);
    EXPECT_EQ(world.rays().stats().groups, 1u);
    const NodeId mover = scene.createNode(x3d::Transform::type);
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, mover));
    addBox(scene);
    const NodeId shape = scene.createNode(x3d::Shape::type), box = scene.createNode(x3d::Box::type);
    ASSERT_TRUE(scene.set(shape, x3d::Shape::geometry, box));
    ASSERT_TRUE(scene.insertChild(mover, x3d::Transform::children, shape));
    for (int i = 0; i < 40; ++i) {
        ASSERT_TRUE(scene.set(mover, x3d::Transform::translation, Vec3f(static_cast<float>(i), 0, 0)));
        scene.seal();
    }
    const std::size_t baked = world.rays().stats().baked;
    EXPECT_EQ(world.rays().stats().merges, 0u);
    world.finishBackgroundWork();
    EXPECT_EQ(world.rays().stats().merges, 1u);
    EXPECT_EQ(world.rays().stats().baked, baked + 1) << "the box that has rested since it came";
}

TEST(WorldRenderer, OneThatFailsSaysSoAndTheWorldGoesOn) {
    Scene scene;
    SharedWorld world(scene);
    ShapeCounter bad(world), good(world);
    ASSERT_TRUE(bad.attachToScene(scene));
    ASSERT_TRUE(good.attachToScene(scene));
    bad.follows = false;
    addBox(scene);
    EXPECT_FALSE(bad.attached());
    EXPECT_EQ(bad.failure(), "it does not count");
    EXPECT_FALSE(bad.renderFrame());
    EXPECT_TRUE(good.renderFrame());
    EXPECT_EQ(good.shapes, 1);
}

}  // namespace
}  // namespace rtsg
