// Files from the network, through the program: what it fetches, refuses, logs and needs no more. The server is on
// loopback.
#include <gmock/gmock.h>

#include "app/program.h"
#include "fetch/web/lying_server.h"

namespace rtsg::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class NetworkOptions : public CommandLine {
  protected:
    void SetUp() override {
        std::filesystem::create_directories(folder / "scene");
        std::filesystem::create_directories(folder / "cache");
        std::filesystem::permissions(folder / "cache", std::filesystem::perms::owner_all);
        scene("/models/part.x3dv",
              "DEF S Shape { appearance Appearance { material UnlitMaterial { } texture ImageTexture { "
              "url \"red.ppm\" } } geometry Rectangle2D { size 100 100 } }");
        server.file("/models/red.ppm", "P6 1 1 255\n\xFF\x10\x10", "Content-Type: image/x-portable-pixmap\r\n");
    }
    void scene(const std::string& path, const std::string& text) {
        server.file(path, "#X3D V4.0 utf8\nPROFILE Full\n" + text);
    }
    std::string document(const std::string& text) {
        writeFile(folder / "scene/main.x3dv", "#X3D V4.0 utf8\nPROFILE Full\n" + text);
        return folder / "scene/main.x3dv";
    }
    std::string inlining() { return document("Inline { url \"" + server.address("/models/part.x3dv") + "\" }"); }
    /// Colour of the middle of a picture in PPM.
    std::string middle(const std::string& file) const {
        const std::string bytes = readFile(file);
        if (bytes.size() < 16 * 16 * 3) return "no picture";
        const auto* pixel = reinterpret_cast<const unsigned char*>(bytes.data() + bytes.size() - 16 * 16 * 3 +
                                                                   static_cast<std::size_t>(8 * 16 + 8) * 3);
        return pixel[0] > 200 && pixel[1] < 60 && pixel[2] < 60 ? "red" : "other";
    }
    Outcome render(const std::string& what, const std::string& to, std::vector<std::string> more) {
        std::vector<std::string> all{"render", what, "-o", to, "--size", "16x16", "--cache", folder / "cache"};
        all.insert(all.end(), more.begin(), more.end());
        return rtsg(all);
    }

    LyingServer server;
};

TEST_F(NetworkOptions, AnAllowedInlineAndItsTextureAreInThePicture) {
    const std::string given = inlining(), picture = folder / "a.ppm";
    const Outcome refused = render(given, picture, {});
    EXPECT_THAT(refused.err, AllOf(HasSubstr("Inline: '" + server.address("/models/part.x3dv")),
                                   HasSubstr("--allow " + server.address("/models/") + " lets it")));
    EXPECT_EQ(refused.status, 1);
    EXPECT_EQ(server.asked(), 0);
    const Outcome allowed = render(given, picture, {"--allow", server.address("/models/")});
    EXPECT_EQ(allowed.err, "");
    EXPECT_EQ(allowed.status, 0);
    EXPECT_EQ(middle(picture), "red");
    EXPECT_EQ(server.asked(), 2) << "each file once";
}

TEST_F(NetworkOptions, ADocumentIsNamedByItsAddress) {
    scene("/models/main.x3dv", "Inline { url \"part.x3dv\" } Inline { url \"/other/part.x3dv\" }");
    const std::string address = server.address("/models/main.x3dv");
    const Outcome info = rtsg({"info", "--json", address, "--cache", "none"});
    EXPECT_THAT(info.err, HasSubstr("--allow " + server.address("/other/")));
    EXPECT_THAT(info.out, HasSubstr("\"errors\":1"));
    scene("/models/main.x3dv", "Inline { url \"part.x3dv\" }");
    const std::string picture = folder / "b.ppm";
    EXPECT_EQ(render(address, picture, {}).err, "");
    EXPECT_EQ(middle(picture), "red");
    const Outcome converted = rtsg({"convert", address, folder / "copy.x3d", "--cache", "none"});
    EXPECT_EQ(converted.err, "");
    EXPECT_THAT(readFile(folder / "copy.x3d"), HasSubstr("part.x3dv"));
    EXPECT_EQ(rtsg({"validate", address, "--cache", "none"}).status, 0);
    EXPECT_THAT(rtsg({"info", server.address("/none.x3d"), "--cache", "none"}).err,
                HasSubstr("the server answers 404"));
}

TEST_F(NetworkOptions, WrongOptionsAreNamed) {
    const std::string given = inlining();
    EXPECT_THAT(rtsg({"info", given, "--allow", "http://user@host/"}).err, HasSubstr("password"));
    EXPECT_THAT(rtsg({"info", given, "--allow-network", "10.0.0.0/99"}).err, HasSubstr("--allow-network"));
    EXPECT_THAT(rtsg({"info", given, "--ca", folder / "none.pem"}).err, HasSubstr("--ca"));
    EXPECT_EQ(rtsg({"info", given, "--ca", folder / "none.pem"}).status, 2);
}

