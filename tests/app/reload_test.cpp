// --reload: a scene that runs follows its file as somebody edits it, and so do its mirrors and its log.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "mirror_session.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Reload : public Mirror {
  protected:
    Reload() { write("1 0 0", "Sphere { }"); }
    void write(const std::string& color, const std::string& geometry) {
        // Editors save like this: they put another file in the place of this one.
        writeFile(edited + "~",
                  fmt::format("#X3D V4.0 utf8\nPROFILE Immersive\nDEF T Transform {{ children Shape {{ appearance "
                              "Appearance {{ material DEF M Material {{ diffuseColor {} }} }} geometry {} }} }}\n",
                              color, geometry));
        std::filesystem::rename(edited + "~", edited);
    }
    static void pass(int milliseconds) { std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds)); }
    /// Patiently, until the server has said it so often.
    void awaitEdits(std::size_t count, std::string_view text) {
        for (int i = 0; i < 300; ++i) {
            const std::string said = server->said();
            std::size_t found = 0;
            for (auto at = said.find(text); at != said.npos; at = said.find(text, at + 1)) ++found;
            if (found >= count) return;
            pass(100);
        }
        FAIL() << "not said: " << text << "\n" << server->said();
    }

    const std::string edited = folder / "edited.x3dv";
};

TEST_F(Reload, MirrorsAndTheLogOfAServedSceneFollowTheFile) {
    const std::string log = folder / "edited.rlog", replica = folder / "replica.x3dv";
    serve({"--reload", "--for", "120s", "--record", log}, "ipc://" + folder / "socket", edited);
    write("0 1 0", "Sphere { }");
    awaitEdits(1, "it was edited: 1 change\n");
    write("0 1 0", "Box { }");
    awaitEdits(2, "it was edited: ");
    writeFile(edited, "#X3D V4.0 utf8\nPROFILE Immersive\nDEF T Transform { scale 1 \n");
    awaitEdits(1, "edited.x3dv:4:1: error: ");
    awaitEdits(1, "is not followed: the scene stays as it was");
    const Outcome mirrored = rtsg({"mirror", endpoint, "--for", "1s", "--save", replica, "--json"});
    EXPECT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_THAT(readFile(replica), HasSubstr("diffuseColor 0 1 0"));
    EXPECT_THAT(readFile(replica), HasSubstr("Box"));
    write("0 0 1", "Box { }");
    awaitEdits(2, "it was edited: 1 change\n");
    server->signal(SIGINT);
    (void)server->wait();
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0);
    ASSERT_EQ(rtsg({"replay", log, "--save", folder / "end.x3dv"}).status, 0);
    EXPECT_THAT(readFile(folder / "end.x3dv"), HasSubstr("diffuseColor 0 0 1"));
    EXPECT_EQ(rtsg({"diff", edited, folder / "end.x3dv"}).status, 0);
}

TEST_F(Reload, AFileThatCannotBeFollowedAtTheEndIsMissed) {
    Program run({"run", edited, "--reload", "--realtime", "--for", "4s", "--save", folder / "a.x3dv"}, streams());
    pass(1500);
    writeFile(edited, "nothing at all");
    const Outcome ended = run.wait();
    EXPECT_EQ(ended.status, 1) << ended.err;
    EXPECT_THAT(ended.err, HasSubstr("edited.x3dv: error: it was edited, and is not followed"));
    EXPECT_THAT(readFile(folder / "a.x3dv"), HasSubstr("Sphere")) << "the scene stays as it was";
}

TEST_F(Reload, AFileThatIsInlinedIsFollowedToo) {
    writeFile(folder / "outer.x3dv", "#X3D V4.0 utf8\nPROFILE Immersive\nDEF I Inline { url \"edited.x3dv\" }\n");
    Program run({"run", folder / "outer.x3dv", "--reload", "--realtime", "--for", "4s"}, streams());
    pass(1500);
    write("0 1 0", "Sphere { }");
    const Outcome ended = run.wait();
    EXPECT_EQ(ended.status, 0) << ended.err;
    EXPECT_THAT(ended.err, HasSubstr("outer.x3dv: note: it was edited: 1 change\n"));
}

/// An undo takes back the mirror's own edit, not the edit of the file that came later.
TEST_F(Reload, AMirrorTakesBackItsOwnEditOnly) {
    const std::string replica = folder / "replica.x3dv";
    serve({"--reload", "--for", "120s", "--upstream", "edits"}, "ipc://" + folder / "socket", edited);
    Program mirror({"mirror", endpoint, "--name", "Ann", "--edit", "T.center=1 2 3@0.2", "--edit",
                    "M.shininess=0.5@0.4", "--undo", "12", "--for", "14s", "--save", replica, "--json"},
                   streams());
    pass(3000);
    write("0 1 0", "Box { }");
    awaitEdits(1, "it was edited: ");
    const Outcome ended = mirror.wait();
    EXPECT_EQ(ended.status, 0) << ended.err;
    const std::string saved = readFile(replica);
    EXPECT_THAT(saved, HasSubstr("center 1 2 3")) << "it stays: the file says nothing of it";
    EXPECT_THAT(saved, testing::Not(HasSubstr("shininess"))) << "taken back";
    EXPECT_THAT(saved, HasSubstr("diffuseColor 0 1 0"));
    EXPECT_THAT(saved, HasSubstr("Box"));
}

TEST_F(Reload, WhatIsNoDocumentInAFileIsRefused) {
    ASSERT_EQ(rtsg({"convert", edited, folder / "a.rtsgb"}).status, 0);
    EXPECT_EQ(rtsg({"run", folder / "a.rtsgb", "--reload"}).status, 2);
    EXPECT_EQ(rtsg({"run", "-", "--reload"}).status, 2);
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "a.rlog", "--reload"}).status, 2);
    EXPECT_EQ(rtsg({"view", "ipc://" + folder / "nobody", "--reload", "--for", "1s"}).status, 1);
}

}  // namespace
}  // namespace rtsg::test
