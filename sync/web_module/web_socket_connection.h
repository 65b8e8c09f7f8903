// WebSocketConnection: one WebSocket, from its handshake on, and the messages that wait for it.
//
// Invariant: what is sent waits here within the rules' bound; the bytes of records are the server's own.
// Threading: the server's thread.
#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <string>

#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include "http_server.h"
#include "stream.h"

namespace rtsg::web {

class WebSocketConnection : public std::enable_shared_from_this<WebSocketConnection> {
  public:
    WebSocketConnection(HttpServer& server, std::uint64_t number, Stream&& stream, std::string source);
    void begin(Request request);
    void push(HttpServer::Message message);
    /// Its last message was taken.
    void resume();
    /// Sends what waits, then ends the connection properly.
    void end();
    /// Ends the connection at once.
    void leave();

    std::uint64_t number() const { return number_; }
    const std::string& source() const { return source_; }
    std::chrono::steady_clock::time_point since() const { return since_; }
    /// The handshake is done.
    bool isAccepted() const { return accepted_; }
    /// True if it has been connected that long and has said nothing.
    bool isSilentFor(std::chrono::steady_clock::duration time) const {
        return !spoke_ && std::chrono::steady_clock::now() - since_ >= time;
    }
    /// The bytes that wait.
    const std::shared_ptr<std::atomic<std::size_t>>& queued() const { return queued_; }

  private:
    void read();
    void write();
    void leaveSoon();

    HttpServer& server_;
    const std::uint64_t number_;
    const std::string source_;
    const std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
    beast::websocket::stream<Stream> socket_;
    net::steady_timer farewell_;
    Request request_;
    beast::flat_buffer incoming_;
    std::deque<HttpServer::Message> queue_;
    const std::shared_ptr<std::atomic<std::size_t>> queued_ = std::make_shared<std::atomic<std::size_t>>(0);
    bool accepted_ = false, writing_ = false, ending_ = false, gone_ = false, spoke_ = false;
};

}  // namespace rtsg::web
