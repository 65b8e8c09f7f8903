// The objects of ISO/IEC 19777-1 V3.3, one by one: each name that the standard gives them is there for a Script, and is
// of the kind that it says. What is left out is in docs/scene-access.md.
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/world.h>

#include "script_scene.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using test::evaluated;
using test::ScriptScene;

struct Member {
    const char *name, *kind;  // what `typeof` says
};
struct Object {
    const char* created;  // an expression
    std::vector<Member> members;
};

const char* const kWorld =
    "COMPONENT Sound:2\nUNIT length inch 0.0254\n"
    "EXTERNPROTO Far [ ] \"far.x3dv\"\nPROTO Near [ ] { Group { } }\n"
    "DEF T Transform { }\nDEF V Viewpoint { }\nDEF W Viewpoint { }\nROUTE V.isBound TO W.set_bind\n";

const std::vector<Member> kVector = {{"add", "function"},       {"divide", "function"},   {"dot", "function"},
                                     {"length", "function"},    {"multiple", "function"}, {"negate", "function"},
                                     {"normalize", "function"}, {"subtract", "function"}, {"toString", "function"}};
const std::vector<Member> kMatrix = {
    {"setTransform", "function"},  {"getTransform", "function"},  {"inverse", "function"},
    {"transpose", "function"},     {"multLeft", "function"},      {"multRight", "function"},
    {"multVecMatrix", "function"}, {"multMatrixVec", "function"}, {"toString", "function"}};
const std::vector<Member> kContext = {{"specificationVersion", "string"},
                                      {"encoding", "string"},
                                      {"profile", "object"},
                                      {"components", "object"},
                                      {"units", "object"},
                                      {"worldURL", "string"},
                                      {"rootNodes", "object"},
                                      {"protos", "object"},
                                      {"externprotos", "object"},
                                      {"routes", "object"},
                                      {"addRoute", "function"},
                                      {"deleteRoute", "function"},
                                      {"createNode", "function"},
                                      {"createProto", "function"},
                                      {"getNamedNode", "function"},
                                      {"updateNamedNode", "function"},
                                      {"removeNamedNode", "function"},
                                      {"getImportedNode", "function"},
                                      {"updateImportedNode", "function"},
                                      {"removeImportedNode", "function"},
                                      {"getProtoDeclaration", "function"},
                                      {"updateProtoDeclaration", "function"},
                                      {"removeProtoDeclaration", "function"},
                                      {"getExternProtoDeclaration", "function"},
                                      {"updateExternProtoDeclaration", "function"},
                                      {"removeExternProtoDeclaration", "function"}};

std::vector<Member> with(std::vector<Member> some, const std::vector<Member>& more) {
    some.insert(some.end(), more.begin(), more.end());
    return some;
}

