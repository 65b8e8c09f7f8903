// Plug-ins and node tables as a library has them: what they add, and what is said of those that are not as they should
// be.
#include <rtsg/plugins/plugin.h>

#include <fstream>

#include <sys/stat.h>

#include <gtest/gtest.h>

#include <rtsg/core/field_path.h>
#include <rtsg/core/field_text.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/light_renderer.h>

#include "support/temp_folder.h"
#include "test_plugins.h"

namespace rtsg::test {
namespace {

std::string plugin(const std::string& name) {
    return std::string(RTSG_TEST_PLUGINS) + "/" + name + ".so";
}

std::string whyNot(const std::string& file) {
    Extensions extensions;
    const Result<> loaded = loadPlugin(file, extensions);
    EXPECT_FALSE(loaded);
    EXPECT_EQ(extensions.dialect(), nullptr) << "nothing of it was added";
    return loaded ? std::string() : loaded.error().format();
}

void write(const std::filesystem::path& file, std::string_view text) {
    std::ofstream(file, std::ios::binary) << text;
}

std::string complaints(const Diagnostics& diagnostics) {
    std::string all;
    for (const Diagnostic& one : diagnostics.all()) all += one.format() + '\n';
    return all;
}

TEST(Plugins, AddTypesThatActFormatsAndMeshes) {
    Extensions extensions;
    const Result<> loaded = loadPlugin(plugin("workshop"), extensions);
    ASSERT_TRUE(loaded) << loaded.error().format();
    ASSERT_NE(extensions.dialect(), nullptr);
    Scene scene;
    extensions.registerWith(scene);
    const std::size_t types = scene.typeCount();
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nDEF S Spinner { turnsPerSecond .25 } DEF T Transform { children Shape { "
                         "geometry Pane { halfSize 2 } } } ROUTE S.rotation_changed TO T.rotation",
                         diagnostics));
    EXPECT_EQ(complaints(diagnostics), "");
    EXPECT_EQ(scene.typeCount(), types + 2);
    scene.newFrame(1);
    const Node& turned = scene.node(scene.findName("T"));
    EXPECT_EQ(printFieldText(turned.value(turned.type().find("rotation"))), "0 1 0 1.5707964");
    SharedWorld world(scene);
    EXPECT_EQ(world.diagnostics().all().size(), 1u) << "a Pane without a source has no triangles";
    extensions.registerWith(world);
    EXPECT_EQ(complaints(world.diagnostics()), "");
    const InstanceDelta all = world.flattener().snapshot();
    ASSERT_EQ(all.geometries.size(), 1u);
    ASSERT_NE(all.geometries[0].mesh, nullptr);
    EXPECT_EQ(all.geometries[0].mesh->bounds.size().x, 4);
}

TEST(Plugins, TakeThePlaceOfWhatIsBuiltInForRenderers) {
    Extensions extensions;
    const Result<> loaded = loadPlugin(plugin("drawing"), extensions);
    ASSERT_TRUE(loaded) << loaded.error().format();
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene, "#X3D V4.0 utf8\nShape { geometry Sphere { } } Shape { geometry Box { } }", diagnostics));
    SharedWorld world(scene);
    extensions.registerWith(world);
    std::size_t empty = 0;
    const InstanceDelta all = world.flattener().snapshot();
    for (const auto& one : all.geometries) empty += one.mesh && one.mesh->empty();
    EXPECT_EQ(empty, 1u) << "the Box has the plug-in's triangles, which are none";
    LightRenderer light(world);
    extensions.registerWith(light);
    ImageOptions image;
    image.settings.width = image.settings.height = 4;
    const auto picture = light.picture(image);
    ASSERT_TRUE(picture) << picture.error().text;
    EXPECT_EQ(picture->pixels[5], Vec4f(0, 1, 0, 1));
}

TEST(Plugins, AddNothingToASceneThatUsesNothingOfThem) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("workshop"), extensions));
    const auto hashOf = [&](bool with) {
        Scene scene;
        if (with) extensions.registerWith(scene);
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nShape { geometry Box { } }", diagnostics));
        scene.newFrame(0);
        return std::pair(scene.hash(), scene.typeCount());
    };
    EXPECT_EQ(hashOf(true), hashOf(false));
}

