// Nothing is lost and nothing pretends: inputs stay, results are complete, or absent, or named as partial with
// status 1.
#include "program.h"

#include <algorithm>

#include <sys/mount.h>
#include <sys/resource.h>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class NothingIsLost : public CommandLine {
  protected:
    void SetUp() override {
        CommandLine::SetUp();
        ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.5s", "--fps", "20"}).status, 0);
        fs::create_symlink(file, folder / "link.x3dv");
        fs::create_hard_link(file, folder / "hard.x3dv");
        fs::create_symlink(log, folder / "link.rlog");
    }
    /// The files in the folder apart from the streams of the programs.
    std::vector<std::string> files() const {
        std::vector<std::string> names;
        for (const auto& entry : fs::directory_iterator(fs::path(folder / "")))
            if (!entry.path().filename().string().starts_with("stream")) names.push_back(entry.path().filename());
        std::ranges::sort(names);
        return names;
    }
    const std::string log = folder / "a.rlog";
};

TEST_F(NothingIsLost, NoVerbOverwritesItsInput) {
    const std::string scene = readFile(file), recorded = readFile(log), mcap = folder / "a.mcap";
    const auto before = files();
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"convert", file, file, "--force"},
             {"convert", file, folder / "link.x3dv", "--force"},
             {"convert", folder / "link.x3dv", folder / "hard.x3dv", "--force"},
             {"convert", file, folder / "./scene.x3dv", "--force"},
             {"record", file, "-o", file, "--force"},
             {"record", file, "-o", folder / "link.x3dv", "--force"},
             {"render", file, "-o", file},
             {"listen", file, "-o", file},
             {"listen", file, "-o", folder / "a.wav", "--ir", folder / "a.wav"},
             {"serve", file, "--record", file, "--for", "100ms", "--force"},
             {"replay", log, "--save", log, "--force"},
             {"replay", log, "--export", log, "--force"},
             {"replay", log, "--export", folder / "link.rlog", "--force"},
             {"replay", log, "--compact", folder / "link.rlog", "--force"},
             {"replay", folder / "link.rlog", "--compact", log, "--force"},
             {"replay", log, "--without", "BOX.translation", "-o", log, "--force"},
             {"replay", log, "--rerun", file, "--save", file, "--force"},
             {"replay", log, "--export", mcap, "--compact", mcap},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments) << outcome.err;
        EXPECT_NE(outcome.err, "") << testing::PrintToString(arguments);
        EXPECT_EQ(readFile(file), scene) << testing::PrintToString(arguments);
        EXPECT_EQ(readFile(log), recorded) << testing::PrintToString(arguments);
    }
    EXPECT_EQ(files(), before);
}

TEST_F(NothingIsLost, TheInputIsNamedWhereAnotherNameIsGiven) {
    const std::string link = folder / "link.x3dv";
    EXPECT_THAT(rtsg({"convert", file, file, "--force"}).err, HasSubstr(file + " is the input itself"));
    EXPECT_THAT(rtsg({"convert", file, link, "--force"}).err, HasSubstr(link + " is the input " + file));
    // Standard input and output have one name, and are no file.
    const Outcome piped = rtsg({"convert", "-", "-"}, readFile(file));
    EXPECT_EQ(piped.status, 0) << piped.err;
    EXPECT_EQ(piped.out, rtsg({"convert", file, "-"}).out);
    EXPECT_THAT(piped.out, HasSubstr("BOX"));
}

