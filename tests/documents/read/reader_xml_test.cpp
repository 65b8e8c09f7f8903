// The XML reader: what it makes of documents, as recorded commands.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "documents/reading.h"

namespace rtsg {
namespace {

using test::Read;
using test::readXmlScene;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ReaderXml, HeadAndScene) {
    const Read r(
        "<?xml version='1.0' encoding='UTF-8'?>\n"
        "<!DOCTYPE X3D PUBLIC 'ISO//Web3D//DTD X3D 3.3//EN' 'http://www.web3d.org/specifications/x3d-3.3.dtd'>\n"
        "<X3D profile='Immersive' version='3.3' xmlns:xsd='http://www.w3.org/2001/XMLSchema-instance' "
        "xsd:noNamespaceSchemaLocation='x'><head><component name='DIS' level='2'/><unit category='angle' name='degree' "
        "conversionFactor='0.0175'/><meta name='title' content='a "
        "&quot;b&quot;'/></head><Scene><Group/></Scene></X3D>");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.header.profile, "Immersive");
    EXPECT_EQ(r.handler.header.version, "3.3");
    EXPECT_EQ(r.handler.header.encoding, Encoding::xml);
    EXPECT_THAT(r.handler.lines,
                ElementsAre("component DIS 2", "unit angle degree 0.0175", "meta title=a \"b\"", "begin Group", "end"));
}

TEST(ReaderXml, ContainerFieldDefaultsByNodeAndParent) {
    const Read r = readXmlScene(
        "<Shape><Appearance><Material/><Material containerField='backMaterial'/><ImageTexture/><TextureTransform/>"
        "</Appearance><IndexedFaceSet><Coordinate/><Normal/><MetadataString/></IndexedFaceSet></Shape>"
        "<Collision><Box containerField='proxy'/><Box/></Collision>");
    EXPECT_THAT(r.handler.lines,
                ElementsAre("begin Shape", "begin Appearance in appearance", "begin Material in material", "end",
                            "begin Material in backMaterial", "end", "begin ImageTexture in texture", "end",
                            "begin TextureTransform in textureTransform", "end", "end",
                            "begin IndexedFaceSet in geometry", "begin Coordinate in coord", "end",
                            "begin Normal in normal", "end", "begin MetadataString in metadata", "end", "end", "end",
                            "begin Collision", "begin Box in proxy", "end", "begin Box in geometry", "end", "end"));
    EXPECT_THAT(r.complaints(), HasSubstr("field 'proxy' of Collision does not take Box"));
    EXPECT_THAT(r.complaints(), HasSubstr("field 'geometry' of Collision does not take Box"));
    EXPECT_EQ(r.diagnostics.warnings(), 2u) << r.complaints();
}

TEST(ReaderXml, ChildWhoseDefaultFieldIsMissingGoesWhereItFits) {
    // MovieTexture's default is texture; AudioClip's is children in 4.0: a Sound has only `source`.
    const Read r = readXmlScene("<Sound><AudioClip/></Sound><Shape><Box containerField='shape'/></Shape>");
    EXPECT_THAT(r.handler.lines, Contains("begin AudioClip in source"));
    EXPECT_THAT(r.handler.lines, Contains("begin Box in geometry"));
    EXPECT_EQ(r.diagnostics.errors(), 0u) << r.complaints();
    EXPECT_THAT(r.complaints(), HasSubstr("containerField: Shape has no field 'shape'; 'geometry' is taken instead"));
}

