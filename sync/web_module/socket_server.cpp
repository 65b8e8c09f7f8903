// Listens for clients of a protocol over WebSockets, decides who may connect, and hands messages over.
#include "socket_server.h"

#include <algorithm>
#include <chrono>

#include <sys/eventfd.h>
#include <sys/socket.h>
#include <boost/beast/websocket/rfc6455.hpp>

#include "socket_peer.h"
#include "sockets/http_host.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kMaxKnocking = 64;  // connections before their handshakes
constexpr std::size_t kMaxNewsWaiting = 1024;
constexpr auto kSocketFarewell = std::chrono::milliseconds(500);
constexpr auto kListenAgain = std::chrono::milliseconds(50);  // after the system had no descriptor left

}  // namespace

std::string SocketServer::start() {
    beast::error_code error;
    sockaddr_storage at{};
    socklen_t length = sizeof(at);
    const bool known = ::getsockname(settings_.listener, reinterpret_cast<sockaddr*>(&at), &length) == 0;
    (void)acceptor_.assign(known && at.ss_family == AF_INET6 ? Tcp::v6() : Tcp::v4(), settings_.listener, error);
    if (error) return error.message();
    accept();
    thread_ = std::thread([this] { io_.run(); });
    return {};
}

SocketServer::~SocketServer() {
    if (!thread_.joinable()) return;
    net::post(io_, [this] { stop(); });
    thread_.join();
}

void SocketServer::accept() {
    acceptor_.async_accept([this](beast::error_code error, Tcp::socket socket) {
        if (stopping_ || error == net::error::operation_aborted) return;
        if (error) {
            again_.expires_after(kListenAgain);
            again_.async_wait([this](beast::error_code stopped) {
                if (!stopped) accept();
            });
            return;
        }
        if (peers_.size() - connections_ < kMaxKnocking) {
            const std::uint64_t number = ++last_;
            const auto peer = std::make_shared<SocketPeer>(*this, std::move(socket), number);
            peers_.emplace(number, peer);
            peer->begin();
        } else {
            refused("too many connections say nothing");
        }
        accept();
    });
}

void SocketServer::stop() {
    stopping_ = true;
    beast::error_code ignored;
    (void)acceptor_.close(ignored);
    deadline_.expires_after(kSocketFarewell);
    deadline_.async_wait([this](beast::error_code) { io_.stop(); });
    const auto now = peers_;
    for (const auto& [number, peer] : now) peer->end();
    if (peers_.empty()) io_.stop();
}

std::optional<std::pair<http::status, std::string>> SocketServer::refusal(const Request& request) const {
    using Refusal = std::pair<http::status, std::string>;
    if (!hostOf(request)) return Refusal(http::status::bad_request, "The request names no host, or not one.");
    if (settings_.loopback && !namesThisMachine(request))
        return Refusal(http::status::forbidden, "This server is known by another name.");
    if (!beast::websocket::is_upgrade(request))
        return Refusal(http::status::upgrade_required, "Here are WebSockets of " + settings_.protocol + ".");
    const std::string origin = textOf(request[http::field::origin]);
    if (!settings_.anyOrigin && !origin.empty() && !detail::isOriginOfThisMachine(origin) &&
        std::ranges::count(settings_.origins, origin) == 0)
        return Refusal(http::status::forbidden, "Pages of this site may not connect: " + origin.substr(0, 200));
    const std::string offered = textOf(request[http::field::sec_websocket_protocol]);
    if (!http::token_list(offered).exists(settings_.protocol))
        return Refusal(http::status::bad_request, "The protocol here is " + settings_.protocol + ".");
    if (connections_ >= settings_.maximumConnections || isFarBehind())
        return Refusal(http::status::service_unavailable, "As many clients are connected as may.");
    return std::nullopt;
}

/// Clients come and go while nobody takes the news of that.
bool SocketServer::isFarBehind() const {
    const std::scoped_lock lock(mutex_);
    return news_.size() >= kMaxNewsWaiting;
}

void SocketServer::came(std::uint64_t number, std::shared_ptr<std::atomic<std::size_t>> queued) {
    {
        const std::scoped_lock lock(mutex_);
        queued_.emplace(number, std::move(queued));
    }
    ++connections_;
    notify({SocketEvent::Kind::came, number, {}});
}

void SocketServer::heard(std::uint64_t number, SocketEvent::Kind kind, std::string text) {
    notify({kind, number, std::move(text)});
}

void SocketServer::refused(std::string why) {
    refusals_.add(std::move(why));
    if (settings_.call >= 0) ::eventfd_write(settings_.call, 1);
}

void SocketServer::went(std::uint64_t number) {
    peers_.erase(number);
    bool had = false;
    {
        const std::scoped_lock lock(mutex_);
        had = queued_.erase(number) > 0;
    }
    if (had) {
        --connections_;
        notify({SocketEvent::Kind::left, number, {}});
    }
    if (stopping_ && peers_.empty()) io_.stop();
}

void SocketServer::notify(SocketEvent news) {
    {
        const std::scoped_lock lock(mutex_);
        news_.push_back(std::move(news));
    }
    if (settings_.call >= 0) ::eventfd_write(settings_.call, 1);
}

std::vector<SocketEvent> SocketServer::takeNews() {
    std::vector<SocketEvent> news;
    {
        const std::scoped_lock lock(mutex_);
        news.swap(news_);
    }
    for (const SocketEvent& one : news)
        if (one.kind == SocketEvent::Kind::text || one.kind == SocketEvent::Kind::bytes)
            net::post(io_, [this, number = one.client] {
                if (const auto found = peers_.find(number); found != peers_.end()) found->second->resume();
            });
    for (std::string& why : refusals_.take()) news.push_back({SocketEvent::Kind::refused, 0, std::move(why)});
    return news;
}

bool SocketServer::hasRoom(std::uint64_t client, std::size_t bytes) const {
    const std::scoped_lock lock(mutex_);
    const auto found = queued_.find(client);
    if (found == queued_.end()) return false;
    const std::size_t waiting = *found->second;
    return waiting == 0 || waiting + bytes <= settings_.maxQueued;
}

bool SocketServer::send(std::uint64_t client, std::string head, std::shared_ptr<const std::string> body, bool bytes) {
    const std::size_t size = head.size() + body->size();
    if (!hasRoom(client, size)) return false;
    {
        const std::scoped_lock lock(mutex_);
        if (const auto found = queued_.find(client); found != queued_.end()) *found->second += size;
    }
    net::post(io_, [this, client, head = std::move(head), body = std::move(body), bytes]() mutable {
        if (const auto found = peers_.find(client); found != peers_.end())
            found->second->push(std::move(head), std::move(body), bytes);
    });
    return true;
}

}  // namespace rtsg::web

namespace {

std::unique_ptr<rtsg::SocketModule> startSockets(const rtsg::SocketSettings& settings, std::string& problem) {
    auto server = std::make_unique<rtsg::web::SocketServer>(settings);
    problem = server->start();
    if (!problem.empty()) return nullptr;
    return server;
}

}  // namespace

/// The program looks this symbol up and calls it to get the function above.
extern "C" __attribute__((visibility("default"))) rtsg::StartSockets rtsg_start_sockets_1() {
    return startSockets;
}
