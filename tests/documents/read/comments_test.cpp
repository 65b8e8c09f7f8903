// Comments, and what authors say about declarations: from each encoding to each, where they stand, and nowhere else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include <rtsg/core/scene.h>
#include <rtsg/documents/command_list.h>
#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "documents/recording_handler.h"

namespace rtsg {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// Each comment with the command before it.
class CommentHandler final : public Filter {
  public:
    std::vector<std::string> comments, abouts;
    void beginNode(std::string_view type, std::string_view, std::string_view, SourceLocation) override { last_ = type; }
    void setField(std::string_view name, Value, SourceLocation) override { last_ = name; }
    void endNode(SourceLocation) override { last_ = "end"; }
    void beginProto(std::string_view name, SourceLocation) override { last_ = name; }
    void declareField(const FieldDeclaration& field, std::optional<Value>, SourceLocation) override {
        last_ = field.name;
        if (field.about) abouts.push_back(field.name + ": " + field.about->appinfo + "|" + field.about->documentation);
    }
    void externProto(std::string_view, const std::vector<FieldDeclaration>& fields, const std::vector<std::string>&,
                     SourceLocation) override {
        for (const FieldDeclaration& field : fields)
            if (field.about) abouts.push_back(field.name + ": " + field.about->appinfo);
    }
    void comment(std::string_view text, SourceLocation) override {
        comments.push_back(std::string(text) + " <" + last_ + ">");
    }
    void documentation(const Documentation& about, SourceLocation) override {
        abouts.push_back("next: " + about.appinfo + "|" + about.documentation);
    }

  private:
    std::string last_;
};

CommentHandler read(std::string_view text) {
    CommentHandler handler;
    Diagnostics problems("test");
    readDocument(text, handler, problems);
    EXPECT_EQ(problems.errors(), 0u) << text;
    return handler;
}

std::string written(std::string_view text, Encoding encoding) {
    std::string out;
    Diagnostics problems("test");
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { out += piece; }, problems);
    readDocument(text, *writer, problems);
    EXPECT_EQ(problems.errors(), 0u);
    return out;
}

constexpr const char* kClassic = R"(#X3D V4.0 utf8
# before the profile
PROFILE Immersive
# one comment
#   of two lines

# another
DEF T Transform { # behind the brace
  translation 1 2 # within a value
    3
  # before the list
  children [
    # in the list
    Shape { geometry # before a node
      Box { } }
    #
    # last in the list
  ]
}
PROTO P [
  # in an interface
  initializeOnly SFNode n # before the value
    Group { }
] {
  # in a body
  Group { }
}
# at the end)";

TEST(Comments, StandWhereTheyStoodInClassicVrml) {
    const CommentHandler handler = read(kClassic);
    EXPECT_THAT(handler.comments, ElementsAre("before the profile <>", "one comment\n  of two lines <>", "another <>",
                                              "behind the brace <Transform>", "within a value <Transform>",
                                              "before the list <translation>", "in the list <translation>",
                                              "before a node <Shape>", "last in the list <end>", "in an interface <P>",
                                              "before the value <P>", "in a body <end>", "at the end <end>"));
}

// Whether an IS follows has to be looked for behind the name; what is said there is about what comes next.
TEST(Comments, BehindAFieldWithoutAValueComeAfterIt) {
    const CommentHandler handler = read(
        "#X3D V4.0 utf8\nPROFILE Immersive\nScript {\n# of a\ninputOnly SFInt32 a\n# of b\noutputOnly SFInt32 b # of "
        "c\n"
        "initializeOnly SFInt32 c 7\n# of d\ninputOnly SFInt32 d\n# the end\n}\n");
    EXPECT_THAT(handler.comments, ElementsAre("of a <Script>", "of b <a>", "of c <b>", "of d <c>", "the end <d>"));
}

