// Sends lines on a thread of its own, so that no reader holds up the scene.
#include "line_sink.h"

#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/worker.h>

#include "mqtt.h"

namespace rtsg::feeds {

namespace {

constexpr std::size_t kMaxWaiting = std::size_t{4} << 20;
constexpr std::size_t kMaxSubscribers = 64;
constexpr auto kFarewell = std::chrono::milliseconds(500);  // for lines that wait at the end

/// The target of lines. All functions are called on the sink's thread.
class Outlet {
  public:
    virtual ~Outlet() = default;
    /// Returns how often the line was missed. `problem` is set if nothing more can be written.
    virtual std::uint64_t send(const std::string& line, std::string& problem) = 0;
    /// Descriptors to wait for, with what.
    virtual void addTo(std::vector<pollfd>&) const {}
    /// Does what those make possible.
    virtual void poll() {}
    virtual std::size_t subscribers() const { return 0; }
    /// True while something waits to be sent.
    virtual bool waits() const { return false; }
    /// Lines that waited for somebody and never will be sent, since this was last asked. `all`: nothing is sent any
    /// more.
    virtual std::uint64_t lost(bool all) {
        (void)all;
        return 0;
    }
};

class FileOutlet final : public Outlet {
  public:
    explicit FileOutlet(Descriptor file) : file_(std::move(file)) {}
    std::uint64_t send(const std::string& line, std::string& problem) override {
        const std::string text = line + '\n';
        for (std::size_t done = 0; done < text.size();) {
            pollfd item = {file_.get(), POLLOUT, 0};
            if (::poll(&item, 1, stuck_ ? 0 : static_cast<int>(kFarewell.count())) == 0) {
                stuck_ = true;
                if (done > 0) problem = "its reader has stopped in the middle of a line";
                return 1;
            }
            // A descriptor that poll() calls writable takes this many bytes without blocking.
            const ssize_t size =
                ::write(file_.get(), text.data() + done, std::min<std::size_t>(text.size() - done, PIPE_BUF));
            if (size < 0 && (errno == EINTR || errno == EAGAIN)) continue;
            if (size < 0) {
                problem = std::strerror(errno);
                takeBack(done);
                return 1;
            }
            done += static_cast<std::size_t>(size);
            stuck_ = false;
        }
        return 0;
    }

  private:
    /// A line of which a file has no room for the rest is not there at all.
    void takeBack(std::size_t bytes) const {
        struct stat status{};
        if (bytes == 0 || ::fstat(file_.get(), &status) != 0 || !S_ISREG(status.st_mode)) return;
        (void)!::ftruncate(file_.get(), status.st_size - static_cast<off_t>(bytes));  // then it stays cut
    }

    Descriptor file_;
    bool stuck_ = false;  // its reader reads nothing
};

class UdpOutlet final : public Outlet {
  public:
    explicit UdpOutlet(Descriptor socket) : socket_(std::move(socket)) {}
    std::uint64_t send(const std::string& line, std::string&) override {
        // An answer that nobody listens there is about the datagram before: this one is sent again.
        for (int attempt = 0; attempt < 2; ++attempt)
            if (::send(socket_.get(), line.data(), line.size(), MSG_NOSIGNAL) >= 0) return 0;
        return 1;
    }

  private:
    Descriptor socket_;
};

class MqttOutlet final : public Outlet {
  public:
    explicit MqttOutlet(std::unique_ptr<MqttModule> module) : module_(std::move(module)) {}
    std::uint64_t send(const std::string& line, std::string&) override { return module_->publish(line) ? 0 : 1; }

  private:
    std::unique_ptr<MqttModule> module_;
};

/// Sends every line to all connections.
class TcpOutlet final : public Outlet {
  public:
    explicit TcpOutlet(Descriptor socket) : socket_(std::move(socket)) {}
    std::uint64_t send(const std::string& line, std::string&) override {
        acceptAll();
        std::uint64_t missed = 0;
        for (Subscriber& one : subscribers_) {
            if (one.waiting.size() + line.size() > kMaxWaiting) {
                ++one.missed;
                ++missed;
                continue;
            }
            if (one.missed > 0) one.waiting += fmt::format("{{\"missed\":{}}}\n", std::exchange(one.missed, 0));
            one.waiting += line;
            one.waiting += '\n';
        }
        return missed;
    }
    void addTo(std::vector<pollfd>& items) const override {
        items.push_back({socket_.get(), POLLIN, 0});
        for (const Subscriber& one : subscribers_) {
            const bool writes = !one.waiting.empty();
            items.push_back({one.socket.get(), static_cast<short>(writes ? POLLIN | POLLOUT : POLLIN), 0});
        }
    }
    void poll() override {
        acceptAll();
        std::erase_if(subscribers_, [this](Subscriber& one) {
            const bool leaves = !orderOf(one);
            if (leaves) lost_ += linesOf(one);
            return leaves;
        });
    }
    std::size_t subscribers() const override { return subscribers_.size(); }
    bool waits() const override {
        return std::ranges::any_of(subscribers_, [](const Subscriber& one) { return !one.waiting.empty(); });
    }

    std::uint64_t lost(bool all) override {
        if (all)
            for (Subscriber& one : subscribers_) {
                lost_ += linesOf(one);
                one.waiting.clear();
            }
        return std::exchange(lost_, 0);
    }