TEST_F(NothingIsLost, WhatTheSceneUsesIsNotOverwritten) {
    const std::string picture = folder / "t01.png", sound = folder / "tone.wav", part = folder / "part.x3dv",
                      given = folder / "given.x3dv";
    writeFile(part,
              "#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearance Appearance { texture ImageTexture { url "
              "\"t01.png\" } } geometry Box { } }\n");
    writeFile(given,
              "#X3D V4.0 utf8\nPROFILE Immersive\nInline { url \"part.x3dv\" }\nSound { source AudioClip { url "
              "[ \"no.wav\" \"tone.wav\" ] } }\n");
    ASSERT_EQ(rtsg({"render", file, "-o", picture, "--size", "8x8"}).status, 0);
    ASSERT_EQ(rtsg({"listen", file, "-o", sound, "--for", "0.1s", "--rays", "10"}).status, 0);
    fs::create_symlink(picture, folder / "link.png");
    writeFile(folder / "part.xml", "<X3D profile='Immersive' version='4.0'><Scene><Group/></Scene></X3D>");
    fs::copy_file(folder / "part.xml", folder / "part.html");
    writeFile(folder / "pages.x3dv",
              "#X3D V4.0 utf8\nPROFILE Immersive\nInline { url \"part.xml\" }\nInline { url \"part.html\" }\n");
    ASSERT_EQ(rtsg({"record", folder / "pages.x3dv", "-o", folder / "pages.rlog", "--for", "0.1s"}).status, 0);
    const std::string log2 = folder / "given.rlog";
    ASSERT_EQ(rtsg({"record", given, "-o", log2, "--for", "0.2s"}).status, 0);
    writeFile(folder / "user.x3dv", "#X3D V4.0 utf8\nPROFILE Immersive\nInline { url \"model.ply\" }\n");
    writeFile(
        folder / "proto.x3dv",
        "#X3D V4.0 utf8\nPROFILE Immersive\nPROTO Part [ initializeOnly MFString partUrl \"part.x3dv\" ] { Group { } "
        "}\nPart { }\n");
    writeFile(folder / "extern.x3dv",
              "#X3D V4.0 utf8\nPROFILE Immersive\nEXTERNPROTO Part [ ] \"part.x3dv#Part\"\nGroup { }\n");
    ASSERT_EQ(rtsg({"convert", given, folder / "model.ply"}).status, 0);
    const std::string pixels = readFile(picture), samples = readFile(sound), text = readFile(part),
                      model = readFile(folder / "model.ply");
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"render", given, "-o", picture},
             {"render", given, "-o", folder / "link.png"},
             {"render", given, "-o", folder / "t%02d.png", "--frames", "3"},
             {"listen", given, "-o", sound},
             {"listen", given, "--ir", sound},
             {"convert", given, part, "--force"},
             {"convert", folder / "proto.x3dv", part, "--force"},
             {"convert", folder / "extern.x3dv", part, "--force"},
             {"convert", folder / "user.x3dv", folder / "model.ply", "--force"},
             {"run", given, "--render", picture},
             {"run", given, "--save", part, "--force"},
             {"replay", log2, "--render", picture},
             {"replay", log2, "--live", "--render", picture},
             {"replay", log2, "--listen", sound},
             {"replay", folder / "pages.rlog", "--verify", "--junit", folder / "part.xml", "--force"},
             {"replay", folder / "pages.rlog", "--rerun", folder / "pages.x3dv", "--page", folder / "part.html",
              "--force"},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments) << outcome.err;
        EXPECT_THAT(outcome.err, HasSubstr("the scene uses ")) << testing::PrintToString(arguments);
    }
    EXPECT_EQ(readFile(picture), pixels);
    EXPECT_EQ(readFile(sound), samples);
    EXPECT_EQ(readFile(part), text);
    EXPECT_EQ(readFile(folder / "model.ply"), model);
    // Another number is another file.
    EXPECT_EQ(rtsg({"render", given, "-o", folder / "t%03d.png", "--frames", "2", "--size", "8x8"}).status, 0);
}

TEST_F(NothingIsLost, ABrokenSceneIsNoReferenceForATest) {
    const std::string broken = folder / "broken.x3dv", recorded = readFile(log);
    writeFile(broken, "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { }\n]\n");
    const Outcome outcome = rtsg({"replay", log, "--rerun", broken, "--update"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("broken.x3dv:4"));
    EXPECT_EQ(readFile(log), recorded);
}

TEST_F(NothingIsLost, LogsAndScenesAreReplacedOnlyByForce) {
    const std::string other = folder / "other.x3dv", kept = folder / "kept.rlog", recorded = readFile(log);
    writeFile(other, "precious");
    const std::string capture = folder / "kept.mcap";
    fs::copy_file(log, kept);
    fs::copy_file(log, capture);
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"convert", file, other},
             {"record", file, "-o", log},
             {"serve", file, "--record", log, "--for", "100ms"},
             {"mirror", "ipc://" + folder / "nobody", "--record", log},
             {"mirror", "ipc://" + folder / "nobody", "--save", other},
             {"replay", log, "--save", other},
             {"replay", log, "--export", capture},
             {"replay", log, "--compact", kept},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 1) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr("--force")) << testing::PrintToString(arguments);
        EXPECT_EQ(readFile(other), "precious") << testing::PrintToString(arguments);
        EXPECT_EQ(readFile(log), recorded) << testing::PrintToString(arguments);
        EXPECT_EQ(readFile(kept), recorded) << testing::PrintToString(arguments);
    }
    EXPECT_EQ(rtsg({"convert", file, other, "--force"}).status, 0);
    EXPECT_THAT(readFile(other), HasSubstr("DEF BOX"));
    EXPECT_EQ(rtsg({"record", file, "-o", log, "--for", "0.2s", "--fps", "20", "--force"}).status, 0);
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0);
    EXPECT_EQ(rtsg({"replay", log, "--save", other, "--force"}).status, 0);
    // Pictures and sounds are made again and again.
    for (int i = 0; i < 2; ++i) EXPECT_EQ(rtsg({"render", file, "-o", folder / "a.png", "--size", "8x8"}).status, 0);
}

TEST_F(NothingIsLost, ABadSceneDoesNotCostTheLog) {
    const std::string recorded = readFile(log), picture = folder / "a.png";
    writeFile(picture, "old");
    EXPECT_EQ(rtsg({"record", folder / "none.x3dv", "-o", log, "--force"}).status, 1);
    EXPECT_EQ(readFile(log), recorded);
    EXPECT_EQ(rtsg({"render", file, "-o", picture, "--viewpoint", "NOWHERE", "--size", "8x8"}).status, 1);
    EXPECT_EQ(readFile(picture), "old");
    // A document that cannot be read at all gives none.
    EXPECT_EQ(rtsg({"convert", folder / "none.x3dv", folder / "new.x3d"}).status, 1);
    EXPECT_FALSE(fs::exists(folder / "new.x3d"));
}

