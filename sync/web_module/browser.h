// Browser: one browser that follows the scene, with its WebSocket and its messages.
//
// Invariant: of what the server sends, at most kMaxQueued bytes and one message wait here. The rest waits at the
// server, within the client's window.
// Threading: the gateway's thread.
#pragma once

#include <chrono>
#include <deque>
#include <memory>
#include <string>

#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include "gateway.h"
#include "link.h"
#include "stream.h"

namespace rtsg::web {

class Browser : public std::enable_shared_from_this<Browser> {
  public:
    Browser(Gateway& gateway, Stream&& stream, std::string source);
    ~Browser();
    void begin(Request request);
    /// Sends what the server has said, then ends the connection properly.
    void end();
    /// Ends the connection at once.
    void leave();
    std::chrono::steady_clock::time_point since() const { return since_; }
    /// True if it has been connected that long and has said nothing.
    bool isSilentFor(std::chrono::steady_clock::duration time) const {
        return !spoke_ && std::chrono::steady_clock::now() - since_ >= time;
    }
    const std::string& source() const { return source_; }

  private:
    void read();
    void pump();
    void watch();
    void write();
    void leaveSoon();

    Gateway& gateway_;
    beast::websocket::stream<Stream> socket_;
    Link link_;
    net::posix::stream_descriptor descriptor_;
    net::steady_timer farewell_;
    Request request_;
    beast::flat_buffer incoming_;
    std::deque<std::string> queue_;
    std::size_t queued_ = 0;
    bool accepted_ = false, writing_ = false, watching_ = false, ending_ = false, gone_ = false, spoke_ = false;
    const std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
    std::string source_;
};

}  // namespace rtsg::web
