// Recorded sessions as tests: what passes, what fails, and with which words.
#include <rtsg/sync/replay_test.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/blame.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

/// A door, its button, and an application that counts how often the button was pressed, into the door's scale.
class ReplayTests : public LogFolder {
  protected:
    static constexpr const char* kDoor = R"(#X3D V4.0 utf8
PROFILE Immersive
DEF DOOR Transform { children DEF LEAF Transform { } }
DEF PRESSED BooleanFilter { }
DEF BUTTON TimeTrigger { }
DEF OPENING TimeSensor { cycleInterval 1.5 }
DEF SWING OrientationInterpolator { key [ 0 1 ] keyValue [ 0 1 0 0, 0 1 0 1.4 ] }
ROUTE PRESSED.inputTrue TO BUTTON.set_boolean
ROUTE BUTTON.triggerTime TO OPENING.startTime
ROUTE OPENING.fraction_changed TO SWING.set_fraction
ROUTE SWING.value_changed TO DOOR.rotation
)";
    static Result<> build(Scene& scene, std::string text) {
        Diagnostics diagnostics;
        if (!loadText(scene, text, diagnostics)) return fail("unreadable");
        return {};
    }
    static std::string edited(std::string from, std::string to) {
        std::string text = kDoor;
        text.replace(text.find(from), from.size(), to);
        return text;
    }
    /// The application's work before each frame: it makes a mark for each press that it sees.
    static Result<> work(Scene& scene, double) {
        const NodeId button = scene.findName("BUTTON"), leaf = scene.findName("LEAF");
        const double pressed = scene.node(button).get(x3d::TimeTrigger::triggerTime).seconds;
        const auto marks = static_cast<float>(scene.node(leaf).get(x3d::Transform::children).size());
        const double seen = scene.node(leaf).get(x3d::Transform::translation).x;
        if (pressed <= 0 || pressed == seen) return {};
        const NodeId mark = scene.createNode(x3d::Transform::type);
        if (auto ok = scene.set(mark, x3d::Transform::translation, Vec3f(marks, 0, 0)); !ok) return ok;
        if (auto ok = scene.insertChild(leaf, x3d::Transform::children, mark); !ok) return ok;
        return scene.set(leaf, x3d::Transform::translation, Vec3f(float(pressed), 0, 0));
    }
    /// Sixty frames; the button is pressed in the tenth and the fortieth.
    void recordDoor(const std::string& text = kDoor, const LogOptions& options = {}) {
        Scene scene;
        ASSERT_TRUE(build(scene, text));
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log);
        Attachment attachment = scene.bus().attach(**log);
        const NodeId pressed = scene.findName("PRESSED");
        for (int frame = 0; frame < 60; ++frame) {
            ASSERT_TRUE(work(scene, frame * .05));
            if (frame == 10 || frame == 40) {
                ASSERT_TRUE(scene.sendEvent(pressed, x3d::BooleanFilter::set_boolean.index, true));
            }
            scene.newFrame(frame * .05);
        }
    }
    std::string said;  // by the last program
    ReplayReport run(std::string text, bool withApplication = false, bool update = false) {
        ReplayTest test;
        test.log = file();
        test.build = [text = std::move(text)](Scene& scene) { return build(scene, text); };
        if (withApplication) test.application = work;
        test.update = update;
        const Result<ReplayReport> report = runReplayTest(test);
        EXPECT_TRUE(report) << report.error().text;
        return report ? *report : ReplayReport{};
    }
};

TEST_F(ReplayTests, TheSameSceneReRunsToTheSameStates) {
    recordDoor();
    for (const bool withApplication : {false, true}) {
        const ReplayReport report = run(kDoor, withApplication);
        EXPECT_TRUE(report.passed()) << report.format();
        EXPECT_EQ(report.frames, 61u);
    }
}

TEST_F(ReplayTests, AnotherSceneFailsWithNodeFieldAndBothValues) {
    recordDoor();
    const ReplayReport report = run(edited("0 1 0 1.4", "0 1 0 1.3"));
    ASSERT_FALSE(report.passed());
    EXPECT_EQ(report.divergence->frame, 1u);
    EXPECT_EQ(report.divergence->node, "SWING");
    EXPECT_EQ(report.divergence->field, "keyValue");
    EXPECT_EQ(report.divergence->text, "recorded [0 1 0 0, 0 1 0 1.4], now [0 1 0 0, 0 1 0 1.3]");
    const ReplayReport unrouted = run(edited("ROUTE SWING.value_changed TO DOOR.rotation\n", ""));
    ASSERT_FALSE(unrouted.passed());
    EXPECT_EQ(unrouted.divergence->node, "SWING");
    EXPECT_EQ(unrouted.divergence->field, "routes");
    EXPECT_EQ(unrouted.divergence->text, "ROUTE SWING.value_changed TO DOOR.rotation only in recorded");
}

