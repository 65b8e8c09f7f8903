// Monitoring of a running program: metrics, `rtsg top`, messages as JSON, messages to the service manager.
#include <sys/socket.h>
#include <sys/un.h>

#include "mirror_session.h"

namespace rtsg::test {

class Operating : public Mirror {};

TEST_F(Operating, FiguresOfAServerAndItsMirrorAreShown) {
    server = std::make_unique<Program>(std::vector<std::string>{"serve", file, "--bind", "tcp://127.0.0.1:*", "--json",
                                                                "--metrics-port", "0", "--await", "1"},
                                       streams());
    const auto first = nlohmann::json::parse(server->firstLine());
    const std::string endpoint = first.at("metrics");
    Program mirror({"mirror", first.at("endpoint"), "--json"}, streams());
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    nlohmann::json figures = nlohmann::json::object();
    while (figures.value("rtsg_peers", 0) < 1 || figures.value("rtsg_sent_bytes_total", 0) < 1000) {
        const Outcome top = rtsg({"top", endpoint, "--once", "--json"});
        ASSERT_EQ(top.status, 0) << top.err;
        figures = nlohmann::json::parse(top.out);
        ASSERT_LT(std::chrono::steady_clock::now(), end) << top.out;
    }
    EXPECT_GT(figures.at("rtsg_memory_bytes"), 1e6);
    EXPECT_GT(figures.at("rtsg_frame_seconds_count"), 0);
    EXPECT_EQ(figures.at("rtsg_frame_seconds_bucket{le=\"+Inf\"}"), figures.at("rtsg_frame_seconds_count"));
    const Outcome table = rtsg({"top", "http://" + endpoint + "/metrics", "--once"});
    EXPECT_NE(table.out.find("\npeers  "), std::string::npos) << table.out;
    EXPECT_EQ(table.out.find('\033'), std::string::npos);
    // It ends with the program that it looks at.
    Program watching({"top", endpoint, "--interval", "50ms"}, streams());
    (void)watching.firstLine();
    server->signal(SIGINT);
    EXPECT_EQ(server->wait().status, 0);
    EXPECT_EQ(mirror.wait().status, 0);
    EXPECT_EQ(watching.wait().status, 0);
    EXPECT_EQ(rtsg({"top", endpoint, "--once"}).status, 1);
}

TEST_F(Operating, WhatIsSaidIsLinesOfJsonFromALevelOn) {
    const std::vector<std::string> serve{"serve", file,    "--bind", "tcp://127.0.0.1:*", "--for", "0.2s", "--feed",
                                         "-",     "--log", "json"};
    const Outcome all = rtsg(serve, "BOXX,scale,1 1 1\nBOX,scale,1 1 1\n");
    std::istringstream in(all.err);
    int warnings = 0;
    for (std::string line; std::getline(in, line);) {
        const auto said = nlohmann::json::parse(line);
        EXPECT_TRUE(said.contains("time") && said.contains("text")) << line;
        if (said.at("level") != "warning" || said.value("file", "") != "-") continue;
        ++warnings;
        EXPECT_EQ(said.at("line"), 1);
        EXPECT_EQ(said.at("code"), "no-such-node");
    }
    EXPECT_EQ(warnings, 1) << all.err;
    std::vector<std::string> quiet = serve;
    quiet.insert(quiet.end(), {"--log-level", "error"});
    EXPECT_EQ(rtsg(quiet, "BOXX,scale,1 1 1\n").err, "");
}

TEST_F(Operating, TheServiceManagerIsTold) {
    const std::string path = folder / "notify";
    const int socket = ::socket(AF_UNIX, SOCK_DGRAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    const timeval patience = {60, 0};
    (void)::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
    ::setenv("WATCHDOG_USEC", "30000", 1);
    server =
        std::make_unique<Program>(std::vector<std::string>{"serve", file, "--bind", "tcp://127.0.0.1:*"}, streams());
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
    const auto heard = [&] {
        char text[500] = {};
        return ::recv(socket, text, sizeof(text) - 1, 0) > 0 ? std::string(text) : "nothing";
    };
    EXPECT_TRUE(heard().starts_with("READY=1\n"));
    EXPECT_EQ(heard(), "WATCHDOG=1");
    EXPECT_EQ(heard(), "WATCHDOG=1");
    server->signal(SIGTERM);
    std::string last = heard();
    while (last == "WATCHDOG=1") last = heard();
    EXPECT_EQ(last, "STOPPING=1");
    EXPECT_EQ(server->wait().status, 0);
    ::close(socket);
}

TEST_F(Operating, WhatCannotBeServedOrSeenIsSaid) {
    EXPECT_EQ(rtsg({"serve", file, "--bind", "tcp://127.0.0.1:*", "--for", "0.1s", "--metrics-port", "x"}).status, 1);
    const Outcome open =
        rtsg({"serve", file, "--bind", "tcp://127.0.0.1:*", "--for", "0.1s", "--metrics-port", "0.0.0.0:0"});
    EXPECT_EQ(open.status, 1);
    EXPECT_NE(open.err.find("--insecure"), std::string::npos) << open.err;
    EXPECT_EQ(rtsg({"top", "tcp://127.0.0.1:1", "--once"}).status, 1);
    EXPECT_EQ(rtsg({"top", "1", "--interval", "1ms"}).status, 2);
}

}  // namespace rtsg::test
