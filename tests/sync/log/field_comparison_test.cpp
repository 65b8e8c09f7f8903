// Scenes compared in chosen fields: distances of values against closed forms, replay tests that outlive edits of their
// document, and what differs named with its cause.
#include <rtsg/sync/field_comparison.h>

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/replay_test.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr double kApart = std::numeric_limits<double>::infinity();

TEST(ValueDistance, IsTheLargestDifferenceOfANumber) {
    EXPECT_EQ(valueDistance(1.0, 1.0), 0);
    EXPECT_EQ(valueDistance(Vec3f(1, 2, 3), Vec3f(1, 2.5f, 2.75f)), .5);
    EXPECT_EQ(valueDistance(Color{0, 0, 0}, Color{0, 0, .25f}), .25);
    EXPECT_EQ(valueDistance(ColorRGBA{0, 0, 0, 1}, ColorRGBA{0, 0, 0, .5f}), .5);
    EXPECT_EQ(valueDistance(Time{10}, Time{12.5}), 2.5);
    EXPECT_EQ(valueDistance(std::int32_t{3}, std::int32_t{-4}), 7);
    EXPECT_EQ(valueDistance(Array<double>{1, 2}, Array<double>{1, 4}), 2);
    EXPECT_EQ(valueDistance(Array<double>{1, 2}, Array<double>{1}), kApart);
    EXPECT_EQ(valueDistance(String("a"), String("b")), kApart);
    EXPECT_EQ(valueDistance(1.0, 1.0f), kApart);  // other types
    Matrix4f m;
    m.elements[7] = 3;
    EXPECT_EQ(valueDistance(Matrix4f{}, m), 3);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(valueDistance(nan, nan), 0);
    EXPECT_EQ(valueDistance(nan, 1.f), kApart);
}

TEST(ValueDistance, OfRotationsIsTheAngleBetweenThem) {
    const float half = std::numbers::pi_v<float> / 2;
    // The same turn, written another way.
    EXPECT_NEAR(valueDistance(Rotation{0, 1, 0, 1}, Rotation{0, -1, 0, -1}), 0, 1e-7);
    EXPECT_NEAR(valueDistance(Rotation{0, 3, 0, 1}, Rotation{0, 1, 0, 1}), 0, 1e-7);
    EXPECT_NEAR(valueDistance(Rotation{1, 0, 0, 0}, Rotation{0, 1, 0, 0}), 0, 1e-7);
    // Round one axis the angles subtract; a quarter turn each about x and y is a third of a turn from one another.
    EXPECT_NEAR(valueDistance(Rotation{0, 1, 0, .5f}, Rotation{0, 1, 0, .5001f}), 1e-4, 1e-7);
    EXPECT_NEAR(valueDistance(Rotation{1, 0, 0, half}, Rotation{0, 1, 0, half}), 2 * std::numbers::pi / 3, 1e-6);
    EXPECT_NEAR(valueDistance(Rotation{0, 1, 0, 0}, Rotation{0, 1, 0, 2 * half}), std::numbers::pi, 1e-6);
}

TEST(FieldSelectionTest, PatternsAreNodeAndField) {
    EXPECT_TRUE((FieldSelection{{"DOOR.*", "*.rotation"}, {"initial"}, 1e-4}.check()));
    for (const char* wrong : {"DOOR", ".rotation", "DOOR.", "initial"})
        EXPECT_FALSE((FieldSelection{{wrong}, {}, 0}.check())) << wrong;
    EXPECT_FALSE((FieldSelection{{}, {}, -1}.check()));
    EXPECT_FALSE((FieldSelection{{}, {}, std::nan("")}.check()));
}