/// The document is the same; what a node does has changed. The cause is named, not what followed from it by routes.
TEST_F(ReplayTests, ABehaviourThatHasChangedIsNamedInTheFrameWhereItShows) {
    recordDoor();
    ReplayTest test;
    test.log = file();
    test.build = [](Scene& scene) {
        static constexpr Behaviour kLate = {
            .onEvent = [](Cascade& cascade, const Node& node, FieldIndex, EventValue value) {
                if (!value.as<bool>()) return;
                cascade.emit(node, x3d::TimeTrigger::triggerTime, Time{cascade.now() + .1});
            }};
        scene.registerBehaviour(x3d::TimeTrigger::type, kLate);
        return build(scene, kDoor);
    };
    const Result<ReplayReport> report = runReplayTest(test);
    ASSERT_TRUE(report);
    ASSERT_FALSE(report->passed());
    EXPECT_EQ(report->divergence->time, .5);
    EXPECT_EQ(report->divergence->node, "BUTTON");
    EXPECT_EQ(report->divergence->field, "triggerTime");
    EXPECT_EQ(report->divergence->text, "recorded 0.5, now 0.6");
    EXPECT_EQ(report->verified, report->frames - 1);
}

TEST_F(ReplayTests, AnApplicationThatHasChangedIsNamed) {
    recordDoor();
    ReplayTest test;
    test.log = file();
    test.build = [](Scene& scene) { return build(scene, kDoor); };
    test.application = [](Scene& scene, double t) -> Result<> {
        if (t > 1.8) return {};  // misses the second press
        return work(scene, t);
    };
    const Result<ReplayReport> report = runReplayTest(test);
    ASSERT_TRUE(report);
    ASSERT_FALSE(report->passed());
    EXPECT_EQ(report->divergence->node, "LEAF");
    EXPECT_NEAR(report->divergence->time, 2.05, 1e-9);
}

TEST_F(ReplayTests, UpdateRecordsAnewAndThenPasses) {
    recordDoor();
    // Another node in front: all numbers move, and the input still finds its way by names.
    const std::string text = edited("DEF DOOR", "Transform { }\nDEF DOOR");
    EXPECT_FALSE(run(text).passed());
    const ReplayReport updated = run(text, false, true);
    EXPECT_TRUE(updated.passed()) << updated.format();
    EXPECT_TRUE(updated.updated);
    EXPECT_TRUE(run(text).passed()) << run(text).format();
    EXPECT_FALSE(run(kDoor).passed());
    EXPECT_FALSE(std::filesystem::exists(file("a.rlog.new")));
    // Both presses are still in it.
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    int events = 0;
    while (*(*replayer)->step())
        for (const Change& change : (*replayer)->lastSet().changes) events += change.kind == ChangeKind::event;
    EXPECT_EQ(events, 2);
    EXPECT_GT((*replayer)->scene().node((*replayer)->scene().findName("LEAF")).get(x3d::Transform::children).size(),
              1u);
}

TEST_F(ReplayTests, AnUpdateThatCannotBeMadeLeavesTheLogAlone) {
    recordDoor();
    const std::string before = readAll(file());
    const ReplayReport report =
        run("#X3D V4.0 utf8\nPROFILE Immersive\nDEF LEAF Transform { }\nDEF BUTTON TimeTrigger { }\n", false, true);
    EXPECT_FALSE(report.passed());
    EXPECT_NE(report.format().find("there is no PRESSED any more"), std::string::npos) << report.format();
    EXPECT_EQ(readAll(file()), before);
    EXPECT_FALSE(std::filesystem::exists(file("a.rlog.new")));
}

TEST_F(ReplayTests, SubscribersFollowAndTheirResultsAreChecked) {
    recordDoor();
    struct Counter : Subscriber {
        std::uint64_t rounds = 0;
        Result<> apply(const Scene&, const ChangeSet& changes) override {
            for (const Change& c : changes.changes)
                rounds += c.kind == ChangeKind::setField && c.field == x3d::Transform::rotation.index;
            return {};
        }
    };
    for (const bool rerun : {false, true}) {
        Counter counter;
        Attachment attachment;
        ReplayTest test;
        test.log = file();
        if (rerun) test.build = [](Scene& scene) { return build(scene, kDoor); };
        test.attach = [&](Scene& scene) -> Result<> {
            attachment = scene.bus().attach(counter);
            return {};
        };
        std::uint64_t checks = 0;
        test.check = [&](const Scene& scene) -> Result<> {
            ++checks;
            return scene.now() > 1.999 ? fail("two seconds are enough") : Result<>{};
        };
        bool finished = false;
        test.finish = [&]() -> Result<> {
            finished = true;
            return {};
        };
        const Result<ReplayReport> report = runReplayTest(test);
        ASSERT_TRUE(report) << report.error().text;
        ASSERT_TRUE(report->divergence);
        EXPECT_EQ(report->divergence->text, "two seconds are enough");
        EXPECT_NEAR(report->divergence->time, 2, 1e-9);
        EXPECT_EQ(checks, report->frames);
        EXPECT_GT(counter.rounds, 20u);
        EXPECT_TRUE(finished);
    }
}

