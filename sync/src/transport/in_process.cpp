// Queues between servers and clients of one process.
#include "in_process.h"

#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <rtsg/sync/mirror_keys.h>

namespace rtsg {

namespace {

constexpr std::string_view kScheme = "inproc://";

struct Mail {
    std::string from, user;
    std::vector<std::byte> first, copy;
    std::span<const std::byte> second;  // in `copy`, or kept alive by `owner`
    SharedBytes owner;
};

}  // namespace

/// Messages for one reader, with a descriptor that is readable while some wait. `mutex` of the net guards it.
class InProcess::Queue {
  public:
    Queue() : ring_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
    ~Queue() { ::close(ring_); }
    Queue(const Queue&) = delete;
    Queue& operator=(const Queue&) = delete;

    void push(std::string from, std::string user, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) {
        Mail& mail = mails_.emplace_back();
        mail.from = std::move(from);
        mail.user = std::move(user);
        mail.first.assign(first.begin(), first.end());
        if (!owner) mail.copy.assign(second.begin(), second.end());
        mail.second = owner ? second : mail.copy;
        mail.owner = owner;
        ring();
    }
    /// The mail stays here until the next one is taken.
    bool take(Received& message) {
        if (mails_.empty()) {
            if (std::exchange(rung_, false)) {
                eventfd_t count = 0;
                (void)::eventfd_read(ring_, &count);
            }
            return false;
        }
        taken_ = std::move(mails_.front());
        mails_.pop_front();
        message.from = taken_.from;
        message.user = taken_.user;
        message.first = taken_.first;
        message.second = taken_.second;
        message.problem = nullptr;
        return true;
    }
    void ring() {
        if (!std::exchange(rung_, true)) (void)::eventfd_write(ring_, 1);
    }
    bool empty() const { return mails_.empty(); }
    int descriptor() const { return ring_; }

  private:
    const int ring_;  // eventfd
    bool rung_ = false;
    std::deque<Mail> mails_;
    Mail taken_;
};

/// All listeners and connections. A connection that is up has a number, by which its listener knows it.
struct InProcess::Net {
    std::mutex mutex;
    std::map<std::string, Ear*, std::less<>> ears;
    std::map<std::string, Link*, std::less<>> up;  // by number
    std::vector<Link*> waiting;                    // for a listener
    std::uint64_t last = 0;                        // number given
};

class InProcess::Ear : public Listener {
  public:
    Ear(std::shared_ptr<Net> net, std::string endpoint) : net_(std::move(net)), endpoint_(std::move(endpoint)) {}
    ~Ear() override;

    const std::string& endpoint() const override { return endpoint_; }
    Clock::duration prepare(Items items, bool) override {
        items[0] = {queue_.descriptor(), POLLIN, 0};
        for (std::size_t i = 1; i < kDescriptors; ++i) items[i] = {-1, 0, 0};
        return std::chrono::hours(1);
    }
    bool came(Items items) override { return items[0].revents != 0; }
    bool receive(Received& message) override {
        const std::scoped_lock lock(net_->mutex);
        return queue_.take(message);
    }
    Failures received(bool) override { return {}; }
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) override;
    Queue& queue() { return queue_; }

  private:
    const std::shared_ptr<Net> net_;
    const std::string endpoint_;
    Queue queue_;
};

