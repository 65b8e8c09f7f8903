// What tests speak to the gateway for browsers with: bare bytes (RFC 9112, RFC 6455), as nothing of ours shall agree
// with itself there; and a gateway with a page, files and a scene.
#pragma once

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/web_gateway.h>

#include "mirror_support.h"
#include "support/temp_folder.h"

namespace rtsg::test {

using namespace std::chrono_literals;

inline const std::string kPng("\x89PNG\r\n\x1a\n and so on", 18);

/// One TCP connection; reads until it has what it waits for, or the peer ends it.
class Line {
  public:
    explicit Line(int port) : descriptor_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    }
    ~Line() { ::close(descriptor_); }
    Line(const Line&) = delete;
    Line& operator=(const Line&) = delete;

    void say(std::string_view bytes) { (void)::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
    /// One more read, if something comes within a while; false at the end.
    bool more(std::chrono::milliseconds patience) {
        pollfd in{descriptor_, POLLIN, 0};
        if (::poll(&in, 1, static_cast<int>(patience.count())) <= 0) return true;
        char buffer[65536];
        const ssize_t count = ::recv(descriptor_, buffer, sizeof(buffer), 0);
        if (count > 0) heard.append(buffer, static_cast<std::size_t>(count));
        return count > 0;
    }
    bool hear(const std::function<bool()>& enough) {
        const auto end = std::chrono::steady_clock::now() + kPatience;
        while (!enough())
            if (!more(10ms) || std::chrono::steady_clock::now() > end) return enough();
        return true;
    }
    bool ended() {
        const auto end = std::chrono::steady_clock::now() + kPatience;
        while (std::chrono::steady_clock::now() < end)
            if (!more(10ms)) return true;
        return false;
    }
    std::string heard;

  private:
    int descriptor_;
};

struct Answer {
    int status = 0;
    std::string head, body;
};

/// By WebSocket: messages of two parts behind the length of the first, in unmasked frames one way, masked the other.
struct WebSocketLine : Line {
    using Line::Line;
    void sayMessage(std::string_view first, std::string_view second = {}) {
        const auto size = static_cast<std::uint32_t>(first.size());
        std::string message(reinterpret_cast<const char*>(&size), 4);
        message += first;
        message += second;
        sayFrame(message);
    }
    void sayFrame(std::string_view message) {
        std::string frame("\x82", 1);
        if (message.size() < 126) {
            frame += static_cast<char>(0x80 | message.size());
        } else {
            frame += static_cast<char>(0x80 | 126);
            frame += static_cast<char>(message.size() >> 8);
            frame += static_cast<char>(message.size() & 0xFF);
        }
        frame += std::string(4, '\0');  // the mask
        frame += message;
        say(frame);
    }
    /// The next message's type and its second part.
    std::optional<std::pair<int, std::string>> next() {
        std::size_t length = 0, at = 0;
        const bool whole = hear([&] {
            if (heard.size() < 2) return false;
            length = static_cast<unsigned char>(heard[1]);
            at = 2;
            for (std::size_t extra = length == 126 ? 2 : length == 127 ? 8 : 0; extra > 0 && at == 2;) {
                if (heard.size() < 2 + extra) return false;
                for (length = 0; extra > 0; --extra) length = length << 8 | static_cast<unsigned char>(heard[at++]);
            }
            return heard.size() >= at + length;
        });
        if (!whole || heard[0] != '\x82' || length < 12) return std::nullopt;
        const std::string message = heard.substr(at, length);
        heard.erase(0, at + length);
        std::uint32_t first = 0;
        std::memcpy(&first, message.data(), 4);
        return std::pair(static_cast<int>(message[9]), message.substr(4 + first));
    }
};

inline std::string helloOf(std::uint64_t session) {
    std::string text("RTSG\x01\x01\0\0", 8);
    for (const std::uint64_t n :
         {session, std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{1} << 20})
        text.append(reinterpret_cast<const char*>(&n), 8);
    return text + std::string(
                      "\x07"
                      "browser",
                      8);
}

struct ServedPage {
    TempFolder folder;
    Scene scene;
    Resources resources;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<WebGateway> gateway;
    std::string host;
    int port = 0;

    explicit ServedPage(WebGatewayOptions options = {}) : resources(folder.path() / "scene") {
        write("page/index.html", "<script nonce=\"@NONCE@\"></script>");
        write("src/index.js", "export {};");
        write("src/.secret.js", "no");
        write("src/notes.txt", "no");
        write("package.json", "no");
        write("scene/sign.png", kPng);
        write("scene/sign.txt", "no picture");
        write("outside.png", kPng);
        server = *MirrorServer::start(scene, kAnyPort);
        options.endpoint = server->endpoint();
        options.folder = folder.path();
        auto started = WebGateway::start(options);
        EXPECT_TRUE(started) << started.error().text;
        gateway = std::move(*started);
        port = std::stoi(gateway->url().substr(gateway->url().rfind(':') + 1));
        host = "127.0.0.1:" + std::to_string(port);
    }
    void write(const std::string& name, const std::string& text) {
        const std::filesystem::path file = folder.path() / name;
        std::filesystem::create_directories(file.parent_path());
        std::ofstream(file, std::ios::binary) << text;
    }
    void load(const std::string& text) {
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, text, diagnostics));
        scene.newFrame(0);
    }
    Answer ask(const std::string& target, const std::string& method = "GET", const std::string& more = {},
               const std::string& name = {}) {
        Line line(port);
        line.say(method + " " + target + " HTTP/1.1\r\nHost: " + (name.empty() ? host : name) + "\r\n" + more +
                 "Connection: close\r\n\r\n");
        const auto end = std::chrono::steady_clock::now() + kPatience;
        while (line.more(5ms) && std::chrono::steady_clock::now() < end) gateway->service(scene, resources);
        Answer answer;
        const std::size_t split = line.heard.find("\r\n\r\n");
        if (split == std::string::npos) return answer;
        answer.head = line.heard.substr(0, split + 2);
        answer.body = line.heard.substr(split + 4);
        answer.status = std::stoi(answer.head.substr(9, 3));
        return answer;
    }
    static std::string upgrade(const std::string& origin = {}) {
        return "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
               (origin.empty() ? "" : "Origin: " + origin + "\r\n");
    }
    /// The status of the answer; 101 when the connection is a WebSocket's from here on.
    int open(WebSocketLine& line, const std::string& target = "/mirror", const std::string& origin = {},
             const std::string& name = {}) {
        line.say("GET " + target + " HTTP/1.1\r\nHost: " + (name.empty() ? host : name) + "\r\n" + upgrade(origin) +
                 "\r\n");
        EXPECT_TRUE(line.hear([&] { return line.heard.find("\r\n\r\n") != std::string::npos; }));
        const int status = std::stoi(line.heard.substr(9, 3));
        line.heard.erase(0, line.heard.find("\r\n\r\n") + 4);
        return status;
    }
};

}  // namespace rtsg::test
