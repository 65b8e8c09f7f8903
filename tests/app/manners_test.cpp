// Help, suggestions, completion, the man page, reports as text or JSON.
#include "program.h"

#include <algorithm>
#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class Manners : public CommandLine {
  protected:
    /// The output of a shell command; the program is $RTSG.
    std::string shell(const std::string& command) {
        const std::string out = folder / "shell.out";
        ::setenv("RTSG", RTSG_PROGRAM, 1);
        EXPECT_EQ(std::system(("bash -c '" + command + "' > " + out + " 2>&1").c_str()), 0) << readFile(out);
        return readFile(out);
    }
    static std::vector<std::string> words(const std::string& text) {
        std::istringstream in(text);
        return {std::istream_iterator<std::string>(in), {}};
    }
    /// The verbs, as help names them.
    std::vector<std::string> verbs() {
        const std::string help = rtsg({"help"}).out;
        std::istringstream lines(help.substr(help.find("Subcommands:")));
        std::vector<std::string> names;
        std::string line;
        std::getline(lines, line);
        while (std::getline(lines, line) && line.starts_with("  "))
            if (line[2] != ' ') names.push_back(words(line).front());
        return names;
    }
    /// Every option of every verb, as --help names them.
    std::vector<std::string> options(const std::string& verb) {
        std::vector<std::string> names;
        for (std::string word : words(rtsg({verb, "--help"}).out)) {
            const auto isOption = [](const std::string& w) { return w.starts_with("--") && w.size() > 2; };
            if (const auto comma = word.find(','); comma != std::string::npos) word = word.substr(comma + 1);
            if (!isOption(word)) continue;
            names.push_back(word.substr(0, word.find_first_not_of("abcdefghijklmnopqrstuvwxyz-")));
        }
        std::ranges::sort(names);
        names.erase(std::unique(names.begin(), names.end()), names.end());
        return names;
    }
};

TEST_F(Manners, WhatIsMadeOfADamagedSceneIsThereAndSaidToBeOfTheRest) {
    writeFile(
        folder / "d.x3dv",
        "#X3D V4.0 utf8\nPROFILE Immersive\nShape { geometry Box { size 1 2 } }\nDEF S Sound { source AudioClip { "
        "} }\nShape { geometry Sphere { } }\n");
    const std::string scene = folder / "d.x3dv", picture = folder / "d.png", log = folder / "d.rlog";
    const std::vector<std::vector<std::string>> verbs{{"info", scene},
                                                      {"run", scene, "--for", ".1s"},
                                                      {"render", scene, "-o", picture, "--size", "16x16"},
                                                      {"record", scene, "-o", log, "--for", ".1s"},
                                                      {"measure", scene, "--irradiance", "0,0,2,0,0,1"},
                                                      {"pick", scene, "--ray", "0", "0", "9", "0", "0", "-1"},
                                                      {"diff", scene, scene},
                                                      {"validate", scene}};
    for (const auto& verb : verbs) {
        const Outcome outcome = rtsg(verb);
        EXPECT_EQ(outcome.status, 1) << verb.front() << outcome.out << outcome.err;
        EXPECT_THAT(outcome.err, HasSubstr("d.x3dv:3:33: error: expected 3 numbers")) << verb.front();
        const auto ofTheRest = HasSubstr("d.x3dv had 1 error: this was made of the rest of it");
        if (verb.front() != "validate") {
            EXPECT_THAT(outcome.err, ofTheRest) << verb.front();
        }
    }
    EXPECT_TRUE(std::filesystem::exists(picture));
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0) << "the log itself is whole";
    // Warnings are none: a picture that is not there is shown by its Material alone.
    writeFile(folder / "w.x3dv",
              "#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearance Appearance { texture "
              "ImageTexture { url \"no.png\" } } geometry Sphere { } }\n");
    EXPECT_EQ(rtsg({"render", folder / "w.x3dv", "-o", picture, "--size", "16x16"}).status, 0);
}

