// Listens, makes room for those who come, and hands messages to connections.
#include "http_server.h"

#include <algorithm>

#include "sockets/http_host.h"
#include "visit.h"
#include "web_socket_connection.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kMaxOfSource = 64;         // connections without a WebSocket of one address of another machine
constexpr auto kSlow = std::chrono::seconds(5);  // answers that take longer may be cut off
constexpr const char* kSilentCrowd = "too many connections say nothing";
constexpr auto kHttpFarewell = std::chrono::milliseconds(500);
constexpr auto kAcceptAgain = std::chrono::milliseconds(50);  // after the system had no descriptor left

}  // namespace

void HttpServer::open() {
    accept();
    thread_ = std::thread([this] { io_.run(); });
}

void HttpServer::close() {
    if (!thread_.joinable()) return;
    net::post(io_, [this] { stop(); });
    thread_.join();
    const auto late = connections_;
    for (const auto& [number, connection] : late) connection->leave();
}

void HttpServer::accept() {
    acceptor_.async_accept([this](beast::error_code error, Tcp::socket socket) {
        if (stopping_ || error == net::error::operation_aborted) return;
        if (error) {
            again_.expires_after(kAcceptAgain);
            again_.async_wait([this](beast::error_code stopped) {
                if (!stopped) accept();
            });
            return;
        }
        if (makeRoomFor(sourceOf(socket)))
            std::make_shared<Visit>(*this, std::move(socket))->begin();
        else
            refuse(kSilentCrowd);
        accept();
    });
}

bool HttpServer::isShared(const std::string& source) const {
    beast::error_code error;
    const auto address = net::ip::make_address(source, error);
    return rules_.loopback || (!error && address.is_loopback());
}

/// Closes a connection if there are too many: the oldest of the address that has most. First choice is one without a
/// request yet, then an idle one, then one that takes its answer slowly. Returns false if all are busy.
bool HttpServer::makeRoomFor(const std::string& source) {
    std::map<std::string, std::size_t> bySource;
    for (const Visit* visit : visits_) ++bySource[visit->source()];
    const bool hasQuota = !isShared(source) && bySource[source] >= kMaxOfSource;
    if (visits_.size() < rules_.maximumVisits && !hasQuota) return true;
    const auto slow = std::chrono::steady_clock::now() - kSlow;
    for (const Visit::State state : {Visit::State::silent, Visit::State::idle, Visit::State::busy}) {
        Visit* found = nullptr;
        for (Visit* visit : visits_) {
            if (state == Visit::State::busy && visit->since() > slow) continue;
            if (visit->state() != state || (hasQuota && visit->source() != source)) continue;
            if (!found || bySource[visit->source()] > bySource[found->source()]) found = visit;
        }
        if (!found) continue;
        refuse(kSilentCrowd);
        found->end();
        return true;
    }
    return false;
}

void HttpServer::stop() {
    stopping_ = true;
    beast::error_code ignored;
    (void)acceptor_.close(ignored);
    deadline_.expires_after(kHttpFarewell);
    deadline_.async_wait([this](beast::error_code) { io_.stop(); });
    const auto now = connections_;
    for (const auto& [number, connection] : now) connection->end();
    if (connections_.empty()) io_.stop();
}

void HttpServer::begin(Stream&& stream, Request request, std::string source) {
    const std::uint64_t number = ++last_;
    const auto connection = std::make_shared<WebSocketConnection>(*this, number, std::move(stream), std::move(source));
    connections_.emplace(number, connection);
    count_ = connections_.size();
    {
        const std::scoped_lock lock(mutex_);
        queued_.emplace(number, connection->queued());
    }
    connection->begin(std::move(request));
}

void HttpServer::went(WebSocketConnection& connection) {
    {
        const std::scoped_lock lock(mutex_);
        queued_.erase(connection.number());
    }
    ended(connection);
    connections_.erase(connection.number());
    count_ = connections_.size();
    if (stopping_ && connections_.empty()) io_.stop();
}

bool HttpServer::hasRoom(std::uint64_t number, std::size_t bytes) const {
    const std::scoped_lock lock(mutex_);
    const auto found = queued_.find(number);
    if (found == queued_.end()) return false;
    const std::size_t waiting = *found->second;
    return waiting == 0 || waiting + bytes <= rules_.maxQueued;
}

bool HttpServer::say(std::uint64_t number, Message message) {
    if (!hasRoom(number, message.size())) return false;
    {
        const std::scoped_lock lock(mutex_);
        if (const auto found = queued_.find(number); found != queued_.end()) *found->second += message.size();
    }
    net::post(io_, [this, number, message = std::move(message)]() mutable {
        if (const auto found = connections_.find(number); found != connections_.end())
            found->second->push(std::move(message));
    });
    return true;
}

void HttpServer::resumeSoon(std::uint64_t number) {
    net::post(io_, [this, number] {
        if (const auto found = connections_.find(number); found != connections_.end()) found->second->resume();
    });
}

void HttpServer::leaveSoon(std::uint64_t number) {
    net::post(io_, [this, number] {
        if (const auto found = connections_.find(number); found != connections_.end())
            std::shared_ptr(found->second)->leave();
    });
}

bool HttpServer::knowsHost(const Request& request) const {
    return !rules_.loopback || detail::isThisMachine(hostOf(request).value_or(""));
}

std::optional<std::string> hostOf(const Request& request) {
    constexpr unsigned kHttp11 = 11;
    const std::size_t count = request.count(http::field::host);
    if (count == 0 && request.version() < kHttp11) return "";
    if (count != 1) return std::nullopt;
    return detail::hostIn(textOf(request[http::field::host]));
}

}  // namespace rtsg::web