  private:
    struct Subscriber {
        Descriptor socket;
        std::string waiting;
        std::uint64_t missed = 0;
    };
    /// Lines that wait for it; one of which it has had a part counts.
    static std::uint64_t linesOf(const Subscriber& one) {
        return static_cast<std::uint64_t>(std::ranges::count(one.waiting, '\n'));
    }
    /// Returns false if it has left.
    static bool orderOf(Subscriber& one) {
        char ignored[4096];
        const ssize_t said = ::recv(one.socket.get(), ignored, sizeof(ignored), 0);
        if (said == 0 || (said < 0 && errno != EAGAIN && errno != EINTR)) return false;
        if (one.waiting.empty()) return true;
        const ssize_t size = ::send(one.socket.get(), one.waiting.data(), one.waiting.size(), MSG_NOSIGNAL);
        if (size < 0) return errno == EAGAIN || errno == EINTR;
        one.waiting.erase(0, static_cast<std::size_t>(size));
        return true;
    }
    void acceptAll() {
        while (true) {
            Descriptor one(::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
            if (one.get() < 0) return;
            const int yes = 1;
            (void)::setsockopt(one.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
            if (subscribers_.size() < kMaxSubscribers) subscribers_.push_back({std::move(one), {}});
        }
    }

    Descriptor socket_;
    std::vector<Subscriber> subscribers_;
    std::uint64_t lost_ = 0;
};

class ThreadedSink final : public LineSink {
  public:
    ThreadedSink(std::unique_ptr<Outlet> outlet, bool waits) : outlet_(std::move(outlet)), waits_(waits) {
        worker_.run([this] { run(); }, [this] { wake_.raise(); });
    }

    void close() override { worker_.stop(); }
    void write(std::string line) override {
        {
            std::unique_lock lock(mutex_);
            if (waits_)
                room_.wait(lock, [this] { return worker_.stops() || !problem_.empty() || waiting_ < kMaxWaiting / 2; });
            if (worker_.stops() || !problem_.empty() || waiting_ + line.size() > kMaxWaiting)
                return void(++counts_.missed);
            waiting_ += line.size();
            ++counts_.lines;
            counts_.bytes += line.size() + 1;
            lines_.push_back(std::move(line));
        }
        wake_.raise();
    }
    SinkCounts counts() const override {
        const std::scoped_lock lock(mutex_);
        return counts_;
    }
    std::string failure() const override {
        const std::scoped_lock lock(mutex_);
        return problem_;
    }

  private:
    void run() {
        try {
            sendUntilStopped();
        } catch (const std::exception& e) {
            const std::scoped_lock lock(mutex_);
            problem_ = fmt::format("sending ended: {}", e.what());
        }
        room_.notify_one();
    }
    void sendUntilStopped() {
        std::vector<pollfd> items;
        std::chrono::steady_clock::time_point end{};
        for (bool stopping = false; !(stopping && (!outlet_->waits() || std::chrono::steady_clock::now() >= end));) {
            items.assign({{wake_.get(), POLLIN, 0}});
            outlet_->addTo(items);
            if (::poll(items.data(), items.size(), stopping ? 20 : -1) < 0) continue;
            wake_.clear();
            // Before the lines are taken: none comes after the end is asked for.
            if (worker_.stops() && !std::exchange(stopping, true)) end = std::chrono::steady_clock::now() + kFarewell;
            sendAll();
            outlet_->poll();
            const std::scoped_lock lock(mutex_);
            counts_.subscribers = outlet_->subscribers();
            counts_.missed += outlet_->lost(false);
        }
        const std::scoped_lock lock(mutex_);
        counts_.missed += outlet_->lost(true);
    }
    void sendAll() {
        std::deque<std::string> lines;
        std::string problem;
        {
            const std::scoped_lock lock(mutex_);
            lines.swap(lines_);
            waiting_ = 0;
            problem = problem_;
        }
        room_.notify_one();
        std::uint64_t missed = 0;
        for (const std::string& line : lines) missed += problem.empty() ? outlet_->send(line, problem) : 1;
        const std::scoped_lock lock(mutex_);
        counts_.missed += missed;
        problem_ = std::move(problem);
    }

    std::unique_ptr<Outlet> outlet_;
    const bool waits_;
    Wakeup wake_;
    mutable std::mutex mutex_;
    std::condition_variable room_;
    std::deque<std::string> lines_;
    std::size_t waiting_ = 0;  // bytes of lines_
    SinkCounts counts_;
    std::string problem_;
    Worker worker_{"rtsg sink"};  // last: it uses all the rest
};

Result<std::unique_ptr<Outlet>> outletAt(Endpoint& endpoint, bool insecure) {
    using Kind = Endpoint::Kind;
    if (!endpoint.isSocket()) {
        Descriptor file(endpoint.kind == Kind::standard
                            ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                            : ::open(endpoint.text.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
        if (!file) return fail(systemError("write", endpoint));
        return std::make_unique<FileOutlet>(std::move(file));
    }
    if (endpoint.kind == Kind::mqtt) {
        MqttSettings settings;
        settings.note = [](const std::string&) {};  // lines that a lost broker misses are counted
        auto module = startMqtt(endpoint, std::move(settings));
        if (!module) return std::unexpected(module.error());
        return std::make_unique<MqttOutlet>(std::move(*module));
    }
    auto socket = endpoint.kind == Kind::udp ? sendTo(endpoint) : listenAt(endpoint, insecure);
    if (!socket) return std::unexpected(socket.error());
    if (endpoint.kind == Kind::udp) return std::make_unique<UdpOutlet>(std::move(*socket));
    return std::make_unique<TcpOutlet>(std::move(*socket));
}

}  // namespace

Result<std::unique_ptr<LineSink>> LineSink::open(Endpoint& endpoint, bool insecure, bool waits) {
    auto outlet = outletAt(endpoint, insecure);
    if (!outlet) return std::unexpected(outlet.error());
    return std::make_unique<ThreadedSink>(std::move(*outlet), waits);
}

}  // namespace rtsg::feeds