TEST(ReaderXml, MFStringQuotingAndTheLoneString) {
    const Read r = readXmlScene(
        "<WorldInfo title='say &quot;hi&quot; \\\"x\\\"' info='\"a \\\"q\\\"\" \"b\\\\c\" &quot;d&quot;,\"\"'/>"
        "<WorldInfo info='just one, not two'/><WorldInfo info=''/>");
    EXPECT_EQ(r.diagnostics.errors(), 0u);
    EXPECT_THAT(r.complaints(), HasSubstr("the strings of a list stand in double quotes"));
    EXPECT_THAT(r.handler.lines, Contains(R"(set title SFString "say \"hi\" \"x\"")"));
    EXPECT_THAT(r.handler.lines, Contains(R"(set info MFString ["a \"q\"", "b\\c", "d", ""])"));
    EXPECT_THAT(r.handler.lines, Contains(R"(set info MFString ["just one, not two"])"));
    EXPECT_THAT(r.handler.lines, Contains("set info MFString []"));
}

TEST(ReaderXml, ImagesHexCommasAsSpaceBooleans) {
    const Read r = readXmlScene(
        "<PixelTexture image='2 1 4 0xFF00FF80, 255' repeatS='false'/>"
        "<Coordinate point='0 0 0, 1 2 3,,4 5 6 ,'/>");
    EXPECT_THAT(r.handler.lines, Contains("set image SFImage 2 1 4 0xff00ff80 0xff"));
    EXPECT_THAT(r.handler.lines, Contains("set repeatS SFBool FALSE"));
    EXPECT_THAT(r.handler.lines, Contains("set point MFVec3f [0 0 0, 1 2 3, 4 5 6]"));
}

TEST(ReaderXml, Prototypes) {
    const Read r = readXmlScene(
        "<ProtoDeclare name='P'><ProtoInterface><field name='look' type='SFNode' accessType='inputOutput'><Appearance/>"
        "</field><field name='kids' type='MFNode' accessType='initializeOnly'/><field name='at' type='SFVec3f' "
        "accessType='inputOutput' value='1 2 3'/><field name='go' type='SFBool' accessType='inputOnly'/>"
        "</ProtoInterface><ProtoBody><Transform><IS><connect nodeField='translation' protoField='at'/></IS></Transform>"
        "</ProtoBody></ProtoDeclare><ProtoInstance name='P' DEF='I'><fieldValue name='at' value='0 0 1'/>"
        "<fieldValue name='kids'><Group/><Group/></fieldValue><fieldValue name='look'/></ProtoInstance>"
        "<ExternProtoDeclare name='E' url='\"a.x3d#E\" \"b.x3d\"'><field name='c' type='SFColor' "
        "accessType='exposedField'/></ExternProtoDeclare><ProtoInstance name='E'/>");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.text(),
              "proto P\ndeclare inputOutput SFNode look\nbegin Appearance in look\nend\n"
              "declare initializeOnly MFNode kids = []\ndeclare inputOutput SFVec3f at = 1 2 3\n"
              "declare inputOnly SFBool go\nbody\nbegin Transform\nis translation at\nend\nendproto\nbegin P DEF I\n"
              "set at SFVec3f 0 0 1\nbegin Group in kids\nend\nbegin Group in kids\nend\nset look SFNode NULL\nend\n"
              "externproto E [inputOutput SFColor c] 'a.x3d#E' 'b.x3d'\nbegin E\nend\n");
}

TEST(ReaderXml, InstanceStandsWhereItsFirstBodyNodeWould) {
    const Read r = readXmlScene(
        "<ProtoDeclare name='M'><ProtoBody><Material/><Group/></ProtoBody></ProtoDeclare>"
        "<Shape><Appearance><ProtoInstance name='M'/></Appearance></Shape>");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.lines, Contains("begin M in material"));
}

TEST(ReaderXml, ScriptFieldsSourceAndIs) {
    const Read r = readXmlScene(
        "<ProtoDeclare name='P'><ProtoInterface><field name='n' type='SFFloat' accessType='inputOutput' value='1'/>"
        "</ProtoInterface><ProtoBody><Script DEF='S' directOutput='true' url='\"a.js\"'>"
        "<IS><connect nodeField='n' protoField='n'/></IS>"
        "<field name='n' type='SFFloat' accessType='inputOutput'/><field name='go' type='SFTime' "
        "accessType='inputOnly'/>"
        "<field name='t' type='SFNode' accessType='initializeOnly'><Transform USE='T'/></field>\n"
        "<![CDATA[\n  ecmascript: if (a < b && c) \"x\";\n]]></Script></ProtoBody></ProtoDeclare>"
        "<Script><![CDATA[var x = a[b[0]]]]><![CDATA[>1;]]></Script>");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.lines,
                ElementsAre("proto P", "declare inputOutput SFFloat n = 1", "body", "begin Script DEF S",
                            "set directOutput SFBool TRUE", "declare inputOutput SFFloat n", "is n n",
                            "declare inputOnly SFTime go", "declare initializeOnly SFNode t", "use T in t",
                            "set url MFString [\"a.js\", \"ecmascript: if (a < b && c) \\\"x\\\";\n\"]", "end",
                            "endproto", "begin Script", "set url MFString [\"ecmascript:var x = a[b[0]]>1;\"]", "end"));
}

