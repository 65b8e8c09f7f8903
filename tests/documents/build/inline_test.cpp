// ISO/IEC 19775-1 V4.0 9.4.2 (Inline), 4.4.5 (EXTERNPROTO), 4.4.6 (IMPORT, EXPORT): documents made of several files.
#include <fstream>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

class Inlines : public testing::Test {
  protected:
    Inlines() { std::filesystem::create_directories(folder / "parts"); }
    void write(const std::string& name, std::string_view text) {
        std::ofstream(folder / name, std::ios::binary) << "#X3D V4.0 utf8\n" << text;
    }
    bool load(const std::string& name, const LoadOptions& options = {}) {
        return loadFile(scene, folder / name, diagnostics, options);
    }
    std::string problems() const { return test::allText(diagnostics); }
    NodeId at(std::initializer_list<const char*> path) const {
        NodeId id;
        for (const char* name : path) id = scene.findName(name, id);
        return id;
    }
    std::string get(NodeId id, std::string_view field) const {
        return printFieldText(scene.node(id).value(scene.node(id).type().find(field)));
    }

    const test::TempFolder own;
    const std::filesystem::path folder = own.path();
    Scene scene;
    Diagnostics diagnostics;
};

TEST_F(Inlines, UrlsAreRelativeToTheirOwnDocument) {
    write("main.x3dv", "DEF I Inline { url \"parts/a.x3dv\" }");
    write("parts/a.x3dv", "DEF J Inline { url [ \"nowhere.x3dv\" \"b%20b.x3dv\" ] }");
    write("parts/b b.x3dv", "DEF T Transform { translation 1 2 3 }");
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_EQ(problems(), "");
    EXPECT_EQ(get(at({"I", "J", "T"}), "translation"), "1 2 3");
}

TEST_F(Inlines, DiagnosticsNameTheFileAndTheUrl) {
    write("main.x3dv", "Group { }\nDEF I Inline { url \"parts/bad.x3dv\" }\nDEF J Inline { url \"gone.x3dv\" }");
    write("parts/bad.x3dv", "\n\nTransform { nothing 1 }");
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_THAT(problems(), HasSubstr("parts/bad.x3dv:4:"));
    EXPECT_THAT(problems(), HasSubstr("main.x3dv:4:1: error: Inline: 'gone.x3dv' is not there"));
}

TEST_F(Inlines, ABrokenFileIsNotLoaded) {
    write("main.x3dv", "DEF I Inline { url \"junk.png\" }\nDEF J Inline { url \"parts\" }");
    std::ofstream(folder / "junk.png", std::ios::binary) << "\x89PNG\r\n\x1a\n" << std::string(100, '\0');
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_GE(diagnostics.errors(), 2u) << problems();
    EXPECT_EQ(scene.nodeCount(), 3u);
}

TEST_F(Inlines, LinesOfATextFileAreNotRepeated) {
    write("main.x3dv", "DEF I Inline { url \"notes.txt\" }\nEXTERNPROTO P [ ] \"notes.xml#P\" P { }");
    std::ofstream(folder / "notes.txt") << "password hunter2\nroot:x:0:0:hunter2\n";
    std::ofstream(folder / "notes.xml") << "<passwords><hunter2 value='hunter2'/></passwords>";
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_THAT(problems(), HasSubstr("'notes.txt' is no scene: it starts neither with #X3D or #VRML"));
    EXPECT_THAT(problems(), HasSubstr("'notes.xml#P'"));
    EXPECT_THAT(problems(), testing::Not(HasSubstr("hunter2")));
}

TEST_F(Inlines, FilesOutsideAreRefused) {
    write("parts/main.x3dv", "Inline { url \"../a.x3dv\" }\nEXTERNPROTO P [ ] \"../a.x3dv#P\" P { }");
    write("a.x3dv", "PROTO P [ ] { Group { } }");
    LoadOptions options;
    options.resources = Resources(folder / "parts");
    ASSERT_TRUE(load("parts/main.x3dv", options));
    EXPECT_THAT(problems(), HasSubstr("main.x3dv:2:1: error: Inline: '../a.x3dv' is outside"));
    EXPECT_THAT(problems(), HasSubstr("main.x3dv:3:13: error: EXTERNPROTO P cannot be resolved"));
    EXPECT_THAT(problems(), HasSubstr("--allow " + folder.string()));
}

