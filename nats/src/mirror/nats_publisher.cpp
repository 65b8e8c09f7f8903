// Publishes the records of a mirror server to NATS, and keyframes to mirrors that join.
#include <rtsg/nats/nats_publisher.h>

#include <algorithm>
#include <mutex>
#include <random>

#include <fmt/format.h>
#include <poll.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/worker.h>
#include <rtsg/sync/change_codec.h>

#include "asking_mirrors.h"
#include "link/open_nats.h"
#include "server/history.h"
#include "sockets/rare_warning.h"
#include "transport/in_process.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;
using nats::Packet;

namespace {

constexpr std::size_t kHeadroom = 256;                   // bytes of a message beside a part of a record
constexpr std::uint64_t kNear = 256 << 10;               // bytes of frames behind a keyframe that is published
constexpr std::uint64_t kFar = std::uint64_t{16} << 20;  // after these another keyframe is taken anyway
constexpr auto kJoinersGather = 50ms;                    // from one publication of the state to the next
// A short question may have a long answer, and anybody may ask.
constexpr double kAnswersAtOnce = 128e6, kAnswersPerSecond = 32e6;  // bytes
constexpr auto kSleep = 500ms;                                      // at most
constexpr auto kFetchWithin = 10s;                                  // a keyframe
constexpr int kAtOnce = 256;                                        // messages of mirrors, before others get a turn
constexpr std::size_t kMaxDiagnostics = 100;
constexpr const char* kInboxes = "_INBOX.";  // where answers go

std::uint64_t anyNumber() {
    std::random_device device;
    return std::uint64_t{device()} << 32 | device();
}

}  // namespace

class NatsPublisher::Impl {
  public:
    Impl(NatsPublisherOptions options, NatsAddress address)
        : options_(std::move(options)),
          address_(std::move(address)),
          subjects_(address_.name),
          typesHash_(ChangeDecoder(builtinTypes()).localHash()),
          history_(options_.history),
          server_(settings(anyNumber()), heardByStream()),
          mirrors_(server_, typesHash_,
                   [this](const std::string& inbox, std::span<const std::byte> first,
                          std::span<const std::byte> second) { publish(inbox, first, second); }) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    Result<> start();
    const std::string& address() const { return address_.shown; }
    NatsPublisherStatistics statistics() const {
        const std::scoped_lock lock(mutex_);
        return shown_;
    }
    std::vector<Diagnostic> takeDiagnostics() {
        const std::scoped_lock lock(mutex_);
        return std::exchange(diagnostics_, {});
    }

  private:
    nats::ServerStream::Settings settings(std::uint64_t client) const {
        return {options_.transport, options_.endpoint, "nats", options_.keys, typesHash_, client};
    }
    nats::ServerStream::Heard heardByStream();
    void run();
    bool poll();
    bool takeAsked();
    bool ask(const NatsMessage& message);
    bool hello(const std::string& inbox, const Packet& packet);
    bool refuseForeign(const NatsMessage& message);
    void welcomed(bool sameEpoch);
    void record(const SharedRecord& record);
    void fetchKeyframe(Clock::time_point now);
    void publishState(Clock::time_point now);
    void publishWelcome(const std::string& subject);
    void publishRecord(const std::string& subject, const EncodedRecord& record);
    void publishEnd(const std::string& subject);
    void publish(const std::string& subject, std::span<const std::byte> first, std::span<const std::byte> second = {});
    void report(Severity severity, std::string text);
    std::size_t maxOfPart() const { return link_->maxPayload() - kHeadroom; }

    const NatsPublisherOptions options_;
    const NatsAddress address_;
    const NatsSubjects subjects_;
    const std::uint64_t typesHash_;
    Wakeup stop_;
    std::unique_ptr<NatsLink> link_;
    NatsEvent news_;
    MirrorHistory history_;
    nats::ServerStream server_;
    nats::AskingMirrors mirrors_;
    std::unique_ptr<nats::ServerStream> fetch_;  // while a keyframe is fetched
    SharedRecord fetched_;
    Clock::time_point fetchBegan_{}, statePublished_{};
    bool stateWanted_ = false;
    double allowance_ = kAnswersAtOnce;  // bytes of answers to hellos
    Clock::time_point allowed_{};
    ByteBuffer message_, packet_;
    NatsPublisherStatistics statistics_;
    mutable std::mutex mutex_;  // guards the members below
    NatsPublisherStatistics shown_;
    std::vector<Diagnostic> diagnostics_;
    Worker worker_{"rtsg nats"};  // last: its job uses the others
};

