// How reports are printed, which code they have, and what a broken precondition says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/check.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg {
namespace {

TEST(Diagnostic, IsPrintedWithPositionSeverityAndCode) {
    const Diagnostic d{Severity::warning, "a.x3d", {3, 4}, "odd", DiagnosticCode("parse")};
    EXPECT_EQ(d.format(), "a.x3d:3:4: warning: odd [parse]");
    EXPECT_EQ(fail(DiagnosticCode("cycle"), "round").error().format(), "error: round [cycle]");
}

std::source_location at(const char*) {
    return std::source_location::current();
}

TEST(Diagnostic, HasTheCodeOfItsSourceFileIfItNamesNone) {
    // This file is in none of the library's rooms.
    EXPECT_EQ(DiagnosticCode::of(at("here")).text(), "application");
    EXPECT_EQ(fail("x").error().code.text(), "application");
    Diagnostics all;
    all.error({}, "y");
    all.add(Severity::note, {}, "z");
    for (const Diagnostic& d : all.all()) EXPECT_EQ(d.code.text(), "application");
    Scene scene;
    const Result<NodeId> none = scene.createNode("Nonsense");
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code.text(), "edit");
    EXPECT_EQ(scene.setName(NodeId{77}, "A").error().code.text(), "no-such-node");
}

TEST(Diagnostics, KeepsAReportThatIsAddedAsItIs) {
    Diagnostics all("here.x3d");
    all.add(Diagnostic{Severity::error, "there.x3d", {1, 2}, "bad", DiagnosticCode("proto")});
    EXPECT_EQ(all.errors(), 1U);
    EXPECT_EQ(all.all()[0].format(), "there.x3d:1:2: error: bad [proto]");
}

/// Garbage cannot fill the memory: beyond the limit reports are only counted.
TEST(Diagnostics, KeepsSoManyAndCountsTheRest) {
    Diagnostics all("a", 3);
    for (int i = 0; i < 5; ++i) all.error({1, static_cast<std::uint32_t>(i + 1)}, "bad");
    all.warning({2, 1}, "odd");
    EXPECT_EQ(all.all().size(), 3U);
    EXPECT_EQ(all.errors(), 5U);
    EXPECT_EQ(all.warnings(), 1U);
    EXPECT_EQ(all.dropped(), 3U);
    Diagnostics more("b", 4);
    more.append(all);
    more.append(all);
    EXPECT_EQ(more.all().size(), 4U);
    EXPECT_EQ(more.errors(), 10U);
    EXPECT_EQ(more.dropped(), 8U);
    EXPECT_EQ(more.all()[0].file, "a");
}

TEST(Diagnostics, WhatTwoSeeAtOnePlaceCountsOnce) {
    Diagnostics all;
    for (int i = 0; i < 2; ++i) all.error({3, 4}, "bad");
    EXPECT_EQ(all.errors(), 1U);
    all.error({3, 5}, "bad");
    all.error({3, 5}, "worse");
    EXPECT_EQ(all.errors(), 3U);
    for (int i = 0; i < 2; ++i) all.error({}, "nowhere");
    EXPECT_EQ(all.errors(), 5U) << "without a place they may be two";
}

TEST(CheckDeathTest, SaysWhereWhatAndBothValues) {
    const int maximum = 4;
    EXPECT_DEATH(RTSG_CHECK_LT(maximum + 5, maximum),
                 "diagnostic_test.cpp:[0-9]+: check failed: maximum \\+ 5 < maximum: 9 < 4");
    EXPECT_DEATH(RTSG_CHECK_EQ(std::string("a"), std::string("b")), "\"a\" == \"b\"");
    RTSG_CHECK_LE(maximum, 4);
}

TEST(CheckDeathTest, ANodeThatIsNotThereIsNamedWithTheCaller) {
    Scene scene;
    EXPECT_DEATH(scene.node(NodeId{77}),
                 "diagnostic_test.cpp:[0-9]+: check failed: the node exists: no node 77 among 1");
    const Node& root = scene.node(scene.root());
    EXPECT_DEATH(root.value(FieldIndex{500}), "500 < ");
    EXPECT_DEATH(scene.type(TypeIndex{60000}), "60000 < ");
}

}  // namespace
}  // namespace rtsg
