// The JSON reader: what it makes of documents, as recorded commands.
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

Read readJsonScene(const std::string& children) {
    return Read(R"({"X3D": {"encoding":"UTF-8", "@profile":"Immersive", "@version":"4.0", "Scene": {"-children":[)" +
                children + "]}}}");
}

TEST(ReaderJson, WhatStandsBesideTheDocumentIsNoneOfIt) {
    const Read r(R"({"$schema":"https://x","list":[{"a":[1]}],"X3D":{"@version":"4.0","@profile":"Full","Scene":)"
                 R"({"-children":[{"Group":{}}]}},"after":null})");
    EXPECT_EQ(r.complaints(), "");
    EXPECT_THAT(r.handler.lines, ElementsAre("begin Group", "end"));
    EXPECT_THAT(Read(R"({"$schema":"https://x"})").complaints(), HasSubstr("there is no X3D object in the document"));
}

TEST(ReaderJson, SaysTheSameAsXml) {
    const Read json = Read(R"json({ "X3D": { "@version":"4.0", "@profile":"Full", "JSON schema":"x",
      "head": { "component": [ {"@name":"Text","@level":2} ], "unit": [ {"@category":"angle","@name":"degree",
        "@conversionFactor":0.0175} ], "meta": [ {"@name":"a","@content":"b \"c\" \\ \u00e4\ud83d\ude00"} ] },
      "Scene": { "-children": [
        { "#comment": "nothing" },
        { "Transform": { "-children": [ { "Shape": { "-appearance": { "Appearance": { "-material": { "Material":
          { "@diffuseColor":[1,0,0.5] } }, "-backMaterial": { "Material": { "@USE":"no" } } } },
          "-geometry": { "IndexedFaceSet": { "@solid":false, "@coordIndex":[0,1,2,-1],
          "-coord": { "Coordinate": { "@point":[0,0,0,1,0,0,0,1,0] } } } } } } ],
          "@translation":[1,2,3], "@DEF":"T" } },
        { "WorldInfo": { "@title":"x\\y \"q\"", "@info":["one","t\"wo","three\n"] } },
        { "ProtoDeclare": { "@name":"P", "ProtoInterface": { "field": [
          { "@name":"at","@type":"SFVec3f","@accessType":"inputOutput","@value":[1,2,3] },
          { "@name":"n","@type":"SFNode","@accessType":"initializeOnly","-children":[ {"Group":{}} ] } ] },
          "ProtoBody": { "-children":[ { "Transform": { "IS": { "connect": [
          { "@nodeField":"translation","@protoField":"at" } ] } } } ] } } },
        { "ProtoInstance": { "@name":"P", "fieldValue":[ {"@name":"at","@value":[0,0,1]} ] } },
        { "ExternProtoDeclare": { "@name":"E","@url":["u#E"], "field":[ {"@name":"b","@type":"SFBool",
          "@accessType":"inputOutput"} ] } },
        { "Script": { "@DEF":"S", "field":[ {"@name":"t","@type":"SFTime","@accessType":"inputOnly"} ],
          "#sourceCode":["ecmascript:","f();"] } },
        { "ROUTE": { "@fromNode":"T","@fromField":"translation_changed","@toNode":"T","@toField":"set_scale" } }
      ] } } })json");
    EXPECT_EQ(json.complaints(), "");
    const Read xml(
        "<X3D profile='Full' version='4.0'><head><component name='Text' level='2'/><unit category='angle' "
        "name='degree' "
        "conversionFactor='0.0175'/><meta name='a' content='b \"c\" \\ \xC3\xA4\xF0\x9F\x98\x80'/></head><Scene>"
        "<Transform DEF='T' translation='1 2 3'><Shape><Appearance><Material diffuseColor='1 0 0.5'/><Material "
        "USE='no' "
        "containerField='backMaterial'/></Appearance><IndexedFaceSet solid='false' coordIndex='0 1 2 -1'><Coordinate "
        "point='0 0 0 1 0 0 0 1 0'/></IndexedFaceSet></Shape></Transform><WorldInfo title='x\\y \"q\"' info='\"one\" "
        "\"t\\\"wo\" \"three&#10;\"'/><ProtoDeclare name='P'><ProtoInterface><field name='at' type='SFVec3f' "
        "accessType='inputOutput' value='1 2 3'/><field name='n' type='SFNode' accessType='initializeOnly'><Group/>"
        "</field></ProtoInterface><ProtoBody><Transform><IS><connect nodeField='translation' protoField='at'/></IS>"
        "</Transform></ProtoBody></ProtoDeclare><ProtoInstance name='P'><fieldValue name='at' value='0 0 1'/>"
        "</ProtoInstance><ExternProtoDeclare name='E' url='\"u#E\"'><field name='b' type='SFBool' "
        "accessType='inputOutput'/></ExternProtoDeclare><Script DEF='S'><field name='t' type='SFTime' "
        "accessType='inputOnly'/><![CDATA[ecmascript:\nf();]]></Script><ROUTE fromNode='T' "
        "fromField='translation_changed' toNode='T' toField='set_scale'/></Scene></X3D>");
    EXPECT_EQ(xml.complaints(), "");
    EXPECT_EQ(json.handler.text(), xml.handler.text());
    EXPECT_EQ(json.handler.header.encoding, Encoding::json);
    EXPECT_EQ(json.handler.header.profile, "Full");
}