// Values in nodes of unknown types are kept as text, of which comments behind them are no part.
TEST(Comments, BehindTheValuesOfUnknownNodesAreNoPartOfThem) {
    const std::string text =
        "#X3D V4.0 utf8\nPROFILE Full\nWidget {\n  label \"a\"\n  # first\n  size 1 2\n  # second\n  parts [ 3 4 ]\n  "
        "# "
        "third\n  inner Part { x 1 }\n  # fourth\n  other \"b\"\n}\n";
    const std::string once = written(text, Encoding::classicVrml);
    EXPECT_EQ(written(once, Encoding::classicVrml), once);
    EXPECT_THAT(once, HasSubstr("label \"a\"\n"));
    for (const char* comment : {"# first\n", "# second\n", "# third\n", "# fourth\n"})
        EXPECT_EQ(once.find(comment), once.rfind(comment)) << once;
}

TEST(Comments, AreTheSameThroughEveryEncodingAndBack) {
    const std::vector<std::string> before = read(kClassic).comments;
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::vrml97, Encoding::xml}) {
        const std::string text = written(kClassic, encoding);
        std::vector<std::string> after = read(text).comments;
        EXPECT_EQ(after.size(), before.size()) << text;
        for (const std::string& one : before) {
            const std::string comment = one.substr(0, one.rfind(" <"));
            EXPECT_TRUE(std::ranges::any_of(after, [&](const std::string& s) { return s.starts_with(comment + " <"); }))
                << comment << "\n"
                << text;
        }
        // From then on nothing moves any more.
        EXPECT_EQ(written(text, encoding), text);
    }
    const std::string json = written(kClassic, Encoding::json);
    EXPECT_EQ(read(json).comments.size(), before.size()) << json;
    EXPECT_EQ(written(json, Encoding::json), json);
}

TEST(Comments, OfXmlKeepTheirLinesAndLoseNothingButDoubleHyphens) {
    const std::string xml =
        "<?xml version='1.0'?><!-- first --><X3D profile='Full' version='4.0'><head><!-- in the head -->"
        "<meta name='a' content='b'/></head><Scene><Group><!--a\n  b--><Shape/><!-- --></Group></Scene></X3D>";
    EXPECT_THAT(read(xml).comments, ElementsAre("first <>", "in the head <>", "a\n  b <Group>"));
    const std::string again = written(xml, Encoding::xml);
    EXPECT_THAT(read(again).comments, ElementsAre("first <>", "in the head <>", "a\n  b <Group>"));
    const std::string hyphens = written("#X3D V4.0 utf8\nPROFILE Full\n# ---- a --\n", Encoding::xml);
    EXPECT_THAT(hyphens, HasSubstr("<!-- - - - - a - - -->"));
    EXPECT_THAT(read(hyphens).comments, ElementsAre("- - - - a - - <>"));
}

TEST(Comments, OfJsonMayBeOneOrSeveral) {
    const std::string json =
        R"({"X3D":{"@version":"4.0","@profile":"Full","#comment":"top","Scene":{"-children":[{"#comment":"one"},)"
        R"({"Shape":{"#comment":["two","three"],"-geometry":{"Box":{}}}}]}}})";
    EXPECT_THAT(read(json).comments, ElementsAre("top <>", "one <>", "two <Shape>", "three <Shape>"));
}

TEST(Comments, WhatAuthorsSayAboutDeclarationsIsKeptInXmlAndJson) {
    const std::string xml =
        "<X3D profile='Full' version='4.0'><Scene><ProtoDeclare name='P' appinfo='a &lt; b' documentation='d'>"
        "<ProtoInterface><field name='f' type='SFFloat' accessType='inputOutput' value='1' appinfo='of f'/>"
        "</ProtoInterface><ProtoBody><Group/></ProtoBody></ProtoDeclare>"
        "<ExternProtoDeclare name='E' url='\"e.x3d\"' documentation='elsewhere'>"
        "<field name='g' type='SFTime' accessType='inputOnly' appinfo='of g'/></ExternProtoDeclare>"
        "<Script><field name='h' type='SFBool' accessType='outputOnly' documentation='of h'/></Script></Scene></X3D>";
    const auto said = ElementsAre("next: a < b|d", "f: of f|", "next: |elsewhere", "g: of g", "h: |of h");
    EXPECT_THAT(read(xml).abouts, said);
    EXPECT_THAT(read(written(xml, Encoding::xml)).abouts, said);
    EXPECT_THAT(read(written(xml, Encoding::json)).abouts, said);
    const std::string classic = written(xml, Encoding::classicVrml);
    for (const char* one : {"# appinfo: a < b", "# documentation: d", "# appinfo: of f", "# documentation: elsewhere",
                            "# appinfo: of g", "# documentation: of h"})
        EXPECT_THAT(classic, HasSubstr(one));
    // A recording keeps them too.
    CommandList list;
    Diagnostics problems("test");
    readDocument(xml, list, problems);
    CommentHandler replayed;
    list.replay(replayed);
    EXPECT_THAT(replayed.abouts, said);
}

