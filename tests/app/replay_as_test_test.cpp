// A recorded session as a test from the command line: rtsg record --set, rtsg replay --rerun, --expect-..., --update.
#include "program.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class ReplayAsTest : public CommandLine {
  protected:
    void SetUp() override {
        CommandLine::SetUp();
        const Outcome created = rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "20", "--set",
                                      "CLOCK.enabled=FALSE@0.5", "--set", "FLAG.set_boolean=TRUE@0.7", "--json"});
        ASSERT_EQ(created.status, 0) << created.err;
        ASSERT_EQ(json::parse(created.out)["frames"], 21);
    }
    Outcome rerun(std::vector<std::string> more = {}) {
        std::vector<std::string> arguments = {"replay", "--json", log, "--rerun", file};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return rtsg(arguments);
    }
    const std::vector<std::string> small = {"--size", "48x32", "--spp", "1"};
    std::vector<std::string> withPicture(std::vector<std::string> more) const {
        more.insert(more.end(), small.begin(), small.end());
        more.insert(more.end(), {"--expect-picture", picture});
        return more;
    }

    const std::string log = folder / "a.rlog", picture = folder / "a.png", sound = folder / "a.wav";
};

TEST_F(ReplayAsTest, TheSameScenePasses) {
    const Outcome same = rerun();
    EXPECT_EQ(same.status, 0) << same.err;
    const json report = json::parse(same.out);
    EXPECT_EQ(report["frames"], report["verified"]);
    EXPECT_TRUE(report["passed"]);
    EXPECT_TRUE(report["first_divergence"].is_null());
}

TEST_F(ReplayAsTest, AnotherSceneFailsNamingWhatIsOther) {
    writeFile(file, scene("3"));
    const Outcome other = rerun();
    EXPECT_EQ(other.status, 1);
    const json report = json::parse(other.out);
    EXPECT_FALSE(report["passed"]);
    EXPECT_EQ(report["first_divergence"]["node"], "PATH");
    EXPECT_EQ(report["first_divergence"]["field"], "keyValue");
    EXPECT_THAT(other.err, HasSubstr("PATH.keyValue: recorded [0 0 0, 2 0 0], now [0 0 0, 3 0 0]"));
    // Recorded anew, it passes, and the old one no longer does.
    EXPECT_EQ(rerun({"--update"}).status, 0);
    EXPECT_EQ(rerun().status, 0);
    writeFile(file, scene());
    EXPECT_EQ(rerun().status, 1);
}

TEST_F(ReplayAsTest, PicturesAndSoundsAreComparedWithinTolerances) {
    const Outcome none = rerun(withPicture({}));
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("a.png"));
    const std::vector<std::string> heard = {"--expect-sound", sound, "--rays", "2000", "--stereo"};
    const auto both = [&](std::vector<std::string> more) {
        more.insert(more.end(), heard.begin(), heard.end());
        return withPicture(std::move(more));
    };
    ASSERT_EQ(rerun(both({"--update"})).status, 0);
    const Outcome same = rerun(both({}));
    EXPECT_EQ(same.status, 0) << same.err;
    // A picture of another moment, and a sound that is another: the log alone is replayed, so that only they differ.
    ASSERT_EQ(
        rtsg({"replay", "--json", log, "--seek", "0.1s", "--render", picture, "--size", "48x32", "--spp", "1"}).status,
        0);
    const Outcome moved = rerun(both({}));
    EXPECT_EQ(moved.status, 1);
    EXPECT_THAT(moved.err, HasSubstr("differs from " + picture + ": rmse"));
    EXPECT_EQ(rerun(both({"--picture-tolerance", "10"})).status, 0);
}

/// They all put what they made into the current folder, under the names of their references.
TEST_F(ReplayAsTest, TestsSideBySideCompareTheirOwnPictures) {
    const std::string other = folder / "other/a.png";
    std::filesystem::create_directory(folder / "other");
    ASSERT_EQ(rerun(withPicture({"--update"})).status, 0);
    ASSERT_EQ(rtsg({"replay", log, "--seek", "0.1s", "--for", "0s", "--render", other, "--size", "48x32"}).status, 0);
    const auto begin = [&](const std::string& reference) {
        return Program({"replay", log, "--rerun", file, "--size", "48x32", "--spp", "1", "--expect-picture", reference},
                       streams());
    };
    for (int round = 0; round < 10; ++round) {
        Program right = begin(picture), wrong = begin(other);
        const Outcome same = right.wait(), another = wrong.wait();
        EXPECT_EQ(same.status, 0) << same.err;
        EXPECT_EQ(another.status, 1) << another.err;
    }
}

