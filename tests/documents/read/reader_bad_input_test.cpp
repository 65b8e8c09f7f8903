// Broken input: always a diagnostic, always an end, always nested commands, and the rest of the file kept.
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/writer.h>

#include "documents/reading.h"

namespace rtsg {
namespace {

using test::Read;
using test::readClassicScene;
using test::readXmlScene;
using testing::Contains;
using testing::HasSubstr;

std::vector<std::string> smallDocuments() {
    return {
        "#X3D V4.0 utf8\nPROFILE Immersive COMPONENT Text:1 META \"a\" \"b\" UNIT length m 2\n"
        "PROTO P [ inputOutput SFNode n Group {} initializeOnly MFString s [ \"x\" ] inputOnly SFBool i ] "
        "{ Transform { translation 1 2 3 children IS n } PROTO Q [] { Group {} } Q {} }\n"
        "EXTERNPROTO E [ inputOnly SFTime t ] \"e.x3dv\" DEF A P { n DEF B Shape { geometry Box {} } }\n"
        "DEF S Script { inputOnly SFTime t initializeOnly SFImage im 1 1 3 0xff url \"ecmascript: 1\" }\n"
        "Group { children [ USE A Group { } ] # x\n } DEF I Inline {} IMPORT I.a AS b EXPORT A AS c ROUTE A.n TO B.x",
        "#VRML V2.0 utf8\nDEF T Transform { rotation 0 1 0 3.14 children [ LOD { level [ Group {} ] range 5.5e1 } ] }\n"
        "PROTO X [ field SFColor c 1 0 0 exposedField MFNode k [] ] { Switch { choice [] } } X { c 0 0 0 }",
        "<?xml version='1.0'?><!DOCTYPE X3D PUBLIC 'x' 'y'><X3D profile='Full' version='4.0'><head><component "
        "name='Text' "
        "level='1'/><unit category='a' name='b' conversionFactor='2'/><meta name='a' content='b'/></head><Scene><!-- c "
        "-->"
        "<ProtoDeclare name='P'><ProtoInterface><field name='n' type='SFNode' accessType='inputOutput'><Group/></field>"
        "</ProtoInterface><ProtoBody><Transform><IS><connect nodeField='children' protoField='n'/></IS></Transform>"
        "</ProtoBody></ProtoDeclare><ProtoInstance name='P'><fieldValue name='n'><Shape><Box/></Shape></fieldValue>"
        "</ProtoInstance><Script DEF='S'><field name='t' type='SFTime' accessType='inputOnly'/><![CDATA[x]]></Script>"
        "<ExternProtoDeclare name='E' url='\"u\"'/><ROUTE fromNode='S' fromField='t' toNode='S' "
        "toField='t'/></Scene></X3D>",
        R"({"X3D":{"@version":"4.0","head":{"meta":[{"@name":"a","@content":"b"}]},"Scene":{"-children":[{"Script":)"
        R"({"@DEF":"S","field":[{"@name":"t","@type":"SFTime","@accessType":"inputOnly"}],"#sourceCode":["a","b"]}},)"
        R"({"ProtoDeclare":{"@name":"P","ProtoInterface":{"field":[{"@name":"n","@type":"SFNode","@accessType":)"
        R"("inputOutput","-children":[{"Group":{}}]}]},"ProtoBody":{"-children":[{"Group":{"IS":{"connect":[)"
        R"({"@nodeField":"children","@protoField":"n"}]}}}]}}},{"ProtoInstance":{"@name":"P","fieldValue":[)"
        R"({"@name":"n","-children":[{"Shape":{"-geometry":{"Box":{"@size":[1,2,3]}}}}]}]}},{"WorldInfo":)"
        R"({"@title":"\u00e4\"x","@info":["y","z"]}}]}}})",
    };
}

