// MirrorOrigin: what a MirrorClient follows, opened by its address: a mirror server's endpoint, or a session that a
// NATS server passes on. Whoever takes an endpoint from a user opens it here.
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
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/nats/nats_subscriber.h>
#include <rtsg/sync/mirror_client.h>

namespace rtsg {

class MirrorOrigin {
  public:
    /// Tries for `patience` to connect to a NATS server; whether a mirror server is there only its client finds out.
    /// Errors: an address of a NATS server that is none; no connection.
    static Result<MirrorOrigin> open(const std::string& address,
                                     std::chrono::milliseconds patience = std::chrono::seconds(5));

    /// For MirrorClient::connect().
    const std::string& endpoint() const { return nats_ ? nats_->endpoint() : shown_; }
    /// For messages; without secrets.
    const std::string& shown() const { return shown_; }
    /// Leaves out what a NATS server does not carry. Error: keys, which are ZeroMQ's.
    Result<> prepare(MirrorClientOptions& options) const;
    /// What has happened to the connection with a NATS server.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    std::string shown_;
    std::unique_ptr<NatsSubscriber> nats_;
};

}  // namespace rtsg