TEST(ReaderXml, AnIsBeforeOrBehindTheFieldsItConnectsReadsAlike) {
    const auto script = [](const std::string& first, const std::string& last) {
        return "<ProtoDeclare name='P'><ProtoInterface><field name='a' type='SFFloat' accessType='inputOutput' "
               "value='1'/><field name='g' type='SFNode' accessType='inputOutput'/><field name='u' type='MFString' "
               "accessType='inputOutput'/></ProtoInterface><ProtoBody><Script DEF='S'>" +
               first +
               "<field name='a' type='SFFloat' accessType='inputOutput' value='2'/>"
               "<!-- said --><field name='none' type='SFNode' accessType='inputOutput'/>"
               "<field name='kids' type='MFNode' accessType='inputOutput'><Group DEF='G'/><Script>" +
               first + "<field name='a' type='SFFloat' accessType='inputOutput' value='3'/>" + last +
               "</Script></field><field name='b' type='SFBool' accessType='inputOnly'/>" + last +
               "<![CDATA[ecmascript:\nf();]]></Script><Group/></ProtoBody></ProtoDeclare>"
               "<Script><field name='a' type='SFFloat' accessType='inputOutput' value='4'/></Script>";
    };
    const std::string is =
        "<IS><connect nodeField='a' protoField='a'/><connect nodeField='set_none' protoField='g'/></IS>";
    const std::string known = "<IS><connect nodeField='a' protoField='a'/></IS>";
    const Read before = readXmlScene(script(known, "")), behind = readXmlScene(script("", known));
    EXPECT_EQ(before.complaints(), "");
    EXPECT_EQ(behind.complaints(), "");
    EXPECT_THAT(
        behind.handler.lines,
        ElementsAre("proto P", "declare inputOutput SFFloat a = 1", "declare inputOutput SFNode g = NULL",
                    "declare inputOutput MFString u = []", "body", "begin Script DEF S",
                    "declare inputOutput SFFloat a", "is a a", "declare inputOutput SFNode none = NULL",
                    "declare inputOutput MFNode kids", "begin Group DEF G in kids", "end", "begin Script in kids",
                    "declare inputOutput SFFloat a", "is a a", "end", "declare inputOnly SFBool b",
                    "set url MFString [\"ecmascript:\nf();\"]", "end", "begin Group", "end", "endproto", "begin Script",
                    "declare inputOutput SFFloat a = 4", "end"));
    EXPECT_EQ(before.handler.text(), behind.handler.text());
    // A value for a node, by the name of its event.
    const Read node = readXmlScene(
        "<ProtoDeclare name='P'><ProtoInterface><field name='a' type='SFFloat' "
        "accessType='inputOutput'/><field name='g' type='SFNode' accessType='inputOutput'/>"
        "</ProtoInterface><ProtoBody><Script>" +
        is +
        "<field name='none' type='SFNode' accessType='inputOutput'/><field name='a' "
        "type='SFFloat' accessType='inputOutput'/></Script></ProtoBody></ProtoDeclare>");
    EXPECT_EQ(node.complaints(), "");
    EXPECT_THAT(node.handler.lines, testing::IsSupersetOf({"declare inputOutput SFNode none", "is none g",
                                                           "declare inputOutput SFFloat a", "is a a"}));
}