TEST_F(NothingIsLost, UnknownKindsAreRefusedByName) {
    const auto before = files();
    for (const auto& [arguments, there] : std::vector<std::pair<std::vector<std::string>, std::string>>{
             {{"listen", file, "-o", folder / "a.mp3"}, ".wav"},
             {{"listen", file, "--ir", folder / "a.flac"}, ".wav"},
             {{"render", file, "-o", folder / "a.avi"}, ".png"},
             {{"render", file, "-o", folder / "a"}, ".png"},
             {{"convert", file, folder / "a.fbx"}, ".x3dv"},
             {{"replay", log, "--save", folder / "a.glb"}, ".x3dv"},
             {{"replay", log, "--render", folder / "a.svg"}, ".png"},
             {{"replay", log, "--listen", folder / "a.ogg"}, ".wav"},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr(there)) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr(arguments.back())) << testing::PrintToString(arguments);
    }
    EXPECT_EQ(files(), before);
}

TEST_F(NothingIsLost, ASeekBeyondTheEndIsStatusOne) {
    const std::string picture = folder / "a.png";
    const Outcome beyond = rtsg({"replay", log, "--seek", "3s", "--render", picture, "--size", "8x8"});
    EXPECT_EQ(beyond.status, 1);
    EXPECT_THAT(beyond.err, HasSubstr("the log ends at 0.5 s"));
    EXPECT_FALSE(fs::exists(picture));
    const Outcome compacted = rtsg({"replay", log, "--compact", folder / "b.rlog", "--seek", "3s"});
    EXPECT_EQ(compacted.status, 1);
    EXPECT_THAT(compacted.err, HasSubstr("the log ends at 0.5 s"));
    EXPECT_FALSE(fs::exists(folder / "b.rlog"));
    EXPECT_EQ(rtsg({"replay", log, "--seek", "0.5s"}).status, 0);
    EXPECT_EQ(rtsg({"replay", log, "--seek", "0.49s"}).status, 0);
}

/// A disk of 16 KiB, where mounts are allowed.
class FullDisk : public NothingIsLost {
  protected:
    void SetUp() override {
        NothingIsLost::SetUp();
        fs::create_directory(disk);
        mounted = ::mount("none", disk.c_str(), "tmpfs", 0, "size=16k") == 0;
        if (!mounted) GTEST_SKIP() << "may not mount: " << std::strerror(errno);
    }
    void TearDown() override {
        if (!mounted) return;
        EXPECT_EQ(::umount2(disk.c_str(), MNT_DETACH), 0);
    }
    std::size_t left() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(disk), fs::directory_iterator()));
    }
    const std::string disk = folder / "disk";
    bool mounted = false;
};

/// Its pictures are larger than the disks of these tests.
const std::string hall = RTSG_SOURCE_DIR "/examples/demo/hall.x3dv";

TEST_F(NothingIsLost, AFileThatMayNotGrowLeavesNone) {
    // A limit of 8 KiB for files acts like a full disk, without a mount.
    const auto before = files();
    for (const char* name : {"a.png", "a.gif", "a.exr"}) {
        const std::string errors = streams();
        const std::string command = "ulimit -f 8; exec '" RTSG_PROGRAM "' render '" + hall + "' -o '" +
                                    (folder / name) + "' --size 320x200 --spp 1 >/dev/null 2> '" + errors + "'";
        const int status = std::system(("bash -c \"" + command + "\"").c_str());
        ASSERT_TRUE(WIFEXITED(status)) << name;
        EXPECT_EQ(WEXITSTATUS(status), 1) << name;
        EXPECT_THAT(readFile(errors), HasSubstr("File too large")) << name;
        EXPECT_EQ(files(), before) << name;
    }
}

TEST_F(NothingIsLost, WhatIsPrintedToAFullDiskIsAnError) {
    const std::string errors = streams();
    for (const std::string& words :
         std::vector<std::string>{"info '" + file + "' --json", "run '" + file + "' --for 0.1s --json",
                                  "run '" + file + "' --for 5s --watch '*'", "replay '" + log + "' --verify"}) {
        const int status = std::system(("'" RTSG_PROGRAM "' " + words + " > /dev/full 2> '" + errors + "'").c_str());
        ASSERT_TRUE(WIFEXITED(status)) << words;
        EXPECT_EQ(WEXITSTATUS(status), 1) << words;
        EXPECT_THAT(readFile(errors), HasSubstr("No space left")) << words;
    }
}

