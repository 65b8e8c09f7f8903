// The ClassicVRML reader: what it makes of documents, as recorded commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "documents/reading.h"

namespace rtsg {
namespace {

using test::Read;
using test::readClassicScene;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ReaderClassic, HeaderStatements) {
    const Read r(
        "#X3D V3.3 utf8\nPROFILE Interchange COMPONENT DIS:2\nMETA \"title\" \"a \\\"b\\\"\" UNIT angle degree "
        "0.0175\n");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.header.version, "3.3");
    EXPECT_EQ(r.handler.header.profile, "Interchange");
    EXPECT_EQ(r.handler.header.encoding, Encoding::classicVrml);
    EXPECT_THAT(r.handler.lines, ElementsAre("component DIS 2", "meta title=a \"b\"", "unit angle degree 0.0175"));
}

TEST(ReaderClassic, NodesFieldsDefUse) {
    const Read r = readClassicScene(
        "DEF T Transform { translation 1 -2.5 .5e1 children [ Shape { geometry DEF B Box { size 1 2 3 } }, "
        "Shape { geometry USE B appearance NULL } ] } # done");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.text(),
              "begin Transform DEF T\nset translation SFVec3f 1 -2.5 5\nbegin Shape in children\n"
              "begin Box DEF B in geometry\nset size SFVec3f 1 2 3\nend\nend\nbegin Shape in children\n"
              "use B in geometry\nset appearance SFNode NULL\nend\nend\n");
}

TEST(ReaderClassic, PositionsCountLinesAndCodePoints) {
    const Read r("#X3D V4.0 utf8\r\nPROFILE Core\r\n  WorldInfo {\r\n title \"\xC3\xA4\" info \"x\" }");
    ASSERT_EQ(r.handler.lines.size(), 4u);
    EXPECT_EQ(r.handler.positions[0].line, 3u);
    EXPECT_EQ(r.handler.positions[0].column, 3u);
    EXPECT_EQ(r.handler.positions[2].line, 4u);
    EXPECT_EQ(r.handler.positions[2].column, 12u);
}

TEST(ReaderClassic, RoutesUseBareNamesInEverySpelling) {
    const Read r = readClassicScene(
        "DEF A Transform {} DEF B Transform {} DEF S TimeSensor {} DEF I PositionInterpolator {}\n"
        "ROUTE A.translation_changed TO B.set_translation ROUTE A.translation TO B.translation\n"
        "ROUTE S.fraction_changed TO I.set_fraction");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.lines, Contains("route A.translation B.translation").Times(2));
    EXPECT_THAT(r.handler.lines, Contains("route S.fraction_changed I.set_fraction"));
}

TEST(ReaderClassic, ProtoWithIsAndNodeDefaults) {
    const Read r = readClassicScene(
        "PROTO P [ initializeOnly SFVec3f at 1 2 3 inputOutput SFNode look Appearance {} inputOnly SFBool go\n"
        " initializeOnly MFNode kids [ ] ] { Transform { translation IS at children IS kids } } P { at 0 0 1 }");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.text(),
              "proto P\ndeclare initializeOnly SFVec3f at = 1 2 3\ndeclare inputOutput SFNode look\n"
              "begin Appearance in look\nend\ndeclare inputOnly SFBool go\ndeclare initializeOnly MFNode kids = []\n"
              "body\nbegin Transform\nis translation at\nis children kids\nend\nendproto\n"
              "begin P\nset at SFVec3f 0 0 1\nend\n");
}

TEST(ReaderClassic, ExternProtoImportExport) {
    const Read r = readClassicScene(
        "EXTERNPROTO E [ inputOutput SFColor c outputOnly SFTime t ] [ \"a.x3dv#E\" \"b.x3dv\" ]\n"
        "E { c 1 0 0 } DEF I Inline {} IMPORT I.far AS near IMPORT I.same EXPORT I AS out EXPORT I");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.lines,
                ElementsAre("externproto E [inputOutput SFColor c] [outputOnly SFTime t] 'a.x3dv#E' 'b.x3dv'",
                            "begin E", "set c SFColor 1 0 0", "end", "begin Inline DEF I", "end", "import I.far near",
                            "import I.same same", "export I out", "export I I"));
}

TEST(ReaderClassic, ScriptDeclaresFields) {
    const Read r = readClassicScene(
        "DEF T Transform {} Script { inputOnly SFTime go initializeOnly SFNode node USE T outputOnly MFVec3f out\n"
        " inputOutput SFString name \"x\" directOutput TRUE url \"ecmascript: f\" name \"y\" }");
    EXPECT_THAT(r.complaints(), HasSubstr("name of Script is given already"));
    EXPECT_EQ(r.diagnostics.errors(), 1u);
    EXPECT_THAT(r.handler.lines, Contains("use T in node"));
    EXPECT_THAT(r.handler.lines, Contains("declare outputOnly MFVec3f out"));
    EXPECT_THAT(r.handler.lines, Contains("declare inputOutput SFString name = \"x\""));
}

TEST(ReaderVrml97, OldKeywordsAndRenamedFields) {
    const Read r(
        "#VRML V2.0 utf8\nPROTO P [ field SFFloat a 1 eventIn SFBool b eventOut SFBool c exposedField SFInt32 d 0 ] "
        "{ Group {} }\nDEF L LOD { level [ Group {} ] range [ 5 ] } Switch { choice Group {} whichChoice 0 }\n"
        "Collision { collide FALSE }\nScript { eventIn SFBool x field SFNode n NULL }");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.header.encoding, Encoding::vrml97);
    EXPECT_THAT(r.handler.lines, Contains("declare inputOutput SFInt32 d = 0"));
    EXPECT_THAT(r.handler.lines, Contains("declare initializeOnly SFFloat a = 1"));
    EXPECT_THAT(r.handler.lines, Contains("begin Group in children").Times(2));
    EXPECT_THAT(r.handler.lines, Contains("set enabled SFBool FALSE"));
}

TEST(ReaderClassic, UnknownNodeAndFieldAreReportedAndTheRestKept) {
    const Read r = readClassicScene(
        "Foo { a [ 1 { \"}\" } ] # }\n } Transform { bogus 1 2 3 nope Shape { } wrong [ Box {} ] translation 1 2 3 "
        "scale TRUE rotation 0 1 0 1 addChildren Group {} center 4 5 6 } Group {}");
    EXPECT_EQ(r.diagnostics.errors(), 5u) << r.complaints();
    EXPECT_THAT(r.complaints(), HasSubstr("test.x3dv:3:1: warning: unknown node type Foo"));
    EXPECT_THAT(r.complaints(), HasSubstr("Transform has no field 'bogus'"));
    EXPECT_THAT(r.complaints(),
                HasSubstr("error: Transform has no field 'nope'; what is in it is kept under its name"));
    EXPECT_THAT(r.handler.lines, ElementsAre("begin Foo", "set a SFString \"1 { \\\"}\\\" }\"", "end",
                                             "begin Transform", "begin Shape in nope", "end", "begin Box in wrong",
                                             "end", "set translation SFVec3f 1 2 3", "set rotation SFRotation 0 1 0 1",
                                             "set center SFVec3f 4 5 6", "end", "begin Group", "end"));
}

}  // namespace
}  // namespace rtsg