TEST(ReaderXml, RoutesImportsExports) {
    const Read r = readXmlScene(
        "<Transform DEF='A'/><Transform DEF='B'/><ROUTE fromNode='A' fromField='translation_changed' toNode='B' "
        "toField='set_translation'/><Inline DEF='I'/><IMPORT inlineDEF='I' importedDEF='far' AS='near'/>"
        "<IMPORT inlineDEF='I' exportedDEF='old'/><EXPORT localDEF='A' AS='out'/><EXPORT localDEF='B'/>");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.lines, Contains("route A.translation B.translation"));
    EXPECT_THAT(r.handler.lines, Contains("import I.far near"));
    EXPECT_THAT(r.handler.lines, Contains("import I.old old"));
    EXPECT_THAT(r.handler.lines, Contains("export A out"));
    EXPECT_THAT(r.handler.lines, Contains("export B B"));
}

TEST(ReaderXml, ComplaintsPointIntoTheAttribute) {
    const Read r = readXmlScene("<Transform\n translation='1 2 3'\n scale='1 &lt;x 3'\n rotation='0 1 0 1'/>");
    EXPECT_EQ(r.complaints(), "test.x3d:3:11: error: scale: expected 3 numbers (SFVec3f), found '<x' [parse]\n");
    EXPECT_THAT(r.handler.lines, Contains("set rotation SFRotation 0 1 0 1"));
}

TEST(ReaderXml, UnknownNodesAndFieldsAreReportedAndTheRestKept) {
    const Read r = readXmlScene(
        "<Foo><Bar/><Group/></Foo><Transform bogus='1' addChildren='x' children='' scale='true' translation='1 2 3'>"
        "<Nope/></Transform><ProtoInstance name='Missing'><fieldValue name='a' value='b'/></ProtoInstance><Group/>");
    EXPECT_THAT(r.handler.lines, ElementsAre("begin Foo", "begin Bar in children", "end", "begin Group in children",
                                             "end", "end", "begin Transform", "set translation SFVec3f 1 2 3",
                                             "begin Nope in children", "end", "end", "begin Group", "end"));
    EXPECT_EQ(r.diagnostics.errors(), 5u) << r.complaints();
    EXPECT_EQ(r.diagnostics.warnings(), 3u) << r.complaints();
    EXPECT_THAT(r.complaints(), HasSubstr("unknown node type Foo"));
    EXPECT_THAT(r.complaints(), HasSubstr("there is no PROTO Missing"));
}

TEST(ReaderXml, ProtoNamedLikeABuiltInNodeIsNotMeantByItsElement) {
    const Read r = readXmlScene(
        "<ProtoDeclare name='Box'><ProtoInterface><field name='q' type='SFBool' accessType='inputOutput' value='true'/>"
        "</ProtoInterface><ProtoBody><Sphere/></ProtoBody></ProtoDeclare><Shape><Box size='1 1 1'/></Shape>");
    EXPECT_EQ(r.diagnostics.errors(), 0u) << r.complaints();
    EXPECT_EQ(r.diagnostics.warnings(), 1u) << r.complaints();
    EXPECT_THAT(r.handler.text(), testing::StartsWith("proto Box_\n"));
    EXPECT_THAT(r.handler.text(),
                testing::EndsWith("begin Shape\nbegin Box in geometry\nset size SFVec3f 1 1 1\nend\nend\n"));
}

TEST(ReaderXml, MalformedXmlKeepsWhatCameBefore) {
    const Read r("<X3D version='4.0'><Scene><Group><Transform/><Shape></Group></Scene></X3D>");
    EXPECT_FALSE(r.usable);
    EXPECT_TRUE(r.handler.complete());
    EXPECT_THAT(r.complaints(), HasSubstr("1:55: error: not well-formed XML: mismatched tag"));
    EXPECT_THAT(r.handler.lines, ElementsAre("begin Group", "begin Transform in children", "end",
                                             "begin Shape in children", "end", "end"));
}