/// The reader of the file and the maker of the picture both find it.
TEST_F(Manners, WhatTwoPartsFindIsSaidOnce) {
    writeFile(folder / "m.x3dv",
              "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { texture MultiTexture { mode \"BRIGHTER\" "
              "texture PixelTexture { image 1 1 1 255 } } } geometry Box { } }\n");
    const std::string scene = folder / "m.x3dv", picture = folder / "m.png";
    const Outcome run = rtsg({"render", scene, "-o", picture, "--size", "8x8"});
    EXPECT_EQ(run.status, 0);
    const std::size_t first = run.err.find("BRIGHTER");
    EXPECT_NE(first, std::string::npos) << run.err;
    EXPECT_EQ(run.err.find("BRIGHTER", first + 1), std::string::npos) << run.err;
}

TEST_F(Manners, ReportsShowControlCharactersOfAScene) {
    // A name may hold U+009B, with which some terminals begin an order as with ESC and a bracket.
    writeFile(
        folder / "c.x3dv",
        "#X3D V4.0 utf8\nPROFILE Full\xc2\x9bm\nDEF A\xc2\x9bm Transform { children Shape { geometry Box { } } }\n");
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"info", folder / "c.x3dv"},
          std::vector<std::string>{"pick", folder / "c.x3dv", "--ray", "0", "0", "10", "0", "0", "-1"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_THAT(outcome.out, HasSubstr("\\x9bm")) << outcome.err;
        EXPECT_THAT(outcome.out + outcome.err, Not(HasSubstr("\x9b")));
    }
}

TEST_F(Manners, SaysWhatWasMeant) {
    const auto said = [&](const std::vector<std::string>& arguments) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        return outcome.err;
    };
    EXPECT_THAT(said({"rendr", file}), HasSubstr("did you mean render?"));
    EXPECT_THAT(said({"vaildate", file}), HasSubstr("did you mean validate?"));
    EXPECT_THAT(said({"rep", file}), HasSubstr("did you mean replay?"));
    EXPECT_THAT(said({"xyzzy", file}), Not(HasSubstr("did you mean")));
    EXPECT_THAT(said({"render", file, "-o", "a.png", "--viewpiont", "X"}), HasSubstr("did you mean --viewpoint?"));
    EXPECT_THAT(said({"render", file, "-o", "a.png", "--integrator", "whited"}), HasSubstr("did you mean whitted?"));
    EXPECT_THAT(said({"convert", file, "-", "--filter", "drop-metdata"}), HasSubstr("did you mean drop-metadata?"));
    EXPECT_THAT(said({"convert", file, "-", "--filter", "triangulate=1"}), HasSubstr("triangulate takes no argument"));
    EXPECT_THAT(said({"convert", file, "out.x3db"}), HasSubstr(".rtsgb; .stl .obj .ply .glb"));
    EXPECT_THAT(said({"mirror", "tcp://127.0.0.1:1", "-o", "a.png"}),
                AllOf(HasSubstr("mirror has no option -o"), Not(HasSubstr("did you mean")), Not(HasSubstr("a.png"))));
    EXPECT_THAT(said({"info", "--all=3", file}), HasSubstr("info has no option --all"));
    EXPECT_THAT(said({"info", file, "more"}), HasSubstr("info takes no 'more' after what it has"));
    EXPECT_THAT(said({"help", "rendr"}), HasSubstr("did you mean render?"));
    EXPECT_THAT(said({"help", "xyzzy"}), HasSubstr("rtsg help names the verbs"));
    EXPECT_THAT(said({"render"}), HasSubstr("rtsg help render"));
}

