// Pieces of documents beside a world, other worlds in its place, and fields by name.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/listeners.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>
#include <rtsg/scripts/run_scripts.h>

namespace rtsg {
namespace {

class WorldTest : public testing::Test {
  protected:
    WorldTest() : folder_(std::filesystem::temp_directory_path() / ("rtsg_world_" + std::to_string(::getpid()))) {
        std::filesystem::create_directories(folder_);
    }
    ~WorldTest() override { std::filesystem::remove_all(folder_); }
    std::filesystem::path file(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << "#X3D V4.0 utf8\nPROFILE Interchange\n" << text;
        return folder_ / name;
    }
    void load(const std::string& text) {
        ASSERT_TRUE(loadWorld(scene_, file("start.x3dv", text), diagnostics_));
        expectQuiet();
        scene_.newFrame(0);
    }
    void expectQuiet() {
        for (const Diagnostic& d : diagnostics_.all()) ADD_FAILURE() << d.format();
        diagnostics_ = Diagnostics();
    }
    Fragment piece(const std::string& text) {
        auto created = createX3DFromString(scene_, text, diagnostics_);
        EXPECT_TRUE(created);
        return created.value_or(Fragment{});
    }

    std::filesystem::path folder_;
    Scene scene_;
    Diagnostics diagnostics_;
};

TEST_F(WorldTest, APieceHangsNowhereAndLeavesNamesWhereTheyAre) {
    load("DEF A Transform { translation 1 0 0 }");
    const NodeId before = scene_.findName("A");
    const Fragment created = piece(R"(DEF A Transform { children DEF B PointLight { } } DEF C Group { children USE B }
                                   DEF T TimeSensor { } ROUTE T.isActive TO B.on)");
    expectQuiet();
    ASSERT_EQ(created.roots.size(), 3U);
    EXPECT_EQ(scene_.findName("A"), before);
    EXPECT_NE(created.find("A"), before);
    EXPECT_EQ(created.find("A"), created.roots[0]);
    EXPECT_EQ(scene_.findName("B"), created.find("B"));
    EXPECT_FALSE(created.find("Z"));
    EXPECT_EQ(scene_.routesTo(created.find("B")).size(), 1U);
    EXPECT_EQ(scene_.parents(created.roots[0]).size(), 0U);
    EXPECT_EQ(scene_.node(scene_.root()).get(x3d::RtsgScene::children).size(), 1U);
    // A name of the piece that is given twice is the later one's, as in any document.
    const Fragment twice = piece("DEF N PointLight { } DEF N SpotLight { }");
    EXPECT_EQ(diagnostics_.warnings(), 1U);
    EXPECT_EQ(scene_.findName("N"), twice.roots[1]);
    EXPECT_EQ(twice.find("N"), twice.roots[1]);
}

TEST_F(WorldTest, APieceOfABadTextSaysWhereAndTheRestIsThere) {
    load("Group { }");
    const std::size_t nodes = scene_.nodeCount();
    EXPECT_FALSE(createX3DFromString(scene_, "", diagnostics_));
    EXPECT_EQ(scene_.nodeCount(), nodes);
    diagnostics_ = Diagnostics();
    const auto created = createX3DFromString(scene_, "Group { }\nTransform { translation 1 two 3 }", diagnostics_);
    ASSERT_TRUE(created);
    EXPECT_EQ(created->roots.size(), 2U);
    ASSERT_GE(diagnostics_.errors(), 1U);
    EXPECT_EQ(diagnostics_.all()[0].where.line, 2U);
    diagnostics_ = Diagnostics();
    ASSERT_TRUE(createX3DFromString(scene_, "DEF L Group { } EXPORT L AS M", diagnostics_));
    ASSERT_EQ(diagnostics_.errors(), 1U);
    EXPECT_NE(diagnostics_.all()[0].text.find("EXPORT"), std::string::npos);
    EXPECT_TRUE(documentInfo(scene_).exports.empty());
}

TEST_F(WorldTest, PiecesComeFromXmlStreamsAndFiles) {
    load("Group { }");
    std::istringstream xml(R"(<X3D profile="Core" version="4.0"><Scene><PointLight DEF="L"/></Scene></X3D>)");
    const auto fromStream = createX3DFromStream(scene_, xml, diagnostics_);
    ASSERT_TRUE(fromStream);
    EXPECT_EQ(fromStream->head.profile, "Core");
    EXPECT_TRUE(scene_.node(fromStream->find("L")).is(x3d::PointLight::type));
    diagnostics_ = Diagnostics();  // PointLight is beyond profile Core
    const auto fromFile = createX3DFromFile(scene_, file("piece.x3dv", "DEF F Group { }"), diagnostics_);
    ASSERT_TRUE(fromFile);
    EXPECT_EQ(fromFile->head.profile, "Interchange");
    EXPECT_EQ(documentInfo(scene_).profile, "Interchange");
    EXPECT_FALSE(createX3DFromFile(scene_, folder_ / "none.x3dv", diagnostics_));
    EXPECT_EQ(diagnostics_.errors(), 1U);
}

TEST_F(WorldTest, AnotherWorldIsOneSetAndSubscribersFollow) {
    load("META \"old\" \"1\"\nDEF A Transform { children DEF V Viewpoint { position 1 2 3 } }");
    Scene replica;
    replica.setBehavioursEnabled(false);
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene_.snapshot())));
    Listeners listeners(scene_), there(replica);
    int worlds = 0, worldsThere = 0;
    listeners.onWorld([&] { ++worlds; });
    there.onWorld([&] { ++worldsThere; });
    const NodeId old = scene_.findName("V");
    ASSERT_TRUE(
        loadWorld(scene_, file("next.x3dv", "META \"new\" \"2\"\nDEF A Group { } DEF W Viewpoint { }"), diagnostics_));
    expectQuiet();
    ASSERT_TRUE(replica.apply(scene_.newFrame(1)));
    EXPECT_EQ(worlds, 1);
    EXPECT_EQ(worldsThere, 1);
    EXPECT_EQ(replica.hash(), scene_.hash());
    EXPECT_EQ(replica.dump(), scene_.dump());
    EXPECT_FALSE(scene_.find(old));
    EXPECT_TRUE(scene_.node(scene_.findName("A")).is(x3d::Group::type));
    EXPECT_TRUE(scene_.node(scene_.findName("W")).get(x3d::Viewpoint::isBound));
    const DocumentInfo info = documentInfo(scene_);
    ASSERT_EQ(info.meta.size(), 1U);
    EXPECT_EQ(info.meta[0].name, "new");
    // The same as if it had been the first, but for the count of worlds.
    Scene fresh;
    Diagnostics quiet;
    ASSERT_TRUE(loadWorld(fresh, folder_ / "next.x3dv", quiet));
    EXPECT_EQ(fresh.nodeCount(), scene_.nodeCount());
}

