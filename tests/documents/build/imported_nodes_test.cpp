// Imports and exports as a program reads and changes them, of the document itself and of what an Inline has loaded.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>
#include <rtsg/scripts/run_scripts.h>

namespace rtsg {
namespace {

class ImportedNodesTest : public testing::Test {
  protected:
    ImportedNodesTest()
        : folder_(std::filesystem::temp_directory_path() / ("rtsg_imported_" + std::to_string(::getpid()))) {
        std::filesystem::create_directories(folder_);
        file("lamp.x3dv", "DEF LAMP PointLight { } EXPORT LAMP AS LIGHT");
        file("room.x3dv",
             "DEF HOLDER Inline { url \"lamp.x3dv\" } DEF TABLE Transform { } IMPORT HOLDER.LIGHT AS BULB "
             "EXPORT BULB AS SUN EXPORT TABLE");
        load(scene_, file("hall.x3dv",
                          "DEF ROOM Inline { url \"room.x3dv\" } DEF EMPTY Inline { load FALSE } DEF T Transform { } "
                          "IMPORT ROOM.SUN AS S IMPORT EMPTY.X AS NONE EXPORT T AS OUT"));
    }
    ~ImportedNodesTest() override { std::filesystem::remove_all(folder_); }
    std::filesystem::path file(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << "#X3D V4.0 utf8\nPROFILE Immersive\n" << text;
        return folder_ / name;
    }
    static void load(Scene& scene, const std::filesystem::path& from) {
        Diagnostics diagnostics;
        ASSERT_TRUE(loadWorld(scene, from, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        scene.newFrame(0);
    }
    static std::string wrong(const Result<>& result) { return result ? "" : result.error().text; }

    std::filesystem::path folder_;
    Scene scene_;
};

TEST_F(ImportedNodesTest, AreReadWithTheirNodes) {
    const NodeId room = scene_.findName("ROOM"), holder = scene_.findName("HOLDER", room);
    const NodeId lamp = scene_.findName("LAMP", holder);
    ASSERT_TRUE(lamp);
    const auto imports = importedNodes(scene_);
    ASSERT_EQ(imports.size(), 2U);
    EXPECT_EQ(imports[0].localName + ' ' + imports[0].exportedName, "S SUN");
    EXPECT_EQ(imports[0].inlineNode, room);
    EXPECT_EQ(imports[0].node, lamp);  // through two Inlines
    EXPECT_EQ(imports[1].localName, "NONE");
    EXPECT_EQ(imports[1].inlineNode, scene_.findName("EMPTY"));
    EXPECT_FALSE(imports[1].node);  // not loaded
    const auto exports = exportedNodes(scene_);
    ASSERT_EQ(exports.size(), 1U);
    EXPECT_EQ(exports[0].exportedName + ' ' + exports[0].localName, "OUT T");
    EXPECT_EQ(exports[0].node, scene_.findName("T"));
    // The content of an Inline.
    ASSERT_EQ(importedNodes(scene_, room).size(), 1U);
    EXPECT_EQ(importedNodes(scene_, room)[0].inlineNode, holder);
    const auto offered = exportedNodes(scene_, room);
    ASSERT_EQ(offered.size(), 2U);
    EXPECT_EQ(offered[0].node, lamp);
    EXPECT_EQ(offered[1].node, scene_.findName("TABLE", room));
    EXPECT_EQ(findImported(scene_, "S"), lamp);
    EXPECT_EQ(findImported(scene_, "BULB", room), lamp);
    EXPECT_EQ(findExported(scene_, "SUN", room), lamp);
    EXPECT_EQ(findExported(scene_, "OUT"), scene_.findName("T"));
    EXPECT_FALSE(findImported(scene_, "T"));  // a name of its own is no import
    EXPECT_FALSE(findExported(scene_, "T"));  // the local name is not what is exported
    // A node that is no document has none.
    EXPECT_TRUE(importedNodes(scene_, scene_.findName("T")).empty());
    EXPECT_TRUE(exportedNodes(scene_, scene_.findName("T")).empty());
}

/// Under the name that it has here, and not under that of the document it came from.
TEST_F(ImportedNodesTest, AScriptPassesOnWhatIsImported) {
    Scene scene;
    runScripts(scene);
    load(scene, file("script.x3dv",
                     "DEF ROOM Inline { url \"room.x3dv\" } IMPORT ROOM.SUN AS S Script { url \"ecmascript: function "
                     "initialize() { const here = Browser.currentScene; here.updateExportedNode('PASSED', "
                     "here.getImportedNode('S')); if (here.getExportedNode('PASSED') !== here.getImportedNode('S')) "
                     "throw 'another node'; }\" }"));
    for (const Diagnostic& d : scene.diagnostics().all()) ADD_FAILURE() << d.format();
    const auto exports = exportedNodes(scene);
    ASSERT_EQ(exports.size(), 1U);
    EXPECT_EQ(exports[0].exportedName + ' ' + exports[0].localName, "PASSED S");
    EXPECT_TRUE(exports[0].node);
    EXPECT_EQ(exports[0].node, findImported(scene, "S"));
}

TEST_F(ImportedNodesTest, AreChangedFollowedAndSaved) {
    Scene replica;
    replica.setBehavioursEnabled(false);
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene_.snapshot())));
    const NodeId room = scene_.findName("ROOM"), table = scene_.findName("TABLE", room);
    const NodeId lamp = findImported(scene_, "S");
    ASSERT_TRUE(updateImportedNode(scene_, room, "TABLE"));
    EXPECT_EQ(findImported(scene_, "TABLE"), table);
    ASSERT_TRUE(updateImportedNode(scene_, room, "TABLE", "S"));  // another node under a known name
    EXPECT_EQ(findImported(scene_, "S"), table);
    EXPECT_EQ(importedNodes(scene_).size(), 3U);
    ASSERT_TRUE(removeImportedNode(scene_, "TABLE"));
    ASSERT_TRUE(removeImportedNode(scene_, "NONE"));
    EXPECT_FALSE(findImported(scene_, "TABLE"));
    ASSERT_TRUE(updateExportedNode(scene_, "PASSED", table));  // what is imported is passed on
    ASSERT_TRUE(updateExportedNode(scene_, "OUT", room));
    ASSERT_TRUE(updateExportedNode(scene_, "MORE", scene_.findName("T")));
    ASSERT_TRUE(removeExportedNode(scene_, "MORE"));
    ASSERT_TRUE(replica.apply(scene_.newFrame(1)));
    EXPECT_EQ(replica.hash(), scene_.hash());
    EXPECT_EQ(findExported(replica, "PASSED"), table);
    // Within an Inline, until it is loaded anew.
    ASSERT_TRUE(removeExportedNode(scene_, "SUN", room));
    ASSERT_TRUE(updateExportedNode(scene_, "DESK", table, room));
    ASSERT_TRUE(updateExportedNode(scene_, "SUN2", lamp, room));
    EXPECT_EQ(findExported(scene_, "DESK", room), table);
    EXPECT_EQ(findExported(scene_, "SUN2", room), lamp);