/// A replica that has no plug-in knows the types from the stream, and saves what the origin would.
TEST(Plugins, TypesOfTablesReachReplicasThatLackThem) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("workshop"), extensions));
    Scene origin, replica;
    extensions.registerWith(origin);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(origin, "#X3D V4.0 utf8\nDEF S Spinner { turnsPerSecond 3 }", diagnostics));
    origin.newFrame(0.5);
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(origin.snapshot())));
    EXPECT_EQ(replica.hash(), origin.hash());
    const auto text = [](const Scene& scene) {
        std::string result;
        Diagnostics problems;
        const auto writer = makeWriter(Encoding::xml, [&](std::string_view piece) { result += piece; }, problems);
        SceneExporter(scene, problems).write(*writer);
        return result + complaints(problems);
    };
    EXPECT_EQ(text(replica), text(origin));
    Diagnostics more;
    ASSERT_TRUE(loadText(replica, "#X3D V4.0 utf8\nSpinner { turnsPerSecond 4 }", more));
    EXPECT_EQ(complaints(more), "") << "a file may use the types that a scene has";
}

// ---- field types ---------------------------------------------------------------------------------------------------

/// The registry is the process's own: other tests, and programs without the type, begin with an empty one.
class FieldTypes : public testing::Test {
  protected:
    FieldTypes() : before_(fieldTypeRegistry()) { restoreFieldTypes(none_); }
    ~FieldTypes() override { restoreFieldTypes(before_); }
    static void forget() { restoreFieldTypes(none_); }

    static std::string text(const Scene& scene, Encoding encoding) {
        std::string result;
        Diagnostics problems;
        const auto writer = makeWriter(encoding, [&](std::string_view piece) { result += piece; }, problems);
        SceneExporter(scene, problems).write(*writer);
        return result + complaints(problems);
    }
    static std::string valueAt(const Scene& scene, std::string_view path) {
        const auto value = fieldText(scene, path);
        return value ? *value : value.error().text;
    }

  private:
    inline static const std::shared_ptr<const FieldTypeRegistry> none_ = fieldTypeRegistry();
    std::shared_ptr<const FieldTypeRegistry> before_;
};

constexpr std::string_view kCrates =
    "#X3D V4.0 utf8\n"
    "PROTO Pallet [ inputOutput SFQuantity load \"2 kg\" initializeOnly MFQuantity all [ \"1 m\" 2.5 2 ] ] {\n"
    "  Crate { weight IS load contents IS all } }\n"
    "DEF A Crate { weight \"3.5 kg\" contents [ \"1 kg\", 2 3 ] }\n"
    "DEF B Crate { }\n"
    "DEF P Pallet { load 7 2 }\n"
    "DEF D Pallet { }\n"
    "DEF S Script { inputOnly SFQuantity given field SFQuantity kept \"5 s\" outputOnly MFQuantity out\n"
    "  url \"ecmascript: function given(v) { kept = [v[0] * 2, v[1]]; out = new Array(v, kept); }\" }\n"
    "ROUTE A.weight TO B.weight\nROUTE A.weight TO S.given\nROUTE S.out TO B.contents\n";

TEST_F(FieldTypes, GoThroughDocumentsOfEveryEncoding) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("workshop"), extensions));
    Scene scene;
    extensions.registerWith(scene);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kCrates, diagnostics));
    EXPECT_EQ(complaints(diagnostics), "");
    EXPECT_EQ(valueAt(scene, "A.weight"), "\"3.5 kg\"");
    EXPECT_EQ(valueAt(scene, "A.contents"), "[\"1 kg\", \"2 s\"]");
    EXPECT_EQ(valueAt(scene, "B.weight"), "\"1 kg\"") << "the table's";
    EXPECT_EQ(valueAt(scene, "P.load"), "\"7 kg\"");
    EXPECT_EQ(valueAt(scene, "D.all"), "[\"1 m\", \"2.5 kg\"]");
    EXPECT_EQ(valueAt(scene, "S.kept"), "\"5 s\"");
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
        const std::string written = text(scene, encoding);
        Scene again;
        extensions.registerWith(again);
        Diagnostics problems;
        ASSERT_TRUE(loadText(again, written, problems)) << written;
        EXPECT_EQ(complaints(problems), "") << written;
        EXPECT_EQ(text(again, Encoding::classicVrml), text(scene, Encoding::classicVrml)) << written;
    }
    EXPECT_NE(text(scene, Encoding::xml).find("weight='3.5 kg'"), std::string::npos) << text(scene, Encoding::xml);
}

