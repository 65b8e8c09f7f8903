// --feed and --publish of the program: what is watched comes back, faults are named, a broker is in between.
#include <arpa/inet.h>
#include <sys/socket.h>

#include <filesystem>

#include "mirror_session.h"
#include "support/mosquitto.h"

namespace rtsg::test {

namespace {

/// Connects to "SCHEME://127.0.0.1:PORT".
int connectTo(const std::string& endpoint) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1))));
    const int socket = ::socket(AF_INET, endpoint.starts_with("udp") ? SOCK_DGRAM : SOCK_STREAM, 0);
    EXPECT_EQ(::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0) << endpoint;
    const timeval patience = {60, 0};
    (void)::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    return socket;
}

std::string lineFrom(int socket) {
    std::string line;
    for (char c = 0; ::recv(socket, &c, 1, 0) == 1 && c != '\n';) line += c;
    return line;
}

}  // namespace

class FeedsOfProgram : public Mirror {};

TEST_F(FeedsOfProgram, WhatWasWatchedComesBack) {
    const std::string still = folder / "still.x3dv";
    std::string text = scene();
    text.erase(text.find("ROUTE PATH"));
    writeFile(still, text);
    beginsAtZero = true;
    const Outcome watched = rtsg({"run", file, "--for", "1s", "--watch", "BOX.translation"});
    ASSERT_EQ(watched.status, 0) << watched.err;
    const Outcome fed = rtsg({"run", still, "--for", "1s", "--feed", "-", "--watch", "BOX.translation"}, watched.out);
    EXPECT_EQ(fed.status, 0) << fed.err;
    EXPECT_EQ(fed.out, watched.out);
    writeFile(folder / "moves", watched.out);
    const Outcome published = rtsg({"run", still, "--for", "1s", "--feed", folder / "moves", "--publish",
                                    folder / "published", "--fields", "BOX.translation"});
    EXPECT_EQ(published.status, 0) << published.err;
    EXPECT_EQ(readFile(folder / "published"), watched.out);
}

TEST_F(FeedsOfProgram, LinesThatNoFileTookMakeTheStatusOne) {
    const Outcome run =
        rtsg({"run", file, "--for", "0.1s", "--publish", "/dev/full", "--fields", "BOX.translation", "--json"});
    EXPECT_EQ(run.status, 1);
    EXPECT_NE(run.err.find("lines were missed"), std::string::npos) << run.err;
}

TEST_F(FeedsOfProgram, WhatCannotBeReadMakesTheStatusOne) {
    const Outcome run = rtsg({"run", file, "--for", "0.1s", "--feed", folder.path().string()});
    EXPECT_EQ(run.status, 1);
    EXPECT_NE(run.err.find("Is a directory"), std::string::npos) << run.err;
    const std::string errors = streams();
    const int status = std::system(("'" RTSG_PROGRAM "' run '" + file + "' --for 0.1s --feed - < '" +
                                    folder.path().string() + "' > /dev/null 2> '" + errors + "'")
                                       .c_str());
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 1);
    EXPECT_NE(readFile(errors).find("cannot read -: Is a directory"), std::string::npos) << readFile(errors);
}

TEST_F(FeedsOfProgram, AFileIsNotFedAndPublishedTo) {
    const std::string lines = folder / "lines", link = folder / "link", moves = "0,BOX,scale,2 2 2\n";
    writeFile(lines, moves);
    std::filesystem::create_symlink(lines, link);
    const Outcome run =
        rtsg({"run", file, "--for", "0.1s", "--feed", lines, "--publish", link, "--fields", "BOX.translation"});
    EXPECT_EQ(run.status, 2);
    EXPECT_NE(run.err.find("is what --feed reads"), std::string::npos) << run.err;
    EXPECT_EQ(readFile(lines), moves);
}

TEST_F(FeedsOfProgram, FaultyLinesOfAPipeAreNamedAndMakeTheStatusOne) {
    const Outcome run =
        rtsg({"run", file, "--for", "0.1s", "--feed", "-", "--json"},
             "BOX,scale,2 2 2\nBOXX,scale,1 1 1\n{\"node\":\"BOX\",\"field\":\"scale\",\"value\":[1]}\n");
    EXPECT_EQ(run.status, 1);
    EXPECT_NE(run.err.find("-:2: warning: BOXX.scale: no node is named BOXX (did you mean BOX?)"), std::string::npos)
        << run.err;
    EXPECT_NE(run.err.find("-:3: warning: BOX.scale: expected SFVec3f"), std::string::npos) << run.err;
    const auto feed = nlohmann::json::parse(lastLine(run.out)).at("feeds").at(0);
    EXPECT_EQ(feed.at("events"), 1);
    EXPECT_EQ(feed.at("faulty"), 2);
}

