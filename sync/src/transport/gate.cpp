// Admits clients whose key is on the list, and counts connections that failed.
#include "gate.h"

#include <algorithm>
#include <cstring>
#include <vector>

namespace rtsg {

namespace {

constexpr const char* kMonitorEndpoint = "inproc://connections";

}  // namespace

Result<> MirrorGate::guard(ZmqSocket& router, const MirrorKeys* keys) {
    keys_ = keys;
    zap_.set(ZMQ_LINGER, 0);
    if (keys) {
        if (zmq_bind(zap_.get(), "inproc://zeromq.zap.01") != 0)
            return std::unexpected(zmqFailure("cannot check who connects"));
        router.set(ZMQ_ZAP_DOMAIN, std::string("rtsg"));  // an empty domain would admit everybody
        router.set(ZMQ_CURVE_SERVER, 1);
        router.set(ZMQ_CURVE_SECRETKEY, keys->serverSecret);
    }
    monitor_.set(ZMQ_LINGER, 0);
    constexpr int events = ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL |
                           ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_DISCONNECTED;
    if (zmq_socket_monitor(router.get(), kMonitorEndpoint, events) != 0 ||
        zmq_connect(monitor_.get(), kMonitorEndpoint) != 0)
        return std::unexpected(zmqFailure("cannot watch connections"));
    return {};
}

void MirrorGate::stopWatching(ZmqSocket& router) {
    zmq_socket_monitor(router.get(), nullptr, 0);
}

void MirrorGate::authenticate() {
    while (true) {
        std::vector<std::string> parts;
        bool more = true;
        while (more) {
            ZmqMessage part;
            if (!zap_.receive(part)) return;
            parts.push_back(part.text());
            more = part.more();
        }
        char key[41] = {};
        bool allowed = false;
        if (keys_ && parts.size() == 7 && parts[5] == "CURVE" && parts[6].size() == 32) {
            zmq_z85_encode(key, reinterpret_cast<const std::uint8_t*>(parts[6].data()), 32);
            allowed = std::ranges::find(keys_->clientPublic, key) != keys_->clientPublic.end();
        }
        const std::string reply[] = {"1.0",
                                     parts.size() > 1 ? parts[1] : "",
                                     allowed ? "200" : "400",
                                     allowed ? "OK" : "not on the list",
                                     allowed ? key : "",
                                     ""};
        for (std::size_t i = 0; i < std::size(reply); ++i) {
            ZmqMessage part(std::as_bytes(std::span(reply[i].data(), reply[i].size())));
            zap_.send(part, i + 1 < std::size(reply));
        }
    }
}

MirrorGate::Failures MirrorGate::failures() {
    Failures result;
    while (true) {
        ZmqMessage event;
        if (!monitor_.receive(event)) return result;
        std::uint16_t what = 0;
        std::int32_t value = 0;  // for these two events: the connection's descriptor
        if (event.bytes().size() >= sizeof(what) + sizeof(value)) {
            std::memcpy(&what, event.bytes().data(), sizeof(what));
            std::memcpy(&value, event.bytes().data() + sizeof(what), sizeof(value));
        }
        monitor_.skipRest(event);
        if (what == ZMQ_EVENT_ACCEPTED)
            connections_.opened(value);
        else if (what == ZMQ_EVENT_DISCONNECTED)
            connections_.closed(value);
        else
            ++(what == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH ? result.refused : result.garbage);
    }
}

std::string userOf(const ZmqMessage& message) {
    const char* user = zmq_msg_gets(message.get(), "User-Id");
    return user ? user : "";
}

}  // namespace rtsg
