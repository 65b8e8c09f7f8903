// A man in the middle of a mirror and its server, who drops or bends messages.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <zmq.h>

#include "support/zmq_parts.h"

namespace rtsg::test {

/// Stands between one client and a server; every message passes `filter`, which may change or drop it.
class Middleman {
  public:
    using Parts = std::vector<std::string>;
    /// `toClient`: the direction. False drops the message.
    using Filter = std::function<bool(bool toClient, Parts& parts)>;

    Middleman(const std::string& server, Filter filter) : filter_(std::move(filter)) {
        context_ = zmq_ctx_new();
        front_ = zmq_socket(context_, ZMQ_ROUTER);
        back_ = zmq_socket(context_, ZMQ_DEALER);
        for (void* socket : {front_, back_}) {
            const int none = 0;
            zmq_setsockopt(socket, ZMQ_LINGER, &none, sizeof(none));
            // A router that has reached its limit drops without a word, which a link of RTSG never does.
            zmq_setsockopt(socket, ZMQ_SNDHWM, &none, sizeof(none));
            zmq_setsockopt(socket, ZMQ_RCVHWM, &none, sizeof(none));
        }
        zmq_bind(front_, "tcp://127.0.0.1:*");
        char bound[256];
        std::size_t length = sizeof(bound);
        zmq_getsockopt(front_, ZMQ_LAST_ENDPOINT, bound, &length);
        endpoint = bound;
        zmq_connect(back_, server.c_str());
        thread_ = std::thread([this] { run(); });
    }
    ~Middleman() {
        stop_ = true;
        thread_.join();
        zmq_close(front_);
        zmq_close(back_);
        zmq_ctx_term(context_);
    }
    std::string endpoint;

  private:
    void run() {
        std::string client;
        while (!stop_) {
            zmq_pollitem_t items[] = {{front_, 0, ZMQ_POLLIN, 0}, {back_, 0, ZMQ_POLLIN, 0}};
            zmq_poll(items, 2, 20);
            if (items[0].revents) {
                Parts parts = receiveParts(front_, 0);
                client = parts.front();
                parts.erase(parts.begin());
                if (filter_(false, parts)) sendParts(back_, parts);
            }
            if (items[1].revents) {
                Parts parts = receiveParts(back_, 0);
                if (!filter_(true, parts) || client.empty()) continue;
                parts.insert(parts.begin(), client);
                sendParts(front_, parts);
            }
        }
    }

    Filter filter_;
    void *context_, *front_, *back_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace rtsg::test
