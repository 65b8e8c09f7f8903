// Filters, alone and in chains.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/filters.h>

#include "documents/reading.h"

namespace rtsg {
namespace {

std::string filtered(std::string_view name, const std::string& body, const std::string& version = "4.0") {
    test::RecordingHandler handler;
    Diagnostics diagnostics;
    const auto filter = makeFilter(name, handler, {diagnostics});
    if (!filter) return filter.error().text;
    readDocument("#X3D V" + version + " utf8\nPROFILE Full META \"a\" \"b\"\n" + body, **filter, diagnostics);
    EXPECT_TRUE(handler.complete()) << handler.violation;
    EXPECT_EQ(diagnostics.all().size(), 0u);
    std::string text = handler.text();
    std::erase(text, ',');
    return text;
}

TEST(Filters, DropDefaultsAndComments) {
    EXPECT_EQ(
        filtered("drop-defaults",
                 "PROTO P [ inputOutput SFFloat f 1 ] { Group { } } P { f 1 }\n"
                 "Transform { scale 1 1 1 translation 0 0 1 } Material { transparency 0 shininess 0.5 }"),
        "meta a=b\nproto P\ndeclare inputOutput SFFloat f = 1\nbody\nbegin Group\nend\nendproto\nbegin P\nset f "
        "SFFloat 1\nend\nbegin Transform\nset translation SFVec3f 0 0 1\nend\nbegin Material\nset shininess SFFloat "
        "0.5\nend\n");
}

TEST(Filters, QuantiseStaysWithinItsError) {
    EXPECT_EQ(filtered("quantise=1e-3",
                       "Coordinate { point [ 0.33333 1234.56789 -0.0004 ] } Transform { rotation 0 1 0 0.33333 "
                       "translation 1.23456 0.99999 2 }"),
              "meta a=b\nbegin Coordinate\nset point MFVec3f [0.333 1234.568 0]\nend\nbegin Transform\nset rotation "
              "SFRotation 0 1 0 0.33333\nset translation SFVec3f 1.235 1 2\nend\n");
}

TEST(Filters, NameWhatTheyDidNotFind) {
    const auto said = [](std::string_view name, const std::string& body) {
        test::RecordingHandler handler;
        Diagnostics diagnostics;
        const auto filter = makeFilter(name, handler, {diagnostics});
        readDocument("#X3D V4.0 utf8\nPROFILE Full\n" + body, **filter, diagnostics);
        std::string all;
        for (const Diagnostic& d : diagnostics.all()) all += d.text + "\n";
        return all;
    };
    const std::string text =
        "DEF I Inline { } IMPORT I.X AS Y PROTO P [ ] { DEF Q Group { } } DEF T Transform { children Shape { } }";
    EXPECT_EQ(said("rename=T:A,I:J,Y:Z", text), "");
    EXPECT_EQ(said("rename=T:A,NOPE:B,Q:C", text), "rename: no node is called 'NOPE'\nrename: no node is called 'Q'\n");
    EXPECT_EQ(said("select=T,Shape", text), "");
    EXPECT_EQ(said("select=T,NOPE", text), "select: no node is called 'NOPE' or is of such a type\n");
    EXPECT_EQ(said("select=NOPE", text), "no node has a name or type that is selected: the document is empty\n");
}

TEST(Filter, DropMetadata) {
    EXPECT_EQ(
        filtered("drop-metadata",
                 "WorldInfo { title \"x\" } DEF T Transform { metadata DEF M MetadataSet { value MetadataString {} } "
                 "scale 2 2 2 children [ Group { metadata USE M } ] } ROUTE M.name TO M.name"),
        "begin Transform DEF T\nset scale SFVec3f 2 2 2\nbegin Group in children\nend\nend\n");
}

TEST(Filter, DropScripts) {
    EXPECT_EQ(
        filtered("drop-scripts",
                 "DEF S Script { inputOnly SFTime t initializeOnly SFNode n Group {} url \"x\" } DEF C TimeSensor {} "
                 "ROUTE C.cycleTime TO S.t ROUTE C.cycleTime TO C.startTime"),
        "meta a=b\nbegin TimeSensor DEF C\nend\nroute C.cycleTime C.startTime\n");
}

TEST(Filter, ShortNamesKeepsScopesApart) {
    EXPECT_EQ(
        filtered("short-names",
                 "DEF Long Group {} PROTO P [] { DEF Long Group { children USE Long } } Group { children USE Long } "
                 "EXPORT Long AS Long"),
        "meta a=b\nbegin Group DEF n1\nend\nproto P\nbody\nbegin Group DEF n2\nuse n2 in children\nend\nendproto\n"
        "begin Group\nuse n1 in children\nend\nexport n1 Long\n");
}

TEST(Filter, CountsAndUnknownNames) {
    test::RecordingHandler handler;
    CountFilter count(handler);
    Diagnostics diagnostics;
    readDocument(
        "#X3D V4.0 utf8\nPROFILE Full PROTO P [] { Group {} } DEF A Group { children [ Shape {} P {} ] } "
        "Group { children USE A } ROUTE A.children TO A.addChildren",
        count, diagnostics);
    EXPECT_EQ(count.nodes(), 5u);
    EXPECT_EQ(count.uses(), 1u);
    EXPECT_EQ(count.protos(), 1u);
    EXPECT_EQ(count.routes(), 1u);
    EXPECT_EQ(count.nodesByType().at("Group"), 3u);
}

TEST(Filter, NamesAndArgumentsAreChecked) {
    EXPECT_EQ(filtered("drop-metdata", ""), "there is no filter drop-metdata (did you mean drop-metadata?)");
    EXPECT_EQ(filtered("quantise", ""), "filter quantise is written quantise=E");
    EXPECT_THAT(filtered("quantise=much", ""), testing::HasSubstr("not 'much'"));
    EXPECT_EQ(filtered("share=1", ""), "filter share takes no argument");
    EXPECT_THAT(filtered("rename=A", ""), testing::HasSubstr("pairs of names, not 'A'"));
    EXPECT_THAT(filtered("select=", ""), testing::HasSubstr("names of nodes or types"));
    for (const char* units : {"units=length", "units=speed:1", "units=length:0", "units=length:1x"})
        EXPECT_THAT(filtered(units, ""), testing::HasSubstr("takes length, angle, mass or force"));
    for (const FilterInfo& info : filters()) {
        test::RecordingHandler handler;
        Diagnostics diagnostics;
        const std::string argument = info.name == "quantise" ? "=0.1" : info.name == "units" ? "=angle:2" : "=A:B";
        const std::string name = std::string(info.name) + (info.argument.empty() ? "" : argument);
        EXPECT_TRUE(makeFilter(name, handler, {diagnostics})) << name;
    }
}

TEST(Filter, DropNamesKeepsThoseThatAreReferredToInTheirScope) {
    EXPECT_EQ(filtered("drop-names",
                       "DEF A Group { } DEF B Group { children [ USE B2 ] } PROTO P [ ] { DEF A Group { } DEF B "
                       "TimeSensor { } ROUTE B.time TO B.startTime } DEF C TimeSensor { } DEF D TimeSensor { } ROUTE "
                       "C.time TO D.startTime DEF E Group { } EXPORT E AS F"),
              "meta a=b\nbegin Group\nend\nbegin Group\nuse B2 in children\nend\nproto P\nbody\nbegin Group\nend\n"
              "begin TimeSensor DEF B\nend\nroute B.time B.startTime\nendproto\nbegin TimeSensor DEF C\nend\n"
              "begin TimeSensor DEF D\nend\nroute C.time D.startTime\nbegin Group DEF E\nend\nexport E F\n");
}

TEST(Filter, RenameFollowsEveryReferenceButThoseOfPrototypes) {
    EXPECT_EQ(filtered("rename=A:X,B:Y",
                       "DEF A Group { } DEF B Inline { } Group { children USE A } PROTO P [ ] { DEF A Group { } }\n"
                       "IMPORT B.A AS C EXPORT A AS A ROUTE A.children TO B.load"),
              "meta a=b\nbegin Group DEF X\nend\nbegin Inline DEF Y\nend\nbegin Group\nuse X in children\nend\n"
              "proto P\nbody\nbegin Group DEF A\nend\nendproto\nimport Y.A C\nexport X A\nroute X.children Y.load\n");
}

TEST(Filter, SelectTakesWhatItsNodesUseAlong) {
    EXPECT_EQ(
        filtered("select=T,PointLight",
                 "Group { children [ Shape { geometry DEF G Box { size 1 2 3 } } DEF U Group { } ] }\n"
                 "PROTO P [ ] { DEF T Group { } }\n"
                 "Group { children [ DEF T Transform { children [ Shape { geometry USE G } Shape { geometry USE "
                 "G } ] } PointLight { } ] }\n"
                 "ROUTE T.center TO T.scale ROUTE U.children TO T.children"),
        "meta a=b\nproto P\nbody\nbegin Group DEF T\nend\nendproto\nbegin Transform DEF T\nbegin Shape in "
        "children\nbegin Box DEF G in geometry\nset size SFVec3f 1 2 3\nend\nend\nbegin Shape in children\nuse G in "
        "geometry\nend\nend\nbegin PointLight\nend\nroute T.center T.scale\n");
}

TEST(Filter, ShareMakesEqualNodesOneAndLeavesWhatActsOrIsRouted) {
    const std::string two = "Shape { appearance Appearance { material Material { shininess 1 } } }";
    EXPECT_EQ(filtered("share", two + two +
                                    "Appearance { material DEF M Material { shininess 1 } } ROUTE M.shininess TO "
                                    "M.transparency TimeSensor { loop TRUE } TimeSensor { loop TRUE }"),
              "meta a=b\nbegin Shape DEF shared1\nbegin Appearance in appearance\nbegin Material in material\nset "
              "shininess SFFloat 1\nend\nend\nend\nuse shared1\nbegin Appearance\nbegin Material DEF M in material\n"
              "set shininess SFFloat 1\nend\nend\nroute M.shininess M.transparency\nbegin TimeSensor\nset loop SFBool "
              "TRUE\nend\nbegin TimeSensor\nset loop SFBool TRUE\nend\n");
    // Names of what goes lead to what stays.
    EXPECT_EQ(filtered("share", "DEF A Box { size 1 2 3 } DEF B Box { size 1 2 3 } Shape { geometry USE B }"),
              "meta a=b\nbegin Box DEF A\nset size SFVec3f 1 2 3\nend\nuse A\nbegin Shape\nuse A in geometry\nend\n");
}

TEST(Filter, IndexGivesEqualPointsOnePlace) {
    EXPECT_EQ(
        filtered("index",
                 "IndexedFaceSet { coordIndex [ 0 1 2 -1 3 4 5 -1 ] coord Coordinate { point [ 0 0 0 1 0 "
                 "0 0 1 0 1 0 0 1 1 0 0 1 0 ] } color Color { color [ 1 0 0 0 1 0 0 0 1 1 0 0 0 1 0 0 0 "
                 "1 ] } }"),
        "meta a=b\nbegin IndexedFaceSet\nset colorIndex MFInt32 [0 1 2 -1 0 1 2 -1]\nset coordIndex MFInt32 [0 1 "
        "2 -1 1 3 2 -1]\nbegin Coordinate in coord\nset point MFVec3f [0 0 0 1 0 0 0 1 0 1 1 0]\nend\nbegin Color "
        "in color\nset color MFColor [1 0 0 0 1 0 0 0 1]\nend\nend\n");
    // A corner is one with all that it has: equal points of different colours stay two.
    EXPECT_EQ(
        filtered("index",
                 "TriangleSet { coord Coordinate { point [ 0 0 0 1 0 0 0 1 0 1 0 0 0 1 0 1 1 0 ] } color "
                 "Color { color [ 1 0 0 1 0 0 1 0 0 0 1 0 1 0 0 1 0 0 ] } }"),
        "meta a=b\nbegin IndexedTriangleSet\nset index MFInt32 [0 1 2 3 2 4]\nbegin Coordinate in coord\nset point "
        "MFVec3f [0 0 0 1 0 0 0 1 0 1 0 0 1 1 0]\nend\nbegin Color in color\nset color MFColor [1 0 0 1 0 0 1 0 0 0 "
        "1 0 1 0 0]\nend\nend\n");
    // Points that something moves, or another node uses, stay as they are.
    const std::string moved =
        "IndexedFaceSet { coordIndex [ 0 1 2 ] coord DEF C Coordinate { point [ 0 0 0 0 0 0 1 1 1 "
        "] } } ";
    EXPECT_THAT(filtered("index", moved + "PointSet { coord USE C }"), testing::HasSubstr("[0 0 0 0 0 0 1 1 1]"));
}

TEST(Filter, FlattenTransformsPutsStillOnesIntoTheCoordinates) {
    const std::string faces =
        "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 ] coord Coordinate { point [ 0 0 0 1 "
        "0 0 0 1 0 ] } } } ";
    EXPECT_EQ(
        filtered("flatten-transforms",
                 "Transform { translation 1 2 3 scale -2 1 1 children [ " + faces + "Shape { geometry Box { } } ] }"),
        "meta a=b\nbegin Shape\nbegin IndexedFaceSet in geometry\nset ccw SFBool FALSE\nset coordIndex MFInt32 [0 1 "
        "2]\nbegin Coordinate in coord\nset point MFVec3f [1 2 3 -1 2 3 1 3 3]\nend\nend\nend\nbegin Transform\nset "
        "scale SFVec3f -2 1 1\nset translation SFVec3f 1 2 3\nbegin Shape in children\nbegin Box in geometry\n"
        "end\nend\nend\n");
    // One that is moved stays, and so does one whose light would reach further.
    for (const std::string& text : {"DEF T Transform { translation 1 0 0 children [ " + faces +
                                        "] } DEF P PositionInterpolator { } ROUTE "
                                        "P.value_changed TO T.translation",
                                    "Transform { translation 1 0 0 children [ DirectionalLight { } " + faces + "] }"})
        EXPECT_THAT(filtered("flatten-transforms", text), testing::HasSubstr("set translation SFVec3f 1 0 0"));
}

// In X3D 3.1 to 3.3 there is one value a child, so each child must stay one.
TEST(Filter, FlattenTransformsKeepsTheChildrenThatACadLayerCounts) {
    const std::string face =
        "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 ] coord Coordinate { point [ 0 0 0 1 0 0 0 1 0 ] } } } ";
    const std::string layer =
        "CADLayer { children [ Transform { translation 1 0 0 children [ " + face + face + "] } " + face + "] ";
    const std::string listed = filtered("flatten-transforms", layer + "visible [ TRUE FALSE ] }", "3.3");
    EXPECT_THAT(listed, testing::HasSubstr("begin Transform"));
    EXPECT_THAT(listed, testing::HasSubstr("set visible MFBool [TRUE FALSE]"));
    EXPECT_THAT(filtered("flatten-transforms", layer + "}", "3.3"),
                testing::Not(testing::HasSubstr("begin Transform")));
}

TEST(Filter, UnitsOfTheDocumentAreReplaced) {
    EXPECT_EQ(filtered("units=length:0.01", "UNIT length km 1000 Transform { translation 1 0 0 }"),
              "unit length own_length 0.01\nmeta a=b\nbegin Transform\nset translation SFVec3f 1000 0 0\nend\n");
    EXPECT_EQ(filtered("units", "UNIT length km 1000 Group { }"), "meta a=b\nbegin Group\nend\n");
}

}  // namespace
}  // namespace rtsg
