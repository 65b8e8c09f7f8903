// Publishes what a mirror server sends to NATS, as a listener of that server whose peers read the same.
#include <rtsg/nats/nats_publisher.h>

#include <deque>
#include <mutex>

#include <poll.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/worker.h>
#include <rtsg/sync/record.h>

#include "link/open_nats.h"
#include "packet.h"
#include "transport/transport.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::size_t kHeadroom = 256;                                // bytes of a message beside a part of a record
constexpr std::size_t kLongestAsked = mirror::kSubmitPart + 8 * 512;  // bytes of a message
constexpr std::size_t kMaxDiagnostics = 100;
constexpr const char* kInboxes = "_INBOX.";  // where answers go

}  // namespace

/// The publisher's and its listener's. What the server sends is published on a thread of its own, as a NATS server may
/// hang.
class NatsPublisher::Impl {
  public:
    Impl(NatsAddress address, std::string user)
        : address_(std::move(address)), subjects_(address_.name), user_(std::move(user)) {}

    Result<> start();
    /// What was sent so far is published; nothing is sent any more.
    void end();
    const std::string& address() const { return address_.shown; }
    NatsPublisherStatistics statistics() const {
        const std::scoped_lock lock(mutex_);
        return statistics_;
    }
    std::vector<Diagnostic> takeDiagnostics();

    // For the listener, on the server's thread.
    std::array<int, 2> descriptors() const { return {link_->descriptor(), answers_.get()}; }
    std::size_t maxOfPart() const { return link_->maxPayload() - kHeadroom; }
    bool receive(Received& message);
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner);

  private:
    void takeNews();
    void publish(const std::string& subject, std::span<const std::byte> first, std::span<const std::byte> second);
    void answer(Message type, bool isLive, std::span<const std::byte> first, std::span<const std::byte> second);

    const NatsAddress address_;
    const NatsSubjects subjects_;
    const std::string user_;
    std::unique_ptr<NatsLink> link_;
    NatsMessage taken_;
    ByteBuffer said_;
    ByteBuffer packet_;                             // for the worker only, as the next two
    std::uint64_t published_ = 0, publishing_ = 0;  // bytes of records; the state after the one that goes out
    std::uint64_t state_ = 0;                       // that has gone out
    Wakeup answers_;
    mutable std::mutex mutex_;  // guards what follows
    bool ended_ = false, reported_ = false;
    std::deque<ByteBuffer> waiting_;  // for the server: acknowledgements
    NatsEvent news_;
    std::vector<Diagnostic> diagnostics_;
    NatsPublisherStatistics statistics_;
    Worker worker_{"rtsg nats"};  // last: its jobs use the others
};

/// All peers are one for it: the NATS server says where answers go.
class NatsPublisher::NatsListener : public Listener {
  public:
    explicit NatsListener(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    const std::string& endpoint() const override { return impl_->address(); }
    Clock::duration prepare(Items items, bool) override {
        const auto [messages, answers] = impl_->descriptors();
        items[0] = {messages, POLLIN, 0};
        items[1] = {answers, POLLIN, 0};
        for (std::size_t i = 2; i < kDescriptors; ++i) items[i] = {-1, 0, 0};
        return std::chrono::hours(1);
    }
    bool came(Items items) override { return items[0].revents != 0 || items[1].revents != 0; }
    bool receive(Received& message) override { return impl_->receive(message); }
    Failures received(bool) override { return {}; }
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) override {
        return impl_->send(to, first, second, owner);
    }
    std::size_t broadcasts() const override { return impl_->maxOfPart(); }

  private:
    const std::shared_ptr<Impl> impl_;
};

Result<> NatsPublisher::Impl::start() {
    auto link = openNatsLink(address_, "rtsg serve");
    if (!link) return std::unexpected(link.error());
    link_ = std::move(*link);
    if (const std::string problem = link_->subscribe(subjects_.ask); !problem.empty())
        return fail(withoutSecrets(problem, address_), {}, address_.shown);
    return {};
}

void NatsPublisher::Impl::end() {
    {
        const std::scoped_lock lock(mutex_);
        ended_ = true;
    }
    link_->unsubscribe(subjects_.ask);
    worker_.finish();
    (void)link_->flush(1s);
}

/// With `mutex_` held. What happens to the connection is found by looking often.
void NatsPublisher::Impl::takeNews() {
    for (std::string& text : news_.take(*link_, address_))
        if (diagnostics_.size() < kMaxDiagnostics)
            diagnostics_.push_back({Severity::warning, address_.shown, {}, std::move(text)});
}

std::vector<Diagnostic> NatsPublisher::Impl::takeDiagnostics() {
    const std::scoped_lock lock(mutex_);
    takeNews();
    std::vector<Diagnostic> result = std::exchange(diagnostics_, {});
    if (const auto ok = worker_.failure("not everything was published"); !ok && !std::exchange(reported_, true))
        result.push_back({Severity::error, address_.shown, {}, ok.error().text});
    return result;
}

