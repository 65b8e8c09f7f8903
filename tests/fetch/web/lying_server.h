// LyingServer: an HTTP server on loopback that answers each path as a test says, with whatever bytes at whatever pace.
//
// Threading: one thread accepts, one a connection. All have ended when the object has gone.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "support/loopback_listener.h"

namespace rtsg::test {

class LyingServer {
  public:
    /// One connection: what was asked, and somewhere to answer.
    struct Asked {
        std::string request;
        std::function<bool(std::string_view)> send;  // false: the client is gone
        const std::atomic<bool>* over = nullptr;

        /// For a server that sends nothing more, until the client or the test is gone.
        void stall() const {
            while (!over->load() && send("")) std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        bool has(std::string_view header) const { return request.contains(header); }
    };
    using Answer = std::function<void(const Asked&)>;

    LyingServer() {
        accepting_ = std::thread([this] { accept(); });
    }
    ~LyingServer() {
        over_ = true;
        accepting_.join();
        for (std::thread& one : connections_) one.join();
    }
    LyingServer(const LyingServer&) = delete;
    LyingServer& operator=(const LyingServer&) = delete;

    void at(const std::string& path, Answer answer) {
        const std::scoped_lock lock(mutex_);
        answers_[path] = std::move(answer);
    }
    /// A whole answer, with its length.
    void file(const std::string& path, const std::string& body, const std::string& headers = {}) {
        at(path, [=](const Asked& asked) { asked.send(whole("200 OK", body, headers)); });
    }
    void redirect(const std::string& path, const std::string& to) {
        at(path, [=](const Asked& asked) { asked.send(whole("302 Found", "", "Location: " + to + "\r\n")); });
    }
    static std::string whole(const std::string& status, const std::string& body, const std::string& headers = {}) {
        return fmt::format("HTTP/1.1 {}\r\nContent-Length: {}\r\nConnection: close\r\n{}\r\n{}", status, body.size(),
                           headers, body);
    }

    std::string address(const std::string& path = "/", const std::string& host = "127.0.0.1") const {
        return fmt::format("http://{}:{}{}", host, listener_.port(), path);
    }
    int port() const { return listener_.port(); }
    int asked() const { return asked_; }

  private:
    void accept() {
        while (!over_) {
            pollfd waiting{listener_.get(), POLLIN, 0};
            if (::poll(&waiting, 1, 10) <= 0) continue;
            const int one = ::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC);
            if (one >= 0) connections_.emplace_back([this, one] { answer(one); });
        }
    }
    void answer(int socket) {
        Asked asked;
        asked.over = &over_;
        asked.send = [socket](std::string_view bytes) {
            char ignored = 0;
            if (::recv(socket, &ignored, 1, MSG_DONTWAIT) == 0) return false;
            while (!bytes.empty()) {
                const ssize_t sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
                if (sent <= 0) return false;
                bytes.remove_prefix(static_cast<std::size_t>(sent));
            }
            return true;
        };
        char block[4096];
        while (!over_ && !asked.request.contains("\r\n\r\n")) {
            pollfd waiting{socket, POLLIN, 0};
            if (::poll(&waiting, 1, 10) <= 0) continue;
            const ssize_t got = ::recv(socket, block, sizeof block, 0);
            if (got <= 0) break;
            asked.request.append(block, static_cast<std::size_t>(got));
        }
        if (const std::size_t begin = asked.request.find(' '); begin != std::string::npos) {
            ++asked_;
            const std::string path = asked.request.substr(begin + 1, asked.request.find(' ', begin + 1) - begin - 1);
            Answer how;
            {
                const std::scoped_lock lock(mutex_);
                if (const auto found = answers_.find(path); found != answers_.end()) how = found->second;
            }
            if (how)
                how(asked);
            else
                asked.send(whole("404 Not Found", "nothing here"));
        }
        ::shutdown(socket, SHUT_RDWR);
        ::close(socket);
    }

    LoopbackListener listener_{64};
    std::atomic<bool> over_ = false;
    std::atomic<int> asked_ = 0;
    std::mutex mutex_;
    std::map<std::string, Answer> answers_;
    std::thread accepting_;
    std::vector<std::thread> connections_;  // of the accepting thread, and then of the destructor
};

}  // namespace rtsg::test
