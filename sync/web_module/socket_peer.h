// SocketPeer: one connection of a SocketServer: its request, its handshake, and then its messages.
//
// Threading: the server's thread.
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include "socket_server.h"
#include "stream.h"

namespace rtsg::web {

class SocketPeer : public std::enable_shared_from_this<SocketPeer> {
  public:
    SocketPeer(SocketServer& server, Tcp::socket&& socket, std::uint64_t number)
        : server_(server), number_(number), socket_(Stream(std::move(socket), nullptr)) {}
    /// Reads the request.
    void begin();
    void push(std::string head, std::shared_ptr<const std::string> body, bool bytes);
    /// Its last message was taken.
    void resume();
    /// Sends what waits, then says goodbye.
    void end();
    /// Ends the connection at once.
    void leave();

  private:
    struct Message {
        std::string head;
        std::shared_ptr<const std::string> body;
        bool bytes = false;
        std::size_t size() const { return head.size() + body->size(); }
    };
    void judge(Request request);
    void refuse(http::status status, std::string why);
    void read();
    void write();

    SocketServer& server_;
    const std::uint64_t number_;
    beast::websocket::stream<Stream> socket_;
    beast::flat_buffer incoming_;
    std::optional<http::request_parser<http::string_body>> parser_;
    Request request_;
    http::response<http::string_body> response_;
    std::deque<Message> queue_;
    std::shared_ptr<std::atomic<std::size_t>> queued_ = std::make_shared<std::atomic<std::size_t>>(0);
    bool accepted_ = false, writing_ = false, ending_ = false, gone_ = false;
};

}  // namespace rtsg::web
