// ZmqContext, ZmqSocket, ZmqMessage: the part of ZeroMQ that mirrors use, with owners and without exceptions.
//
// Sockets are waited for with poll() at their descriptors. zmq_poll() looks at each socket several times, with one or
// two system calls each time. For a frame to a thousand peers that would be most of the work.
#pragma once

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include <zmq.h>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/module.h>

namespace rtsg::delayed {
extern DelayedLibrary zmq;
}

namespace rtsg {

/// Gives ZeroMQ's threads the scheduling policy SCHED_BATCH in place of the ordinary one (sched(7)). While every core
/// is busy, a thread that gets work then waits its turn instead of interrupting. So a thread that sends to many peers
/// can go on, and a peer that got two writes wakes up once.
class ZmqContext {
  public:
    ZmqContext();
    ~ZmqContext() { zmq_ctx_term(context_); }  // the sockets' LINGER is bounded, so this cannot hang
    ZmqContext(const ZmqContext&) = delete;
    ZmqContext& operator=(const ZmqContext&) = delete;
    void* get() const { return context_; }

  private:
    void* context_;
};

class ZmqMessage {
  public:
    ZmqMessage() { zmq_msg_init(&message_); }
    explicit ZmqMessage(std::span<const std::byte> bytes);
    /// Sends `bytes` in place; `owner` keeps them alive until ZeroMQ is done with them.
    ZmqMessage(std::span<const std::byte> bytes, std::shared_ptr<const void> owner);
    /// Shares the bytes of `other`; both messages keep them alive.
    struct Shared {};
    ZmqMessage(Shared, const ZmqMessage& other) {
        zmq_msg_init(&message_);
        zmq_msg_copy(&message_, &other.message_);
    }
    ~ZmqMessage() { zmq_msg_close(&message_); }
    ZmqMessage(const ZmqMessage&) = delete;
    ZmqMessage& operator=(const ZmqMessage&) = delete;
    std::span<const std::byte> bytes() const {
        return {static_cast<const std::byte*>(zmq_msg_data(&message_)), zmq_msg_size(&message_)};
    }
    std::string text() const { return {static_cast<const char*>(zmq_msg_data(&message_)), zmq_msg_size(&message_)}; }
    bool more() const { return zmq_msg_more(&message_) != 0; }
    zmq_msg_t* get() const { return &message_; }

  private:
    mutable zmq_msg_t message_;
};

class ZmqSocket {
  public:
    ZmqSocket(const ZmqContext& context, int type) : socket_(zmq_socket(context.get(), type)) {}
    ~ZmqSocket() { close(); }
    ZmqSocket(const ZmqSocket&) = delete;
    ZmqSocket& operator=(const ZmqSocket&) = delete;
    void close() {
        if (socket_) zmq_close(socket_);
        socket_ = nullptr;
    }
    void set(int option, int value) { zmq_setsockopt(socket_, option, &value, sizeof(value)); }
    void set(int option, std::int64_t value) { zmq_setsockopt(socket_, option, &value, sizeof(value)); }
    void set(int option, const std::string& value) { zmq_setsockopt(socket_, option, value.data(), value.size()); }
    /// Returns false with errno: EAGAIN if it would block, EHOSTUNREACH if a ROUTER does not know the peer.
    bool send(ZmqMessage& message, bool more = false) {
        foundEmpty_ = false;
        return zmq_msg_send(message.get(), socket_, ZMQ_DONTWAIT | (more ? ZMQ_SNDMORE : 0)) >= 0;
    }
    bool receive(ZmqMessage& message) {
        const bool received = zmq_msg_recv(message.get(), socket_, ZMQ_DONTWAIT) >= 0;
        foundEmpty_ = !received && zmq_errno() == EAGAIN;
        return received;
    }
    /// Readable when something has come since receive() found nothing. Any other use of the socket may lose that
    /// notice, so wait for it only while foundEmpty().
    int descriptor() const;
    bool foundEmpty() const { return foundEmpty_; }
    /// Reads and drops the rest of a message of several parts.
    void skipRest(const ZmqMessage& last);
    /// For calls that are not wrapped here. They may lose the notice that something has come.
    void* get() const {
        foundEmpty_ = false;
        return socket_;
    }

  private:
    void* socket_;
    mutable bool foundEmpty_ = false;
};

/// `what: reason` from errno.
Diagnostic zmqFailure(std::string_view what);

/// Checks that so many files as a socket, its connection and its threads need may still be opened: ZeroMQ ends the
/// process where it gets none.
Result<> checkRoomForSocket();

/// Lets a socket connect by IPv6 if the endpoint needs it: an address in brackets, or a name that has no address of
/// IPv4. Elsewhere ZeroMQ would prefer it, and miss servers that listen on the other.
void allowIpv6(ZmqSocket& socket, std::string_view endpoint);

/// Refuses ports above 65535, which ZeroMQ takes modulo 65536.
Result<> checkPort(std::string_view endpoint);

}  // namespace rtsg