TEST(BadInput, TruncatedAnywhereEndsWithWhatWasComplete) {
    for (const std::string& document : smallDocuments()) {
        const Read whole(document);
        EXPECT_EQ(whole.complaints(), "");
        std::size_t silent = 0;
        for (std::size_t size = 0; size < document.size(); ++size) {
            const Read part(document.substr(0, size), true);
            if (part.diagnostics.all().empty()) ++silent;
            EXPECT_LE(part.handler.nodes, whole.handler.nodes) << size;
        }
        // A ClassicVRML text cut between two statements is a whole text; XML and JSON cut anywhere are not.
        if (const Encoding e = detectEncoding(document); e == Encoding::xml || e == Encoding::json)
            EXPECT_EQ(silent, 0u);
        else
            EXPECT_LT(silent, document.size() / 2);
    }
}

TEST(BadInput, TruncatedAnywhereThroughTheWritersToo) {
    for (const std::string& document : smallDocuments()) {
        for (std::size_t size = 0; size < document.size(); size += 3) {
            for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml, Encoding::vrml97, Encoding::json}) {
                Diagnostics diagnostics;
                std::string text;
                const auto writer = makeWriter(encoding, [&](std::string_view t) { text += t; }, diagnostics);
                if (!readDocument(document.substr(0, size), *writer, diagnostics) && text.empty()) continue;
                const Read again(text);
                EXPECT_EQ(again.diagnostics.errors(), 0u) << again.complaints() << text;
            }
        }
    }
}

TEST(BadInput, RandomDamageEnds) {
    constexpr unsigned seed = 99;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    constexpr std::string_view bytes = "{}[]\"#\\.,<>&;'/= \n\0aZ0-+eISUSEDEF\xFF\xC3";
    for (const std::string& document : smallDocuments()) {
        for (int i = 0; i < 3000; ++i) {
            std::string damaged = document;
            for (auto n = random() % 4 + 1; n > 0; --n) {
                const std::size_t at = 15 + random() % (damaged.size() - 15);
                switch (random() % 3) {
                    case 0:
                        damaged[at] = bytes[random() % bytes.size()];
                        break;
                    case 1:
                        damaged.erase(at, random() % 20);
                        break;
                    default:
                        damaged.insert(at, 1, bytes[random() % bytes.size()]);
                }
            }
            const Read r(damaged, true);  // checks the contract of commands
        }
    }
}

TEST(BadInput, HundredThousandSiblingsAndLevelsAreRead) {
    constexpr std::size_t many = 100000;
    std::string siblings = "#X3D V4.0 utf8\nPROFILE Full\nGroup { children [\n", xml = "<X3D><Scene><Group>";
    for (std::size_t i = 0; i < many; ++i) {
        siblings += "DEF N" + std::to_string(i) + " Shape { geometry Box {} }\n";
        xml += "<Shape DEF='N" + std::to_string(i) + "'><Box/></Shape>";
    }
    const Read a(siblings + "] }", true);
    EXPECT_EQ(a.handler.nodes, 2 * many + 1);
    EXPECT_EQ(a.complaints(), "");
    const Read b(xml + "</Group></Scene></X3D>", true);
    EXPECT_EQ(b.handler.nodes, 2 * many + 1);
    EXPECT_EQ(b.complaints(), "");
}

std::string repeated(std::string_view text, std::size_t count) {
    std::string all;
    for (std::size_t i = 0; i < count; ++i) all += text;
    return all;
}

TEST(BadInput, DeepNestingOfEveryKind) {
    constexpr std::size_t deep = 100000;
    const Read nodes = readClassicScene(repeated("Group{children ", deep) + "Group{}" + repeated("}", deep), true);
    EXPECT_EQ(nodes.handler.nodes, deep + 1);
    EXPECT_EQ(nodes.complaints(), "");
    const Read open = readClassicScene(repeated("Group{children[", deep), true);
    EXPECT_EQ(open.handler.nodes, deep);
    EXPECT_EQ(open.diagnostics.errors(), 1u);
    const Read protos = readClassicScene(repeated("PROTO P[]{", deep), true);
    EXPECT_EQ(protos.diagnostics.errors(), 1u);
    const Read unknown = readClassicScene(repeated("X{a[", deep), true);
    EXPECT_EQ(unknown.handler.nodes, deep);
    EXPECT_EQ(unknown.diagnostics.warnings(), deep);
    const Read brackets = readClassicScene(repeated("Group{children ", deep) + repeated("]", deep), true);
    EXPECT_GE(brackets.diagnostics.errors(), deep);
    const Read xml = readXmlScene(repeated("<Group>", deep) + repeated("</Group>", deep), true);
    EXPECT_EQ(xml.handler.nodes, deep);
    EXPECT_EQ(xml.complaints(), "");
    const Read xmlOpen("<X3D><Scene>" + repeated("<Group>", deep), true);
    EXPECT_EQ(xmlOpen.handler.nodes, deep);
    const Read xmlUnknown = readXmlScene(repeated("<x>", deep) + repeated("</x>", deep) + "<Group/>", true);
    EXPECT_EQ(xmlUnknown.handler.nodes, deep + 1);
}