TEST_F(FieldTypes, AreRoutedAndPassedToReplicasThatLackThem) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("workshop"), extensions));
    Scene origin, replica;
    extensions.registerWith(origin);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(origin, kCrates, diagnostics));
    ASSERT_TRUE(sendFieldText(origin, "A.weight", "\"9 m\""));
    origin.newFrame(0.5);
    EXPECT_EQ(valueAt(origin, "B.weight"), "\"9 m\"");
    const std::string named = text(origin, Encoding::classicVrml);
    forget();
    const std::string plain = text(origin, Encoding::classicVrml);
    EXPECT_NE(plain, named);
    EXPECT_NE(plain.find("weight 9 1"), std::string::npos) << plain;
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(origin.snapshot())));
    EXPECT_EQ(replica.hash(), origin.hash());
    EXPECT_EQ(text(replica, Encoding::classicVrml), plain) << "its prototypes name a type that only the stream has";
    EXPECT_EQ(valueAt(replica, "A.weight"), "9 1");
    registerDocuments(replica);
    const auto another = replica.createNode("Pallet");
    ASSERT_TRUE(another) << another.error().text;
    ASSERT_TRUE(loadPlugin(plugin("workshop"), extensions));
    EXPECT_EQ(valueAt(replica, "A.weight"), "\"9 m\"") << "once it has the type, it has the text";
}

TEST_F(FieldTypes, OfTablesHaveNumbersAndBytesAndNoFunctions) {
    Extensions extensions;
    Diagnostics diagnostics("t.x3dspec");
    ASSERT_TRUE(
        readNodeTable("component Own\nfieldType SFTag bytes 0\nfieldType SFBasis float32 3\n"
                      "node Thing : X3DChildNode level 1 container children @acts(never)\n"
                      "    SFTag [in,out] tag 1 255 @none\n    MFBasis [in,out] axes [1 0 0, 0 1 0] @none\n"
                      "    SFBasis [in] turned @none\n",
                      extensions, diagnostics))
        << complaints(diagnostics);
    Scene scene;
    extensions.registerWith(scene);
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene, "#X3D V4.0 utf8\nDEF A Thing { }\nDEF B Thing { tag 0xAb axes [ 1 2 3 ] }", problems));
    EXPECT_EQ(complaints(problems), "");
    EXPECT_EQ(valueAt(scene, "A.tag"), "0x01ff");
    EXPECT_EQ(valueAt(scene, "A.axes"), "[1 0 0, 0 1 0]");
    EXPECT_EQ(valueAt(scene, "B.tag"), "0xab");
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
        Scene again;
        extensions.registerWith(again);
        ASSERT_TRUE(loadText(again, text(scene, encoding), problems)) << text(scene, encoding);
        EXPECT_EQ(complaints(problems), "") << text(scene, encoding);
        EXPECT_EQ(text(again, Encoding::classicVrml), text(scene, Encoding::classicVrml));
    }
}

TEST_F(FieldTypes, FaultsAreNamedAndNothingOfThemStays) {
    const auto reported = [](std::string_view lines) {
        Extensions extensions;
        Diagnostics diagnostics("t.x3dspec");
        EXPECT_FALSE(readNodeTable("component Own\n" + std::string(lines), extensions, diagnostics));
        return complaints(diagnostics);
    };
    for (const char* line : {"fieldType SFVec3f float32 3", "fieldType Quantity float64 1", "fieldType MFA float64 1",
                             "fieldType SFA", "fieldType SFA double 1", "fieldType SFA float64 0",
                             "fieldType SFA float64 1025", "fieldType SFA int32 x", "fieldType SFCustom int32 1"})
        EXPECT_NE(reported(line).find("t.x3dspec:2: error: "), std::string::npos) << line;
    const std::string head = "fieldType SFA int32 2\nnode N : X3DChildNode level 1 container children\n";
    EXPECT_NE(reported(head + "    SFA [in,out] a 1 @none").find("SFA takes 2"), std::string::npos);
    EXPECT_NE(reported(head + "    SFA [in,out] a 1 .5 @none").find("'.5' is no value of SFA"), std::string::npos);
    EXPECT_NE(reported(head + "    SFA [in,out] a 1 2 [0,1] @none").find("no range"), std::string::npos);
    EXPECT_NE(reported(head + "    SFA [in,out] a 1 2 @none @unit(length)").find("have no unit"), std::string::npos);
    EXPECT_NE(
        reported("fieldType SFA int32 2\nfieldType SFA int32 3").find("t.x3dspec:3: error: there is a field type"),
        std::string::npos);
    EXPECT_EQ(findFieldType("SFA"), nullptr);
    ASSERT_TRUE(registerFieldType("SFA", {CustomLayout::Of::float64, 2}));
    EXPECT_NE(reported("fieldType SFB int32 1\nfieldType SFA int32 2").find("another layout"), std::string::npos);
    EXPECT_EQ(findFieldType("SFB"), nullptr) << "a table that fails leaves none";
    Extensions extensions;
    EXPECT_FALSE(loadPlugin(plugin("odd_throws"), extensions));
    EXPECT_EQ(findFieldType("SFUnpaid"), nullptr) << "so does a plug-in";
    Scene scene;
    Diagnostics problems("f");
    (void)loadText(
        scene,
        "#X3D V4.0 utf8\nPROTO P [ initializeOnly SFA a 1 2 initializeOnly SFNone n 3 initializeOnly SFA b x "
        "] { Group { } }",
        problems);
    EXPECT_NE(complaints(problems).find("'SFNone' is no field type"), std::string::npos) << complaints(problems);
    EXPECT_NE(complaints(problems).find("expected 2 numbers (SFA), found 'x'"), std::string::npos);
}

