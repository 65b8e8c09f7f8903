// Follows a mirror server: hello, credit, and records put together from their parts.
#include "server_stream.h"

#include <random>

#include <fmt/format.h>

namespace rtsg::nats {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::uint64_t kWindow = std::uint64_t{64} << 20;
constexpr auto kHelloAgain = 1s;  // without an answer, or after a refusal
constexpr auto kSilence = 4s;     // after which the server may have forgotten us

}  // namespace

ServerStream::ServerStream(const ZmqContext& context, const Settings& settings, Heard heard)
    : settings_(settings), heard_(std::move(heard)), socket_(context, ZMQ_DEALER) {
    std::random_device device;
    session_ = std::uint64_t{device()} << 32 | device();
}

ServerStream::~ServerStream() {
    mirror::begin(message_, Message::bye);
    ZmqMessage out(message_.bytes());
    socket_.send(out);
}

Result<> ServerStream::connect() {
    socket_.set(ZMQ_LINGER, 100);
    socket_.set(ZMQ_RECONNECT_IVL, 10);
    socket_.set(ZMQ_RCVHWM, 0);  // bounded by the window
    if (settings_.keys) {
        socket_.set(ZMQ_CURVE_SERVERKEY, settings_.keys->serverPublic);
        socket_.set(ZMQ_CURVE_PUBLICKEY, settings_.keys->clientPublic.front());
        socket_.set(ZMQ_CURVE_SECRETKEY, settings_.keys->clientSecret);
    }
    allowIpv6(socket_, settings_.endpoint);
    if (zmq_connect(socket_.get(), settings_.endpoint.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot connect to {}", settings_.endpoint)));
    return {};
}

void ServerStream::hello() {
    ++session_;
    received_ = acknowledged_ = 0;
    parts_.clear();
    welcomed_ = helloDue_ = false;
    greeted_ = heardAt_ = Clock::now();
    mirror::Hello greeting;
    greeting.session = session_;
    greeting.dictionaryHash = settings_.typesHash;
    greeting.epoch = state_ ? epoch_ : 0;
    greeting.sequence = state_;
    greeting.window = kWindow;
    greeting.name = settings_.name;
    greeting.wishes.client = settings_.client;
    greeting.wishes.hash = hash_;
    greeting.write(message_);
    ZmqMessage out(message_.bytes());
    socket_.send(out);
}

void ServerStream::poll(Clock::time_point now) {
    if (helloDue_ || (!welcomed_ && now - greeted_ > kHelloAgain) || now - heardAt_ > kSilence) hello();
    if (!welcomed_ || received_ == acknowledged_) return;
    const std::uint64_t numbers[] = {session_, state_, received_};
    mirror::write(message_, Message::ack, numbers);
    ZmqMessage out(message_.bytes());
    if (socket_.send(out)) acknowledged_ = received_;
}

bool ServerStream::send(std::span<const std::byte> first, std::span<const std::byte> second) {
    if (!welcomed_) return false;
    withSession(message_, first, session_);
    ZmqMessage head(message_.bytes()), body(second);
    return socket_.send(head, !second.empty()) && (second.empty() || socket_.send(body));
}

bool ServerStream::receive() {
    ZmqMessage first, second;
    if (!socket_.receive(first)) return false;
    if (first.more()) {
        socket_.receive(second);
        socket_.skipRest(second);
    }
    wire::Reader in(first.bytes());
    const auto type = mirror::readPrologue(in);
    if (!type) return true;
    heardAt_ = Clock::now();
    const Packet packet{*type, first.bytes(), second.bytes()};
    switch (*type) {
        case Message::welcome:
            welcome(packet);
            break;
        case Message::data:
            data(packet);
            break;
        case Message::unknown:
            helloDue_ = true;
            break;
        case Message::refused:
            welcomed_ = false;
            if (heard_.refused) heard_.refused(std::string(in.text()));
            break;
        case Message::bye:
            if (heard_.other) heard_.other(packet);
            mirror::begin(message_, Message::bye);
            {
                ZmqMessage out(message_.bytes());
                socket_.send(out);
            }
            welcomed_ = false;
            break;
        case Message::ping: {
            std::uint64_t token[1];
            if (!mirror::read(in, token)) break;
            mirror::write(message_, Message::pong, token);
            ZmqMessage out(message_.bytes());
            socket_.send(out);
            if (heard_.other) heard_.other(packet);
            break;
        }
        default:
            if (heard_.other) heard_.other(packet);
            break;
    }
    return true;
}

void ServerStream::welcome(const Packet& packet) {
    wire::Reader in = packet.fields();
    std::uint64_t numbers[3];  // session, epoch, heartbeat
    if (!mirror::read(in, numbers) || numbers[0] != session_) return;
    const bool same = epoch_ == numbers[1];
    if (!same) {
        state_ = 0;
        hash_ = {};
    }
    epoch_ = numbers[1];
    heartbeat_ = numbers[2];
    head_.clear();
    head_.append(packet.second);
    welcomed_ = true;
    acknowledged_ = 1;  // the welcome is acknowledged with 0 bytes
    if (heard_.welcome) heard_.welcome(same);
}

void ServerStream::data(const Packet& packet) {
    wire::Reader in = packet.fields();
    std::uint64_t numbers[4];  // session, size, offset, published
    if (!mirror::read(in, numbers) || numbers[0] != session_ || !welcomed_) return;
    received_ += packet.second.size();
    const RecordParts::Step step = parts_.add(numbers[1], numbers[2], packet.second);
    if (step == RecordParts::Step::misfit) helloDue_ = true;
    if (step != RecordParts::Step::complete) return;
    auto record = std::make_shared<EncodedRecord>();
    record->bytes.append(parts_.bytes().bytes());
    record->published = numbers[3];
    parts_.clear();
    const auto header = checkRecord(record->bytes.bytes());
    const bool follows = header && (header->from == 0 || header->from == state_);
    if (!follows) {
        helloDue_ = true;
        return;
    }
    finishRecord(*record);
    state_ = header->to;
    hash_ = header->hash;
    if (heard_.record) heard_.record(std::move(record));
}

}  // namespace rtsg::nats