Result<> NatsPublisher::Impl::start() {
    if (options_.keys)
        if (auto ok = options_.keys->checkForClient(); !ok)
            return fail("NATS needs a client's keys in the key file: " + ok.error().text);
    auto link = openNatsLink(address_, "rtsg serve");
    if (!link) return std::unexpected(link.error());
    link_ = std::move(*link);
    if (const std::string problem = link_->subscribe(subjects_.ask); !problem.empty())
        return fail(withoutSecrets(problem, address_), {}, address_.shown);
    if (auto ok = server_.connect(); !ok) return ok;
    worker_.run([this] { run(); }, [this] { stop_.raise(); });
    return {};
}

nats::ServerStream::Heard NatsPublisher::Impl::heardByStream() {
    nats::ServerStream::Heard heard;
    heard.welcome = [this](bool sameEpoch) { welcomed(sameEpoch); };
    heard.record = [this](const SharedRecord& given) { record(given); };
    heard.other = [this](const Packet& packet) {
        if (packet.type == Message::ping || packet.type == Message::bye) publish(subjects_.live, packet.first);
        mirrors_.answered(packet);
    };
    heard.refused = [this](const std::string& why) { report(Severity::warning, "the server refuses us: " + why); };
    return heard;
}

void NatsPublisher::Impl::run() {
    try {
        while (poll()) continue;
        (void)link_->flush(1s);
    } catch (const std::exception& e) {
        report(Severity::error, fmt::format("nothing is published any more: {}", e.what()));
    }
}

/// False once it shall end. Descriptors are waited for only when everything has been found empty, since sending may
/// lose ZeroMQ's notice.
bool NatsPublisher::Impl::poll() {
    const Clock::time_point now = steadyClock().now();
    server_.poll(now);
    if (fetch_) fetch_->poll(now);
    mirrors_.poll(now);
    fetchKeyframe(now);
    publishState(now);
    bool any = false;
    while (server_.receive()) any = true;
    while (fetch_ && fetch_->receive()) any = true;
    any = takeAsked() || any;
    for (std::string& text : news_.take(*link_, address_)) report(Severity::warning, std::move(text));
    {
        const std::scoped_lock lock(mutex_);
        shown_ = statistics_;
    }
    pollfd items[] = {{stop_.get(), POLLIN, 0},
                      {link_->descriptor(), POLLIN, 0},
                      {server_.descriptors()[0], POLLIN, 0},
                      {server_.descriptors()[1], POLLIN, 0},
                      {fetch_ ? fetch_->descriptors()[0] : -1, POLLIN, 0},
                      {fetch_ ? fetch_->descriptors()[1] : -1, POLLIN, 0}};
    const std::chrono::milliseconds maximum = any ? 0ms : stateWanted_ ? 10ms : kSleep;
    (void)::poll(items, std::size(items), static_cast<int>(maximum.count()));
    return (items[0].revents & POLLIN) == 0;
}

bool NatsPublisher::Impl::takeAsked() {
    NatsMessage message;
    for (int i = 0; i < kAtOnce; ++i) {
        if (!link_->take(message)) return i > 0;
        ++statistics_.asked;
        if (ask(message)) continue;
        if (auto reported = mirror::reportedOf(++statistics_.garbage, "ignored an invalid message"))
            report(Severity::warning, std::move(*reported));
    }
    return true;
}