TEST_F(ReplayAsTest, ChosenFieldsOutliveEditsOfTheDocument) {
    writeFile(file, scene() + "WorldInfo { title \"more\" }\n");
    EXPECT_EQ(rerun().status, 1);
    const Outcome fields =
        rerun({"--field", "BOX.*", "--field", "FLAG.*", "--ignore", "initial", "--tolerance", "1e-4"});
    EXPECT_EQ(fields.status, 0) << fields.err;
    EXPECT_GT(json::parse(fields.out)["fields"], 2);
}

/// Ten of them by name, and how many others there are.
TEST_F(ReplayAsTest, FieldsThatDifferAreNamedUpToTen) {
    constexpr int kAll = 13;
    const auto positions = [](int moved) {
        std::string text = "#X3D V4.0 utf8\n";
        for (int i = 0; i < kAll; ++i)
            text += "DEF T" + std::to_string(i) + " Transform { translation 1 " + (i < moved ? "3" : "2") + " 0 }\n";
        return text;
    };
    writeFile(file, positions(0));
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.2s", "--fps", "20", "--force"}).status, 0);
    for (const int moved : {1, 9, 10, 11, kAll}) {
        SCOPED_TRACE(moved);
        writeFile(file, positions(moved));
        const Outcome reported = rtsg({"replay", log, "--rerun", file, "--field", "*.translation"});
        EXPECT_EQ(reported.status, 1);
        int also = 0;
        for (auto at = reported.err.find("  also T"); at != std::string::npos;
             at = reported.err.find("  also T", at + 1))
            ++also;
        EXPECT_EQ(also, std::min(moved, 10) - 1) << reported.err;
        const std::string rest =
            moved == 11 ? "and 1 more field\n" : "and " + std::to_string(moved - 10) + " more fields\n";
        EXPECT_EQ(reported.err.find(rest) != std::string::npos, moved > 10) << reported.err;
        EXPECT_EQ(reported.err.find("more field") != std::string::npos, moved > 10) << reported.err;
        EXPECT_EQ(json::parse(rerun({"--field", "*.translation"}).out)["differences"].size(), moved);
    }
}

TEST_F(ReplayAsTest, WhatComparesNothingDoesNotPass) {
    for (const char* ignored : {"BOX.*", "*.*"}) {
        const Outcome rerunOfNothing = rerun({"--field", "BOX.*", "--ignore", ignored});
        EXPECT_EQ(rerunOfNothing.status, 1) << ignored;
        EXPECT_NE(rerunOfNothing.out.find("nothing was compared"), std::string::npos) << rerunOfNothing.out;
        EXPECT_EQ(rerunOfNothing.err.find("frame "), std::string::npos) << "it is of none: " << rerunOfNothing.err;
        for (const std::string& one : {file, log}) {
            const Outcome diff = rtsg({"diff", one, one, "--field", "BOX.*", "--ignore", ignored});
            EXPECT_EQ(diff.status, 1) << one;
            EXPECT_NE(diff.err.find("nothing was compared"), std::string::npos) << diff.err;
        }
    }
}

/// A test goes on without, as what was left out may be gone from the scene.
TEST_F(ReplayAsTest, WhatIsIgnoredInVainIsTold) {
    const Outcome reported = rerun({"--ignore", "PATHH.keyValue", "--ignore", "FLAG.*"});
    EXPECT_EQ(reported.status, 0) << reported.err;
    EXPECT_THAT(reported.err, HasSubstr("warning: --ignore PATHH.keyValue: there is no such field"));
    EXPECT_THAT(reported.err, testing::Not(HasSubstr("FLAG")));
    const Outcome diff = rtsg({"diff", log, log, "--ignore", "FLAGG.*"});
    EXPECT_EQ(diff.status, 0) << diff.err;
    EXPECT_THAT(diff.err, HasSubstr("warning: --ignore FLAGG.*: there is no such field"));
    EXPECT_THAT(rtsg({"diff", file, file, "--ignore", "FLAGG.*"}).err, HasSubstr("FLAGG"));
}