TEST(BadInput, UnbalancedBracketsKeepTheRest) {
    const Read missingBrace = readClassicScene("Transform { children [ Shape { geometry Box {} ] } DEF After Group {}");
    EXPECT_EQ(missingBrace.diagnostics.errors(), 1u) << missingBrace.complaints();
    EXPECT_THAT(missingBrace.handler.lines, Contains("begin Group DEF After"));
    const Read missingBracket = readClassicScene("Transform { children [ Shape {} } DEF After Group {}");
    EXPECT_EQ(missingBracket.diagnostics.errors(), 1u) << missingBracket.complaints();
    EXPECT_THAT(missingBracket.handler.lines, Contains("begin Group DEF After"));
    const Read extra = readClassicScene("Group {} } ] ) DEF After Group {}");
    EXPECT_EQ(extra.diagnostics.errors(), 3u) << extra.complaints();
    EXPECT_THAT(extra.handler.lines, Contains("begin Group DEF After"));
    const Read openArray =
        readClassicScene("Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 solid FALSE } } Group {}");
    EXPECT_EQ(openArray.diagnostics.errors(), 1u) << openArray.complaints();
    EXPECT_THAT(openArray.handler.lines, Contains("set coordIndex MFInt32 [0, 1, 2, -1]"));
    EXPECT_THAT(openArray.handler.lines, Contains("set solid SFBool FALSE"));
}

TEST(BadInput, NumbersThatAreNone) {
    const Read r = readClassicScene(
        "Coordinate { point [ 0 0 0, nan 1 1e39, 2 2 2 ] } Material { shininess nan transparency 0.5 }\n"
        "IndexedFaceSet { coordIndex [ 0 99999999999 2000000000 -1 ] creaseAngle 1e40 }\n"
        "Coordinate { point [ 0 0 0 1 1 ] } Coordinate { point [ 1 2 3 x 4 ] } Coordinate { point [ 5 5 5 ] }");
    EXPECT_THAT(r.handler.lines, Contains("set point MFVec3f [0 0 0, 0 1 0, 2 2 2]"));
    EXPECT_THAT(r.handler.lines, Contains("set transparency SFFloat 0.5"));
    EXPECT_THAT(r.handler.text(), testing::Not(HasSubstr("shininess")));
    EXPECT_THAT(r.handler.text(), testing::Not(HasSubstr("creaseAngle")));
    EXPECT_THAT(r.handler.lines, Contains("set coordIndex MFInt32 [0, 0, 2000000000, -1]"));
    EXPECT_THAT(r.handler.lines, Contains("set point MFVec3f [0 0 0]"));
    EXPECT_THAT(r.handler.lines, Contains("set point MFVec3f [1 2 3]"));
    EXPECT_THAT(r.handler.lines, Contains("set point MFVec3f [5 5 5]"));
    EXPECT_EQ(r.diagnostics.errors(), 6u) << r.complaints();
}

TEST(BadInput, OutOfRangeIsAWarningAndKept) {
    const Read r = readClassicScene(
        "Material { transparency 1.5 diffuseColor 2 0 0 } Fog { fogType \"DENSE\" } Transform { rotation 1 1 0 1 }\n"
        "Transform { rotation 0 0 0 1 } Material { ambientIntensity -1 }");
    EXPECT_EQ(r.diagnostics.errors(), 0u) << r.complaints();
    EXPECT_EQ(r.diagnostics.warnings(), 6u) << r.complaints();
    EXPECT_THAT(r.complaints(), HasSubstr("test.x3dv:3:25: warning: 1.5 is outside the range [0, 1] of transparency"));
    EXPECT_THAT(r.handler.lines, Contains("set transparency SFFloat 1.5"));
    EXPECT_THAT(r.handler.lines, Contains("set rotation SFRotation 0 0 0 1"));
}

