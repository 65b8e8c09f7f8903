// Diagnostics that say what may have been meant, and how it is written.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "commands/suggestion.h"
#include "core/scene_check.h"

namespace rtsg {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string problemsOf(std::string_view text) {
    Scene scene;
    Diagnostics problems("test");
    loadText(scene, text, problems);
    return test::allText(problems);
}

TEST(Suggestion, FindsWhatIsNearAndNothingElse) {
    const std::vector<std::string_view> known = {"Transform", "translation", "rotation", "Box", "Cone", "Group"};
    EXPECT_EQ(detail::nearest("Trasnform", known), "Transform");
    EXPECT_EQ(detail::nearest("transform", known), "Transform");
    EXPECT_EQ(detail::nearest("translaton", known), "translation");
    EXPECT_EQ(detail::nearest("box", known), "Box");
    EXPECT_EQ(detail::nearest("Bax", known), "Box");
    EXPECT_EQ(detail::nearest("Sphere", known), "");
    EXPECT_EQ(detail::nearest("", known), "");
    EXPECT_EQ(detail::nearest("x", known), "");
    EXPECT_EQ(detail::nearest(std::string(10'000, 'a'), known), "");
}

TEST(Teaching, NamesWhatWasMeantInEveryEncoding) {
    const std::string classic = problemsOf(
        "#X3D V4.0 utf8\nTrasnform { }\nTransform { translaton 1 2 3 }\nDEF C TimeSensor { }\nDEF T Transform { }\n"
        "ROUTE C.fraction_chaged TO T.set_translaton\nScript { inputOutput SFFloat speed 1 spede 2 }\n");
    EXPECT_THAT(classic, HasSubstr("unknown node type Trasnform (did you mean Transform?); it is kept"));
    EXPECT_THAT(classic, HasSubstr("Transform has no field 'translaton' (did you mean translation?)"));
    EXPECT_THAT(classic, HasSubstr("TimeSensor C has no field 'fraction_chaged' (did you mean fraction_changed?)"));
    EXPECT_THAT(classic, HasSubstr("Script has no field 'spede' (did you mean speed?)"));
    const std::string xml =
        problemsOf("<X3D version='4.0'><Scene><Trasnform/><Transform translaton='1 2 3'/></Scene></X3D>");
    EXPECT_THAT(xml, HasSubstr("unknown node type Trasnform (did you mean Transform?)"));
    EXPECT_THAT(xml, HasSubstr("has no field 'translaton' (did you mean translation?)"));
    EXPECT_EQ(xml.find("unknown node type"), xml.rfind("unknown node type")) << "reader and builder say it once";
}

TEST(Teaching, SaysWhatAWordThatIsNoneOfAFieldsIsTakenFor) {
    EXPECT_THAT(
        problemsOf(
            "#X3D V4.0 utf8\nTextureProperties { boundaryModeS \"FOO\" }\nFontStyle { style \"FAT\" }\nFontStyle { "
            "justify [ \"LEFT\" ] }\n"),
        AllOf(HasSubstr("warning: 'FOO' is none of the values of boundaryModeS (CLAMP, CLAMP_TO_EDGE, "
                        "CLAMP_TO_BOUNDARY, MIRRORED_REPEAT, REPEAT): taken as REPEAT"),
              HasSubstr("'FAT' is none of the values of style (PLAIN, BOLD, ITALIC, BOLDITALIC): taken as PLAIN"),
              HasSubstr("'LEFT' is none of the values of justify (MIDDLE, BEGIN, END, FIRST)")));
}

TEST(Teaching, NamesTheFieldThatNodesWereMeantFor) {
    EXPECT_THAT(
        problemsOf("#X3D V4.0 utf8\nTransform { childrn [ Shape { } ] }\n"),
        HasSubstr("test:2:13: error: Transform has no field 'childrn' (did you mean children?); what is in it is "
                  "kept under its name"));
    EXPECT_THAT(
        problemsOf("<X3D version='4.0'><Scene><Shape><Box containerField='geomtry'/></Shape></Scene></X3D>"),
        HasSubstr("containerField: Shape has no field 'geomtry' (did you mean geometry?); 'geometry' is taken"));
    EXPECT_THAT(
        problemsOf("<X3D version='4.0'><Scene><Shape><Material containerField='geomtry'/></Shape></Scene></X3D>"),
        HasSubstr("error: Shape has no field 'geomtry' (did you mean geometry?); what is in it is kept"));
}

TEST(Teaching, NamesOtherFormsOfAWordAndOtherWordsForAThing) {
    const std::vector<std::string_view> clock = {"cycleInterval", "startTime", "fraction_changed", "isActive", "loop"};
    EXPECT_EQ(detail::nearest("fraction", clock), "fraction_changed");
    EXPECT_EQ(detail::nearest("start", clock), "startTime");
    EXPECT_EQ(detail::nearest("duration", clock), "cycleInterval");
    EXPECT_EQ(detail::nearest("end", clock), "");
    const std::vector<std::string_view> fields = {"center", "children",     "rotation",
                                                  "scale",  "set_fraction", "translation"};
    EXPECT_EQ(detail::nearest("position", fields), "translation");
    EXPECT_EQ(detail::nearest("set_position", fields), "translation");
    EXPECT_EQ(detail::nearest("orientation_changed", fields), "rotation");
    EXPECT_EQ(detail::nearest("child", fields), "children");
    EXPECT_EQ(detail::nearest("fraction", fields), "set_fraction");
    const std::string routes = problemsOf(
        "#X3D V4.0 utf8\nDEF X Transform { }\nDEF T TimeSensor { }\nDEF P PositionInterpolator { }\n"
        "ROUTE T.fraction TO P.set_fraction\nROUTE P.value TO X.position\n");
    EXPECT_THAT(routes, HasSubstr("TimeSensor T has no field 'fraction' (did you mean fraction_changed?)"));
    EXPECT_THAT(routes, HasSubstr("PositionInterpolator P has no field 'value' (did you mean value_changed?)"));
    EXPECT_THAT(problemsOf("#X3D V4.0 utf8\nTransform { position 1 2 3 }"), HasSubstr("(did you mean translation?)"));
}

TEST(Teaching, NamesABraceThatIsMissing) {
    // If a node has no field for the next one, the next one goes to the parent as intended.
    for (const char* next : {"Transform { }", "DEF T Transform { }", "USE A"}) {
        Scene scene;
        Diagnostics problems("test");
        loadText(scene,
                 std::string(
                     "#X3D V4.0 utf8\nPROFILE Full\nDEF A Transform { }\nShape {\n  geometry Box { size 1 1 1\n}\n") +
                     next + "\nDEF B Group { }\n",
                 problems);
        EXPECT_EQ(test::allText(problems),
                  "test:7:1: error: '}' is missing before Transform, at the end of Shape begun at line 4 [parse]\n");
        EXPECT_EQ(scene.node(scene.root()).get(x3d::RtsgScene::children).size(), 4u);
    }
    const std::string list =
        problemsOf("#X3D V4.0 utf8\nGroup { children [\nShape { geometry Sphere { }\nShape { }\n] }\n");
    EXPECT_EQ(list, "test:4:1: error: '}' is missing before Shape, at the end of Shape begun at line 3 [parse]\n");
    // Where the next one has a place, its field's name may be what is missing.
    const std::string either = problemsOf("#X3D V4.0 utf8\nTransform {\nShape { }\n}\n");
    EXPECT_EQ(either,
              "test:3:1: error: 'children' is missing before Shape in Transform begun at line 2, or '}' at the end of "
              "that [parse]\n");
    EXPECT_THAT(
        problemsOf("#X3D V4.0 utf8\nShape {\nappearance Appearance { material Material { }\ngeometry Box { } }"),
        AllOf(HasSubstr("test:4:1: error: Appearance has no field 'geometry'"),
              HasSubstr("; Shape begun at line 2 has one: is a '}' missing?"),
              HasSubstr("1 levels deep: '}' is missing")));
}

TEST(Teaching, NamesWhatNoNameMayHave) {
    const std::string classic =
        problemsOf("#VRML V2.0 utf8\nDEF 1x Group {}\nDEF -a Group {}\nDEF a.b Group {}\nDEF a-1_x002E_ Group {}\n");
    EXPECT_EQ(classic,
              "test:2:5: warning: DEF '1x' begins with '1', which no name may have; ROUTE and USE find it so [parse]\n"
              "test:3:5: warning: DEF '-a' begins with '-', which no name may have; ROUTE and USE find it so [parse]\n"
              "test:4:5: warning: DEF 'a.b' has '.' in it, which no name may have; ROUTE and USE find it so [parse]\n");
    const std::string xml = problemsOf(
        "<X3D profile='Full' version='4.0'><Scene><Group DEF='1x'/><Group DEF='a:b'/><Group DEF='a.b-c'/><Group "
        "DEF='\xC3\xA4'/></Scene></X3D>");
    EXPECT_THAT(xml, AllOf(HasSubstr("DEF '1x' begins with '1'"), HasSubstr("DEF 'a:b' has ':' in it")));
    EXPECT_EQ(std::ranges::count(xml, '\n'), 2) << xml;
}

TEST(Teaching, NamesFieldsThatWereCalledOtherwiseInEarlierVersions) {
    const std::string now = "field 'collide' of Collision is called 'enabled' since X3D 3.0";
    EXPECT_THAT(problemsOf("#X3D V4.0 utf8\nCollision { collide FALSE }"), HasSubstr("test:2:13: warning: " + now));
    EXPECT_THAT(problemsOf("<X3D version='3.3'><Scene><Collision collide='false'/></Scene></X3D>"), HasSubstr(now));
    EXPECT_THAT(problemsOf("#X3D V4.0 utf8\nSwitch { choice [ Group { } ] }"),
                HasSubstr("field 'choice' of Switch is called 'children' since X3D 3.0"));
    EXPECT_THAT(problemsOf("<X3D version='4.0'><Scene><LoadSensor><ImageTexture "
                           "containerField='watchList'/></LoadSensor></Scene></X3D>"),
                HasSubstr("containerField: field 'watchList' of LoadSensor is called 'children' since X3D 4.0"));
    EXPECT_EQ(problemsOf("#VRML V2.0 utf8\nCollision { collide FALSE }\nSwitch { choice [ Group { } ] }"), "");
    EXPECT_EQ(problemsOf("#X3D V3.3 utf8\nPROFILE Full\nLoadSensor { watchList [ ] }"), "");
}

TEST(Teaching, NamesWhatIsWrongInXml) {
    EXPECT_THAT(problemsOf("<X3D version='4.0'><Scene><WorldInfo title='a & b'/></Scene></X3D>"),
                HasSubstr("a '&' that begins no reference is written &amp;"));
    EXPECT_THAT(problemsOf("<X3D version='4.0'><Scene><WorldInfo title='a &amp; b'><Box></WorldInfo></Scene></X3D>"),
                Not(HasSubstr("begins no reference")));
    EXPECT_THAT(problemsOf("<X3D version='4.0'><Scene><Box DEF='my box'/></Scene></X3D>"),
                HasSubstr("DEF 'my box' has white space in it"));
    const std::string classic = problemsOf("#X3D V4.0 utf8\nTransform { children\n DEF my box Shape { } }");
    EXPECT_THAT(classic, HasSubstr("test:3:9: error: a name has no white space: 'DEF my box' could be 'DEF my_box'"));
    EXPECT_EQ(std::ranges::count(classic, '\n'), 1) << classic;
    EXPECT_THAT(problemsOf("<X3D version='4.0'><Scene><WorldInfo info='one two'/></Scene></X3D>"),
                HasSubstr("the strings of a list stand in double quotes; this is taken as one"));
}

TEST(Teaching, NamesMissingAndTrailingCommasOfJsonWithTheirPlace) {
    const char* const head = "{\"X3D\":{\"@version\":\"4.0\",\"Scene\":{\"-children\":[\n";
    const auto body = [&](const char* text) { return problemsOf(std::string(head) + text + "]}}}"); };
    EXPECT_EQ(body("{\"Box\":{\"@size\":[1,2,3],\"@solid\":true}}"), "");
    EXPECT_THAT(body("{\"Box\":{\"@size\":[1,2,3]\n\"@solid\":true}}"),
                HasSubstr("test:3:1: error: a comma is missing before this"));
    EXPECT_THAT(body("{\"Box\":{\"@size\":[1 2,3]}}"), HasSubstr("test:2:20: error: a comma is missing before this"));
    EXPECT_THAT(body("{\"Box\":{\"@size\":[1,2,3],}}"),
                HasSubstr("test:2:25: error: there is nothing between the last comma and this bracket"));
    EXPECT_THAT(body("{\"Box\":{\"@size\":[1,,2,3]}}"), HasSubstr("test:2:20: error: a comma too many"));
}

}  // namespace
}  // namespace rtsg
