// Dispatch of operations to registered node renderers.
#include <rtsg/renderers/renderer.h>

#include <gtest/gtest.h>

#include <rtsg/renderers/shared_world.h>

#include "renderers/ray_support.h"
#include "renderers/scene_edits.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

constexpr std::uint64_t kRendererSeed = 20090616;
constexpr Operation kList{1}, kCount{2};

/// Writes down what it is asked to do.
struct Recorder : Renderer {
    using Renderer::Renderer;
    std::vector<std::string> calls;
    int changes = 0, frames = 0;
    Result<> renderFrame() override {
        ++frames;
        return renderScene(kList);
    }
    Result<> apply(const Scene&, const ChangeSet&) override {
        ++changes;
        return {};
    }
    void note(const char* who, const Node& node, Operation operation) {
        calls.push_back(std::string(who) + " " + node.type().name + " " + std::to_string(static_cast<int>(operation)));
    }
};

struct RendererCase : testing::Test {
    Scene scene;
    NodeId group, transform, shape, light;
    void SetUp() override {
        group = add(x3d::Group::type, scene.root());
        transform = add(x3d::Transform::type, group);
        shape = add(x3d::Shape::type, transform);
        light = add(x3d::PointLight::type, group);
    }
    NodeId add(TypeIndex type, NodeId parent) {
        const NodeId id = scene.createNode(type);
        EXPECT_TRUE(scene.insertChild(parent, scene.node(parent).type().findExact("children"), id));
        return id;
    }
};

NodeRenderer noting(const char* who) {
    return nodeRendererFor<Recorder>([who](Recorder& r, const Node& n, Operation o) -> Result<> {
        r.note(who, n, o);
        return {};
    });
}

TEST_F(RendererCase, OperationsPassThroughGroupsToRegisteredNodeRenderers) {
    Recorder renderer;
    renderer.registerNodeRenderer("Shape", noting("own"));
    renderer.registerNodeRenderer("X3DLightNode", noting("abstract"));
    ASSERT_TRUE(renderer.attachToScene(scene));
    ASSERT_TRUE(renderer.renderFrame());
    EXPECT_EQ(renderer.calls, (std::vector<std::string>{"own Shape 1", "abstract PointLight 1"}));
    renderer.calls.clear();
    ASSERT_TRUE(renderer.renderNode(transform, kCount));
    EXPECT_EQ(renderer.calls, std::vector<std::string>{"own Shape 2"});
    renderer.calls.clear();
    const NodeId list[] = {light, shape, light};
    ASSERT_TRUE(renderer.renderNodes(list, kCount));
    EXPECT_EQ(renderer.calls,
              (std::vector<std::string>{"abstract PointLight 2", "own Shape 2", "abstract PointLight 2"}));
}

TEST_F(RendererCase, RegisteredWinsOverTypesAndConcreteOverAbstract) {
    auto types = std::make_shared<NodeRenderers>(NodeRenderers::standard());
    types->set("Shape", noting("type"));
    types->set("PointLight", noting("type"));
    Recorder plain(types), special(types);
    special.registerNodeRenderer("Shape", noting("own"));
    special.registerNodeRenderer("X3DLightNode", noting("own abstract"));
    for (Recorder* r : {&plain, &special}) {
        ASSERT_TRUE(r->attachToScene(scene));
        ASSERT_TRUE(r->renderFrame());
    }
    EXPECT_EQ(plain.calls, (std::vector<std::string>{"type Shape 1", "type PointLight 1"}));
    EXPECT_EQ(special.calls, (std::vector<std::string>{"own Shape 1", "own abstract PointLight 1"}));
    special.registerNodeRenderer("PointLight", noting("own concrete"));  // at run time
    special.calls.clear();
    ASSERT_TRUE(special.renderNode(light, kList));
    EXPECT_EQ(special.calls, std::vector<std::string>{"own concrete PointLight 1"});
}

TEST_F(RendererCase, OverridingRenderNodeSeesTargets) {
    struct Overriding : Recorder {
        Result<> renderNode(NodeId node, Operation operation) override {
            note("override", scene()->node(node), operation);
            return Recorder::renderNode(node, operation);
        }
    } renderer;
    ASSERT_TRUE(renderer.attachToScene(scene));
    ASSERT_TRUE(renderer.renderFrame());
    EXPECT_EQ(renderer.calls, std::vector<std::string>{"override Group 1"});
}

TEST_F(RendererCase, LeaveComesAfterEverythingBelow) {
    Recorder renderer;
    renderer.registerNodeRenderer("X3DGroupingNode",
                                  nodeRendererFor<Recorder>(
                                      [](Recorder& r, const Node& n, Operation o) -> Result<> {
                                          r.note("enter", n, o);
                                          const FieldIndex f = n.type().findExact("children");
                                          const auto& list = *static_cast<const Array<NodeId>*>(n.storage(f));
                                          r.descend(list.span(), o);
                                          return {};
                                      },
                                      [](Recorder& r, const Node& n, Operation o) { r.note("leave", n, o); }));
    renderer.registerNodeRenderer("Shape", noting("own"));
    ASSERT_TRUE(renderer.attachToScene(scene));
    ASSERT_TRUE(renderer.renderFrame());
    EXPECT_EQ(renderer.calls, (std::vector<std::string>{"enter Group 1", "enter Transform 1", "own Shape 1",
                                                        "leave Transform 1", "leave Group 1"}));
}

