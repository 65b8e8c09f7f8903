// The three writers: text, escapes, numbers, and limits of each encoding.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/writer.h>

#include "documents/reading.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using test::Read;
using test::readClassicScene;
using test::readXmlScene;
using testing::HasSubstr;

std::string rewrite(std::string_view text, Encoding encoding, Diagnostics* complaints = nullptr) {
    std::string out;
    Diagnostics reading, writing;
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { out += piece; }, writing);
    readDocument(text, *writer, reading);
    if (complaints)
        complaints->append(writing);
    else
        EXPECT_EQ(writing.all().size(), 0u) << (writing.all().empty() ? "" : writing.all()[0].format());
    return out;
}

TEST(Writer, ANameThatIsUsedBeforeItIsThereIsNamedWhereItsTypeIsWritten) {
    const char* text =
        "<X3D profile='Full' version='4.0'><Scene>\n<Shape><Box USE='B'/></Shape>\n<Shape><Box DEF='B'/></Shape>\n"
        "<Inline DEF='I'/><IMPORT inlineDEF='I' importedDEF='x'/><Group><Group USE='x'/></Group></Scene></X3D>";
    for (const Encoding encoding : {Encoding::xml, Encoding::json}) {
        Diagnostics complaints;
        rewrite(text, encoding, &complaints);
        ASSERT_EQ(complaints.all().size(), 1u);
        EXPECT_EQ(complaints.all()[0].format(),
                  "2:8: error: USE 'B': no node has that name before this point; of which type it is cannot be written "
                  "[write]");
    }
    Diagnostics classic;
    EXPECT_THAT(rewrite(text, Encoding::classicVrml, &classic), HasSubstr("geometry USE B"));
    EXPECT_TRUE(classic.all().empty()) << "it says no types";
}

// Everything that a document can say, in the order in which XML says it.
constexpr const char* kEverything = R"(<X3D profile='Immersive' version='4.0'>
<head><component name='Scripting' level='1'/><unit category='angle' name='degree' conversionFactor='0.0175'/>
<meta name='title' content='a "quoted" &lt;title&gt;'/></head><Scene>
<WorldInfo title="it's &quot;so&quot; \\ &amp;" info='"one" "tw\"o" "" "back\\slash"'/>
<Transform DEF='T' translation='0.1 -2.5e-8 3e20' rotation='0 1 0 1.5708'>
  <Shape><Appearance><Material DEF='M' diffuseColor='1 0 0.5'/><Material USE='M' containerField='backMaterial'/>
  <PixelTexture image='2 2 3 0xFF0000 255 0 0x00ff00'/></Appearance>
  <IndexedFaceSet coordIndex='0 1 2 -1' solid='false'><Coordinate point='0 0 0, 1 0 0, 0 1 0'/></IndexedFaceSet></Shape>
  <Group USE='near'/>
</Transform>
<MetadataSet name='set'><MetadataBoolean containerField='value' value='true false'/>
<MetadataDouble containerField='value' value='0.1 1e-300'/><MetadataString name='inner'/></MetadataSet>
<ProtoDeclare name='P'><ProtoInterface>
  <field name='look' type='SFNode' accessType='inputOutput'><Appearance/></field>
  <field name='kids' type='MFNode' accessType='initializeOnly'><Group/><Group/></field>
  <field name='none' type='MFNode' accessType='inputOutput'/>
  <field name='at' type='SFVec3f' accessType='inputOutput' value='1 2 3'/>
  <field name='go' type='SFBool' accessType='inputOnly'/><field name='done' type='SFTime' accessType='outputOnly'/>
</ProtoInterface><ProtoBody>
  <ProtoDeclare name='Inner'><ProtoBody><Group/></ProtoBody></ProtoDeclare>
  <Transform DEF='B'><IS><connect nodeField='translation' protoField='at'/></IS><ProtoInstance name='Inner'/></Transform>
  <Script DEF='S' directOutput='true'><IS><connect nodeField='a' protoField='at'/></IS>
    <field name='a' type='SFVec3f' accessType='inputOutput'/><field name='b' type='MFFloat' accessType='initializeOnly'
    value='1 2 3'/><field name='in' type='SFTime' accessType='inputOnly'/>
    <field name='node' type='SFNode' accessType='initializeOnly'><Transform USE='B'/></field>
    <field name='nodes' type='MFNode' accessType='initializeOnly'><Group/><Group DEF='G'/></field>
    <field name='none' type='SFNode' accessType='inputOutput'/>
