// Every way in which a program can hold up the scene, or take what it should not have, ends in a diagnostic; and the
// scene goes on, with its clock, its routes and the programs of others.
#include <atomic>
#include <cstdlib>
#include <thread>

#include "script_scene.h"
#include "support/no_threads.h"

namespace rtsg {
namespace {

using test::limits;
using test::ScriptScene;

struct Variant {
    const char *name, *program, *diagnostic;
};

// clang-format off
const Variant kVariants[] = {
    // Looping.
    {"a loop", "function go() { for (;;); }", "ran longer than 0.1 s; it is not called again"},
    {"one that catches everything", "function go() { for (;;) try { throw 1; } catch (e) { } finally { continue; } }", "ran longer"},
    {"at load", "while (true);", "ran longer"},
    {"in initialize", "function initialize() { while (true); }", "ran longer"},
    {"in prepareEvents", "function prepareEvents() { while (true); }", "ran longer"},
    {"in eventsProcessed", "function eventsProcessed() { while (true); }", "ran longer"},
    {"a generator", "function go() { for (const x of (function* () { for (;;) yield 1; })()); }", "ran longer"},
    {"a proxy", "function go() { for (const x in new Proxy({}, {ownKeys() { for (;;); }})); }", "ran longer"},
    {"a getter of a value that is sent", "function go() { out = {get length() { for (;;); }}; }", "ran longer"},
    {"a conversion", "function go() { new SFVec3f({valueOf() { for (;;); }}); }", "ran longer"},
    {"comparisons", "function go() { [3, 2, 1].sort(() => { for (;;); }); }", "ran longer"},
    {"an engine's loop", "function go() { Array.prototype.lastIndexOf.call({length: 2 ** 53 - 1}, 5); }", "ran longer"},
    {"text of texts", "function go() { let a = [1]; for (let i = 0; i < 60; ++i) a = [a, a]; String(a); }", "ran longer"},
    {"JSON of objects", "function go() { let a = [1]; for (let i = 0; i < 60; ++i) a = [a, a]; JSON.stringify(a); }", "ran longer"},
    {"eval", "function go() { eval('for (;;);'); }", "ran longer"},
    {"printing", "function go() { for (;;) print(''); }", "ran longer"},
    {"making nodes", "function go() { for (;;) Browser.currentScene.createNode('Group'); }", "ran longer"},
    {"a search in a long text", "function go() { 'a'.repeat(1 << 22).indexOf('a'.repeat(1 << 21) + 'b'); }", "RangeError: looking for 2097153 characters among 4194304 takes too long"},
    {"many marks on a letter", "function go() { ('a' + '\\u0301\\u0323'.repeat(500000)).normalize('NFD'); }", "RangeError: 4096 combining characters"},
    {"backtracking", "function go() { /^(a|a)*$/.test('a'.repeat(5000) + 'b'); }", "InternalError: too much recursion"},
    // Allocating.
    {"arrays", "function go() { const a = []; for (;;) a.push(new Array(10000).fill(7)); }", "scripts may hold 32 MiB; it is not called again"},
    {"texts", "function go() { const a = []; for (let i = 0; ; ++i) a.push('x'.repeat(100000) + i); }", "scripts may hold 32 MiB"},
    {"objects that hold each other", "function go() { let a = null; for (;;) a = {a}; }", "scripts may hold 32 MiB"},
    {"one array that is too large", "function go() { new Float64Array(1e9); }", "RangeError: out of memory: 8000000000 bytes"},
    {"one text that is too large", "function go() { 'x'.repeat(1e9); }", "RangeError"},
    {"a value of the scene", "function go() { const a = new MFVec3f(); for (;;) a.push(new SFVec3f(1, 2, 3)); }", "it is not called again"},
    {"promises", "function go() { const a = []; for (;;) a.push(new Promise(() => { })); }", "scripts may hold 32 MiB"},
    // Recursing.
    {"a function", "function go() { go(); }", "InternalError: too much recursion"},
    {"a getter", "const o = {get x() { return this.x; }}; function go() { o.x; }", "InternalError: too much recursion"},
    {"a text of itself", "const a = {toString() { return '' + this; }}; function go() { print(a); }", "InternalError: too much recursion"},
    {"a proxy of itself", "const p = new Proxy({}, {get: (t, k, r) => r[k]}); function go() { p.x; }", "InternalError: too much recursion"},
    {"a program that is nested", "function go() { eval('('.repeat(1e5) + ')'.repeat(1e5)); }", "InternalError: too much recursion"},
    {"nodes within nodes", "function go() { Browser.createVrmlFromString('Group { children '.repeat(100000)); }", "100000 levels deep"},
    {"one's own node within itself", "const g = Browser.currentScene.createNode('Group'); function go() { g.children = new MFNode(g); }", "contain itself"},
    // Throwing.
    {"an error", "function go() { throw new Error('mine'); }", "line 1: Error: mine"},
    {"anything", "function go() { throw {toString() { for (;;); }}; }", "uncaught exception: Object"},
    {"an error that says too much", "function go() { throw new Error('x'.repeat(1e6)); }", "Error: xxx"},
    {"an error whose stack is a program", "function go() { const e = new TypeError('odd'); Object.defineProperty(e, 'stack', {get() { for (;;); }}); throw e; }", "TypeError: odd"},
    {"what does not parse", "function go( { }", "SyntaxError"},
    {"in a conversion", "function go() { out = {get length() { throw new RangeError('late'); }}; }", "RangeError: late"},
    {"instead of an error's constructor", "TypeError = function() { throw 'none'; }; function go() { out = new SFVec3f(); }", "uncaught exception: none"},
    // Promising.
    {"a chain", "function step() { Promise.resolve().then(step); } function go() { step(); }", "ran longer"},
    {"waiting for ever", "async function go() { for (;;) await null; }", "ran longer"},
    {"a rejection", "function go() { Promise.reject(new Error('lost')); }", "Error: lost (a promise that nothing handles)"},
    {"a thousand rejections", "function go() { for (let i = 0; i < 1000; ++i) Promise.reject(i); }", "more promises that nothing handles"},
    {"rejections made by looking at them", "function odd() { const e = {}; Object.defineProperty(e, 'stack', {get() { Promise.reject(odd()); }}); return e; } function go() { Promise.reject(odd()); }", "Object (a promise that nothing handles)"},
    {"a thenable that loops", "function go() { Promise.resolve({then() { for (;;); }}); }", "ran longer"},
    {"a module", "function go() { import('other.js'); }", "import"},
    // Loading.
    {"a file that is not there", "function go() { Browser.loadURL(['none.x3dv']); }", "was not loaded"},
    {"a file that may not be opened", "function go() { Browser.createX3DFromURL(['/etc/hostname']); }", "line 1: Error"},
    {"more than a frame can", "function go() { for (;;) Browser.loadURL(['none.x3dv']); }", "Error: 64 documents are asked for already"},
    {"a text that is none", "function go() { Browser.createX3DFromString('}'); }", "unexpected '}'"},
    {"a program that is not there", "function go() { Browser.currentScene.getNamedNode('S').url = new MFString('none.js'); }", "none.js"},
    {"itself, again and again", "function initialize() { const s = Browser.currentScene.getNamedNode('S'); s.url = new MFString(s.url[0] + ' '); } function go() { throw 'anew'; }", "anew"},
};
// clang-format on

constexpr const char* kOthers = R"(
DEF C TimeSensor { loop TRUE cycleInterval 8 }
DEF I PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 8 0 0 ] }
DEF M Transform { }
DEF W Script { inputOnly SFFloat set_fraction outputOnly SFFloat out url "ecmascript: function set_fraction(f) { out = 8 * f; }" }
ROUTE C.fraction_changed TO I.set_fraction
ROUTE I.value_changed TO M.translation
ROUTE C.fraction_changed TO W.set_fraction
)";