TEST(Plugins, ThatCannotBeLoadedAreNamedWithTheReason) {
    const TempFolder folder;
    EXPECT_EQ(whyNot(folder / "none.so"),
              folder / "none.so" + std::string(": error: it cannot be loaded: No such file or directory [plug-in]"));
    const std::string ours = RTSG_PLUGIN_HEADERS;
    write(folder / "text.so", "this is no library");
    EXPECT_EQ(whyNot(folder / "text.so"),
              folder / "text.so" +
                  std::string(": error: it is no plug-in, or an old one: it does "
                              "not say that it was compiled with the headers of this program (") +
                  ours + ") [plug-in]");
    write(folder / "cut.so", std::string("\x7f"
                                         "ELF\x02\x01\x01") +
                                 RTSG_PLUGIN_INTERFACE);
    EXPECT_NE(whyNot(folder / "cut.so").find("cut.so: error: it cannot be loaded: "), std::string::npos);
    write(folder / "wild.so", "RTSG plug-in interface 9.9\x1b[2J");
    EXPECT_NE(whyNot(folder / "wild.so").find("with other headers (9.9) than"), std::string::npos);
    ASSERT_EQ(::mkfifo((folder / "pipe.so").c_str(), 0600), 0);
    EXPECT_NE(whyNot(folder / "pipe.so").find("it is no regular file"), std::string::npos);
    EXPECT_NE(whyNot(folder / "").find("it cannot be loaded: "), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_function")).find("it is no plug-in: it has no function rtsg_plugin"),
              std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_headers"))
                  .find("odd_headers.so: error: it was compiled with other headers (0.2-0123456789ab) than this "
                        "program (" +
                        ours + "): compile it again [plug-in]"),
              std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_library")).find("(" + ours + ", _GLIBCXX_DEBUG) than this program (" + ours + ")"),
              std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_says")).find("it is no plug-in, or an old one"), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_nothing")).find("its rtsg_plugin returns nothing"), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_symbol")).find("whatNobodyHas"), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_incomplete")).find("the reader of 'empty' files lacks a function"), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_unfinished")).find("the node type Half is not finished"), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_throws")).find("odd_throws.so: error: it failed: no licence"), std::string::npos);
    EXPECT_NE(whyNot(plugin("odd_error")).find("there is a node type Box already, a built-in one"), std::string::npos);
}

TEST(Plugins, AreLoadedByTheirFileAndNotByAName) {
    Extensions extensions;
    const Result<> loaded = loadPlugin("workshop.so", extensions);  // which LD_LIBRARY_PATH might find
    ASSERT_FALSE(loaded);
    EXPECT_NE(loaded.error().text.find("No such file"), std::string::npos);
}