TEST(ReaderXml, EntitiesOfTheDocumentAreExpandedAndThoseOfOtherFilesNeverOpened) {
    const Read r(
        "<!DOCTYPE X3D [<!ENTITY red '1 0 0'><!ENTITY passwords SYSTEM '/etc/passwd'>]><X3D><Scene>"
        "<Material diffuseColor='&red;'/><WorldInfo>&passwords;</WorldInfo></Scene></X3D>");
    EXPECT_THAT(r.handler.lines, Contains("set diffuseColor SFColor 1 0 0"));
    EXPECT_THAT(r.complaints(), HasSubstr("the entity passwords is in another file, which is not opened"));
    EXPECT_EQ(r.complaints().find("root"), std::string::npos);
}

TEST(ReaderXml, EntitiesThatGrowWithoutEndAreStopped) {
    std::string text = "<!DOCTYPE X3D [<!ENTITY a0 'ha'>";
    for (int i = 1; i < 30; ++i)
        text +=
            "<!ENTITY a" + std::to_string(i) + " '&a" + std::to_string(i - 1) + ";&a" + std::to_string(i - 1) + ";'>";
    const Read r(text + "]><X3D><Scene><WorldInfo title='&a29;'/></Scene></X3D>");
    EXPECT_FALSE(r.usable);
    EXPECT_THAT(r.complaints(), HasSubstr("limit on input amplification"));
    EXPECT_TRUE(r.handler.lines.empty());
}

std::string entityName(int number) {
    return "e" + std::to_string(number);
}
/// `count` entities that each name one other: the one before, or the one behind.
std::string entityChain(int count, bool backwards) {
    std::string text = "<!DOCTYPE X3D [\n";
    for (int i = 0; i <= count; ++i) {
        const int named = backwards ? i - 1 : i + 1;
        const bool isLast = backwards ? i == 0 : i == count;
        text += "<!ENTITY " + entityName(i) + " \"" + (isLast ? "x" : "&" + entityName(named) + ";") + "\">\n";
    }
    return text + "]><X3D><Scene><WorldInfo title='&" + entityName(backwards ? count : 0) + ";'/></Scene></X3D>";
}