[[maybe_unused]] void take(const Variant& variant) {
    SCOPED_TRACE(variant.name);
    std::string program;
    for (const char* c = variant.program; *c; ++c) program += *c == '\\' ? std::string("\\\\") : std::string(1, *c);
    // Where memory is what ends it, time must not, however slow the build.
    const bool byMemory = std::string_view(variant.diagnostic).find("may hold") != std::string_view::npos;
    ScriptScene s("directOutput TRUE inputOnly SFBool go outputOnly MFFloat out", program, kOthers,
                  limits(true, byMemory ? 60 : .1, std::size_t{32} << 20));
    for (int i = 0; i < 3; ++i) {
        s.send("go", true);
        s.frame();
    }
    EXPECT_NE(s.problems().find(variant.diagnostic), std::string::npos) << s.problems();
    EXPECT_LT(s.problems().size(), 20'000u);
    s.frame();
    EXPECT_EQ(s.scene.now(), 4);
    EXPECT_FLOAT_EQ(s.get<Vec3f>("translation", "M").x, 4) << "another node's route";
    EXPECT_FLOAT_EQ(s.get<float>("out", "W"), 4) << "another's program";
}

#ifndef __SANITIZE_THREAD__  // SpiderMonkey, as packaged not instrumented, faults in its collector there
TEST(ScriptEngine, EveryWayToHoldUpTheSceneEndsInADiagnosticAndTheSceneGoesOn) {
    // The limit of memory is read when the first script of a thread runs.
    std::thread([] {
        for (const Variant& variant : kVariants) take(variant);
    }).join();
}
#endif

/// How often something is said of scripts.
std::size_t timesReportedIn(Scene& scene, std::string_view text) {
    std::size_t count = 0;
    for (const Diagnostic& d : scene.diagnostics().all()) count += d.text.find(text) != std::string::npos;
    return count;
}

ScriptOptions limitedTo(double seconds) {
    ScriptOptions options;
    options.timeLimit = seconds;
    return options;
}

TEST(ScriptEngine, ManyThatLoopShareTheTimeOfAFrame) {
    // Each is stopped after .05 s, so after .25 s of a frame's five, and those that never got their turn are ended too.
    std::string scripts;
    for (int i = 0; i < 40; ++i) scripts += "Script { url \"ecmascript: function initialize() { for (;;); }\" } ";
    ScriptScene s("outputOnly SFInt32 n", "function prepareEvents() { n = n + 1; }", scripts, limitedTo(.05));
    s.frame();
    EXPECT_GE(timesReportedIn(s.scene, "ran longer than 0.05 s"), 1u);
    EXPECT_LE(timesReportedIn(s.scene, "ran longer than 0.05 s"), 6u);
    EXPECT_EQ(timesReportedIn(s.scene, "scripts ran longer than 0.25 s in one frame"), 1u) << s.problems();
    const std::size_t reported = s.scene.diagnostics().all().size();
    s.frame();
    s.frame();
    EXPECT_EQ(s.scene.diagnostics().all().size(), reported) << "nobody is left who loops: " << s.problems();
}

TEST(ScriptEngine, OneThatRunsOverItsLimitCostsTheOthersNothing) {
    // The making of nodes is not stopped half way: one call takes longer than all of a frame may.
    ScriptScene s("inputOnly SFBool go", "function go() { Browser.createVrmlFromString('Group { } '.repeat(300000)); }",
                  kOthers, limitedTo(.05));
    s.send("go", true);
    s.frame();
    EXPECT_GE(timesReportedIn(s.scene, "ran longer than 0.05 s"), 1u) << s.problems();
    EXPECT_EQ(timesReportedIn(s.scene, "in one frame"), 0u) << s.problems();
    s.frame();
    EXPECT_FLOAT_EQ(s.get<float>("out", "W"), static_cast<float>(s.scene.now()));
}

TEST(ScriptEngine, WhereNoThreadCouldStopThemNoProgramRuns) {
    const std::string fields = "outputOnly SFInt32 n", program = "function initialize() { n = 1; }";
    {
        ScriptScene before(fields, program);  // the library has its own threads
        before.frame();
        ASSERT_EQ(before.get<std::int32_t>("n"), 1);
    }
    const test::NoThreads none;
    ScriptScene s(fields, program);
    s.frame();
    EXPECT_NE(s.problems().find("the script engine does not start"), std::string::npos) << s.problems();
    EXPECT_EQ(s.get<std::int32_t>("n"), 0);
}

TEST(ScriptEngine, OneThatMakesOthersLikeItselfEndsInADiagnostic) {
    ScriptScene s("directOutput TRUE",
                  "function prepareEvents() { "
                  "Browser.createX3DFromString(Browser.currentScene.getNamedNode('S').toXMLString()); }",
                  {}, limitedTo(.02));
    for (int i = 0; i < 6 && timesReportedIn(s.scene, "in one frame") == 0; ++i) s.frame();
    EXPECT_GE(timesReportedIn(s.scene, "scripts ran longer than 0.1 s in one frame"), 1u) << s.problems();
    s.frame();
    s.frame();
    EXPECT_GE(timesReportedIn(s.scene, "scripts ran longer than 0.02 s in one frame"), 1u)
        << "less in the frames after it";
}

TEST(ScriptEngine, WhatAFrameTookIsNotHeldAgainstTheNext) {
    // Some ms a frame: together more than the .5 s that one frame has.
    ScriptScene s("inputOnly SFInt32 go outputOnly SFInt32 n",
                  "function go(v) { let x = 0; for (let i = 0; i < 3e6; ++i) x = (x * 31 + i) | 0; n = v + 0 * x; }",
                  {}, limitedTo(.1));
    for (int i = 1; i <= 200; ++i) {
        s.send("go", i);
        s.frame();
        ASSERT_EQ(s.get<std::int32_t>("n"), i) << s.problems();
    }
    EXPECT_TRUE(s.scene.diagnostics().all().empty()) << s.problems();
}

TEST(ScriptEngine, AnEventThatComesBackWhileAProgramIsLoadedIsNotHandled) {
    ScriptScene s("directOutput TRUE inputOnly SFInt32 go outputOnly SFInt32 n",
                  "Browser.currentScene.getNamedNode('O').step = 1; function go(v) { n = v; }",
                  "DEF O Script { directOutput TRUE inputOnly SFInt32 step url \"ecmascript: function step(v) { "
                  "print('step'); Browser.currentScene.getNamedNode('S').go = v; }\" }");
    s.frame();
    EXPECT_EQ(s.printed, "step\n") << s.problems();
    EXPECT_EQ(s.get<std::int32_t>("n"), 0);
    s.send("go", 7);
    s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 7) << s.problems();
}