/// For users who come from other programs.
TEST_F(Manners, UsualSlipsGetAHint) {
    const std::string picture = folder / "a.png";
    using Arguments = std::vector<std::string>;
    for (const auto& [arguments, hint] : std::vector<std::pair<Arguments, std::string>>{
             {{"-v"}, "--version"},
             {{"version"}, "rtsg --version"},
             {{"show", file}, "rtsg view SCENE"},
             {{"browse", file}, "rtsg serve SCENE --web 8080"},
             {{"connect", "localhost"}, "rtsg mirror ENDPOINT"},
             {{file}, "rtsg info " + file},
             {{"tcp://127.0.0.1:1"}, "rtsg mirror tcp://127.0.0.1:1"},
             {{"render", file, "-o", picture, "--width", "640"}, "--size 1280x720"},
             {{"render", file, "-o", picture, "--camera", "FRONT"}, "--viewpoint"},
             {{"render", file, picture}, "-o " + picture},
             {{"listen", file, folder / "a.wav"}, "-o " + (folder / "a.wav")},
             {{"run", file, "--duration", "2s"}, "--for"},
             {{"run", file, "--time", "2s"}, "--for"},
             {{"convert", file, "-", "--to", "json"}, "--encoding"},
             {{"record", file, "-o", folder / "a.rlog", "-f"}, "--force"},
             {{"replay", folder / "a.rlog", "--start", "2s"}, "--seek"},
             {{"run", file, "--start", "2s"}, "--at"},
             {{"mirror", "localhost:5570"}, "tcp://127.0.0.1:5570"},
             {{"mirror", "http://example.org:5570/"}, "tcp://example.org:5570"},
             {{"mirror", "10.0.0.1"}, "tcp://10.0.0.1:5570"},
             {{"mirror", file}, "rtsg serve " + file},
             {{"serve", file, "--bind", "5571"}, "tcp://127.0.0.1:5571"},
             {{"serve", file, "--bind", "tcp://localhost:5571"}, "tcp://127.0.0.1:5571"},
             {{"serve", file, "--port", "5571"}, "--bind tcp://127.0.0.1:5570"},
             {{"relay", ":5570"}, "tcp://127.0.0.1:5570"},
             {{"relay", "tcp://127.0.0.1:1", "--bind", "*:5571"}, "tcp://*:5571"},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr("did you mean " + hint)) << testing::PrintToString(arguments);
    }
    EXPECT_THAT(rtsg({"--for", "5", "run", file}).err,
                HasSubstr("--for stands before the verb: options of a verb stand behind it"));
    for (const Arguments& unclear : std::vector<Arguments>{{"mirror", "nonsense"}, {"mirror", "a b"}, {"run", "--zzz"}})
        EXPECT_THAT(rtsg(unclear).err, Not(HasSubstr("did you mean"))) << testing::PrintToString(unclear);
}

/// A long list is read from its top: what it is for, then its options by what they are about.
TEST_F(Manners, HelpBeginsWithExamplesAndHasSections) {
    for (const std::string& verb : verbs()) {
        const std::string help = rtsg({verb, "--help"}).out;
        const std::size_t example = help.find("\nExample: rtsg " + verb), options = help.find("\nOptions:\n");
        EXPECT_LT(help.find("Usage: rtsg " + verb), example) << verb;
        EXPECT_LT(example, options) << verb;
        std::istringstream lines(help);
        std::string line;
        int inSection = 0, maximum = 0;
        while (std::getline(lines, line)) {
            inSection = line.ends_with(":") && !line.starts_with(" ") ? 0 : inSection + line.starts_with("  -");
            maximum = std::max(maximum, inSection);
        }
        EXPECT_LE(maximum, 20) << verb;
    }
}

TEST_F(Manners, WithoutAVerbTheVerbsAreNamed) {
    const Outcome bare = rtsg({});
    EXPECT_EQ(bare.status, 2);
    EXPECT_EQ(bare.out, "");
    EXPECT_EQ(bare.err, rtsg({"help"}).out);
}

TEST_F(Manners, HelpAndVersion) {
    const Outcome all = rtsg({"help"});
    EXPECT_EQ(all.status, 0);
    EXPECT_EQ(all.out, rtsg({"--help"}).out);
    EXPECT_GE(verbs().size(), 15u);
    for (const std::string& verb : verbs()) {
        const Outcome help = rtsg({"help", verb});
        EXPECT_EQ(help.status, 0) << verb;
        EXPECT_THAT(help.out, HasSubstr("Usage: rtsg " + verb)) << verb;
        EXPECT_THAT(help.out, HasSubstr("Example: rtsg " + verb)) << verb;
        EXPECT_EQ(help.out, rtsg({verb, "--help"}).out) << verb;
    }
    const Outcome version = rtsg({"-V"});
    EXPECT_EQ(version.status, 0);
    EXPECT_THAT(version.out, StartsWith("rtsg "));
    EXPECT_EQ(version.out, rtsg({"--version"}).out);
    // One place says which: the logs' and the man page's are the same.
    EXPECT_THAT(rtsg({"help", "--man"}).out, HasSubstr("\"" + version.out.substr(0, version.out.size() - 1) + "\""));
}

