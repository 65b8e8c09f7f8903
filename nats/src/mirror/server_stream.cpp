// Follows a mirror server: hello, credit, and records put together from their parts.
#include "server_stream.h"

#include <random>

#include <fmt/format.h>

namespace rtsg::nats {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::uint64_t kWindow = std::uint64_t{64} << 20;
constexpr auto kConnectWithin = 2000ms;  // an attempt
constexpr auto kHelloAgain = 1s;         // without an answer, or after a refusal
constexpr auto kSilence = 4s;            // after which the server may have forgotten us

}  // namespace

ServerStream::ServerStream(const Settings& settings, Heard heard)
    : settings_(settings), heard_(std::move(heard)), clock_(settings_.transport->clock()) {
    std::random_device device;
    session_ = std::uint64_t{device()} << 32 | device();
}

ServerStream::~ServerStream() {
    mirror::begin(message_, Message::bye);
    if (connection_) connection_->send(message_.bytes());
}

Result<> ServerStream::connect() {
    auto connection =
        settings_.transport->connect(settings_.endpoint, {settings_.keys ? &*settings_.keys : nullptr, kConnectWithin});
    if (!connection) return std::unexpected(connection.error());
    connection_ = std::move(*connection);
    return {};
}

void ServerStream::hello() {
    ++session_;
    received_ = acknowledged_ = 0;
    parts_.clear();
    welcomed_ = helloDue_ = false;
    greeted_ = heardAt_ = clock_.now();
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
    connection_->send(message_.bytes());
}

void ServerStream::poll(Clock::time_point now) {
    while (connection_->nextEvent() != Connection::Event::none) continue;  // what was lost is found by its silence
    if (helloDue_ || (!welcomed_ && now - greeted_ > kHelloAgain) || now - heardAt_ > kSilence) hello();
    if (!welcomed_ || received_ == acknowledged_) return;
    const std::uint64_t numbers[] = {session_, state_, received_};
    mirror::write(message_, Message::ack, numbers);
    if (connection_->send(message_.bytes())) acknowledged_ = received_;
}

bool ServerStream::send(std::span<const std::byte> first, std::span<const std::byte> second) {
    if (!welcomed_) return false;
    withSession(message_, first, session_);
    return connection_->send(message_.bytes(), second);
}

bool ServerStream::receive() {
    Received message;
    if (!connection_->receive(message)) return false;
    wire::Reader in(message.first);
    const auto type = mirror::readPrologue(in);
    if (!type || message.problem) return true;
    heardAt_ = clock_.now();
    const Packet packet{*type, message.first, message.second};
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
            connection_->send(message_.bytes());
            welcomed_ = false;
            break;
        case Message::ping: {
            std::uint64_t token[1];
            if (!mirror::read(in, token)) break;
            mirror::write(message_, Message::pong, token);
            connection_->send(message_.bytes());
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
    record->bytes.swap(parts_.bytes());
    record->published = numbers[3];
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
