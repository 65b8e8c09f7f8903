// Acts as a mirror server towards a client of this process, with records from a NATS server.
#include <rtsg/nats/nats_subscriber.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <random>
#include <thread>

#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <rtsg/sync/mirror_request.h>

#include "link/open_nats.h"
#include "packet.h"
#include "record_chain.h"
#include "sockets/rare_warning.h"
#include "sockets/zmq_socket.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;
using nats::Packet;
using nats::RecordChain;

namespace {

constexpr auto kJoinAgain = 1s;  // without an answer to a join
constexpr auto kFramesAtMost = 500ms;
constexpr int kReadAtOnce = 256;  // messages, before the client gets a turn
constexpr std::size_t kMaxWarnings = 100;
constexpr std::uint64_t kSmallestCredit = 1 << 20;  // bytes

/// The published stream has limits, so wishes for less are refused.
const char* refusalOf(const mirror::Wishes& wishes) {
    if (wishes.partial()) return "over NATS whole scenes are published: parts, regions and aspects need ZeroMQ";
    if (wishes.inputs) return "over NATS states are published: inputs need ZeroMQ";
    if (wishes.milliFrames > 0 || wishes.rate > 0)
        return "over NATS every frame is published: limits of rate need ZeroMQ";
    if (wishes.whenSlow == static_cast<std::uint8_t>(MirrorWhenSlow::block))
        return "over NATS nobody holds up the scene: mirrors with --when-slow block need ZeroMQ";
    return nullptr;
}

}  // namespace

class NatsSubscriber::Impl {
  public:
    explicit Impl(NatsAddress address)
        : address_(std::move(address)),
          subjects_(address_.name),
          stop_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
          router_(context_, ZMQ_ROUTER) {}
    ~Impl() {
        if (thread_.joinable()) {
            (void)::eventfd_write(stop_, 1);
            thread_.join();
        }
        router_.close();
        std::error_code ignored;
        if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
        ::close(stop_);
    }
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    Result<> start(std::chrono::milliseconds patience);
    const std::string& endpoint() const { return endpoint_; }
    const std::string& address() const { return address_.shown; }
    NatsSubscriberStatistics statistics() const {
        const std::scoped_lock lock(mutex_);
        return shown_;
    }
    std::vector<Diagnostic> takeDiagnostics() {
        const std::scoped_lock lock(mutex_);
        return std::exchange(diagnostics_, {});
    }

  private:
    using Clock = std::chrono::steady_clock;
    enum class Mode : std::uint8_t {
        idle,       // no client has said hello
        joining,    // the server was asked for a state, or for missing records
        following,  // records come as they are published
        behind,     // the client has more than its window to read
    };

    Result<> bind();
    void run();
    bool poll();
    bool takeFromClient();
    void fromClient(std::string identity, std::span<const std::byte> first, const ZmqMessage& second);
    void hello(const std::string& identity, std::span<const std::byte> first);
    void acknowledged(std::span<const std::byte> first);
    bool takeFromNats();
    void fromNats(const NatsMessage& message);
    void live(const Packet& packet);
    void answerToJoin(const Packet& packet);
    void welcome(const Packet& packet);
    void data(const Packet& packet, bool joining);
    void answer(const Packet& packet);
    void join();
    void joined();
    void ask(std::span<const std::byte> first, std::span<const std::byte> second = {});
    bool toClient(std::span<const std::byte> first, std::span<const std::byte> second = {});
    void report(std::string text);
    void strange(const NatsMessage& message);
    void refuse(std::string_view why);
    void garbage() {
        if (auto reported = mirror::reportedOf(++statistics_.garbage, "ignored an invalid message"))
            report(std::move(*reported));
    }

    const NatsAddress address_;
    const NatsSubjects subjects_;
    const int stop_;  // eventfd
    std::string inbox_, endpoint_;
    std::filesystem::path folder_;  // of the local socket
    ZmqContext context_;
    ZmqSocket router_;
    std::unique_ptr<NatsLink> link_;
    NatsEvent news_;

    Mode mode_ = Mode::idle;
    std::string client_;  // identity of the client's connection
    mirror::Hello greeting_;
    bool welcomed_ = false;    // the client, in its session
    bool answering_ = false;   // the answer to a join has begun
    std::uint64_t epoch_ = 0;  // that the client is in, or was welcomed to
    RecordChain chain_;
    std::uint64_t sent_ = 0, acknowledged_ = 0;  // bytes of records in the client's session
    Clock::time_point askedAt_{};
    ByteBuffer message_, packet_;
    NatsSubscriberStatistics statistics_;
    std::thread thread_;
    mutable std::mutex mutex_;  // guards the members below
    NatsSubscriberStatistics shown_;
    std::vector<Diagnostic> diagnostics_;
};