TEST_F(Manners, BashCompletes) {
    const auto completed = [&](const std::string& line) {
        const auto typed = words(line);
        const bool next = line.ends_with(" ");
        return words(shell("source <(\"$RTSG\" completion bash); COMP_WORDS=(" + line + (next ? "\"\"" : "") +
                           "); COMP_CWORD=" + std::to_string(typed.size() - (next ? 0 : 1)) +
                           "; _rtsg; echo \"${COMPREPLY[@]}\""));
    };
    using testing::Contains;
    using testing::ElementsAre;
    EXPECT_THAT(completed("rtsg ren"), ElementsAre("render"));
    EXPECT_THAT(completed("rtsg render a.x3dv --integ"), ElementsAre("--integrator"));
    EXPECT_THAT(completed("rtsg render a.x3dv --integrator "), ElementsAre("whitted", "path", "raster", "hybrid"));
    EXPECT_THAT(completed("rtsg completion z"), ElementsAre("zsh"));
    EXPECT_THAT(completed("rtsg help rep"), ElementsAre("replay"));
    EXPECT_TRUE(completed("rtsg render a.x3dv --output ").empty()) << "files are the shell's own to complete";
    for (const std::string& verb : verbs()) {
        EXPECT_THAT(completed("rtsg "), Contains(verb));
        const auto offered = completed("rtsg " + verb + " -");
        for (const std::string& option : options(verb)) EXPECT_THAT(offered, Contains(option)) << verb;
    }
}

TEST_F(Manners, OtherShellsAndTheManPageKnowEveryOption) {
    const std::string zsh = rtsg({"completion", "zsh"}).out, fish = rtsg({"completion", "fish"}).out;
    std::string man = rtsg({"help", "--man"}).out;
    for (std::size_t at = 0; (at = man.find("\\-", at)) != std::string::npos;) man.erase(at, 1);
    EXPECT_THAT(zsh, StartsWith("#compdef rtsg\n"));
    for (const std::string& verb : verbs()) {
        EXPECT_THAT(zsh, HasSubstr("'" + verb + ":")) << verb;
        EXPECT_THAT(fish, HasSubstr("-a " + verb + " ")) << verb;
        EXPECT_THAT(man, HasSubstr(".SS " + verb + "\n")) << verb;
        for (const std::string& option : options(verb)) {
            EXPECT_THAT(zsh, HasSubstr("'" + option + "[")) << verb;
            EXPECT_THAT(fish, HasSubstr(" -l " + option.substr(2) + " ")) << verb;
            EXPECT_THAT(man, HasSubstr("\\fB" + option + "\\fR")) << verb;
        }
    }
    EXPECT_EQ(rtsg({"completion", "tcsh"}).status, 2);
    for (const char* other : {"zsh", "fish"})
        shell(std::string("! command -v ") + other + " || \"$RTSG\" completion " + other + " | " + other + " -n");
    shell("! command -v groff || [ -z \"$(\"$RTSG\" help --man | groff -ww -man -Tutf8 2>&1 >/dev/null)\" ]");
}

TEST_F(Manners, ReportsAreTextOrJsonEverywhere) {
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.2s"}).status, 0);
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"info", file},
             {"info", log},
             {"validate", file},
             {"run", file, "--for", "0.1s"},
             {"record", file, "-o", log, "--for", "0.1s", "--force"},
             {"render", file, "-o", folder / "a.png", "--size", "8x8"},
             {"replay", log},
             {"replay", log, "--diff", log},
             {"replay", log, "--rerun", file},
             {"replay", log, "--compact", folder / "b.rlog", "--force"},
             {"mirror", "ipc://" + folder / "nobody", "--wait", "100ms"},
             {"pick", file, "--point", "0", "0", "0"},
         }) {
        const std::string text = rtsg(arguments).out;
        EXPECT_NE(text, "") << testing::PrintToString(arguments);
        EXPECT_THAT(text, Not(StartsWith("{"))) << testing::PrintToString(arguments);
        std::vector<std::string> machine = arguments;
        machine.push_back("--json");
        EXPECT_TRUE(json::accept(rtsg(machine).out)) << testing::PrintToString(machine);
    }
}

