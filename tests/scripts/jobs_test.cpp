// Promises: their jobs run at the end of the call that adds them, in order, within its limits. ECMA-262, 9.5.
#include "script_scene.h"

namespace rtsg {
namespace {

using test::limits;
using test::ScriptScene;

TEST(ScriptJobs, RunWhenTheCallEndsInTheOrderTheyWereAdded) {
    ScriptScene s("outputOnly SFInt32 n", R"(
        function initialize() {
            Promise.resolve().then(() => print('a')).then(() => print('c'));
            Promise.resolve().then(() => print('b'));
            print('first');
            n = 1;
            Promise.resolve(5).then(v => { n = n + v; });
        })");
    s.frame();
    EXPECT_EQ(s.printed, "first\na\nb\nc\n");
    EXPECT_EQ(s.get<std::int32_t>("n"), 6) << s.problems();
    EXPECT_EQ(s.problems(), "");
}

TEST(ScriptJobs, WhatTheyAssignTravelsAtTheSameTimestamp) {
    ScriptScene s("inputOnly SFBool go outputOnly SFVec3f out",
                  "async function go() { await null; out = new SFVec3f(1, 2, 3); }", "DEF T Transform { }");
    ASSERT_TRUE(
        s.scene.addRoute(s.script(), s.field("S", "out"), s.scene.findName("T"), x3d::Transform::translation.index));
    s.send("go", true);
    s.frame();
    EXPECT_EQ(s.get<Vec3f>("translation", "T"), Vec3f(1, 2, 3)) << s.problems();
}

TEST(ScriptJobs, AwaitAndAsyncGeneratorsComeToTheirEnd) {
    ScriptScene s("outputOnly SFInt32 n", R"(
        async function* count() { for (let i = 1; i <= 4; ++i) yield i; }
        async function sum() { let all = 0; for await (const i of count()) all += i; return all; }
        async function initialize() { n = await sum(); })");
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 10) << s.problems();
}

TEST(ScriptJobs, ARejectionThatNothingHandlesIsReportedWithItsLine) {
    ScriptScene s("inputOnly SFBool again outputOnly SFInt32 n", R"(
        async function late() {
            await null;
            throw new Error('too late');
        }
        function initialize() { late(); Promise.reject(7); n = 1; }
        function again() { n = 2; })");
    s.frame();
    EXPECT_NE(s.problems().find("line 4: Error: too late (a promise that nothing handles)"), std::string::npos)
        << s.problems();
    EXPECT_NE(s.problems().find("7 (a promise that nothing handles)"), std::string::npos) << s.problems();
    EXPECT_EQ(s.scene.diagnostics().all().size(), 2u);
    s.send("again", true);
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 2) << "the program goes on";
    EXPECT_EQ(s.scene.diagnostics().all().size(), 2u);
}

TEST(ScriptJobs, ARejectionThatIsHandledByTheEndOfTheCallIsNone) {
    ScriptScene s("", R"(
        function initialize() {
            const p = Promise.reject(new Error('caught'));
            Promise.resolve().then(() => p.catch(e => print(e.message)));
        })");
    s.frame();
    EXPECT_EQ(s.printed, "caught\n");
    EXPECT_EQ(s.problems(), "");
}

TEST(ScriptJobs, ImportIsRejected) {
    ScriptScene s("", R"(
        function initialize() {
            import('other.js').then(() => print('imported'), e => print('refused'));
            import('another.js');
        })");
    s.frame();
    EXPECT_EQ(s.printed, "refused\n");
    EXPECT_NE(s.problems().find("import"), std::string::npos) << s.problems();
    EXPECT_NE(s.problems().find("line 4"), std::string::npos) << s.problems();
}

TEST(ScriptJobs, AnEndlessChainIsStoppedByTheWatchAndNotCalledAgain) {
    ScriptScene s("inputOnly SFBool go outputOnly SFInt32 n", R"(
        function step() { Promise.resolve().then(step); }
        function initialize() { n = 1; step(); }
        function go() { n = 2; })",
                  {}, limits(true, 0.05));
    s.frame();
    EXPECT_NE(s.problems().find("ran longer"), std::string::npos) << s.problems();
    s.send("go", true);
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 1);
}

TEST(ScriptJobs, AFailedCallStillRunsWhatItPutOff) {
    ScriptScene s("outputOnly SFInt32 n", R"(
        function initialize() { Promise.resolve().then(() => { n = 3; }); throw new Error('now'); })");
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 3);
    EXPECT_NE(s.problems().find("now"), std::string::npos);
}

TEST(ScriptJobs, ANestedCallRunsItsOwnJobsAndLeavesTheOuterOnes) {
    ScriptScene s("directOutput TRUE inputOnly SFBool go initializeOnly SFNode other USE O", R"(
        function go() {
            Promise.resolve().then(() => print('outer job'));
            other.step = 1;
        })",
                  "DEF O Script { directOutput TRUE inputOnly SFInt32 step url \"ecmascript: function step() { "
                  "print('inner'); Promise.resolve().then(() => print('inner job')); }\" }");
    // The other one's output goes the same way.
    s.send("go", true);
    s.frame();
    EXPECT_EQ(s.printed, "inner\ninner job\nouter job\n") << s.problems();
}

TEST(ScriptJobs, TwoRunsAgree) {
    const auto run = [] {
        ScriptScene s("outputOnly SFInt32 n", R"(
            async function walk(k) { for (let i = 0; i < k; ++i) { await null; n = 7 * n + k; } }
            function prepareEvents() { walk(3); walk(2); })");
        for (int i = 0; i < 5; ++i) s.frame();
        EXPECT_EQ(s.problems(), "");
        return s.scene.hash();
    };
    EXPECT_EQ(run(), run());
}

TEST(ScriptJobs, AShutdownRunsItsJobsToo) {
    ScriptScene s("", "async function shutdown() { await null; print('bye'); }");
    s.frame();
    ASSERT_TRUE(s.scene.destroyNode(s.script()));
    s.frame();
    EXPECT_EQ(s.printed, "bye\n");
}

}  // namespace
}  // namespace rtsg