TEST_F(NetworkOptions, ALogWithTheBytesNeedsNoNetwork) {
    const std::string given = inlining(), log = folder / "a.rlog", picture = folder / "c.ppm";
    const Outcome recorded = rtsg({"record", given, "-o", log, "--for", "0.1s", "--inputs", "--embed", "--allow",
                                   server.address("/models/"), "--cache", "none"});
    EXPECT_EQ(recorded.err, "");
    const int asked = server.asked();
    EXPECT_EQ(asked, 2);
    const Outcome replayed = rtsg({"replay", log, "--render", picture, "--size", "16x16", "--cache", "none"});
    EXPECT_EQ(replayed.err, "");
    EXPECT_EQ(middle(picture), "red");
    server.file("/models/part.x3dv", "#X3D V4.0 utf8\nGroup { }\n");  // the world has gone on
    const Outcome again = rtsg({"replay", log, "--rerun", given, "--cache", "none"});
    EXPECT_EQ(again.err, "");
    EXPECT_EQ(again.status, 0) << again.out;
    EXPECT_EQ(server.asked(), asked);
}

TEST_F(NetworkOptions, ALogWithTheHashRefusesAnotherContent) {
    const std::string given = inlining(), log = folder / "a.rlog";
    const std::vector<std::string> allowed{"--allow", server.address("/models/"), "--cache", "none"};
    const auto with = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.end(), allowed.begin(), allowed.end());
        return rtsg(arguments);
    };
    EXPECT_EQ(with({"record", given, "-o", log, "--for", "0.1s", "--inputs"}).err, "");
    const Outcome same = with({"replay", log, "--rerun", given});
    EXPECT_EQ(same.status, 0) << same.out << same.err;
    const int asked = server.asked();
    const Outcome refused = rtsg({"replay", log, "--render", folder / "d.ppm", "--size", "16x16", "--cache", "none"});
    EXPECT_THAT(refused.err, HasSubstr("--allow"));
    EXPECT_EQ(server.asked(), asked) << "a log makes nobody fetch";
    scene("/models/part.x3dv", "Group { }");
    const Outcome other = with({"replay", log, "--rerun", given});
    EXPECT_THAT(other.err, HasSubstr("it is not what the session had"));
    EXPECT_EQ(other.status, 1);
}

TEST_F(NetworkOptions, AServedSceneIsMirroredWithTheBytes) {
    const std::string given = inlining();
    Program origin(
        {"serve", given, "--for", "20s", "--embed", "--allow", server.address("/models/"), "--cache", "none"},
        folder / "serve");
    const std::string line = origin.firstLine();
    const std::size_t at = line.find("tcp://");
    ASSERT_NE(at, std::string::npos) << line << origin.said();
    const std::string endpoint = line.substr(at, line.find_first_of(" \n", at) - at);
    const std::string picture = folder / "e.ppm";
    const Outcome mirrored =
        rtsg({"mirror", endpoint, "--render", picture, "--size", "16x16", "--for", "0.5s", "--cache", "none"});
    EXPECT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_EQ(middle(picture), "red");
    EXPECT_EQ(server.asked(), 2);
    origin.signal(SIGINT);
    origin.wait();
}

TEST_F(NetworkOptions, ARunningSceneGoesOnWhileSomethingComes) {
    server.at("/models/slow.x3dv", [](const LyingServer::Asked& asked) {
        std::this_thread::sleep_for(std::chrono::seconds(1));
        asked.send(LyingServer::whole("200 OK", "#X3D V4.0 utf8\nGroup { }\n"));
    });
    const std::string given = document("DEF L LoadSensor { children DEF I Inline { load FALSE url \"" +
                                       server.address("/models/slow.x3dv") + "\" } }\n");
    const Outcome outcome = rtsg({"run", given, "--for", "3s", "--realtime", "--set", "I.load=TRUE@0.2", "--watch",
                                  "L.*", "--allow", server.address("/models/"), "--cache", "none"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("\"isLoaded\",\"value\":true"));
    const std::size_t loaded = outcome.out.find("\"isLoaded\"");
    ASSERT_NE(loaded, std::string::npos) << outcome.out.substr(0, 1000);
    const std::size_t line = outcome.out.rfind("\"t\":", loaded);
    ASSERT_NE(line, std::string::npos);
    EXPECT_GT(std::strtod(outcome.out.c_str() + line + 4, nullptr), 0.8) << "the scene waited, and time stood still";
}

}  // namespace
}  // namespace rtsg::test