TEST_F(Inlines, TheirNodesAreLimited) {
    // 2^20 Groups from 21 lines.
    for (int i = 0; i < 20; ++i)
        write(fmt::format("n{}.x3dv", i),
              fmt::format("Inline {{ url \"n{0}.x3dv\" }} Inline {{ url \"n{0}.x3dv\" }}", i + 1));
    write("n20.x3dv", "Group { }");
    LoadOptions options;
    ResourcePolicy policy;
    policy.maximumNodes = 1000;
    options.resources = Resources::ofFile(folder / "n0.x3dv", policy);
    ASSERT_TRUE(load("n0.x3dv", options));
    EXPECT_LE(scene.nodeCount(), 1010u);
    EXPECT_THAT(problems(), HasSubstr("more than 1000 nodes"));
    EXPECT_THAT(problems(), HasSubstr("--limit nodes=N"));
}

TEST_F(Inlines, NestingIsLimited) {
    for (int i = 0; i < 10; ++i)
        write(fmt::format("n{}.x3dv", i), fmt::format("DEF I Inline {{ url \"n{}.x3dv\" }} DEF T Group {{ }}", i + 1));
    write("n10.x3dv", "DEF T Group { }");
    LoadOptions options;
    ResourcePolicy policy;
    policy.maximumDepth = 5;
    options.resources = Resources::ofFile(folder / "n0.x3dv", policy);
    ASSERT_TRUE(load("n0.x3dv", options));
    EXPECT_THAT(problems(), HasSubstr("more than 5"));
    EXPECT_TRUE(at({"I", "I", "I", "I", "I", "T"}));
    EXPECT_FALSE(at({"I", "I", "I", "I", "I", "I", "T"}));
}

TEST_F(Inlines, AFileInlinedOftenIsReadOnce) {
    write("part.x3dv", "Transform { nothing 1 } DEF T Transform { translation 1 1 1 }");
    std::string text;
    for (int i = 0; i < 200; ++i) text += fmt::format("DEF I{} Inline {{ url \"part.x3dv\" }}\n", i);
    write("main.x3dv", text);
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_EQ(diagnostics.errors(), 1u) << problems();
    EXPECT_NE(at({"I0", "T"}), at({"I199", "T"}));
}

TEST_F(Inlines, PrototypesOfDocumentsDoNotMix) {
    write("main.x3dv",
          "PROTO P [ ] { DEF T Group { } } DEF A P { } DEF I Inline { url \"part.x3dv\" } DEF J Inline { url "
          "\"other.x3dv\" }");
    write("part.x3dv", "PROTO P [ ] { DEF T Transform { } } DEF A P { }");
    write("other.x3dv", "DEF A P { }");
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_EQ(scene.node(at({"A", "T"})).type().name, "Group");
    EXPECT_EQ(scene.node(at({"I", "A", "T"})).type().name, "Transform");
    EXPECT_FALSE(at({"J", "A"})) << "a PROTO of the outer document is not known in an inlined one";
}

TEST_F(Inlines, AnInlineInAProtoTakesItsUrlFromTheInstance) {
    write("main.x3dv",
          "PROTO P [ initializeOnly MFString where [ ] ] { DEF I Inline { url IS where } }\n"
          "DEF A P { where \"part.x3dv\" } DEF B P { }");
    write("part.x3dv", "DEF T Transform { }");
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_EQ(problems(), "");
    EXPECT_TRUE(at({"A", "I", "T"}));
    EXPECT_FALSE(at({"B", "I", "T"}));
}

TEST_F(Inlines, AnExternProtoThatContainsItselfEnds) {
    write("main.x3dv", "EXTERNPROTO P [ ] \"lib.x3dv#P\" DEF A P { }");
    write("lib.x3dv", "EXTERNPROTO P2 [ ] \"lib2.x3dv#Q\" PROTO P [ ] { Group { children P2 { } } }");
    write("lib2.x3dv", "EXTERNPROTO P3 [ ] \"lib.x3dv#P\" PROTO Q [ ] { Group { children P3 { } } }");
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_THAT(problems(), HasSubstr("contains itself"));
    EXPECT_LT(scene.nodeCount(), 20u);
}

