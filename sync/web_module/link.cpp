// Packs and unpacks messages between a WebSocket and ZeroMQ.
#include "link.h"

#include <cstdint>
#include <cstring>

namespace rtsg::web {

namespace {

constexpr std::size_t kLength = 4;

void set(void* socket, int option, int value) {
    zmq_setsockopt(socket, option, &value, sizeof(value));
}

void set(void* socket, int option, const std::string& value) {
    zmq_setsockopt(socket, option, value.data(), value.size());
}

}  // namespace

Link::Link(void* context, const WebSettings& settings) : socket_(zmq_socket(context, ZMQ_DEALER)) {
    set(socket_, ZMQ_LINGER, 100);
    set(socket_, ZMQ_RECONNECT_IVL, 10);
    set(socket_, ZMQ_RCVHWM, 16);  // the rest waits at the server, which counts it
    if (!settings.serverKey.empty()) {
        set(socket_, ZMQ_CURVE_SERVERKEY, settings.serverKey);
        set(socket_, ZMQ_CURVE_PUBLICKEY, settings.publicKey);
        set(socket_, ZMQ_CURVE_SECRETKEY, settings.secretKey);
    }
    const int six = settings.endpoint.starts_with("tcp://[") ? 1 : 0;
    zmq_setsockopt(socket_, ZMQ_IPV6, &six, sizeof(six));
    zmq_connect(socket_, settings.endpoint.c_str());
}

Link::~Link() {
    zmq_close(socket_);
}

int Link::descriptor() const {
    int descriptor = -1;
    std::size_t size = sizeof(descriptor);
    zmq_getsockopt(socket_, ZMQ_FD, &descriptor, &size);
    return descriptor;
}

bool Link::receive(std::string& message) {
    message.clear();
    int more = 1;
    for (int part = 0; more; ++part) {
        zmq_msg_t content;
        zmq_msg_init(&content);
        if (zmq_msg_recv(&content, socket_, ZMQ_DONTWAIT) < 0) {
            zmq_msg_close(&content);
            return false;
        }
        const auto size = static_cast<std::uint32_t>(zmq_msg_size(&content));
        if (part == 0) {
            message.resize(kLength);
            std::memcpy(message.data(), &size, kLength);
        }
        message.append(static_cast<const char*>(zmq_msg_data(&content)), size);
        more = zmq_msg_more(&content);
        zmq_msg_close(&content);
    }
    return true;
}

bool Link::send(std::string_view message) {
    std::uint32_t first = 0;
    if (message.size() < kLength) return false;
    std::memcpy(&first, message.data(), kLength);
    message.remove_prefix(kLength);
    if (first == 0 || first > message.size()) return false;
    const bool two = first < message.size();
    if (zmq_send(socket_, message.data(), first, ZMQ_DONTWAIT | (two ? ZMQ_SNDMORE : 0)) < 0) return false;
    return !two || zmq_send(socket_, message.data() + first, message.size() - first, ZMQ_DONTWAIT) >= 0;
}

void Link::bye() {
    const std::string_view bye("RTSG\x01\x05\0\0", 8);
    zmq_send(socket_, bye.data(), bye.size(), ZMQ_DONTWAIT);
}

}  // namespace rtsg::web
