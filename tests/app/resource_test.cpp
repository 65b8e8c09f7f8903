// The files that the urls of a scene may open, through the program.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "app/program.h"

namespace rtsg::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A scene in a folder of its own, and something beside it that is none of its business. The working folder is neither.
class ResourceOptions : public CommandLine {
  protected:
    void SetUp() override {
        std::filesystem::create_directories(folder / "scene/parts");
        std::filesystem::create_directories(folder / "other");
        writeFile(folder / "other/secret.x3dv", "password hunter2\n");
        writeFile(folder / "other/group.x3dv", "#X3D V4.0 utf8\nPROFILE Full\nGroup { children Group { } }\n");
        writeFile(folder / "other/program.js", "function initialize() { print('ran'); }\n");
        writeFile(folder / "other/tone.wav", wav());
    }
    std::string document(const std::string& text, const std::string& name = "main.x3dv") {
        writeFile(folder / ("scene/" + name), "#X3D V4.0 utf8\nPROFILE Full\n" + text);
        return folder / ("scene/" + name);
    }
    /// A hundred samples, 16 bits, mono, 8 kHz.
    static std::string wav() {
        using namespace std::string_literals;
        return "RIFF\xEC\0\0\0WAVEfmt \x10\0\0\0\1\0\1\0\x40\x1F\0\0\x80\x3E\0\0\2\0\x10\0data\xC8\0\0\0"s +
               std::string(200, '\x20');
    }
};

TEST_F(ResourceOptions, AnInlineOutsideIsRefusedUnlessAllowed) {
    const std::string given = document("Inline { url \"../other/group.x3dv\" }");
    const Outcome refused = rtsg({"info", "--json", given});
    EXPECT_EQ(refused.status, 1) << "what it names is an error, as for validate";
    EXPECT_THAT(refused.out, HasSubstr("\"nodes\":1,"));
    EXPECT_THAT(refused.err, HasSubstr("main.x3dv:3:1: error: Inline: '../other/group.x3dv' is outside"));
    EXPECT_THAT(refused.err, HasSubstr("--allow " + folder / "other"));
    const Outcome allowed = rtsg({"info", "--json", given, "--allow", folder / "other"});
    EXPECT_EQ(allowed.err, "");
    EXPECT_THAT(allowed.out, HasSubstr("\"nodes\":3,"));
}

TEST_F(ResourceOptions, AnInlineOfATextFilePrintsNoLineOfIt) {
    const std::string given = document("Inline { url [ \"../other/secret.x3dv\" \"file:///etc/passwd\" ] }");
    for (const auto& more : {std::vector<std::string>{}, {"--allow", folder / "other", "--allow", "/etc"}}) {
        std::vector<std::string> arguments{"info", given};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_THAT(outcome.err, HasSubstr("Inline: '../other/secret.x3dv' is"));
        EXPECT_THAT(outcome.err, Not(HasSubstr("hunter2")));
        EXPECT_THAT(outcome.err, Not(HasSubstr("root")));
    }
}

TEST_F(ResourceOptions, DevicesAndPipesEndNothing) {
    ASSERT_EQ(::mkfifo((folder / "scene/pipe").c_str(), 0600), 0);
    const std::string given =
        document("Script { url \"/dev/zero\" }\nScript { url \"pipe\" }\nInline { url \"pipe\" }");
    const Outcome outcome = rtsg({"run", given, "--for", "0.1s", "--allow", "/dev"});
    EXPECT_EQ(outcome.status, 1) << "the Inline is an error, as for validate";
    EXPECT_THAT(outcome.err, HasSubstr("'/dev/zero' is a device, not a file"));
    EXPECT_THAT(outcome.err, HasSubstr("'pipe' is a pipe, not a file"));
}

TEST_F(ResourceOptions, ScriptsComeFromTheSamePlaces) {
    const std::string given = document("Script { url \"../other/program.js\" }");
    const Outcome refused = rtsg({"run", given, "--for", "0.1s"});
    EXPECT_THAT(refused.out, Not(HasSubstr("ran")));
    EXPECT_THAT(refused.err, HasSubstr("--allow " + folder / "other"));
    EXPECT_THAT(rtsg({"run", given, "--for", "0.1s", "--allow", folder / "other"}).out, HasSubstr("ran"));
}

TEST_F(ResourceOptions, ASoundOfAnInlinedFileIsFoundBesideIt) {
    document("Sound { source DEF CLIP AudioClip { url \"tone.wav\" } }", "parts/part.x3dv");
    const std::string given = document("Viewpoint { position 0 0 3 }\nInline { url \"parts/part.x3dv\" }");
    writeFile(folder / "scene/parts/tone.wav", wav());
    const Outcome found = rtsg({"listen", given, "-o", folder / "a.wav", "--for", "0.1s", "--rays", "10"});
    EXPECT_EQ(found.status, 0);
    EXPECT_THAT(found.err, Not(HasSubstr("is silent")));
    // One beside the outer document is not meant.
    std::filesystem::rename(folder / "scene/parts/tone.wav", folder / "scene/tone.wav");
    const Outcome missing = rtsg({"listen", given, "-o", folder / "a.wav", "--for", "0.1s", "--rays", "10"});
    EXPECT_EQ(missing.status, 0) << "as for a picture that is not there";
    EXPECT_THAT(missing.err, HasSubstr("CLIP is silent"));
    EXPECT_THAT(missing.err, HasSubstr("'tone.wav' is not there (looked for " + folder / "scene/parts/tone.wav"));
}

