// Nodes in the wrong place, of an unknown type, or spelled as in another version: nothing of them is lost, and
// references still find them.
#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "documents/reading.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using test::allText;
using test::Read;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

std::string convert(std::string_view text, Encoding encoding, Diagnostics& writing) {
    std::string out;
    Diagnostics reading;
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { out += piece; }, writing);
    readDocument(text, *writer, reading);
    return out;
}
std::string convert(std::string_view text, Encoding encoding) {
    Diagnostics ignored;
    return convert(text, encoding, ignored);
}

constexpr const char* kMisplaced = R"(<X3D profile='Interchange' version='4.0'><Scene>
<WorldInfo><MetadataSet name='a'><Transform DEF='T' translation='1 2 3'><Shape><Box DEF='B'/></Shape></Transform>
</MetadataSet></WorldInfo>
<Foo DEF='F' x='1' y='"a" "b"'><Shape DEF='S'><Sphere/></Shape><Bar/></Foo>
<Shape><Box/><Cone DEF='C'/></Shape>
<Group DEF='G'><Transform USE='T'/><Foo USE='F'/><Shape USE='S'/><Shape><Cone USE='C'/></Shape>
<Shape><Box USE='B'/></Shape></Group>
</Scene></X3D>)";

TEST(KeptNodes, WhatStandsWhereItDoesNotBelongIsFoundByItsName) {
    for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml, Encoding::json}) {
        Scene scene;
        Diagnostics diagnostics;
        const std::string text = encoding == Encoding::xml ? kMisplaced : convert(kMisplaced, encoding);
        ASSERT_TRUE(loadText(scene, text, diagnostics)) << allText(diagnostics);
        const auto children = [&](std::string_view def) {
            const Node& node = scene.node(scene.findName(def));
            return node.value(node.type().find("children")).as<Array<NodeId>>();
        };
        // T, S and the Shapes of C and B; the node of an unknown type is in no field.
        const Array<NodeId> group = children("G");
        ASSERT_EQ(group.size(), 4u) << allText(diagnostics) << text;
        EXPECT_EQ(group[0], scene.findName("T"));
        EXPECT_EQ(group[1], scene.findName("S"));
        for (const auto& [shape, name] : {std::pair{group[2], "C"}, std::pair{group[3], "B"}}) {
            const Node& node = scene.node(shape);
            EXPECT_EQ(node.value(node.type().find("geometry")).as<NodeId>(), scene.findName(name)) << name;
        }
        EXPECT_THAT(allText(diagnostics), Not(HasSubstr("USE")));
        EXPECT_THAT(allText(diagnostics), HasSubstr("unknown node type Foo"));
        EXPECT_THAT(allText(diagnostics), HasSubstr("does not take Transform"));
    }
}

/// The scene of an XML text, and `parent.field` of it as a text.
std::string placed(std::string_view body, std::string_view def, std::string_view name, std::string& problems) {
    Scene scene;
    Diagnostics diagnostics;
    EXPECT_TRUE(loadText(scene, "<X3D profile='Full' version='4.0'><Scene>" + std::string(body) + "</Scene></X3D>",
                         diagnostics))
        << body;
    problems = allText(diagnostics);
    const Node& node = scene.node(scene.findName(def));
    const Value value = node.value(node.type().find(name));
    if (value.holds<NodeId>()) return value.as<NodeId>() ? "1" : "0";
    return std::to_string(value.as<Array<NodeId>>().size());
}

TEST(KeptNodes, ANodeWithoutContainerFieldGoesWhereOneFieldAloneTakesIt) {
    std::string problems;
    EXPECT_EQ(placed("<LinePickSensor DEF='P'><Shape/></LinePickSensor>", "P", "pickTarget", problems), "1");
    EXPECT_EQ(problems, "") << "what the sensor puts out takes none";
    EXPECT_EQ(
        placed("<ProtoDeclare name='Q'><ProtoInterface><field name='stuff' type='MFNode' accessType='inputOutput'/>"
               "</ProtoInterface><ProtoBody><Group/></ProtoBody></ProtoDeclare>"
               "<ProtoInstance name='Q' DEF='P'><Shape/></ProtoInstance>",
               "P", "stuff", problems),
        "0");
    EXPECT_NE(problems, "") << "a field that takes any node is not meant by that";
}