<![CDATA[ecmascript:
function f() { return a[b[0]]]]><![CDATA[>c && "x" < 'y'; } // \ ]]></Script>
  <ROUTE fromNode='B' fromField='translation_changed' toNode='B' toField='set_scale'/>
</ProtoBody></ProtoDeclare>
<ProtoInstance name='P' DEF='I'><fieldValue name='at' value='0 0 1'/><fieldValue name='kids'><Group/><Shape/></fieldValue>
<fieldValue name='look'/></ProtoInstance>
<ExternProtoDeclare name='E' url='"a.x3d#E" "b.x3d"'><field name='c' type='SFColor' accessType='inputOutput'/>
</ExternProtoDeclare><ProtoInstance name='E' DEF='IE'/>
<Inline DEF='In' url='"x.x3d"'/><IMPORT inlineDEF='In' importedDEF='far' AS='near'/><EXPORT localDEF='T' AS='out'/>
<TimeSensor DEF='Clock' loop='true'/><PositionInterpolator DEF='Move' key='0 1' keyValue='0 0 0 1 1 1'/>
<ROUTE fromNode='Clock' fromField='fraction_changed' toNode='Move' toField='set_fraction'/>
<ROUTE fromNode='Move' fromField='value_changed' toNode='T' toField='translation'/>
</Scene></X3D>)";

TEST(Writer, XmlClassicXmlGivesEqualCommands) {
    const Read original(kEverything);
    EXPECT_EQ(original.complaints(), "");
    const std::string xml = rewrite(kEverything, Encoding::xml);
    EXPECT_EQ(Read(xml).handler.text(), original.handler.text()) << xml;
    const std::string classic = rewrite(xml, Encoding::classicVrml);
    const Read throughClassic(classic);
    EXPECT_EQ(throughClassic.complaints(), "") << classic;
    EXPECT_EQ(throughClassic.handler.text(), original.handler.text()) << classic;
    EXPECT_EQ(throughClassic.handler.header.profile, "Immersive");
    EXPECT_EQ(throughClassic.handler.header.version, "4.0");
    const std::string back = rewrite(classic, Encoding::xml);
    EXPECT_EQ(back, xml);
    EXPECT_EQ(rewrite(back, Encoding::classicVrml), classic);
}

TEST(Writer, XmlJsonXmlGivesEqualCommands) {
    const std::string xml = rewrite(kEverything, Encoding::xml);
    const std::string json = rewrite(kEverything, Encoding::json);
    const Read throughJson(json);
    EXPECT_EQ(throughJson.complaints(), "") << json;
    EXPECT_EQ(rewrite(json, Encoding::json), json);
    EXPECT_EQ(rewrite(json, Encoding::xml), xml) << json;
}

// Readers that go by the order know a Script's own fields only once they have come.
TEST(Writer, AnIsComesBehindTheFieldsThatANodeDeclares) {
    constexpr const char* kDocument =
        "#X3D V4.0 utf8\nPROFILE Immersive\nPROTO P [inputOutput SFFloat a 1 inputOutput SFVec3f at 0 0 0] {"
        "Script { inputOutput SFFloat a IS a initializeOnly SFNode t Group { }"
        " url \"ecmascript:\nf();\" } Transform { translation IS at children Group { } } }";
    EXPECT_THAT(rewrite(kDocument, Encoding::xml),
                HasSubstr("        <Script>\n          <field accessType='inputOutput' type='SFFloat' name='a'/>\n"
                          "          <field accessType='initializeOnly' type='SFNode' name='t'>\n            <Group/>\n"
                          "          </field>\n          <IS>\n            <connect nodeField='a' protoField='a'/>\n"
                          "          </IS><![CDATA[ecmascript:\nf();]]></Script>\n        <Transform>\n          <IS>\n"
                          "            <connect nodeField='translation' protoField='at'/>\n          </IS>\n"
                          "          <Group/>\n        </Transform>\n"));
    const std::string json = rewrite(kDocument, Encoding::json);
    const std::size_t script = json.find("\"Script\""), transform = json.find("\"Transform\"");
    EXPECT_LT(json.find("\"field\"", script), json.find("\"IS\"", script)) << json;
    EXPECT_LT(json.find("\"IS\"", transform), json.find("\"Group\"", transform)) << json;
    EXPECT_EQ(Read(json).handler.text(), Read(kDocument).handler.text());
    EXPECT_EQ(Read(rewrite(kDocument, Encoding::xml)).handler.text(), Read(kDocument).handler.text());
}

// Readers that do not look into the PROTO assume `children` for instances.
TEST(Writer, PlacesOfInstancesAreSaid) {
    constexpr const char* kDocument =
        "#X3D V4.0 utf8\nPROFILE Immersive\nPROTO G [] { Box { } } PROTO S [] { Shape { } }"
        "Group { children [ DEF I S { } Shape { geometry DEF J G { } } Shape { geometry USE J } USE I ] }";
    const std::string xml = rewrite(kDocument, Encoding::xml);
    EXPECT_THAT(xml,
                HasSubstr("<ProtoInstance name='S' DEF='I'/>\n      <Shape>\n        <ProtoInstance name='G' DEF='J' "
                          "containerField='geometry'/>\n      </Shape>\n      <Shape>\n        <ProtoInstance "
                          "name='G' USE='J' containerField='geometry'/>\n      </Shape>\n      <ProtoInstance "
                          "name='S' USE='I'/>\n"));
    EXPECT_EQ(Read(xml).handler.text(), Read(kDocument).handler.text());
    // A containerField that the file does not give for a node of unknown type is not made up.
    const std::string unknown =
        "<X3D version='4.0' profile='Full'><Scene><Appearance><Polish/></Appearance></Scene></X3D>";
    EXPECT_THAT(rewrite(unknown, Encoding::xml), HasSubstr("<Polish/>"));
}

TEST(Writer, ClassicLayout) {
    EXPECT_EQ(rewrite("#X3D V4.0 utf8\nPROFILE Immersive Group{children[Shape{geometry Box{size 1 2 3}}Group{}]}",
                      Encoding::classicVrml),
              "#X3D V4.0 utf8\nPROFILE Immersive\nGroup {\n  children [\n    Shape {\n      geometry Box {\n"
              "        size 1 2 3\n      }\n    }\n    Group {}\n  ]\n}\n");
}

TEST(Writer, XmlLayout) {
    EXPECT_EQ(
        rewrite("#X3D V4.0 utf8\nPROFILE Immersive Group{children[Shape{geometry Box{size 1 2 3}}Group{}]"
                " bboxSize 1 1 1}",
                Encoding::xml),
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<X3D profile='Immersive' version='4.0'>\n  <Scene>\n"
        "    <Group bboxSize='1 1 1'>\n      <Shape>\n        <Box size='1 2 3'/>\n      </Shape>\n      <Group/>\n"
        "    </Group>\n  </Scene>\n</X3D>\n");
}

TEST(Writer, InterleavedListsBecomeOneListEach) {
    const std::string classic = rewrite(
        "<X3D><Scene><HAnimHumanoid><HAnimJoint DEF='a' containerField='joints'/><HAnimSegment DEF='s' "
        "containerField='segments'/><HAnimJoint DEF='b' containerField='joints'/><HAnimSegment DEF='t' "
        "containerField='segments'/></HAnimHumanoid></Scene></X3D>",
        Encoding::classicVrml);
    EXPECT_EQ(
        classic,
        "#X3D V4.0 utf8\nPROFILE Full\nHAnimHumanoid {\n  joints [\n    DEF a HAnimJoint {}\n"
        "    DEF b HAnimJoint {}\n  ]\n  segments [\n    DEF s HAnimSegment {}\n    DEF t HAnimSegment {}\n  ]\n}\n");
}

TEST(Writer, Vrml97UsesTheOldWords) {
    const std::string text = rewrite(
        "#X3D V3.3 utf8\nPROFILE Full\nPROTO P [ initializeOnly SFFloat a 1 inputOutput SFBool b TRUE ] { Group {} }\n"
        "DEF L LOD { children Group {} } Switch { children [ Group {} ] }",
        Encoding::vrml97);
    EXPECT_THAT(text, HasSubstr("#VRML V2.0 utf8\n"));
    EXPECT_THAT(text, HasSubstr("field SFFloat a 1\n"));
    EXPECT_THAT(text, HasSubstr("exposedField SFBool b TRUE\n"));
    EXPECT_THAT(text, HasSubstr("level ["));
    EXPECT_THAT(text, HasSubstr("choice ["));
    const Read r(text);
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.header.encoding, Encoding::vrml97);
}

