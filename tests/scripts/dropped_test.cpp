// Objects that scripts make and drop are freed, objects with references are not, and every run does the same.
#include <gtest/gtest.h>

#include <rtsg/core/resource.h>

#include "script_scene.h"

namespace rtsg {
namespace {

using test::ScriptScene;

std::size_t createdOf(const Scene& scene, TypeIndex type) {
    std::size_t count = 0;
    scene.forEachNode([&](const Node& node) { count += node.is(type); });
    return count;
}

/// A script that makes `each` Transforms a frame; `keep` says what else it does with each, which is `n`.
std::string maker(const std::string& keep, int each = 1000) {
    return "var kept = [], turn = 0, scene = Browser.currentScene; function prepareEvents() { ++turn; for (var i = 0; "
           "i < " +
           std::to_string(each) + "; ++i) { var n = scene.createNode('Transform'); " + keep + " } }";
}

TEST(Dropped, TwentyFramesOfAThousandLeaveNoMoreThanTwo) {
    ScriptScene s("", maker(""));
    for (int i = 0; i < 20; ++i) s.frame();
    EXPECT_LE(createdOf(s.scene, x3d::Transform::type), 2000u);
    EXPECT_EQ(s.problems(), "");
}

TEST(Dropped, WhatVariablesHoldStaysAndNothingElse) {
    // In an array, in a closure, as the key of a map, in a promise, deep in objects: one of each a frame.
    ScriptScene s(
        "", maker("if (i === 0) kept.push(n); else if (i === 1) kept.push(() => n.translation);"
                  "else if (i === 2) kept.push(new Map([[n, 1]])); else if (i === 3) kept.push(Promise.resolve(n));"
                  "else if (i === 4) kept.push({deep: {node: n}}); else if (i === 5) new WeakMap().set(n, kept);"));
    for (int i = 0; i < 21; ++i) s.frame();
    EXPECT_EQ(createdOf(s.scene, x3d::Transform::type), 20u * 5 + 1000)
        << "those of the last frame have not been looked at";
    EXPECT_EQ(s.problems(), "");
}

TEST(Dropped, AVariableFindsItsNodeAliveForEver) {
    ScriptScene s("directOutput TRUE outputOnly SFVec3f told",
                  "var mine = null; function initialize() { mine = Browser.currentScene.createNode('Transform'); "
                  "mine.translation = new SFVec3f(1, 2, 3); } " +
                      maker("") + " function eventsProcessed() {} function shutdown() { print(mine.translation); }");
    for (int i = 0; i < 10; ++i) s.frame();
    s.send("url", Value(Array<String>{}));
    s.frame();
    s.frame();
    EXPECT_EQ(s.printed, "1 2 3\n") << s.problems();
}

TEST(Dropped, WhatTheSceneRefersToStays) {
    ScriptScene s("directOutput TRUE inputOutput SFNode field NULL initializeOnly SFNode group DEF G Group { }",
                  "function initialize() { var sc = Browser.currentScene;"
                  " sc.addRootNode(sc.createNode('Group'));"
                  " var child = sc.createNode('Transform'); child.children = new MFNode(sc.createNode('Shape'));"
                  " group.children = new MFNode(child);"
                  " sc.updateNamedNode('NAMED', sc.createNode('Billboard'));"
                  " field = sc.createNode('Switch');"
                  " var clock = sc.createNode('TimeSensor'); sc.addRoute(clock, 'enabled', group, 'visible');"
                  " var a = sc.createNode('BooleanFilter'), b = sc.createNode('BooleanToggle');"
                  " sc.addRoute(a, 'inputTrue', b, 'set_boolean'); } " +
                      maker(""));
    for (int i = 0; i < 10; ++i) s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(createdOf(s.scene, x3d::Group::type), 2u);
    EXPECT_EQ(createdOf(s.scene, x3d::Shape::type), 1u);
    EXPECT_TRUE(s.scene.findName("NAMED"));
    EXPECT_EQ(createdOf(s.scene, x3d::Switch::type), 1u);
    EXPECT_EQ(createdOf(s.scene, x3d::TimeSensor::type), 1u) << "a route to what stays";
    EXPECT_EQ(createdOf(s.scene, x3d::BooleanFilter::type), 0u) << "a route to what goes keeps nothing";
    EXPECT_EQ(createdOf(s.scene, x3d::BooleanToggle::type), 0u);
}

TEST(Dropped, RoutesAmongThoseThatGoKeepNone) {
    for (const char* route :
         {"sc.addRoute(a, 'toggle', b, 'set_boolean');", "sc.addRoute(b, 'toggle', a, 'set_boolean');"}) {
        ScriptScene s("directOutput TRUE", std::string("function initialize() { var sc = Browser.currentScene;"
                                                       " var a = sc.createNode('BooleanToggle'),"
                                                       " b = sc.createNode('BooleanToggle'); ") +
                                               route + " } " + maker(""));
        for (int i = 0; i < 10; ++i) s.frame();
        EXPECT_EQ(s.problems(), "");
        EXPECT_EQ(createdOf(s.scene, x3d::BooleanToggle::type), 0u) << route;
    }
}

TEST(Dropped, WhatLeavesTheSceneLaterGoesThen) {
    ScriptScene s("directOutput TRUE", maker("scene.addRootNode(n); kept.push(n); if (kept.length > 5) "
                                             "scene.removeRootNode(kept.shift());",
                                             100));
    for (int i = 0; i < 50; ++i) s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_LE(createdOf(s.scene, x3d::Transform::type), 1500u);
    EXPECT_EQ(s.scene.node(s.scene.root()).get(x3d::RtsgScene::children).size(), 6u) << "the Script and five";
}

TEST(Dropped, WhatTheApplicationHoldsStaysUntilItLetsGo) {
    ScriptScene s("", maker(""));
    s.frame();
    NodeId held;
    s.scene.forEachNode([&](const Node& node) {
        if (!held && node.is(x3d::Transform::type)) held = node.id();
    });
    s.scene.hold(held);
    s.scene.hold(held);
    for (int i = 0; i < 5; ++i) s.frame();
    s.scene.letGo(held);
    for (int i = 0; i < 5; ++i) s.frame();
    EXPECT_TRUE(s.scene.find(held)) << "held twice";
    s.scene.letGo(held);
    for (int i = 0; i < 5; ++i) s.frame();
    EXPECT_FALSE(s.scene.find(held));
    s.scene.letGo(held);  // of nobody: nothing happens
    s.scene.hold(NodeId{4'000'000});
}

TEST(Dropped, NodesOfFilesAndOfTheApplicationAreNeverTouched) {
    ScriptScene s("directOutput TRUE",
                  "function initialize() { var sc = Browser.currentScene; "
                  "sc.removeRootNode(sc.getNamedNode('OUT')); } " +
                      maker(""),
                  "DEF OUT Group { children Shape { } }");
    const NodeId own = s.scene.createNode(x3d::Billboard::type);
    for (int i = 0; i < 10; ++i) s.frame();
    EXPECT_TRUE(s.scene.find(own));
    EXPECT_EQ(createdOf(s.scene, x3d::Shape::type), 1u);
}

TEST(Dropped, InstancesGoWithTheirBodiesAndScriptsWithTheirPrograms) {
    ScriptScene s(
        "",
        "var scene = Browser.currentScene; function prepareEvents() { for (var i = 0; i < 60; ++i) "
        "scene.createNode('Lamp'); }",
        "PROTO Lamp [ inputOutput SFBool on TRUE ] { Group { children [ DEF L PointLight { on IS on } DEF Q Script { "
        "inputOnly SFBool go url \"ecmascript: var own = Browser.currentScene.createNode('Billboard'); "
        "function go() {} function shutdown() { }\" } ] } ROUTE L.on TO Q.go }");
    for (int i = 0; i < 12; ++i) s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_LE(createdOf(s.scene, x3d::PointLight::type), 450u);
    EXPECT_LE(createdOf(s.scene, x3d::Billboard::type), 450u) << "held by programs of Scripts that have gone";
}

TEST(Dropped, TwoScriptsThatHoldEachOtherGo) {
    // Each holds the other in a field and in a variable; nothing else refers to either.
    ScriptScene s("directOutput TRUE",
                  "var scene = Browser.currentScene; function prepareEvents() { for (var i = 0; i < 100; ++i) { "
                  "var a = scene.createNode('Pair'), b = scene.createNode('Pair'); a.other = b; b.other = a; } }",
                  "PROTO Pair [ inputOutput SFNode other NULL ] { Script { inputOutput SFNode other IS other url "
                  "\"ecmascript: var it = null; function set_other(o) { it = o; }\" } }");
    for (int i = 0; i < 10; ++i) s.frame();
    std::size_t count = 0;
    s.scene.forEachNode([&](const Node& node) { count += node.type().name == "Pair"; });
    EXPECT_LE(count, 1000u);
}

TEST(Dropped, RunsAreEqualBitForBitAndReplicasFollow) {
    const auto run = [](std::vector<Hash128>& hashes) {
        // The program decides which objects are kept: every seventh, in closures that come and go.
        ScriptScene s("directOutput TRUE",
                      maker("if (i % 7 === 0) kept.push(() => n); if (kept.length > 300) kept.splice(0, 100); "
                            "if (i % 50 === 0) scene.addRootNode(n);",
                            400));
        Scene replica;
        replica.setBehavioursEnabled(false);
        EXPECT_TRUE(replica.apply(std::make_shared<ChangeSet>(s.scene.snapshot())));
        for (int i = 0; i < 25; ++i) {
            const auto set = s.frame();
            EXPECT_TRUE(replica.apply(set));
            hashes.push_back(s.scene.hash());
            EXPECT_EQ(replica.hash(), s.scene.hash());
        }
        EXPECT_EQ(replica.dump(), s.scene.dump());
        EXPECT_LE(createdOf(s.scene, x3d::Transform::type), 3000u);
    };
    std::vector<Hash128> first, second;
    run(first);
    run(second);
    EXPECT_EQ(first, second);
}

TEST(Dropped, WhatAFieldHeldOnceIsNotHeldByItsProgram) {
    ScriptScene s("inputOutput SFNode field NULL inputOutput MFNode fields [ ]",
                  maker("") +
                      " function initialize() { field = scene.createNode('Group'); "
                      "fields = new MFNode(scene.createNode('Group'), field); }");
    s.frame();
    ASSERT_EQ(createdOf(s.scene, x3d::Group::type), 2u) << s.problems();
    ASSERT_TRUE(s.scene.setField(s.script(), s.field("S", "field"), Value(NodeId{})));
    ASSERT_TRUE(s.scene.setField(s.script(), s.field("S", "fields"), Value(Array<NodeId>())));
    for (int i = 0; i < 5; ++i) s.frame();
    EXPECT_EQ(createdOf(s.scene, x3d::Group::type), 0u);
    EXPECT_EQ(s.problems(), "");
}

TEST(Dropped, ScriptsKeepNoMoreNodesThanThePolicyLets) {
    ScriptOptions options;
    ResourcePolicy policy;
    policy.maximumNodes = 100;
    options.resources = std::make_shared<const Resources>(std::filesystem::path(), policy);
    ScriptScene s("outputOnly SFInt32 n", R"(
        var kept = [], scene = Browser.currentScene;
        function initialize() {
            try { for (;;) kept.push(scene.createNode('Group')); } catch (e) { n = kept.length; }
            for (const make of [() => scene.createNode('Group'), () => Browser.createVrmlFromString('Group { }')])
                try { make(); } catch (e) { print(e.message); }
        })",
                  {}, options);
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 100);
    EXPECT_EQ(createdOf(s.scene, x3d::Group::type), 100u);
    EXPECT_EQ(s.printed,
              "scripts may make 100 nodes that are there at a time: 100 are, and this may be 1 more\n"
              "scripts may make 100 nodes that are there at a time: 100 are, and this may be 4 more\n")
        << s.problems();
}

TEST(Dropped, ATextThatMayMakeTooManyNodesIsNotRead) {
    ScriptOptions options;
    ResourcePolicy policy;
    policy.maximumNodes = 100;
    options.resources = std::make_shared<const Resources>(std::filesystem::path(), policy);
    ScriptScene s("outputOnly SFInt32 n", R"(
        function initialize() {
            n = Browser.createVrmlFromString('Group{}'.repeat(42)).length;
            Browser.createVrmlFromString('Group{}'.repeat(43));
        })",
                  {}, options);
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 42);
    EXPECT_NE(s.problems().find("scripts may make 100 nodes"), std::string::npos) << s.problems();
    EXPECT_EQ(createdOf(s.scene, x3d::Group::type), 42u);
}

}  // namespace
}  // namespace rtsg