const std::vector<Object> kServices = {
    {"Browser",
     {{"name", "string"},
      {"version", "string"},
      {"currentSpeed", "number"},
      {"currentFrameRate", "number"},
      {"description", "string"},
      {"supportedComponents", "object"},
      {"supportedProfiles", "object"},
      {"currentScene", "object"},
      {"replaceWorld", "function"},
      {"createX3DFromString", "function"},
      {"createX3DFromURL", "function"},
      {"loadURL", "function"},
      {"importDocument", "function"},
      {"getRenderingProperty", "function"},
      {"getBrowserProperty", "function"},
      {"print", "function"},
      {"println", "function"},
      {"addBrowserListener", "function"},
      {"removeBrowserListener", "function"},
      {"beginUpdate", "function"},
      {"endUpdate", "function"},
      {"changeViewpoint", "function"},
      {"firstViewpoint", "function"},
      {"previousViewpoint", "function"},
      {"nextViewpoint", "function"},
      {"lastViewpoint", "function"},
      {"createScene", "function"},
      {"getProfile", "function"},
      {"getComponent", "function"},
      {"setBrowserOption", "function"},
      // 14772-1, C.6.1
      {"getName", "function"},
      {"getVersion", "function"},
      {"getCurrentSpeed", "function"},
      {"getCurrentFrameRate", "function"},
      {"getWorldURL", "function"},
      {"setDescription", "function"},
      {"createVrmlFromString", "function"},
      {"createVrmlFromURL", "function"},
      {"addRoute", "function"},
      {"deleteRoute", "function"}}},
    {"Browser.currentScene", with(kContext, {{"getMetaData", "function"},
                                             {"setMetaData", "function"},
                                             {"getExportedNode", "function"},
                                             {"updateExportedNode", "function"},
                                             {"removeExportedNode", "function"},
                                             {"addRootNode", "function"},
                                             {"removeRootNode", "function"}})},
    {"Browser.supportedComponents[0]",
     {{"name", "string"}, {"level", "number"}, {"title", "string"}, {"providerURL", "string"}}},
    {"Browser.supportedProfiles[0]",
     {{"name", "string"}, {"title", "string"}, {"providerURL", "string"}, {"components", "object"}}},
    {"Browser.currentScene.units[0]", {{"category", "string"}, {"name", "string"}, {"conversionFactor", "number"}}},
    {"Browser.currentScene.routes[0]",
     {{"sourceNode", "object"},
      {"sourceField", "string"},
      {"destinationNode", "object"},
      {"destinationField", "string"}}},
    {"Browser.currentScene.protos[0]",
     {{"name", "string"}, {"fields", "object"}, {"isExternProto", "boolean"}, {"newInstance", "function"}}},
    {"Browser.currentScene.externprotos[0]",
     {{"name", "string"},
      {"fields", "object"},
      {"isExternProto", "boolean"},
      {"newInstance", "function"},
      {"urls", "object"},
      {"loadState", "number"},
      {"loadNow", "function"}}},
    {"Browser.currentScene.getNamedNode('T')",
     {{"getNodeName", "function"},
      {"getNodeType", "function"},
      {"getNodeTypeName", "function"},
      {"getFieldDefinitions", "function"},
      {"toVRMLString", "function"},
      {"toXMLString", "function"},
      {"dispose", "function"}}},
    {"Browser.currentScene.getNamedNode('T').getFieldDefinitions()[0]",
     {{"name", "string"}, {"accessType", "number"}, {"dataType", "number"}}}};

const std::vector<Object> kValues = {{"new SFColor()",
                                      {{"r", "number"},
                                       {"g", "number"},
                                       {"b", "number"},
                                       {"setHSV", "function"},
                                       {"getHSV", "function"},
                                       {"toString", "function"}}},
                                     {"new SFColorRGBA()",
                                      {{"r", "number"},
                                       {"g", "number"},
                                       {"b", "number"},
                                       {"a", "number"},
                                       {"setHSV", "function"},
                                       {"getHSV", "function"},
                                       {"toString", "function"}}},
                                     {"new SFImage()",
                                      {{"x", "number"},
                                       {"y", "number"},
                                       {"comp", "number"},
                                       {"array", "object"},
                                       {"width", "number"},
                                       {"height", "number"},
                                       {"toString", "function"}}},
                                     {"new SFRotation()",
                                      {{"x", "number"},
                                       {"y", "number"},
                                       {"z", "number"},
                                       {"angle", "number"},
                                       {"getAxis", "function"},
                                       {"setAxis", "function"},
                                       {"inverse", "function"},
                                       {"multiply", "function"},
                                       {"multiVec", "function"},
                                       {"multVec", "function"},
                                       {"slerp", "function"},
                                       {"getMatrix", "function"},
                                       {"setMatrix", "function"},
                                       {"toString", "function"}}},
                                     {"new X3DMatrix3()", with(kMatrix, {{"0", "object"}, {"2", "object"}})},
                                     {"new X3DMatrix4()", with(kMatrix, {{"0", "object"}, {"3", "object"}})},
                                     {"new VrmlMatrix()", with(kMatrix, {{"0", "object"}, {"3", "object"}})}};

