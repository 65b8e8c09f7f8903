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

#include <rtsg/core/descriptor.h>
#include <rtsg/sync/mirror_keys.h>

namespace rtsg {

namespace {

constexpr std::string_view kScheme = "inproc://";

struct QueuedMessage {
    std::string from, user;
    std::vector<std::byte> first, copy;
    std::span<const std::byte> second;  // in `copy`, or kept alive by `owner`
    SharedBytes owner;
};

/// What a reader waits at; it is rung once until it is silenced.
class Bell {
  public:
    void ring() {
        if (!std::exchange(isRung_, true)) wakeup_.raise();
    }
    void silence() {
        if (std::exchange(isRung_, false)) wakeup_.clear();
    }
    int descriptor() const { return wakeup_.get(); }

  private:
    Wakeup wakeup_;
    bool isRung_ = false;
};

}  // namespace

/// Messages for one reader, with a descriptor that is readable while some wait. `mutex` of the directory guards it.
class InProcess::Queue {
  public:
    void push(std::string from, std::string user, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) {
        QueuedMessage& queued = waiting_.emplace_back();
        queued.from = std::move(from);
        queued.user = std::move(user);
        queued.first.assign(first.begin(), first.end());
        if (!owner) queued.copy.assign(second.begin(), second.end());
        queued.second = owner ? second : queued.copy;
        queued.owner = owner;
        bell_.ring();
    }
    /// The message stays here until the next one is taken.
    bool take(Received& message) {
        if (waiting_.empty()) return bell_.silence(), false;
        taken_ = std::move(waiting_.front());
        waiting_.pop_front();
        message.from = taken_.from;
        message.user = taken_.user;
        message.first = taken_.first;
        message.second = taken_.second;
        message.problem = nullptr;
        return true;
    }
    int descriptor() const { return bell_.descriptor(); }

  private:
    Bell bell_;
    std::deque<QueuedMessage> waiting_;
    QueuedMessage taken_;
};

/// All listeners and connections. A connection that is up has a number, by which its listener knows it.
struct InProcess::Directory {
    std::mutex mutex;
    std::map<std::string, QueueListener*, std::less<>> listeners;
    std::map<std::string, QueueConnection*, std::less<>> up;  // by number
    std::vector<QueueConnection*> waiting;                    // for a listener
    std::uint64_t last = 0;                                   // number given
};

class InProcess::QueueListener : public Listener {
  public:
    QueueListener(std::shared_ptr<Directory> directory, std::string endpoint)
        : directory_(std::move(directory)), endpoint_(std::move(endpoint)) {}
    ~QueueListener() override;

    const std::string& endpoint() const override { return endpoint_; }
    Clock::duration prepare(Items items, bool) override {
        items[0] = {queue_.descriptor(), POLLIN, 0};
        for (std::size_t i = 1; i < kDescriptors; ++i) items[i] = {-1, 0, 0};
        return std::chrono::hours(1);
    }
    bool came(Items items) override { return items[0].revents != 0; }
    bool receive(Received& message) override {
        const std::scoped_lock lock(directory_->mutex);
        return queue_.take(message);
    }
    Failures received(bool) override { return {}; }
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) override;
    Queue& queue() { return queue_; }

  private:
    const std::shared_ptr<Directory> directory_;
    const std::string endpoint_;
    Queue queue_;
};

class InProcess::QueueConnection : public Connection {
  public:
    QueueConnection(std::shared_ptr<Directory> directory, std::string endpoint, std::string user)
        : directory_(std::move(directory)), endpoint_(std::move(endpoint)), user_(std::move(user)) {
        const std::scoped_lock lock(directory_->mutex);
        lookFor();
    }
    ~QueueConnection() override {
        const std::scoped_lock lock(directory_->mutex);
        leave();
    }

    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override {
        const std::scoped_lock lock(directory_->mutex);
        if (listener_) listener_->queue().push(number_, user_, first, second, nullptr);
        return listener_ != nullptr;
    }
    bool receive(Received& message) override {
        const std::scoped_lock lock(directory_->mutex);
        empty_ = !queue_.take(message);
        return !empty_;
    }
    bool foundEmpty() const override { return empty_; }
    std::array<int, 2> descriptors() const override { return {queue_.descriptor(), events_.descriptor()}; }
    Event nextEvent() override {
        const std::scoped_lock lock(directory_->mutex);
        if (happened_.empty()) return events_.silence(), Event::none;
        const Event event = happened_.front();
        happened_.pop_front();
        return event;
    }
    void reconnect(std::chrono::milliseconds) override {
        const std::scoped_lock lock(directory_->mutex);
        leave();
        lookFor();
    }