    Diagnostics diagnostics;
    ASSERT_TRUE(saveWorld(scene_, folder_ / "saved.x3d", diagnostics));
    Scene again;
    load(again, folder_ / "saved.x3d");
    const auto imports = importedNodes(again);
    ASSERT_EQ(imports.size(), 1U);
    EXPECT_EQ(imports[0].localName, "S");
    EXPECT_EQ(imports[0].node, again.findName("TABLE", again.findName("ROOM")));
    ASSERT_EQ(exportedNodes(again).size(), 2U);
    EXPECT_EQ(findExported(again, "PASSED"), imports[0].node);
    EXPECT_EQ(findExported(again, "OUT"), again.findName("ROOM"));
}

TEST_F(ImportedNodesTest, SayWhatIsWrong) {
    const NodeId room = scene_.findName("ROOM"), t = scene_.findName("T"), table = scene_.findName("TABLE", room);
    const std::string before = scene_.dump();
    EXPECT_EQ(wrong(updateImportedNode(scene_, t, "X")), "Transform exports nothing: an Inline does");
    EXPECT_NE(wrong(updateImportedNode(scene_, scene_.root(), "X")), "");
    EXPECT_EQ(updateImportedNode(scene_, NodeId{9999}, "X").error().code.text(), "no-such-node");
    EXPECT_EQ(wrong(updateImportedNode(scene_, room, "TABLE", "T")), "a node is named T already");
    EXPECT_EQ(wrong(updateImportedNode(scene_, room, "")), "a node is imported under a name");
    EXPECT_EQ(wrong(removeImportedNode(scene_, "T")), "nothing is imported as T");
    EXPECT_EQ(wrong(removeExportedNode(scene_, "T")), "nothing is exported as T");
    EXPECT_EQ(wrong(updateExportedNode(scene_, "X", table)),
              "a node that has no name in the document cannot be exported");
    EXPECT_EQ(wrong(updateExportedNode(scene_, "", t)), "a node is exported under a name");
    EXPECT_EQ(updateExportedNode(scene_, "X", NodeId{9999}).error().code.text(), "no-such-node");
    EXPECT_NE(wrong(updateExportedNode(scene_, "X", t, t)), "");
    EXPECT_NE(wrong(removeExportedNode(scene_, "OUT", t)), "");
    EXPECT_EQ(scene_.dump(), before);
    const NodeId nameless = scene_.createNode(x3d::Inline::type);
    EXPECT_EQ(wrong(updateImportedNode(scene_, nameless, "X")), "an Inline without a name exports nothing");
    EXPECT_EQ(wrong(updateExportedNode(scene_, "X", nameless)),
              "a node that has no name in the document cannot be exported");
}

}  // namespace
}  // namespace rtsg
