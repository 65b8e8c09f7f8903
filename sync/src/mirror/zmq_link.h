// ZmqLink: a client's connection by a ZeroMQ socket and its monitor.
#pragma once

#include <deque>

#include "link.h"
#include "zmq_socket.h"

namespace rtsg {

class ZmqLink final : public MirrorLink {
  public:
    ZmqLink(std::string endpoint, std::optional<MirrorKeys> keys);
    ~ZmqLink() override;
    Result<> start() override;
    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override;
    std::optional<Message> receive() override;
    bool wait(std::chrono::milliseconds most) override;
    std::optional<Event> nextEvent() override;
    void reconnect(std::chrono::milliseconds within) override;
    int descriptor() const override { return descriptor_; }

  private:
    void readEvents();

    std::string endpoint_;
    std::optional<MirrorKeys> keys_;
    ZmqContext context_;
    ZmqSocket socket_, monitor_;
    std::optional<ZmqMessage> first_, second_;  // handed over last
    std::deque<Event> events_;
    int descriptor_ = -1;
};

}  // namespace rtsg
