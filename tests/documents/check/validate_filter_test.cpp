// Inconsistencies in a document: profiles, indices, keys, places, scripts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/filters.h>
#include <rtsg/scripts/run_scripts.h>

#include "documents/reading.h"

namespace rtsg {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::string problems(const std::string& body, const std::string& head = "PROFILE Full") {
    test::RecordingHandler handler;
    Diagnostics diagnostics("test");
    const auto filter = makeFilter("validate", handler, {diagnostics, {}, {}, ecmaScript().get()});
    readDocument("#X3D V4.0 utf8\n" + head + "\n" + body, **filter, diagnostics);
    std::string all;
    for (const Diagnostic& d : diagnostics.all()) all += d.format() + "\n";
    return all;
}

TEST(ValidateFilter, PassesEverythingOn) {
    const std::string text = "PROTO P [ ] { Group { } } DEF T Transform { children [ P { } USE T ] }";
    test::RecordingHandler plain, checked;
    Diagnostics diagnostics;
    readDocument("#X3D V4.0 utf8\nPROFILE Full\n" + text, plain, diagnostics);
    const auto filter = makeFilter("validate", checked, {diagnostics});
    readDocument("#X3D V4.0 utf8\nPROFILE Full\n" + text, **filter, diagnostics);
    EXPECT_EQ(checked.text(), plain.text());
}

TEST(ValidateFilter, ProfilesAndComponents) {
    EXPECT_EQ(problems("Shape { geometry Text { } }", "PROFILE Interchange COMPONENT Text:1"), "");
    EXPECT_THAT(problems("Shape { geometry Text { } }", "PROFILE Interchange"),
                HasSubstr("test:3:18: warning: Text is of component Text, level 1; profile Interchange has none of it "
                          "(COMPONENT Text:1 is missing) [profile]"));
    EXPECT_THAT(problems("Switch { }", "PROFILE Interchange"), HasSubstr("and the components named reach level 1"));
    EXPECT_THAT(problems("", "PROFILE Interchang"), HasSubstr("no profile Interchang (did you mean Interchange?)"));
    EXPECT_THAT(problems("", "PROFILE Full COMPONENT Geospatail:1"), HasSubstr("(did you mean Geospatial?)"));
    EXPECT_EQ(problems("HAnimHumanoid { }", "PROFILE Immersive COMPONENT H-Anim:1"), "");
}

TEST(ValidateFilter, AMissingProfileIsToldWithItsPlace) {
    EXPECT_EQ(problems("Group { }", ""),
              "test:3:1: warning: there is no PROFILE, which every document of X3D names; Full is taken [profile]\n");
    const auto of = [](const std::string& text) {
        test::RecordingHandler handler;
        Diagnostics diagnostics("test");
        const auto filter = makeFilter("validate", handler, {diagnostics});
        readDocument(text, **filter, diagnostics);
        return diagnostics.all().empty() ? std::string() : diagnostics.all()[0].format();
    };
    const char* xml = ": warning: X3D has no profile, which every document names; Full is taken [profile]";
    EXPECT_EQ(of("\n<X3D version='4.0'><Scene/></X3D>"), std::string("test:2:1") + xml);
    EXPECT_THAT(of(R"({"X3D":{"@version":"4.0","Scene":{"-children":[]}}})"), HasSubstr(xml));
    EXPECT_EQ(of("#VRML V2.0 utf8\nGroup { }"), "") << "VRML97 has none";
}

TEST(ValidateFilter, ProfilesAndComponentsHaveTheirPlaces) {
    const auto positions = [](const std::string& text) {
        test::RecordingHandler handler;
        Diagnostics diagnostics("test");
        const auto filter = makeFilter("validate", handler, {diagnostics});
        readDocument(text, **filter, diagnostics);
        std::vector<std::string> all;
        for (const Diagnostic& d : diagnostics.all()) all.push_back(d.format());
        return all;
    };
    EXPECT_THAT(positions("#X3D V4.0 utf8\n# before\nPROFILE  Interchang\nCOMPONENT Txt:1\n"),
                ElementsAre(HasSubstr("test:3:10: warning: there is no profile"),
                            HasSubstr("test:4:11: warning: there is no component")));
    EXPECT_THAT(positions("<X3D profile='Full'>\n<head>\n<component name='Txt' level='1'/></head><Scene/></X3D>"),
                ElementsAre(HasSubstr("test:3:1: warning: there is no component")));
    EXPECT_THAT(positions("<!-- -->\n <X3D profile='Interchang'><Scene/></X3D>"),
                ElementsAre(HasSubstr("test:2:2: warning: there is no profile")));
    EXPECT_THAT(
        positions("{\"X3D\":{\"@profile\":\"Interchang\",\"head\":{\n\"component\":[{\"@name\":\"Txt\",\"@level\":1}]},"
                  "\"Scene\":{}}}"),
        ElementsAre(HasSubstr("test:1:8: warning: there is no profile"),
                    HasSubstr("test:2:14: warning: there is no component")));
}

TEST(ValidateFilter, IndicesBeyondTheirPoints) {
    const std::string begin = "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 ", end = " -1 ] coord ";
    const std::string points = "Coordinate { point [ 0 0 0 1 0 0 0 1 0 ] } } }";
    EXPECT_EQ(problems(begin + "2" + end + points), "");
    EXPECT_THAT(problems(begin + "3" + end + points),
                HasSubstr("coordIndex[2] of IndexedFaceSet is 3, but coord has 3 elements, counted from 0"));
    EXPECT_THAT(problems(begin + "-2" + end + points), HasSubstr("is -2, but"));
    EXPECT_THAT(problems("Shape { geometry PointSet { coord DEF C Coordinate { point [ 0 0 0 ] } } } " + begin + "2" +
                         end + "USE C } }"),
                HasSubstr("coordIndex[1] of IndexedFaceSet is 1, but coord has 1 elements"));
    // Points that come later, by a route, are not known.
    EXPECT_EQ(problems(begin + "2" + end + "Coordinate { } } }"), "");
}

TEST(ValidateFilter, KeysAndValues) {
    EXPECT_THAT(problems("PositionInterpolator { key [ 0 1 2 ] keyValue [ 0 0 0 1 1 1 ] }"),
                HasSubstr("PositionInterpolator has 3 keys and 2 values [behaviour]"));
    EXPECT_EQ(problems("CoordinateInterpolator { key [ 0 1 ] keyValue [ 0 0 0 1 1 1 2 2 2 3 3 3 ] }"), "");
    EXPECT_THAT(problems("CoordinateInterpolator { key [ 0 1 ] keyValue [ 0 0 0 1 1 1 2 2 2 ] }"),
                HasSubstr("2 keys and 3 values"));
    EXPECT_THAT(problems("ScalarInterpolator { key [ 0 2 1 ] keyValue [ 0 1 2 ] }"), HasSubstr("do not ascend"));
    EXPECT_EQ(problems("PROTO P [ initializeOnly MFFloat k [ ] ] { ScalarInterpolator { key IS k } }"), "");
    // A list that comes by IS is not none.
    EXPECT_EQ(problems("PROTO P [ initializeOnly MFFloat v [ ] ] { ScalarInterpolator { key [ 0 1 ] keyValue IS v } }"),
              "");
    EXPECT_THAT(
        problems("PROTO P [ initializeOnly MFFloat v [ ] ] { ScalarInterpolator { key [ 1 0 ] keyValue IS v } }"),
        HasSubstr("do not ascend"));
    EXPECT_EQ(problems("PROTO P [ initializeOnly MFColor c [ ] ] { Background { skyAngle [ 1 ] skyColor IS c } }"), "");
    EXPECT_THAT(problems("ElevationGrid { xDimension 3 zDimension 2 height [ 1 2 3 ] }"),
                HasSubstr("has 3 heights for 6 points"));
}

TEST(ValidateFilter, KnotsOfInterpolators) {
    const std::string points = " controlPoint Coordinate { point [ 0 0 0, 1 0 0, 2 0 0 ] } ";
    const auto curve = [&](const std::string& fields) {
        return problems("NurbsPositionInterpolator {" + points + fields + " }");
    };
    EXPECT_EQ(curve(""), "");
    EXPECT_EQ(curve("knot [ 0 0 0 1 1 1 ]"), "") << "the order is 3 where none is given";
    EXPECT_THAT(
        curve("knot [ 0 1 ]"),
        HasSubstr("the knots of NurbsPositionInterpolator do not fit 3 control points of order 3: taken as even "
                  "[behaviour]"));
    EXPECT_THAT(curve("order 2 knot [ 0 0 0 1 1 1 ]"), HasSubstr("of order 2"));
    EXPECT_EQ(curve("order 2 knot [ 0 0 1 2 2 ]"), "");
    EXPECT_EQ(curve("order 4 knot [ 0 1 ]"), "") << "that there are too few points is told when it runs";
    EXPECT_EQ(problems("PROTO P [ initializeOnly SFInt32 o 2 ] { NurbsPositionInterpolator { order IS o" + points +
                       "knot [ 0 0 1 2 2 ] } }"),
              "");
    EXPECT_EQ(problems("NurbsPositionInterpolator { knot [ 0 1 ] }"), "") << "points may come later";
    EXPECT_THAT(problems("NurbsOrientationInterpolator {" + points + "knot [ 0 1 ] }"), HasSubstr("the knots of"));
    const auto surface = [](const std::string& knots) {
        return problems("NurbsSurfaceInterpolator { uDimension 3 vDimension 2 vOrder 2 " + knots + " }");
    };
    EXPECT_EQ(surface("uKnot [ 0 0 0 1 1 1 ] vKnot [ 0 0 1 1 ]"), "");
    EXPECT_THAT(surface("uKnot [ 0 0 1 1 ]"), HasSubstr("the knots along u of NurbsSurfaceInterpolator do not fit 3"));
    EXPECT_THAT(surface("vKnot [ 0 0 1 0 ]"), HasSubstr("the knots along v of NurbsSurfaceInterpolator do not fit 2"));
}

TEST(ValidateFilter, PlacesAtTheTop) {
    EXPECT_THAT(
        problems("Material { }"),
        HasSubstr("Material does nothing at the top of a scene; it belongs in field material of an Appearance"));
    EXPECT_EQ(problems("Group { } WorldInfo { } MetadataString { } LayerSet { } Viewpoint { }"), "");
    EXPECT_EQ(problems("PROTO P [ ] { Material { } } Shape { appearance Appearance { material P { } } }"), "");
}

TEST(ValidateFilter, ScriptsThatCannotBeParsed) {
    EXPECT_EQ(problems("Script { url \"ecmascript: function f() { return 1; }\" }"), "");
    const std::string bad = problems("DEF S Script {\n url \"ecmascript: function f() {\n  return 1 +;\n}\" }");
    EXPECT_THAT(bad, HasSubstr("test:5:1: warning: the script of S cannot run: SyntaxError"));
    EXPECT_THAT(bad, HasSubstr("(its line 2) [script]"));
    EXPECT_EQ(problems("Script { url \"other.js\" }"), "");
}

TEST(ValidateFilter, BooleansOfClassicVrmlAreInCapitals) {
    EXPECT_THAT(problems("TimeSensor { loop true }"),
                HasSubstr("test:3:19: warning: ClassicVRML writes TRUE and FALSE"));
    EXPECT_THAT(problems("TimeSensor { loop TRUE }"), Not(HasSubstr("writes")));
}

TEST(ValidateFilter, TangentsAreAsManyAsThePoints) {
    const auto faces = [](const char* more, const char* vectors) {
        return problems(std::string("Shape { geometry IndexedFaceSet {\n  coordIndex [ 0 1 2 -1 ] ") + more +
                        " coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } tangent Tangent { vector [ " + vectors +
                        " ] } } }");
    };
    EXPECT_EQ(faces("", "1 0 0 1, 1 0 0 1, 1 0 0 1"), "");
    EXPECT_EQ(faces("normalPerVertex FALSE", "1 0 0 1"), "") << "one of the face";
    EXPECT_EQ(faces("normalIndex [ 0 0 0 -1 ]", "1 0 0 1"), "");
    EXPECT_THAT(faces("", "1 0 0 1, 1 0 0 1"),
                HasSubstr("test:4:3: warning: IndexedFaceSet has 2 tangents for 3 points [geometry]"));
    EXPECT_THAT(faces("normalIndex [ 0 1 1 -1 ]", "1 0 0 1"),
                HasSubstr("normalIndex[1] of IndexedFaceSet is 1, but tangent has 1 elements"));
}

TEST(ValidateFilter, ListsThatDoNotFitEachOther) {
    EXPECT_THAT(problems("OrthoViewpoint { fieldOfView [-1 -1 1] }"),
                HasSubstr("test:3:18: warning: fieldOfView of OrthoViewpoint has 3 values; it takes 4 [behaviour]"));
    EXPECT_THAT(problems("NavigationInfo { avatarSize [1] }"), HasSubstr("avatarSize of NavigationInfo has 1 value;"));
    EXPECT_THAT(problems("NavigationInfo { type [\"WALK\" \"FOO\"] }"), HasSubstr("'FOO' is no type of navigation"));
    EXPECT_THAT(problems("Background { skyColor [1 0 0 0 1 0 0 0 1] skyAngle [1.5 1] }"),
                HasSubstr("skyAngle of Background does not ascend"));
    EXPECT_THAT(problems("Background { groundAngle [1] groundColor [1 0 0] }"),
                HasSubstr("Background has 1 groundColor for 1 groundAngle; it takes one more than these"));
    EXPECT_THAT(problems("LOD { range [20 5] }"), HasSubstr("range of LOD does not ascend"));
    EXPECT_THAT(problems("HAnimJoint { skinCoordIndex [0 1 2] skinCoordWeight [1] }"),
                HasSubstr("HAnimJoint has 1 skinCoordWeight for 3 skinCoordIndexes"));
    EXPECT_THAT(problems("ParticleSystem { colorKey [0] color Color { color [1 0 0, 0 1 0] } }"),
                HasSubstr("colorKey of ParticleSystem has 1 key for 2 colours"));
    EXPECT_THAT(problems("NurbsCurve { controlPoint Coordinate { point [0 0 0, 1 0 0, 1 1 0] } weight [1 2] }"),
                HasSubstr("NurbsCurve has 2 weights for 3 control points"));
    EXPECT_THAT(problems("NurbsCurve2D { controlPoint [0 0, 1 0, 1 1] weight [1 2] }"), Not(HasSubstr("weights")));
}

TEST(ValidateFilter, FieldsInWhichTheOthersLeaveNoSense) {
    const auto shape = [](const std::string& appearance) {
        return "Shape { appearance Appearance { " + appearance + " } }";
    };
    EXPECT_THAT(problems(shape("texture PixelTexture3D { image [3 1 1] }")),
                HasSubstr("image of PixelTexture3D has 3 numbers"));
    EXPECT_THAT(problems(shape("texture PixelTexture3D { image [1 1 2 1 7] }")),
                HasSubstr("image of PixelTexture3D has 1 texel for a block of 2"));
    EXPECT_THAT(problems(shape("material UnlitMaterial { } backMaterial Material { }")),
                HasSubstr("backMaterial is of type Material and material of type UnlitMaterial"));
    EXPECT_THAT(problems("GeoLocation { geoCoords 100 0 0 }"),
                HasSubstr("geoCoords of GeoLocation has a latitude beyond"));
    EXPECT_THAT(problems("ClipPlane { plane 0 0 0 -1 }"), HasSubstr("plane of ClipPlane has no direction"));
    EXPECT_THAT(problems("TextureProjector { }"), HasSubstr("TextureProjector has no texture: it throws nothing"));
    EXPECT_THAT(problems("Shape { geometry Box { } appearance Appearance { textureTransform TextureTransform { } } }"),
                "");
    EXPECT_THAT(problems("Shape { geometry IndexedFaceSet { texCoord TextureCoordinateGenerator { mode \"NOISE\" "
                         "parameter [1] } } }"),
                HasSubstr("parameter of TextureCoordinateGenerator has 1 value; NOISE takes 6"));
}

TEST(ValidateFilter, ListsThatFitAreLeftAlone) {
    EXPECT_EQ(
        problems("OrthoViewpoint { fieldOfView [-1 -1 1 1] } NavigationInfo { avatarSize [.25 1.6 .75] type \"ANY\" }"
                 "Background { skyColor [1 0 0, 0 1 0, 0 0 1] skyAngle [1, 1.5] } Background { groundColor [ ] }"
                 "LOD { range [5 20] } HAnimJoint { skinCoordIndex [0 1] skinCoordWeight [1 .5] }"
                 "GeoLocation { geoCoords 90 100 0 } GeoLocation { geoSystem [\"GD\" \"longitude_first\"] geoCoords "
                 "100 9 0 }"
                 "GeoLocation { geoSystem \"GC\" geoCoords 1e6 1e6 1e6 } TextureProjector { texture ImageTexture { } }"
                 "Shape { appearance Appearance { material Material { } backMaterial Material { }"
                 "texture PixelTexture3D { image [1 1 2 1 7 8] } } }"),
        "");
    const std::string instance = "PROTO P [ inputOutput SFNode t NULL ] { TextureProjector { texture IS t } } P { }";
    EXPECT_EQ(problems(instance), "");
}

TEST(ValidateFilter, PixelsOfMoreBitsThanTheirComponentsTake) {
    const auto image = [](const std::string& pixels) { return problems("PixelTexture { image " + pixels + " }"); };
    EXPECT_THAT(image("1 2 1 0 300"), HasSubstr("test:3:30: warning: the pixel has more bits than 1 component takes"));
    EXPECT_THAT(image("1 1 3 0x1000000"), HasSubstr("the pixel has more bits than 3 components take"));
    for (const char* good : {"1 2 1 0 255", "1 1 2 0xffff", "1 1 3 0xffffff", "1 1 4 0xffffffff", "1 1 4 -1"})
        EXPECT_THAT(image(good), Not(HasSubstr("more bits"))) << good;
}

TEST(ValidateFilter, FacesWithoutArea) {
    const std::string line = "coord Coordinate { point [ 0 0 0, 1 2 3, 2 4 6, 0 1 0, 0 0 0 ] } ";
    EXPECT_THAT(problems("Shape { geometry IndexedFaceSet { " + line + "coordIndex [ 0 1 3 -1 0 1 2 4 -1 2 1 3 ] } }"),
                HasSubstr("test:3:100: warning: face 1 (from 0) of IndexedFaceSet has no area and shows nothing "
                          "[geometry]"));
    EXPECT_THAT(problems("Shape { geometry IndexedTriangleSet { " + line + "index [ 0 1 3 0 1 2 4 4 0 ] } }"),
                HasSubstr("2 triangles of IndexedTriangleSet have no area and show nothing, the first of them number 1 "
                          "(from 0)"));
    EXPECT_THAT(problems("Shape { geometry TriangleSet2D { vertices [ 0 0, 1 1, 3 3 ] } }"),
                HasSubstr("triangle 0 (from 0) of TriangleSet2D"));
    EXPECT_EQ(problems("Shape { geometry QuadSet { coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 1 1 0 ] } } }"), "");
    // Strips are joined by such.
    EXPECT_EQ(problems("Shape { geometry TriangleStripSet { stripCount 5 " + line + "} }"), "");
}

TEST(ValidateFilter, FiguresReachPointsThatAreThere) {
    const auto figure = [](const char* joint, const char* displacer, const char* more = "") {
        return std::string("HAnimHumanoid { skeleton HAnimJoint { children HAnimJoint { skinCoordIndex [ ") + joint +
               " ] displacers HAnimDisplacer { coordIndex [ " + displacer +
               " ] } } } skinCoord Coordinate { point [ 0 0 0, 1 1 1 ] } " + more + "}";
    };
    EXPECT_EQ(problems(figure("0 1", "1")), "");
    EXPECT_THAT(
        problems(figure("0 2 1", "1")),
        HasSubstr("test:3:61: warning: skinCoordIndex[1] of HAnimJoint is 2, but skinCoord has 2 points, counted "
                  "from 0 [geometry]"));
    EXPECT_THAT(problems(figure("0", "5")), HasSubstr("coordIndex[0] of HAnimDisplacer is 5, but skinCoord has 2"));
    EXPECT_EQ(problems(figure("2", "2", "skinBindingCoords Coordinate { point [ 0 0 0, 1 1 1, 2 2 2 ] } ")), "");
    EXPECT_THAT(
        problems("HAnimSegment { coord Coordinate { point [ 0 0 0 ] } displacers HAnimDisplacer { coordIndex [ 0 "
                 "1 ] } }"),
        HasSubstr("coordIndex[1] of HAnimDisplacer is 1, but coord has 1 points"));
}

}  // namespace
}  // namespace rtsg
