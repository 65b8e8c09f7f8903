// Connections in virtual time, and what goes wrong with them.
#include "network.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <poll.h>

namespace rtsg::simulation {

namespace {

constexpr Nanoseconds kTryAgain = 200 * kMillisecond;

}  // namespace

Nanoseconds ProcessClock::local() const {
    const Nanoseconds since = at() - worldBase_;
    return localBase_ + since + since / 1000 * drift_ / 1000;
}
Clock::time_point ProcessClock::now() const {
    return time_point(std::chrono::hours(1) + std::chrono::nanoseconds(local()));
}
Nanoseconds ProcessClock::worldFromLocal(duration local) const {
    const auto time = std::min<Nanoseconds>(std::chrono::nanoseconds(local).count(), 3600 * kSecond);
    return time - time / 1000 * drift_ / 1000 + 1;
}
int ProcessClock::wait(std::span<pollfd> items, duration maximum) {
    int ready = 0;
    for (pollfd& item : items) {
        item.revents = system_.isReadable(item.fd) ? item.events : short{0};
        ready += item.revents != 0;
    }
    if (ready == 0 && maximum > duration::zero()) ahead_ += worldFromLocal(maximum);
    return ready;
}
void ProcessClock::jump(Nanoseconds by) {
    localBase_ += by;
}
void ProcessClock::setDrift(std::int64_t partsPerMillion) {
    localBase_ = local();
    worldBase_ = at();
    drift_ = partsPerMillion;
}

/// A listener.
class Network::Port : public Listener, Readable {
  public:
    Port(Network& of, Process& process, std::string endpoint)
        : network(of), owner(process), endpoint_(std::move(endpoint)), descriptor_(of.system_.add(this)) {}
    ~Port() override;
    const std::string& endpoint() const override { return endpoint_; }
    Clock::duration prepare(Items items, bool) override {
        items[0] = {descriptor_, POLLIN, 0};
        for (std::size_t i = 1; i < kDescriptors; ++i) items[i] = {-1, 0, 0};
        return std::chrono::hours(1);
    }
    bool came(Items items) override { return items[0].revents != 0; }
    bool isReadable() override {
        dropLost();
        return !waiting.empty() && waiting.top().at <= owner.clock.at();
    }
    bool receive(Received& message) override {
        if (!isReadable()) return false;
        taken_ = waiting.top();
        waiting.pop();
        message.from = taken_.from;
        message.user.clear();
        message.first = taken_.first;
        message.second = taken_.copy;
        message.problem = nullptr;
        if (network.heard) network.heard(message.first, true);
        return true;
    }
    Failures received(bool) override {
        if (!waiting.empty()) owner.isDue(waiting.top().at);
        return {};
    }
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& shared) override;
    void leave();

    struct Later {
        bool operator()(const Message& a, const Message& b) const {
            return std::pair(a.at, a.serial) > std::pair(b.at, b.serial);
        }
    };
    std::priority_queue<Message, std::vector<Message>, Later> waiting;
    Network& network;
    Process& owner;
    bool isSilent = false;

  private:
    void dropLost() {
        while (!waiting.empty() && *waiting.top().isLost) waiting.pop();
    }
    const std::string endpoint_;
    const int descriptor_;
    Message taken_;
};

