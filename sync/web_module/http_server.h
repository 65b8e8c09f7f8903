// HttpServer: a server of HTTP and WebSockets: it listens, reads requests, and keeps the connections that begin by one.
//
// Invariant: one message of each connection waits here, and the next is read when that was taken. Silence keeps
// nobody out: the oldest connection that says nothing makes room. Threading: everything belongs to the thread that runs
// the io_context, except the functions of which it is said.
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http.hpp>

#include "news.h"

namespace rtsg::web {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Tcp = net::ip::tcp;
using Request = http::request<http::string_body>;

inline std::string textOf(beast::string_view text) {
    return {text.data(), text.size()};
}

class WebSocketConnection;
class Stream;
class Visit;

struct HttpServerRules {
    bool loopback = true;           // it listens there
    std::size_t maximumVisits = 0;  // connections without a WebSocket
    std::chrono::milliseconds requestTimeout{0};
    std::chrono::milliseconds silence{0};  // who does not even answer pings for so long is dropped
    std::string protocol;                  // the subprotocol of WebSockets; empty: none
    std::size_t longestIncoming = 0;       // bytes of a message; a longer one ends the connection
    std::size_t maxQueued = 0;             // bytes that wait for one connection
};

/// The host in the request's one Host field, without its port. Empty if there are none or several, or it is no host
/// name (RFC 9112, 3.2). HTTP/1.0 requests may lack it: "".
std::optional<std::string> hostOf(const Request& request);

class HttpServer {
  public:
    explicit HttpServer(HttpServerRules rules) : rules_(std::move(rules)) {}
    /// Whoever derives from it calls close() before.
    virtual ~HttpServer() = default;
    HttpServer(const HttpServer&) = delete;
    HttpServer& operator=(const HttpServer&) = delete;

    const HttpServerRules& rules() const { return rules_; }
    net::io_context& io() { return io_; }
    /// Null without encryption.
    net::ssl::context* tls() { return tls_.get(); }

    // Used by visits and connections.
    virtual void answer(const std::shared_ptr<Visit>& visit, Request request) = 0;
    /// What was no request, and a handshake that failed.
    virtual void refuse(std::string why) = 0;
    virtual void begun(WebSocketConnection&) {}
    /// Returns false if the message ends the connection; else it is taken, and then resumeSoon() is called.
    virtual bool heard(WebSocketConnection& from, std::string message, bool isText) = 0;
    virtual void ended(WebSocketConnection& connection) = 0;
    void came(Visit* visit) { visits_.push_back(visit); }
    void went(Visit* visit) { std::erase(visits_, visit); }
    void went(WebSocketConnection& connection);

  protected:
    struct Message {
        std::string head;
        std::span<const std::byte> second;
        std::shared_ptr<const void> owner;
        bool bytes = true;
        std::size_t size() const { return head.size() + second.size(); }
    };
    friend class WebSocketConnection;

    /// Precondition: the acceptor listens.
    void open();
    void close();
    /// True if the request's host is one of ours, so that no other site's name leads here. Precondition: hostOf()
    /// returns one.
    bool knowsHost(const Request& request) const;
    /// On loopback, and behind a proxy on this machine, all users have one address.
    bool isShared(const std::string& source) const;
    void begin(Stream&& stream, Request request, std::string source);
    const std::map<std::uint64_t, std::shared_ptr<WebSocketConnection>>& connections() const { return connections_; }

    // On any thread.
    std::size_t count() const { return count_; }
    /// True if so many bytes have room: within the bound, or because nothing waits. False if it has ended, too.
    bool hasRoom(std::uint64_t number, std::size_t bytes) const;
    /// False if there is no room.
    bool say(std::uint64_t number, Message message);
    void resumeSoon(std::uint64_t number);
    void leaveSoon(std::uint64_t number);

    Tcp::acceptor& acceptor() { return acceptor_; }
    std::unique_ptr<net::ssl::context> tls_;

  private:
    void accept();
    bool makeRoomFor(const std::string& source);
    void stop();

    const HttpServerRules rules_;
    std::atomic<std::size_t> count_{0};
    std::vector<Visit*> visits_;  // oldest first
    bool stopping_ = false;
    std::uint64_t last_ = 0;                                                     // number given
    mutable std::mutex mutex_;                                                   // guards the next
    std::map<std::uint64_t, std::shared_ptr<std::atomic<std::size_t>>> queued_;  // bytes that wait for each
    net::io_context io_{1};
    Tcp::acceptor acceptor_{io_};
    net::steady_timer deadline_{io_}, again_{io_};
    std::map<std::uint64_t, std::shared_ptr<WebSocketConnection>> connections_;  // go before the io_context
    std::thread thread_;
};

}  // namespace rtsg::web