const std::vector<Object> kConstants = {{"X3DConstants",
                                         {{"INITIALIZED_EVENT", "number"},
                                          {"SHUTDOWN_EVENT", "number"},
                                          {"CONNECTION_ERROR", "number"},
                                          {"INITIALIZED_ERROR", "number"},
                                          {"NOT_STARTED_STATE", "number"},
                                          {"IN_PROGRESS_STATE", "number"},
                                          {"COMPLETE_STATE", "number"},
                                          {"FAILED_STATE", "number"},
                                          {"inputOnly", "number"},
                                          {"outputOnly", "number"},
                                          {"inputOutput", "number"},
                                          {"initializeOnly", "number"},
                                          {"SFBool", "number"},
                                          {"MFMatrix4d", "number"},
                                          {"X3DBoundedObject", "number"},
                                          {"X3DMetadataObject", "number"},
                                          {"X3DUrlObject", "number"},
                                          {"X3DTriggerNode", "number"},
                                          {"X3DInfoNode", "number"},
                                          {"X3DAppearanceNode", "number"},
                                          {"X3DMaterialNode", "number"},
                                          {"X3DTextureNode", "number"},
                                          {"X3DTexture2DNode", "number"},
                                          {"X3DTexture3DNode", "number"},
                                          {"X3DGeometryNode", "number"},
                                          {"X3DCoordinateNode", "number"},
                                          {"X3DGroupingNode", "number"},
                                          {"X3DChildNode", "number"},
                                          {"X3DBindableNode", "number"},
                                          {"X3DInterpolatorNode", "number"},
                                          {"X3DShapeNode", "number"},
                                          {"X3DScriptNode", "number"},
                                          {"X3DSensorNode", "number"},
                                          {"X3DLightNode", "number"},
                                          {"X3DTouchSensorNode", "number"},
                                          {"X3DPrototypeInstance", "number"}}}};

std::vector<Object> objects() {
    std::vector<Object> all = kServices;
    for (const auto* more : {&kValues, &kConstants}) all.insert(all.end(), more->begin(), more->end());
    for (const char* name : {"SFVec2f", "SFVec2d"})
        all.push_back({name, with(kVector, {{"x", "number"}, {"y", "number"}})});
    for (const char* name : {"SFVec3f", "SFVec3d"})
        all.push_back(
            {name, with(kVector, {{"x", "number"}, {"y", "number"}, {"z", "number"}, {"cross", "function"}})});
    for (const char* name : {"SFVec4f", "SFVec4d"})
        all.push_back({name, with(kVector, {{"x", "number"}, {"y", "number"}, {"z", "number"}, {"w", "number"}})});
    for (const char* name : {"SFMatrix3f", "SFMatrix3d", "SFMatrix4f", "SFMatrix4d"})
        all.push_back({name, with(kMatrix, {{"0", "number"}, {"8", "number"}})});
    for (const char* name :
         {"MFBool",  "MFColor",    "MFColorRGBA", "MFDouble",   "MFFloat",    "MFImage",    "MFInt32",
          "MFNode",  "MFRotation", "MFString",    "MFTime",     "MFVec2d",    "MFVec2f",    "MFVec3d",
          "MFVec3f", "MFVec4d",    "MFVec4f",     "MFMatrix3d", "MFMatrix3f", "MFMatrix4d", "MFMatrix4f"})
        all.push_back({name, {{"length", "number"}, {"toString", "function"}}});
    return all;
}

TEST(SaiNames, EveryObjectHasThoseOfTheStandard) {
    std::string program = "function initialize() {", expected;
    for (const Object& object : objects()) {
        const std::string name = object.created;
        const bool isType = name.starts_with("SF") || name.starts_with("MF");
        program += " { const o = " + (isType ? "new " + name + "()" : name) + ";";
        for (const Member& member : object.members) {
            program += std::string(" print(o === undefined ? 'none' : typeof o['") + member.name + "']);";
            expected += name + ' ' + member.name + ' ' + member.kind + '\n';
        }
        program += " }";
    }
    ScriptScene s("directOutput TRUE", program + " }", kWorld);
    s.frame();
    EXPECT_EQ(s.problems(), "");
    std::string found;
    std::istringstream lines(s.printed);
    for (const Object& object : objects())
        for (const Member& member : object.members) {
            std::string kind;
            std::getline(lines, kind);
            found += std::string(object.created) + ' ' + member.name + ' ' + kind + '\n';
        }
    EXPECT_EQ(found, expected);
}

