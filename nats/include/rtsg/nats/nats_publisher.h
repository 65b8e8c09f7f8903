// NatsPublisher: publishes the stream of a mirror server to a NATS server, for any number of mirrors.
//
// A new record is published once for all mirrors. A mirror that joins asks, and gets the last keyframe and the records
// after it; all that ask within a moment share one publication. Questions, requests and commands of mirrors go to the
// server, and its answers go back to the sender (PROTOCOL.md, "NATS"). For records all of them are one peer, and their
// own names stand behind that peer's. Invariant: it keeps no scene and no records, and passes records on in the
// server's bytes. A lost connection to the NATS server is made again; mirrors then ask for what they missed. Threading:
// a thread of its own; all functions on any.

// Example:
//     #include <rtsg/nats/nats_publisher.h>
//     #include <rtsg/sync/mirror_server.h>
//     rtsg::Scene scene;
//     const auto server = rtsg::MirrorServer::start(scene, "tcp://127.0.0.1:*");
//     if (!server) return;
//     rtsg::NatsPublisherOptions options;
//     options.address = "nats://127.0.0.1:4222/hall";
//     const auto publisher = rtsg::NatsPublisher::start(**server, options);
//     if (!publisher) return;  // publisher.error() says why
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/mirror_keys.h>
#include <rtsg/sync/mirror_server.h>

namespace rtsg {

struct NatsPublisherOptions {
    std::string address;  // nats_address.h
    /// The keys of a client, with whose permission mirrors ask, if the server has keys.
    std::optional<MirrorKeys> keys;
};

struct NatsPublisherStatistics {
    std::uint64_t records = 0, messages = 0, bytes = 0;  // published; bytes are those of records, without repairs
    std::uint64_t states = 0;                            // how often a keyframe and the records after it were published
    std::uint64_t resumed = 0;                           // mirrors that got only what they had missed
    std::uint64_t asked = 0;                             // messages from mirrors
    std::uint64_t garbage = 0;                           // invalid ones among them
    std::uint64_t failed = 0;                            // messages that could not be published
};

class NatsPublisher {
  public:
    /// Publishes what a server of this process serves. Errors: an invalid address; no connection; keys that are not a
    /// client's.
    static Result<std::unique_ptr<NatsPublisher>> start(MirrorServer& server, NatsPublisherOptions options);
    /// If the server ends before this, mirrors get its goodbye.
    ~NatsPublisher();

    /// The address without secrets.
    const std::string& address() const;
    NatsPublisherStatistics statistics() const;
    std::vector<Diagnostic> takeDiagnostics();

  private:
    class Impl;
    class NatsListener;
    explicit NatsPublisher(std::shared_ptr<Impl> impl);
    std::shared_ptr<Impl> impl_;
};

}  // namespace rtsg
