#include <rtsg/sync/mirror_client.h>

#include <algorithm>
#include <random>

#include <fmt/format.h>

#include <rtsg/sync/change_codec.h>

#include "mirror_message.h"
#include "zmq_socket.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr int kLinger = 100;           // ms, for the goodbye
constexpr auto kHelloAgain = 500ms;    // without an answer
constexpr auto kRepairAgain = 1000ms;  // between two snapshots asked for because of a divergence
constexpr auto kLongestTurn = 20ms;    // of poll() beyond its timeout, while frames keep coming

}  // namespace

class MirrorClient::Impl {
  public:
    using Clock = std::chrono::steady_clock;

    Impl(Scene& replica, MirrorClientOptions options)
        : replica_(replica),
          options_(std::move(options)),
          socket_(context_, ZMQ_DEALER),
          monitor_(context_, ZMQ_PAIR),
          decoder_(builtinTypes()),
          dictionaryHash_(decoder_.localHash()) {}
    ~Impl() {
        mirror::begin(message_, Message::bye);
        send();
        zmq_socket_monitor(socket_.get(), nullptr, 0);
    }

    Result<> start(const std::string& endpoint);
    std::size_t poll(std::chrono::milliseconds timeout);

    MirrorStatistics statistics_;
    std::vector<Diagnostic> diagnostics_;
    std::string refusal_;
    bool serverLeft_ = false;
    bool inStep() const { return connected_ && haveState_ && partial_.empty() && statistics_.sequence >= newestHeard_; }

  private:
    bool send() {
        ZmqMessage out(message_.bytes());
        return socket_.send(out);
    }
    void report(Severity severity, std::string text) {
        if (diagnostics_.size() < 100) diagnostics_.push_back({severity, endpoint_, {}, std::move(text)});
    }
    void garbage(std::string text) {
        ++statistics_.garbage;
        report(Severity::warning, "ignored " + std::move(text));
    }
    void hello(bool afresh);
    void watchConnection();
    void keepInTouch();
    bool receiveOne();
    void welcome(wire::Reader& in, const ZmqMessage& second);
    void data(wire::Reader& in, const ZmqMessage& second);
    void record(std::span<const std::byte> bytes);
    void apply(std::span<const std::byte> bytes, const RecordHeader& header, bool afresh);
    void acknowledge();
    std::shared_ptr<ChangeSet> freshSet();

    Scene& replica_;
    MirrorClientOptions options_;
    std::string endpoint_;
    ZmqContext context_;
    ZmqSocket socket_, monitor_;
    ChangeDecoder decoder_;
    std::uint64_t dictionaryHash_;
    ByteBuffer message_;

    std::uint64_t session_ = 0, epoch_ = 0;
    bool helloPending_ = true, connected_ = false;
    bool haveState_ = false;  // the replica is in a state of this epoch
    bool touched_ = false;    // something was applied to the replica: it has to be reset before a keyframe
    std::uint64_t newestHeard_ = 0;
    std::uint64_t received_ = 0, acknowledged_ = 0;  // bytes of this session
    ByteBuffer partial_;                             // a record that comes in several parts
    std::uint64_t partialSize_ = 0;
    Clock::time_point heard_{}, greeted_{}, repaired_{};
    std::vector<std::shared_ptr<ChangeSet>> sets_;
    std::size_t applied_ = 0;  // in this turn of poll()
};

