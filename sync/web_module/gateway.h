// Gateway: the inside of the web gateway, which listens and counts. Browsers and visits refer to it; it outlives them.
//
// Invariant: everything except the counts and the news belongs to the one thread that runs the io_context.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http.hpp>

#include "news.h"
#include "pages.h"
#include "sockets/web_module.h"

namespace rtsg::web {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Tcp = net::ip::tcp;
using Request = http::request<http::string_body>;

inline std::string textOf(beast::string_view text) {
    return {text.data(), text.size()};
}

class Browser;
class Visit;

/// The address for which a connection counts. For IPv6 the first half, because one customer has all addresses of the
/// other half.
std::string sourceOf(const Tcp::socket& socket);
/// The host in the request's one Host field, without its port. Empty if there are none or several, or it is no host
/// name (RFC 9112, 3.2). HTTP/1.0 requests may lack it: "".
std::optional<std::string> hostOf(const Request& request);
/// True if the request names this machine by loopback, so that no other site's name has led here.
bool namesThisMachine(const Request& request);

class Gateway : public WebModule {
  public:
    explicit Gateway(WebSettings settings);
    ~Gateway() override;
    /// Binds, finds the page and starts the thread. Returns the problem, or an empty text.
    std::string start();

    std::uint16_t port() const override { return port_; }
    WebCounts counts() const override;
    std::vector<std::string> takeNews() override { return news_.take(); }
    std::vector<FileWish> takeWishes() override;
    void answer(std::uint64_t wish, std::string bytes, std::string type) override;
    int descriptor() const override { return ring_; }
    bool take(std::uint64_t& browser, std::string& message) override;
    void ignore() override;
    void end() override;
    bool send(std::uint64_t browser, std::string head, std::span<const std::byte> second,
              std::shared_ptr<const void> owner) override;

    // Used by browsers and visits.
    const WebSettings& settings() const { return settings_; }
    net::io_context& io() { return io_; }
    /// Null without encryption.
    net::ssl::context* tls() { return tls_.get(); }
    void news(std::string text) { news_.add(std::move(text)); }
    /// Why this request may not follow, nor load files that the scene names. Empty if it may.
    std::string refusal(const Request& request, const std::string& source) const;
    /// True if the request's host is one of ours, so that no other site's name leads here. Precondition: hostOf()
    /// returns one.
    bool knowsHost(const Request& request) const;
    /// A number for a browser, by which the server knows it.
    std::uint64_t came(Browser* browser);
    /// The server takes the message, and then the browser's resume() is called.
    void heard(std::uint64_t browser, std::string message);
    void went(Browser* browser);
    void came(Visit* visit) { visits_.push_back(visit); }
    void went(Visit* visit) { std::erase(visits_, visit); }
    /// Closes a WebSocket that has said nothing yet, if the maximum is reached.
    void makeRoomForBrowser();
    /// The scene's thread answers `visit`. Returns false if too many wait.
    bool wish(FileWish wish, std::weak_ptr<Visit> visit);
    /// The file as gzip, packed once for all. Empty on loopback and for small files, where it does not pay.
    std::string packedPage(const PageFile& file, const std::string& text);

    std::atomic<std::uint64_t> requests{0}, refused{0};

  private:
    std::string readCertificate();
    Browser* find(std::uint64_t number) const;
    void resumeSoon(std::uint64_t browser);
    void accept();
    bool makeRoomFor(const std::string& address);
    bool isShared(const std::string& address) const;
    void stop();

    WebSettings settings_;
    std::uint16_t port_ = 0;
    int ring_ = -1;  // eventfd: messages wait
    std::set<Browser*> browsers_;
    std::uint64_t lastBrowser_ = 0;
    std::atomic<std::size_t> connections_{0};
    std::atomic<std::uint64_t> opened_{0};
    std::vector<Visit*> visits_;  // oldest first
    bool stopping_ = false;
    News news_;
    std::mutex mutex_;  // guards what follows
    std::deque<std::pair<std::uint64_t, std::string>> messages_;
    std::set<std::uint64_t> here_;  // browsers that have not left
    bool ignores_ = false;
    std::vector<FileWish> wishes_;
    std::map<std::uint64_t, std::weak_ptr<Visit>> wishing_;  // used by the thread only
    std::uint64_t wishNumber_ = 0;
    std::map<std::string, std::pair<std::string, std::string>> packed_;  // by path: tag and bytes
    std::unique_ptr<net::ssl::context> tls_;
    net::io_context io_{1};
    Tcp::acceptor acceptor_{io_};
    net::steady_timer deadline_{io_}, again_{io_};
    std::thread thread_;
};

}  // namespace rtsg::web