TEST(Writer, NamesThatClassicCannotSpellAreChangedAlikeEverywhere) {
    Diagnostics complaints;
    const std::string text =
        rewrite("<X3D><Scene><Group DEF='a.b c'/><Group USE='a.b c'/><Group DEF='1'/><Group DEF='USE'/></Scene></X3D>",
                Encoding::classicVrml, &complaints);
    EXPECT_THAT(text, HasSubstr("DEF a_x002E_b_x0020_c Group {}\nUSE a_x002E_b_x0020_c\n"));
    EXPECT_THAT(text, HasSubstr("DEF _x0031_ Group"));
    EXPECT_THAT(text, HasSubstr("DEF _x0055_SE Group"));
    EXPECT_EQ(complaints.warnings(), 4u);
    const Read back(text);
    EXPECT_EQ(back.complaints(), "");
    EXPECT_EQ(back.handler.text(),
              "begin Group DEF a.b c\nend\nuse a.b c\nbegin Group DEF 1\nend\nbegin Group DEF "
              "USE\nend\n");
}

TEST(Writer, LongArraysAreBrokenIntoLines) {
    std::string points;
    for (int i = 0; i < 200; ++i) points += std::to_string(i) + " 0.5 -1e-3, ";
    const std::string wrapped =
        "<X3D><Scene><Shape><PointSet><Coordinate point='" + points + "'/></PointSet></Shape></Scene></X3D>";
    const Read original(wrapped);
    for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml}) {
        const std::string text = rewrite(wrapped, encoding);
        std::size_t longest = 0, start = 0;
        for (std::size_t end = text.find('\n'); end != text.npos; end = text.find('\n', start)) {
            longest = std::max(longest, end - start);
            start = end + 1;
        }
        EXPECT_LT(longest, 140u);
        EXPECT_EQ(Read(text).handler.text(), original.handler.text());
    }
}