/// What comes from outside has the inbox of its sender. Who may only ask shall not make us publish where mirrors
/// believe what comes.
bool NatsPublisher::Impl::receive(Received& message) {
    message = {};
    const std::scoped_lock lock(mutex_);
    if (!waiting_.empty()) {
        said_.swap(waiting_.front());
        waiting_.pop_front();
        message.first = said_.bytes();
        return true;
    }
    answers_.clear();
    if (!link_->take(taken_)) return false;
    ++statistics_.asked;
    const auto parts = nats::split(taken_.bytes);
    if (!parts || !taken_.reply.starts_with(kInboxes) || taken_.bytes.size() > kLongestAsked) {
        ++statistics_.garbage;
        message.problem = "an invalid message";
        return true;
    }
    message.from = taken_.reply;
    message.user = user_;
    message.first = parts->first;
    message.second = parts->second;
    return true;
}

bool NatsPublisher::Impl::send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
                               const SharedBytes& owner) {
    {
        const std::scoped_lock lock(mutex_);
        if (ended_) return false;
    }
    const std::string subject = to == Listener::kFollowers ? subjects_.live
                                : to == Listener::kJoiners ? subjects_.state
                                                           : std::string(to);
    std::vector<std::byte> copy(first.begin(), first.end());
    if (owner)
        worker_.start([this, subject, copy = std::move(copy), second, owner] { publish(subject, copy, second); });
    else
        worker_.start([this, subject, copy = std::move(copy), more = std::vector(second.begin(), second.end())] {
            publish(subject, copy, more);
        });
    return true;
}

void NatsPublisher::Impl::publish(const std::string& subject, std::span<const std::byte> first,
                                  std::span<const std::byte> second) {
    nats::pack(packet_, first, second);
    const std::string problem = link_->publish(subject, "", packet_.bytes());
    const auto type = static_cast<Message>(first[5]);
    const bool isLive = subject == subjects_.live;
    if (type == Message::bye) (void)link_->flush(1s);
    if (type == Message::unknown && isLive) state_ = 0;  // states have other numbers from here on
    {
        const std::scoped_lock lock(mutex_);
        takeNews();
        ++(problem.empty() ? statistics_.messages : statistics_.failed);
        if (type == Message::data && nats::sessionOf(first) == 0) statistics_.bytes += second.size();
        if (type == Message::welcome) ++(subject == subjects_.state ? statistics_.states : statistics_.resumed);
    }
    if (type == Message::data || type == Message::bye) answer(type, isLive, first, second);
}

/// Tells the server what has gone out, as if a peer had read it.
void NatsPublisher::Impl::answer(Message type, bool isLive, std::span<const std::byte> first,
                                 std::span<const std::byte> second) {
    ByteBuffer message;
    if (type == Message::data) {
        wire::Reader in(first.subspan(mirror::kPrologue));
        std::uint64_t numbers[3] = {};  // session, size, offset
        (void)mirror::read(in, numbers);
        published_ += second.size();
        if (numbers[2] == 0 && isLive)
            if (const auto header = parseRecordHeader(second, 0, kMaxPayload)) publishing_ = header->to;
        const bool isWhole = isLive && numbers[2] + second.size() == numbers[1];
        if (isWhole) state_ = publishing_;
        const std::uint64_t acknowledged[] = {0, state_, published_};
        mirror::write(message, Message::ack, acknowledged);
        const std::scoped_lock lock(mutex_);
        statistics_.records += isWhole;
        waiting_.push_back(std::move(message));
    } else {
        mirror::begin(message, type);
        const std::scoped_lock lock(mutex_);
        waiting_.push_back(std::move(message));
    }
    answers_.raise();
}

NatsPublisher::NatsPublisher(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
NatsPublisher::~NatsPublisher() {
    impl_->end();
}

Result<std::unique_ptr<NatsPublisher>> NatsPublisher::start(MirrorServer& server, NatsPublisherOptions options) {
    auto address = NatsAddress::parse(options.address);
    if (!address) return std::unexpected(address.error());
    if (options.keys)
        if (auto ok = options.keys->checkForClient(); !ok)
            return fail("NATS needs a client's keys in the key file: " + ok.error().text);
    auto impl =
        std::make_shared<Impl>(std::move(*address), options.keys ? options.keys->clientPublic.front() : std::string());
    if (auto ok = impl->start(); !ok) return std::unexpected(ok.error());
    server.admit(std::make_unique<NatsListener>(impl));
    return std::unique_ptr<NatsPublisher>(new NatsPublisher(std::move(impl)));
}

const std::string& NatsPublisher::address() const {
    return impl_->address();
}
NatsPublisherStatistics NatsPublisher::statistics() const {
    return impl_->statistics();
}
std::vector<Diagnostic> NatsPublisher::takeDiagnostics() {
    return impl_->takeDiagnostics();
}

}  // namespace rtsg