class FieldComparisons : public LogFolder {
  protected:
    /// A slide that a clock moves, and a lamp that a button switches.
    static std::string slide(std::string_view reach = "2 0 0", std::string_view more = "",
                             std::string_view size = "1") {
        return fmtText("#X3D V4.0 utf8\nPROFILE Immersive\n", more,
                       "DEF SLIDE Transform { children DEF KNOB Transform { scale ", size, " 1 1 } }\n",
                       "DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }\n",
                       "DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, ", reach, " ] }\n",
                       "DEF SWITCH BooleanToggle { }\nDEF LAMP PointLight { on FALSE }\n",
                       "ROUTE CLOCK.fraction_changed TO PATH.set_fraction\n",
                       "ROUTE PATH.value_changed TO SLIDE.translation\nROUTE SWITCH.toggle TO LAMP.on\n");
    }
    template <class... Parts>
    static std::string fmtText(Parts... parts) {
        return (std::string(parts) + ...);
    }
    static Result<> build(Scene& scene, const std::string& text) {
        Diagnostics diagnostics;
        if (!loadText(scene, text, diagnostics)) return fail("unreadable");
        return {};
    }
    /// Twenty frames, .05 s apart; the button is pressed in the tenth.
    void recordSlide(const std::filesystem::path& path, const std::string& text, bool pressed = true) {
        Scene scene;
        scene.newFrame(100.1);
        ASSERT_TRUE(build(scene, text));
        auto log = LogWriter::create(path, builtinTypes());
        ASSERT_TRUE(log);
        Attachment attachment = scene.bus().attach(**log);
        for (int frame = 0; frame < 20; ++frame) {
            if (frame == 10 && pressed) {
                ASSERT_TRUE(scene.sendEvent(scene.findName("SWITCH"), x3d::BooleanToggle::set_boolean.index, true));
            }
            scene.newFrame(100.1 + frame * .05);
        }
        ASSERT_TRUE((*log)->close());
    }
    ReplayReport rerun(std::string text, FieldSelection compared) {
        ReplayTest test;
        test.log = file();
        test.build = [text = std::move(text)](Scene& scene) { return build(scene, text); };
        test.compared = std::move(compared);
        const auto report = runReplayTest(test);
        EXPECT_TRUE(report) << report.error().format();
        return report ? *report : ReplayReport{};
    }
};

TEST_F(FieldComparisons, EditsOfTheDocumentElsewhereChangeNothing) {
    recordSlide(file(), slide());
    const std::string grown = slide("2 0 0", "WorldInfo { title \"more\" }\nDEF NEW Transform { }\n");
    EXPECT_FALSE(rerun(grown, {}).passed());  // whole states are others
    for (const FieldSelection& chosen : {FieldSelection{{"SLIDE.translation", "LAMP.on"}, {}, 0},
                                         FieldSelection{{"*.*"}, {}, 0}, FieldSelection{{}, {"initial"}, 0}}) {
        const ReplayReport report = rerun(grown, chosen);
        EXPECT_TRUE(report.passed()) << report.format();
        EXPECT_GT(report.fields, 1u);
        EXPECT_EQ(report.frames, 21u);
    }
}

TEST_F(FieldComparisons, WhatNeverChangesCountsOnlyIfInitialValuesDo) {
    recordSlide(file(), slide());
    const std::string other = slide("2 0 0", "", "3");
    const ReplayReport strict = rerun(other, {{"KNOB.*", "SLIDE.*"}, {}, 0});
    ASSERT_EQ(strict.differences.size(), 1u);
    EXPECT_EQ(strict.differences[0].field, "scale");
    EXPECT_EQ(strict.differences[0].largest, 2);
    EXPECT_EQ(strict.differences[0].states, strict.frames);
    EXPECT_TRUE(rerun(other, {{"KNOB.*", "SLIDE.*"}, {"initial"}, 0}).passed());
    EXPECT_TRUE(rerun(other, {{"KNOB.*", "SLIDE.*"}, {"KNOB.sc*"}, 0}).passed());
    // But what happens is no initial value, also where it no longer happens.
    std::string still = slide();
    still.replace(still.find("loop TRUE"), 9, "enabled FALSE");
    const ReplayReport report = rerun(still, {{"SLIDE.*"}, {"initial"}, 0});
    ASSERT_EQ(report.differences.size(), 1u);
    EXPECT_EQ(report.differences[0].field, "translation");
    EXPECT_EQ(
        report.differences[0].cause,
        "recorded only: ROUTE CLOCK.fraction_changed > PATH.set_fraction, PATH.value_changed > SLIDE.translation");
}