TEST(KeptNodes, AContainerFieldThatIsThereButTakesOthersIsWrong) {
    std::string problems;
    EXPECT_EQ(placed("<Group DEF='P'><MetadataString containerField='children'/></Group>", "P", "metadata", problems),
              "0");
    EXPECT_THAT(problems, HasSubstr("does not take MetadataString"));
    EXPECT_EQ(placed("<LinePickSensor DEF='P'><Shape containerField='pickedGeometry'/></LinePickSensor>", "P",
                     "pickTarget", problems),
              "0");
    EXPECT_THAT(problems, HasSubstr("outputOnly"));
}

TEST(KeptNodes, TheyPassThroughEveryEncodingAndBack) {
    const std::string xml = convert(kMisplaced, Encoding::xml);
    EXPECT_THAT(xml, HasSubstr("<Foo DEF='F' x='1' y='\"a\" \"b\"'>"));
    EXPECT_EQ(convert(xml, Encoding::xml), xml);
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::json})
        EXPECT_EQ(convert(convert(xml, encoding), Encoding::xml), xml);
}

TEST(KeptNodes, NamesThatAnEncodingCannotSpellAreSpelledOtherwiseAndComeBack) {
    // Names that ClassicVRML takes and XML does not, statements' names, an attribute's that has a meaning, one twice.
    const std::string classic =
        "#X3D V4.0 utf8\nDEF A R\xC3\xA4um { gr\xC3\xB6\xC3\x9F"
        "e 1 DEF 2 a 3 a 4 }\nScene { }\nUSE A";
    for (const Encoding encoding : {Encoding::xml, Encoding::json}) {
        const Read r(convert(classic, encoding));
        EXPECT_EQ(r.diagnostics.errors(), 0u) << r.complaints();
        EXPECT_EQ(r.handler.text(),
                  "begin R\xC3\xA4um DEF A\nset gr\xC3\xB6\xC3\x9F"
                  "e SFString \"1\"\nset DEF SFString \"2\"\nset a SFString \"3\"\nend\nbegin Scene\nend\nuse A\n")
            << convert(classic, encoding);
    }
    Diagnostics writing;
    convert(classic, Encoding::xml, writing);
    EXPECT_THAT(allText(writing), HasSubstr("is no name in XML; written as R_x00E4_um"));
    // And the other way.
    EXPECT_THAT(convert("<X3D version='4.0'><Scene><ROUTE.x/></Scene></X3D>", Encoding::classicVrml),
                HasSubstr("ROUTE_x002E_x {"));
}

TEST(KeptNodes, AFaultThatReaderAndBuilderSeeIsToldOnce) {
    test::Loaded l("WorldInfo { metadata MetadataSet { value [ DEF T Transform { } ] } }\nFoo { }");
    EXPECT_EQ(l.diagnostics.warnings(), 2u) << l.problems();
    EXPECT_EQ(l.diagnostics.errors(), 0u) << l.problems();
    EXPECT_TRUE(l.named("T"));
}

TEST(KeptNodes, ARouteToANodeOfUnknownTypeSaysSo) {
    test::Loaded l("DEF F Foo { } DEF T TimeSensor { } ROUTE T.fraction_changed TO F.set_fraction");
    EXPECT_THAT(l.problems(), HasSubstr("does nothing: F is of an unknown type"));
    EXPECT_EQ(l.diagnostics.errors(), 0u) << l.problems();
}

TEST(KeptNodes, AnUnknownContainerFieldTakesNoOthersPlace) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "<X3D version='4.0'><Scene><Material DEF='M'><PixelTexture DEF='N' containerField='normalMap'/>"
                 "<PixelTexture DEF='D' containerField='diffuseTexture'/></Material></Scene></X3D>",
                 diagnostics));
    const Node& material = scene.node(scene.findName("M"));
    const auto only = [&](const char* field) { return material.value(material.type().find(field)).as<NodeId>(); };
    EXPECT_EQ(only("diffuseTexture"), scene.findName("D"));
    EXPECT_FALSE(only("ambientTexture"));
    EXPECT_TRUE(scene.findName("N"));
    EXPECT_THAT(allText(diagnostics), HasSubstr("field 'normalMap' of Material does not take PixelTexture"));
}

