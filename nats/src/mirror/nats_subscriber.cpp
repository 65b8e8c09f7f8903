// Follows a session at a NATS server in the place of a connection to a mirror server.
#include <rtsg/nats/nats_subscriber.h>

#include <algorithm>
#include <mutex>
#include <random>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/sync/record.h>

#include "link/open_nats.h"
#include "packet.h"
#include "sockets/rare_warning.h"
#include "transport/transport.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;
using nats::Packet;

namespace {

constexpr std::size_t kMaxWarnings = 100;
constexpr std::uint64_t kSmallestWindow = 1 << 20;  // bytes

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

/// What a subscriber and the connection of its client have in common.
struct NatsSession {
    explicit NatsSession(NatsAddress at) : address(std::move(at)), subjects(address.name) {}

    void report(std::string text) {
        if (diagnostics.size() < kMaxWarnings)
            diagnostics.push_back({Severity::warning, address.shown, {}, std::move(text)});
    }
    void takeNews() {
        const std::scoped_lock lock(mutex);
        for (std::string& text : news.take(*link, address)) report(std::move(text));
        statistics.dropped = link->dropped();
    }

    const NatsAddress address;
    const NatsSubjects subjects;
    std::string inbox;
    std::unique_ptr<NatsLink> link;
    std::mutex mutex;  // guards what follows
    NatsEvent news;
    NatsSubscriberStatistics statistics;
    std::vector<Diagnostic> diagnostics;
};

/// Follows in the place of a mirror server: what the client says becomes questions to the publisher, and what is
/// published becomes messages of the client's session.
class NatsConnection : public Connection {
  public:
    explicit NatsConnection(std::shared_ptr<NatsSession> session)
        : session_(std::move(session)), link_(*session_->link) {
        connected_.raise();
    }
    ~NatsConnection() override {
        (void)link_.flush(500ms);  // the client's goodbye
    }

    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override;
    bool receive(Received& message) override;
    bool foundEmpty() const override {
        session_->takeNews();  // this is asked before each wait, and nothing comes by a connection that is lost
        return empty_ && !refused_;
    }
    std::array<int, 2> descriptors() const override { return {link_.descriptor(), connected_.get()}; }
    Event nextEvent() override { return connected_.clear() ? Event::up : Event::none; }
    void reconnect(std::chrono::milliseconds) override { connected_.raise(); }

  private:
    enum class Mode : std::uint8_t {
        idle,       // the client has not said hello
        joining,    // the client waits for the answer to its hello
        following,  // records come as they are published
        behind,     // more waits than the client's window; it is dropped, and then the client asks
    };

    void hello(std::span<const std::byte> first);
    void ask(std::span<const std::byte> first, std::span<const std::byte> second = {});
    void refuse(std::string why);
    // These return true if `out` has a message for the client.
    bool take(const NatsMessage& message, Received& out);
    bool strange(const NatsMessage& message);
    bool live(const Packet& packet, Received& out);
    bool answerToJoin(const Packet& packet, Received& out);
    bool data(const Packet& packet, bool joining, Received& out);
    bool answer(const Packet& packet, Received& out);
    /// A message with this first part in place of `message_`.
    static bool say(Received& out, std::span<const std::byte> first, std::span<const std::byte> second = {}) {
        out.first = first;
        out.second = second;
        return true;
    }
    bool garbage();

