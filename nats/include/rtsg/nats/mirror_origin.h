// MirrorOrigin: opens the origin of a MirrorClient by its address: the endpoint of a mirror server, or a session that a
// NATS server passes on. Code that receives an endpoint from a user opens it here.
//
// Threading: one thread.

// Example:
//     #include <rtsg/nats/mirror_origin.h>
//     rtsg::Scene replica;
//     rtsg::MirrorClientOptions options;
//     auto origin = rtsg::MirrorOrigin::open("tcp://127.0.0.1:4711");
//     if (!origin) return;  // origin.error() says why
//     if (!origin->prepare(options)) return;
//     const auto client = rtsg::MirrorClient::connect(replica, origin->endpoint(), options);
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/nats/nats_subscriber.h>
#include <rtsg/sync/mirror_client.h>

namespace rtsg {

class MirrorOrigin {
  public:
    /// Tries for `patience` to connect to a NATS server. A mirror server is not contacted; only its client finds out
    /// whether it is there. Errors: an invalid address of a NATS server; no connection.
    static Result<MirrorOrigin> open(const std::string& address,
                                     std::chrono::milliseconds patience = std::chrono::seconds(5));

    /// For MirrorClient::connect().
    const std::string& endpoint() const { return shown_; }
    /// For messages; without secrets.
    const std::string& shown() const { return shown_; }
    /// Removes options that a NATS server does not support, and says how to reach the endpoint. Error: keys, which are
    /// for ZeroMQ only.
    Result<> prepare(MirrorClientOptions& options) const;
    /// Invalid messages that came by a NATS server.
    std::uint64_t garbage() const { return nats_ ? nats_->statistics().garbage : 0; }
    /// The events of the connection with a NATS server since the last call.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    std::string shown_;
    std::unique_ptr<NatsSubscriber> nats_;
};

}  // namespace rtsg