/// Runs a command of bash, and returns its status: 128 + n if signal n ended the program.
int shell(const std::string& command) {
    const int status = std::system(("bash -c \"" + command + "\" 2>/dev/null").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(NothingIsLost, WhatCannotBeSaidDoesNotEndTheProgram) {
    const std::string program = "'" RTSG_PROGRAM "' ", created = folder / "b.rlog";
    EXPECT_EQ(shell(program + "info '" + folder.path().string() + "/none.x3dv' 2>/dev/full"), 1);
    EXPECT_EQ(shell(program + "no-verb 2>/dev/full"), 2);
    EXPECT_EQ(shell(program + "serve '" + file + "' --bind 'tcp://127.0.0.1:*' --metrics-port 0 --record '" + created +
                    "' --for 0.5s 2>/dev/full >/dev/null"),
              0);
    EXPECT_EQ(rtsg({"replay", created, "--verify"}).status, 0);
}

TEST_F(NothingIsLost, AClosedStandardStreamDoesNotBecomeALog) {
    const std::string program = "'" RTSG_PROGRAM "' ", created = folder / "b.rlog";
    const std::string scene = "'" + file + "' --for 0.1s --json ";
    EXPECT_EQ(shell(program + "record " + scene + "-o '" + created + "' <&- >&- 2>&-"), 1)
        << "the report was not printed";
    EXPECT_EQ(rtsg({"replay", created, "--verify"}).status, 0);
    EXPECT_EQ(shell(program + "record " + scene + "--force -o '" + created + "' <&- >/dev/null 2>&-"), 0);
    EXPECT_EQ(rtsg({"replay", created, "--verify"}).status, 0);
    EXPECT_EQ(shell(program + "serve " + scene + "--record '" + created + "' --force <&- >&- 2>&-"), 1);
    EXPECT_EQ(rtsg({"replay", created, "--verify"}).status, 0);
    EXPECT_EQ(shell(program + "info - <&- >/dev/null"), 1);
}

TEST_F(NothingIsLost, TooFewFilesAreAnErrorAndNoCrash) {
    const std::string errors = streams();
    for (const char* maximum : {"6", "8", "10", "12", "14", "16", "18", "32"}) {
        // Whoever runs the tests may have left files open.
        const int status =
            shell("exec >/dev/null 2>'" + errors + "' 3>&- 4>&- 5>&- 6>&- 7>&- 8>&- 9>&-; ulimit -n " + maximum +
                  "; exec '" RTSG_PROGRAM "' serve '" + file + "' --bind 'tcp://127.0.0.1:*' --for 0.1s");
        if (status == 0) continue;
        EXPECT_EQ(status, 1) << maximum;
        EXPECT_THAT(readFile(errors), HasSubstr("Too many open files")) << maximum;
        EXPECT_NE(std::string(maximum), "32");
    }
}

TEST_F(NothingIsLost, PicturesThatCannotBeWrittenAreMissing) {
    const Outcome outcome = rtsg({"replay", log, "--render", folder / "none/%02d.png", "--size", "16x16", "--fps", "20",
                                  "--frames", "3-7", "--json"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("missing: 5 of 5 pictures: 3-7"));
    EXPECT_EQ(json::parse(lastLine(outcome.out)).at("pictures"), 0);
}

/// A NATS server takes one log; of several pieces it would store one.
TEST_F(NothingIsLost, ALogAtANatsServerIsNotDivided) {
    const std::string stored = "nats://127.0.0.1:1/log";
    for (const auto& [option, value] : {std::pair{"--rotate", "1s"}, std::pair{"--keep", "1GB"}})
        for (std::vector<std::string> verb : std::vector<std::vector<std::string>>{
                 {"record", file, "-o", stored}, {"serve", file, "--record", stored}, {"serve", "--resume", stored}}) {
            verb.insert(verb.end(), {"--for", "1s", option, value});
            const Outcome outcome = rtsg(verb);
            EXPECT_EQ(outcome.status, 2) << verb[0] << ' ' << option;
            EXPECT_THAT(outcome.err, HasSubstr(std::string(option)));
            EXPECT_THAT(outcome.err, HasSubstr("a log at a NATS server cannot be divided into pieces"));
        }
}

/// The file of the log's name is still the piece before.
TEST_F(NothingIsLost, APieceThatCannotBeBegunLeavesTheOneBeforeAndSaysHowMuchThatHolds) {
    const std::string longest = folder / (std::string(248, 'x') + ".rlog");  // with a number it would be too long
    const Outcome outcome = rtsg({"record", file, "-o", longest, "--for", "3s", "--rotate", "1s"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("File name too long"));
    EXPECT_THAT(outcome.err, HasSubstr("holds the first " + std::to_string(fs::file_size(longest)) + " bytes"));
}

TEST_F(NothingIsLost, AFolderIsNoPageAndStays) {
    const std::string page = folder / "page.html";
    fs::create_directory(page);
    EXPECT_EQ(rtsg({"replay", log, "--rerun", file, "--page", page, "--force"}).status, 1);
    EXPECT_TRUE(fs::is_directory(page));
}

TEST_F(NothingIsLost, ASeekIntoAGapIsStatusOne) {
    const std::string pieces = folder / "pieces";
    fs::create_directory(pieces);
    ASSERT_EQ(rtsg({"record", file, "-o", pieces + "/p.rlog", "--for", "4s", "--fps", "10", "--rotate", "1s"}).status,
              0);
    const auto seek = [&](const char* time) {
        return rtsg({"replay", pieces, "--seek", time, "--save", folder / "then.x3dv", "--force"});
    };
    EXPECT_EQ(seek("2.5s").status, 0);
    fs::remove(pieces + "/p.0003.rlog");
    EXPECT_EQ(seek("1.5s").status, 0);
    EXPECT_EQ(seek("2s").status, 0) << "that state is there";
    const Outcome within = seek("2.5s");
    EXPECT_EQ(within.status, 1);
    EXPECT_THAT(within.err, HasSubstr("--seek 2.5s: frames 24 to 33 are missing; what is there is frame 23 (t = 2 s)"));
    EXPECT_EQ(seek("3.5s").status, 0);
    EXPECT_EQ(rtsg({"serve", "--resume", pieces, "--bind", "tcp://127.0.0.1:*", "--for", "0.1s"}).status, 2);
}

TEST_F(FullDisk, LeavesNoHalfFile) {
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"render", hall, "-o", disk + "/a.png", "--size", "400x300", "--spp", "1"},
             {"render", hall, "-o", disk + "/a.gif", "--size", "200x150", "--spp", "1", "--frames", "3"},
             {"render", hall, "-o", disk + "/a.exr", "--size", "200x150", "--spp", "1"},
             {"render", hall, "-o", disk + "/a.mp4", "--size", "400x300", "--spp", "1", "--frames", "20"},
             {"listen", file, "-o", disk + "/a.wav", "--for", "0.2s", "--rays", "100"},
             {"listen", hall, "--ir", disk + "/a.wav", "--rays", "100", "--length", "0.2"},
             {"listen", hall, "--ir", disk + "/a.sofa", "--rays", "100", "--length", "0.2"},
             {"listen", hall, "--report", disk + "/a.html", "--rays", "100"},
             {"replay", log, "--export", disk + "/a.mcap", "--export-plain"},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 1) << testing::PrintToString(arguments) << outcome.out;
        EXPECT_THAT(outcome.err, HasSubstr("No space left")) << testing::PrintToString(arguments);
        if (arguments[0] == "replay") {
            EXPECT_THAT(outcome.err, Not(HasSubstr("[picture]")));
        }
        EXPECT_EQ(left(), 0u) << testing::PrintToString(arguments);
    }
}

TEST_F(FullDisk, ALogKeepsItsWholeFrames) {
    const Outcome outcome = rtsg({"record", file, "-o", disk + "/a.rlog", "--for", "60s"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("No space left"));
    const json replayed = json::parse(rtsg({"replay", disk + "/a.rlog", "--json"}).out);
    EXPECT_GT(replayed.at("frames"), 3);
    EXPECT_EQ(replayed.at("frames"), replayed.at("verified"));
    EXPECT_EQ(replayed.at("damaged"), 0);
}

/// A first state that has no room leaves no log without a state, and the one that it was to replace.
TEST_F(FullDisk, ALogWithoutAStateIsNone) {
    const std::string large = folder / "large.x3dv", taken = disk + "/a.rlog";
    writeFile(large,
              "#X3D V4.0 utf8\nPROFILE Core\nDEF M MetadataString { value \"" + std::string(20000, 'x') + "\" }\n");
    const auto expectNone = [&](const std::vector<std::string>& arguments, std::size_t files) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 1) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr("No space left")) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr("nothing was recorded")) << testing::PrintToString(arguments);
        EXPECT_EQ(left(), files) << testing::PrintToString(arguments);
    };
    expectNone({"record", large, "-o", taken, "--for", "200ms"}, 0);
    expectNone({"serve", large, "--record", taken, "--for", "200ms"}, 0);
    ASSERT_EQ(rtsg({"record", file, "-o", taken, "--for", "0s"}).status, 0);
    const std::string before = readFile(taken);
    expectNone({"record", large, "-o", taken, "--for", "200ms", "--force"}, 1);
    expectNone({"serve", large, "--record", taken, "--for", "200ms", "--force"}, 1);
    EXPECT_EQ(readFile(taken), before);
}