TEST(SaiNames, ObjectsAreInstancesOfWhatTheyAreCalled) {
    ScriptScene s("directOutput TRUE", R"(
        function initialize() {
            const scene = Browser.currentScene;
            print([scene instanceof X3DScene, scene instanceof X3DExecutionContext, Browser.createScene() instanceof X3DScene,
                   scene.routes instanceof RouteArray, scene.routes[0] instanceof X3DRoute, scene.protos instanceof ProtoDeclarationArray,
                   scene.protos[0] instanceof X3DProtoDeclaration, scene.protos[0].fields instanceof FieldDefinitionArray,
                   scene.externprotos instanceof ExternProtoDeclarationArray, scene.externprotos[0] instanceof X3DExternProtoDeclaration,
                   scene.components instanceof ComponentInfoArray, scene.components[0] instanceof ComponentInfo,
                   scene.units instanceof UnitInfoArray, scene.units[0] instanceof UnitInfo, scene.profile instanceof ProfileInfo,
                   Browser.supportedProfiles instanceof ProfileInfoArray, scene.routes instanceof Array, scene instanceof Object,
                   scene.getNamedNode('T').getFieldDefinitions()[0] instanceof X3DFieldDefinition].every(is => is === true));
            print([scene.routes instanceof ProtoDeclarationArray, scene.units[0] instanceof X3DRoute, ({}) instanceof X3DScene].some(is => is));
            print(String(scene), String(Browser));
            try { new X3DScene(); } catch (e) { print(e.name, e.message); }
            print(scene.profile.components.length > 10, scene.profile.components[0].level > 0);
        })",
                  kWorld);
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(s.printed,
              "true\nfalse\n[object X3DScene] [object X3DBrowser]\nTypeError X3DScene cannot be made by a "
              "program\ntrue true\n");
}

/// The body of a PROTO's instance is a context of its own, and no scene.
TEST(SaiNames, AScriptInAPrototypeHasAnExecutionContext) {
    ScriptScene s(
        "", "",
        "PROTO P [ ] { Transform { children DEF IN Script { directOutput TRUE url \"ecmascript: function "
        "initialize() { const c = Browser.currentScene; print(c instanceof X3DExecutionContext, c instanceof X3DScene, "
        "c.isScene, c.rootNodes.length, c.rootNodes[0].getNodeTypeName(), typeof c.getNamedNode('IN'), typeof "
        "c.addRootNode); try { c.rootNodes = []; } catch (e) { print(e.message); } }\" } } Group { } }\nP { }");
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(s.printed,
              "true false false 2 Transform object undefined\nrootNodes of a prototype's instance cannot be written\n");
}

TEST(SaiNames, RootNodesOfASceneCanBeWritten) {
    ScriptScene s(
        "directOutput TRUE",
        "function initialize() { const c = Browser.currentScene; c.rootNodes = [c.getNamedNode('S'), "
        "c.createNode('Group'), c.getNamedNode('T')]; print(c.rootNodes.map(n => n.getNodeTypeName())); const p = "
        "Browser.createX3DFromString('Group { }'); p.rootNodes = []; print(p.rootNodes.length); }",
        "DEF G Group { } DEF T Transform { }");
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(s.printed, "Transform,Script,Group\n0\n");
}

TEST(SaiNames, ANodesFieldsAreItsKeys) {
    ScriptScene s("directOutput TRUE", R"(
        function initialize() {
            const G = Browser.currentScene.getNamedNode('G');
            print(Object.keys(G));
            const all = []; for (const name in G) all.push(name);
            print(all.length, 'children' in G, 'none' in G, Object.hasOwn(G, 'children'), Object.entries(G).length);
            Browser.currentScene.getNamedNode('L').dispose();
        })",
                  "DEF G Group { children DEF L PointLight { } }");
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(
        s.printed,
        "addChildren,bboxCenter,bboxDisplay,bboxSize,children,metadata,removeChildren,visible\n8 true false true 8\n");
}

