// Messages of several parts on bare ZeroMQ sockets.
#pragma once

#include <string>
#include <vector>

#include <zmq.h>

namespace rtsg::test {

/// All parts of the next message; none within `timeout` ms: nothing.
inline std::vector<std::string> receiveParts(void* socket, int timeout) {
    zmq_pollitem_t item{socket, 0, ZMQ_POLLIN, 0};
    std::vector<std::string> parts;
    if (zmq_poll(&item, 1, timeout) <= 0) return parts;
    int more = 1;
    while (more) {
        zmq_msg_t part;
        zmq_msg_init(&part);
        if (zmq_msg_recv(&part, socket, 0) < 0) break;
        parts.emplace_back(static_cast<const char*>(zmq_msg_data(&part)), zmq_msg_size(&part));
        more = zmq_msg_more(&part);
        zmq_msg_close(&part);
    }
    return parts;
}

inline void sendParts(void* socket, const std::vector<std::string>& parts) {
    for (std::size_t i = 0; i < parts.size(); ++i)
        zmq_send(socket, parts[i].data(), parts[i].size(), i + 1 < parts.size() ? ZMQ_SNDMORE : 0);
}

}  // namespace rtsg::test