TEST_F(Inlines, AnExternProtoOfAnExternProto) {
    write("main.x3dv",
          "EXTERNPROTO P [ inputOutput SFVec3f at ] \"lib.x3dv#P\" DEF A P { at 4 5 6 }\n"
          "EXTERNPROTO Wrong [ inputOnly SFVec3f at ] \"lib2.x3dv#P\" DEF B Wrong { }");
    write("lib.x3dv", "EXTERNPROTO P [ inputOutput SFVec3f at ] \"lib2.x3dv#P\"");
    write("lib2.x3dv", "PROTO P [ inputOutput SFVec3f at 1 1 1 ] { DEF T Transform { translation IS at } }");
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_EQ(get(at({"A", "T"}), "translation"), "4 5 6");
    EXPECT_EQ(diagnostics.errors(), 1u) << problems();
    EXPECT_THAT(problems(), HasSubstr("EXTERNPROTO Wrong: field 'at' is inputOutput SFVec3f in the PROTO"));
}

TEST_F(Inlines, BadImportsAreReported) {
    write("main.x3dv",
          "DEF I Inline { url \"part.x3dv\" } DEF G Group { }\n"
          "IMPORT I.T AS A\nIMPORT I.Nothing AS B\nIMPORT G.T AS C\nIMPORT I.T AS G\nIMPORT I.T AS A\n"
          "EXPORT Nobody\nROUTE A.translation TO G.nothing\nROUTE B.x TO A.translation");
    write("part.x3dv", "DEF T Transform { } DEF Hidden Group { } EXPORT T");
    ASSERT_TRUE(load("main.x3dv"));
    for (const char* text : {"main.x3dv:4:", "exports no such name", "no Inline is named 'G'",
                             "a node has that name already", "another IMPORT", "EXPORT 'Nobody'", "no field 'nothing'"})
        EXPECT_THAT(problems(), HasSubstr(text));
}

TEST_F(Inlines, AreSavedAsInlines) {
    write("main.x3dv",
          "DEF I Inline { url \"part.x3dv\" } DEF A Transform { }\nIMPORT I.T AS M EXPORT A AS Out\n"
          "EXPORT M ROUTE A.translation TO M.translation ROUTE M.center TO A.center");
    write("part.x3dv", "DEF T Transform { children Shape { } } EXPORT T");
    ASSERT_TRUE(load("main.x3dv"));
    ASSERT_EQ(problems(), "");
    ASSERT_EQ(scene.routeCount(), 2u);
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml}) {
        std::string text;
        const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, diagnostics);
        SceneExporter(scene, diagnostics).write(*writer, encoding);
        EXPECT_EQ(text.find("Shape"), std::string::npos) << text;
        Scene again;
        Diagnostics more;
        ASSERT_TRUE(loadText(again, text, more, folder));
        EXPECT_EQ(test::allText(more), "") << text;
        EXPECT_EQ(test::canonicalText(again), test::canonicalText(scene));
    }
    EXPECT_EQ(problems(), "");
}

TEST_F(Inlines, LoadAndUnloadWhileRunning) {
    write("main.x3dv",
          "DEF I Inline { load FALSE url \"part.x3dv\" } DEF A Transform { }\nIMPORT I.T AS M\n"
          "ROUTE A.translation TO M.translation");
    write("part.x3dv",
          "PROTO P [ ] { DEF X Transform { } } DEF T Transform { children [ P { } DEF J Inline { url \"more.x3dv\" } ] "
          "} EXPORT T");
    write("more.x3dv", "DEF D Shape { }");
    ASSERT_TRUE(load("main.x3dv"));
    const std::size_t before = scene.nodeCount();
    BuildOptions options;
    options.file = folder / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    EXPECT_EQ(loader.update(), 0u);
    const NodeId i = at({"I"});
    const FieldIndex loadField = scene.node(i).type().find("load"), url = scene.node(i).type().find("url");
    std::size_t full = 0;
    for (int round = 0; round < 3; ++round) {
        ASSERT_TRUE(scene.sendEvent(i, loadField, Value(true)));
        scene.newFrame(round * 4);
        EXPECT_EQ(loader.update(), 1u);
        EXPECT_TRUE(at({"I", "J", "D"})) << problems();
        EXPECT_EQ(scene.routeCount(), 1u);
        EXPECT_TRUE(full == 0 || scene.nodeCount() == full) << scene.nodeCount() << " instead of " << full;
        full = scene.nodeCount();
        // Another url in place of the one loaded.
        ASSERT_TRUE(scene.sendEvent(i, url, Value(Array<String>{String("more.x3dv")})));
        scene.newFrame(round * 4 + 1);
        EXPECT_EQ(loader.update(), 1u);
        EXPECT_FALSE(at({"I", "T"}));
        EXPECT_TRUE(at({"I", "D"}));
        ASSERT_TRUE(scene.sendEvent(i, url, Value(Array<String>{String("part.x3dv")})));
        ASSERT_TRUE(scene.sendEvent(i, loadField, Value(false)));
        scene.newFrame(round * 4 + 2);
        EXPECT_EQ(loader.update(), 1u);
        EXPECT_EQ(scene.nodeCount(), before);
        EXPECT_EQ(scene.routeCount(), 0u);
        EXPECT_EQ(loader.update(), 0u);
    }
    EXPECT_EQ(problems(), "");
    // A replica has followed all of it.
    scene.seal();
    Scene replica;
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(scene.snapshot())));
    EXPECT_EQ(replica.dump(), scene.dump());
}