TEST_F(FieldComparisons, TolerancesAndTheWholeRunCount) {
    recordSlide(file(), slide());
    const std::string longer = slide("2.1 0 0");
    // At 100 + t, of a cycle of 2 s, the slide is at 2 t / 2 and at 2.1 t / 2: apart by .05 t, in the last frame by
    // .0525, and beyond .021 once t is over .42.
    EXPECT_TRUE(rerun(longer, {{"SLIDE.*"}, {}, .0526}).passed());
    const ReplayReport report = rerun(longer, {{"SLIDE.*", "LAMP.*"}, {}, .021});
    ASSERT_FALSE(report.passed());
    ASSERT_EQ(report.differences.size(), 1u);
    const FieldDifference& d = report.differences[0];
    EXPECT_EQ(d.node + "." + d.field, "SLIDE.translation");
    EXPECT_NEAR(d.time, 100.45, 1e-9);
    EXPECT_NEAR(d.largest, .0525, 1e-6);
    EXPECT_EQ(d.states, 13u);
    EXPECT_EQ(report.frames, 21u);  // it went on to the end
    EXPECT_EQ(report.verified, 8u);
    EXPECT_EQ(d.cause, "ROUTE CLOCK.fraction_changed > PATH.set_fraction, PATH.value_changed > SLIDE.translation");
    ASSERT_EQ(report.histories.size(), 1u);
    const FieldHistory::Sample& last = report.histories[0].samples.back();
    EXPECT_EQ(report.histories[0].components, 3);
    EXPECT_NEAR(last.a[0], 1.05, 1e-6);
    EXPECT_NEAR(last.b[0], 1.1025, 1e-6);
}

TEST_F(FieldComparisons, InputThatDoesNothingNowIsNamed) {
    recordSlide(file(), slide());
    std::string cut = slide();
    cut.replace(cut.find("ROUTE SWITCH"), std::string("ROUTE SWITCH.toggle TO LAMP.on").size(), "");
    const ReplayReport report = rerun(cut, {{"LAMP.*"}, {}, 0});
    ASSERT_EQ(report.differences.size(), 1u);
    EXPECT_EQ(report.differences[0].field, "on");
    EXPECT_EQ(report.differences[0].text, "recorded TRUE, now FALSE");
    EXPECT_EQ(report.differences[0].cause, "recorded only: set from outside, then ROUTE SWITCH.toggle > LAMP.on");
}

TEST_F(FieldComparisons, ATestThatComparesNothingDoesNotPass) {
    recordSlide(file(), slide());
    const ReplayReport report = rerun(slide(), {{"SLIDE.*", "SLIED.translation"}, {}, 0});
    EXPECT_FALSE(report.passed());
    EXPECT_NE(report.format().find("SLIED.translation"), std::string::npos) << report.format();
    ReplayTest none;
    none.log = file();
    none.compared.fields = {"SLIDE.*"};
    EXPECT_FALSE(runReplayTest(none));  // a replay would compare the log with itself
}

TEST_F(FieldComparisons, ANodeThatIsGoneDiffers) {
    recordSlide(file(), slide());
    std::string gone = slide();
    gone.replace(gone.find("DEF KNOB "), 9, "");
    const ReplayReport report = rerun(gone, {{"KNOB.scale"}, {}, 0});
    ASSERT_EQ(report.differences.size(), 1u);
    EXPECT_EQ(report.differences[0].text, "only in recorded");
    EXPECT_EQ(report.differences[0].largest, kApart);
}