TEST(KeptNodes, TextureTransformsAreMembersOfAMultiTextureTransform) {
    test::Loaded l("DEF M MultiTextureTransform { textureTransform [ TextureTransform { } TextureTransform3D { } ] }");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.nodes(l.named("M"), "textureTransform").size(), 2u);
}

// ---- versions

TEST(Versions, FieldsOfEarlierVersionsAreReadAndWrittenUnderTheirNames) {
    const std::string_view old =
        "<X3D profile='Full' version='3.3'><Scene><Appearance><ComposedCubeMapTexture>"
        "<ImageTexture containerField='back'/><ImageTexture "
        "containerField='top'/></ComposedCubeMapTexture></Appearance>"
        "<LoadSensor><ImageTexture containerField='watchList'/></LoadSensor>"
        "<ParticleSystem><Color containerField='colorRamp'/></ParticleSystem>"
        "<LayerSet><Layer isPickable='false'/><LayoutLayer isPickable='false'/></LayerSet></Scene></X3D>";
    const Read r(old);
    EXPECT_EQ(r.complaints(), "");
    for (const char* line : {"begin ImageTexture in backTexture", "begin ImageTexture in topTexture",
                             "begin ImageTexture in children", "begin Color in color"})
        EXPECT_THAT(r.handler.lines, Contains(line));
    for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml, Encoding::json}) {
        const std::string text = convert(old, encoding);
        EXPECT_THAT(text, HasSubstr("watchList"));
        EXPECT_THAT(text, HasSubstr("isPickable"));
        EXPECT_THAT(text, Not(HasSubstr("backTexture")));
        EXPECT_EQ(convert(text, Encoding::xml), convert(old, Encoding::xml));
    }
    std::string now(old);
    now.replace(now.find("3.3"), 3, "4.0");
    EXPECT_THAT(convert(now, Encoding::xml), HasSubstr("backTexture"));
}

TEST(Versions, FieldsThatLaterVersionsDroppedAreLeftOutWithAWarning) {
    const char* classic =
        "#X3D V3.2 utf8\nPROFILE Full\nDEF V GeoViewpoint { headlight FALSE navType [ \"WALK\" ] description \"x\" }\n"
        "ParticleSystem { emitter SurfaceEmitter { coordIndex [ -1 ] surface Box { } } }";
    const char* xml =
        "<X3D profile='Full' version='3.2'><Scene><GeoViewpoint DEF='V' headlight='false' navType='\"WALK\"' "
        "description='x'/><ParticleSystem><SurfaceEmitter coordIndex='-1'><Box containerField='surface'/>"
        "</SurfaceEmitter></ParticleSystem></Scene></X3D>";
    for (const char* text : {classic, xml}) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, text, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u) << allText(diagnostics);
        for (const char* said :
             {"GeoViewpoint.headlight is a field up to X3D 3.2 only", "GeoViewpoint.navType is a field",
              "SurfaceEmitter.coordIndex is a field up to X3D 3.3 only"})
            EXPECT_THAT(allText(diagnostics), HasSubstr(said));
        const Node& view = scene.node(scene.findName("V"));
        EXPECT_EQ(view.value(view.type().findExact("description")).as<String>(), "x");
    }
}

