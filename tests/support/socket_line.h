// A client of HTTP and WebSockets of bare bytes (RFC 9112, RFC 6455), as nothing of ours shall agree with itself there.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace rtsg::test {

inline constexpr std::chrono::seconds kLinePatience{60};

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
        const auto end = std::chrono::steady_clock::now() + kLinePatience;
        while (!enough())
            if (!more(std::chrono::milliseconds(10)) || std::chrono::steady_clock::now() > end) return enough();
        return true;
    }
    bool ended() {
        const auto end = std::chrono::steady_clock::now() + kLinePatience;
        while (std::chrono::steady_clock::now() < end)
            if (!more(std::chrono::milliseconds(10))) return true;
        return false;
    }
    std::string heard;

  private:
    int descriptor_;
};

/// By WebSocket: whole messages, masked one way.
struct SocketLine : Line {
    using Line::Line;
    struct Frame {
        static constexpr int kText = 1, kBytes = 2, kClose = 8, kPing = 9, kPong = 10;
        int kind = 0;
        std::string payload;
    };
    void sayFrame(std::string_view message, int kind = Frame::kBytes) {
        std::string frame(1, static_cast<char>(0x80 | kind));
        if (message.size() < 126) {
            frame += static_cast<char>(0x80 | message.size());
        } else if (message.size() < 65536) {
            frame += static_cast<char>(0x80 | 126);
            frame += static_cast<char>(message.size() >> 8);
            frame += static_cast<char>(message.size() & 0xFF);
        } else {
            frame += static_cast<char>(0x80 | 127);
            for (int shift = 56; shift >= 0; shift -= 8) frame += static_cast<char>(message.size() >> shift & 0xFF);
        }
        frame += std::string(4, '\0');  // the mask
        frame += message;
        say(frame);
    }
    /// A whole message has been read.
    bool hasFrame() const { return frameEnd() > 0; }
    /// Nothing if the peer ends the connection first.
    std::optional<Frame> nextFrame() {
        if (!hear([&] { return hasFrame(); })) return std::nullopt;
        const std::size_t end = frameEnd(), from = payloadAt();
        Frame frame{heard[0] & 0x0F, heard.substr(from, end - from)};
        heard.erase(0, end);
        return frame;
    }
    /// Asks for a WebSocket; `more` are lines of the request. The status of the answer, 101 if it is one from here on.
    int open(const std::string& target, const std::string& host, const std::string& more = {}) {
        say("GET " + target + " HTTP/1.1\r\nHost: " + host +
            "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
            more + "\r\n");
        if (!hear([&] { return heard.find("\r\n\r\n") != std::string::npos; })) return 0;
        const int status = std::stoi(heard.substr(9, 3));
        head = heard.substr(0, heard.find("\r\n\r\n"));
        heard.erase(0, heard.find("\r\n\r\n") + 4);
        return status;
    }
    std::string head;  // of the answer

  private:
    std::size_t payloadAt() const { return heard[1] == 126 ? 4 : heard[1] == 127 ? 10 : 2; }
    /// Where the first message ends; 0 if it is not whole.
    std::size_t frameEnd() const {
        if (heard.size() < 2 || heard.size() < payloadAt()) return 0;
        std::size_t length = 0;
        const std::size_t from = payloadAt();
        for (std::size_t at = from == 2 ? 1 : 2; at < from; ++at)
            length = length << 8 | static_cast<unsigned char>(heard[at]);
        return heard.size() >= from + length ? from + length : 0;
    }
};

}  // namespace rtsg::test