TEST_F(WorldTest, AWorldThatInlinesItselfEnds) {
    ASSERT_TRUE(loadWorld(scene_, file("self.x3dv", "DEF I Inline { url \"self.x3dv\" }"), diagnostics_));
    ASSERT_EQ(diagnostics_.all().size(), 1U);
    EXPECT_NE(diagnostics_.all()[0].text.find("contain itself"), std::string::npos) << diagnostics_.all()[0].text;
    EXPECT_EQ(scene_.nodeCount(), 2U);
}

TEST_F(WorldTest, AWorldThatCannotBeReadLeavesTheOldOne) {
    load("DEF A Transform { }");
    const std::string before = scene_.dump();
    EXPECT_FALSE(loadWorld(scene_, folder_ / "none.x3dv", diagnostics_));
    std::ofstream(folder_ / "words.x3dv") << "no scene at all";
    EXPECT_FALSE(loadWorld(scene_, folder_ / "words.x3dv", diagnostics_));
    EXPECT_EQ(scene_.dump(), before);
    EXPECT_GE(diagnostics_.errors(), 2U);
}

TEST_F(WorldTest, APieceAsTheWorldKeepsWhatIsHeldAndItsOwnNames) {
    load("DEF A Transform { } DEF K Group { } DEF X Group { }");
    const NodeId kept = scene_.findName("K");
    scene_.hold(kept);
    const Fragment created = piece("DEF A PointLight { } Group { children DEF B Group { } }");
    ASSERT_TRUE(replaceWorld(scene_, created));
    scene_.newFrame(1);
    EXPECT_EQ(scene_.findName("A"), created.roots[0]);
    EXPECT_TRUE(scene_.find(kept));
    EXPECT_FALSE(scene_.findName("X"));
    const auto& roots = scene_.node(scene_.root()).get(x3d::RtsgScene::children);
    ASSERT_EQ(roots.size(), 2U);
    EXPECT_EQ(roots[0], created.roots[0]);
    EXPECT_EQ(documentInfo(scene_).profile, "");
    // Nodes of a piece that has gone since.
    ASSERT_TRUE(scene_.destroyNode(created.roots[0]));
    EXPECT_EQ(replaceWorld(scene_, created).error().code.text(), "no-such-node");
    EXPECT_EQ(scene_.node(scene_.root()).get(x3d::RtsgScene::children).size(), 1U);
}

