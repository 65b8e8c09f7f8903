// Browser: one browser that follows the scene, with its WebSocket and its messages.
//
// Invariant: one message of it waits for the server, and the next is read when that was taken. What the server sends
// waits here, as much as the client's window allows; the bytes of records are the server's own.
// Threading: the gateway's thread.
#pragma once

#include <chrono>
#include <deque>
#include <memory>
#include <span>
#include <string>

#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include "gateway.h"
#include "stream.h"

namespace rtsg::web {

class Browser : public std::enable_shared_from_this<Browser> {
  public:
    Browser(Gateway& gateway, Stream&& stream, std::string source);
    ~Browser();
    void begin(Request request);
    /// A message for it. `owner` keeps `second` alive.
    void push(std::string head, std::span<const std::byte> second, std::shared_ptr<const void> owner);
    /// Its last message was taken.
    void resume();
    /// Sends what waits, then ends the connection properly.
    void end();
    /// Ends the connection at once.
    void leave();
    std::uint64_t number() const { return number_; }
    std::chrono::steady_clock::time_point since() const { return since_; }
    /// True if it has been connected that long and has said nothing.
    bool isSilentFor(std::chrono::steady_clock::duration time) const {
        return !spoke_ && std::chrono::steady_clock::now() - since_ >= time;
    }
    const std::string& source() const { return source_; }

  private:
    struct Message {
        std::string head;
        std::span<const std::byte> second;
        std::shared_ptr<const void> owner;
        std::size_t size() const { return head.size() + second.size(); }
    };
    void read();
    void write();
    void leaveSoon();

    Gateway& gateway_;
    beast::websocket::stream<Stream> socket_;
    net::steady_timer farewell_;
    Request request_;
    beast::flat_buffer incoming_;
    std::deque<Message> queue_;
    std::size_t queued_ = 0;
    bool accepted_ = false, writing_ = false, ending_ = false, gone_ = false, spoke_ = false;
    const std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
    std::string source_;
    const std::uint64_t number_;
    std::shared_ptr<Browser> waits_;  // itself, while its message waits for the server and nothing is read
};

}  // namespace rtsg::web