TEST(ScriptEngine, WhatWentWrongIsToldInAFewWords) {
    ScriptScene s("", "function prepareEvents() { throw new Error('\xC3\xA4'.repeat(1e6)); }");
    s.frame();
    ASSERT_EQ(s.scene.diagnostics().all().size(), 1u);
    const std::string text = s.scene.diagnostics().all()[0].text;
    EXPECT_LT(text.size(), 1100u);
    EXPECT_EQ(text.substr(text.size() - 5), "\xC3\xA4...") << "cut between two characters";
}

TEST(ScriptEngine, AThousandDifferentComplaintsAreCountedAndNotKept) {
    ScriptScene s("outputOnly SFInt32 n",
                  "function prepareEvents() { n = n + 1; for (let i = 0; i < 5; ++i) Promise.reject(5 * n + i); }");
    for (int i = 0; i < 400; ++i) s.frame();
    EXPECT_EQ(s.get<std::int32_t>("n"), 400);
    EXPECT_EQ(s.scene.diagnostics().all().size() + s.scene.diagnostics().dropped(), 2000u);
    EXPECT_LE(s.scene.diagnostics().all().size(), 1000u);
}

/// It ends after the engine's own static data, whose threads must be gone before the engine's memory is.
TEST(ScriptEngineDeathTest, ASceneMayLiveAsLongAsTheProcess) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const auto run = [] {
        static Scene scene;
        runScripts(scene);
        Diagnostics diagnostics("test");
        const bool loaded = loadText(scene,
                                     "#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { outputOnly SFInt32 n url "
                                     "\"ecmascript: function initialize() { n = 1; } function shutdown() {}\" }\n",
                                     diagnostics);
        scene.newFrame(1);
        const Node& script = scene.node(scene.findName("S"));
        std::exit(loaded && script.value(script.type().find("n")).as<std::int32_t>() == 1 ? 0 : 1);
    };
    EXPECT_EXIT(run(), testing::ExitedWithCode(0), "");
}

