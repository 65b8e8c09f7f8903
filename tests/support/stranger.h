// Strangers to a mirror's server: a ZeroMQ peer that says what it likes, and a bare TCP connection.
#pragma once

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <zmq.h>

namespace rtsg::test {

/// A plain DEALER. Nothing that it says waits for longer than a second, nor outlives it.
class Stranger {
  public:
    explicit Stranger(const std::string& endpoint)
        : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_DEALER)) {
        const int linger = 0, timeout = 1000;
        zmq_setsockopt(socket_, ZMQ_LINGER, &linger, sizeof(linger));
        zmq_setsockopt(socket_, ZMQ_SNDTIMEO, &timeout, sizeof(timeout));
        zmq_connect(socket_, endpoint.c_str());
    }
    ~Stranger() {
        zmq_close(socket_);
        zmq_ctx_term(context_);
    }
    Stranger(const Stranger&) = delete;
    Stranger& operator=(const Stranger&) = delete;
    /// Nothing any more once a message could not be sent in a second: the server has shut the connection.
    void say(std::string_view text, bool more = false) {
        if (!isHeard_) return;
        isHeard_ = zmq_send(socket_, text.data(), text.size(), more ? ZMQ_SNDMORE : 0) >= 0;
    }

  private:
    void *context_, *socket_;
    bool isHeard_ = true;
};

/// A TCP connection to a port of this machine, or one to a socket's file.
class RawConnection {
  public:
    explicit RawConnection(const std::string& file) : descriptor_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::strncpy(address.sun_path, file.c_str(), sizeof(address.sun_path) - 1);
        connected = ::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    }
    explicit RawConnection(int port) : descriptor_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        connected = ::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    }
    ~RawConnection() { ::close(descriptor_); }
    RawConnection(const RawConnection&) = delete;
    RawConnection& operator=(const RawConnection&) = delete;
    /// How much of it fits now; nothing when the connection is gone.
    std::optional<std::size_t> send(std::string_view bytes) const {
        const ssize_t sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent < 0 && errno != EAGAIN) return std::nullopt;
        return sent < 0 ? 0 : static_cast<std::size_t>(sent);
    }
    bool connected = false;

  private:
    int descriptor_;
};

inline int portOf(const std::string& endpoint) {
    return std::stoi(endpoint.substr(endpoint.rfind(':') + 1));
}

/// ZMTP 3.0 (RFC 23): greeting with the NULL mechanism, then READY as a DEALER.
inline std::string zmtpGreeting() {
    std::string text("\xFF\0\0\0\0\0\0\0\x01\x7F\x03\0NULL", 16);
    text.resize(64, '\0');
    return text;
}
inline std::string zmtpReady() {
    const std::string body = std::string("\x05READY\x0BSocket-Type\0\0\0\x06", 22) + "DEALER";
    return std::string("\x04", 1) + static_cast<char>(body.size()) + body;
}

}  // namespace rtsg::test
