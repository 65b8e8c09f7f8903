// One browser's connection to the mirror server, and how messages of two parts travel as one.
//
// Invariant: what a browser says has a first part, behind u32 its length, and perhaps a second; anything else is
// refused before it gets here. Threading: the gateway's thread.
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

    /// Readable when something may have come; only a hint (ZMQ_FD).
    int descriptor() const;
    /// False when nothing is there. `message`: as a browser gets it.
    bool receive(std::string& message);
    /// False when it makes no sense, or the server takes no more.
    bool send(std::string_view message);
    /// So that the server need not wait for a sign of this client.
    void bye();

  private:
    void* socket_;
};

}  // namespace rtsg::web