TEST_F(FullDisk, EndsTheRecordingNotTheSession) {
    const Outcome outcome = rtsg({"serve", file, "--bind", "ipc://" + folder / "socket", "--record", disk + "/a.rlog",
                                  "--for", "4s", "--fps", "200", "--linger", "0", "--json"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("No space left"));
    EXPECT_THAT(outcome.err, HasSubstr("the recording has ended"));
    EXPECT_THAT(outcome.err, Not(HasSubstr("error: error")));
    EXPECT_THAT(outcome.err, HasSubstr("a.rlog: error:")) << "which file";
    const json summary = json::parse(outcome.out.substr(outcome.out.find('\n') + 1));
    EXPECT_GT(summary.at("t"), 2) << "the session went on";
    EXPECT_LE(summary.at("log_bytes"), 16384);
}

/// The log ends, as that of a server does, and other outputs are made. A mirror without other outputs ends with it.
TEST_F(FullDisk, EndsTheLogOfAMirrorNotItsPictures) {
    const std::string endpoint = "ipc://" + folder / "socket";
    Program server({"serve", file, "--bind", endpoint, "--fps", "200", "--json"}, folder / "server");
    ASSERT_NE(server.firstLine(), "");
    const Outcome pictured = rtsg({"mirror", endpoint, "--record", disk + "/a.rlog", "--for", "3s", "--fps", "4",
                                   "--render", folder / "p%02d.png", "--size", "16x9", "--json"});
    EXPECT_EQ(pictured.status, 1);
    EXPECT_THAT(pictured.err, HasSubstr("No space left"));
    const json report = json::parse(pictured.out);
    EXPECT_EQ(report.at("pictures"), 12) << report;
    EXPECT_THAT(report.at("missing").get<std::string>(), HasSubstr("the log beyond state ")) << report;
    const json replayed = json::parse(rtsg({"replay", disk + "/a.rlog", "--json"}).out);
    EXPECT_GT(replayed.at("frames"), 3);
    EXPECT_EQ(replayed.at("frames"), replayed.at("verified"));
    const Outcome alone = rtsg({"mirror", endpoint, "--record", disk + "/b.rlog", "--for", "60s", "--json"});
    EXPECT_EQ(alone.status, 1);
    const json ended = json::parse(alone.out);
    EXPECT_LT(ended.at("t"), 50) << ended;
    EXPECT_EQ(ended.at("missing"), "the log") << ended;
}

/// Values that a document cannot express are left out and named, and the rest can be read.
TEST_F(NothingIsLost, ASavedSceneWithoutAValueThatIsNotFiniteIsNamedAsPartial) {
    writeFile(
        file,
        "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { scale 2 2 2 }\nDEF CLOCK TimeSensor { loop TRUE }\n"
        "DEF S Script { inputOnly SFFloat f outputOnly SFVec3f o url \"ecmascript: function f(v){ o = new "
        "SFVec3f(0/0, 1/0, 1); }\" }\n"
        "ROUTE CLOCK.fraction_changed TO S.f\nROUTE S.o TO BOX.translation\n");
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.1s", "--force"}).status, 0);
    for (const char* extension : {".x3d", ".x3dv", ".wrl", ".json"}) {
        const std::string saved = folder / ("saved" + std::string(extension));
        for (const auto& arguments : {std::vector<std::string>{"run", file, "--for", "0.1s"}, {"replay", log}}) {
            std::vector<std::string> saving = arguments;
            saving.insert(saving.end(), {"--save", saved, "--force"});
            const Outcome outcome = rtsg(saving);
            EXPECT_EQ(outcome.status, 1) << outcome.err;
            EXPECT_THAT(outcome.err, HasSubstr("BOX.translation holds nan"));
            EXPECT_THAT(outcome.err, HasSubstr("[write]"));
            EXPECT_THAT(outcome.out, HasSubstr("t = 0.1 s")) << "the report comes all the same";
            const Outcome read = rtsg({"validate", saved});
            EXPECT_EQ(read.status, 0) << readFile(saved) << read.err;
            EXPECT_THAT(readFile(saved), HasSubstr("scale"));
        }
    }
}

class Interrupted : public NothingIsLost {
  protected:
    /// Starts the program, waits until `ready` and interrupts it.
    template <class Ready>
    Outcome interrupt(std::vector<std::string> arguments, const Ready& ready, int signal = SIGINT) {
        Program program(std::move(arguments), streams());
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (!ready() && std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        program.signal(signal);
        return program.wait();
    }
    void expectOnly(const std::vector<std::string>& before, std::vector<std::string> more) {
        more.insert(more.end(), before.begin(), before.end());
        std::ranges::sort(more);
        EXPECT_EQ(files(), more) << "half files are left";
    }
};

/// By Ctrl-C, by a system that shuts down, by a terminal that is closed.
TEST_F(Interrupted, RecordingKeepsAWholeLogAndSaysSo) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        const std::string other = folder / "other" + std::to_string(signal) + ".rlog";
        const Outcome outcome = interrupt(
            {"record", file, "-o", other, "--for", "1000s", "--realtime"},
            [&] { return readFile(other).size() > 5000; }, signal);
        EXPECT_EQ(outcome.status, 1) << signal;
        EXPECT_THAT(outcome.err, HasSubstr("interrupted: " + other + " holds "));
        EXPECT_EQ(rtsg({"replay", other, "--verify"}).status, 0) << signal;
    }
}