/// 14772-1, 6.8, 6.25, 6.46; and fields that X3D 4.0 renamed.
TEST(SaiNames, FieldsHaveTheirFormerNamesToo) {
    Scene scene;
    Diagnostics diagnostics;
    runScripts(scene);
    ASSERT_TRUE(loadText(
        scene,
        "#VRML V2.0 utf8\nDEF SW Switch { whichChoice 0 choice [ Group { } DEF T Transform { } ] }\nDEF L LOD { level "
        "[ Group { } ] }\n"
        "DEF C Collision { collide FALSE }\nDEF D Collision { }\n"
        "DEF S Script { directOutput TRUE field SFNode s USE SW field SFNode l USE L field SFNode c USE C field SFNode "
        "d USE D "
        "field SFNode t USE T eventOut MFString said url \"javascript: function initialize() { var a = []; "
        "a[0] = s.choice.length + ' ' + l.level.length + ' ' + c.collide + ' ' + ('choice' in s) + ' ' + ('collide' in "
        "s); "
        "c.collide = true; a[1] = c.enabled + ' ' + c.collide; c.set_collide = false; a[2] = String(c.collide); "
        "s.choice = new MFNode(t); a[3] = String(s.children.length); Browser.addRoute(c, 'collide_changed', d, "
        "'set_collide'); "
        "try { t.choice = 1; } catch (e) { a[4] = e.message; } said = a; }\" }\n",
        diagnostics));
    scene.newFrame(0);
    scene.newFrame(1);
    EXPECT_EQ(fieldText(scene, "S.said").value_or("none"),
              R"(["2 1 false true false", "true true", "false", "1", "Transform has no field choice"])");
    ASSERT_TRUE(sendFieldText(scene, "C.enabled", "FALSE"));
    scene.newFrame(2);
    EXPECT_EQ(fieldText(scene, "D.enabled").value_or("none"), "FALSE");
    EXPECT_TRUE(scene.diagnostics().all().empty());
}

TEST(SaiNames, ADeclarationGetsAnotherName) {
    ScriptScene s("directOutput TRUE", R"(
        function initialize() {
            const scene = Browser.currentScene, near = scene.getProtoDeclaration('Near');
            scene.updateProtoDeclaration('Nearer', near);
            print(scene.createProto('Nearer').size, scene.getProtoDeclaration('Nearer').fields.length, scene.protos.map(p => p.name));
            scene.updateProtoDeclaration('Near', near);
            for (const bad of ['Group', 'Nearer', 'Q [ ] { Group { } } Group', ''])
                try { scene.updateProtoDeclaration(bad, near); } catch (e) { print(e.message); }
            try { scene.updateProtoDeclaration('Q', 5); } catch (e) { print(e.name, e.message); }
            try { scene.updateExternProtoDeclaration('Q', near); } catch (e) { print(e.name, e.message); }
            try { scene.removeProtoDeclaration('Near'); } catch (e) { print(e.message); }
            try { scene.removeExternProtoDeclaration('Near'); } catch (e) { print(e.message); }
        })",
                  "PROTO Inner [ ] { Group { } }\nPROTO Near [ inputOutput SFFloat size 2 ] { Inner { } }");
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(
        s.printed,
        "2 2 Inner,Near,Nearer\nthere is a node type Group already, which stays\n"
        "there is a node type Nearer already, which stays\n'Q [ ] { Group { } } Group' is no name for a prototype\n"
        "'' is no name for a prototype\nTypeError X3DProtoDeclaration was expected\n"
        "TypeError X3DExternProtoDeclaration was expected\n"
        "Near stays: a prototype is declared as long as its world is there\nno prototype is named Near\n");
    EXPECT_EQ(s.scene.node(s.scene.root()).get(x3d::RtsgScene::children).size(), 1U) << "a name makes no nodes";
}

