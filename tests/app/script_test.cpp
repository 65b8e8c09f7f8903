// Hostile and curious scripts, through the program: it goes on, and says the same wherever it runs.
#include <sys/resource.h>

#include "program.h"
#include "support/own_heap.h"

namespace rtsg {
namespace {

using namespace test;

std::string scriptScene(const std::string& fields, const std::string& program) {
    return "#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { " + fields + " url \"ecmascript:" + program + "\" }\n";
}

TEST(ScriptProgram, PromisesAndImportsDoNotEndTheProcess) {
    const TempFolder folder;
    writeFile(folder / "s.x3dv", scriptScene("outputOnly SFInt32 n",
                                             "async function* g() { yield 1; }\n"
                                             "async function initialize() {\n"
                                             "  for await (const x of g()) print('got ' + x);\n"
                                             "  await import('other.js');\n"
                                             "}"));
    const Outcome run = Program({"run", folder / "s.x3dv", "--for", "0.1"}, folder / "run").wait();
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_NE(run.out.find("got 1"), std::string::npos) << run.out;
    EXPECT_NE(run.err.find("import"), std::string::npos) << run.err;
}

TEST(ScriptProgram, WhatFailsInShutdownIsTold) {
    const TempFolder folder;
    writeFile(folder / "s.x3dv", scriptScene("", "function shutdown() { print('bye'); throw new Error('too late'); }"));
    for (const std::vector<std::string>& verb : {std::vector<std::string>{"run", folder / "s.x3dv"},
                                                 {"record", folder / "s.x3dv", "-o", folder / "s.rlog"},
                                                 {"serve", folder / "s.x3dv", "--bind", "ipc://" + folder / "s"}}) {
        std::vector<std::string> arguments = verb;
        arguments.insert(arguments.end(), {"--for", "0.1s"});
        const Outcome run = Program(arguments, folder / "run").wait();
        EXPECT_EQ(run.status, 0) << verb[0];
        EXPECT_NE(run.out.find("bye"), std::string::npos) << verb[0] << run.out;
        const std::size_t reported = run.err.find("too late");
        EXPECT_NE(reported, std::string::npos) << verb[0] << run.err;
        EXPECT_EQ(run.err.find("too late", reported + 1), std::string::npos) << verb[0] << run.err;
    }
}

TEST(ScriptProgram, AnEventForANodeThatHasGoneIsNamed) {
    const TempFolder folder;
    writeFile(folder / "s.x3dv",
              scriptScene("directOutput TRUE inputOnly SFBool go", "function go() { Browser.replaceWorld(null); }"));
    const Outcome run = Program({"run", folder / "s.x3dv", "--for", "1s", "--fps", "10", "--set", "S.go=TRUE@0.2",
                                 "--set", "S.go=TRUE@0.5"},
                                folder / "run")
                            .wait();
    EXPECT_EQ(run.status, 1);
    EXPECT_NE(run.err.find("S.go=TRUE@0.5: its node is no longer there"), std::string::npos) << run.err;
    EXPECT_EQ(run.err.find("@0.2"), std::string::npos) << run.err;
}

/// The frames' hashes, with TZ and LC_ALL set so.
std::string hashesIn(const TempFolder& folder, const char* zone, const char* locale) {
    ::setenv("TZ", zone, 1);
    ::setenv("LC_ALL", locale, 1);
    const Outcome run = Program({"run", folder / "s.x3dv", "--for", "0.1", "--hash"}, folder / "run").wait();
    ::unsetenv("TZ");
    ::unsetenv("LC_ALL");
    EXPECT_EQ(run.status, 0) << run.err;
    return run.out;
}

TEST(ScriptProgram, TheMachinesTimeZoneAndLocaleDoNotMoveTheHash) {
    const TempFolder folder;
    writeFile(folder / "s.x3dv", scriptScene("outputOnly MFString seen", R"(
        function initialize() {
            const d = new Date(2020, 5, 1, 12, 30);
            seen = new MFString(String(d), d.toLocaleString(), d.getTimezoneOffset(), d.getTime(), d.getHours(), Date(),
                                Date.parse('2020-06-01T12:00'), (1234.5).toLocaleString(), 'I'.toLocaleLowerCase(),
                                new Intl.DateTimeFormat().resolvedOptions().locale, new Intl.DateTimeFormat().format(d),
                                ['z', 'a', 'ä'].sort((a, b) => a.localeCompare(b)).join());
        })"));
    const std::string here = hashesIn(folder, "UTC", "C");
    EXPECT_NE(here.find("hash"), std::string::npos) << here;
    EXPECT_EQ(hashesIn(folder, "America/New_York", "C"), here);
    EXPECT_EQ(hashesIn(folder, "Asia/Kathmandu", "C"), here);
    EXPECT_EQ(hashesIn(folder, "UTC", "de_DE.UTF-8"), here);
    EXPECT_EQ(hashesIn(folder, "UTC", "tr_TR.UTF-8"), here);
}

TEST(ScriptProgram, AStringOvershootsByItsOwnLengthAndNoMore) {
    const TempFolder folder;
    // 2^29 characters in one step, where the engine lets nobody look in between.
    writeFile(
        folder / "s.x3dv",
        scriptScene("outputOnly SFInt32 n",
                    "var s = 'x'; function initialize() { for (let i = 0; i < 29; ++i) s += s; s.indexOf('y'); }"));
    const Outcome run = Program({"run", folder / "s.x3dv", "--for", "0.1"}, folder / "run").wait();
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_NE(run.err.find("out of memory, scripts may hold 256 MiB"), std::string::npos) << run.err;
    rusage usage{};
    ASSERT_EQ(::getrusage(RUSAGE_CHILDREN, &usage), 0);
    const long maximum = (RTSG_HEAP_IS_OURS ? 256 + 512 + 96 : 2048) << 10;  // KiB
    EXPECT_LT(usage.ru_maxrss, maximum);
}

}  // namespace
}  // namespace rtsg