TEST_F(Interrupted, APictureOfTheEndEndsTooWhereTheRunHasEndedByItself) {
    const auto before = files();
    for (const char* how : {"--json", "--live"}) {
        const Outcome outcome = interrupt(
            {"run", file, "--for", "0.1s", "--render", folder / "a.png", "--size", "4000x3000", "--integrator", "path",
             "--spp", "4000", how},
            [start = std::chrono::steady_clock::now()] {
                return std::chrono::steady_clock::now() - start > std::chrono::seconds(2);
            },
            SIGTERM);
        // A plain ending where the handler was not in place yet.
        EXPECT_TRUE(outcome.status == 1 || outcome.status == 128 + SIGTERM) << how << outcome.status;
        if (outcome.status == 1) {
            EXPECT_THAT(outcome.err, HasSubstr("interrupted")) << how;
        }
        expectOnly(before, {});
    }
}

TEST_F(Interrupted, PicturesAreWholeOrNotThere) {
    const auto before = files();
    const Outcome one = interrupt({"render", file, "-o", folder / "a.png", "--size", "2000x1500", "--spp", "4000"},
                                  [start = std::chrono::steady_clock::now()] {
                                      return std::chrono::steady_clock::now() - start > std::chrono::seconds(2);
                                  });
    // Whether the handler was in place already decides between an ending in order and a plain one.
    EXPECT_TRUE(one.status == 1 || one.status == 128 + SIGINT) << one.status;
    expectOnly(before, {});
    const Outcome many = interrupt({"render", file, "-o", folder / "f%d.png", "--size", "32x24", "--frames", "100000"},
                                   [&] { return fs::exists(folder / "f2.png"); });
    EXPECT_EQ(many.status, 1);
    EXPECT_THAT(many.err, testing::ContainsRegex("interrupted: [0-9]+ of 100000 frames were written"));
    for (const auto& name : files()) {
        if (!name.ends_with(".png")) continue;
        EXPECT_TRUE(name.starts_with("f")) << "half a picture: " << name;
        EXPECT_EQ(readFile(folder / name).substr(1, 3), "PNG") << name;
    }
}