// Expat follows them by recursion: a chain of 60,000 is deeper than the stack.
TEST(ReaderXml, EntitiesNestToABoundInAnyOrder) {
    for (const bool backwards : {true, false}) {
        const Read good(entityChain(32, backwards));
        EXPECT_EQ(good.complaints(), "");
        EXPECT_THAT(good.handler.lines, Contains("set title SFString \"x\""));
        for (const int count : {33, 60'000}) {
            const Read bad(entityChain(count, backwards));
            EXPECT_FALSE(bad.usable);
            // In the line of the entity that makes one too deep.
            EXPECT_EQ(bad.complaints().find(backwards ? "test.x3d:35:" : "test.x3d:34:"), 0u) << bad.complaints();
            EXPECT_THAT(bad.complaints(), HasSubstr("error: entities stand more than 32 deep within each other"));
            EXPECT_EQ(bad.diagnostics.errors(), 1u) << bad.complaints();
        }
    }
    const Read circle("<!DOCTYPE X3D [<!ENTITY a '&b;'><!ENTITY b '&a;'>]><X3D><Scene><Group/></Scene></X3D>");
    EXPECT_THAT(circle.complaints(), HasSubstr("entities stand more than 32 deep"));
}

TEST(ReaderXml, DeclarationsOfADocumentTypeAreCounted) {
    const auto declared = [](int entities, int attributes) {
        std::string text = "<!DOCTYPE X3D [";
        for (int i = 0; i < entities; ++i) text += "<!ENTITY " + entityName(i) + " 'x'>";
        for (int i = 0; i < attributes; ++i) text += "<!ATTLIST Group a" + std::to_string(i) + " CDATA 'x'>";
        return Read(text + "]><X3D><Scene><Group/></Scene></X3D>").complaints();
    };
    EXPECT_EQ(declared(10'000, 1000), "");
    EXPECT_THAT(declared(10'001, 0), HasSubstr("declares more than 10000 entities; reading ends here"));
    EXPECT_THAT(declared(0, 1001), HasSubstr("declares more than 1000 attributes; reading ends here"));
}

TEST(ReaderXml, FaultsOfManyAttributesStandEachInItsOwnPlace) {
    std::string text = "<X3D><Scene>\n<Group";
    for (int i = 0; i < 40; ++i) text += "\n  a" + std::to_string(i) + " = '>' b" + std::to_string(i) + "=\"='\"";
    const Read r(text + "/>\n<Transform a1='x'\n translation='1 0 x'/></Scene></X3D>");
    for (int i = 0; i < 40; ++i) {
        const std::string line = "test.x3d:" + std::to_string(3 + i) + ":", name = std::to_string(i);
        const auto column = [&](std::size_t before) { return std::to_string(before + 2 * name.size()); };
        EXPECT_THAT(r.complaints(),
                    HasSubstr(line + std::to_string(8 + name.size()) + ": error: Group has no field 'a" + name + "'"));
        EXPECT_THAT(r.complaints(), HasSubstr(line + column(14) + ": error: Group has no field 'b" + name + "'"));
    }
    EXPECT_THAT(r.complaints(), HasSubstr("test.x3d:43:16: error: Transform has no field 'a1'"));
    EXPECT_THAT(r.complaints(), HasSubstr("test.x3d:44:19: error: translation:"));
}

TEST(ReaderXml, Utf16AndLatin1AreConverted) {
    const Read latin("<?xml version='1.0' encoding='ISO-8859-1'?><X3D><Scene><WorldInfo title='\xE4'/></Scene></X3D>");
    EXPECT_EQ(latin.complaints(), "");
    EXPECT_THAT(latin.handler.lines, Contains("set title SFString \"\xC3\xA4\""));
    std::string wide("\xFF\xFE", 2);
    for (const char c : std::string("<X3D><Scene><Group/></Scene></X3D>")) wide += {c, '\0'};
    const Read utf16(wide);
    EXPECT_EQ(utf16.complaints(), "");
    EXPECT_THAT(utf16.handler.lines, ElementsAre("begin Group", "end"));
    // The other encodings have one, and are not taken for faulty XML.
    for (const char* text : {"#X3D V3.0 utf8\nGroup { }", " {\"X3D\":{}}"}) {
        std::string other("\xFF\xFE", 2);
        for (const char* c = text; *c; ++c) other += {*c, '\0'};
        EXPECT_THAT(Read(other).complaints(), testing::HasSubstr("ClassicVRML or JSON in UTF-16"));
    }
}

// The declaration has no other field in which a second node could be kept.
TEST(ReaderXml, ADeclaredFieldOfOneNodeTakesTheFirst) {
    for (const char* type : {"SFNode", "MFNode"}) {
        const std::string field = std::string("<field name='n' accessType='inputOutput' type='") + type +
                                  "'><Group DEF='A'/><Transform><Shape/></Transform></field>";
        const Read read("<X3D><Scene><ProtoDeclare name='P'><ProtoInterface>" + field +
                        "</ProtoInterface><ProtoBody><Group/></ProtoBody></ProtoDeclare><Script>" + field +
                        "</Script></Scene></X3D>");
        const bool one = type[0] == 'S';
        EXPECT_EQ(read.complaints().find("field 'n' takes one node, and is given one already; this one is left out") !=
                      std::string::npos,
                  one);
        EXPECT_EQ(read.diagnostics.errors(), one ? 2u : 0u);
        EXPECT_EQ(std::ranges::count_if(read.handler.lines,
                                        [](const std::string& line) { return line.starts_with("begin Transform"); }),
                  one ? 0 : 2);
        EXPECT_TRUE(read.handler.violation.empty());
    }
}

// HTML gives "style" to every element; two nodes of X3D have a field of that name.
TEST(ReaderXml, StyleIsAFieldWhereTheNodeHasOne) {
    const Read read(
        "<X3D><Scene><Shape style='color:red' class='a' id='b'><Text><FontStyle style='BOLD'/></Text></Shape>"
        "</Scene></X3D>");
    EXPECT_EQ(read.complaints(), "");
    EXPECT_THAT(read.handler.lines, ElementsAre("begin Shape", "begin Text in geometry", "begin FontStyle in fontStyle",
                                                "set style SFString \"BOLD\"", "end", "end", "end"));
}

}  // namespace
}  // namespace rtsg
