// Programs at rest: where nothing happens, none of them looks for something to do.
#include <fmt/format.h>

#include "mirror_session.h"

namespace rtsg::test {

class AtRest : public Mirror {
  protected:
    AtRest() {
        writeFile(still,
                  "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { children Shape { geometry Box { } } }\n");
    }
    void SetUp() override { serve({"--for", "90s", "--upstream", "edits"}, "tcp://127.0.0.1:*", still); }
    Program& start(std::vector<std::string> arguments) {
        return *programs.emplace_back(std::make_unique<Program>(std::move(arguments), streams()));
    }
    /// What the first line of a program says.
    std::string endpointOf(const Program& program) {
        const std::string line = program.firstLine();
        return line.empty() ? line : nlohmann::json::parse(line).at("endpoint").get<std::string>();
    }
    /// Wake-ups a second of all threads of each program. They have begun some seconds before.
    static std::vector<double> wakeUps(const std::vector<const Program*>& all) {
        constexpr std::chrono::seconds kWatched(6);
        std::vector<double> counts;
        for (const Program* one : all) counts.push_back(-static_cast<double>(one->wakeUps()));
        std::this_thread::sleep_for(kWatched);
        for (std::size_t i = 0; i < all.size(); ++i)
            counts[i] = (counts[i] + static_cast<double>(all[i]->wakeUps())) / static_cast<double>(kWatched.count());
        return counts;
    }
    void expectRest(const std::vector<const Program*>& all, const std::vector<double>& maximum) {
        std::this_thread::sleep_for(std::chrono::seconds(5));
        const std::vector<double> counts = wakeUps(all);
        for (std::size_t i = 0; i < all.size(); ++i) EXPECT_LE(counts[i], maximum[i]) << "program " << i;
    }

    const std::string still = folder / "still.x3dv";
    std::vector<std::unique_ptr<Program>> programs;
};

TEST_F(AtRest, WhoDrawsAndJoinsTilesWakesSeldom) {
    const std::string film = folder / "film.gif";
    Program& joining =
        start({"assemble", "--live", "tcp://127.0.0.1:0", "--tiles", "3,2", "--json", "-o", film, "--for", "20s"});
    const std::string door = endpointOf(joining);
    for (int i = 0; i < 2; ++i)
        start({"mirror", endpoint, "--tiles", door, "--size", "60x40", "--spp", "2", "--fps", "10", "--threads", "1"});
    expectRest({&joining, programs[1].get(), programs[2].get()}, {5, 6, 6});
    // What changes is drawn.
    EXPECT_EQ(rtsg({"mirror", endpoint, "--edit", "BOX.translation=1 0 0@0", "--for", "1s"}).status, 0);
    const Outcome joined = joining.wait();
    ASSERT_EQ(joined.status, 0) << joined.err;
    const nlohmann::json report = nlohmann::json::parse(lastLine(joined.out));
    EXPECT_GE(report.at("pictures"), 2) << report;
    EXPECT_LE(report.at("pictures"), 7) << "of 200: " << report;
    const auto states = report.at("states").get<std::vector<std::uint64_t>>();
    EXPECT_GT(states.back() - states.front(), 5u) << report;
    // The film shows the last one until the end.
    const std::string bytes = readFile(film);
    std::size_t shown = 0;
    for (std::size_t at = bytes.find("\x21\xF9\x04"); at != bytes.npos; at = bytes.find("\x21\xF9\x04", at + 1))
        ++shown;
    EXPECT_GE(shown, 140u);
    EXPECT_LE(shown, 210u);
}

TEST_F(AtRest, WhoMakesPicturesOrServesViewersWakesSeldom) {
    const std::string relayed =
        endpointOf(start({"relay", endpoint, "--bind", "tcp://127.0.0.1:*", "--json", "--for", "60s"}));
    std::vector<const Program*> all{programs[0].get()};
    for (const std::vector<std::string>& more : {std::vector<std::string>{"--for", "60s"},
                                                 {"--render", folder / "live.png", "--live", "--size", "32x32"},
                                                 {"--listen", folder / "live.wav", "--live"},
                                                 {"--foxglove", "0"}}) {
        std::vector<std::string> arguments{"mirror", relayed};
        arguments.insert(arguments.end(), more.begin(), more.end());
        all.push_back(&start(std::move(arguments)));
    }
    all.push_back(server.get());
    // A connection to each mirror is one more that a relay listens to.
    expectRest(all, {16, 5, 8, 8, 6, 6});
}

TEST_F(AtRest, WhoPlaysALogWaitsForItsStates) {
    const std::string log = folder / "slow.rlog";
    ASSERT_EQ(rtsg({"record", still, "-o", log, "--for", "60s", "--fps", "1"}).status, 0);
    const Program& plays = start({"serve", log, "--bind", "tcp://127.0.0.1:*", "--json"});
    const std::string served = endpointOf(plays);
    const Program& paused = start({"serve", log, "--bind", "tcp://127.0.0.1:*", "--paused", "--control"});
    const Program& shown = start({"replay", log, "--live", "--render", folder / "shown.png", "--size", "32x32"});
    expectRest({&plays, &paused, &shown}, {8, 4, 8});
}

}  // namespace rtsg::test