TEST(ReaderJson, ComplaintsHavePositions) {
    const Read r =
        readJsonScene("\n{\"Foo\": {\"@a\":1}},\n{\"Box\": {\"@size\":[1,\"x\",3], \"@solid\": {}}}, {\"Group\": {}}");
    EXPECT_THAT(r.complaints(), HasSubstr("2:9: warning: unknown node type Foo"));
    EXPECT_THAT(r.complaints(), HasSubstr("3:18: error: size: expected 3 numbers"));
    EXPECT_THAT(r.complaints(), HasSubstr("3:39: error: an attribute has no object"));
    EXPECT_THAT(r.handler.lines,
                ElementsAre("begin Foo", "set a SFString \"1\"", "end", "begin Box", "end", "begin Group", "end"));
}

TEST(ReaderJson, BrokenTextKeepsWhatCameBefore) {
    const std::string document =
        R"({"X3D":{"@version":"4.0","Scene":{"-children":[{"Transform":{"@DEF":"T","-children":[{"Shape":{"-geometry":)"
        R"({"Box":{"@size":[1,2,3]}}}}]}},{"WorldInfo":{"@title":"a\u00e4\"b","@info":["x","y"]}}]}}})";
    const Read whole(document);
    EXPECT_EQ(whole.complaints(), "");
    for (std::size_t size = 0; size < document.size(); ++size) {
        const Read part(document.substr(0, size), true);
        EXPECT_FALSE(part.usable);
        EXPECT_LE(part.handler.nodes, whole.handler.nodes);
    }
    const Read mixed(R"({"X3D":{"Scene":{"-children":[{"Group":{}},{"Box":{]}]}}})");
    EXPECT_THAT(mixed.complaints(), HasSubstr("the bracket matches none"));
    EXPECT_THAT(mixed.handler.lines, Contains("begin Group"));
}

TEST(ReaderJson, DeepNestingIsRead) {
    constexpr std::size_t deep = 100000;
    std::string text;
    for (std::size_t i = 0; i < deep; ++i) text += R"({"Group":{"-children":[)";
    for (std::size_t i = 0; i < deep; ++i) text += "]}}";
    const Read r(R"({"X3D":{"Scene":{"-children":[)" + text + "]}}}", true);
    EXPECT_EQ(r.complaints(), "");
    EXPECT_EQ(r.handler.nodes, deep);
    const Read brackets("{\"X3D\":{\"Scene\":" + std::string(deep, '['), true);
    EXPECT_FALSE(brackets.usable);
}

}  // namespace
}  // namespace rtsg