Result<> MirrorClient::Impl::start(const std::string& endpoint) {
    endpoint_ = endpoint;
    socket_.set(ZMQ_LINGER, kLinger);
    socket_.set(ZMQ_RECONNECT_IVL, 5);
    socket_.set(ZMQ_RECONNECT_IVL_MAX, 200);
    socket_.set(ZMQ_IMMEDIATE, 1);  // nothing is queued for a server that is not there
    socket_.set(ZMQ_RCVHWM, 0);     // bounded by the window
    socket_.set(ZMQ_MAXMSGSIZE, std::int64_t{16} << 20);
    if (options_.keys) {
        socket_.set(ZMQ_CURVE_SERVERKEY, options_.keys->serverPublic);
        socket_.set(ZMQ_CURVE_PUBLICKEY, options_.keys->clientPublic.front());
        socket_.set(ZMQ_CURVE_SECRETKEY, options_.keys->clientSecret);
    }
    monitor_.set(ZMQ_LINGER, 0);
    if (zmq_socket_monitor(socket_.get(), "inproc://connection", ZMQ_EVENT_DISCONNECTED) != 0 ||
        zmq_connect(monitor_.get(), "inproc://connection") != 0)
        return std::unexpected(zmqFailure("cannot watch the connection"));
    if (zmq_connect(socket_.get(), endpoint.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot connect to {}", endpoint)));
    std::random_device device;
    session_ = std::uint64_t{device()} << 32 | device();
    return {};
}

/// `afresh`: whatever state the replica is in, begin with a keyframe.
void MirrorClient::Impl::hello(bool afresh) {
    ++session_;  // what is still under way of the last one is ignored
    received_ = acknowledged_ = 0;
    partial_.clear();
    connected_ = false;
    if (afresh) haveState_ = false;
    mirror::Hello greeting;
    greeting.session = session_;
    greeting.dictionaryHash = dictionaryHash_;
    greeting.epoch = haveState_ ? epoch_ : 0;
    greeting.sequence = haveState_ ? replica_.sequence() : 0;
    greeting.window = options_.window;
    greeting.name = options_.name.substr(0, mirror::kLongestName);
    greeting.write(message_);
    helloPending_ = !send();
    greeted_ = Clock::now();
}

/// A lost connection is known at once, not after a silence; the next hello goes out when there is another one.
void MirrorClient::Impl::watchConnection() {
    while (true) {
        ZmqMessage event;
        if (!monitor_.receive(event)) return;
        monitor_.skipRest(event);
        connected_ = false;
        helloPending_ = true;
    }
}

void MirrorClient::Impl::keepInTouch() {
    watchConnection();
    const Clock::time_point now = Clock::now();
    if (helloPending_ ? now - greeted_ > 5ms : !connected_ && now - greeted_ > kHelloAgain) {
        hello(false);
    } else if (connected_ && now - heard_ > options_.timeout) {
        report(Severity::note, "the server has gone silent");
        hello(false);
    }
}

std::size_t MirrorClient::Impl::poll(std::chrono::milliseconds timeout) {
    applied_ = 0;
    const Clock::time_point start = Clock::now();
    const auto longest = std::max<Clock::duration>(timeout, kLongestTurn);
    while (true) {
        keepInTouch();
        bool any = false;
        // In portions: time passes while a long run of frames is applied.
        for (int i = 0; i < 64 && receiveOne(); ++i) any = true;
        if (received_ != acknowledged_) acknowledge();
        const auto spent = Clock::now() - start;
        if (any && spent < longest) continue;
        if (applied_ > 0 || spent >= timeout) break;
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(timeout - spent);
        zmq_pollitem_t items[] = {{socket_.get(), 0, ZMQ_POLLIN, 0}, {monitor_.get(), 0, ZMQ_POLLIN, 0}};
        zmq_poll(items, 2, std::clamp<long>(left.count(), 1, helloPending_ ? 5 : 100));
    }
    statistics_.sequence = replica_.sequence();
    return applied_;
}

bool MirrorClient::Impl::receiveOne() {
    ZmqMessage first, second;
    if (!socket_.receive(first)) return false;
    if (first.more()) {
        socket_.receive(second);
        if (second.more()) {
            socket_.skipRest(second);
            garbage("a message of too many parts");
            return true;
        }
    }
    wire::Reader in(first.bytes());
    const std::optional<Message> type = mirror::readPrologue(in);
    if (!type) {
        garbage(fmt::format("a message of {} bytes that is none of this protocol", first.bytes().size()));
        return true;
    }
    heard_ = Clock::now();
    serverLeft_ = *type == Message::bye;
    std::uint64_t token[1];
    switch (*type) {
        case Message::welcome:
            welcome(in, second);
            break;
        case Message::data:
            data(in, second);
            break;
        case Message::ping:
            if (!mirror::read(in, token)) {
                garbage("a malformed ping");
                break;
            }
            if (haveState_) newestHeard_ = std::max(newestHeard_, token[0]);
            mirror::write(message_, Message::pong, token);
            send();
            break;
        case Message::pong:
            break;
        case Message::bye:
            mirror::begin(message_, Message::bye);
            send();
            connected_ = false;  // and hello again in a while
            greeted_ = Clock::now();
            report(Severity::note, "the server said goodbye");
            break;
        case Message::unknown:
            if (connected_) hello(false);
            break;
        case Message::refused:
            refusal_ = in.text();
            connected_ = false;
            greeted_ = Clock::now();
            break;
        default:
            garbage(fmt::format("a message of unknown type {}", static_cast<unsigned>(*type)));
    }
    return true;
}

void MirrorClient::Impl::welcome(wire::Reader& in, const ZmqMessage& second) {
    std::uint64_t numbers[3];  // session, epoch, heartbeat
    if (!mirror::read(in, numbers)) return garbage("a malformed welcome");
    if (numbers[0] != session_) return;
    if (const auto intact = checkRecord(second.bytes(), 0, options_.maxRecord); !intact)
        return garbage("a damaged head: " + intact.error().text);
    const Result<StreamHead> head = decodeHead(second.bytes());
    if (!head) return garbage("a head: " + head.error().text);
    if (auto ok = decoder_.setHead(*head); !ok) {
        refusal_ = ok.error().text;
        return;
    }
    if (numbers[1] != epoch_) {
        if (epoch_ != 0) {
            ++statistics_.restarts;
            report(Severity::note, "the server is another run of the scene");
        }
        haveState_ = false;
        newestHeard_ = 0;
        epoch_ = numbers[1];
    }
    refusal_.clear();
    connected_ = true;
    acknowledge();  // tells the server that everything before has been read
}

void MirrorClient::Impl::data(wire::Reader& in, const ZmqMessage& second) {
    std::uint64_t numbers[3];  // session, size, offset
    if (!mirror::read(in, numbers)) return garbage("malformed data");
    const auto [session, size, offset] = numbers;
    if (session != session_ || !connected_) return;
    const std::span<const std::byte> part = second.bytes();
    if (size > options_.maxRecord || part.empty() || part.size() > size || offset > size - part.size())
        return garbage(fmt::format("{} bytes from {} on of a record of {}", part.size(), offset, size));
    received_ += part.size();
    statistics_.bytes += part.size();
    if (offset == 0 && part.size() == size) {
        partial_.clear();
        return record(part);
    }
    if (offset == 0) {
        partial_.clear();
        partialSize_ = size;
    }
    if (offset != partial_.size() || size != partialSize_) {
        ++statistics_.gaps;
        return hello(false);
    }
    partial_.append(part);
    // Credit for the next parts while this record is still incomplete.
    if (received_ - acknowledged_ > options_.window / 4) acknowledge();
    if (partial_.size() < size) return;
    ByteBuffer whole;
    whole.swap(partial_);
    record(whole.bytes());
    whole.swap(partial_);
    partial_.clear();
}

void MirrorClient::Impl::record(std::span<const std::byte> bytes) {
    const Result<RecordHeader> header = checkRecord(bytes, 0, options_.maxRecord);
    if (!header) {
        garbage("a damaged record: " + header.error().text);
        return hello(false);
    }
    if (header->kind != RecordKind::frame && header->kind != RecordKind::keyframe) return;
    newestHeard_ = std::max(newestHeard_, header->to);
    const bool follows = haveState_ && header->from == replica_.sequence();
    if (!follows && haveState_ && header->kind == RecordKind::frame) {
        if (header->to <= replica_.sequence()) return;  // seen already
        ++statistics_.gaps;
        report(Severity::note, fmt::format("frames {} to {} are missing", replica_.sequence() + 1, header->from));
        return hello(false);
    }
    if (!follows && header->kind == RecordKind::frame) {
        ++statistics_.gaps;
        return hello(true);
    }
    if (!follows && touched_) {
        if (auto ok = replica_.reset(); !ok) {
            refusal_ = ok.error().text;
            return;
        }
        newestHeard_ = header->to;
    }
    apply(bytes, *header, !follows);
}

std::shared_ptr<ChangeSet> MirrorClient::Impl::freshSet() {
    for (const auto& set : sets_)
        if (set.use_count() == 1) return set;
    if (sets_.size() >= 8) sets_.erase(sets_.begin());
    return sets_.emplace_back(std::make_shared<ChangeSet>());
}

void MirrorClient::Impl::apply(std::span<const std::byte> bytes, const RecordHeader& header, bool afresh) {
    const std::shared_ptr<ChangeSet> set = freshSet();
    Result<> ok = decoder_.decode(bytes, *set);
    touched_ = true;
    if (ok) ok = replica_.apply(set);
    if (!ok) {
        garbage(fmt::format("state {}, which cannot be applied: {}", header.to, ok.error().text));
        haveState_ = false;
        if (Clock::now() - repaired_ > kRepairAgain) {
            repaired_ = Clock::now();
            hello(true);
        } else {
            connected_ = false;
            greeted_ = Clock::now();
        }
        return;
    }
    haveState_ = true;
    ++applied_;
    ++statistics_.frames;
    if (afresh) ++statistics_.snapshots;
    statistics_.sequence = header.to;
    statistics_.hash = replica_.hash();
    statistics_.originHash = header.hash;
    statistics_.equal = decoder_.exact() && statistics_.hash == statistics_.originHash;
    if (statistics_.equal || !decoder_.exact()) return;
    ++statistics_.divergences;
    report(Severity::error, fmt::format("state {}: hash {} here, {} at the origin", header.to, statistics_.hash.hex(),
                                        statistics_.originHash.hex()));
    if (Clock::now() - repaired_ < kRepairAgain) return;
    repaired_ = Clock::now();
    hello(true);
}

void MirrorClient::Impl::acknowledge() {
    const std::uint64_t numbers[] = {session_, haveState_ ? replica_.sequence() : 0, received_};
    mirror::write(message_, Message::ack, numbers);
    if (send()) acknowledged_ = received_;
}

// ---- the public face -------------------------------------------------------------------------------------------

MirrorClient::MirrorClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MirrorClient::~MirrorClient() = default;

Result<std::unique_ptr<MirrorClient>> MirrorClient::connect(Scene& replica, const std::string& endpoint,
                                                            MirrorClientOptions options) {
    if (const Result<bool> local = isLocalEndpoint(endpoint); !local) return std::unexpected(local.error());
    if (options.keys)
        if (auto ok = options.keys->checkForClient(); !ok) return std::unexpected(ok.error());
    replica.setBehavioursEnabled(false);
    auto impl = std::make_unique<Impl>(replica, std::move(options));
    if (auto ok = impl->start(endpoint); !ok) return std::unexpected(ok.error());
    return std::unique_ptr<MirrorClient>(new MirrorClient(std::move(impl)));
}

std::size_t MirrorClient::poll(std::chrono::milliseconds timeout) {
    return impl_->poll(timeout);
}
bool MirrorClient::inStep() const {
    return impl_->inStep();
}
const MirrorStatistics& MirrorClient::statistics() const {
    return impl_->statistics_;
}
std::vector<Diagnostic> MirrorClient::takeDiagnostics() {
    return std::exchange(impl_->diagnostics_, {});
}
bool MirrorClient::serverLeft() const {
    return impl_->serverLeft_;
}
const std::string& MirrorClient::refusal() const {
    return impl_->refusal_;
}

}  // namespace rtsg