TEST(SaiNames, ExternalDeclarationsAreLoadedWhenTheyAreAskedTo) {
    const test::TempFolder folder;
    std::ofstream(folder.path() / "doors.x3dv")
        << "#X3D V4.0 utf8\nPROTO Door [ inputOutput SFFloat w 3 ] { Group { } }\n";
    std::ofstream(folder.path() / "start.x3dv") << "#X3D V4.0 utf8\nPROFILE Full\nEXTERNPROTO Door [ inputOutput "
                                                   "SFFloat w ] [ \"none.x3dv#Door\" \"doors.x3dv#Door\" ]\n"
                                                   "EXTERNPROTO Gone [ ] \"a\\\"b.x3dv\"\n"
                                                   "DEF S Script { directOutput TRUE url \"ecmascript: function "
                                                   "initialize() { const all = Browser.currentScene.externprotos; "
                                                   "const tell = () => print(all.map(one => one.name + one.urls + "
                                                   "one.loadState)); tell(); all.forEach(one => one.loadNow()); "
                                                   "tell(); print(all[0].newInstance().w); }\" }\n";
    std::string printed;
    ScriptOptions options;
    options.print = [&](std::string_view text) { printed += text; };
    Scene scene;
    runScripts(scene, options);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadWorld(scene, folder.path() / "start.x3dv", diagnostics));
    scene.newFrame(0);
    EXPECT_EQ(printed,
              "Door[\"none.x3dv#Door\", \"doors.x3dv#Door\"]0,Gone[\"a\\\"b.x3dv\"]0\n"
              "Door[\"none.x3dv#Door\", \"doors.x3dv#Door\"]2,Gone[\"a\\\"b.x3dv\"]3\n3\n");
    ASSERT_EQ(scene.diagnostics().all().size(), 1U);
    EXPECT_THAT(scene.diagnostics().all()[0].text, testing::StartsWith("EXTERNPROTO Gone cannot be resolved"));
}

TEST(SaiNames, ListenersHearOfTheEnd) {
    std::string printed;
    {
        ScriptScene s("", R"(
            function initialize() {
                const heard = what => event => print(what, event === X3DConstants.SHUTDOWN_EVENT), gone = heard('gone');
                Browser.addBrowserListener(heard('function'));
                Browser.addBrowserListener({browserChanged: heard('object')});
                Browser.addBrowserListener(gone);
                Browser.removeBrowserListener(gone);
                try { Browser.addBrowserListener(5); } catch (e) { print(e.message); }
                Browser.beginUpdate(); Browser.endUpdate();
            }
            function shutdown() { print('shutdown'); })");
        s.frame();
        ASSERT_TRUE(s.scene.destroyNode(s.script()));
        EXPECT_EQ(s.problems(), "");
        printed = s.printed;
    }
    EXPECT_EQ(printed, "a listener is a function\nfunction true\nobject true\nshutdown\n");
}

TEST(SaiNames, AViewpointIsChosenByNameOrDescription) {
    ScriptScene s("inputOnly SFString go directOutput TRUE",
                  "function go(text) { try { if (text === 'back') Browser.changeViewpoint(null, text); else "
                  "Browser.changeViewpoint(text); } catch (e) { print(e.message); } }",
                  "DEF A Viewpoint { } DEF B Viewpoint { description \"back\" }");
    s.frame();
    const auto bound = [&](const char* text) {
        s.send("go", String(text));
        s.frame();
        s.frame();
        return s.get<bool>("isBound", "A") ? "A" : "B";
    };
    EXPECT_EQ(bound("back"), std::string("B"));
    EXPECT_EQ(bound("A"), std::string("A"));
    EXPECT_EQ(bound("none"), std::string("A"));
    EXPECT_EQ(s.printed, "no viewpoint is named or described as none\n");
}

TEST(SaiNames, ARotationsMatrix) {
    EXPECT_EQ(evaluated("SFRotation(0, 0, 1, Math.PI / 2).getMatrix().components().map(c => Math.round(c) + 0)"),
              "0,1,0,-1,0,0,0,0,1");
    EXPECT_EQ(evaluated("(r => { r.setMatrix(SFRotation(1, 0, 0, 0.5).getMatrix()); return r.components().map(c => "
                        "c.toFixed(6)); })(SFRotation())"),
              "1.000000,0.000000,0.000000,0.500000");
}

/// 14772-1, C.6.8: x and y are width and height.
TEST(SaiNames, AnImageHasTheNamesOfBothStandards) {
    EXPECT_EQ(
        evaluated(
            "(i => { i.x = 1; i.y = 2; i.comp = 1; i.array = [5, 6]; return [i.width, i.height, i]; })(SFImage())"),
        "1,2,1 2 1 5 6");
}

}  // namespace
}  // namespace rtsg