class InProcess::Link : public Connection {
  public:
    Link(std::shared_ptr<Net> net, std::string endpoint, std::string user)
        : net_(std::move(net)), endpoint_(std::move(endpoint)), user_(std::move(user)) {
        const std::scoped_lock lock(net_->mutex);
        lookFor();
    }
    ~Link() override {
        const std::scoped_lock lock(net_->mutex);
        leave();
    }

    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override {
        const std::scoped_lock lock(net_->mutex);
        if (ear_) ear_->queue().push(number_, user_, first, second, nullptr);
        return ear_ != nullptr;
    }
    bool receive(Received& message) override {
        const std::scoped_lock lock(net_->mutex);
        empty_ = !queue_.take(message);
        return !empty_;
    }
    bool foundEmpty() const override { return empty_; }
    std::array<int, 2> descriptors() const override { return {queue_.descriptor(), events_.descriptor()}; }
    Event nextEvent() override {
        const std::scoped_lock lock(net_->mutex);
        Received none;
        if (happened_.empty()) return (void)events_.take(none), Event::none;
        const Event event = happened_.front();
        happened_.pop_front();
        return event;
    }
    void reconnect(std::chrono::milliseconds) override {
        const std::scoped_lock lock(net_->mutex);
        leave();
        lookFor();
    }

    // With the net's mutex held.
    void lookFor() {
        const auto found = net_->ears.find(endpoint_);
        if (found == net_->ears.end()) return net_->waiting.push_back(this);
        ear_ = found->second;
        number_ = std::to_string(++net_->last);
        net_->up.emplace(number_, this);
        happens(Event::up);
    }
    void leave() {
        std::erase(net_->waiting, this);
        net_->up.erase(number_);
        ear_ = nullptr;
    }
    void lose() {
        leave();
        happens(Event::down);
        net_->waiting.push_back(this);
    }
    bool leadsTo(const Ear* ear) const { return ear_ == ear; }
    const std::string& endpoint() const { return endpoint_; }
    Queue& queue() { return queue_; }

  private:
    void happens(Event event) {
        happened_.push_back(event);
        events_.ring();
    }

    const std::shared_ptr<Net> net_;
    const std::string endpoint_, user_;
    Ear* ear_ = nullptr;
    std::string number_;
    Queue queue_, events_;  // of the latter only the descriptor
    std::deque<Event> happened_;
    bool empty_ = false;
};

InProcess::Ear::~Ear() {
    const std::scoped_lock lock(net_->mutex);
    if (const auto own = net_->ears.find(endpoint_); own != net_->ears.end() && own->second == this)
        net_->ears.erase(own);
    std::vector<Link*> ours;
    for (const auto& [number, link] : net_->up)
        if (link->leadsTo(this)) ours.push_back(link);
    for (Link* link : ours) link->lose();
}

bool InProcess::Ear::send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
                          const SharedBytes& owner) {
    const std::scoped_lock lock(net_->mutex);
    const auto found = net_->up.find(to);
    if (found == net_->up.end() || !found->second->leadsTo(this)) return false;
    found->second->queue().push({}, {}, first, second, owner);
    return true;
}

InProcess::InProcess(Clock& clock) : clock_(clock), net_(std::make_shared<Net>()) {}
InProcess::~InProcess() = default;

Result<bool> InProcess::isLocal(const std::string& endpoint) const {
    if (endpoint.size() > kScheme.size() && endpoint.starts_with(kScheme)) return true;
    return fail(fmt::format("'{}' is no endpoint within a process: inproc://NAME", endpoint));
}

Result<std::unique_ptr<Listener>> InProcess::listen(const std::string& endpoint, const ListenSettings&) {
    if (const auto local = isLocal(endpoint); !local) return std::unexpected(local.error());
    auto ear = std::make_unique<Ear>(net_, endpoint);
    const std::scoped_lock lock(net_->mutex);
    if (!net_->ears.emplace(endpoint, ear.get()).second)
        return fail(fmt::format("cannot bind {}: Address already in use", endpoint));
    for (Link* link : std::exchange(net_->waiting, {})) link->lookFor();
    return ear;
}

Result<std::unique_ptr<Connection>> InProcess::connect(const std::string& endpoint, const ConnectSettings& settings) {
    if (const auto local = isLocal(endpoint); !local) return std::unexpected(local.error());
    return std::make_unique<Link>(net_, endpoint, settings.keys ? settings.keys->clientPublic.front() : std::string());
}

}  // namespace rtsg