/// Text before and behind a long list in open nodes waits with it.
TEST(Writer, LongListsStandWhereTheyWereGiven) {
    std::string points, indices;
    for (int i = 0; i < 5000; ++i) {
        points += std::to_string(i) + ".5 0 -1.25\n";
        indices += std::to_string(i) + ", ";
    }
    const std::string text =
        "#X3D V4.0 utf8\nPROFILE Full\nUNIT length foot 0.5\n"
        "Group { visible FALSE children [ DEF S Shape { geometry IndexedFaceSet { coordIndex [" +
        indices + "] coord Coordinate { point [" + points + "] } solid FALSE texCoordIndex [" + indices +
        "] ccw FALSE } } USE S ] bboxSize 1 2 3 }\n";
    Scene expected;
    Diagnostics problems;
    ASSERT_TRUE(loadText(expected, text, problems));
    for (const Encoding encoding : {Encoding::xml, Encoding::json, Encoding::classicVrml}) {
        Scene scene;
        ASSERT_TRUE(loadText(scene, rewrite(text, encoding), problems));
        EXPECT_EQ(scene.hash(), expected.hash());
        EXPECT_EQ(problems.all().size(), 0u) << problems.all()[0].format();
    }
    const std::string xml = rewrite(text, Encoding::xml), json = rewrite(text, Encoding::json);
    EXPECT_TRUE(xml.contains("<IndexedFaceSet coordIndex='0 1 2"));
    EXPECT_TRUE(xml.contains("4998 4999' solid='false' texCoordIndex='0 1"));
    EXPECT_TRUE(xml.contains("4998 4999' ccw='false'>"));
    EXPECT_TRUE(json.contains(R"({"IndexedFaceSet":{"@coordIndex":[0,1,2,)"));
    EXPECT_TRUE(json.contains(R"(,4998,4999],"@solid":false,"@texCoordIndex":[0,1,)"));
    EXPECT_TRUE(json.contains(R"(,4999],"@ccw":false,"-coord":{"Coordinate":{"@point":[0.5,0,-1.25,)"));
}

TEST(Writer, DeepNestingAndManySiblingsStayLinear) {
    // The written text's size stands for the work: indents that grow with the depth would make it quadratic.
    std::string text = "#X3D V4.0 utf8\nPROFILE Full\n";
    constexpr int depth = 100000;
    for (int i = 0; i < depth; ++i) text += "Group{children[";
    for (int i = 0; i < depth; ++i) text += "]}";
    for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml, Encoding::json}) {
        const std::string out = rewrite(text, encoding);
        EXPECT_LT(out.size(), 400u * depth);
        const Read again(out, true);
        EXPECT_EQ(again.handler.nodes, static_cast<std::size_t>(depth));
        EXPECT_EQ(again.handler.deepest, static_cast<std::size_t>(depth));
        EXPECT_EQ(again.complaints(), "");
    }
}

TEST(Writer, FilesByNamePlainAndGzip) {
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    const Read original(kEverything);
    for (const char* name : {"a.x3d", "a.x3dv", "a.x3dz", "a.json", "a.x3dvz", "a.x3d.gz"}) {
        Diagnostics diagnostics;
        auto file = DocumentFileWriter::create(folder / name, diagnostics);
        ASSERT_TRUE(file) << name;
        readDocument(kEverything, (*file)->handler(), diagnostics);
        EXPECT_TRUE((*file)->close());
        test::RecordingHandler handler;
        EXPECT_TRUE(readDocumentFile(folder / name, handler, diagnostics)) << name;
        const bool reordered = handler.header.encoding == Encoding::json;  // its attributes come first
        EXPECT_TRUE(reordered || handler.text() == original.handler.text()) << name;
        EXPECT_EQ(diagnostics.all().size(), 0u);
    }
    Diagnostics diagnostics;
    EXPECT_FALSE(DocumentFileWriter::create(folder / "a.obj", diagnostics));
    EXPECT_FALSE(DocumentFileWriter::create(folder / "no/such/folder/a.x3d", diagnostics));
}

}  // namespace
}  // namespace rtsg
