// A client of Foxglove's protocol, of bare bytes: what it is told of topics, and the messages of those it subscribes
// to.
#pragma once

#include <cstring>
#include <map>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "support/socket_line.h"

namespace rtsg::test {

struct FoxgloveMessage {
    std::uint32_t subscription = 0;
    std::uint64_t nanoseconds = 0;
    std::string json;
};

class FoxgloveClient : public SocketLine {
  public:
    /// `address`: ws://127.0.0.1:PORT
    explicit FoxgloveClient(const std::string& address, const std::string& more = {})
        : SocketLine(std::stoi(address.substr(address.rfind(':') + 1))) {
        status = open("/", address.substr(address.find("://") + 3),
                      more.empty() ? "Sec-WebSocket-Protocol: other, foxglove.websocket.v1\r\n" : more);
    }

    /// Reads on until `enough` messages are there or something else is; false if the connection ends first.
    bool readUntil(const std::function<bool()>& enough) {
        while (!enough()) {
            const auto frame = nextFrame();
            if (!frame) return false;
            take(*frame);
        }
        return true;
    }
    /// Reads what is there; true once that is enough.
    bool readUntilQuiet(const std::function<bool()>& enough) {
        (void)more(std::chrono::milliseconds(2));
        while (!enough() && hasFrame()) take(*nextFrame());
        return enough();
    }
    void subscribe(std::uint32_t id, const std::string& topic) {
        ask(R"({"op":"subscribe","subscriptions":[{"id":)" + std::to_string(id) + R"(,"channelId":)" +
            std::to_string(channels.at(topic)) + "}]}");
    }
    void ask(const std::string& json) { sayFrame(json, Frame::kText); }

    int status = 0;
    bool closed = false;
    std::string serverInfo;
    std::map<std::string, int> channels;  // by topic
    std::vector<std::string> advertised, statuses;
    std::vector<FoxgloveMessage> messages;
    std::uint64_t time = 0;  // nanoseconds, as last told

  private:
    void take(const Frame& frame) {
        if (frame.kind == Frame::kClose) closed = true;
        if (frame.kind == Frame::kPing) sayFrame(frame.payload, Frame::kPong);
        if (frame.kind == Frame::kText) takeText(frame.payload);
        if (frame.kind != Frame::kBytes || frame.payload.empty()) return;
        const auto number = [&]<class T>(T into, std::size_t at) {
            std::memcpy(&into, frame.payload.data() + at, sizeof(into));
            return into;
        };
        if (frame.payload[0] == 1)
            messages.push_back({number(std::uint32_t{}, 1), number(std::uint64_t{}, 5), frame.payload.substr(13)});
        else if (frame.payload[0] == 2)
            time = number(std::uint64_t{}, 1);
        else
            ADD_FAILURE() << "an unknown message: " << int(frame.payload[0]);
    }
    void takeText(const std::string& text) {
        if (text.starts_with(R"({"op":"serverInfo")")) serverInfo = text;
        if (text.starts_with(R"({"op":"status")")) statuses.push_back(text);
        if (!text.starts_with(R"({"op":"advertise")")) return;
        advertised.push_back(text);
        const std::string id = R"({"id":)", topic = R"(,"topic":")";
        for (std::size_t at = text.find(id); at != text.npos; at = text.find(id, at + 1)) {
            const std::size_t name = text.find(topic, at) + topic.size();
            channels[text.substr(name, text.find('"', name) - name)] = std::stoi(text.substr(at + id.size()));
        }
    }
};

}  // namespace rtsg::test