/// Returns false if the message is invalid. Such messages are only counted, since anybody may send them.
bool NatsPublisher::Impl::ask(const NatsMessage& message) {
    const auto packet = nats::unpack(message.bytes);
    // Who may only ask shall not make us publish where mirrors believe what comes.
    if (!message.reply.starts_with(kInboxes)) return false;
    if (!packet) return refuseForeign(message);
    if (packet->type == Message::hello) return hello(message.reply, *packet);
    if (packet->type != Message::ping) return mirrors_.take(message.reply, *packet, steadyClock().now());
    wire::Reader in = packet->fields();
    std::uint64_t token[1];
    if (!mirror::read(in, token)) return false;
    mirrors_.pinged(message.reply, steadyClock().now());
    const std::uint64_t answer[] = {token[0], steadyClock().nanoseconds()};
    mirror::write(message_, Message::pong, answer);
    publish(message.reply, message_.bytes());
    return true;
}

/// Returns false if it is no hello of another version.
bool NatsPublisher::Impl::refuseForeign(const NatsMessage& message) {
    const auto foreign = nats::foreign(message.bytes);
    if (!foreign || mirror::foreignType(foreign->first) != Message::hello) return false;
    mirror::refuseVersion(message_, foreign->version);
    publish(message.reply, message_.bytes());
    return true;
}

bool NatsPublisher::Impl::hello(const std::string& inbox, const Packet& packet) {
    mirror::Hello greeting;
    wire::Reader in = packet.fields();
    if (!greeting.read(in)) return false;
    if (!mirrors_.greeted(inbox, greeting)) {
        mirror::begin(message_, Message::refused);
        wire::putText(message_, "the server has as many mirrors as it takes");
        message_.put(std::uint8_t{0});
        publish(inbox, message_.bytes());
        return true;
    }
    const bool resumes = greeting.epoch != 0 && greeting.epoch == server_.epoch() && !history_.empty() &&
                         history_.continues(greeting.sequence, greeting.wishes.hash);
    if (!resumes) return stateWanted_ = true;
    const double size = static_cast<double>(history_.bytesFrom(greeting.sequence));
    if (allowance_ < 0) return true;  // it asks again
    allowance_ -= size;
    ++statistics_.resumed;
    publishWelcome(inbox);
    for (const SharedRecord& missed : history_.framesFrom(greeting.sequence, SIZE_MAX)) publishRecord(inbox, *missed);
    publishEnd(inbox);
    return true;
}

void NatsPublisher::Impl::welcomed(bool sameEpoch) {
    if (!sameEpoch) {
        history_.clear();
        fetch_.reset();
        fetched_.reset();
        // Whoever followed the run before has to join this one.
        mirror::begin(message_, Message::unknown);
        publish(subjects_.live, message_.bytes());
    }
    mirrors_.welcomed(sameEpoch);
}

void NatsPublisher::Impl::record(const SharedRecord& record) {
    const RecordHeader& header = record->header;
    if (header.from == header.to) return mirrors_.repaired(record, maxOfPart());
    const bool jumps = header.from == 0 && history_.newest() != header.to && !history_.empty();
    if (jumps) history_.clear();
    if (!history_.add(record)) return;
    ++statistics_.records;
    // A keyframe goes only to those who ask: mirrors that follow have its state, or notice the gap.
    if (header.from != 0) publishRecord(subjects_.live, *record);
}

/// The server keeps a keyframe ready, so one costs the scene nothing.
void NatsPublisher::Impl::fetchKeyframe(Clock::time_point now) {
    if (fetched_ && history_.continues(fetched_->header.to)) {
        history_.setKeyframe(std::exchange(fetched_, nullptr));
        fetch_.reset();
    }
    if (fetch_ && now - fetchBegan_ > kFetchWithin) fetch_.reset();
    if (fetch_ || history_.empty() || !server_.welcomed()) return;
    const SharedRecord keyframe = history_.keyframe();
    const std::uint64_t behind = keyframe ? history_.bytesFrom(keyframe->header.to) : 0;
    const bool near = keyframe && behind <= keyframe->bytes.size() + kNear;
    if (near || (!stateWanted_ && keyframe && behind < std::max(kFar, 2 * keyframe->bytes.size()))) return;
    nats::ServerStream::Heard heard;
    heard.record = [this](const SharedRecord& given) {
        if (!fetched_ && given->header.from == 0 && fetch_->epoch() == server_.epoch()) fetched_ = given;
    };
    fetchBegan_ = now;
    fetched_.reset();
    fetch_ = std::make_unique<nats::ServerStream>(settings(0), std::move(heard));
    if (!fetch_->connect()) fetch_.reset();
}