TEST_F(ReplayTests, ADamagedLogFailsWhereItIsDamaged) {
    recordDoor();
    const auto records = recordsOf(file());
    std::string bytes = readAll(file());
    const auto& [offset, header] = records[30];
    bytes[offset + header.size() - 1] = static_cast<char>(bytes[offset + header.size() - 1] ^ 1);
    writeAll(file(), bytes);
    const ReplayReport report = run(kDoor);
    ASSERT_FALSE(report.passed());
    EXPECT_NE(report.format().find("bytes " + std::to_string(offset) + " to "), std::string::npos) << report.format();
}

/// A keyframe repeats what the frames lead to: without it every state is there, and compared; the test fails in the
/// end.
TEST_F(ReplayTests, AllStatesAreComparedWhereOnlyAKeyframeIsDamaged) {
    LogOptions options;
    options.keyframeSeconds = 1;
    recordDoor(kDoor, options);
    const std::uint64_t states = run(kDoor).frames;
    const auto records = recordsOf(file());
    const auto keyframe = std::find_if(records.begin() + 5, records.end(),
                                       [](const auto& r) { return r.second.kind == RecordKind::keyframe; });
    ASSERT_NE(keyframe, records.end());
    const std::string whole = readAll(file());
    std::string bytes = whole;
    bytes[keyframe->first + keyframe->second.size() - 1] ^= 1;
    const std::filesystem::path intact = file().string() + ".intact";
    writeAll(intact, whole);
    writeAll(file(), bytes);
    const std::string range = "bytes " + std::to_string(keyframe->first) + " to ";
    const ReplayReport report = run(kDoor);
    EXPECT_EQ(report.frames, states);
    EXPECT_EQ(report.verified, states);
    EXPECT_FALSE(report.passed());
    EXPECT_THAT(report.format(), testing::HasSubstr(range));
    // A difference before it is told alone.
    const ReplayReport other = run(edited("0 1.4 ]", "0 1.3 ]"));
    ASSERT_TRUE(other.divergence);
    EXPECT_LT(other.frames, states);
    // Two logs are compared by every state, and by every field, and the damage is told.
    ComparedStates compared;
    const auto first = diffLogs(intact, file(), {}, &compared);
    ASSERT_TRUE(first) << first.error().format();
    EXPECT_FALSE(*first) << (*first)->format();
    EXPECT_EQ(compared.both, states);
    EXPECT_EQ(compared.damage[0], "");
    EXPECT_THAT(compared.damage[1], testing::HasSubstr("1 damaged place, the first at " + range));
    FieldSelection selection;
    selection.fields = {"LEAF.*"};
    const auto fields = diffLogFields(intact, file(), selection);
    ASSERT_TRUE(fields) << fields.error().format();
    EXPECT_EQ(fields->states, states);
    EXPECT_TRUE(fields->differences.empty());
    EXPECT_THAT(fields->damage[1], testing::HasSubstr(range));
    std::filesystem::remove(intact);
}

/// A session in which people edited, as a test of another edition of its scene, and recorded anew: the edits are
/// theirs.
TEST_F(ReplayTests, EditsAreOfTheNodesThatTheyWereOfAndOfTheirAuthors) {
    {
        Scene scene;
        ASSERT_TRUE(build(scene, kDoor));
        auto log = LogWriter::create(file(), builtinTypes());
        ASSERT_TRUE(log);
        const Attachment attachment = scene.bus().attach(**log);
        scene.newFrame(0);
        const NodeId door = scene.findName("DOOR"), leaf = scene.findName("LEAF"), swing = scene.findName("SWING");
        ASSERT_TRUE(scene.set(door, x3d::Transform::translation, Vec3f(1, 2, 3)));
        scene.attribute("Ann", door, x3d::Transform::translation.index);
        scene.newFrame(1);
        ASSERT_TRUE(scene.setName(leaf, "PANEL"));
        scene.newFrame(2);
        ASSERT_TRUE(scene.set(leaf, x3d::Transform::scale, Vec3f(2)));
        ASSERT_TRUE(scene.destroyNode(swing));
        scene.newFrame(3);
    }
    const std::string edition = edited("DEF PRESSED", "WorldInfo { }\nDEF PRESSED");
    ReplayTest test;
    test.log = file();
    test.build = [&](Scene& scene) { return build(scene, edition); };
    test.compared.fields = {"DOOR.*", "PANEL.*"};
    test.compared.ignore = {"DOOR.children"};
    const auto compared = runReplayTest(test);
    ASSERT_TRUE(compared);
    EXPECT_TRUE(compared->passed()) << compared->format();
    const ReplayReport updated = run(edition, false, true);
    EXPECT_TRUE(updated.passed()) << updated.format();
    const auto steps = blame(file(), "DOOR.translation");
    ASSERT_TRUE(steps);
    EXPECT_EQ(steps->back().author, "Ann");
}