TEST(Versions, APrototypeMayHaveTheNameOfALaterNode) {
    for (const char* header : {"#VRML V2.0 utf8\n", "#X3D V3.3 utf8\n"}) {
        Scene scene;
        Diagnostics diagnostics;
        const std::string field = header[1] == 'V' ? "exposedField" : "inputOutput";
        ASSERT_TRUE(loadText(
            scene, header + ("PROTO Delay [ " + field + " SFTime x 1 ] { Group { } }\n") + "DEF D Delay { x 2 }",
            diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u) << allText(diagnostics);
        const Node& node = scene.node(scene.findName("D"));
        EXPECT_EQ(node.type().kind, NodeType::Kind::proto);
        EXPECT_EQ(node.value(node.type().find("x")).as<Time>(), Time(2));
    }
    Scene scene;
    Diagnostics diagnostics;
    loadText(scene, "#X3D V4.0 utf8\nPROTO Delay [ ] { Group { } }\nDEF D Delay { }", diagnostics);
    EXPECT_EQ(diagnostics.errors(), 1u) << allText(diagnostics);
    EXPECT_EQ(scene.node(scene.findName("D")).type().kind, NodeType::Kind::builtin);
}

TEST(Versions, InXmlAndJsonAPrototypeMayHaveTheNameOfAnyNode) {
    const std::string xml =
        "<X3D profile='Full' version='3.3'><Scene><ProtoDeclare name='Box'><ProtoInterface><field name='size' "
        "type='SFVec3f' accessType='inputOutput' value='1 1 1'/></ProtoInterface><ProtoBody><Sphere/></ProtoBody>"
        "</ProtoDeclare><Shape><ProtoInstance DEF='P' name='Box' containerField='geometry'><fieldValue name='size' "
        "value='3 3 3'/></ProtoInstance></Shape><Shape><Box DEF='B' size='2 2 2'/></Shape></Scene></X3D>";
    const std::string json =
        R"({"X3D":{"@version":"3.3","@profile":"Full","Scene":{"-children":[{"ProtoDeclare":{"@name":"Box",)"
        R"("ProtoInterface":{"field":[{"@name":"size","@type":"SFVec3f","@accessType":"inputOutput","@value":[1,1,1]}]},)"
        R"("ProtoBody":{"-children":[{"Sphere":{}}]}}},{"Shape":{"-geometry":{"ProtoInstance":{"@DEF":"P","@name":"Box",)"
        R"("fieldValue":[{"@name":"size","@value":[3,3,3]}]}}}},{"Shape":{"-geometry":{"Box":{"@DEF":"B","@size":[2,2,2]}}}}]}}})";
    for (const std::string& text : {xml, json}) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, text, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u) << allText(diagnostics);
        EXPECT_THAT(allText(diagnostics), HasSubstr("PROTO Box has the name of a node of X3D; it is called Box_"));
        const Node &instance = scene.node(scene.findName("P")), &box = scene.node(scene.findName("B"));
        EXPECT_EQ(instance.type().kind, NodeType::Kind::proto);
        EXPECT_EQ(instance.value(instance.type().find("size")).as<Vec3f>(), Vec3f(3));
        EXPECT_EQ(box.type().kind, NodeType::Kind::builtin);
        EXPECT_EQ(box.value(box.type().find("size")).as<Vec3f>(), Vec3f(2));
        // It comes back from every encoding.
        for (const Encoding encoding : {Encoding::xml, Encoding::json, Encoding::classicVrml}) {
            Diagnostics writing;
            Scene again;
            ASSERT_TRUE(loadText(again, convert(text, encoding, writing), writing));
            EXPECT_EQ(writing.errors(), 0u) << allText(writing);
            EXPECT_EQ(again.node(again.findName("P")).type().name, "Box_");
        }
    }
    // Instances of an external one that cannot be had stay, as they do under any other name.
    Diagnostics writing;
    const std::string kept = convert(
        "<X3D profile='Full' version='3.3'><Scene><ExternProtoDeclare name='Text' url='\"none.x3d\"'><field "
        "name='string' "
        "type='MFString' accessType='inputOutput'/></ExternProtoDeclare><Shape><ProtoInstance name='Text' "
        "containerField='geometry'><fieldValue name='string' value='\"Hi\"'/></ProtoInstance></Shape></Scene></X3D>",
        Encoding::xml, writing);
    EXPECT_EQ(writing.errors(), 0u) << allText(writing);
    EXPECT_THAT(kept, HasSubstr("<ProtoInstance name='Text_'"));
}

