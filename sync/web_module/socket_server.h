// SocketServer: listens for clients of one protocol over WebSockets, and passes messages on that it does not read.
//
// Invariant: a client that does not connect properly gets an answer that says why. Threading: what the module offers
// may be called on any thread; all else belongs to the server's.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "http_server.h"
#include "sockets/web_module.h"

namespace rtsg::web {

class SocketServer : public SocketModule, private HttpServer {
  public:
    explicit SocketServer(SocketSettings settings);
    ~SocketServer() override { close(); }
    /// Starts the thread. Returns the problem, or an empty text.
    std::string start();

    std::size_t connections() const override { return count(); }
    std::vector<SocketEvent> takeNews() override;
    bool hasRoom(std::uint64_t client, std::size_t bytes) const override { return HttpServer::hasRoom(client, bytes); }
    bool send(std::uint64_t client, std::string head, std::shared_ptr<const std::string> body, bool bytes) override {
        const auto second = std::as_bytes(std::span(*body));
        return say(client, {std::move(head), second, std::move(body), bytes});
    }

  private:
    void answer(const std::shared_ptr<Visit>& visit, Request request) override;
    void refuse(std::string why) override;
    void begun(WebSocketConnection& connection) override;
    bool heard(WebSocketConnection& from, std::string message, bool isText) override;
    void ended(WebSocketConnection& connection) override;
    /// Why the request may not open a WebSocket, with the status that says so. Nothing if it may.
    std::optional<std::pair<http::status, std::string>> refusal(const Request& request) const;
    void notify(SocketEvent news);
    bool isFarBehind() const;

    const SocketSettings settings_;
    mutable std::mutex mutex_;
    std::vector<SocketEvent> news_;
    News refusals_;
};

}  // namespace rtsg::web
