// Visit: one HTTP connection, whose requests are answered one after the other, until one asks for a WebSocket.
//
// Invariant: a request has at most kLongestHead bytes and almost no body.
// Threading: the server's thread.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include <boost/beast/core.hpp>

#include "http_server.h"
#include "stream.h"

namespace rtsg::web {

using Response = http::response<http::string_body>;

/// The address for which a connection counts. For IPv6 the first half, because one customer has all addresses of the
/// other half.
std::string sourceOf(const Tcp::socket& socket);

class Visit : public std::enable_shared_from_this<Visit> {
  public:
    Visit(HttpServer& server, Tcp::socket&& socket);
    ~Visit() { server_.went(this); }
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

    // Answers, one to each request.
    void say(Response response);
    /// A line of text, after which the connection ends.
    void refuse(http::status status, std::string why);
    /// The answer comes from another thread, or the request times out.
    void wait();
    /// What was waited for. With `type` empty there is no such file.
    void show(std::string bytes, const std::string& type);
    /// The connection becomes a WebSocket.
    Stream&& release();
    unsigned version() const { return version_; }

  private:
    void read();
    void failed(beast::error_code error);

    HttpServer& server_;
    const std::string source_;
    State state_ = State::silent;
    std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
    Stream stream_;
    beast::flat_buffer buffer_;
    std::optional<http::request_parser<http::string_body>> parser_;
    Response response_;
    net::steady_timer waiting_;  // for another thread
    bool keepAlive_ = false;
    unsigned version_ = 11;
};

}  // namespace rtsg::web
