// Link: one browser's connection to the mirror server. Messages of two parts travel as one.
//
// Invariant: a browser's message has the length of its first part (u32), that part, and perhaps a second one. Other
// messages are refused before they get here.
// Threading: the gateway's thread.
#pragma once

#include <string>
#include <string_view>

#include <zmq.h>

#include "sockets/web_module.h"

namespace rtsg::web {

class Link {
  public:
    Link(void* context, const WebSettings& settings);
    ~Link();
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;

    /// Readable when something may have come; this is only a hint (ZMQ_FD).
    int descriptor() const;
    /// Returns false if there is none. `message` has the form for browsers.
    bool receive(std::string& message);
    /// Returns false if the message makes no sense, or the server takes no more.
    bool send(std::string_view message);
    /// Says goodbye, so that the server need not wait for this client.
    void bye();

  private:
    void* socket_;
};

}  // namespace rtsg::web