/// As in VRML97 files of a library: the node of a later version is meant if it has all the fields.
TEST(Versions, AnExternPrototypeMayHaveTheNameOfALaterNodeThatIsAnotherThing) {
    const test::TempFolder folder;
    const auto write = [&](const char* name, std::string_view text) { std::ofstream(folder / name) << text; };
    write("delay.wrl", "#VRML V2.0 utf8\nPROTO Delay [ exposedField SFTime cycleInterval 1 ] { Group { } }\n");
    const std::string classic = "#VRML V2.0 utf8\nEXTERNPROTO Delay [ exposedField SFTime cycleInterval ] ";
    const std::string use = "\nDEF D Delay { cycleInterval 3 }";
    const std::string xml =
        "<X3D profile='Full' version='3.3'><Scene><ExternProtoDeclare name='Delay' url='\"delay.wrl#Delay\"'>"
        "<field name='cycleInterval' type='SFTime' accessType='inputOutput'/></ExternProtoDeclare>"
        "<ProtoInstance DEF='D' name='Delay'><fieldValue name='cycleInterval' "
        "value='3'/></ProtoInstance></Scene></X3D>";
    for (const std::string& text : {classic + "\"delay.wrl\"" + use, classic + "\"delay.wrl#Delay\"" + use, xml}) {
        write("scene", text);
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadFile(scene, folder / "scene", diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u) << allText(diagnostics);
        EXPECT_THAT(allText(diagnostics), HasSubstr("it is called Delay_ from here on"));
        const Node& node = scene.node(scene.findName("D"));
        EXPECT_EQ(node.type().kind, NodeType::Kind::externProto);
        EXPECT_EQ(node.value(node.type().find("cycleInterval")).as<Time>(), Time(3));
    }
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#VRML V2.0 utf8\nEXTERNPROTO Delay [ exposedField SFTime delayTime ] \"none.wrl\"\n"
                         "DEF D Delay { delayTime 2 }",
                         diagnostics));
    EXPECT_EQ(scene.node(scene.findName("D")).type().kind, NodeType::Kind::builtin) << allText(diagnostics);
    // A field of that name and another type makes it another thing, too.
    Scene other;
    loadText(other,
             "#VRML V2.0 utf8\nEXTERNPROTO Delay [ exposedField SFInt32 delayTime ] \"none.wrl\"\nDEF D Delay { }",
             diagnostics);
    EXPECT_EQ(other.node(other.findName("D")).type().kind, NodeType::Kind::externProto);
}

TEST(Versions, VRML97IsToldOfNodesItDoesNotHave) {
    Diagnostics writing;
    const std::string text = convert("#X3D V4.0 utf8\nDelay { } Delay { } Group { }", Encoding::vrml97, writing);
    EXPECT_EQ(writing.warnings(), 1u) << allText(writing);
    EXPECT_THAT(allText(writing), HasSubstr("2:1: warning: Delay is no node of VRML97"));
    EXPECT_THAT(text, HasSubstr("Delay {"));
}

// ---- spellings that other browsers read

TEST(Spellings, ARouteMayHaveWhiteSpaceRoundItsDots) {
    for (const char* route :
         {"ROUTE A .translation TO B. translation", "ROUTE A . translation TO B .set_translation"}) {
        test::Loaded l(std::string("DEF A Transform { } DEF B Transform { }\n") + route);
        EXPECT_EQ(l.problems(), "") << route;
        EXPECT_EQ(l.scene.routeCount(), 1u) << route;
    }
    test::Loaded wrong("DEF A Transform { } ROUTE A translation TO A.scale");
    EXPECT_EQ(wrong.scene.routeCount(), 0u);
    EXPECT_GE(wrong.diagnostics.errors(), 1u);
}

TEST(Spellings, NumbersAmongStringsAreStrings) {
    test::Loaded l("DEF W WorldInfo { info [ 1 \"b\" -2.5 ] title 7 }");
    EXPECT_EQ(l.get("W", "info"), "[\"1\", \"b\", \"-2.5\"]");
    EXPECT_EQ(l.get("W", "title"), "\"7\"");
    EXPECT_EQ(l.diagnostics.warnings(), 3u) << l.problems();
    EXPECT_EQ(l.diagnostics.errors(), 0u) << l.problems();
}