TEST_F(ResourceOptions, ASoundThatIsRefusedIsToldWhereNobodyListens) {
    const std::string given = document("Sound { source DEF CLIP AudioClip { url \"../other/tone.wav\" } }");
    const Outcome refused = rtsg({"run", given, "--for", "0.1s", "--at", "0", "--watch", "CLIP.isActive"});
    EXPECT_EQ(refused.status, 0);
    EXPECT_EQ(refused.out, "");
    EXPECT_THAT(refused.err, HasSubstr("AudioClip CLIP never plays: '../other/tone.wav' is outside"));
    EXPECT_THAT(refused.err, HasSubstr("--allow " + folder / "other"));
    const Outcome allowed = rtsg({"run", given, "--for", "0.1s", "--allow", folder / "other"});
    EXPECT_EQ(allowed.err, "");
}

/// A sound that plays is never reported as silent: clips without pictures, in any container.
TEST_F(ResourceOptions, ASoundThatIsHeardHasALength) {
    const std::string data = std::string(RTSG_SOURCE_DIR) + "/tests/audio/scene/data";
    for (const char* name : {"tone.aac", "tone.ac3", "tone.wma", "tone.mka", "tone.webm", "flac.ogg"}) {
        const std::string given = document("Sound { source DEF CLIP AudioClip { url \"" + data + "/" + name + "\" } }");
        const Outcome heard =
            rtsg({"run", given, "--for", "0.1s", "--at", "0", "--allow", data, "--watch", "CLIP.duration_changed"});
        EXPECT_EQ(heard.err, "") << name;
        EXPECT_THAT(heard.out, HasSubstr("\"duration_changed\",\"value\":0.2")) << name;
    }
}

TEST_F(ResourceOptions, AMirrorOpensNothingThatItWasNotAllowed) {
    const std::string given = document("Viewpoint { position 0 0 3 }\nSound { source AudioClip { url [ \"" +
                                       (folder / "other/tone.wav") + "\" \"/etc/passwd\" \"tone.wav\" ] } }");
    Program server({"serve", given, "--for", "20s"}, streams());
    const std::string line = server.firstLine();
    const std::string endpoint = line.substr(line.rfind(' ') + 1);
    const std::vector<std::string> listening{"mirror",   endpoint,         "--for",  "0.2s",
                                             "--listen", folder / "m.wav", "--rays", "10"};
    const Outcome closed = rtsg(listening);
    EXPECT_THAT(closed.err, HasSubstr("'" + (folder / "other/tone.wav") + "' is outside"));
    EXPECT_THAT(closed.err, HasSubstr("--allow " + folder / "other"));
    EXPECT_THAT(closed.err, HasSubstr("'/etc/passwd' is outside"));
    EXPECT_THAT(closed.err, HasSubstr("'tone.wav' is relative"));
    for (const char* option : {"--allow", "--base"}) {
        std::vector<std::string> open = listening;
        open.insert(open.end(), {option, folder / "other"});
        EXPECT_THAT(rtsg(open).err, Not(HasSubstr("is silent"))) << option;
    }
}

TEST_F(ResourceOptions, LimitsAreRaisedByAnOption) {
    document("Group { } Group { } Group { }", "part.x3dv");
    const std::string given = document("Inline { url \"part.x3dv\" }");
    const Outcome few = rtsg({"info", "--json", given, "--limit", "nodes=2"});
    EXPECT_THAT(few.err, HasSubstr("more than 2 nodes"));
    EXPECT_THAT(few.out, HasSubstr("\"nodes\":3,"));
    EXPECT_EQ(rtsg({"info", given, "--limit", "nodes=3"}).err, "");
    EXPECT_THAT(rtsg({"info", given, "--limit", "bytes=10"}).err, HasSubstr("more than 10 bytes"));
    // The limit is for the whole process, and also for files that the user names: a million nodes take some 300 MB.
    std::string many = "#X3D V4.0 utf8\n";
    for (int i = 0; i < 1'000'000; ++i) many += "Group{}";
    const Outcome much = rtsg({"info", document(many), "--limit", "memory=100000000"});
    EXPECT_EQ(much.status, 1);
    EXPECT_THAT(much.err, HasSubstr("the process would hold more than 100000000 bytes; --limit memory=N raises this"));
    EXPECT_THAT(much.err, HasSubstr("[memory]"));
    EXPECT_EQ(rtsg({"info", given, "--limit", "nodes"}).status, 2);
    EXPECT_EQ(rtsg({"info", given, "--limit", "knots=3"}).status, 2);
    EXPECT_EQ(rtsg({"info", given, "--allow", folder / "nowhere"}).status, 2);
}

TEST_F(ResourceOptions, DoublingUseEndsAtTheLimitOfInstances) {
    // 2^26 paths to one box.
    std::string text = "DEF L0 Group { children Shape { geometry Box { } } }\n";
    for (int i = 1; i <= 26; ++i)
        text += "DEF L" + std::to_string(i) + " Group { children [ USE L" + std::to_string(i - 1) + " USE L" +
                std::to_string(i - 1) + " ] }\n";
    const Outcome outcome = rtsg({"info", "--json", document(text), "--limit", "instances=1000"});
    EXPECT_THAT(outcome.err, HasSubstr("more than 1000 ")) << outcome.out;
    EXPECT_THAT(outcome.out, testing::ContainsRegex("\"instances\":[1-9][0-9]?[0-9]?,"));  // paths to groups count, too
}

}  // namespace
}  // namespace rtsg::test