    // With the directory's mutex held.
    void lookFor() {
        const auto found = directory_->listeners.find(endpoint_);
        if (found == directory_->listeners.end()) return directory_->waiting.push_back(this);
        listener_ = found->second;
        number_ = std::to_string(++directory_->last);
        directory_->up.emplace(number_, this);
        happens(Event::up);
    }
    void leave() {
        std::erase(directory_->waiting, this);
        directory_->up.erase(number_);
        listener_ = nullptr;
    }
    void lose() {
        leave();
        happens(Event::down);
        directory_->waiting.push_back(this);
    }
    bool leadsTo(const QueueListener* listener) const { return listener_ == listener; }
    const std::string& endpoint() const { return endpoint_; }
    Queue& queue() { return queue_; }

  private:
    void happens(Event event) {
        happened_.push_back(event);
        events_.ring();
    }

    const std::shared_ptr<Directory> directory_;
    const std::string endpoint_, user_;
    QueueListener* listener_ = nullptr;
    std::string number_;
    Queue queue_;
    Bell events_;
    std::deque<Event> happened_;
    bool empty_ = false;
};

InProcess::QueueListener::~QueueListener() {
    const std::scoped_lock lock(directory_->mutex);
    if (const auto own = directory_->listeners.find(endpoint_);
        own != directory_->listeners.end() && own->second == this)
        directory_->listeners.erase(own);
    std::vector<QueueConnection*> ours;
    for (const auto& [number, connection] : directory_->up)
        if (connection->leadsTo(this)) ours.push_back(connection);
    for (QueueConnection* connection : ours) connection->lose();
}

bool InProcess::QueueListener::send(std::string_view to, std::span<const std::byte> first,
                                    std::span<const std::byte> second, const SharedBytes& owner) {
    const std::scoped_lock lock(directory_->mutex);
    const auto found = directory_->up.find(to);
    if (found == directory_->up.end() || !found->second->leadsTo(this)) return false;
    found->second->queue().push({}, {}, first, second, owner);
    return true;
}

InProcess::InProcess(Clock& clock) : clock_(clock), directory_(std::make_shared<Directory>()) {}
InProcess::~InProcess() = default;

Result<bool> InProcess::isLocal(const std::string& endpoint) const {
    if (endpoint.size() > kScheme.size() && endpoint.starts_with(kScheme)) return true;
    return fail(fmt::format("'{}' is no endpoint within a process: inproc://NAME", endpoint));
}

Result<std::unique_ptr<Listener>> InProcess::listen(const std::string& endpoint, const ListenSettings&) {
    if (const auto local = isLocal(endpoint); !local) return std::unexpected(local.error());
    auto listener = std::make_unique<QueueListener>(directory_, endpoint);
    const std::scoped_lock lock(directory_->mutex);
    if (!directory_->listeners.emplace(endpoint, listener.get()).second)
        return fail(fmt::format("cannot bind {}: Address already in use", endpoint));
    for (QueueConnection* connection : std::exchange(directory_->waiting, {})) connection->lookFor();
    return listener;
}

Result<std::unique_ptr<Connection>> InProcess::connect(const std::string& endpoint, const ConnectSettings& settings) {
    if (const auto local = isLocal(endpoint); !local) return std::unexpected(local.error());
    return std::make_unique<QueueConnection>(directory_, endpoint,
                                             settings.keys ? settings.keys->clientPublic.front() : std::string());
}

}  // namespace rtsg
