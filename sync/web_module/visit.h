// One connection by HTTP: files of the page, one after the other, until it asks for a WebSocket.
//
// Invariant: a request is at most kLongestHead bytes long and has no body worth mention. Threading: the gateway's.
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
    /// What it waits for.
    enum class State : std::uint8_t {
        silent,  // its first request
        idle,    // another one
        busy,    // its answer
    };
    State state() const { return state_; }
    const std::string& source() const { return source_; }
    /// When its last request came.
    std::chrono::steady_clock::time_point since() const { return since_; }
    /// Ends the connection, which counts no more from now on.
    void end();
    /// Agrees on encryption where there is any, then reads.
    void begin();
    void read();
    /// The file that was asked for; `type` empty: there is none.
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