TEST(Spellings, SourceTextIsSourceCode) {
    const Read r(R"({"X3D":{"@version":"4.0","Scene":{"-children":[{"Script":{"#sourceText":["a();","b();"]}}]}}})");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.text(), HasSubstr("a();\nb();"));
}

// A field's name, or a word of declarations, is a node's type where a brace follows it.
TEST(KeptNodes, UnknownTypesMayBeCalledAsFieldsAndKeywordsAre) {
    const std::string xml = convert(
        "<X3D profile='Full' version='4.0'><Scene>"
        "<Shape><bboxCenter DEF='A'><Group DEF='G'/></bboxCenter><inputOutput/><Box/></Shape>"
        "<Script><field name='n' type='SFNode' accessType='initializeOnly'><inputOnly DEF='I'/></field></Script>"
        "</Scene></X3D>",
        Encoding::xml);
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::json}) {
        const std::string text = convert(xml, encoding);
        EXPECT_EQ(convert(text, Encoding::xml), xml) << text;
        Diagnostics reading;
        Filter nothing;
        readDocument(text, nothing, reading);
        EXPECT_EQ(reading.errors(), 0u) << text << allText(reading);
    }
    const std::string skipped =
        convert("#X3D V4.0 utf8\nPROFILE Full\nShape { nothing geometry Box { size 1 2 3 } }", Encoding::xml);
    EXPECT_THAT(skipped, HasSubstr("<Box size='1 2 3'/>")) << "an unknown field without a value takes no field's name";
}

// In JSON a PROTO stands in "-children", and what was begun before it may have its instances.
TEST(KeptNodes, APrototypeComesBeforeItsInstancesInEveryEncoding) {
    for (const char* type : {"Nose", "HAnimHumanoid"}) {
        const std::string text =
            std::string("#X3D V4.0 utf8\nPROFILE Full\n") + type +
            " { skeleton Group { } PROTO P [ ] { Group { } } EXTERNPROTO Q [ ] \"q.x3dv\" skeleton P { } "
            "ROUTE A.x TO A.y skeleton Q { } }\n";
        for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
            std::string written;
            Diagnostics writing, reading;
            readDocument(text,
                         *makeWriter(encoding, [&](std::string_view piece) { written += piece; }, writing), writing);
            test::RecordingHandler back;
            readDocument(written, back, reading);
            EXPECT_EQ(reading.errors(), 0u) << test::allText(reading) << written;
            EXPECT_EQ(std::ranges::count(back.lines, "begin P in skeleton"), 1) << written;
            EXPECT_EQ(std::ranges::count(back.lines, "begin Q in skeleton"), 1) << written;
        }
    }
}

// As in XML with containerField: reported once, kept, and the same from each encoding to each.
TEST(KeptNodes, NodesInAFieldOfValuesAreKeptUnderItsName) {
    for (const char* before : {"", "value [ TRUE ] "}) {
        const std::string text = std::string("#X3D V4.0 utf8\nPROFILE Full\nMetadataBoolean { ") + before +
                                 "value [ MetadataDouble { value 0.5 } ] name \"n\" value DEF A Group { } }\n";
        for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
            std::string written;
            Diagnostics writing, reading;
            readDocument(text,
                         *makeWriter(encoding, [&](std::string_view piece) { written += piece; }, writing), writing);
            EXPECT_EQ(writing.errors(), 0u) << test::allText(writing);
            EXPECT_EQ(writing.warnings(), 2u) << test::allText(writing);
            test::RecordingHandler back;
            readDocument(written, back, reading);
            EXPECT_EQ(reading.errors(), 0u) << test::allText(reading) << written;
            EXPECT_EQ(std::ranges::count(back.lines, "begin MetadataDouble in value"), 1) << written;
            EXPECT_EQ(std::ranges::count(back.lines, "begin Group DEF A in value"), 1) << written;
            EXPECT_EQ(std::ranges::count(back.lines, "set value MFBool [TRUE]"), *before ? 1 : 0) << written;
            EXPECT_EQ(std::ranges::count(back.lines, "set name SFString \"n\""), 1) << written;
        }
    }
    // A value that is none is an error, as before.
    test::RecordingHandler handler;
    Diagnostics problems;
    readDocument("#X3D V4.0 utf8\nPROFILE Full\nMetadataBoolean { value Group value Box }", handler, problems);
    EXPECT_GE(problems.errors(), 1u);
}

}  // namespace
}  // namespace rtsg