TEST_F(FeedsOfProgram, OptionsThatMakeNoSenseAreRefused) {
    using Arguments = std::vector<std::string>;
    for (const Arguments& more : {Arguments{"--publish", "-"},
                                  {"--fields", "BOX.translation"},
                                  {"--publish-rate", "3"},
                                  {"--feed", "udp://127.0.0.1:0"},
                                  {"--feed", "-", "--feed", "-"}}) {
        Arguments arguments{"run", file, "--for", "0.1s"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        EXPECT_EQ(rtsg(arguments).status, 2) << more[0] << ' ' << more.back();
    }
    const Outcome open =
        rtsg({"serve", file, "--bind", "tcp://127.0.0.1:*", "--feed", "udp://0.0.0.0:0", "--for", "1s"});
    EXPECT_EQ(open.status, 1);
    EXPECT_NE(open.err.find("--insecure"), std::string::npos) << open.err;
}

TEST_F(FeedsOfProgram, AServedSceneTakesAndSendsEventsBySockets) {
    server = std::make_unique<Program>(
        std::vector<std::string>{"serve", file, "--bind", "tcp://127.0.0.1:*", "--json", "--feed", "udp://127.0.0.1:0",
                                 "--feed", "tcp://127.0.0.1:0", "--publish", "tcp://127.0.0.1:0", "--fields",
                                 "FLAG.toggle,BOX.scale"},
        streams());
    const auto first = nlohmann::json::parse(server->firstLine());
    const int out = connectTo(first.at("published").at(0));
    const int datagrams = connectTo(first.at("feeds").at(0)), stream = connectTo(first.at("feeds").at(1));
    const std::string scaled = R"({"node":"BOX","field":"scale","value":[2,3,4]})", half = "FLAG,toggle,";
    ASSERT_GT(::send(datagrams, scaled.data(), scaled.size(), 0), 0);
    EXPECT_NE(lineFrom(out).find(R"("node":"BOX","field":"scale","value":[2,3,4]})"), std::string::npos);
    ASSERT_GT(::send(stream, half.data(), half.size(), 0), 0);
    ASSERT_GT(::send(stream, "TRUE\n", 5, 0), 0);
    EXPECT_NE(lineFrom(out).find(R"("node":"FLAG","field":"toggle","value":true})"), std::string::npos);
    server->signal(SIGINT);
    const Outcome end = server->wait();
    for (const int one : {out, datagrams, stream}) ::close(one);
    EXPECT_EQ(end.status, 0) << end.err;
    const auto summary = nlohmann::json::parse(lastLine(end.out));
    EXPECT_EQ(summary.at("feeds").at(0).at("events"), 1);
    EXPECT_EQ(summary.at("published").at(0).at("lines"), 2);
}

TEST_F(FeedsOfProgram, ABrokerIsInBetween) {
    if (Mosquitto::program().empty()) GTEST_SKIP() << Mosquitto::kMissing;
    Mosquitto broker;
    // The first scene's box moves, the second one's follows it by the broker.
    const std::string still = folder / "still.x3dv";
    std::string text = scene();
    text.erase(text.find("ROUTE PATH"));
    writeFile(still, text);
    Program follower({"serve", still, "--bind", "tcp://127.0.0.1:*", "--json", "--feed", broker.endpoint("scene/#"),
                      "--publish", "tcp://127.0.0.1:0", "--fields", "BOX.translation"},
                     streams());
    const int out = connectTo(nlohmann::json::parse(follower.firstLine()).at("published").at(0));
    serve({"--publish", broker.endpoint("scene/box"), "--fields", "BOX.translation", "--publish-rate", "20"},
          "tcp://127.0.0.1:*");
    const std::string moved = lineFrom(out);
    EXPECT_NE(moved.find(R"("node":"BOX","field":"translation","value":[)"), std::string::npos) << moved;
    ::close(out);
    broker.stop();
    // Without its broker each goes on.
    for (Program* one : {&follower, server.get()}) {
        one->signal(SIGINT);
        EXPECT_EQ(one->wait().status, 0);
    }
}

}  // namespace rtsg::test