/// Earlier pieces are other files: this is no test of the whole session, and cannot be recorded again.
TEST_F(ReplayAsTest, ALaterPieceOfALogIsNotRunAgain) {
    const std::string pieces = folder / "pieces.rlog";
    const Outcome created =
        rtsg({"serve", file, "--for", "1.2s", "--fps", "20", "--record", pieces, "--rotate", "0.4s"});
    ASSERT_EQ(created.status, 0) << created.err;
    const auto before = std::filesystem::file_size(pieces);
    for (const bool updates : {false, true}) {
        const Outcome refused =
            updates ? rtsg({"replay", pieces, "--rerun", file, "--update"}) : rtsg({"replay", pieces, "--rerun", file});
        EXPECT_EQ(refused.status, 1);
        EXPECT_THAT(refused.err, HasSubstr("pieces.rlog: error: this is a later piece of a log, from "));
    }
    EXPECT_EQ(std::filesystem::file_size(pieces), before);
    EXPECT_EQ(rtsg({"replay", folder / "pieces.0001.rlog", "--rerun", file}).status, 0) << "the first one";
}

/// An empty number, a variable of a shell that is not set say, is not 0.
TEST_F(ReplayAsTest, AnEmptyNumberIsWrongUsage) {
    for (const char* option : {"--tolerance", "--picture-tolerance", "--fps"})
        EXPECT_EQ(rerun({option, ""}).status, 2) << option;
    EXPECT_THAT(rerun({"--tolerance", ""}).err, HasSubstr("--tolerance: a value is empty"));
}

/// A scene file, and a log as the scene that it begins with, at a clock of today and at one that begins with 0.
TEST_F(ReplayAsTest, ASceneFileRunsAsItsDocument) {
    const std::string compact = folder / "a.rtsgb", run = folder / "run.rlog", other = folder / "other.png";
    ASSERT_EQ(rtsg({"convert", file, compact}).status, 0);
    ASSERT_EQ(rtsg(atZero({"record", file, "-o", log, "--for", "1s", "--force"})).status, 0);
    for (const std::string at : {"2000-01-01", "0"}) {
        const auto render = [&](const std::string& scene, const std::string& into) {
            const Outcome created = rtsg({"render", "--at", at, scene, "-o", into, "--size", "48x32", "--time", "0s"});
            EXPECT_EQ(created.status, 0) << scene << created.err;
            return readFile(into);
        };
        const std::string expected = render(file, picture);
        EXPECT_EQ(render(compact, other), expected) << at;
        EXPECT_EQ(render(log, other), expected) << at;
        const Outcome created =
            rtsg({"record", "--at", at, compact, "-o", run, "--for", "1s", "--set", "BOX.scale=2 1 1@0.5", "--force"});
        ASSERT_EQ(created.status, 0) << created.err;
        const Outcome again = rtsg({"replay", run, "--rerun", compact, "--json"});
        EXPECT_EQ(again.status, 0) << again.err;
        EXPECT_GT(json::parse(again.out)["verified"], 60);
        const Outcome moved = rtsg({"replay", run, "--blame", "BOX.translation"});
        EXPECT_THAT(moved.out, HasSubstr("changes)")) << "its clock runs";
    }
    // Time does not go back from the state that a log begins with.
    const std::string later = folder / "later.rlog";
    ASSERT_EQ(rtsg({"record", "--at", "2020-01-01", file, "-o", later, "--for", "0.1s"}).status, 0);
    const Outcome back = rtsg({"render", "--at", "2000-01-01", later, "-o", other, "--size", "48x32"});
    EXPECT_EQ(back.status, 1);
    EXPECT_THAT(back.err, HasSubstr("--at: it begins with a state of a later time, 2020-01-01T00:00:00Z"));
}

