// MirrorRelay: passes a session on: a replica of an origin, served to peers of its own (PROTOCOL.md, "Relays").
//
// Invariant: who follows the relay is in a state that the origin had, with its number and hash. What peers send is
// checked here by what they may, handed to the origin, which carries it out, and its verdict comes back when the effect
// is there. That the origin is lost is told within a second of the last heartbeat. Threading: the replica's thread.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

namespace rtsg {

class MirrorRelay {
  public:
    /// `replica`: as MirrorClient's. Serves at `endpoint` from the first state of the origin's on.
    static Result<std::unique_ptr<MirrorRelay>> connect(Scene& replica, const std::string& origin,
                                                        const std::string& endpoint, MirrorClientOptions from = {},
                                                        MirrorServerOptions to = {});
    ~MirrorRelay();

    /// Passes on what has come, from either side; waits for it up to `timeout`. Returns the number of sets applied.
    /// Error: `endpoint` cannot be served.
    Result<std::size_t> poll(std::chrono::milliseconds timeout = std::chrono::milliseconds(0));

    MirrorClient& client() { return *client_; }
    /// Null until the first state has come.
    MirrorServer* server() { return server_.get(); }

  private:
    MirrorRelay(Scene& replica, std::string endpoint, MirrorServerOptions to);

    Scene& replica_;
    std::string endpoint_;
    MirrorServerOptions options_;
    std::unique_ptr<MirrorClient> client_;
    std::unique_ptr<MirrorServer> server_;
};

}  // namespace rtsg