void NatsPublisher::Impl::publishState(Clock::time_point now) {
    allowance_ = std::min(kAnswersAtOnce,
                          allowance_ + std::chrono::duration<double>(now - allowed_).count() * kAnswersPerSecond);
    allowed_ = now;
    if (!stateWanted_ || fetch_ || !server_.welcomed() || now - statePublished_ < kJoinersGather) return;
    const SharedRecord keyframe = history_.keyframe();
    if (!keyframe || allowance_ < 0) return;
    allowance_ -= static_cast<double>(keyframe->bytes.size() + history_.bytesFrom(keyframe->header.to));
    stateWanted_ = false;
    ++statistics_.states;
    publishWelcome(subjects_.state);
    publishRecord(subjects_.state, *keyframe);
    for (const SharedRecord& later : history_.framesFrom(keyframe->header.to, SIZE_MAX))
        publishRecord(subjects_.state, *later);
    publishEnd(subjects_.state);
    statePublished_ = steadyClock().now();
}

void NatsPublisher::Impl::publishWelcome(const std::string& subject) {
    const std::uint64_t numbers[] = {0, server_.epoch(), server_.heartbeat(), history_.newest()};
    mirror::write(message_, Message::welcome, numbers);
    publish(subject, message_.bytes(), server_.head().bytes());
}

void NatsPublisher::Impl::publishRecord(const std::string& subject, const EncodedRecord& record) {
    const std::span<const std::byte> whole = record.bytes.bytes();
    for (std::size_t sent = 0; sent < whole.size();) {
        const auto part = whole.subspan(sent, std::min(maxOfPart(), whole.size() - sent));
        const std::uint64_t numbers[] = {0, whole.size(), sent, record.published, 1};
        mirror::write(message_, Message::data, numbers);
        publish(subject, message_.bytes(), part);
        sent += part.size();
    }
    statistics_.bytes += whole.size();
}

/// Publishes the state that the records so far lead to.
void NatsPublisher::Impl::publishEnd(const std::string& subject) {
    const std::uint64_t token[] = {history_.newest(), history_.newest(), 0};
    mirror::write(message_, Message::ping, token);
    publish(subject, message_.bytes());
}

void NatsPublisher::Impl::publish(const std::string& subject, std::span<const std::byte> first,
                                  std::span<const std::byte> second) {
    nats::pack(packet_, first, second);
    const std::string problem = link_->publish(subject, "", packet_.bytes());
    ++(problem.empty() ? statistics_.messages : statistics_.failed);
}

void NatsPublisher::Impl::report(Severity severity, std::string text) {
    const std::scoped_lock lock(mutex_);
    if (diagnostics_.size() < kMaxDiagnostics) diagnostics_.push_back({severity, address_.shown, {}, std::move(text)});
}

NatsPublisher::NatsPublisher(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NatsPublisher::~NatsPublisher() = default;

Result<std::unique_ptr<NatsPublisher>> NatsPublisher::start(MirrorServer& server, NatsPublisherOptions options) {
    options.endpoint = "inproc://nats";
    options.transport = std::make_shared<InProcess>();
    auto listener = options.transport->listen(options.endpoint, {});
    if (!listener) return std::unexpected(listener.error());
    auto publisher = start(std::move(options));
    if (publisher) server.admit(std::move(*listener));
    return publisher;
}

Result<std::unique_ptr<NatsPublisher>> NatsPublisher::start(NatsPublisherOptions options) {
    if (!options.transport) options.transport = zmqTransport();
    auto address = NatsAddress::parse(options.address);
    if (!address) return std::unexpected(address.error());
    auto impl = std::make_unique<Impl>(std::move(options), std::move(*address));
    if (auto ok = impl->start(); !ok) return std::unexpected(ok.error());
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