TEST_F(ReplayAsTest, AFailureLeavesAPageAndJUnitXml) {
    const std::string page = folder / "a.html", junit = folder / "a.xml";
    ASSERT_EQ(rerun(withPicture({"--update"})).status, 0);
    const std::vector<std::string> reports = {"--field", "BOX.translation", "--tolerance", "1e-4",   "--page",
                                              page,      "--junit",         junit,         "--name", "slide <&>"};
    writeFile(file, scene("3"));
    const Outcome failed = rerun(withPicture(reports));
    EXPECT_EQ(failed.status, 1);
    const json report = json::parse(failed.out);
    ASSERT_EQ(report["differences"].size(), 1);
    EXPECT_EQ(report["differences"][0]["node"], "BOX");
    const std::string html = readFile(page), xml = readFile(junit);
    EXPECT_THAT(html, HasSubstr("slide &lt;&amp;&gt;"));
    EXPECT_THAT(html, HasSubstr("<b>BOX.translation</b>"));
    EXPECT_THAT(html, HasSubstr("ROUTE CLOCK.fraction_changed &gt; PATH.set_fraction, PATH.value_changed &gt; BOX."));
    EXPECT_THAT(html, HasSubstr("<polyline"));
    // Both pictures and their difference, and nothing that has to be fetched.
    std::size_t pictures = 0;
    for (auto at = html.find("src="); at != html.npos; at = html.find("src=", at + 1)) {
        EXPECT_EQ(html.substr(at, 28), "src=\"data:image/png;base64,i");
        ++pictures;
    }
    EXPECT_EQ(pictures, 3u);
    EXPECT_EQ(html.find("http"), html.npos);
    EXPECT_THAT(xml, HasSubstr("<testsuite name=\"slide &lt;&amp;&gt;\" tests=\"2\" failures=\"2\""));
    EXPECT_THAT(xml, HasSubstr("BOX.translation"));
    // The page of a failure does not outlive it.
    writeFile(file, scene());
    EXPECT_EQ(rerun(withPicture(reports)).status, 0);
    EXPECT_FALSE(std::filesystem::exists(page));
    EXPECT_THAT(readFile(junit), HasSubstr("failures=\"0\""));
}

/// Nobody asked for pictures: what is to be seen are the two scenes where they part.
TEST_F(ReplayAsTest, ThePageOfAFailureShowsBothScenesWhereTheyFirstDiffer) {
    const std::string page = folder / "a.html";
    writeFile(file, scene("3"));
    for (const std::vector<std::string>& chosen : {std::vector<std::string>{}, {"--field", "BOX.translation"}}) {
        std::filesystem::remove(page);
        std::vector<std::string> words = {"--page", page};
        words.insert(words.end(), chosen.begin(), chosen.end());
        words.insert(words.end(), small.begin(), small.end());
        const Outcome failed = rerun(words);
        EXPECT_EQ(failed.status, 1);
        const json first = json::parse(failed.out).at("first_divergence");
        const std::string html = readFile(page);
        EXPECT_THAT(html, HasSubstr("<h2>Pictures of state " + first.at("frame").dump() + ", the first that differed"));
        std::size_t pictures = 0;
        for (auto at = html.find("src="); at != html.npos; at = html.find("src=", at + 1)) {
            EXPECT_EQ(html.substr(at, 28), "src=\"data:image/png;base64,i");
            ++pictures;
        }
        EXPECT_EQ(pictures, 3u);
    }
}

TEST_F(ReplayAsTest, WithoutALogItSaysHowToRecordOne) {
    const Outcome none = rtsg({"replay", folder / "none.rlog", "--rerun", file});
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("rtsg record " + file + " -o " + (folder / "none.rlog")));
}

/// A reader of the reports only must see a failure, and not the report of the run before.
TEST_F(ReplayAsTest, ATestThatCannotRunIsReportedAsFailed) {
    const std::string junit = folder / "a.xml";
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"replay", folder / "none.rlog", "--rerun", file},
          {"replay", log, "--rerun", folder / "none.x3dv"}}) {
        writeFile(junit, "old");
        std::vector<std::string> words = arguments;
        words.insert(words.end(), {"--junit", junit});
        EXPECT_EQ(rtsg(words).status, 1);
        EXPECT_THAT(readFile(junit), HasSubstr("failures=\"1\"")) << arguments[1];
        EXPECT_THAT(readFile(junit), HasSubstr("none.")) << arguments[1];
        // How to get what is missing, as on the terminal.
        const bool hasRecipe = readFile(junit).contains("rtsg record " + file + " -o " + (folder / "none.rlog"));
        EXPECT_EQ(hasRecipe, arguments[1] != log) << readFile(junit);
    }
}