TEST_F(FieldComparisons, LogsAreComparedByTimeSinceTheirStarts) {
    recordSlide(file("a.rlog"), slide());
    recordSlide(file("b.rlog"), slide("2.1 0 0", "Group { }\n"), false);
    const FieldSelection chosen{{"SLIDE.translation", "LAMP.on"}, {}, .02};
    const auto report = diffLogFields(file("a.rlog"), file("b.rlog"), chosen);
    ASSERT_TRUE(report) << report.error().format();
    ASSERT_EQ(report->differences.size(), 2u);
    EXPECT_EQ(report->differences[0].node, "SLIDE");
    EXPECT_EQ(report->differences[1].text, "first TRUE, second FALSE");
    EXPECT_EQ(report->states, 21u);
    EXPECT_NEAR(report->end, .95, 1e-6);
    EXPECT_TRUE(diffLogFields(file("a.rlog"), file("a.rlog"), chosen)->differences.empty());
    EXPECT_FALSE(diffLogFields(file("a.rlog"), file("a.rlog"), {{"NOBODY.on"}, {}, 0}));
}

/// A server's log, and one of a mirror that joined later: the same states, and not the same times since the start.
TEST_F(FieldComparisons, LogsOfOneSessionAreComparedByTheirStates) {
    recordSlide(file("a.rlog"), slide());
    {
        auto from = Replayer::open(file("a.rlog"));
        ASSERT_TRUE(from);
        auto log = LogWriter::create(file("b.rlog"), builtinTypes());
        ASSERT_TRUE(log);
        Replayer& replayer = **from;
        for (int i = 0; i < 8; ++i) ASSERT_TRUE(*replayer.step());
        ASSERT_TRUE((*log)->write(replayer.scene().snapshot()));
        while (*replayer.step()) ASSERT_TRUE((*log)->write(replayer.lastSet()));
        ASSERT_TRUE((*log)->close());
    }
    const FieldSelection chosen{{"SLIDE.translation", "LAMP.on"}, {}, 0};
    for (const auto& [a, b] : {std::pair("a.rlog", "b.rlog"), std::pair("b.rlog", "a.rlog")}) {
        const auto report = diffLogFields(file(a), file(b), chosen);
        ASSERT_TRUE(report) << report.error().format();
        EXPECT_TRUE(report->differences.empty()) << report->differences[0].text;
        EXPECT_EQ(report->unequalEnds, "");
        EXPECT_GT(report->states, 10u);
    }
}

TEST_F(FieldComparisons, ScenesAreComparedNodeByNode) {
    const auto differences = [](const std::string& x, const std::string& y) {
        Scene a, b;
        EXPECT_TRUE(build(a, x));
        EXPECT_TRUE(build(b, y));
        std::vector<std::string> texts;
        for (const Divergence& d : sceneDifferences(a, b)) texts.push_back(d.node + "." + d.field + ": " + d.text);
        return texts;
    };
    using Texts = std::vector<std::string>;
    const std::string head = "#X3D V4.0 utf8\nPROFILE Immersive\n";
    EXPECT_EQ(differences(slide(), slide()), Texts{});
    // A node may stand several times in one list.
    const std::string thrice = head + "DEF A Group { } Group { children [ USE A DEF B Group { } USE A USE A ] }";
    EXPECT_EQ(differences(thrice, thrice), Texts{});
    EXPECT_EQ(differences(thrice, head + "DEF A Group { } Group { children [ USE A DEF B Group { } USE A ] }"),
              Texts{"children[1].children: Group A at 3 only in first"});
    // One more in front, and everything after it is still told to be the same.
    EXPECT_EQ(differences(slide(), slide("2 0 0", "WorldInfo { }\n")),
              Texts{".children: WorldInfo at 0 only in second"});
    EXPECT_EQ(differences(slide(), slide("2 0 0", "", "3")), Texts{"KNOB.scale: first 1 1 1, second 3 1 1"});
    EXPECT_EQ(differences(head + "Group { } Shape { geometry Box { } }",
                          head + "Group { } Shape { geometry Box { size 1 2 3 } }"),
              Texts{"children[1].geometry.size: first 2 2 2, second 1 2 3"});
    EXPECT_EQ(differences(head + "DEF A Group { } DEF B Group { }", head + "DEF B Group { } DEF A Group { }"),
              Texts{".children: the same nodes in another order"});
    EXPECT_EQ(differences(head + "Shape { geometry Box { } }", head + "Shape { geometry Sphere { } }"),
              Texts{"children[0].geometry: first Box, second Sphere"});
    std::string cut = slide();
    cut.replace(cut.find("ROUTE SWITCH"), std::string("ROUTE SWITCH.toggle TO LAMP.on").size(), "");
    EXPECT_EQ(differences(slide(), cut), Texts{".routes: ROUTE SWITCH.toggle TO LAMP.on only in first"});
}

