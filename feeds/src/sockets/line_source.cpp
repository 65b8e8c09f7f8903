// Reads files, pipes, datagrams and connections, each until it is told to stop.
#include "line_source.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "mqtt.h"

namespace rtsg::feeds {

namespace {

constexpr std::size_t kPiece = std::size_t{64} << 10;  // a datagram is not larger
constexpr std::size_t kMaxConnections = 64;
constexpr std::uint32_t kLargestMessage = 1 << 20;  // of a broker
constexpr auto kQuiet = std::chrono::seconds(10);   // so long a connection is silent before another takes its place

using SteadyClock = std::chrono::steady_clock;

/// Whether bytes are the beginning of a request of HTTP, which browsers send for any page to any port; nothing while
/// that is open.
std::optional<bool> isHttpRequest(std::string_view bytes) {
    constexpr std::array<std::string_view, 9> kMethods = {"GET ",   "POST ",    "HEAD ",  "PUT ",    "DELETE ",
                                                          "PATCH ", "OPTIONS ", "TRACE ", "CONNECT "};
    for (const std::string_view method : kMethods) {
        if (bytes.starts_with(method)) return true;
        if (method.starts_with(bytes)) return std::nullopt;
    }
    return false;
}

/// Waits until the descriptor or `stop` has something. False: stop.
bool waitFor(int descriptor, int stop) {
    pollfd items[] = {{stop, POLLIN, 0}, {descriptor, POLLIN, 0}};
    while (::poll(items, 2, -1) < 0 && errno == EINTR) {
    }
    return items[0].revents == 0;
}

/// Notes the first eight of a kind, and then each that doubles their number.
void noteRarely(LineTaker& taker, std::uint64_t& times, std::string text) {
    constexpr std::uint64_t kAllReported = 8;
    if (++times > kAllReported && !std::has_single_bit(times)) return;
    taker.note(times > kAllReported ? fmt::format("{}; {} by now", text, times) : std::move(text));
}

class FileSource final : public LineSource {
  public:
    explicit FileSource(Descriptor file) : file_(std::move(file)) {
        struct stat status{};
        isFile_ = ::fstat(file_.get(), &status) == 0 && S_ISREG(status.st_mode);
    }
    bool isFile() const override { return isFile_; }
    void read(LineTaker& taker, int stop) override {
        std::string bytes(kPiece, '\0');
        while (waitFor(file_.get(), stop)) {
            const ssize_t size = ::read(file_.get(), bytes.data(), bytes.size());
            if (size < 0 && (errno == EINTR || errno == EAGAIN)) continue;
            if (size < 0) taker.broke(fmt::format("cannot be read on: {}", std::strerror(errno)));
            if (size <= 0) break;
            if (!taker.came(0, std::string_view(bytes).substr(0, static_cast<std::size_t>(size)), true)) return;
        }
        taker.paused(0, true);
    }

  private:
    Descriptor file_;
    bool isFile_ = false;
};

class UdpSource final : public LineSource {
  public:
    explicit UdpSource(Descriptor socket) : socket_(std::move(socket)) {}
    void read(LineTaker& taker, int stop) override {
        std::string bytes(kPiece, '\0');
        while (waitFor(socket_.get(), stop)) {
            const ssize_t size = receive(bytes, taker);
            if (size < 0) continue;  // nothing is there after all
            if (!taker.came(0, std::string_view(bytes).substr(0, static_cast<std::size_t>(size)), false)) return;
            taker.paused(0, false);
        }
    }

  private:
    ssize_t receive(std::string& bytes, LineTaker& taker) {
        alignas(cmsghdr) char control[CMSG_SPACE(sizeof(std::uint32_t))] = {};
        iovec room = {bytes.data(), bytes.size()};
        msghdr message{};
        message.msg_iov = &room;
        message.msg_iovlen = 1;
        message.msg_control = control;
        message.msg_controllen = sizeof(control);
        const ssize_t size = ::recvmsg(socket_.get(), &message, 0);
        const cmsghdr* const head = size < 0 ? nullptr : CMSG_FIRSTHDR(&message);
        if (!head || head->cmsg_level != SOL_SOCKET || head->cmsg_type != SO_RXQ_OVFL) return size;
        std::uint32_t leftOut = 0;  // by the system, since the socket was opened
        std::memcpy(&leftOut, CMSG_DATA(head), sizeof(leftOut));
        if (leftOut != leftOut_) taker.lost(leftOut - leftOut_);
        leftOut_ = leftOut;
        return size;
    }

    Descriptor socket_;
    std::uint32_t leftOut_ = 0;
};

class TcpSource final : public LineSource {
  public:
    explicit TcpSource(Descriptor socket) : socket_(std::move(socket)) {}
    void read(LineTaker& taker, int stop) override {
        std::string bytes(kPiece, '\0');
        std::vector<pollfd> items;
        while (true) {
            items.assign({{stop, POLLIN, 0}, {socket_.get(), POLLIN, 0}});
            for (const Connection& one : connections_) items.push_back({one.socket.get(), POLLIN, 0});
            if (::poll(items.data(), items.size(), -1) < 0) continue;
            if (items[0].revents != 0) return;
            for (std::size_t i = connections_.size(); i-- > 0;)
                if (items[i + 2].revents != 0 && !readFrom(i, bytes, taker)) return;
            if (items[1].revents != 0) accept(taker);
        }
    }