TEST_F(WorldTest, NoWorldComesWithinAFrame) {
    load("DEF T TimeTrigger { }");
    std::string code;
    bool loaded = true;
    scene_.setEventListener([&](double, const Node&, FieldIndex, const Value&) {
        code = replaceWorld(scene_, {}).error().code.text();
        loaded = loadWorld(scene_, folder_ / "start.x3dv", diagnostics_);
    });
    ASSERT_TRUE(scene_.sendEvent(scene_.findName("T"), x3d::TimeTrigger::set_boolean.index, true));
    scene_.newFrame(1);
    EXPECT_EQ(code, "from-within");
    EXPECT_FALSE(loaded);
    EXPECT_TRUE(scene_.findName("T"));
}

TEST_F(WorldTest, NoWorldComesFromAnotherThread) {
    load("DEF T TimeTrigger { }");
    std::string code;
    bool loaded = true;
    std::thread([&] {
        code = replaceWorld(scene_, {}).error().code.text();
        loaded = loadWorld(scene_, folder_ / "start.x3dv", diagnostics_);
    }).join();
    EXPECT_EQ(code, "wrong-thread");
    EXPECT_FALSE(loaded);
    EXPECT_EQ(diagnostics_.errors(), 1U);
    EXPECT_TRUE(scene_.findName("T"));
}

TEST_F(WorldTest, ScriptsOfTheNextWorldReadFilesBesideIt) {
    std::filesystem::create_directories(folder_ / "one");
    std::filesystem::create_directories(folder_ / "two");
    for (const char* name : {"one", "two"}) {
        std::ofstream(folder_ / name / "world.x3dv")
            << "#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { outputOnly SFString said url \"say.js\" }";
        std::ofstream(folder_ / name / "say.js") << "function initialize() { said = '" << name << "'; }";
    }
    Scene scene;
    runScripts(scene);
    for (const char* name : {"one", "two"}) {
        Diagnostics diagnostics;
        ASSERT_TRUE(loadWorld(scene, folder_ / name / "world.x3dv", diagnostics));
        scene.newFrame(0);
        for (const Diagnostic& d : scene.diagnostics().all()) ADD_FAILURE() << d.format();
        EXPECT_EQ(fieldText(scene, "S.said").value_or("none"), '"' + std::string(name) + '"');
    }
}

TEST_F(WorldTest, AWorldIsSavedAsItsNameSays) {
    load("DEF A Transform { translation 1 2 3 }");
    for (const char* name : {"a.x3d", "a.x3dv", "a.json", "a.wrl"}) {
        Diagnostics diagnostics;
        ASSERT_TRUE(saveWorld(scene_, folder_ / name, diagnostics)) << name;
        Scene again;
        ASSERT_TRUE(loadWorld(again, folder_ / name, diagnostics)) << name;
        EXPECT_EQ(fieldText(again, "A.translation").value_or("none"), "1 2 3") << name;
        EXPECT_FALSE(saveWorld(scene_, folder_ / name, diagnostics)) << "it is there already";
        EXPECT_TRUE(saveWorld(scene_, folder_ / name, diagnostics, Existing::replace));
    }
    EXPECT_FALSE(saveWorld(scene_, folder_ / "a.txt", diagnostics_));
}

TEST_F(WorldTest, FieldsAreReadSetAndSentByName) {
    load(R"(PROTO P [ inputOutput SFFloat x 1 ] { DEF IN Transform { } } DEF I P { }
            DEF T Transform { children [ DEF A Group { } Group { } ] } DEF S Switch { })");
    EXPECT_EQ(fieldText(scene_, "T.scale").value_or("none"), "1 1 1");
    ASSERT_TRUE(setFieldText(scene_, "T.translation", " 1, 2 3 "));
    EXPECT_EQ(fieldText(scene_, "T.translation").value_or("none"), "1 2 3");
    ASSERT_TRUE(setFieldText(scene_, "I/IN.translation", "4 5 6"));
    EXPECT_EQ(fieldText(scene_, "I/IN.translation_changed").value_or("none"), "4 5 6");
    ASSERT_TRUE(sendFieldText(scene_, "S.set_whichChoice", "3"));
    EXPECT_EQ(fieldText(scene_, "S.whichChoice").value_or("none"), "-1");
    scene_.newFrame(1);
    EXPECT_EQ(fieldText(scene_, "S.whichChoice").value_or("none"), "3");
    const std::string nameless =
        "#" + std::to_string(scene_.node(scene_.findName("T")).get(x3d::Transform::children)[1].value);
    EXPECT_EQ(fieldText(scene_, "T.children").value_or("none"), "[ A " + nameless + " ]");
    ASSERT_TRUE(setFieldText(scene_, "S.children", "[ A, T ]"));
    EXPECT_EQ(fieldText(scene_, "S.children").value_or("none"), "[ A T ]");
    EXPECT_EQ(fieldText(scene_, "S.metadata").value_or("none"), "NULL");
    ASSERT_TRUE(setFieldText(scene_, "S.metadata", "NULL"));
}