/// A reader of the reports only must see why there is no scene, and that a scene was incomplete, as the exit status
/// says.
TEST_F(ReplayAsTest, ReportsSayWhatIsWrongWithTheScene) {
    const std::string junit = folder / "a.xml", hurt = folder / "hurt.x3dv";
    EXPECT_EQ(rerun({"--junit", junit, "--rerun", folder / "none.x3dv"}).status, 2) << "one scene";
    EXPECT_EQ(rtsg({"replay", log, "--rerun", folder / "none.x3dv", "--junit", junit}).status, 1);
    EXPECT_THAT(readFile(junit), HasSubstr("No such file or directory"));
    writeFile(hurt, readFile(file) + "\nROUTE NOBODY.x TO BOX.translation\n");
    const Outcome rest = rtsg({"replay", log, "--rerun", hurt, "--junit", junit});
    EXPECT_EQ(rest.status, 1);
    EXPECT_THAT(rest.out, HasSubstr("22 of 22 states as recorded: failed"));
    EXPECT_THAT(rest.err, HasSubstr(hurt + " has 1 error: what was run is the rest of it"));
    EXPECT_THAT(readFile(junit), HasSubstr("failures=\"1\""));
}

TEST_F(ReplayAsTest, WhatIsWrongIsNamedAsItWasTyped) {
    EXPECT_THAT(rerun({"--field", "BOX.*", "--tolerance", "-1"}).err, HasSubstr("--tolerance: -1"));
    EXPECT_THAT(rerun({"--expect-picture", folder / "a.x3dv"}).err,
                HasSubstr("--expect-picture: " + (folder / "a.x3dv")));
    EXPECT_THAT(rerun({"--expect-sound", folder / "a.png"}).err, HasSubstr("--expect-sound: " + (folder / "a.png")));
}

/// Records a scene whose Script does something in its fifth frame, and runs it again, in each way.
class RerunOfScripts : public CommandLine {
  protected:
    void sameAgain(const std::string& nodes, const std::string& script, const std::string& routes = "",
                   const std::vector<std::string>& more = {}) {
        const std::string source = folder / "made.x3dv", log = folder / "made.rlog";
        writeFile(source,
                  "#X3D V3.3 utf8\nPROFILE Immersive\nDEF T TimeSensor { loop TRUE cycleInterval 2 startTime 1 }\n" +
                      nodes + "\nDEF SC Script { inputOnly SFTime tick outputOnly MFNode add outputOnly SFBool load " +
                      "url \"ecmascript: var n = 0; function tick(t) { n++; if (n == 5) { " + script +
                      " } }\" }\nROUTE T.time TO SC.tick\n" + routes);
        for (const std::vector<std::string>& how : {std::vector<std::string>{}, {"--inputs"}, {"--mode", "input"}}) {
            std::vector<std::string> record = {"record", source, "-o", log, "--for", ".5s", "--fps", "30", "--force"};
            record.insert(record.end(), how.begin(), how.end());
            record.insert(record.end(), more.begin(), more.end());
            const Outcome recorded = rtsg(record);
            ASSERT_EQ(recorded.status, 0) << recorded.err;
            const Outcome again = rtsg({"replay", "--json", log, "--rerun", source});
            EXPECT_EQ(again.status, 0) << (how.empty() ? "states" : how.back()) << ": " << again.err;
            if (again.status != 0) continue;
            const json report = json::parse(again.out);
            EXPECT_EQ(report["frames"], report["verified"]);
            EXPECT_GT(report["frames"], 10);
        }
    }
};

TEST_F(RerunOfScripts, NodesThatScriptsMakeAreMadeOnce) {
    const std::string group = "DEF G Group { }", route = "ROUTE SC.add TO G.addChildren\n";
    sameAgain(group, "add = new MFNode(Browser.createVrmlFromString('DEF M Transform { children Shape { } }')[0]);",
              route);
    sameAgain(group, "add = new MFNode(Browser.createX3DFromString('Transform { }').rootNodes[0]);", route);
}

