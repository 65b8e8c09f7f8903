// Runs a client and a server on one replica; passes requests up and verdicts down.
#include <rtsg/sync/mirror_relay.h>

#include <algorithm>

#include "transport/transport.h"

namespace rtsg {

MirrorRelay::MirrorRelay(Scene& replica, std::string endpoint, MirrorServerOptions to)
    : replica_(replica), endpoint_(std::move(endpoint)), options_(std::move(to)) {}
MirrorRelay::~MirrorRelay() = default;

Result<std::unique_ptr<MirrorRelay>> MirrorRelay::connect(Scene& replica, const std::string& origin,
                                                          const std::string& endpoint, MirrorClientOptions from,
                                                          MirrorServerOptions to) {
    if (!to.transport) to.transport = zmqTransport();
    std::unique_ptr<MirrorRelay> relay(new MirrorRelay(replica, endpoint, std::move(to)));
    from.onMissed = [r = relay.get(), heard = std::move(from.onMissed)] {
        if (r->server_) r->server_->noteOriginMissed();
        if (heard) heard();
    };
    auto client = MirrorClient::connect(replica, origin, std::move(from));
    if (!client) return std::unexpected(client.error());
    relay->client_ = std::move(*client);
    return relay;
}

Result<std::size_t> MirrorRelay::poll(std::chrono::milliseconds timeout) {
    const Clock& clock = options_.transport->clock();
    const auto end = clock.now() + timeout;
    const bool lost = client_->originLost();
    std::size_t applied = 0;
    while (true) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - clock.now());
        applied += client_->poll(std::max(left, std::chrono::milliseconds(0)));
        if (!server_ && client_->statistics().frames > 0) {
            auto started = MirrorServer::start(replica_, endpoint_, options_);
            if (!started) return std::unexpected(started.error());
            server_ = std::move(*started);
            client_->wakeBy(server_->callDescriptor());
            server_->forwardRequests([this](MirrorRequest request) { return client_->submit(std::move(request)); });
            server_->forwardCommands([this](std::string_view command) { return client_->control(command); });
        }
        if (server_) {
            for (const MirrorVerdict& verdict : client_->takeVerdicts()) server_->answer(verdict);
            for (std::string& reply : client_->takeReplies()) server_->answerCommand(std::move(reply));
            server_->setOriginLost(client_->originLost());
            server_->service();
        }
        if (applied > 0 || client_->originLost() != lost || clock.now() >= end) return applied;
    }
}

}  // namespace rtsg