TEST_F(Inlines, ACircleIsRefusedAtRunTimeToo) {
    write("main.x3dv", "DEF I Inline { load FALSE url \"a.x3dv\" }");
    write("a.x3dv", "DEF J Inline { load FALSE url \"main.x3dv\" }");
    ASSERT_TRUE(load("main.x3dv"));
    BuildOptions options;
    options.file = folder / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    ASSERT_TRUE(scene.setField(at({"I"}), scene.node(at({"I"})).type().find("load"), Value(true)));
    scene.newFrame(0);
    EXPECT_EQ(loader.update(), 1u);
    ASSERT_TRUE(at({"I", "J"}));
    ASSERT_TRUE(scene.setField(at({"I", "J"}), scene.node(at({"I", "J"})).type().find("load"), Value(true)));
    scene.newFrame(1);
    loader.update();
    EXPECT_THAT(problems(), HasSubstr("would contain itself"));
    EXPECT_FALSE(at({"I", "J", "I"}));
}

TEST_F(Inlines, AGeometryAloneIsTakenFromAMeshFile) {
    write("main.x3dv", "Shape { geometry DEF I InlineGeometry { url \"part.stl\" solid TRUE smooth FALSE } }");
    std::ofstream(folder / "part.stl") << "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                          "vertex 0 1 0\nendloop\nendfacet\nendsolid s\n";
    ASSERT_TRUE(load("main.x3dv"));
    EXPECT_EQ(problems(), "");
    const Node* geometry = scene.effectiveNode(at({"I"}));
    ASSERT_NE(geometry, nullptr);
    EXPECT_TRUE(geometry->type().isA("X3DComposedGeometryNode")) << geometry->type().name;
    EXPECT_EQ(get(geometry->id(), "solid"), "TRUE");
    const Node* coord = scene.find(*static_cast<const NodeId*>(geometry->storage(geometry->type().find("coord"))));
    ASSERT_NE(coord, nullptr);
    EXPECT_EQ(get(coord->id(), "point"), "[0 0 0, 1 0 0, 0 1 0]");
    // The Shape of the file is gone: it is neither in the scene nor in what is saved of it.
    std::size_t shapes = 0;
    scene.forEachNode([&](const Node& node) { shapes += node.type().name == "Shape"; });
    EXPECT_EQ(shapes, 1u);
}