const char* const kCounting =
    "#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { outputOnly SFInt32 n url \"ecmascript: function prepareEvents() { "
    "for "
    "(let i = 0; i < 1000; ++i) n = n + 1; }\" }\n";

void startCounting(Scene& scene) {
    Diagnostics diagnostics("test");
    runScripts(scene);
    (void)loadText(scene, kCounting, diagnostics);
    scene.newFrame(0);
}

/// exit() destroys nothing that is on a stack or on the heap.
TEST(ScriptEngineDeathTest, AProcessMayEndWithScenesInIt) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const auto run = [] {
        static auto* const kept = new Scene;
        static Scene ended;  // before the engine, and its programs with it
        Scene scene;
        for (Scene* one : {kept, &ended, &scene}) startCounting(*one);
        std::exit(7);
    };
    EXPECT_EXIT(run(), testing::ExitedWithCode(7), "");
}

TEST(ScriptEngineDeathTest, AProcessMayEndWhileOtherThreadsRunScripts) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const auto run = [] {
        static std::atomic<int> running = 0;
        const auto frames = [] {
            auto* const scene = new Scene;
            startCounting(*scene);
            for (int frame = 1;; ++frame) {
                scene->newFrame(frame);
                if (frame == 3) ++running;
            }
        };
        std::thread(frames).detach();
        std::thread(frames).detach();
        while (running < 2) std::this_thread::yield();
        std::exit(7);
    };
    EXPECT_EXIT(run(), testing::ExitedWithCode(7), "");
}

}  // namespace
}  // namespace rtsg
