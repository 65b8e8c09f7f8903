// MirrorGate: decides who may connect. It is the ZAP handler of an encrypted mirror (ZeroMQ RFC 27), counts connections
// that never became peers, and watches for those that send an endless message.
//
// Invariant: with keys, a connection's user id is its public key, and only keys on the list get one.
// Threading: the thread of the socket that is watched.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/sync/mirror_keys.h>

#include "connection_watch.h"
#include "zmq_socket.h"

namespace rtsg {

class MirrorGate {
  public:
    explicit MirrorGate(const ZmqContext& context) : zap_(context, ZMQ_REP), monitor_(context, ZMQ_PAIR) {}
    /// Call it before `router` is bound. If `keys` is null everybody is admitted. The list may change later.
    Result<> guard(ZmqSocket& router, const MirrorKeys* keys);
    void stopWatching(ZmqSocket& router);

    /// Answers waiting requests for admission.
    void authenticate();
    /// Failed connections since the last call.
    struct Failures {
        std::uint64_t refused = 0, garbage = 0;
    };
    Failures failures();
    ConnectionWatch& connections() { return connections_; }
    const ConnectionWatch& connections() const { return connections_; }
    const ZmqSocket& zap() const { return zap_; }
    const ZmqSocket& monitor() const { return monitor_; }

  private:
    ZmqSocket zap_, monitor_;
    ConnectionWatch connections_;
    const MirrorKeys* keys_ = nullptr;
};

/// The public key with which a message's connection was admitted. Empty without keys.
std::string userOf(const ZmqMessage& message);

}  // namespace rtsg