TEST(Plugins, ReadersOfNonsenseAreReportedAndTheRestIsKept) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("odd_reader"), extensions));
    Scene scene;
    extensions.registerWith(scene);
    Diagnostics diagnostics("file");
    EXPECT_FALSE(loadText(scene, "nonsense throw", diagnostics) && diagnostics.errors() == 0);
    const std::string said = complaints(diagnostics);
    for (const char* part :
         {"ends a node that it has not begun", "sets a field of no node", "gives 'a\tname' as a name",
          "gives field 'radius' of Sphere a value of type SFVec3f; it is of type SFFloat",
          "sets 'size', which is no field", "ends a prototype that it has not begun", "ends its document within a node",
          "goes on behind the end", "1 numbers of the nonsense file are not finite",
          "the reader of nonsense files failed: out of ideas"})
        EXPECT_NE(said.find(part), std::string::npos) << part << "\n" << said;
    EXPECT_TRUE(scene.findName("KEPT"));
    EXPECT_EQ(scene.nodeCount(), 3u) << "the root, the shape and the sphere";
}

TEST(Plugins, AReaderThatCannotSayWhatItReadsReadsNothing) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("odd_reader"), extensions));
    Scene scene;
    extensions.registerWith(scene);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, "#X3D V4.0 utf8\nGroup { }", diagnostics));
    EXPECT_EQ(complaints(diagnostics), "");
}

TEST(Plugins, AWriterThatThrowsMakesNoFile) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("odd_reader"), extensions));
    const TempFolder folder;
    Diagnostics diagnostics;
    auto writer = DocumentFileWriter::create(folder / "out.tired", diagnostics, Existing::replace,
                                             Encoding::classicVrml, extensions.dialect());
    ASSERT_TRUE(writer) << writer.error().text;
    ASSERT_TRUE(readDocument("#X3D V4.0 utf8\nGroup { }", (*writer)->handler(), diagnostics));
    const Result<> closed = (*writer)->close();
    ASSERT_FALSE(closed);
    EXPECT_EQ(closed.error().text, "the writer of tired files failed: too many nodes");
    writer->reset();
    EXPECT_FALSE(std::filesystem::exists(folder / "out.tired"));
}

TEST(Plugins, ASubscriberThatCannotBeMadeIsNamed) {
    Extensions extensions;
    ASSERT_TRUE(loadPlugin(plugin("odd_reader"), extensions));
    Scene scene;
    Extensions::Attached attached;
    const Result<> done = extensions.attachSubscribers(scene, attached);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().text, "a subscriber of a plug-in cannot be made: busy");
    EXPECT_EQ(attached.count(), 0u);
}

// ---- node tables ---------------------------------------------------------------------------------------------------

std::string tableErrors(std::string_view text) {
    Extensions extensions;
    Diagnostics diagnostics("t.x3dspec");
    EXPECT_FALSE(readNodeTable(text, extensions, diagnostics));
    EXPECT_EQ(extensions.dialect(), nullptr);
    return complaints(diagnostics);
}

constexpr std::string_view kPendulum =
    "component Workshop\nnode Pendulum : X3DChildNode level 1 container children @acts(always)\n"
    "    SFFloat [in,out] amplitude 0.5 [0,pi] @none\n    SFRotation [out] rotation_changed @transform\n";

TEST(NodeTables, AreKnownToFilesOfEveryEncoding) {
    Extensions extensions;
    Diagnostics diagnostics("t.x3dspec");
    ASSERT_TRUE(readNodeTable(kPendulum, extensions, diagnostics)) << complaints(diagnostics);
    for (
        const char* text :
        {"#X3D V4.0 utf8\nGroup { children DEF P Pendulum { amplitude .25 metadata MetadataString { } } }",
         "<X3D version='4.0'><Scene><Group><Pendulum DEF='P' "
         "amplitude='.25'><MetadataString/></Pendulum></Group></Scene></"
         "X3D>",
         R"({"X3D":{"@version":"4.0","Scene":{"-children":[{"Group":{"-children":[{"Pendulum":{"@DEF":"P","@amplitude":0.25,
             "-metadata":{"MetadataString":{}}}}]}}]}}})"}) {
        Scene scene;
        extensions.registerWith(scene);
        Diagnostics problems;
        ASSERT_TRUE(loadText(scene, text, problems));
        EXPECT_EQ(complaints(problems), "") << text;
        const Node* node = scene.find(scene.findName("P"));
        ASSERT_NE(node, nullptr) << text;
        EXPECT_EQ(node->type().component, "Workshop");
        EXPECT_EQ(*static_cast<const float*>(node->storage(node->type().find("amplitude"))), 0.25f);
        EXPECT_TRUE(node->type().isA("X3DNode"));
        EXPECT_EQ(scene.nodeCount(), 4u);
    }
}

