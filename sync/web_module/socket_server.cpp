// Listens for clients of a protocol over WebSockets, decides who may connect, and hands messages over.
#include "socket_server.h"

#include <algorithm>

#include <sys/eventfd.h>
#include <sys/socket.h>
#include <boost/beast/websocket/rfc6455.hpp>

#include "sockets/http_host.h"
#include "visit.h"
#include "web_socket_connection.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kMaxKnocking = 64;  // connections before their handshakes
constexpr std::size_t kMaxNewsWaiting = 1024;

}  // namespace

SocketServer::SocketServer(SocketSettings settings)
    : HttpServer({settings.loopback, kMaxKnocking, settings.requestTimeout, settings.silence, settings.protocol,
                  settings.longestIncoming, settings.maxQueued}),
      settings_(std::move(settings)) {}

std::string SocketServer::start() {
    beast::error_code error;
    sockaddr_storage at{};
    socklen_t length = sizeof(at);
    const bool known = ::getsockname(settings_.listener, reinterpret_cast<sockaddr*>(&at), &length) == 0;
    (void)acceptor().assign(known && at.ss_family == AF_INET6 ? Tcp::v6() : Tcp::v4(), settings_.listener, error);
    if (error) return error.message();
    open();
    return {};
}

void SocketServer::answer(const std::shared_ptr<Visit>& visit, Request request) {
    if (auto refusal = this->refusal(request)) {
        refuse("refused a request: " + refusal->second);
        return visit->refuse(refusal->first, std::move(refusal->second));
    }
    begin(visit->release(), std::move(request), visit->source());
}

std::optional<std::pair<http::status, std::string>> SocketServer::refusal(const Request& request) const {
    using Refusal = std::pair<http::status, std::string>;
    if (!hostOf(request)) return Refusal(http::status::bad_request, "The request names no host, or not one.");
    if (!knowsHost(request)) return Refusal(http::status::forbidden, "This server is known by another name.");
    if (!beast::websocket::is_upgrade(request))
        return Refusal(http::status::upgrade_required, "Here are WebSockets of " + settings_.protocol + ".");
    const std::string origin = textOf(request[http::field::origin]);
    if (!settings_.anyOrigin && !origin.empty() && !detail::isOriginOfThisMachine(origin) &&
        std::ranges::count(settings_.origins, origin) == 0)
        return Refusal(http::status::forbidden, "Pages of this site may not connect: " + origin.substr(0, 200));
    const std::string offered = textOf(request[http::field::sec_websocket_protocol]);
    if (!http::token_list(offered).exists(settings_.protocol))
        return Refusal(http::status::bad_request, "The protocol here is " + settings_.protocol + ".");
    if (count() >= settings_.maximumConnections || isFarBehind())
        return Refusal(http::status::service_unavailable, "As many clients are connected as may.");
    return std::nullopt;
}

/// Clients come and go while nobody takes the news of that.
bool SocketServer::isFarBehind() const {
    const std::scoped_lock lock(mutex_);
    return news_.size() >= kMaxNewsWaiting;
}

void SocketServer::begun(WebSocketConnection& connection) {
    notify({SocketEvent::Kind::came, connection.number(), {}});
}

bool SocketServer::heard(WebSocketConnection& from, std::string message, bool isText) {
    notify({isText ? SocketEvent::Kind::text : SocketEvent::Kind::bytes, from.number(), std::move(message)});
    return true;
}

void SocketServer::refuse(std::string why) {
    refusals_.add(std::move(why));
    if (settings_.call >= 0) ::eventfd_write(settings_.call, 1);
}

void SocketServer::ended(WebSocketConnection& connection) {
    if (connection.isAccepted()) notify({SocketEvent::Kind::left, connection.number(), {}});
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
        if (one.kind == SocketEvent::Kind::text || one.kind == SocketEvent::Kind::bytes) resumeSoon(one.client);
    for (std::string& why : refusals_.take()) news.push_back({SocketEvent::Kind::refused, 0, std::move(why)});
    return news;
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
