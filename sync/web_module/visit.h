// One connection by HTTP: files of the page, one after the other, until it asks for a WebSocket.
//
// Invariant: a request is at most kLongestHead bytes long and has no body worth mention. Threading: the gateway's.
#pragma once

#include <memory>
#include <optional>

#include <boost/beast/core.hpp>

#include "gateway.h"
#include "stream.h"

namespace rtsg::web {

class Visit : public std::enable_shared_from_this<Visit> {
  public:
    Visit(Gateway& gateway, Tcp::socket&& socket);
    ~Visit() { gateway_.visited(-1); }
    /// Agrees on encryption where there is any, then reads.
    void begin();
    void read();
    /// The file that was asked for; `type` empty: there is none.
    void show(std::string bytes, const std::string& type);

  private:
    void answer(Request request);
    bool wish(const Request& request);
    void say(http::response<http::string_body> response);

    Gateway& gateway_;
    Stream stream_;
    beast::flat_buffer buffer_;
    std::optional<http::request_parser<http::string_body>> parser_;
    http::response<http::string_body> response_;
    net::steady_timer waiting_;  // for the scene's thread
    bool keepAlive_ = false;
    unsigned version_ = 11;
};

}  // namespace rtsg::web
