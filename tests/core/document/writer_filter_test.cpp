// Filters, alone and in chains.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/filter.h>

#include "core/reading.h"

namespace rtsg {
namespace {

std::string filtered(std::string_view name, const std::string& body) {
    test::RecordingHandler handler;
    Diagnostics diagnostics;
    const auto filter = makeFilter(name, handler);
    readDocument("#X3D V4.0 utf8\nPROFILE Full META \"a\" \"b\"\n" + body, *filter, diagnostics);
    EXPECT_TRUE(handler.complete()) << handler.violation;
    EXPECT_EQ(diagnostics.all().size(), 0u);
    return handler.text();
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
    EXPECT_EQ(filtered("quantise-1e-3",
                       "Coordinate { point [ 0.33333 1234.56789 -0.0004 ] } Transform { rotation 0 1 0 0.33333 "
                       "translation 1.23456 0.99999 2 }"),
              "meta a=b\nbegin Coordinate\nset point MFVec3f [0.333 1234.568 0]\nend\nbegin Transform\nset rotation "
              "SFRotation 0 1 0 0.33333\nset translation SFVec3f 1.235 1 2\nend\n");
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
    EXPECT_EQ(makeFilter("no such filter", handler), nullptr);
    for (const std::string_view name : filterNames()) EXPECT_NE(makeFilter(name, handler), nullptr) << name;
}

}  // namespace
}  // namespace rtsg