TEST(NodeTables, AreCheckedWithPositions) {
    EXPECT_EQ(tableErrors("component Own\nnode Box : X3DGeometryNode level 1 container geometry\n")
                  .find("t.x3dspec:2: error: "
                        "'Box' is already"),
              0u);
    EXPECT_NE(tableErrors("component Own\nnode A : Nobody level 1 container children\n").find("t.x3dspec:2: error: "),
              std::string::npos);
    EXPECT_NE(
        tableErrors("component Own\nnode A : B level 1 container children\nnode B : A level 1 container children\n")
            .find("inherits from itself"),
        std::string::npos);
    EXPECT_NE(tableErrors("component Own\nnode A : X3DNode level 300 container children\n").find("at most 255"),
              std::string::npos);
    EXPECT_NE(tableErrors(std::string(2 << 20, '#')).find("more than"), std::string::npos);
    std::string chain = "component Own\nnode N0 : X3DNode level 1 container children\n";
    for (int i = 1; i < 1100; ++i)
        chain += "node N" + std::to_string(i) + " : N" + std::to_string(i - 1) + " level 1 container children\n";
    EXPECT_NE(tableErrors(chain).find("at most 1000 types"), std::string::npos);
    EXPECT_NE(tableErrors("component Own\nextend Box\n    SFFloat [in,out] extra 1 @none\n").find("cannot be extended"),
              std::string::npos);
}

TEST(NodeTables, ThatAreNoFilesAreErrors) {
    const TempFolder folder;
    for (const std::string& file : {folder / "none.x3dspec", folder / ""}) {
        Extensions extensions;
        Diagnostics diagnostics;
        EXPECT_FALSE(loadNodeTable(file, extensions, diagnostics));
        EXPECT_NE(complaints(diagnostics).find(file + ": error: cannot read it: "), std::string::npos)
            << complaints(diagnostics);
    }
}

TEST(NodeTables, OfOneTypeMayBeGivenTwiceIfTheyAgree) {
    Extensions extensions;
    Diagnostics diagnostics("t.x3dspec");
    ASSERT_TRUE(readNodeTable(kPendulum, extensions, diagnostics));
    EXPECT_TRUE(readNodeTable(kPendulum, extensions, diagnostics));
    std::string other(kPendulum);
    other.replace(other.find("0.5"), 3, "0.4");
    EXPECT_FALSE(readNodeTable(other, extensions, diagnostics));
    EXPECT_NE(complaints(diagnostics).find("there is a node type Pendulum already, which is another one"),
              std::string::npos);
}

/// An EXTERNPROTO of a node that a table has stands for that node; elsewhere it is a prototype.
TEST(NodeTables, TakeThePlaceOfExternProtosOfTheirNames) {
    Extensions extensions;
    Diagnostics diagnostics("t.x3dspec");
    ASSERT_TRUE(readNodeTable(kPendulum, extensions, diagnostics));
    for (const char* text :
         {"#X3D V4.0 utf8\nEXTERNPROTO Pendulum [ inputOutput SFFloat amplitude ] \"none.x3dv#Pendulum\"\n"
          "DEF P Pendulum { amplitude .25 }",
          "<X3D version='4.0'><Scene><ExternProtoDeclare name='Pendulum' url='\"none.x3d#Pendulum\"'><field "
          "name='amplitude' "
          "type='SFFloat' accessType='inputOutput'/></ExternProtoDeclare><ProtoInstance name='Pendulum' "
          "DEF='P'><fieldValue "
          "name='amplitude' value='.25'/></ProtoInstance></Scene></X3D>"}) {
        Scene scene;
        extensions.registerWith(scene);
        Diagnostics problems;
        ASSERT_TRUE(loadText(scene, text, problems));
        EXPECT_EQ(complaints(problems), "") << text;
        const Node* node = scene.find(scene.findName("P"));
        ASSERT_NE(node, nullptr);
        EXPECT_EQ(node->type().kind, NodeType::Kind::user);
        EXPECT_EQ(*static_cast<const float*>(node->storage(node->type().find("amplitude"))), 0.25f);
    }
    Scene scene;
    extensions.registerWith(scene);
    Diagnostics problems;
    (void)loadText(scene, "#X3D V4.0 utf8\nPROTO Pendulum [ ] { Group { } }\nDEF P Pendulum { }", problems);
    EXPECT_NE(complaints(problems).find("PROTO Pendulum has the name of a built-in node"), std::string::npos);
}

}  // namespace
}  // namespace rtsg::test