/// A connection, seen from the client that made it.
class Network::Line : public Connection {
  public:
    Line(Network& of, Process& process, std::string endpoint)
        : network(of), owner(process), endpoint_(std::move(endpoint)), messages_(*this), events_(*this) {
        network.all_.push_back(this);
        connect();
    }
    ~Line() override {
        leave();
        std::erase(network.all_, this);
    }
    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override {
        progress();
        if (!port_) return false;
        if (owner.clock.at() < halfOpenUntil_ || isSilent) return true;
        Message message;
        message.at = up.arrival(owner.clock.at(), first.size() + second.size());
        message.serial = ++network.serial_;
        message.isLost = isLost_;
        message.from = number_;
        message.first.assign(first.begin(), first.end());
        message.copy.assign(second.begin(), second.end());
        port_->owner.isDue(message.at);
        port_->waiting.push(std::move(message));
        ++network.messages;
        return true;
    }
    bool receive(Received& message) override {
        if (!hasMessage()) return false;
        taken_ = std::move(inbox_.front());
        inbox_.pop_front();
        unread_ -= taken_.second.size();
        message.from.clear();
        message.user.clear();
        message.first = taken_.first;
        message.second = taken_.second;
        message.problem = nullptr;
        if (network.heard) network.heard(message.first, false);
        return true;
    }
    bool foundEmpty() const override { return true; }
    std::array<int, 2> descriptors() const override { return {messages_.descriptor, events_.descriptor}; }
    Event nextEvent() override {
        progress();
        if (happened_.empty() || happened_.front().first > owner.clock.at()) return Event::none;
        const Event event = happened_.front().second;
        happened_.pop_front();
        return event;
    }
    void reconnect(std::chrono::milliseconds) override {
        leave();
        happened_.clear();
        inbox_.clear();
        unread_ = 0;
        connect();
    }
    /// When the process has to look again, for what is under way.
    void isDue() {
        if (!inbox_.empty()) owner.isDue(inbox_.front().at);
        if (!happened_.empty()) owner.isDue(happened_.front().first);
        if (connectAt_ < kNever) owner.isDue(connectAt_);
    }
    void deliver(std::span<const std::byte> first, std::span<const std::byte> second, const SharedBytes& shared,
                 Nanoseconds sentAt) {
        ++network.messages;
        if (sentAt < halfOpenUntil_) return;
        Message& message = inbox_.emplace_back();
        message.at = down.arrival(sentAt, first.size() + second.size());
        message.first.assign(first.begin(), first.end());
        if (!shared) message.copy.assign(second.begin(), second.end());
        message.second = shared ? second : message.copy;
        message.owner = shared;
        unread_ += second.size();
        network.maximumUnread = std::max(network.maximumUnread, unread_);
        owner.isDue(message.at);
    }
    /// The other side has ended it, or the way there. Messages from before are received, or lost with it.
    void lose(Nanoseconds at, bool withMessages) {
        if (withMessages) {
            *isLost_ = true;
            std::erase_if(inbox_, [&](const Message& m) { return m.at > at; });
            unread_ = 0;
            for (const Message& message : inbox_) unread_ += message.second.size();
        }
        if (!port_) return;
        leave();
        happened_.emplace_back(std::max(at, lastArrival()), Event::down);
        owner.isDue(happened_.back().first);
        connectAt_ = happened_.back().first + delay;
        owner.isDue(connectAt_);
    }
    void leave() {
        if (port_) network.up_.erase(number_);
        port_ = nullptr;
        halfOpenUntil_ = 0;
        connectAt_ = kNever;
    }
    void beHalfOpen(Nanoseconds time) {
        refusedUntil = std::max(refusedUntil, owner.clock.at() + time);
        if (port_) halfOpenUntil_ = std::max(halfOpenUntil_, owner.clock.at() + time);
        owner.isDue(halfOpenUntil_);
    }

    /// One direction.
    struct Direction {
        Nanoseconds& delay;
        Nanoseconds last = 0, heldUntil = 0, throttledUntil = 0, idleFrom = 0;
        std::uint64_t bytesPerSecond = 0;
        Nanoseconds arrival(Nanoseconds now, std::size_t size) {
            Nanoseconds at = std::max(now, heldUntil) + delay;
            if (now < throttledUntil) {
                idleFrom = std::max(idleFrom, now) +
                           static_cast<Nanoseconds>(size + 64) * kSecond / static_cast<Nanoseconds>(bytesPerSecond);
                at = std::max(at, std::min(idleFrom, throttledUntil) + delay);
            }
            return last = std::max(last, at);
        }
    };
    Network& network;
    Process& owner;
    Nanoseconds delay = kMillisecond;
    Direction up{delay}, down{delay};
    Nanoseconds refusedUntil = 0;
    bool isSilent = false;
    const Port* port() const { return port_; }
    std::uint64_t unread() const { return unread_; }

  private:
    struct Messages final : Readable {
        explicit Messages(Line& line) : of(line), descriptor(line.network.system_.add(this)) {}
        ~Messages() { of.network.system_.remove(descriptor); }
        bool isReadable() override { return of.hasMessage(); }
        Line& of;
        const int descriptor;
    };
    struct Events final : Readable {
        explicit Events(Line& line) : of(line), descriptor(line.network.system_.add(this)) {}
        ~Events() { of.network.system_.remove(descriptor); }
        bool isReadable() override {
            of.progress();
            return !of.happened_.empty() && of.happened_.front().first <= of.owner.clock.at();
        }
        Line& of;
        const int descriptor;
    };

    bool hasMessage() {
        progress();
        return !inbox_.empty() && inbox_.front().at <= owner.clock.at();
    }
    Nanoseconds lastArrival() const { return inbox_.empty() ? 0 : inbox_.back().at; }
    void connect() {
        connectAt_ = owner.clock.at() + 2 * delay;
        owner.isDue(connectAt_);
    }
    /// Does what time has brought: a half open connection ends, an attempt succeeds or is made again.
    void progress() {
        const Nanoseconds now = owner.clock.at();
        if (halfOpenUntil_ > 0 && now >= halfOpenUntil_) {
            halfOpenUntil_ = 0;
            lose(now, true);
        }
        if (connectAt_ > now) return;
        const auto found = network.ports_.find(endpoint_);
        if (now < refusedUntil || isSilent || found == network.ports_.end()) {
            connectAt_ = std::max(now + kTryAgain, std::min(refusedUntil, now + 5 * kTryAgain));
            return owner.isDue(connectAt_);
        }
        connectAt_ = kNever;
        port_ = found->second;
        number_ = std::to_string(++network.lastNumber_);
        isLost_ = std::make_shared<bool>(false);
        network.up_.emplace(number_, this);
        happened_.emplace_back(now, Event::up);
    }