// A colour above 1 is a lamp; other colours are shares of light, and none is negative.
TEST(BadInput, LampsMayShineBeyondTheRange) {
    const Read lamp = readClassicScene(
        "Material { emissiveColor 8 8 8 } UnlitMaterial { emissiveColor 0 0 2 } PhysicalMaterial { emissiveColor 30 1 "
        "1 }");
    EXPECT_EQ(lamp.complaints(), "");
    EXPECT_THAT(lamp.handler.lines, Contains("set emissiveColor SFColor 8 8 8"));
    for (const char* wrong : {"Material { emissiveColor 0 -1 0 }", "Material { specularColor 0 8 0 }"})
        EXPECT_THAT(readClassicScene(wrong).complaints(), HasSubstr("is outside the range [0, 1] of ")) << wrong;
}

TEST(BadInput, BadUtf8IsReplaced) {
    const Read r("#VRML V2.0 utf8\nWorldInfo { title \"caf\xE9\" info \"\xED\xA0\x80\" } Group {}");
    EXPECT_EQ(r.diagnostics.errors(), 1u);
    EXPECT_THAT(r.complaints(), HasSubstr(":2:23: error: 4 bytes are not valid UTF-8"));
    EXPECT_THAT(r.handler.lines, Contains("set title SFString \"caf\xEF\xBF\xBD\""));
    EXPECT_THAT(r.handler.lines, Contains("begin Group"));
    const Read xml("<X3D><Scene><WorldInfo title='\xC0\x80'/><Group/></Scene></X3D>");
    EXPECT_THAT(xml.handler.lines, Contains("begin Group"));
    EXPECT_EQ(xml.diagnostics.errors(), 1u);
}

TEST(BadInput, ZeroBytesAreReplacedToo) {
    for (const std::string pad : {"", "0123456789012345678901234567890123456789"}) {
        const std::string zero = pad + std::string(1, '\0') + pad;
        const Read r("#X3D V4.0 utf8\nPROFILE Core WorldInfo { title \"" + zero + "\" } Group {}");
        EXPECT_EQ(r.diagnostics.errors(), 1u) << r.complaints();
        EXPECT_THAT(r.handler.lines, Contains("set title SFString \"" + pad + "\xEF\xBF\xBD" + pad + "\""));
        EXPECT_THAT(r.handler.lines, Contains("begin Group"));
    }
}

TEST(BadInput, PrototypesCannotContainThemselves) {
    const Read r = readClassicScene("PROTO P [] { Group { children P {} } } P {}");
    EXPECT_THAT(r.complaints(), HasSubstr("unknown node type P"));
    EXPECT_EQ(r.handler.text(), "proto P\nbody\nbegin Group\nbegin P in children\nend\nend\nendproto\nbegin P\nend\n");
}

TEST(BadInput, ProtoNamedLikeABuiltInNodeIsLeftOut) {
    const Read r = readClassicScene(
        "PROTO Box [ initializeOnly SFNode n Sphere {} ] { Sphere {} PROTO In [] { Cone {} } } Shape { geometry Box {} "
        "}");
    EXPECT_EQ(r.diagnostics.errors(), 1u) << r.complaints();
    EXPECT_EQ(r.handler.text(), "begin Shape\nbegin Box in geometry\nend\nend\n");
}

TEST(BadInput, WrongHeadersAndEncodings) {
    for (const char* text :
         {"", "   ", "#VRML V1.0 ascii\nSeparator {}", "{\"X3D\":", "\x1f", "PK\x03\x04", "\0\0\0"}) {
        const Read r(text);
        EXPECT_GE(r.diagnostics.errors(), 1u) << text;
    }
    const Read headless("Group { children Shape {} }");
    EXPECT_EQ(headless.diagnostics.errors(), 1u);
    EXPECT_EQ(headless.handler.nodes, 2u);
}

}  // namespace
}  // namespace rtsg