TEST_F(Inlines, GeometriesComeAndGoWithoutALeftover) {
    write("main.x3dv", "Shape { geometry DEF I InlineGeometry { load FALSE url \"part.x3dv\" } }");
    write("part.x3dv",
          "PROTO P [ ] { IndexedFaceSet { coord Coordinate { point [ 0 0 0 ] } } } DEF T Transform { children [ "
          "DEF J Inline { url \"more.x3dv\" } Shape { appearance Appearance { } geometry DEF G P { } } ] }\n"
          "DEF C TimeSensor { } DEF S ScalarInterpolator { } ROUTE C.fraction_changed TO S.set_fraction");
    write("more.x3dv", "DEF D Shape { geometry Box { } }");
    ASSERT_TRUE(load("main.x3dv"));
    const std::size_t before = scene.nodeCount();
    BuildOptions options;
    options.file = folder / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    for (int round = 0; round < 3; ++round) {
        ASSERT_TRUE(scene.setField(at({"I"}), scene.node(at({"I"})).type().find("load"), Value(true)));
        scene.newFrame(2 * round);
        EXPECT_EQ(loader.update(), 1u);
        EXPECT_EQ(scene.nodeCount(), before + 3) << "the instance, its face set, and that one's points";
        EXPECT_EQ(scene.routeCount(), 0u);
        ASSERT_TRUE(scene.effectiveNode(at({"I"})));
        EXPECT_EQ(scene.effectiveNode(at({"I"}))->type().name, "IndexedFaceSet");
        ASSERT_TRUE(scene.setField(at({"I"}), scene.node(at({"I"})).type().find("load"), Value(false)));
        scene.newFrame(2 * round + 1);
        EXPECT_EQ(loader.update(), 1u);
        EXPECT_EQ(scene.nodeCount(), before);
        EXPECT_EQ(scene.effectiveNode(at({"I"})), nullptr);
    }
    EXPECT_EQ(problems(), "");
}

TEST_F(Inlines, AreReadAgainWhenTheirTimeHasCome) {
    write("main.x3dv",
          "DEF I Inline { url \"a.x3dv\" autoRefresh 2 autoRefreshTimeLimit 9 }\n"
          "Shape { geometry DEF G InlineGeometry { url \"g.x3dv\" autoRefresh 4 } } DEF K Inline { url \"a.x3dv\" }");
    write("a.x3dv", "DEF T Transform { translation 1 0 0 }");
    write("g.x3dv", "Shape { geometry DEF B Box { size 1 1 1 } }");
    ASSERT_TRUE(load("main.x3dv"));
    BuildOptions options;
    options.file = folder / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    const auto frame = [&](double t) {
        scene.newFrame(t);
        const std::size_t count = loader.update();
        scene.seal();
        return count;
    };
    EXPECT_EQ(frame(0), 0u);
    write("a.x3dv", "DEF T Transform { translation 2 0 0 }");
    write("g.x3dv", "Shape { geometry DEF B Box { size 2 2 2 } }");
    EXPECT_EQ(frame(1.9), 0u);
    EXPECT_EQ(get(at({"I", "T"}), "translation"), "1 0 0");
    EXPECT_EQ(frame(2), 1u);
    EXPECT_EQ(get(at({"I", "T"}), "translation"), "2 0 0");
    EXPECT_EQ(get(at({"K", "T"}), "translation"), "1 0 0");
    EXPECT_EQ(get(at({"G", "B"}), "size"), "1 1 1");
    const std::size_t nodes = scene.nodeCount();
    EXPECT_EQ(frame(4), 2u);
    EXPECT_EQ(get(at({"G", "B"}), "size"), "2 2 2");
    EXPECT_EQ(scene.nodeCount(), nodes);
    // If a file is missing for a moment, the old content stays; content that is not to be loaded is removed.
    std::filesystem::remove(folder / "a.x3dv");
    EXPECT_EQ(frame(6), 0u);
    EXPECT_EQ(get(at({"I", "T"}), "translation"), "2 0 0");
    EXPECT_EQ(problems(), "");
    write("a.x3dv", "DEF T Transform { translation 3 0 0 }");
    EXPECT_EQ(frame(8), 2u);
    EXPECT_EQ(get(at({"I", "T"}), "translation"), "3 0 0");
    write("a.x3dv", "DEF T Transform { translation 4 0 0 }");
    EXPECT_EQ(frame(10), 0u);  // beyond its limit
    EXPECT_EQ(get(at({"I", "T"}), "translation"), "3 0 0");
    ASSERT_TRUE(scene.set(at({"G"}), x3d::InlineGeometry::autoRefresh, Time{0}));
    EXPECT_EQ(frame(20), 0u);
    // From the time when it is asked for.
    ASSERT_TRUE(scene.set(at({"K"}), x3d::Inline::autoRefresh, Time{1}));
    EXPECT_EQ(frame(21), 0u);
    EXPECT_EQ(frame(22), 1u);
    EXPECT_EQ(get(at({"K", "T"}), "translation"), "4 0 0");
}

}  // namespace
}  // namespace rtsg
