// Tiles of a served scene's pictures, drawn by several mirrors at the same time: one state a picture, bits as one
// program makes them; mirrors that are killed or differ.
#include <csignal>

#include <fmt/format.h>

#include "mirror_session.h"

namespace rtsg::test {

class LiveTiles : public Mirror {
  protected:
    LiveTiles() { beginsAtZero = true; }
    void assemble(std::vector<std::string> more) {
        std::vector<std::string> arguments{"assemble", "--live", "tcp://127.0.0.1:0", "--tiles", "3,2", "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        assembler = std::make_unique<Program>(arguments, streams());
        const std::string line = assembler->firstLine();
        ASSERT_NE(line, "");
        door = nlohmann::json::parse(line).at("endpoint");
    }
    std::unique_ptr<Program> mirror(const std::vector<std::string>& more = {}) {
        std::vector<std::string> arguments{"mirror", endpoint, "--tiles", door, "--size",    "60x40",
                                           "--spp",  "2",      "--fps",   "10", "--threads", "1"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return std::make_unique<Program>(arguments, streams());
    }

    std::unique_ptr<Program> assembler;
    std::string door;
};

TEST_F(LiveTiles, JoinPicturesOfOneStateWithItsBits) {
    const std::string log = folder / "served.rlog";
    serve({"--record", log, "--at", "0"}, "tcp://127.0.0.1:0");
    assemble({"--for", "2s", "-o", folder / "live%03d.png"});
    const auto one = mirror(), other = mirror(), third = mirror();
    const Outcome joined = assembler->wait();
    ASSERT_EQ(joined.status, 0) << joined.err;
    const nlohmann::json report = nlohmann::json::parse(lastLine(joined.out));
    EXPECT_EQ(report.at("mirrors"), 3) << report;
    ASSERT_GT(report.at("pictures"), 2) << report;
    EXPECT_EQ(report.at("tiles"), 6 * report.at("pictures").get<int>()) << report;
    for (Program* program : {one.get(), other.get(), third.get()}) EXPECT_EQ(program->wait().status, 0);
    server->signal(SIGINT);
    ASSERT_EQ(server->wait().status, 0);
    for (int picture = 0; picture < report.at("pictures"); ++picture) {
        const std::string name =
            folder / ("live" + std::string(picture < 10 ? "00" : "0") + std::to_string(picture) + ".png");
        const std::string time =
            fmt::format("{:.6f}s", report.at("times")[static_cast<std::size_t>(picture)].get<double>());
        const Outcome shown = rtsg({"replay", log, "--seek", time, "--render", folder / "then.png", "--size", "60x40",
                                    "--spp", "2", "--json"});
        ASSERT_EQ(shown.status, 0) << shown.err;
        EXPECT_TRUE(readFile(name) == readFile(folder / "then.png")) << name << ' ' << time;
    }
}

TEST_F(LiveTiles, GoOnWhereAMirrorIsKilled) {
    serve({"--at", "0"}, "tcp://127.0.0.1:0");
    assemble({"--for", "3s"});
    auto one = mirror(), other = mirror();
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    one->signal(SIGKILL);
    const Outcome joined = assembler->wait();
    ASSERT_EQ(joined.status, 0) << joined.err;
    const nlohmann::json report = nlohmann::json::parse(lastLine(joined.out));
    EXPECT_GT(report.at("pictures"), 2) << report;
    EXPECT_EQ(other->wait().status, 0);
}

TEST_F(LiveTiles, OfOtherOptionsAreRefused) {
    serve({"--at", "0"}, "tcp://127.0.0.1:0");
    assemble({"--for", "2s"});
    const auto one = mirror();
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const auto other = mirror({"--seed", "7"});
    const Outcome refused = other->wait();
    EXPECT_EQ(refused.status, 1);
    EXPECT_NE(refused.err.find("a mirror with other options for pictures"), std::string::npos) << refused.err;
    const Outcome joined = assembler->wait();
    EXPECT_EQ(joined.status, 0) << joined.err;
    EXPECT_NE(joined.err.find("a mirror with other options"), std::string::npos) << joined.err;
}

TEST_F(LiveTiles, OfAnotherServerAreRefused) {
    serve({"--at", "0"}, "tcp://127.0.0.1:0");
    assemble({"--for", "4s"});
    const auto one = mirror();
    writeFile(folder / "other.x3dv", scene("5"));
    Program another({"serve", folder / "other.x3dv", "--at", "0", "--json", "--for", "60s"}, streams());
    endpoint = nlohmann::json::parse(another.firstLine()).at("endpoint");
    const auto other = mirror();
    // Their clocks differ, so it may take some pictures until both name one.
    const Outcome refused = other->wait();
    EXPECT_EQ(refused.status, 1);
    EXPECT_NE(refused.err.find("a mirror of another session"), std::string::npos) << refused.err;
    const Outcome joined = assembler->wait();
    EXPECT_EQ(joined.status, 0) << joined.err;
}

TEST_F(LiveTiles, OptionsThatMakeNoSenseAreRefused) {
    EXPECT_EQ(rtsg({"assemble", "--live", "tcp://0.0.0.0:0"}).status, 1) << "others could reach it";
    EXPECT_EQ(rtsg({"assemble", "--live", "nowhere"}).status, 1);
    EXPECT_EQ(rtsg({"assemble", "--live", "tcp://127.0.0.1:0", "--frames", "0-1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble"}).status, 2);
    EXPECT_EQ(rtsg({"mirror", "tcp://127.0.0.1:1", "--tiles", "tcp://127.0.0.1:1", "--save", folder / "a.x3d"}).status,
              2);
    EXPECT_EQ(
        rtsg({"mirror", "tcp://127.0.0.1:1", "--tiles", "tcp://127.0.0.1:1", "--shutter", ".5", "--spp", "4"}).status,
        2);
}

}  // namespace rtsg::test
