// Lets tests speak to the gateway like browsers; and a gateway with a page, files and a scene.
#pragma once

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/web_gateway.h>

#include "mirror_support.h"
#include "support/socket_line.h"
#include "support/temp_folder.h"

namespace rtsg::test {

using namespace std::chrono_literals;

inline const std::string kPng("\x89PNG\r\n\x1a\n and so on", 18);

struct Answer {
    int status = 0;
    std::string head, body;
};

/// By WebSocket: messages of two parts behind the length of the first.
struct WebSocketLine : SocketLine {
    using SocketLine::SocketLine;
    void sayMessage(std::string_view first, std::string_view second = {}) {
        const auto size = static_cast<std::uint32_t>(first.size());
        std::string message(reinterpret_cast<const char*>(&size), 4);
        message += first;
        message += second;
        sayFrame(message);
    }
    /// The next message's type and its second part.
    std::optional<std::pair<int, std::string>> next() {
        const auto frame = nextFrame();
        if (!frame || frame->kind != Frame::kBytes || frame->payload.size() < 12) return std::nullopt;
        std::uint32_t first = 0;
        std::memcpy(&first, frame->payload.data(), 4);
        return std::pair(static_cast<int>(frame->payload[9]), frame->payload.substr(4 + first));
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
        options.folder = folder.path();
        auto started = WebGateway::start(*server, options);
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
        return line.open(target, name.empty() ? host : name, origin.empty() ? "" : "Origin: " + origin + "\r\n");
    }
};

}  // namespace rtsg::test
