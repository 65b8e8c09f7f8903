// SocketServer: listens for clients of one protocol over WebSockets, and passes messages on that it does not read.
//
// Invariant: one message of each client waits here, and the next is read when that was taken. Messages to a client wait
// up to the settings' bound, or up to one message. A client that does not connect properly gets an answer that says
// why, or none if there are too many. Threading: overriding functions may be called on any thread; all others belong to
// the thread that runs the io_context.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "gateway.h"
#include "sockets/web_module.h"

namespace rtsg::web {

class SocketPeer;

class SocketServer : public SocketModule {
  public:
    explicit SocketServer(SocketSettings settings) : settings_(std::move(settings)) {}
    ~SocketServer() override;
    /// Starts the thread. Returns the problem, or an empty text.
    std::string start();

    std::size_t connections() const override { return connections_; }
    std::vector<SocketEvent> takeNews() override;
    bool hasRoom(std::uint64_t client, std::size_t bytes) const override;
    bool send(std::uint64_t client, std::string head, std::shared_ptr<const std::string> body, bool bytes) override;

    // Used by peers.
    const SocketSettings& settings() const { return settings_; }
    net::io_context& io() { return io_; }
    /// Why the request may not open a WebSocket, with the status that says so. Nothing if it may.
    std::optional<std::pair<http::status, std::string>> refusal(const Request& request) const;
    /// The handshake is done; `queued` counts the bytes that wait.
    void came(std::uint64_t number, std::shared_ptr<std::atomic<std::size_t>> queued);
    void heard(std::uint64_t number, SocketEvent::Kind kind, std::string text);
    void refused(std::string why);
    void went(std::uint64_t number);

  private:
    void accept();
    void stop();
    void notify(SocketEvent news);
    bool isFarBehind() const;

    const SocketSettings settings_;
    std::atomic<std::size_t> connections_{0};  // after their handshakes
    mutable std::mutex mutex_;
    std::vector<SocketEvent> news_;
    /// The bytes that wait for each client that has come.
    std::map<std::uint64_t, std::shared_ptr<std::atomic<std::size_t>>> queued_;
    News refusals_;
    bool stopping_ = false;
    std::uint64_t last_ = 0;  // number given
    net::io_context io_{1};
    Tcp::acceptor acceptor_{io_};
    net::steady_timer deadline_{io_}, again_{io_};
    std::map<std::uint64_t, std::shared_ptr<SocketPeer>> peers_;  // goes before the io_context
    std::thread thread_;
};

}  // namespace rtsg::web
