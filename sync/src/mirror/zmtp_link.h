// ZmtpLink: a client's connection that speaks ZMTP 3.0 (rfc.zeromq.org/spec/23) as a DEALER without keys, by TCP to a
// numeric IPv4 address or by a local socket.
//
// Invariant: input_ holds from start_ on a message that is being read, or has been handed over; next_ is where the next
// frame begins. A server is not trusted: a message takes at most kLongestMessage, and what is no ZMTP ends the
// connection. Threading: the replica's thread; beside it the LinkKeeper's calls keep(), which touches what mutex_
// guards.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>

#include <sys/socket.h>

#include <rtsg/sync/byte_buffer.h>

#include "link.h"

namespace rtsg {

class ZmtpLink final : public MirrorLink {
  public:
    using Clock = std::chrono::steady_clock;
    struct Address {
        sockaddr_storage storage{};
        socklen_t size = 0;
    };
    /// Nothing for endpoints that are left to ZeroMQ.
    static std::optional<Address> addressOf(const std::string& endpoint);

    explicit ZmtpLink(const Address& address);
    ~ZmtpLink() override;
    Result<> start() override;
    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override;
    std::optional<Message> receive() override;
    bool wait(std::chrono::milliseconds most) override;
    std::optional<Event> nextEvent() override;
    void reconnect(std::chrono::milliseconds within) override;
    int descriptor() const override { return socket_; }
    /// Reads what has come, if the client has not looked for a while. Another thread's.
    void keep(Clock::time_point now);

  private:
    enum class State { apart, connecting, greeting, shaking, up };

    void connect(Clock::time_point now);
    void fail();
    void hangUp();
    void look(short revents);
    void greet();
    bool readGreeting();
    void shakeHands(std::span<const std::byte> command);
    void obey(std::span<const std::byte> command);
    void read();
    void makeRoom();
    bool readMessage();
    bool readFrame();
    void dropHandedOver();
    void put(unsigned flags, std::span<const std::byte> bytes);
    void putCommand(std::string_view name, std::span<const std::byte> bytes);
    void flush();

    const Address address_;
    std::mutex mutex_;                   // for reading from the socket, and for closing it
    ByteBuffer waiting_;                 // read by keep()
    std::atomic<bool> kept_{false};      // there is some of it
    std::atomic<std::int64_t> away_{0};  // since then the client has not looked; ns of the clock, 0 while it does
    int socket_ = -1;
    State state_ = State::apart;
    Clock::time_point due_{};  // of the next attempt, or when this one is given up
    std::chrono::milliseconds within_ = kConnectWithin;
    std::deque<Event> events_;

    ByteBuffer input_;
    std::size_t start_ = 0, next_ = 0;
    struct Part {
        std::size_t at = 0, size = 0;
    };
    std::array<Part, 2> firstParts_;
    std::size_t parts_ = 0;
    std::size_t missing_ = 0;  // bytes of the frame that is being read
    bool complete_ = false, handedOver_ = false;
    bool readable_ = false;  // the system may have more

    ByteBuffer output_;
    std::size_t sent_ = 0;  // bytes of it
};

}  // namespace rtsg