TEST(Comments, WhatIsSaidOfADeclarationStandsBeforeItInClassicVrml) {
    const std::string xml =
        "<X3D profile='Full' version='4.0'><Scene><Script><field name='n' type='MFNode' accessType='initializeOnly'>"
        "<Group/></field><field name='o' type='SFTime' accessType='outputOnly' appinfo='of o' documentation='more'/>"
        "</Script></Scene></X3D>";
    EXPECT_THAT(written(xml, Encoding::classicVrml),
                HasSubstr("  ]\n  # appinfo: of o\n  \n  # documentation: more\n  outputOnly SFTime o\n"));
}

TEST(Comments, DoNotChangeTheScene) {
    Scene with, without;
    Diagnostics problems("test");
    loadText(with, kClassic, problems);
    std::string bare;
    for (std::size_t at = 0, end = 0; at < std::string_view(kClassic).size(); at = end + 1) {
        const std::string_view text(kClassic);
        end = std::min(text.find('\n', at), text.size());
        const std::string_view line = text.substr(at, end - at);
        bare += std::string(at == 0 ? line : line.substr(0, line.find('#'))) + "\n";
    }
    loadText(without, bare, problems);
    EXPECT_EQ(problems.errors(), 0u);
    EXPECT_EQ(with.hash().hex(), without.hash().hex());
}

TEST(Vrml97Writer, NamesTheNodesAndFieldsThatVrml97DoesNotHave) {
    std::string out;
    Diagnostics problems("test");
    const auto writer = makeWriter(Encoding::vrml97, [&](std::string_view piece) { out += piece; }, problems);
    readDocument(
        "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry Rectangle2D { solid TRUE } appearance Appearance { alphaMode "
        "\"MASK\" material PhysicalMaterial { } } }\nShape { bboxSize 1 1 1 geometry Rectangle2D { } }\n"
        "Transform { bboxSize 1 1 1 metadata MetadataString { } }\n",
        *writer, problems);
    std::vector<std::string> said;
    for (const Diagnostic& one : problems.all()) said.push_back(one.text.substr(0, one.text.find(')')));
    EXPECT_THAT(said, ElementsAre("Rectangle2D is no node of VRML97 (it came with X3D 3.0",
                                  "Appearance.alphaMode is no field of VRML97 (it came with X3D 4.0",
                                  "PhysicalMaterial is no node of VRML97 (it came with X3D 4.0",
                                  "Shape.bboxSize is no field of VRML97 (it came with X3D 3.0",
                                  "MetadataString is no node of VRML97 (it came with X3D 3.0",
                                  "Transform.metadata is no field of VRML97 (it came with X3D 3.0"));
}

// Such as the name of a shape in a file of another program.
TEST(Comments, AllKindsOfLineEndsStayInside) {
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::vrml97, Encoding::xml, Encoding::json}) {
        std::string text;
        Diagnostics problems;
        const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, problems);
        DocumentHeader header;
        header.version = encoding == Encoding::vrml97 ? "2.0" : "4.0", header.profile = "Full";
        writer->beginDocument(header);
        writer->comment("Shape { }\rBox { }\r\nCone { }\nSphere { }", {});
        writer->beginNode("Group", {}, {}, {});
        writer->endNode({});
        writer->endDocument();
        test::RecordingHandler back;
        readDocument(text, back, problems);
        EXPECT_THAT(back.lines, ElementsAre("begin Group", "end")) << text;
        EXPECT_EQ(problems.errors(), 0u);
        if (encoding == Encoding::classicVrml) {
            EXPECT_THAT(text, HasSubstr("# Shape { }\n# Box { }\n# Cone { }\n# Sphere { }\n"));
        }
    }
}

}  // namespace
}  // namespace rtsg
