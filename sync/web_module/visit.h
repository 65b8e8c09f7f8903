// Visit: one HTTP connection that loads files of the page, one after the other, until it asks for a WebSocket.
//
// Invariant: a request has at most kLongestHead bytes and almost no body.
// Threading: the gateway's thread.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include <boost/beast/core.hpp>

#include "gateway.h"
#include "stream.h"

namespace rtsg::web {

class Visit : public std::enable_shared_from_this<Visit> {
  public:
    Visit(Gateway& gateway, Tcp::socket&& socket);
    ~Visit() { gateway_.went(this); }
    /// The event that the connection waits for.
    enum class State : std::uint8_t {
        silent,  // its first request
        idle,    // another request
        busy,    // its answer
    };
    State state() const { return state_; }
    const std::string& source() const { return source_; }
    /// When its last request came.
    std::chrono::steady_clock::time_point since() const { return since_; }
    /// Ends the connection, which no longer counts.
    void end();
    /// Does the TLS handshake, if any, then reads.
    void begin();
    void read();
    /// Sends the file that was asked for. With `type` empty there is none.
    void show(std::string bytes, const std::string& type);

  private:
    void answer(Request request);
    bool wish(const Request& request);
    void say(http::response<http::string_body> response);

    void refuse(beast::error_code error);

    Gateway& gateway_;
    const std::string source_;
    State state_ = State::silent;
    std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
    Stream stream_;
    beast::flat_buffer buffer_;
    std::optional<http::request_parser<http::string_body>> parser_;
    http::response<http::string_body> response_;
    net::steady_timer waiting_;  // for the scene's thread
    bool keepAlive_ = false;
    unsigned version_ = 11;
};

}  // namespace rtsg::web
