// ServerStream: follows a mirror server for others, without a scene: it takes the records and passes them on.
//
// Invariant: a record is handed over once, whole, and after the one before it. Everything that comes is acknowledged at
// once, as it waits nowhere.
// Threading: one thread.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include <rtsg/sync/encoded_record.h>
#include <rtsg/sync/mirror_keys.h>

#include "packet.h"
#include "transport/transport.h"

namespace rtsg::nats {

class ServerStream {
  public:
    struct Settings {
        std::shared_ptr<Transport> transport;
        std::string endpoint, name;
        std::optional<MirrorKeys> keys;
        std::uint64_t typesHash = 0;
        std::uint64_t client = 0;  // 0: a passing one, beside which another stream may stand
    };
    /// Each may be empty.
    struct Heard {
        std::function<void(bool sameEpoch)> welcome;
        std::function<void(SharedRecord)> record;
        std::function<void(const Packet&)> other;  // pings, answers, goodbyes
        std::function<void(std::string)> refused;
    };

    ServerStream(const Settings& settings, Heard heard);
    ~ServerStream();

    Result<> connect();
    std::array<int, 2> descriptors() const { return connection_->descriptors(); }
    /// Takes one message; false if there is none.
    bool receive();
    /// Says hello where that is due, and acknowledges.
    void poll(Clock::time_point now);
    /// Sends a message whose session is replaced by this one's. False if there is no connection for it.
    bool send(std::span<const std::byte> first, std::span<const std::byte> second = {});

    bool welcomed() const { return welcomed_; }
    std::uint64_t epoch() const { return epoch_; }
    std::uint64_t session() const { return session_; }
    std::uint64_t heartbeat() const { return heartbeat_; }
    const ByteBuffer& head() const { return head_; }

  private:
    void hello();
    void welcome(const Packet& packet);
    void data(const Packet& packet);

    const Settings settings_;
    const Heard heard_;
    Clock& clock_;
    std::unique_ptr<Connection> connection_;
    std::uint64_t session_ = 0, epoch_ = 0, heartbeat_ = 0;
    std::uint64_t state_ = 0;  // the last one handed over, with its hash
    Hash128 hash_;
    std::uint64_t received_ = 0, acknowledged_ = 0;
    bool welcomed_ = false, helloDue_ = true;
    Clock::time_point greeted_{}, heardAt_{};
    RecordParts parts_;
    ByteBuffer head_, message_;
};

}  // namespace rtsg::nats
