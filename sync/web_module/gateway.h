// Gateway: the inside of the web gateway: which browsers may follow, and the page and files that they load.
//
// Invariant: everything except the counts, the news and what the module offers belongs to the server's thread.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "http_server.h"
#include "pages.h"
#include "sockets/web_module.h"

namespace rtsg::web {

class Gateway : public WebModule, private HttpServer {
  public:
    explicit Gateway(WebSettings settings);
    ~Gateway() override;
    /// Binds, finds the page and starts the thread. Returns the problem, or an empty text.
    std::string start();

    std::uint16_t port() const override { return port_; }
    WebCounts counts() const override { return {count(), opened_, requests_, refused_}; }
    std::vector<std::string> takeNews() override { return news_.take(); }
    std::vector<FileWish> takeWishes() override;
    void answer(std::uint64_t wish, std::string bytes, std::string type) override;
    int descriptor() const override { return ring_; }
    bool take(std::uint64_t& browser, std::string& message) override;
    void ignore() override;
    void end() override { close(); }
    bool send(std::uint64_t browser, std::string head, std::span<const std::byte> second,
              std::shared_ptr<const void> owner) override;

  private:
    void answer(const std::shared_ptr<Visit>& visit, Request request) override;
    void refuse(std::string) override { ++refused_; }
    bool heard(WebSocketConnection& from, std::string message, bool isText) override;
    void ended(WebSocketConnection& connection) override;

    std::string readCertificate();
    /// Why this request may not follow, nor load files that the scene names. Empty if it may.
    std::string refusal(const Request& request, const std::string& source) const;
    /// Closes a WebSocket that has said nothing yet, if the maximum is reached.
    void makeRoomForBrowser();
    http::response<http::string_body> page(const Request& request);
    /// The scene's thread answers the visit. Returns false if there is no such file, or too many wait.
    bool wish(const Request& request, const std::shared_ptr<Visit>& visit);
    /// The file as gzip, packed once for all. Empty on loopback and for small files, where it does not pay.
    std::string packedPage(const PageFile& file, const std::string& text);
    void pass(std::uint64_t browser, std::string message);

    WebSettings settings_;
    std::uint16_t port_ = 0;
    int ring_ = -1;  // eventfd: messages wait
    std::atomic<std::uint64_t> opened_{0}, requests_{0}, refused_{0};
    News news_;
    std::mutex mutex_;  // guards what follows
    std::deque<std::pair<std::uint64_t, std::string>> messages_;
    bool ignores_ = false;
    std::vector<FileWish> wishes_;
    std::map<std::uint64_t, std::weak_ptr<Visit>> wishing_;  // used by the thread only
    std::uint64_t wishNumber_ = 0;
    std::map<std::string, std::pair<std::string, std::string>> packed_;  // by path: tag and bytes
};

}  // namespace rtsg::web