TEST_F(Manners, WatchedEventsAndASummary) {
    const Outcome both = rtsg({"run", file, "--for", "0.1s", "--fps", "10", "--watch", "BOX.translation", "--json"});
    ASSERT_EQ(both.status, 0) << both.err;
    const json summary = json::parse(lastLine(both.out));
    EXPECT_EQ(summary.at("frames"), 2);
    EXPECT_EQ(summary.at("hash").get<std::string>().size(), 32u);
    EXPECT_THAT(both.out, StartsWith("{\"t\":0,\"node\":\"BOX\""));
}

TEST_F(Manners, InfoOfNothingSaysSoAndNoMore) {
    const Outcome outcome = rtsg({"info", folder / "none.x3dv"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("No such file"));
    EXPECT_EQ(outcome.out, "");
}

/// docs/diagnostics.md.
TEST_F(Manners, EveryErrorEndsInACode) {
    const std::string log = folder / "a.rlog", other = folder / "b.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.2s", "--fps", "20"}).status, 0);
    writeFile(other, readFile(log).substr(0, 9000));
    for (const auto& [arguments, code] :
         {std::pair{std::vector<std::string>{"mirror", "ipc://" + folder / "none", "--wait", "0"}, "mirror"},
          {{"relay", "ipc://" + folder / "none", "--wait", "0"}, "mirror"},
          {{"replay", other, "--verify"}, "replay"},
          {{"run", file, "--for", "0", "--set", "NOBODY.x=1@0"}, "no-such-node"},
          {{"nonsense"}, "command-line"},
          {{"run", file, "--fps", "no"}, "command-line"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_NE(outcome.status, 0);
        EXPECT_THAT(outcome.err, testing::ContainsRegex("rtsg: error: .* \\[" + std::string(code) + "\\]\n"));
    }
}

TEST_F(Manners, InfoDescribesALog) {
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "20"}).status, 0);
    const json whole = json::parse(rtsg({"info", log, "--json"}).out);
    EXPECT_EQ(whole.at("frames"), 21);
    EXPECT_EQ(whole.at("keyframes"), 1);
    EXPECT_EQ(whole.at("sessions"), 1);
    EXPECT_EQ(whole.at("duration_s"), 1);
    EXPECT_EQ(whole.at("begins"), "2000-01-01T00:00:00Z");
    EXPECT_THAT(rtsg({"info", log}).out, HasSubstr("time       1 s, from 2000-01-01T00:00:00Z on\n"));
    const std::string other = folder / "dated.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", other, "--for", "0s", "--at", "2026-11-20T12:34:56.25Z"}).status, 0);
    EXPECT_EQ(json::parse(rtsg({"info", other, "--json"}).out).at("begins"), "2026-11-20T12:34:56.25Z");
    EXPECT_EQ(whole.at("bytes"), std::filesystem::file_size(log));
    EXPECT_EQ(whole.at("damaged"), 0);
    EXPECT_EQ(whole.at("closed"), true);
    EXPECT_EQ(whole.at("mode"), "state");
    EXPECT_EQ(whole.at("types").at("Shape"), 2);
    // Cut off in the middle, as by a crash; and with a hole.
    const std::string bytes = readFile(log), cut = folder / "cut.rlog", hole = folder / "hole.rlog";
    writeFile(cut, bytes.substr(0, bytes.rfind("RTSGrec1") - 3));
    const json shorter = json::parse(rtsg({"info", cut, "--json"}).out);
    EXPECT_EQ(shorter.at("closed"), false);
    EXPECT_EQ(shorter.at("frames"), 20);
    std::string holed = bytes;
    holed[bytes.size() / 2] = static_cast<char>(holed[bytes.size() / 2] ^ 1);
    writeFile(hole, holed);
    const Outcome damaged = rtsg({"info", hole, "--json"});
    EXPECT_EQ(damaged.status, 1);
    EXPECT_EQ(json::parse(damaged.out).at("damaged"), 1);
}

