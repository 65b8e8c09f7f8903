// One browser that follows: its WebSocket, and what it says and is told.
//
// Invariant: of what the server sends at most kMostQueued bytes and a message wait here; the rest waits at the server,
// within the client's window. Threading: the gateway's thread.
#pragma once

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
    Browser(Gateway& gateway, Stream&& stream);
    ~Browser();
    void begin(Request request);
    /// What the server has said goes out, then a proper end.
    void end();

  private:
    void read();
    void pump();
    void watch();
    void write();
    void leave();
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
    bool accepted_ = false, writing_ = false, watching_ = false, ending_ = false, gone_ = false;
};

}  // namespace rtsg::web