/// With an end that was stated: what is one file for all of it, or for its end, is not complete before that.
TEST_F(Interrupted, AFilmASoundAndALastStateAreWholeOrNotThere) {
    const std::string big = folder / "big.rlog", film = folder / "a.gif", sound = folder / "a.wav",
                      saved = folder / "a.x3d", picture = folder / "a.png";
    ASSERT_EQ(rtsg({"record", file, "-o", big, "--for", "2000s", "--fps", "60"}).status, 0);
    const std::vector<std::string> created{film, sound, saved, picture};
    for (const std::string& one : created) writeFile(one, "old");
    const auto before = files();
    const auto later = [](int milliseconds) {
        return [milliseconds, start = std::chrono::steady_clock::now()] {
            return std::chrono::steady_clock::now() - start > std::chrono::milliseconds(milliseconds);
        };
    };
    for (const auto& verb : {std::vector<std::string>{"run", file, "--for", "2000s"},
                             {"run", file, "--for", "2000s", "--live"},
                             {"replay", big},
                             {"replay", big, "--live"}})
        for (const std::string& shown : {film, picture}) {
            std::vector<std::string> arguments = verb;
            arguments.insert(arguments.end(), {"--render", shown, "--listen", sound, "--save", saved, "--size", "16x10",
                                               "--rays", "50", "--force"});
            const Outcome outcome = interrupt(arguments, later(1500));
            EXPECT_TRUE(outcome.status == 1 || outcome.status == 128 + SIGINT) << outcome.status;
            if (outcome.status == 1) {
                EXPECT_THAT(outcome.err, HasSubstr(shown + ", " + sound + ", " + saved +
                                                   ": error: interrupted before its end: not written [output]"));
            }
            for (const std::string& one : created)
                EXPECT_EQ(readFile(one), "old") << one << testing::PrintToString(arguments);
            expectOnly(before, {});
        }
}

TEST_F(Interrupted, AnExportIsWholeOrNamedAsPartial) {
    const std::string big = folder / "big.rlog", mcap = folder / "a.mcap";
    ASSERT_EQ(rtsg({"record", file, "-o", big, "--for", "2000s", "--fps", "60"}).status, 0);
    const auto before = files();
    std::size_t known = before.size();
    const auto unfinished = [&] { return files().size() > known; };
    const Outcome outcome = interrupt({"replay", big, "--export", mcap}, unfinished);
    EXPECT_EQ(outcome.status, 1) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr("interrupted: what is written holds "));
    expectOnly(before, {"a.mcap"});
    known = files().size();
    const Outcome shorter = interrupt({"replay", big, "--compact", folder / "short.rlog"}, unfinished);
    EXPECT_EQ(shorter.status, 1) << shorter.out;
    EXPECT_THAT(shorter.err, HasSubstr("short.rlog was not written"));
    expectOnly(before, {"a.mcap"});
}