  private:
    struct Connection {
        Descriptor socket;
        std::uint64_t stream = 0;
        SteadyClock::time_point heard = SteadyClock::now();
        bool hasLine = false;   // a whole one has come
        bool isFeed = false;    // it does not begin as a request of HTTP does
        std::string opening{};  // while that is open
    };

    /// Returns false if nothing more is wanted.
    bool readFrom(std::size_t i, std::string& bytes, LineTaker& taker) {
        const ssize_t size = ::recv(connections_[i].socket.get(), bytes.data(), bytes.size(), 0);
        if (size < 0 && (errno == EAGAIN || errno == EINTR)) return true;
        Connection& one = connections_[i];
        if (size <= 0) {
            const bool goesOn = one.opening.empty() || taker.came(one.stream, one.opening, true);
            close(i, taker);
            return goesOn;
        }
        std::string_view came = std::string_view(bytes).substr(0, static_cast<std::size_t>(size));
        one.heard = SteadyClock::now();
        one.hasLine = one.hasLine || came.contains('\n');
        if (one.isFeed) return taker.came(one.stream, came, true);
        const std::string all = one.opening + std::string(came);
        const std::optional<bool> isHttp = isHttpRequest(all);
        if (!isHttp) {
            one.opening = all;
            return true;
        }
        if (*isHttp) {
            noteRarely(taker, requests_, "dropped a connection that begins as a request of HTTP, as pages may send");
            one.opening.clear();
            close(i, taker);
            return true;
        }
        one.isFeed = true;
        one.opening.clear();
        return taker.came(one.stream, all, true);
    }
    void close(std::size_t i, LineTaker& taker) {
        taker.paused(connections_[i].stream, true);
        connections_.erase(connections_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    /// Closes the oldest connection that has sent no line yet; else the one that has been silent for longest.
    bool makeRoom(LineTaker& taker) {
        auto gone = std::ranges::find(connections_, false, &Connection::hasLine);
        if (gone == connections_.end()) gone = std::ranges::min_element(connections_, {}, &Connection::heard);
        if (gone->hasLine && SteadyClock::now() - gone->heard < kQuiet) return false;
        noteRarely(taker, silent_,
                   fmt::format("closed a connection that was silent, for a new one: there are {}", kMaxConnections));
        close(static_cast<std::size_t>(gone - connections_.begin()), taker);
        return true;
    }
    void accept(LineTaker& taker) {
        Descriptor one(::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (one.get() < 0) {
            // Too many files are open, say: the listening socket stays readable.
            if (errno != EAGAIN && errno != EINTR) std::this_thread::sleep_for(std::chrono::milliseconds(20));
            return;
        }
        if (connections_.size() < kMaxConnections || makeRoom(taker))
            return connections_.push_back({std::move(one), ++streams_});
        noteRarely(taker, refused_, fmt::format("refused a connection: there are {}", kMaxConnections));
    }

    Descriptor socket_;
    std::vector<Connection> connections_;
    std::uint64_t streams_ = 0;
    std::uint64_t requests_ = 0, silent_ = 0, refused_ = 0;
};

class MqttSource final : public LineSource {
  public:
    explicit MqttSource(Endpoint endpoint) : endpoint_(std::move(endpoint)) {}
    /// Messages before read() are left out.
    Result<> connect() {
        MqttSettings settings;
        settings.largest = kLargestMessage;
        settings.take = [this](std::string_view message) {
            const std::scoped_lock lock(mutex_);
            if (!taker_) return;
            (void)taker_->came(0, message, false);
            taker_->paused(0, false);
        };
        settings.note = [this](std::string text) {
            const std::scoped_lock lock(mutex_);
            if (taker_) taker_->note(std::move(text));
        };
        auto module = startMqtt(endpoint_, std::move(settings));
        if (!module) return std::unexpected(module.error());
        module_ = std::move(*module);
        return {};
    }
    void read(LineTaker& taker, int stop) override {
        {
            const std::scoped_lock lock(mutex_);
            taker_ = &taker;
        }
        pollfd item = {stop, POLLIN, 0};
        while (::poll(&item, 1, -1) < 0 && errno == EINTR) {
        }
        const std::scoped_lock lock(mutex_);
        taker_ = nullptr;
    }

  private:
    Endpoint endpoint_;
    std::mutex mutex_;
    LineTaker* taker_ = nullptr;
    std::unique_ptr<MqttModule> module_;  // last: its thread must end before the members that it uses
};

}  // namespace

Result<std::unique_ptr<LineSource>> LineSource::open(Endpoint& endpoint, bool insecure) {
    using Kind = Endpoint::Kind;
    if (!endpoint.isSocket()) {
        Descriptor file(endpoint.kind == Kind::standard
                            ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
                            : ::open(endpoint.text.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
        struct stat status{};
        if (file && ::fstat(file.get(), &status) == 0 && S_ISDIR(status.st_mode)) {
            errno = EISDIR;
            return fail(systemError("read", endpoint));
        }
        if (!file) return fail(systemError("read", endpoint));
        return std::make_unique<FileSource>(std::move(file));
    }
    if (endpoint.kind == Kind::mqtt) {
        auto source = std::make_unique<MqttSource>(endpoint);
        if (auto ok = source->connect(); !ok) return std::unexpected(ok.error());
        return source;
    }
    auto socket = listenAt(endpoint, insecure);
    if (!socket) return std::unexpected(socket.error());
    if (endpoint.kind == Kind::udp) return std::make_unique<UdpSource>(std::move(*socket));
    return std::make_unique<TcpSource>(std::move(*socket));
}

}  // namespace rtsg::feeds
