// NatsLink: the interface of librtsg_nats_module.so, one connection to a NATS server. Only the module uses libnats.
//
// Invariant: messages of all subscriptions come in the order in which the server sent them. Messages beyond the limit
// of memory are dropped and counted. A lost connection is made again, with its subscriptions. The module does not link
// this library. Errors are sentences without passwords. Threading: every function may be called on any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace rtsg {

struct NatsSettings {
    std::vector<std::string> servers;                // urls with what authenticates us
    std::string client;                              // a name, for the server's own reports
    std::string user, password;                      // in no url; without a password the user is a token
    std::string credentials;                         // a file of NATS's accounts (.creds)
    std::string authorities, certificate, key;       // files in PEM for tls://; empty: the system's, and none
    std::size_t maxWaiting = std::size_t{64} << 20;  // bytes of messages that nobody has taken
};

struct NatsMessage {
    std::string subject, reply, bytes;
};

/// The content of a stream of JetStream.
struct NatsStream {
    bool exists = false;
    std::uint64_t first = 0, last = 0;  // sequences
    std::uint64_t messages = 0, bytes = 0;
};

class NatsLink {
  public:
    virtual ~NatsLink() = default;
    /// The most bytes of a message, as the server says.
    virtual std::size_t maxPayload() const = 0;
    virtual bool connected() const = 0;
    /// Messages that found no room, here or in libnats.
    virtual std::uint64_t dropped() const = 0;
    virtual std::vector<std::string> takeNews() = 0;
    /// Readable when a message may wait. take() makes it unreadable once it has found none.
    virtual int descriptor() const = 0;
    virtual bool take(NatsMessage& into) = 0;
    /// Bytes of the messages that wait.
    virtual std::size_t waiting() const = 0;

    /// These return why it failed; empty if it did not. Without a connection messages wait for the next one, up to a
    /// few megabytes.
    virtual std::string publish(const std::string& subject, const std::string& reply,
                                std::span<const std::byte> bytes) = 0;
    virtual std::string subscribe(const std::string& subject) = 0;
    virtual void unsubscribe(const std::string& subject) = 0;
    /// Waits until the server has read all published messages.
    virtual std::string flush(std::chrono::milliseconds maximum) = 0;

    // ---- JetStream ------------------------------------------------------------------------------------------
    virtual std::string streamState(const std::string& stream, NatsStream& into) = 0;
    /// A stream in files of so many servers that refuses what no longer fits. `subject` is the only one that it takes.
    virtual std::string makeStream(const std::string& stream, const std::string& subject, int copies) = 0;
    virtual std::string removeStream(const std::string& stream) = 0;
    enum class Stored : std::uint8_t { yes, unknown, no };
    /// Stores a message behind the one with sequence `after`, and nowhere else. `unknown`: no answer came. Waits at
    /// most two seconds.
    virtual Stored store(const std::string& stream, const std::string& subject, std::span<const std::byte> bytes,
                         std::uint64_t after, std::string& problem) = 0;
    /// Calls `sink` with the sequences and bytes of the messages from `first` to `last` that are there, in order, until
    /// it returns false.
    using Sink = std::function<bool(std::uint64_t, std::string_view)>;
    virtual std::string read(const std::string& stream, const std::string& subject, std::uint64_t first,
                             std::uint64_t last, const Sink& sink) = 0;
};

/// Returns null and the reason if there is no connection.
using OpenNats = std::unique_ptr<NatsLink> (*)(const NatsSettings&, std::string& problem);
/// The one symbol of the module: a function without arguments that returns an OpenNats.
#define RTSG_NATS_SYMBOL "rtsg_start_nats_3"

}  // namespace rtsg
