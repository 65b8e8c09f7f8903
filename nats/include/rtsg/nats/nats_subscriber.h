// NatsSubscriber: lets a MirrorClient of this process follow a scene that a NatsPublisher publishes.
//
// For the client it is a transport, whose connection leads to the mirror server behind the publisher: hashes, repairs,
// requests and verdicts are that server's. It takes records from the NATS server, asks for missing ones, and passes on
// the client's questions. Only whole scenes are published, so parts, regions, inputs and rate limits are refused.
// Invariant: the client gets each record once and in order. If more waits for it than its window, that is dropped, and
// it gets the missing frames if the publisher still has them, else a keyframe. Threading: the connection belongs to the
// client's thread; all functions on any.

// Example:
//     #include <rtsg/nats/nats_subscriber.h>
//     #include <rtsg/sync/mirror_client.h>
//     rtsg::Scene replica;
//     const auto nats = rtsg::NatsSubscriber::start("nats://127.0.0.1:4222/hall");
//     if (!nats) return;  // nats.error() says why
//     rtsg::MirrorClientOptions options;
//     options.transport = (*nats)->transport();
//     const auto client = rtsg::MirrorClient::connect(replica, (*nats)->address(), options);
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/mirror_client.h>

namespace rtsg {

struct NatsSubscriberStatistics {
    std::uint64_t messages = 0;  // messages from NATS that were read
    std::uint64_t dropped = 0;   // messages without room, because this process is too slow
    std::uint64_t joins = 0;     // how often the server was asked for a state, or for missing records
    std::uint64_t garbage = 0;   // invalid messages
};

class NatsSubscriber {
  public:
    /// Tries for `patience` to connect. Errors: an invalid address; no connection.
    static Result<std::unique_ptr<NatsSubscriber>> start(
        const std::string& address, std::chrono::milliseconds patience = std::chrono::milliseconds(0));
    ~NatsSubscriber();

    /// For MirrorClientOptions::transport. Its endpoint is the address.
    std::shared_ptr<Transport> transport() const;
    /// The address without secrets.
    const std::string& address() const;
    NatsSubscriberStatistics statistics() const;
    std::vector<Diagnostic> takeDiagnostics();

  private:
    class Impl;
    explicit NatsSubscriber(std::shared_ptr<Impl> impl);
    std::shared_ptr<Impl> impl_;
};

}  // namespace rtsg