TEST_F(RerunOfScripts, FilesThatScriptsAskForAreLoadedOnce) {
    writeFile(folder / "piece.x3dv", "#X3D V3.3 utf8\nPROFILE Immersive\nDEF P Transform { translation 1 2 3 }\n");
    writeFile(folder / "inl.x3dv",
              "#X3D V3.3 utf8\nPROFILE Immersive\nDEF C TimeSensor { loop TRUE cycleInterval 1 startTime 1 }\n"
              "DEF I PositionInterpolator { key [0 1] keyValue [0 0 0, 1 0 0] }\nDEF X Transform { }\n"
              "ROUTE C.fraction_changed TO I.set_fraction\nROUTE I.value_changed TO X.translation\n");
    sameAgain("DEF G Group { }",
              "Browser.createVrmlFromURL(new MFString('piece.x3dv'), Browser.currentScene.getNamedNode('G'), "
              "'addChildren');");
    const std::string inlined = "DEF IN Inline { url \"inl.x3dv\" load FALSE }";
    sameAgain(inlined, "load = true;", "ROUTE SC.load TO IN.load\n");
    sameAgain(inlined, "", "", {"--set", "IN.load=TRUE@.1"});
}

TEST_F(ReplayAsTest, DiffNamesWhatTwoScenesOrLogsDifferIn) {
    const std::string other = folder / "other.x3dv", otherLog = folder / "other.rlog";
    writeFile(other, scene("3"));
    const Outcome scenes = rtsg({"diff", file, other, "--json"});
    EXPECT_EQ(scenes.status, 1);
    EXPECT_EQ(json::parse(scenes.out)["count"], 1);
    EXPECT_EQ(json::parse(scenes.out)["differences"][0]["field"], "keyValue");
    EXPECT_EQ(rtsg({"diff", file, file}).status, 0);
    ASSERT_EQ(rtsg({"record", other, "-o", otherLog, "--for", "1s", "--fps", "20"}).status, 0);
    const Outcome logs = rtsg({"diff", log, otherLog, "--field", "BOX.translation", "--tolerance", "1e-4", "--json"});
    EXPECT_EQ(logs.status, 1);
    EXPECT_EQ(json::parse(logs.out)["differences"][0]["node"], "BOX");
    EXPECT_EQ(rtsg({"diff", log, log}).status, 0);
    EXPECT_EQ(rtsg({"diff", log, file}).status, 2);
    EXPECT_EQ(rtsg({"diff", log, otherLog, "--field", "BOX"}).status, 2);
}

TEST_F(ReplayAsTest, OptionsThatDoNotGoTogetherAreWrongUsage) {
    EXPECT_EQ(rtsg({"replay", "--json", log, "--update"}).status, 2);
    EXPECT_EQ(rtsg({"replay", "--json", log, "--field", "BOX.*"}).status, 2);
    EXPECT_EQ(rerun({"--field", "BOX"}).status, 2);
    EXPECT_EQ(rerun({"--junit", file}).status, 2);
    EXPECT_EQ(rerun(withPicture({"--render", folder / "b.png"})).status, 2);
    EXPECT_EQ(rtsg({"record", file, "-o", log, "--force", "--set", "NOBODY.on=TRUE@1"}).status, 2);
}

TEST_F(ReplayAsTest, ALogOfAnEarlierFormatIsVerifiedAndTheReportSaysSo) {
    const std::string old = RTSG_SOURCE_DIR "/tests/sync/conformance/format2/raw.rlog";
    const Outcome verified = rtsg({"replay", old, "--verify"});
    EXPECT_EQ(verified.status, 0) << verified.err;
    EXPECT_THAT(verified.out, HasSubstr("recorded in format 2, whose hashes were compared"));
    const json report = json::parse(rtsg({"replay", old, "--verify", "--json"}).out);
    EXPECT_EQ(report["frames"], report["verified"]);
    EXPECT_EQ(report["format"], 2);
    EXPECT_EQ(report["left_out"], 0);
    EXPECT_THAT(rtsg({"replay", log, "--verify"}).out, testing::Not(HasSubstr("format")));
    EXPECT_EQ(json::parse(rtsg({"replay", log, "--verify", "--json"}).out)["format"], 3);
}

}  // namespace
}  // namespace rtsg::test