TEST_F(RendererCase, ErrorsEndTheTraversalAndLeaveItUsable) {
    Recorder renderer;
    int calls = 0;
    renderer.registerNodeRenderer("Shape", {[&](Renderer&, const Node&, Operation) -> Result<> {
                                                ++calls;
                                                return fail("no luck");
                                            },
                                            {}});
    renderer.registerNodeRenderer("PointLight", noting("own"));
    EXPECT_FALSE(renderer.renderFrame()) << "not attached yet";
    ASSERT_TRUE(renderer.attachToScene(scene));
    EXPECT_FALSE(renderer.attachToScene(scene)) << "attached already";
    const Result<> result = renderer.renderFrame();
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().text, "no luck");
    EXPECT_TRUE(renderer.calls.empty());
    ASSERT_TRUE(renderer.renderNode(light, kList));
    EXPECT_EQ(renderer.calls.size(), 1u);
    EXPECT_EQ(calls, 1);
}

/// Nothing throws across the interface; and what was under way then is forgotten.
TEST_F(RendererCase, WhatANodeRendererThrowsIsAnError) {
    Recorder renderer;
    renderer.registerNodeRenderer("Shape", {[](Renderer&, const Node&, Operation) -> Result<> { throw 7; }, {}});
    renderer.registerNodeRenderer("PointLight", noting("own"));
    renderer.registerNodeRenderer(
        "Transform", {[&](Renderer& r, const Node& n, Operation o) -> Result<> {
                          r.descend(n.get(x3d::Transform::children).span(), o);
                          return {};
                      },
                      [](Renderer&, const Node&, Operation) { throw std::runtime_error("out of paint"); }});
    ASSERT_TRUE(renderer.attachToScene(scene));
    for (int i = 0; i < 600; ++i) {  // more often than calls may be nested
        const Result<> result = renderer.renderFrame();
        ASSERT_FALSE(result);
        ASSERT_EQ(result.error().text, "a node renderer threw");
    }
    ASSERT_TRUE(scene.destroyNode(shape));
    const Result<> result = renderer.renderFrame();
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().text, "a node renderer threw: out of paint");
    EXPECT_TRUE(renderer.calls.empty());
    ASSERT_TRUE(renderer.renderNode(light, kList));
    EXPECT_EQ(renderer.calls.size(), 1U);
}

TEST_F(RendererCase, ListensToTheBusUntilDetached) {
    Recorder renderer;
    ASSERT_TRUE(renderer.attachToScene(scene));
    EXPECT_EQ(renderer.changes, 1);  // the snapshot
    ASSERT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(1)));
    scene.seal();
    EXPECT_EQ(renderer.changes, 2);
    renderer.detachFromScene();
    ASSERT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(2)));
    scene.seal();
    EXPECT_EQ(renderer.changes, 2);
}

TEST_F(RendererCase, DepthOfNestingIsNoLimitToDescending) {
    NodeId parent = group;
    for (int i = 0; i < 20000; ++i) parent = add(x3d::Group::type, parent);
    add(x3d::Shape::type, parent);
    Recorder renderer;
    renderer.registerNodeRenderer("Shape", noting("own"));
    ASSERT_TRUE(renderer.attachToScene(scene));
    ASSERT_TRUE(renderer.renderFrame());
    EXPECT_EQ(renderer.calls.size(), 2u);
    // Recursion through renderNode() is stopped with an error, not by the end of the stack.
    renderer.registerNodeRenderer("Group", {[](Renderer& r, const Node& n, Operation o) {
                                                return r.renderNodes(n.get(x3d::Group::children).span(), o);
                                            },
                                            {}});
    EXPECT_FALSE(renderer.renderFrame());
}

// ---- the baseline -------------------------------------------------------------------------------------------------

// Law 2 once more: two ways that share no state give the same hits.
TEST(FullTraversal, AgreesWithTheIncrementalWorld) {
    int hits = 0;
    for (std::uint64_t seed = kRendererSeed; seed < kRendererSeed + 20; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        test::Edits edits(scene, seed);
        if (seed % 2) edits.showBoxes();
        SharedWorld flat(scene);
        const RayWorld& rays = flat.rays();
        FullTraversalRenderer baseline;
        ASSERT_TRUE(baseline.attachToScene(scene));
        std::mt19937 random(static_cast<unsigned>(seed));
        for (int frame = 0; frame < 60; ++frame) {
            SCOPED_TRACE(frame);
            for (int n = frame ? 6 : 600; n > 0; --n) edits.step();
            scene.seal();
            ASSERT_EQ(flat.failure(), "");
            ASSERT_TRUE(baseline.renderFrame());
            const auto a = rays.stats(), b = baseline.world().stats();
            ASSERT_EQ(a.instances, b.instances);
            ASSERT_EQ(a.traced, b.traced);
            ASSERT_EQ(a.meshes, b.meshes);
            for (int i = 0; i < 500; ++i) {
                const Ray ray = test::randomRay(random, 6);
                const Hit x = rays.intersect(ray), y = baseline.world().intersect(ray);
                ASSERT_EQ(bool(x), bool(y)) << i;
                if (!x) continue;
                ++hits;
                EXPECT_NEAR(x.t, y.t, 1e-4 * y.t);
            }
        }
    }
    EXPECT_GT(hits, 1000);
}

TEST(FullTraversal, FindsNothingWhereNothingChanged) {
    Scene scene;
    test::Edits edits(scene, kRendererSeed);
    edits.showBoxes();
    for (int i = 0; i < 600; ++i) edits.step();
    FullTraversalRenderer baseline;
    ASSERT_TRUE(baseline.attachToScene(scene));
    EXPECT_FALSE(baseline.delta().empty());
    ASSERT_TRUE(baseline.renderFrame());
    EXPECT_TRUE(baseline.delta().empty());
    EXPECT_GT(baseline.stats().nodesVisited, 10u);
}

}  // namespace
}  // namespace rtsg