TEST_F(WorldTest, WrongPathsAndTextsAreNamed) {
    load("DEF TABLE Transform { } DEF B TimeTrigger { }");
    const auto wrong = [&](const char* path, const char* text) {
        const auto ok = setFieldText(scene_, path, text);
        return ok ? std::string("taken") : ok.error().text;
    };
    EXPECT_EQ(wrong("TABEL.translation", "0 0 0"), "TABEL.translation: no node is named TABEL (did you mean TABLE?)");
    EXPECT_EQ(wrong("TABLE.translaton", "0 0 0"),
              "TABLE.translaton: Transform has no field 'translaton' (did you mean translation?)");
    EXPECT_EQ(wrong("TABLE", "0 0 0"), "TABLE: expected DEF.field");
    EXPECT_NE(wrong("TABLE.translation", "0 0").find("TABLE.translation: "), std::string::npos);
    EXPECT_NE(wrong("TABLE.children", "[ CHAIR ]").find("no node is named CHAIR"), std::string::npos);
    EXPECT_NE(wrong("TABLE.metadata", "TABLE B").find("one node's name"), std::string::npos);
    EXPECT_NE(wrong("TABLE/X.translation", "0 0 0").find("no node is named TABLE/X"), std::string::npos);
    EXPECT_FALSE(fieldText(scene_, "B.set_boolean"));
}

TEST_F(WorldTest, ProfilesComponentsAndWhatADocumentSays) {
    const auto profiles = supportedProfiles();
    const auto interchange = std::ranges::find(profiles, "Interchange", &Profile::name);
    ASSERT_NE(interchange, profiles.end());
    EXPECT_EQ(interchange->components.size(), 12U);
    const auto components = supportedComponents();
    const auto rendering = std::ranges::find(components, "Rendering", &DocumentHead::Component::name);
    ASSERT_NE(rendering, components.end());
    EXPECT_GE(rendering->level, 4);
    load(R"(COMPONENT Sound:2
UNIT length inch 0.0254
META "title" "hall"
PROTO P [ ] { Group { } }
EXTERNPROTO Q [ ] "none.x3dv"
DEF I Inline { } DEF P1 P { }
IMPORT I.X AS Y
EXPORT P1 AS OUT)");
    const DocumentInfo info = documentInfo(scene_);
    ASSERT_EQ(info.components.size(), 1U);
    EXPECT_EQ(info.components[0].name + std::to_string(info.components[0].level), "Sound2");
    ASSERT_EQ(info.units.size(), 1U);
    EXPECT_EQ(info.units[0].conversionFactor, .0254);
    ASSERT_EQ(info.imports.size(), 1U);
    EXPECT_EQ(info.imports[0].inlineName + info.imports[0].exportedName + info.imports[0].localName, "IXY");
    ASSERT_EQ(info.exports.size(), 1U);
    EXPECT_EQ(info.exports[0].localName + info.exports[0].exportedName, "P1OUT");
    EXPECT_EQ(info.prototypes, (std::vector<std::string>{"P"}));
    EXPECT_EQ(info.externPrototypes, (std::vector<std::string>{"Q"}));
}

/// The types of the world before stay known; the document is of those that it uses.
TEST_F(WorldTest, AWorldWithAnotherPrototypeOfTheSameNameIsSavedWithItsOwn) {
    load("PROTO P [ ] { Group { } } PROTO Q [ ] { P { } } P { }");
    ASSERT_TRUE(loadWorld(scene_, file("next.x3dv", "PROTO P [ ] { Switch { } } P { }"), diagnostics_));
    expectQuiet();
    EXPECT_EQ(documentInfo(scene_).prototypes, (std::vector<std::string>{"P", "Q"}));
    ASSERT_TRUE(saveWorld(scene_, folder_ / "saved.x3dv", diagnostics_));
    expectQuiet();
    Scene saved;
    ASSERT_TRUE(loadWorld(saved, folder_ / "saved.x3dv", diagnostics_));
    expectQuiet();
    EXPECT_TRUE(saved.effectiveNode(saved.node(saved.root()).get(x3d::RtsgScene::children)[0])->is(x3d::Switch::type));
}

}  // namespace
}  // namespace rtsg