TEST_F(ReplayTests, OnlyOneSessionCanBeRunAgain) {
    recordDoor();
    const std::string session = readAll(file());
    std::filesystem::remove(file());
    recordDoor();
    writeAll(file(), session + readAll(file()));
    const ReplayReport report = run(kDoor);
    ASSERT_FALSE(report.passed());
    EXPECT_EQ(report.verified, 61u);
    EXPECT_EQ(report.divergence->text, "here another session begins in the log: only one can be run again");
}

TEST_F(ReplayTests, WhatCannotBeRunIsAnError) {
    ReplayTest test;
    test.log = file("none.rlog");
    EXPECT_FALSE(runReplayTest(test));
    recordDoor();
    test.log = file();
    EXPECT_TRUE(runReplayTest(test)->passed());
    test.update = true;
    EXPECT_FALSE(runReplayTest(test));
    test.update = false;
    test.build = [](Scene&) { return fail("cannot be built"); };
    const auto report = runReplayTest(test);
    ASSERT_FALSE(report);
    EXPECT_EQ(report.error().text, "cannot be built");
}

/// A test program's main says by its status how the test went.
TEST_F(ReplayTests, TheEndIsToldWhileTheSceneIsThereAlsoOfATestThatCannotBegin) {
    recordDoor();
    ReplayTest test;
    test.log = file();
    const Scene* scene = nullptr;
    std::size_t nodes = 0;
    test.build = [&](Scene& created) -> Result<> {
        scene = &created;
        return fail("no scene today");
    };
    test.finish = [&]() -> Result<> {
        nodes = scene->nodeCount();
        return fail("told after what went wrong first");
    };
    const Result<ReplayReport> report = runReplayTest(test);
    ASSERT_FALSE(report);
    EXPECT_EQ(report.error().text, "no scene today");
    EXPECT_EQ(nodes, 1u);
}

TEST_F(ReplayTests, AProgramOfItsOwnEndsWithAStatus) {
    recordDoor();
    const auto status = [&](std::string_view text, std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), "app_test");
        std::vector<char*> argv;
        for (std::string& one : arguments) argv.push_back(one.data());
        ReplayTest test;
        test.build = [text](Scene& scene) { return build(scene, std::string(text)); };
        testing::internal::CaptureStdout();
        testing::internal::CaptureStderr();
        const int result = replayTestMain(static_cast<int>(argv.size()), argv.data(), std::move(test));
        said = testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr();
        return result;
    };
    const std::string log = file().string(), slow = edited("0 1 0 1.4", "0 1 0 1.3");
    EXPECT_EQ(status(kDoor, {log}), 0) << said;
    EXPECT_EQ(status(slow, {log}), 1);
    EXPECT_NE(said.find("SWING.keyValue"), std::string::npos) << said;
    EXPECT_EQ(status(slow, {log, "--field", "DOOR.*", "--tolerance", ".2"}), 0) << said;
    EXPECT_EQ(status(slow, {log, "--field", "DOOR.*", "--tolerance", "1e-4"}), 1);
    EXPECT_EQ(status(slow, {log, "--field", "DOOR.*", "--ignore", "DOOR.rotation"}), 0) << said;
    EXPECT_EQ(status(kDoor, {file("none.rlog").string()}), 1);
    for (const std::vector<std::string>& wrong :
         {std::vector<std::string>{}, {log, "--field"}, {log, "--tolerance", "wide"}, {log, "--nonsense", "1"}}) {
        EXPECT_EQ(status(kDoor, wrong), 2);
        EXPECT_NE(said.find("usage: app_test LOG"), std::string::npos) << said;
    }
    EXPECT_EQ(status(slow, {log, "--update"}), 0) << said;
    EXPECT_EQ(status(slow, {log}), 0) << said;
}

}  // namespace
}  // namespace rtsg
