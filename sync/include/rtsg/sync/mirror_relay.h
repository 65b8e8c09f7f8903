// MirrorRelay: follows an origin as a replica and serves that replica to peers of its own (PROTOCOL.md, "Relays").
//
// Invariant: a peer of the relay is always in a state that the origin had, with its number and hash. The relay checks
// requests of peers against their permissions and passes them on. The origin carries them out; its verdict reaches the
// peer when the effect is there. Peers learn within a second of the last heartbeat that the origin is lost. Threading:
// the replica's thread.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

namespace rtsg {

class MirrorRelay {
  public:
    /// `replica` has the same requirements as for MirrorClient. Serves at `endpoint` once the origin's first state has
    /// come.
    static Result<std::unique_ptr<MirrorRelay>> connect(Scene& replica, const std::string& origin,
                                                        const std::string& endpoint, MirrorClientOptions from = {},
                                                        MirrorServerOptions to = {});
    ~MirrorRelay();

    /// Passes on messages of both sides, and waits for them up to `timeout`, or until the origin is lost or found.
    /// Returns the number of sets applied. Error: `endpoint` cannot be served.
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