class Ends : public NothingIsLost {
  protected:
    void serve(std::vector<std::string> more) {
        std::vector<std::string> arguments{"serve", file, "--bind", "ipc://" + folder / "socket",
                                           "--fps", "30", "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        server = std::make_unique<Program>(arguments, streams());
        endpoint = json::parse(server->firstLine()).at("endpoint");
    }
    std::unique_ptr<Program> server;
    std::string endpoint;
};

TEST_F(Ends, AServerThatLeavesEarlyIsStatusOne) {
    serve({"--for", "1s"});
    const Outcome outcome = rtsg({"mirror", endpoint, "--for", "30s", "--wait", "60s", "--json"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("of 30 s"));
    const json report = json::parse(outcome.out);
    EXPECT_EQ(report.at("equal"), true) << "what there was it has";
    EXPECT_EQ(report.at("sequence"), report.at("origin_sequence"));
}

TEST_F(Ends, AServerThatDiesIsStatusOne) {
    serve({});
    Program mirror({"mirror", endpoint, "--wait", "2s", "--record", folder / "m.rlog"}, streams());
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (readFile(folder / "m.rlog").size() < 1000 && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    server->signal(SIGKILL);
    const Outcome outcome = mirror.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("silent"));
}

TEST_F(Ends, APartThatDoesNotExistIsStatusOne) {
    serve({"--for", "2s"});
    Program none({"mirror", endpoint, "--part", "NOBODY", "--wait", "60s"}, streams());
    Program box({"mirror", endpoint, "--part", "BOX", "--wait", "60s"}, streams());
    const Outcome missing = none.wait(), there = box.wait();
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.err, HasSubstr("NOBODY"));
    EXPECT_EQ(there.status, 0) << there.err;
}

/// A name that was meant for another option.
TEST_F(NothingIsLost, AReportReplacesNoSceneOrLog) {
    const std::string scene = readFile(file), kept = folder / "kept.xml", report = folder / "old.xml";
    fs::copy_file(log, kept);
    writeFile(folder / "named.xml", scene);
    writeFile(report, "<?xml version='1.0'?><testsuites></testsuites>");
    for (const std::string& there : {kept, folder / "named.xml"}) {
        const std::string before = readFile(there);
        const Outcome outcome = rtsg({"replay", log, "--rerun", file, "--junit", there});
        EXPECT_EQ(outcome.status, 1) << there;
        EXPECT_THAT(outcome.err, HasSubstr("no scene or log"));
        EXPECT_EQ(readFile(there), before);
    }
    EXPECT_EQ(rtsg({"replay", log, "--rerun", file, "--junit", report}).status, 0);
    EXPECT_THAT(readFile(report), HasSubstr("states"));
    EXPECT_EQ(rtsg({"replay", log, "--rerun", file, "--junit", kept, "--force"}).status, 0);
    // A test whose scene cannot be loaded knows of no sound that the scene would use.
    const std::string sound = folder / "tone.xml";
    writeFile(sound, std::string("RIFF\0\0\0\0WAVE", 12));
    const Outcome outcome = rtsg({"replay", log, "--rerun", folder / "none.x3dv", "--junit", sound});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("no binary file"));
    EXPECT_EQ(readFile(sound).size(), 12U);
}

/// A sound or a picture of a scene, say, which no log knows before it is played: nothing of another kind has the name
/// of a log.
TEST_F(NothingIsLost, ALogTakesThePlaceOfLogsOnly) {
    const std::string sound = folder / "tone.wav", damaged = folder / "damaged.rlog", mcap = folder / "old.mcap";
    for (const std::string& there : {sound, folder / "part.x3dv"}) {
        writeFile(there, "what somebody made");
        for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
                 {"replay", log, "--compact", there, "--force"},
                 {"replay", log, "--export", there, "--force"},
                 {"record", file, "-o", there, "--for", "0.1s", "--force"},
                 {"mirror", "ipc://" + folder / "nobody", "--record", there, "--force"},
                 {"serve", file, "--record", there, "--for", "0.1s", "--force"},
             }) {
            const Outcome outcome = rtsg(arguments);
            EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
            EXPECT_EQ(readFile(there), "what somebody made") << testing::PrintToString(arguments);
        }
    }
    writeFile(damaged, "no log any more");
    writeFile(folder / "empty.rlog", "");
    for (const std::string& there : {damaged, folder / "empty.rlog"})
        EXPECT_EQ(rtsg({"replay", log, "--compact", there, "--force"}).status, 0) << there;
    EXPECT_EQ(rtsg({"replay", log, "--export", mcap}).status, 0);
    EXPECT_EQ(rtsg({"replay", log, "--export", mcap, "--force"}).status, 0);
}

/// Each option that names a file which is written, in each verb that has it.
TEST_F(NothingIsLost, NamesOfEachKindEndAsItsFilesDo) {
    const std::string endpoint = "ipc://" + folder / "nobody";
    const std::vector<std::string> run{"run", file}, mirror{"mirror", endpoint}, replay{"replay", log},
        listen{"listen", file}, rerun{"replay", log, "--rerun", file};
    const std::vector<std::pair<std::vector<std::string>, std::string>> options = {
        {{"convert", file}, ""},
        {{"render", file}, "-o"},
        {{"record", file}, "-o"},
        {{"serve", file, "--for", "0.1s"}, "--record"},
        {listen, "-o"},
        {listen, "--ir"},
        {listen, "--report"},
        {listen, "--stream-out"},
        {run, "--render"},
        {run, "--listen"},
        {run, "--save"},
        {mirror, "--render"},
        {mirror, "--listen"},
        {mirror, "--record"},
        {mirror, "--save"},
        {replay, "--render"},
        {replay, "--listen"},
        {replay, "--save"},
        {replay, "--export"},
        {replay, "--compact"},
        {rerun, "--junit"},
        {rerun, "--page"},
        {rerun, "--expect-picture"},
        {rerun, "--expect-sound"},
    };
    const auto before = files();
    for (const auto& [verb, option] : options)
        for (const std::string name : {"-", "name", "a.bat", "a.rlog.bak"}) {
            if (option.empty() && name == "-") continue;  // standard output
            std::vector<std::string> arguments = verb;
            if (!option.empty()) arguments.push_back(option);
            arguments.push_back(name == "-" ? name : folder / name);
            const Outcome outcome = rtsg(arguments);
            EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments) << outcome.err;
            EXPECT_THAT(outcome.err, HasSubstr(option.empty() ? "OUT: " : option + ": "));
        }
    EXPECT_EQ(files(), before);
    // A device has the name that it has.
    EXPECT_EQ(rtsg({"replay", log, "--export", "/dev/null"}).status, 0);
}

}  // namespace
}  // namespace rtsg::test