Result<> NatsSubscriber::Impl::start(std::chrono::milliseconds patience) {
    auto link = openNatsLink(address_, "rtsg mirror", patience);
    if (!link) return std::unexpected(link.error());
    link_ = std::move(*link);
    std::random_device device;
    inbox_ = fmt::format("_INBOX.rtsg.{:08x}{:08x}", device(), device());
    for (const std::string& subject : {subjects_.live, inbox_})
        if (const std::string problem = link_->subscribe(subject); !problem.empty())
            return fail(withoutSecrets(problem, address_), {}, address_.shown);
    if (auto ok = bind(); !ok) return ok;
    thread_ = std::thread([this] { run(); });
    return {};
}

Result<> NatsSubscriber::Impl::bind() {
    std::error_code problem;
    std::string folder = (std::filesystem::temp_directory_path(problem) / "rtsg-nats-XXXXXX").string();
    if (problem || !::mkdtemp(folder.data()))
        return fail(fmt::format("no folder for a local socket: {}", std::generic_category().message(errno)));
    folder_ = folder;
    endpoint_ = "ipc://" + (folder_ / "mirror").string();
    router_.set(ZMQ_LINGER, 0);
    router_.set(ZMQ_SNDHWM, 0);  // bounded by the client's window
    if (zmq_bind(router_.get(), endpoint_.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot listen at {}", endpoint_)));
    return {};
}

void NatsSubscriber::Impl::run() {
    ::pthread_setname_np(::pthread_self(), "rtsg nats");
    try {
        while (poll()) continue;
        mirror::begin(message_, Message::bye);
        ask(message_.bytes());
        (void)link_->flush(500ms);
    } catch (const std::exception& e) {
        report(fmt::format("nothing is read any more: {}", e.what()));
    }
}

/// False once it shall end.
bool NatsSubscriber::Impl::poll() {
    bool any = takeFromClient();
    any = takeFromNats() || any;
    if (mode_ == Mode::joining && Clock::now() - askedAt_ > kJoinAgain) join();
    for (std::string& text : news_.take(*link_, address_)) report(std::move(text));
    statistics_.dropped = link_->dropped();
    {
        const std::scoped_lock lock(mutex_);
        shown_ = statistics_;
    }
    // Sending may lose ZeroMQ's notice, so its descriptor is waited for only when the socket has just been found empty.
    any = any || !router_.foundEmpty();
    pollfd items[] = {{stop_, POLLIN, 0}, {link_->descriptor(), POLLIN, 0}, {router_.descriptor(), POLLIN, 0}};
    (void)::poll(items, 3, any ? 0 : static_cast<int>(std::chrono::milliseconds(kFramesAtMost).count()));
    return (items[0].revents & POLLIN) == 0;
}

bool NatsSubscriber::Impl::takeFromClient() {
    for (int i = 0; i < kReadAtOnce; ++i) {
        ZmqMessage identity, first, second;
        if (!router_.receive(identity)) return i > 0;
        if (!identity.more() || !router_.receive(first)) continue;
        if (first.more()) router_.receive(second);
        if (second.more()) router_.skipRest(second);
        fromClient(identity.text(), first.bytes(), second);
    }
    return true;
}

void NatsSubscriber::Impl::fromClient(std::string identity, std::span<const std::byte> first,
                                      const ZmqMessage& second) {
    wire::Reader in(first);
    const auto type = mirror::readPrologue(in);
    if (!type) return;
    if (*type == Message::hello) return hello(identity, first);
    if (identity != client_) {
        // A client that has another connection now, or none of ours.
        client_ = std::move(identity);
        mirror::begin(message_, Message::unknown);
        toClient(message_.bytes());
        mode_ = Mode::idle;
        return;
    }
    switch (*type) {
        case Message::ack:
            return acknowledged(first);
        case Message::pong:
            return;
        case Message::bye:
            mode_ = Mode::idle;
            return;
        default:
            return ask(first, second.bytes());
    }
}

void NatsSubscriber::Impl::hello(const std::string& identity, std::span<const std::byte> first) {
    client_ = identity;
    wire::Reader in(first.subspan(mirror::kPrologue));
    mirror::Hello greeting;
    if (!greeting.read(in)) return;
    if (const char* why = refusalOf(greeting.wishes)) return refuse(why);
    greeting_ = std::move(greeting);
    welcomed_ = false;
    epoch_ = greeting_.epoch;
    chain_.set(greeting_.epoch ? greeting_.sequence : 0, greeting_.wishes.hash);
    sent_ = acknowledged_ = 0;
    join();
}

void NatsSubscriber::Impl::acknowledged(std::span<const std::byte> first) {
    wire::Reader in(first.subspan(mirror::kPrologue));
    std::uint64_t numbers[3];  // session, state, bytes
    if (!mirror::read(in, numbers) || numbers[0] != greeting_.session) return;
    acknowledged_ = std::min(numbers[2], sent_);
    if (mode_ == Mode::behind && sent_ - acknowledged_ <= greeting_.window / 2) join();
}

/// Asks for the records that follow the client's state.
void NatsSubscriber::Impl::join() {
    ++statistics_.joins;
    mode_ = Mode::joining;
    answering_ = false;
    askedAt_ = Clock::now();
    (void)link_->subscribe(subjects_.state);
    mirror::Hello greeting = greeting_;
    greeting.epoch = chain_.state() ? epoch_ : 0;
    greeting.sequence = chain_.state();
    greeting.wishes.hash = chain_.hash();
    greeting.write(message_);
    ask(message_.bytes());
}

void NatsSubscriber::Impl::joined() {
    mode_ = Mode::following;
    link_->unsubscribe(subjects_.state);
}

bool NatsSubscriber::Impl::takeFromNats() {
    NatsMessage message;
    for (int i = 0; i < kReadAtOnce; ++i) {
        if (!link_->take(message)) return i > 0;
        ++statistics_.messages;
        fromNats(message);
    }
    return true;
}

void NatsSubscriber::Impl::fromNats(const NatsMessage& message) {
    const auto packet = nats::unpack(message.bytes);
    if (!packet) return strange(message);
    if (mode_ == Mode::idle) return;
    if (message.subject == subjects_.live) return live(*packet);
    const bool ofJoin = packet->type == Message::welcome || packet->type == Message::ping ||
                        (packet->type == Message::data && nats::sessionOf(packet->first) == 0);
    if (ofJoin) return answerToJoin(*packet);
    if (message.subject == inbox_) return answer(*packet);
    garbage();
}

/// A publisher of another version refuses the client in words, if it knows how versions meet.
void NatsSubscriber::Impl::strange(const NatsMessage& message) {
    const auto foreign = nats::foreign(message.bytes);
    const bool refuses = foreign && mirror::foreignType(foreign->first) == Message::refused;
    if (!foreign || mode_ != Mode::joining || (refuses && message.subject != inbox_)) return garbage();
    std::string why = mirror::versionText(foreign->version);
    if (refuses) {
        wire::Reader in(foreign->first.subspan(mirror::kPrologue));
        if (const std::string_view said = in.text(); !in.problem) why = said;
    }
    refuse(why);
}

void NatsSubscriber::Impl::refuse(std::string_view why) {
    mirror::begin(message_, Message::refused);
    wire::putText(message_, why);
    message_.put(std::uint8_t{1});
    toClient(message_.bytes());
    mode_ = Mode::idle;
}

void NatsSubscriber::Impl::live(const Packet& packet) {
    switch (packet.type) {
        case Message::data:
            if (mode_ == Mode::following) data(packet, false);
            return;
        case Message::ping: {
            // The client must not take records as lost that it has not had from us yet.
            wire::Reader in = packet.fields();
            std::uint64_t numbers[3] = {0, 0, 0};  // state sent, state of the scene, 1: the origin is lost
            if (!mirror::read(in, numbers)) return garbage();
            if (mode_ == Mode::following && !chain_.within() && numbers[0] > chain_.state()) {
                ++statistics_.gaps;
                return join();
            }
            numbers[0] = std::min(numbers[0], chain_.state());
            mirror::write(message_, Message::ping, numbers);
            if (welcomed_) toClient(message_.bytes());
            return;
        }
        case Message::bye:
            if (welcomed_) toClient(packet.first);
            return;
        case Message::unknown:
            return join();
        default:
            return garbage();
    }
}

void NatsSubscriber::Impl::answerToJoin(const Packet& packet) {
    if (mode_ != Mode::joining) return;
    if (packet.type == Message::welcome) return welcome(packet);
    if (!answering_) return;  // the rest of an answer that had begun before we asked
    if (packet.type == Message::data) return data(packet, true);
    joined();
}

/// The client is welcomed once in a session. Another epoch makes it say hello again.
void NatsSubscriber::Impl::welcome(const Packet& packet) {
    wire::Reader in = packet.fields();
    std::uint64_t numbers[3];  // session, epoch, heartbeat
    if (!mirror::read(in, numbers)) return garbage();
    answering_ = true;
    if (welcomed_ && numbers[1] == epoch_) return;
    if (welcomed_) {
        mirror::begin(message_, Message::unknown);
        toClient(message_.bytes());
        mode_ = Mode::idle;
        return;
    }
    if (numbers[1] != epoch_) chain_.set(0, {});
    epoch_ = numbers[1];
    ByteBuffer own;
    nats::withSession(own, packet.first, greeting_.session);
    welcomed_ = toClient(own.bytes(), packet.second);
}

void NatsSubscriber::Impl::data(const Packet& packet, bool joining) {
    wire::Reader in = packet.fields();
    std::uint64_t numbers[4];  // session, size, offset, published
    if (!mirror::read(in, numbers)) return garbage();
    const std::uint64_t window = std::max(greeting_.window, kSmallestCredit);
    if (numbers[2] == 0 && sent_ - acknowledged_ > window) {
        // Records that come while the client is behind are requested later.
        mode_ = Mode::behind;
        link_->unsubscribe(subjects_.state);
        return;
    }
    switch (chain_.add(numbers[1], numbers[2], packet.second, joining)) {
        case RecordChain::Step::pass:
            break;
        case RecordChain::Step::gap:
            ++statistics_.gaps;
            if (!joining) join();
            return;
        case RecordChain::Step::rubbish:
            return garbage();
        case RecordChain::Step::old:
        case RecordChain::Step::repair:
            return;
    }
    sent_ += packet.second.size();
    ByteBuffer own;
    nats::withSession(own, packet.first, greeting_.session);
    toClient(own.bytes(), packet.second);
}

/// Handles the server's answers to this client alone, with its session.
void NatsSubscriber::Impl::answer(const Packet& packet) {
    switch (packet.type) {
        case Message::unknown:
            return join();  // the publisher is another one
        case Message::data:
            if (nats::sessionOf(packet.first) == greeting_.session) sent_ += packet.second.size();
            [[fallthrough]];
        case Message::pong:
        case Message::refused:
        case Message::digest:
        case Message::anatomy:
        case Message::verdict:
        case Message::reply:
            toClient(packet.first, packet.second);
            return;
        default:
            return garbage();
    }
}

void NatsSubscriber::Impl::ask(std::span<const std::byte> first, std::span<const std::byte> second) {
    nats::pack(packet_, first, second);
    (void)link_->publish(subjects_.ask, inbox_, packet_.bytes());
}

bool NatsSubscriber::Impl::toClient(std::span<const std::byte> first, std::span<const std::byte> second) {
    ZmqMessage to(std::as_bytes(std::span(client_.data(), client_.size()))), head(first), body(second);
    return router_.send(to, true) && router_.send(head, !second.empty()) && (second.empty() || router_.send(body));
}

void NatsSubscriber::Impl::report(std::string text) {
    const std::scoped_lock lock(mutex_);
    if (diagnostics_.size() < kMaxWarnings)
        diagnostics_.push_back({Severity::warning, address_.shown, {}, std::move(text)});
}

NatsSubscriber::NatsSubscriber(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NatsSubscriber::~NatsSubscriber() = default;

Result<std::unique_ptr<NatsSubscriber>> NatsSubscriber::start(const std::string& address,
                                                              std::chrono::milliseconds patience) {
    auto parsed = NatsAddress::parse(address);
    if (!parsed) return std::unexpected(parsed.error());
    auto impl = std::make_unique<Impl>(std::move(*parsed));
    if (auto ok = impl->start(patience); !ok) return std::unexpected(ok.error());
    return std::unique_ptr<NatsSubscriber>(new NatsSubscriber(std::move(impl)));
}

const std::string& NatsSubscriber::endpoint() const {
    return impl_->endpoint();
}
const std::string& NatsSubscriber::address() const {
    return impl_->address();
}
NatsSubscriberStatistics NatsSubscriber::statistics() const {
    return impl_->statistics();
}
std::vector<Diagnostic> NatsSubscriber::takeDiagnostics() {
    return impl_->takeDiagnostics();
}

}  // namespace rtsg
