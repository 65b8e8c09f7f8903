// A link that can be cut, and may be long or slow: passes bytes between clients and one server on loopback, until it
// does not.
//
// Threading: one thread of its own; cut() and restore() from any other.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace rtsg::test {

class TcpProxy {
  public:
    /// `server`: tcp://127.0.0.1:PORT; `delay`: how long bytes are under way, in each direction; `rate`: how many of
    /// the server's pass in a second, 0: all; `bend`: what becomes of the server's, as many as were read at once.
    explicit TcpProxy(const std::string& server, std::chrono::milliseconds delay = {}, std::size_t rate = 0,
                      std::function<void(std::string&)> bend = {})
        : target_(addressOf(std::stoi(server.substr(server.rfind(':') + 1)))),
          delay_(delay),
          rate_(rate),
          bend_(std::move(bend)) {
        listen();
        endpoint = "tcp://127.0.0.1:" + std::to_string(ntohs(own_.sin_port));
        thread_ = std::thread([this] { run(); });
    }
    ~TcpProxy() {
        stop_ = true;
        thread_.join();
        closeAll();
    }
    TcpProxy(const TcpProxy&) = delete;
    TcpProxy& operator=(const TcpProxy&) = delete;

    /// Connections end and new ones are refused; returns when that is so.
    void cut() { change(true); }
    void restore() { change(false); }
    std::string endpoint;

  private:
    static sockaddr_in addressOf(int port) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        return address;
    }
    void listen() {
        listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        const int on = 1;
        ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
        if (own_.sin_port == 0) own_ = addressOf(0);
        ::bind(listener_, reinterpret_cast<const sockaddr*>(&own_), sizeof(own_));
        ::listen(listener_, 100);
        socklen_t length = sizeof(own_);
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&own_), &length);
    }
    void change(bool cut) {
        wanted_ = cut;
        while (is_ != cut) std::this_thread::yield();
    }
    void closeAll() {
        for (const auto& pair : pairs_)
            for (const int descriptor : pair) ::close(descriptor);
        pairs_.clear();
        links_.clear();
        if (listener_ >= 0) ::close(listener_);
        listener_ = -1;
    }
    void accept() {
        const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
        const int server = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        const int on = 1;
        for (const int descriptor : {client, server})
            ::setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
        constexpr int kFew = 8192;  // a slow link holds few bytes: its sender waits
        if (rate_ > 0) ::setsockopt(server, SOL_SOCKET, SO_RCVBUF, &kFew, sizeof(kFew));
        if (client < 0 || ::connect(server, reinterpret_cast<const sockaddr*>(&target_), sizeof(target_)) != 0) {
            ::close(client);
            ::close(server);
            return;
        }
        pairs_.push_back({client, server});
    }
    /// False at the end of the stream.
    bool pass(int from, int to, bool limited, bool bent) {
        const std::size_t maximum =
            limited ? std::min(buffer_.size(), static_cast<std::size_t>(credit_)) : buffer_.size();
        const ssize_t got = ::recv(from, buffer_.data(), maximum, 0);
        if (got <= 0) return false;
        if (limited) credit_ -= static_cast<double>(got);
        std::string bytes(buffer_.data(), static_cast<std::size_t>(got));
        if (bent) bend_(bytes);
        if (delay_.count() == 0) return give(to, bytes);
        links_.push_back({Clock::now() + delay_, to, bytes});
        return true;
    }
    static bool give(int to, const std::string& bytes) {
        for (std::size_t sent = 0; sent < bytes.size();) {
            const ssize_t n = ::send(to, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
            if (n <= 0) return false;
            sent += static_cast<std::size_t>(n);
        }
        return true;
    }
    void arrive() {
        for (; !links_.empty() && links_.front().due <= Clock::now(); links_.pop_front())
            (void)give(links_.front().to, links_.front().bytes);
    }
    /// Adds to the bytes that may pass now; what is not used in time is lost.
    void earn() {
        const Clock::time_point now = Clock::now();
        const std::chrono::duration<double> since = now - std::exchange(earned_, now);
        const auto rate = static_cast<double>(rate_);
        credit_ = std::min(credit_ + rate * since.count(), std::max(rate / 20, 1.));
    }
    void run() {
        while (!stop_) {
            earn();
            if (wanted_ != is_) {
                if (wanted_)
                    closeAll();
                else
                    listen();
                is_ = wanted_.load();
            }
            std::vector<pollfd> items;
            if (listener_ >= 0) items.push_back({listener_, POLLIN, 0});
            for (const auto& pair : pairs_)
                for (const int descriptor : pair) {
                    const bool waits = rate_ > 0 && descriptor == pair[1] && credit_ < 1;
                    items.push_back({descriptor, static_cast<short>(waits ? 0 : POLLIN), 0});
                }
            ::poll(items.data(), items.size(), 1);
            arrive();
            std::size_t at = listener_ >= 0 ? 1 : 0;
            for (std::size_t i = 0; i < pairs_.size();) {
                bool open = true;
                for (std::size_t side = 0; side < 2; ++side)
                    if (items[at + side].revents) {
                        const bool limited = rate_ > 0 && side == 1;
                        if (limited && credit_ < 1) continue;
                        open = pass(pairs_[i][side], pairs_[i][1 - side], limited, bend_ && side == 1) && open;
                    }
                at += 2;
                if (open) {
                    ++i;
                    continue;
                }
                for (const int descriptor : pairs_[i]) {
                    std::erase_if(links_, [&](const Bytes& bytes) { return bytes.to == descriptor; });
                    ::close(descriptor);
                }
                pairs_.erase(pairs_.begin() + static_cast<std::ptrdiff_t>(i));
            }
            if (listener_ >= 0 && items[0].revents) accept();
        }
    }

    using Clock = std::chrono::steady_clock;
    struct Bytes {
        Clock::time_point due;
        int to;
        std::string bytes;
    };

    sockaddr_in target_, own_{};
    const std::chrono::milliseconds delay_;
    const std::size_t rate_;
    const std::function<void(std::string&)> bend_;
    double credit_ = 0;
    Clock::time_point earned_ = Clock::now();
    std::deque<Bytes> links_;
    int listener_ = -1;
    std::vector<std::array<int, 2>> pairs_;
    std::array<char, 65536> buffer_;
    std::atomic<bool> stop_{false}, wanted_{false}, is_{false};
    std::thread thread_;
};

}  // namespace rtsg::test
