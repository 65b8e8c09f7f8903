// Where nodes were read is known while the scene runs: of documents, of what they inline, of bodies of prototypes.
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

std::string readIn(const Scene& scene, NodeId id) {
    const NodeLocation location = scene.locationOf(id);
    const std::string file = std::filesystem::path(location.file).filename();
    return file + ":" + std::to_string(location.where.line) + ":" + std::to_string(location.where.column);
}

TEST(NodeLocations, AreThoseOfTheFilesThatNodesAreFrom) {
    const test::TempFolder folder;
    const auto write = [&](const char* name, const char* text) {
        std::ofstream(folder.path() / name, std::ios::binary) << "#X3D V4.0 utf8\n" << text;
    };
    write("main.x3dv",
          "PROTO P [ ] {\n DEF BODY Group { } }\nDEF A Transform {\n  children DEF B Shape { } }\nInline { url "
          "\"part.x3dv\" }\nDEF C P { }\nDEF S Script { inputOnly SFBool on url \"ecmascript:\" }");
    write("part.x3dv", "\nGroup { children DEF INNER Group { } }");
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, folder.path() / "main.x3dv", diagnostics));
    EXPECT_EQ(readIn(scene, scene.findName("A")), "main.x3dv:4:1");
    EXPECT_EQ(readIn(scene, scene.findName("B")), "main.x3dv:5:12");
    EXPECT_EQ(readIn(scene, scene.findName("C")), "main.x3dv:7:1");
    EXPECT_EQ(readIn(scene, scene.findName("S")), "main.x3dv:8:1");
    int bodies = 0, inner = 0;
    scene.forEachNode([&](const Node& node) {
        bodies += scene.name(node.id()) == "BODY" && readIn(scene, node.id()) == "main.x3dv:3:2";
        inner += scene.name(node.id()) == "INNER" && readIn(scene, node.id()) == "part.x3dv:3:18";
    });
    EXPECT_EQ(bodies, 1);
    EXPECT_EQ(inner, 1);
    // A node that was not read from a file has no place, and a replica reads none.
    EXPECT_EQ(readIn(scene, scene.createNode(x3d::Group::type)), ":0:0");
    EXPECT_EQ(readIn(scene, NodeId{123456}), ":0:0");
    Scene replica;
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene.snapshot())));
    EXPECT_EQ(readIn(replica, scene.findName("A")), ":0:0");
    EXPECT_EQ(replica.dump(), scene.dump()) << "no part of the state";
}

TEST(NodeLocations, ComeInAnyOrder) {
    Scene scene;
    for (const std::uint32_t id : {5u, 9u, 7u, 1u, 9u, 8u})
        scene.setLocation(NodeId{id}, {id % 2 ? "odd" : "even", {id, id + 100}});
    scene.setLocation(NodeId{7}, {"other", {1, 2}});
    for (const std::uint32_t id : {1u, 5u, 8u, 9u}) {
        EXPECT_EQ(scene.locationOf(NodeId{id}).file, id % 2 ? "odd" : "even");
        EXPECT_EQ(scene.locationOf(NodeId{id}).where.line, id);
        EXPECT_EQ(scene.locationOf(NodeId{id}).where.column, id + 100);
    }
    EXPECT_EQ(scene.locationOf(NodeId{7}).file, "other");
    EXPECT_EQ(scene.locationOf(NodeId{6}).file, "");
}

}  // namespace
}  // namespace rtsg