/// Histories are for charts, and have a limit: 64 fields, 4096 samples each. Differences beyond it are counted.
TEST(FieldHistories, AreLimited) {
    Scene a, b;
    std::vector<NodeId> nodes;
    for (int i = 0; i < 70; ++i)
        for (Scene* scene : {&a, &b}) {
            const NodeId node = scene->createNode(x3d::Transform::type);
            ASSERT_TRUE(scene->setName(node, "N" + std::to_string(i)));
            if (scene == &b) nodes.push_back(node);
        }
    a.newFrame(0);
    b.newFrame(0);
    FieldComparison comparison({{"*.translation"}, {}, 0}, a, b);
    EXPECT_TRUE(comparison.first());
    EXPECT_EQ(comparison.fieldCount(), 70U);
    for (int frame = 1; frame <= 4200; ++frame) {
        ASSERT_TRUE(b.set(nodes[0], x3d::Transform::translation, Vec3f(static_cast<float>(frame))));
        if (frame == 1) {
            for (const NodeId node : nodes) ASSERT_TRUE(b.set(node, x3d::Transform::translation, Vec3f(1)));
        }
        comparison.changedA(*a.newFrame(frame));
        comparison.changedB(*b.newFrame(frame));
        EXPECT_FALSE(comparison.compare());
    }
    EXPECT_EQ(comparison.differences().size(), 70U);
    EXPECT_EQ(comparison.differences()[0].states, 4200U);
    const auto histories = comparison.histories();
    EXPECT_EQ(histories.size(), 64U);
    std::size_t maximum = 0;
    for (const FieldHistory& history : histories) maximum = std::max(maximum, history.samples.size());
    EXPECT_EQ(maximum, 4096U);
    EXPECT_EQ(comparison.nothingCompared(), "");
    EXPECT_TRUE(comparison.ignoredInVain().empty());
    FieldComparison none({{"NOBODY.*"}, {}, 0}, a, b);
    none.first();
    EXPECT_EQ(none.nothingCompared(), "NOBODY.*: no such field, so nothing was compared");
    FieldComparison left({{"*.translation"}, {"*.translation", "NOBODY.x", "initial"}, 0}, a, b);
    left.first();
    EXPECT_EQ(left.nothingCompared(), "all of the fields that were asked for are left out, so nothing was compared");
    EXPECT_EQ(left.ignoredInVain(), std::vector<std::string>{"NOBODY.x"});
}

/// One that goes differs from then on, and one of the same name that comes in its place is compared again.
TEST(FieldComparison, WhatIsDestroyedInOneSceneDiffers) {
    Scene a, b;
    const auto make = [](Scene& scene) {
        const NodeId node = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.setName(node, "N"));
        EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(1, 2, 3)));
        return node;
    };
    make(a);
    const NodeId gone = make(b);
    a.newFrame(0);
    b.newFrame(0);
    FieldComparison comparison({{"N.translation"}, {}, 0}, a, b);
    EXPECT_TRUE(comparison.first());
    const auto step = [&](double t) {
        comparison.changedA(*a.newFrame(t));
        comparison.changedB(*b.newFrame(t));
        return comparison.compare();
    };
    EXPECT_TRUE(step(1));
    ASSERT_TRUE(b.destroyNode(gone));
    EXPECT_FALSE(step(2));
    EXPECT_FALSE(step(3));
    make(b);
    EXPECT_TRUE(step(4));
    ASSERT_EQ(comparison.differences().size(), 1U);
    EXPECT_EQ(comparison.differences()[0].states, 2U);
}

}  // namespace
}  // namespace rtsg