    const std::string endpoint_;
    Port* port_ = nullptr;
    std::string number_;
    std::shared_ptr<bool> isLost_ = std::make_shared<bool>(false);
    std::deque<Message> inbox_;
    Message taken_;
    std::uint64_t unread_ = 0;
    std::deque<std::pair<Nanoseconds, Event>> happened_;
    Nanoseconds connectAt_ = kNever, halfOpenUntil_ = 0;
    Messages messages_;
    Events events_;
};

/// Tells all connections, which connect again once there is a listener.
void Network::Port::leave() {
    if (const auto own = network.ports_.find(endpoint_); own != network.ports_.end() && own->second == this)
        network.ports_.erase(own);
    std::vector<Line*> ours;
    for (const auto& [number, line] : network.up_)
        if (line->port() == this) ours.push_back(line);
    for (Line* line : ours) line->lose(owner.clock.at() + line->delay, false);
}

Network::Port::~Port() {
    leave();
    network.system_.remove(descriptor_);
}

bool Network::Port::send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
                         const SharedBytes& shared) {
    if (isSilent) return true;
    const auto found = network.up_.find(to);
    if (found == network.up_.end() || found->second->port() != this) return false;
    found->second->deliver(first, second, shared, owner.clock.at());
    return true;
}

class Network::View : public Transport {
  public:
    View(Network& of, Process& process) : network_(of), process_(process) {}
    Clock& clock() override { return process_.clock; }
    Result<bool> isLocal(const std::string&) const override { return true; }
    Result<std::unique_ptr<Listener>> listen(const std::string& endpoint, const ListenSettings&) override {
        auto port = std::make_unique<Port>(network_, process_, endpoint);
        if (!network_.ports_.emplace(endpoint, port.get()).second)
            return fail(fmt::format("cannot bind {}: Address already in use", endpoint));
        return port;
    }
    Result<std::unique_ptr<Connection>> connect(const std::string& endpoint, const ConnectSettings&) override {
        return std::make_unique<Line>(network_, process_, endpoint);
    }

  private:
    Network& network_;
    Process& process_;
};

std::shared_ptr<Transport> Network::transportOf(Process& process) {
    return std::make_shared<View>(*this, process);
}

bool Network::cut(std::uint32_t which) {
    if (all_.empty()) return false;
    Line& line = *all_[which % all_.size()];
    if (!line.port()) return false;
    line.lose(line.owner.clock.at(), true);
    return true;
}
bool Network::halfOpen(std::uint32_t which, Nanoseconds time) {
    if (all_.empty()) return false;
    all_[which % all_.size()]->beHalfOpen(time);
    return true;
}
bool Network::stall(std::uint32_t which, Nanoseconds time) {
    if (all_.empty()) return false;
    Line& line = *all_[which % all_.size()];
    // One direction, or both.
    if (which % 3 != 0) line.up.heldUntil = std::max(line.up.heldUntil, world_.now + time);
    if (which % 3 != 1) line.down.heldUntil = std::max(line.down.heldUntil, world_.now + time);
    return true;
}
bool Network::throttle(std::uint32_t which, std::uint64_t bytesPerSecond, Nanoseconds time) {
    if (all_.empty()) return false;
    for (Line::Direction* direction : {&all_[which % all_.size()]->up, &all_[which % all_.size()]->down}) {
        direction->bytesPerSecond = bytesPerSecond;
        direction->throttledUntil = world_.now + time;
    }
    return true;
}
bool Network::slow(std::uint32_t which, Nanoseconds delay) {
    if (all_.empty()) return false;
    all_[which % all_.size()]->delay = delay;
    return true;
}
bool Network::refuse(std::uint32_t which, Nanoseconds time) {
    if (all_.empty()) return false;
    all_[which % all_.size()]->refusedUntil = world_.now + time;
    return true;
}

void Network::kill(Process& process, bool isSilent) {
    for (auto p = ports_.begin(); p != ports_.end();) {
        Port* port = (p++)->second;
        if (&port->owner != &process) continue;
        port->isSilent = true;
        if (!isSilent) {
            port->leave();
            continue;
        }
        // Nobody is told: connections lead nowhere for a while.
        for (const auto& [number, line] : up_)
            if (line->port() == port) line->beHalfOpen(12 * kSecond);
    }
    for (Line* line : all_)
        if (&line->owner == &process) line->isSilent = true;
}

void Network::heal() {
    for (Line* line : all_) {
        line->refusedUntil = std::min(line->refusedUntil, world_.now);
        for (Line::Direction* direction : {&line->up, &line->down})
            direction->heldUntil = direction->throttledUntil = 0;
    }
}

}  // namespace rtsg::simulation