// docs/program.md: what becomes part of the scene is an error where it is missing, what a node shows or plays a
// warning.
TEST_F(Manners, StatusTellsOfMissingPartsOfTheScene) {
    const std::string name = folder / "missing.x3dv";
    const auto shape = [](const std::string& texture) {
        return "Shape { geometry Box { } appearance Appearance { texture " + texture + " } }";
    };
    const std::pair<std::string, int> kMissing[] = {{"Inline { url \"nosuch\" }", 1},
                                                    {"Shape { geometry InlineGeometry { url \"nosuch\" } }", 1},
                                                    {"EXTERNPROTO P [ ] \"nosuch\" P { }", 1},
                                                    {"FontLibrary { url \"nosuch\" family \"F\" }", 1},
                                                    {shape("ImageTexture { url \"nosuch\" }"), 0},
                                                    {shape("MovieTexture { url \"nosuch\" }"), 0},
                                                    {"Background { frontUrl \"nosuch\" }", 0},
                                                    {"Sound { source AudioClip { url \"nosuch\" } }", 0},
                                                    {"Script { url \"nosuch\" }", 0}};
    for (const auto& [text, status] : kMissing) {
        writeFile(name, "#X3D V4.0 utf8\nPROFILE Full\n" + text + "\n");
        for (const auto& verb : {std::vector<std::string>{"validate", name},
                                 {"render", name, "-o", folder / "a.png", "--size", "8x8"},
                                 {"listen", name, "-o", folder / "a.wav", "--for", ".01s"}}) {
            const Outcome outcome = rtsg(verb);
            EXPECT_EQ(outcome.status, status) << verb[0] << ": " << text;
            const bool heardOf = status == 1 || verb[0] == "validate" ||
                                 (verb[0] == "render" ? !text.starts_with("Sound") : text.starts_with("Sound"));
            if (heardOf) {
                EXPECT_THAT(outcome.err, HasSubstr("'nosuch' is not there")) << verb[0];
            }
        }
    }
}

TEST_F(Manners, AnErrorThatIsNotReachedIsAMissingPart) {
    const std::string name = folder / "lamp.x3dv";
    writeFile(name,
              "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry Sphere { radius 3 } appearance Appearance { material "
              "UnlitMaterial { } } }\n");
    for (const auto& [samples, status] : {std::pair("16", 1), std::pair("16384", 0)}) {
        const Outcome outcome = rtsg(
            {"render", name, "-o", folder / "a.exr", "--size", "16x16", "--error", ".05", "--spp", samples, "--json"});
        EXPECT_EQ(outcome.status, status) << outcome.err;
        EXPECT_EQ(json::parse(outcome.out).at("unreached").get<double>() > 0, status == 1);
        EXPECT_THAT(readFile(folder / "a.exr"), HasSubstr("interval.R"));
        if (status == 0) {
            EXPECT_EQ(outcome.err, "");
        } else {
            EXPECT_THAT(outcome.err, HasSubstr("error: missing: the error 0.05: it is "));
        }
        const Outcome run = rtsg({"run", name, "--for", ".1s", "--render", folder / "b.png", "--size", "16x16",
                                  "--error", ".05", "--spp", samples});
        EXPECT_EQ(run.status, status) << run.err;
    }
}

TEST_F(Manners, SizesThatAFormatHasNotAreRefusedAtOnce) {
    for (const auto& [out, size, why] : {std::tuple{"a.webp", "16384x1", "a WebP has at most 16383 a side"},
                                         {"a.jpg", "1x65501", "a JPEG has at most 65500 a side"},
                                         {"a.mp4", "33x32", "the width and height of a film are even, not 33 x 32"},
                                         {"a.mp4", "16386x2", "a film has at most 16384 a side"}}) {
        for (const auto& verb : {std::vector<std::string>{"render", "nosuch.x3dv", "-o", folder / out},
                                 {"run", "nosuch.x3dv", "--for", "1s", "--render", folder / out}}) {
            std::vector<std::string> arguments = verb;
            arguments.insert(arguments.end(), {"--size", size});
            const Outcome outcome = rtsg(arguments);
            EXPECT_EQ(outcome.status, 2) << out;
            EXPECT_THAT(outcome.err, HasSubstr(why));
        }
    }
    EXPECT_THAT(rtsg({"render", "nosuch.x3dv", "-o", folder / "a.webp", "--size", "8192x2", "--stereo", "beside"}).err,
                HasSubstr("16384 x 2 pixels"));
}