    const std::shared_ptr<NatsSession> session_;
    NatsLink& link_;
    Wakeup connected_;
    Mode mode_ = Mode::idle;
    std::uint64_t client_ = 0;  // the client's session
    std::uint64_t window_ = 0;  // bytes
    bool answering_ = false;    // the answer to its hello has begun
    bool passes_ = false;       // the record that is coming
    std::uint64_t coming_ = 0;  // bytes of that record
    bool empty_ = false, refused_ = false;
    NatsMessage taken_;
    ByteBuffer message_;  // what the client reads now
    ByteBuffer hello_, packet_, refusal_;
};

bool NatsConnection::send(std::span<const std::byte> first, std::span<const std::byte> second) {
    wire::Reader in(first);
    const auto type = mirror::readPrologue(in);
    if (type == Message::hello)
        hello(first);
    else if (type != Message::ack && type != Message::pong && mode_ != Mode::idle)  // nobody waits for these
        ask(first, second);
    if (type == Message::bye) mode_ = Mode::idle;
    return true;
}

bool NatsConnection::receive(Received& message) {
    message.problem = nullptr;
    if (std::exchange(refused_, false)) return say(message, refusal_.bytes());
    while (true) {
        empty_ = !link_.take(taken_);
        if (empty_) break;
        {
            const std::scoped_lock lock(session_->mutex);
            ++session_->statistics.messages;
        }
        if (take(taken_, message)) return true;
        if (std::exchange(refused_, false)) return say(message, refusal_.bytes());
    }
    if (mode_ != Mode::behind) return false;
    mode_ = Mode::idle;
    mirror::begin(message_, Message::unknown);  // it says hello with the state that it has
    return say(message, message_.bytes());
}

void NatsConnection::hello(std::span<const std::byte> first) {
    wire::Reader in(first.subspan(mirror::kPrologue));
    mirror::Hello greeting;
    if (!greeting.read(in)) return;
    if (const char* why = refusalOf(greeting.wishes)) return refuse(why);
    client_ = greeting.session;
    window_ = std::max(greeting.window, kSmallestWindow);
    mode_ = Mode::joining;
    answering_ = false;
    (void)link_.subscribe(session_->subjects.state);
    hello_.clear();
    hello_.append(first);
    ask(first);
    const std::scoped_lock lock(session_->mutex);
    ++session_->statistics.joins;
}

void NatsConnection::ask(std::span<const std::byte> first, std::span<const std::byte> second) {
    nats::pack(packet_, first, second);
    (void)link_.publish(session_->subjects.ask, session_->inbox, packet_.bytes());
}

void NatsConnection::refuse(std::string why) {
    mirror::begin(refusal_, Message::refused);
    wire::putText(refusal_, why);
    refusal_.put(std::uint8_t{1});
    refused_ = true;
    mode_ = Mode::idle;
}

bool NatsConnection::garbage() {
    const std::scoped_lock lock(session_->mutex);
    if (auto reported = mirror::reportedOf(++session_->statistics.garbage, "ignored an invalid message"))
        session_->report(std::move(*reported));
    return false;
}

bool NatsConnection::take(const NatsMessage& message, Received& out) {
    const auto packet = nats::unpack(message.bytes);
    if (!packet) return strange(message);
    if (mode_ == Mode::idle) return false;
    if (message.subject == session_->subjects.live) return live(*packet, out);
    const bool ofJoin = packet->type == Message::welcome || packet->type == Message::ping ||
                        (packet->type == Message::data && nats::sessionOf(packet->first) == 0);
    if (ofJoin) return answerToJoin(*packet, out);
    return message.subject == session_->inbox ? answer(*packet, out) : garbage();
}

/// A publisher of another version refuses the client in words, if it knows how versions meet.
bool NatsConnection::strange(const NatsMessage& message) {
    const auto foreign = nats::foreign(message.bytes);
    const bool refuses = foreign && mirror::foreignType(foreign->first) == Message::refused;
    if (!foreign || mode_ != Mode::joining || (refuses && message.subject != session_->inbox)) return garbage();
    std::string why = mirror::versionText(foreign->version);
    if (refuses) {
        wire::Reader in(foreign->first.subspan(mirror::kPrologue));
        if (const std::string_view said = in.text(); !in.problem) why = said;
    }
    refuse(std::move(why));
    return false;
}

bool NatsConnection::live(const Packet& packet, Received& out) {
    switch (packet.type) {
        case Message::data:
            return mode_ == Mode::following && data(packet, false, out);
        case Message::ping: {
            wire::Reader in = packet.fields();
            std::uint64_t numbers[3] = {0, 0, 0};  // state sent, state of the scene, 1: the origin is lost
            if (!mirror::read(in, numbers)) return garbage();
            if (mode_ == Mode::following) return say(out, packet.first);
            numbers[0] = 0;  // what was sent comes with the answer
            mirror::write(message_, Message::ping, numbers);
            return say(out, message_.bytes());
        }
        case Message::unknown:
            if (mode_ == Mode::joining) ask(hello_.bytes());  // another publisher has not heard it
            [[fallthrough]];
        case Message::bye:
            return say(out, packet.first);
        default:
            return garbage();
    }
}

bool NatsConnection::answerToJoin(const Packet& packet, Received& out) {
    if (mode_ != Mode::joining) return false;
    if (packet.type == Message::welcome) {
        if (packet.first.size() < mirror::kPrologue + sizeof(client_)) return garbage();
        answering_ = true;
        nats::withSession(message_, packet.first, client_);
        return say(out, message_.bytes(), packet.second);
    }
    if (!answering_) return false;  // the rest of an answer that had begun before we asked
    if (packet.type == Message::data) return data(packet, true, out);
    mode_ = Mode::following;
    link_.unsubscribe(session_->subjects.state);
    return false;
}

/// Records that no mirror needs, and what is none, stay here; the client notices what is missing.
bool NatsConnection::data(const Packet& packet, bool joining, Received& out) {
    wire::Reader in = packet.fields();
    std::uint64_t numbers[4];  // session, size, offset, published
    if (!mirror::read(in, numbers)) return garbage();
    const auto [session, size, offset, published] = numbers;
    if (offset == 0) {
        if (!joining && link_.waiting() > window_) {
            mode_ = Mode::behind;
            return false;
        }
        const auto header = parseRecordHeader(packet.second, 0, kMaxPayload);
        const bool isState = header && header->size() == size &&
                             (header->kind == RecordKind::frame || header->kind == RecordKind::keyframe);
        passes_ = isState && header->from != header->to && (joining || header->from != 0);
        coming_ = size;
        if (!isState) return garbage();
    }
    if (size != coming_) return garbage();
    if (!passes_) return false;
    nats::withSession(message_, packet.first, client_);
    return say(out, message_.bytes(), packet.second);
}

/// The server's answers to this client alone, with its session.
bool NatsConnection::answer(const Packet& packet, Received& out) {
    switch (packet.type) {
        case Message::unknown:  // the publisher is another one
        case Message::data:
        case Message::pong:
        case Message::refused:
        case Message::digest:
        case Message::anatomy:
        case Message::verdict:
        case Message::reply:
            return say(out, packet.first, packet.second);
        default:
            return garbage();
    }
}

}  // namespace

