// Browser and its scenes as a Script has them: pieces from text and files, other worlds, what documents say of
// themselves.
#include <filesystem>
#include <fstream>
#include <utility>

#include <gtest/gtest.h>

#include <rtsg/documents/world.h>
#include <rtsg/scripts/run_scripts.h>

#include "script_scene.h"

namespace rtsg {
namespace {

using test::ScriptScene;

/// Runs the program's `initialize`, and gives what it printed, a line a call of print.
std::string printed(const std::string& body, const std::string& others = {}) {
    ScriptScene s("directOutput TRUE", "function initialize() { " + body + " }", others);
    s.frame();
    EXPECT_EQ(s.problems(), "");
    return s.printed;
}
/// The text of the diagnostics.
std::string refused(const std::string& body, const std::string& others = {}) {
    ScriptScene s("directOutput TRUE", "function initialize() { " + body + " }", others);
    s.frame();
    return s.problems();
}

TEST(ScriptBrowser, MakesNodesFromText) {
    ScriptScene s(
        "inputOnly SFBool go directOutput TRUE",
        "function go() { const nodes = Browser.createVrmlFromString('DEF N Transform { translation 1 2 3 } Group { }');"
        " print(nodes.length, nodes[0].translation, nodes[1].getNodeTypeName());"
        " Browser.currentScene.addRootNode(nodes[0]); print(Browser.currentScene.getNamedNode('N') === nodes[0]); }",
        "DEF G Group { }");
    s.frame();
    s.send("go", true);
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(s.printed, "2 1 2 3 Group\ntrue\n");
    EXPECT_EQ(s.scene.node(s.scene.root()).get(x3d::RtsgScene::children).size(), 3U);
    EXPECT_EQ(fieldText(s.scene, "N.translation").value_or("none"), "1 2 3");
}

TEST(ScriptBrowser, APieceHasNamesOfItsOwn) {
    EXPECT_EQ(
        printed(
            "const piece = Browser.createX3DFromString('DEF A PointLight { intensity 0.5 }');"
            " print(piece.rootNodes.length, piece.getNamedNode('A').intensity, piece.isScene);"
            " print(Browser.currentScene.getNamedNode('A').intensity);"
            " piece.updateNamedNode('B', piece.rootNodes[0]); print(piece.getNamedNode('B') === piece.rootNodes[0]);"
            " piece.removeNamedNode('B'); try { piece.getNamedNode('B'); } catch (e) { print(e.message); }"
            " piece.addRootNode(piece.createNode('Group')); print(piece.rootNodes.length);"
            " piece.removeRootNode(piece.rootNodes[0]); print(piece.rootNodes[0].getNodeTypeName());",
            "DEF A PointLight { intensity 0.25 }"),
        "1 0.5 true\n0.25\ntrue\nno node is named B\n2\nGroup\n");
}

TEST(ScriptBrowser, XmlIsReadAsWell) {
    EXPECT_EQ(printed("const text = '<X3D version=\\\\'4.0\\\\'><Scene><Transform DEF=\\\\'T\\\\' translation=\\\\'3 2 "
                      "1\\\\'/></Scene></X3D>';"
                      " print(Browser.createX3DFromString(text).getNamedNode('T').translation);"),
              "3 2 1\n");
}

TEST(ScriptBrowser, ABadTextIsAnErrorThatSaysWhere) {
    const std::string kept = refused("Browser.createX3DFromString('Grup { }');");
    EXPECT_NE(kept.find("unknown node type Grup"), std::string::npos) << kept;
    const std::string text = refused("Browser.createVrmlFromString('<X3D><Scene');");
    EXPECT_NE(text.find("line 1: Error: text:1:"), std::string::npos) << text;
}

class ScriptBrowserFiles : public testing::Test {
  protected:
    ScriptBrowserFiles()
        : folder_(std::filesystem::temp_directory_path() / ("rtsg_browser_" + std::to_string(::getpid()))) {
        std::filesystem::create_directories(folder_ / "below");
    }
    ~ScriptBrowserFiles() override { std::filesystem::remove_all(folder_); }
    void file(const std::string& name, const std::string& text) const {
        std::ofstream(folder_ / name) << "#X3D V4.0 utf8\nPROFILE Full\n" << text;
    }
    /// A world with one Script.
    void start(const std::string& program, const std::string& others = {}) {
        ScriptOptions options;
        options.print = [this](std::string_view text) { printed_ += text; };
        runScripts(scene_, options);
        file("start.x3dv",
             others + "DEF S Script { directOutput TRUE inputOnly SFBool go inputOnly MFNode come url \"ecmascript:" +
                 program + "\" }");
        Diagnostics diagnostics;
        ASSERT_TRUE(loadWorld(scene_, folder_ / "start.x3dv", diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        scene_.newFrame(0);
    }
    void go() {
        ASSERT_TRUE(sendFieldText(scene_, "S.go", "TRUE"));
        scene_.newFrame(scene_.now() + 1);
    }
    std::string problems() {
        std::string text;
        for (const Diagnostic& d : scene_.diagnostics().all()) text += d.text + '\n';
        return text;
    }

    std::filesystem::path folder_;
    std::string printed_;
    Scene scene_;
};

TEST_F(ScriptBrowserFiles, NodesFromAFileComeAsAnEventOfTheNextFrame) {
    file("below/part.x3dv", "DEF P Group { children Inline { url \"inner.x3dv\" } }");
    file("below/inner.x3dv", "DEF INNER Group { }");
    start(
        "function go() { Browser.createVrmlFromURL(['none.x3dv', 'below/part.x3dv'], S, 'come'); print('asked'); }"
        " function come(nodes) { print(nodes.length, nodes[0].children[0].getNodeTypeName(), "
        "Browser.currentScene.getNamedNode('S') === S); }"
        " const S = Browser.currentScene.getNamedNode('S');");
    go();
    EXPECT_EQ(printed_, "asked\n");
    scene_.newFrame(2);
    EXPECT_EQ(problems(), "");
    EXPECT_EQ(printed_, "asked\n1 Inline true\n");
    const Node& inline_ = scene_.node(scene_.node(scene_.findName("P")).get(x3d::Group::children)[0]);
    EXPECT_EQ(inline_.get(x3d::Inline::body).size(), 1U) << "its urls start from its own folder";
}

/// A data: url is no file: it is skipped, or reported as none.
TEST_F(ScriptBrowserFiles, OnlyFilesAreLoadedSoDataUrlsArePassedOver) {
    file("part.x3dv", "DEF P PointLight { intensity 0.5 }");
    start(
        "function go() { const data = 'data:model/x3d+vrml,%23X3D%20V4.0%20utf8';"
        " print(Browser.createX3DFromURL(new MFString(data, 'part.x3dv')).getNamedNode('P').intensity);"
        " try { print(Browser.createX3DFromURL(new MFString(data))); } catch (e) { print(e.message); } }");
    go();
    EXPECT_TRUE(printed_.starts_with("0.5\n")) << printed_;
    EXPECT_NE((printed_ + problems()).find("only files can be loaded"), std::string::npos) << printed_ << problems();
}

TEST_F(ScriptBrowserFiles, NodesFromAFileAtOnceWhereNobodyIsNamed) {
    file("part.x3dv", "DEF P PointLight { intensity 0.5 }");
    start("function go() { print(Browser.createX3DFromURL(new MFString('part.x3dv')).getNamedNode('P').intensity); }");
    go();
    EXPECT_EQ(printed_, "0.5\n");
}

TEST_F(ScriptBrowserFiles, WhatMayNotBeOpenedIsNotLoaded) {
    start(
        "function go() { Browser.loadURL(['/etc/hostname']); Browser.createVrmlFromURL(['/etc/hostname'], S, 'come');"
        " Browser.loadURL(['http://example.org/a.x3d']); Browser.createX3DFromURL(['/etc/hostname']); }"
        " function come() { print('come'); } const S = Browser.currentScene.getNamedNode('S');");
    go();
    scene_.newFrame(5);
    const std::string text = problems();
    EXPECT_EQ(printed_, "");
    EXPECT_NE(text.find("Error: '/etc/hostname' is outside"), std::string::npos) << text;
    std::size_t count = 0;
    for (auto at = text.find("asked for was not loaded"); at != text.npos;
         at = text.find("asked for was not loaded", at + 1))
        ++count;
    EXPECT_EQ(count, 3U) << text;
    EXPECT_TRUE(scene_.findName("S"));
}

TEST_F(ScriptBrowserFiles, AnotherWorldComesBetweenFramesAndTheOldOneShutsDown) {
    file("below/next.x3dv",
         "DEF V Viewpoint { } DEF W Viewpoint { } DEF T Script { outputOnly SFString said url \"say.js\" }");
    std::ofstream(folder_ / "below/say.js") << "function initialize() { said = 'next'; }";
    start(
        "function go() { Browser.loadURL(['below/next.x3dv#W']); "
        "print(Browser.currentScene.getNamedNode('S').getNodeName()); }"
        " function shutdown() { print('over'); }");
    go();
    EXPECT_EQ(printed_, "S\n");
    scene_.newFrame(2);
    EXPECT_EQ(printed_, "S\nover\n");
    EXPECT_EQ(problems(), "");
    EXPECT_FALSE(scene_.findName("S"));
    EXPECT_EQ(fieldText(scene_, "T.said").value_or("none"), "\"next\"");
    EXPECT_TRUE(scene_.node(scene_.findName("W")).get(x3d::Viewpoint::isBound));
}

TEST_F(ScriptBrowserFiles, AWorldMadeOfAPieceOrOfNodes) {
    start(
        "function go() { const piece = Browser.createX3DFromString('DEF S Group { } DEF N Group { children DEF M Group "
        "{ } }');"
        " Browser.replaceWorld(piece); }");
    go();
    scene_.newFrame(2);
    EXPECT_EQ(problems(), "");
    EXPECT_TRUE(scene_.node(scene_.findName("S")).is(x3d::Group::type));
    EXPECT_TRUE(scene_.findName("M"));
    EXPECT_EQ(scene_.nodeCount(), 4U);
    start("function go() { Browser.replaceWorld(Browser.createVrmlFromString('Group { } Transform { }')); }");
    go();
    scene_.newFrame(5);
    EXPECT_EQ(scene_.nodeCount(), 3U);
}

TEST_F(ScriptBrowserFiles, TheWorldInItsOwnPlaceStays) {
    start("function go() { Browser.replaceWorld(Browser.currentScene); print('on'); }", "DEF G Group { }\n");
    go();
    scene_.newFrame(2);
    EXPECT_EQ(problems(), "");
    EXPECT_TRUE(scene_.findName("G"));
    EXPECT_TRUE(scene_.findName("S"));
    EXPECT_EQ(printed_, "on\n");
}

TEST_F(ScriptBrowserFiles, WhatIsNoWorldTakesNoPlace) {
    for (const char* given : {"{}", "5", "true", "() => 1"}) {
        start("function go() { try { Browser.replaceWorld(" + std::string(given) +
              "); } catch (e) { print(e.message); } }");
        go();
        scene_.newFrame(scene_.now() + 1);
        EXPECT_EQ(std::exchange(printed_, ""), "replaceWorld takes a scene or nodes\n") << given;
        EXPECT_TRUE(scene_.findName("S")) << given;
    }
}

TEST_F(ScriptBrowserFiles, AReplicaGetsWhatScriptsLoad) {
    file("part.x3dv", "DEF P PointLight { intensity 0.5 }");
    file("next.x3dv", "DEF V Viewpoint { }");
    start(
        "function go() { Browser.createVrmlFromURL(['part.x3dv'], G, 'addChildren'); if (++count > 1) "
        "Browser.loadURL(['next.x3dv']); }"
        " let count = 0; const G = Browser.currentScene.getNamedNode('G');",
        "DEF G Group { } ");
    Scene replica;
    replica.setBehavioursEnabled(false);
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene_.snapshot())));
    for (int i = 0; i < 5; ++i) {
        if (scene_.findName("S")) {
            ASSERT_TRUE(sendFieldText(scene_, "S.go", "TRUE"));
        }
        ASSERT_TRUE(replica.apply(scene_.newFrame(i + 1.0)));
        EXPECT_EQ(replica.dump(), scene_.dump());
    }
    EXPECT_TRUE(replica.findName("V"));
}

TEST(ScriptBrowser, WhatAPieceBringsAndNobodyKeepsIsDestroyed) {
    ScriptScene s("inputOnly SFBool go directOutput TRUE",
                  "function go() { for (let i = 0; i < 300; ++i) Browser.createX3DFromString('Group { children [ Group "
                  "{ } Group { } ] }'); }");
    s.frame();
    for (int i = 0; i < 20; ++i) {
        s.send("go", true);
        s.frame();
    }
    EXPECT_LT(s.scene.nodeCount(), 5000U);
    EXPECT_EQ(s.problems(), "");
}

TEST(ScriptBrowser, PrototypesAreDeclaredMadeAndDescribed) {
    const char* proto = "PROTO Door [ inputOutput SFFloat width 1 inputOnly SFBool open ] { Transform { } }";
    EXPECT_EQ(
        printed("const door = Browser.currentScene.createProto('Door'); print(door.width, door.getNodeTypeName());"
                " const all = Browser.currentScene.protos; print(all.length, all[0].name, all[0].isExternProto);"
                " print(all[0].fields.map(f => f.name + f.dataType + f.accessType).join());"
                " print(Browser.currentScene.getProtoDeclaration('Door').newInstance().width);"
                " print(door.getNodeType()[0] === X3DConstants.X3DPrototypeInstance);"
                " try { Browser.currentScene.createProto('Group'); } catch (e) { print(e.name, e.message); }",
                proto),
        "1 Door\n1 Door false\nwidth43,open01,metadata123\n1\ntrue\nReferenceError no prototype is named Group\n");
}

TEST(ScriptBrowser, RoutesAreListedAndTakenBack) {
    EXPECT_EQ(printed("const scene = Browser.currentScene, T = scene.getNamedNode('T'), L = scene.getNamedNode('L');"
                      " print(scene.routes.length); const route = scene.addRoute(T, 'isActive', L, 'on'); "
                      "print(scene.routes.length);"
                      " const one = scene.routes[0]; print(one.sourceNode === T, one.sourceField, one.destinationNode "
                      "=== L, one.destinationField);"
                      " scene.deleteRoute(route); print(scene.routes.length);"
                      " scene.addRoute(T, 'isActive', L, 'set_on'); scene.deleteRoute(T, 'isActive', L, 'on'); "
                      "print(scene.routes.length);",
                      "DEF T TimeSensor { } DEF L PointLight { }"),
              "0\n1\ntrue isActive true on\n0\n0\n");
}

TEST(ScriptBrowser, NamesImportsAndExports) {
    EXPECT_EQ(
        printed(
            "const scene = Browser.currentScene, A = scene.getNamedNode('A');"
            " scene.updateNamedNode('B', A); print(scene.getNamedNode('B') === A);"
            " scene.updateExportedNode('OUT', A); print(scene.getExportedNode('OUT') === A);"
            " scene.removeExportedNode('OUT'); try { scene.getExportedNode('OUT'); } catch (e) { print(e.message); }"
            " scene.removeNamedNode('B'); try { scene.getNamedNode('B'); } catch (e) { print(e.message); }"
            " try { scene.updateExportedNode('X', A); } catch (e) { print(e.message); }"
            " try { scene.getImportedNode('X'); } catch (e) { print(e.message); }",
            "DEF A Group { }"),
        "true\ntrue\nnothing is exported as OUT\nno node is named B\n"
        "a node that has no name in the document cannot be exported\nnothing was imported as X\n");
}

TEST(ScriptBrowser, WhatTheDocumentSays) {
    EXPECT_EQ(
        printed(
            "const scene = Browser.currentScene; print(scene.profile.name, scene.specificationVersion, scene.isScene);"
            " print(scene.getMetaData('title'), scene.getMetaData('none')); scene.setMetaData('title', 'room');"
            " scene.setMetaData('more', 'yes'); print(scene.getMetaData('title'), scene.getMetaData('more'));"
            " print(scene.components.map(c => c.name + c.level).join(), scene.units[0].conversionFactor);",
            "COMPONENT Sound:2\nUNIT length inch 0.0254\nMETA \"title\" \"hall\"\n"),
        "Full 4.0 true\nhall undefined\nroom yes\nSound2 0.0254\n");
}

TEST(ScriptBrowser, WhatItKnows) {
    EXPECT_EQ(
        printed(
            "print(Browser.name === Browser.getName(), Browser.getVersion() === Browser.version, "
            "Browser.getCurrentSpeed());"
            " print(Browser.supportedProfiles.some(p => p.name === 'Interchange'), Browser.getProfile('Full').name);"
            " print(Browser.supportedComponents.find(c => c.name === 'Rendering').level >= 4, "
            "Browser.getComponent('Core', 1).level);"
            " try { Browser.getComponent('Core', 9); } catch (e) { print(e.message); }"
            " try { Browser.getProfile('Nonsense'); } catch (e) { print(e.message); }"
            " print(Browser.getBrowserProperty('PROTOTYPE_CREATE'), Browser.getBrowserProperty('toString'));"
            " try { Browser.importDocument({}); } catch (e) { print(e.message); }",
            "NavigationInfo { speed 3 }"),
        "true true 0\ntrue Full\ntrue 1\nno component Core of level 9\nno profile is named Nonsense\ntrue false\n"
        "there is no document object model here\n");
}

TEST(ScriptBrowser, TheSpeedIsThatOfTheBoundNavigation) {
    ScriptScene s("inputOnly SFBool go", "function go() { print(Browser.currentSpeed, Browser.getCurrentSpeed()); }",
                  "NavigationInfo { speed 3 }");
    s.frame();
    s.send("go", true);
    s.frame();
    EXPECT_EQ(s.printed, "3 3\n");
}

TEST(ScriptBrowser, NodesDescribeThemselves) {
    EXPECT_EQ(
        printed("const T = Browser.currentScene.getNamedNode('T');"
                " print(T.getNodeType().includes(X3DConstants.Transform), "
                "T.getNodeType().includes(X3DConstants.X3DGroupingNode));"
                " const f = T.getFieldDefinitions().find(f => f.name === 'translation');"
                " print(f.dataType === X3DConstants.SFVec3f, f.accessType === X3DConstants.inputOutput);"
                " print(T.toVRMLString()); print(T.toXMLString());",
                "DEF T Transform { translation 1 2 3 children DEF L PointLight { } }"),
        "true true\ntrue true\nDEF T Transform {\n  children [\n    DEF L PointLight {}\n  ]\n  translation 1 2 3\n}\n"
        "<Transform DEF='T' translation='1 2 3'>\n      <PointLight DEF='L'/>\n    </Transform>\n");
}

TEST(ScriptBrowser, NodesDocumentsAndValuesAreTextInEachEncoding) {
    const std::string text = printed(
        "const T = Browser.currentScene.getNamedNode('T'); const again = JSON.parse(T.toJSONString());"
        " print(again.Transform['@DEF'], again.Transform['@translation'].join(' '),"
        " again.Transform['-children'][0].PointLight['@DEF']);"
        " const all = JSON.parse(Browser.currentScene.toJSONString()); print(Object.keys(all), "
        "all.X3D.Scene['-children'].length);"
        " print(Browser.currentScene.toVRMLString().startsWith('#X3D V'), "
        "Browser.currentScene.toXMLString().includes('<X3D '));"
        " print(T.translation.toXMLString(), T.translation.toVRMLString(), T.translation.toJSONString());"
        " const list = new MFVec3f(new SFVec3f(1, 2, 3), new SFVec3f(4, 5, 6));"
        " print(list.toXMLString(), list.toVRMLString(), list.toJSONString());"
        " print(new MFString('a', 'b<').toXMLString(), new MFString('a').toJSONString());",
        "DEF T Transform { translation 1 2 3 children DEF L PointLight { } }");
    EXPECT_EQ(text,
              "T 1 2 3 L\nX3D 2\ntrue true\n1 2 3 1 2 3 [1,2,3]\n1 2 3, 4 5 6 [1 2 3, 4 5 6] [1,2,3, 4,5,6]\n"
              "\"a\", \"b&lt;\" [\"a\"]\n");
}

TEST(ScriptBrowser, ValuesSayWhetherTheyAreEqual) {
    EXPECT_EQ(
        printed(
            "const T = Browser.currentScene.getNamedNode('T');"
            " print(new SFVec3f(1, 2, 3).equals(new SFVec3f(1, 2, 3)), new SFVec3f(1, 2, 3).equals(new SFVec3f(1, 2, "
            "4)),"
            " new SFVec3f(1, 2, 3).equals(7), new SFVec3f(1, 2, 0).equals(new SFVec2f(1, 2)));"
            " print(new SFImage(1, 1, 1, [7]).equals(new SFImage(1, 1, 1, [7])), new SFImage(1, 1, 1, [7]).equals(new "
            "SFImage()));"
            " print(new MFFloat(1, 2).equals(new MFFloat(1, 2)), new MFVec2f(new SFVec2f(1, 2)).equals(new MFVec2f()));"
            " print(T.equals(T), T.equals(T.children[0]), T.translation.equals(new SFVec3f(1, 2, 3)));",
            "DEF T Transform { translation 1 2 3 children DEF L PointLight { } }"),
        "true false false false\ntrue false\ntrue false\ntrue false true\n");
}

TEST(ScriptBrowser, DisposingTakesANodeOut) {
    ScriptScene s("directOutput TRUE", "function initialize() { Browser.currentScene.getNamedNode('L').dispose(); }",
                  "DEF G Group { children DEF L PointLight { } }");
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_TRUE(s.scene.node(s.scene.findName("G")).get(x3d::Group::children).empty());
}

TEST(ScriptBrowser, ViewpointsAreBoundInTheNextFrame) {
    ScriptScene s("inputOnly SFBool go directOutput TRUE", "function go() { Browser.nextViewpoint(); }",
                  "DEF A Viewpoint { } DEF B Viewpoint { }");
    s.frame();
    s.send("go", true);
    s.frame();
    s.frame();
    EXPECT_TRUE(s.get<bool>("isBound", "B"));
}

TEST(ScriptBrowser, NobodyCanChangeWhatAllProgramsShare) {
    EXPECT_EQ(
        printed("try { X3DConstants.SFBool = 7; } catch (e) { } print(X3DConstants.SFBool, X3DConstants.MFMatrix4d);"
                " Browser.extra = 1; Browser.currentScene.extra = 2; print(Browser.extra);"),
        "0 41\n1\n");
    ScriptScene other("directOutput TRUE", "function initialize() { print(Browser.extra, X3DConstants.SFBool); }");
    other.frame();
    EXPECT_EQ(other.printed, "undefined 0\n");
}

TEST(ScriptBrowser, AtTheEndNothingCanBeMade) {
    std::string text;
    {
        ScriptScene s(
            "directOutput TRUE",
            "function shutdown() { try { Browser.createX3DFromString('Group { }'); } catch (e) { print(e.message); }"
            " try { Browser.loadURL(['a.x3d']); } catch (e) { print(e.message); }"
            " try { Browser.replaceWorld(null); } catch (e) { print(e.message); } }");
        s.frame();
        ASSERT_TRUE(s.scene.destroyNode(s.script()));
        text = s.printed;
    }
    EXPECT_EQ(text,
              "a script that shuts down can change nothing\na script that shuts down can change nothing\n"
              "a script that shuts down can change nothing\n");
}

}  // namespace
}  // namespace rtsg