TEST_F(Manners, ValidateLooksForWhatUrlsName) {
    const std::string there = folder / "there.js", other = folder / "other.x3dv";
    writeFile(there, "ecmascript:");
    writeFile(other,
              "#X3D V4.0 utf8\nPROFILE Immersive\nDEF S Script { url \"nosuch.js\" }\nDEF T Script { url [ "
              "\"nosuch.js\" \"there.js\" ] }\nDEF U Script { url \"ecmascript: function x() { }\" }\n"
              "Shape { appearance Appearance { texture DEF P ImageTexture { url \"nosuch.png\" } } geometry Box { } }\n"
              "Anchor { url \"http://example.org/\" }\nBackground { frontUrl \"nosky.png\" }\n"
              "Inline { load FALSE url \"later.x3dv\" }\nSound { source DEF C AudioClip { url \"nosuch.wav\" } }\n");
    const Outcome outcome = rtsg({"validate", other, "--json"});
    for (const char* said : {"Script S.url: ", "ImageTexture P.url: ", "nosuch.png",
                             "Background.frontUrl: ", "Inline.url: ", "AudioClip C.url: "})
        EXPECT_THAT(outcome.err, HasSubstr(said));
    for (const char* unsaid : {"Script T", "Script U", "Anchor"}) EXPECT_THAT(outcome.err, Not(HasSubstr(unsaid)));
    EXPECT_EQ(json::parse(outcome.out).at("warnings"), 5);
    // An Inline that is to be loaded and is not there is an error.
    writeFile(other, "#X3D V4.0 utf8\nPROFILE Immersive\nInline { url \"nosuch.x3dv\" }\n");
    EXPECT_EQ(rtsg({"validate", other}).status, 1);
}

TEST_F(Manners, TheDemoRemovesOnlyWhatItMade) {
    const std::string precious = folder / "precious";
    std::filesystem::create_directory(precious);
    writeFile(precious + "/thesis.txt", "years of work");
    EXPECT_THAT(shell("! RTSG=\"$RTSG\" " RTSG_SOURCE_DIR "/examples/demo/run " + precious),
                HasSubstr("was not made by the demo"));
    EXPECT_EQ(readFile(precious + "/thesis.txt"), "years of work");
    // In a folder of its own, too, it removes what its marker lists and nothing else, and writes over nothing.
    const std::string own = folder / "own", fails = folder / "fails";
    writeFile(fails, "#!/bin/sh\nexit 3\n");
    const std::string run =
        "chmod +x " + fails + "; ! RTSG=" + fails + " " RTSG_SOURCE_DIR "/examples/demo/run " + own + " 2>&1";
    EXPECT_THAT(shell(run), HasSubstr("the server has stopped"));
    EXPECT_EQ(readFile(own + "/.rtsg-demo"), "serve.jsonl\n");
    writeFile(own + "/thesis.txt", "years of work");
    writeFile(own + "/.rtsg-demo", "serve.jsonl\n../precious/thesis.txt\n");
    EXPECT_THAT(shell(run), HasSubstr("the server has stopped"));
    EXPECT_EQ(readFile(own + "/thesis.txt"), "years of work");
    EXPECT_EQ(readFile(precious + "/thesis.txt"), "years of work");
    writeFile(own + "/hall.png", "holidays");
    EXPECT_THAT(shell(run), HasSubstr("hall.png, which the demo has not made"));
    EXPECT_EQ(readFile(own + "/hall.png"), "holidays");
}

}  // namespace
}  // namespace rtsg::test