class NatsSubscriber::Impl : public Transport {
  public:
    explicit Impl(NatsAddress address) : session(std::make_shared<NatsSession>(std::move(address))) {}

    Result<> start(std::chrono::milliseconds patience);
    Clock& clock() override { return steadyClock(); }
    Result<bool> isLocal(const std::string&) const override { return false; }
    Result<std::unique_ptr<Listener>> listen(const std::string&, const ListenSettings&) override {
        return fail("at a NATS server a publisher serves");
    }
    Result<std::unique_ptr<Connection>> connect(const std::string&, const ConnectSettings&) override {
        return std::make_unique<NatsConnection>(session);
    }

    const std::shared_ptr<NatsSession> session;
};

Result<> NatsSubscriber::Impl::start(std::chrono::milliseconds patience) {
    auto link = openNatsLink(session->address, "rtsg mirror", patience);
    if (!link) return std::unexpected(link.error());
    session->link = std::move(*link);
    std::random_device device;
    session->inbox = fmt::format("_INBOX.rtsg.{:08x}{:08x}", device(), device());
    for (const std::string& subject : {session->subjects.live, session->inbox})
        if (const std::string problem = session->link->subscribe(subject); !problem.empty())
            return fail(withoutSecrets(problem, session->address), {}, session->address.shown);
    return {};
}

NatsSubscriber::NatsSubscriber(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
NatsSubscriber::~NatsSubscriber() = default;

Result<std::unique_ptr<NatsSubscriber>> NatsSubscriber::start(const std::string& address,
                                                              std::chrono::milliseconds patience) {
    auto parsed = NatsAddress::parse(address);
    if (!parsed) return std::unexpected(parsed.error());
    auto impl = std::make_shared<Impl>(std::move(*parsed));
    if (auto ok = impl->start(patience); !ok) return std::unexpected(ok.error());
    return std::unique_ptr<NatsSubscriber>(new NatsSubscriber(std::move(impl)));
}

std::shared_ptr<Transport> NatsSubscriber::transport() const {
    return impl_;
}
const std::string& NatsSubscriber::address() const {
    return impl_->session->address.shown;
}
NatsSubscriberStatistics NatsSubscriber::statistics() const {
    const std::scoped_lock lock(impl_->session->mutex);
    return impl_->session->statistics;
}
std::vector<Diagnostic> NatsSubscriber::takeDiagnostics() {
    impl_->session->takeNews();
    const std::scoped_lock lock(impl_->session->mutex);
    return std::exchange(impl_->session->diagnostics, {});
}

}  // namespace rtsg
