// --web on the command line: where the page is, who is refused, and that a served scene answers browsers.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <nlohmann/json.hpp>

#include "program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class WebOption : public CommandLine {
  protected:
    /// The answer to GET `target`, with its head.
    static std::string get(int port, const std::string& target) {
        const int descriptor = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        std::string answer;
        if (::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
            const std::string request = "GET " + target + " HTTP/1.1\r\nHost: localhost:" + std::to_string(port) +
                                        "\r\nConnection: close\r\n\r\n";
            (void)::send(descriptor, request.data(), request.size(), MSG_NOSIGNAL);
            char buffer[4096];
            for (ssize_t count; (count = ::recv(descriptor, buffer, sizeof(buffer), 0)) > 0;)
                answer.append(buffer, static_cast<std::size_t>(count));
        }
        ::close(descriptor);
        return answer;
    }
    static int portOf(const std::string& url) { return std::stoi(url.substr(url.find(':', 7) + 1)); }
};

TEST_F(WebOption, NamesThePageAndServesItWithTheScenesPictures) {
    writeFile(folder / "sign.png", std::string("\x89PNG\r\n\x1a\n.....", 13));
    writeFile(file,
              "#X3D V4.0 utf8\nShape { appearance Appearance { texture ImageTexture { url \"sign.png\" } } "
              "geometry Box { } }\n");
    Program server({"serve", file, "--json", "--web", "0", "--for", "60s"}, streams());
    const json first = json::parse(server.firstLine());
    EXPECT_THAT(first.at("endpoint"), HasSubstr("tcp://127.0.0.1:"));
    const std::string url = first.at("web");
    EXPECT_THAT(url, HasSubstr("http://127.0.0.1:"));
    EXPECT_THAT(get(portOf(url), "/"), HasSubstr("/page/page.js"));
    EXPECT_THAT(get(portOf(url), "/src/mirror.js"), HasSubstr("export class Mirror"));
    int pictures = 0;
    for (int node = 2; node < 8; ++node)
        pictures += get(portOf(url), "/picture/" + std::to_string(node) + "/0").find("image/png") != std::string::npos;
    EXPECT_EQ(pictures, 1);
    server.signal(SIGINT);
    EXPECT_EQ(server.wait().status, 1);  // before its time
}

TEST_F(WebOption, AServedLogHasThePageToo) {
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "200ms"}).status, 0);
    Program server({"serve", log, "--json", "--web", "0", "--paused", "--for", "60s"}, streams());
    const std::string url = json::parse(server.firstLine()).at("web");
    EXPECT_THAT(get(portOf(url), "/"), HasSubstr("200 OK"));
    server.signal(SIGINT);
    EXPECT_EQ(server.wait().status, 1);  // before its time
}

TEST_F(WebOption, WhatCannotBeServedIsSaid) {
    const auto status = [&](std::vector<std::string> more, const char* text) {
        std::vector<std::string> arguments{"serve", file, "--for", "100ms"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_THAT(outcome.err, HasSubstr(text));
        return outcome.status;
    };
    EXPECT_EQ(status({"--web", "80x"}, "expected PORT or ADDRESS:PORT"), 2);
    EXPECT_EQ(status({"--web", "0", "--web-token", "a b"}, "a token is made of"), 2);
    for (const char* half : {"--web-cert", "--web-key"})
        EXPECT_EQ(status({"--web", "0", half, file}, "needs a certificate and its private key"), 2);
    EXPECT_EQ(status({"--web-token", "abc"}, "only together with --web"), 2);
    Program server({"serve", file, "--json", "--web", "0", "--for", "60s"}, streams());
    const int taken = portOf(json::parse(server.firstLine()).at("web"));
    EXPECT_EQ(status({"--web", std::to_string(taken)}, "cannot serve browsers"), 1);
    const Outcome other = rtsg({"serve", file, "--web", "0.0.0.0:0", "--for", "100ms"});
    EXPECT_EQ(other.status, 0);
    EXPECT_THAT(other.out, HasSubstr("/#token="));
}

}  // namespace
}  // namespace rtsg::test
