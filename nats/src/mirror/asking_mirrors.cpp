// Passes questions of mirrors on to the server, and its answers back.
#include "asking_mirrors.h"

#include <algorithm>

#include <fmt/format.h>

namespace rtsg::nats {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::size_t kMaxMirrors = 20000, kMaxRequests = 256, kMaxQuestions = 64, kMaxCommands = 16;
constexpr std::uint64_t kMaxSubmitted = std::uint64_t{16} << 20;  // bytes of requests without a verdict
// Slightly less than the server allows one peer.
constexpr double kQuestionsAtOnce = 20, kQuestionsPerSecond = 3.8;
constexpr auto kAnswerWithin = 3s;  // after which the next question goes out
constexpr auto kForgotten = 120s;   // a mirror of which nothing was heard
constexpr auto kPruneEvery = 10s;

}  // namespace

bool AskingMirrors::greeted(const std::string& inbox, const mirror::Hello& hello) {
    if (mirrors_.size() >= kMaxMirrors && !mirrors_.contains(inbox)) return false;
    Mirror& mirror = mirrors_[inbox];
    mirror.client = hello.wishes.client;
    mirror.name = hello.name.empty() ? fmt::format("peer-{:04x}", hello.wishes.client & 0xFFFF) : hello.name;
    mirror.sameTypes = hello.dictionaryHash == typesHash_;
    mirror.heard = steadyClock().now();
    mirror.submission = {};
    inboxes_[mirror.client] = inbox;
    return true;
}

bool AskingMirrors::take(const std::string& inbox, const Packet& packet, Clock::time_point now) {
    const auto found = mirrors_.find(inbox);
    if (found == mirrors_.end()) {
        mirror::begin(message_, Message::unknown);
        reply(inbox, message_);
        return true;
    }
    Mirror& mirror = found->second;
    mirror.heard = now;
    switch (packet.type) {
        case Message::doubt:
        case Message::inspect:
        case Message::want:
            // A mirror waits for one answer at a time, so another question of it is a newer one.
            if (questions_.size() < kMaxQuestions)
                questions_.push_back({inbox, {packet.first.begin(), packet.first.end()}});
            return true;
        case Message::submit:
            return submit(inbox, mirror, packet);
        case Message::control: {
            if (commands_.size() < kMaxCommands && server_.send(packet.first)) {
                commands_.push_back({inbox, sessionOf(packet.first)});
                return true;
            }
            mirror::Words{sessionOf(packet.first), "refused: too many commands wait"}.write(message_, Message::reply);
            reply(inbox, message_);
            return true;
        }
        case Message::bye:
            if (const auto own = inboxes_.find(mirror.client); own != inboxes_.end() && own->second == inbox)
                inboxes_.erase(own);
            mirrors_.erase(found);
            return true;
        default:
            return false;
    }
}

bool AskingMirrors::submit(const std::string& inbox, Mirror& mirror, const Packet& packet) {
    wire::Reader in = packet.fields();
    std::uint64_t numbers[4];  // session, request, size, offset
    if (!mirror::read(in, numbers)) return false;
    const auto [session, request, size, offset] = numbers;
    std::string author = mirror.name;
    if (in.left()) {
        const std::string_view given = in.text();
        if (in.problem || given.size() > mirror::kLongestName) return false;
        author += "/" + std::string(given);
    }
    author.resize(std::min(author.size(), mirror::kLongestName));
    const char* problem = nullptr;
    const bool complete = mirror.submission.add(request, size, offset, packet.second, problem);
    if (problem) return false;
    if (!complete) return true;
    std::vector<std::byte> record = std::exchange(mirror.submission, {}).bytes;
    sessions_[mirror.client] = session;
    const mirror::Verdict* known = nullptr;
    switch (ledger_.standing(mirror.client, request, known)) {
        case mirror::RequestLedger::Standing::pending:
            return true;
        case mirror::RequestLedger::Standing::answered:
            if (known) {
                known->write(message_, session);
                reply(inbox, message_);
            }
            return true;
        case mirror::RequestLedger::Standing::fresh:
            break;
    }
    if (!mirror.sameTypes) return refuse(inbox, session, request, "the node types here are others than there"), true;
    std::uint64_t waiting = record.size();
    for (const auto& [number, other] : requests_) waiting += other.record.size();
    if (requests_.size() >= kMaxRequests || waiting > kMaxSubmitted || !ledger_.begin(mirror.client, request))
        return refuse(inbox, session, request, "too many requests wait for the scene"), true;
    const std::uint64_t number = nextRequest_++;
    passOn(number, requests_[number] = {mirror.client, request, std::move(record), std::move(author)});
    return true;
}

void AskingMirrors::passOn(std::uint64_t number, const Request& request) {
    const std::span<const std::byte> whole(request.record);
    for (std::size_t sent = 0; sent < whole.size();) {
        const auto part = whole.subspan(sent, std::min(mirror::kSubmitPart, whole.size() - sent));
        const std::uint64_t numbers[] = {0, number, whole.size(), sent};
        ByteBuffer message;
        mirror::write(message, Message::submit, numbers);
        wire::putText(message, request.author);
        if (!server_.send(message.bytes(), part)) return;  // again with the next welcome
        sent += part.size();
    }
}

void AskingMirrors::refuse(const std::string& inbox, std::uint64_t session, std::uint64_t request, std::string why) {
    mirror::Verdict verdict;
    verdict.request = request;
    verdict.refusal = std::move(why);
    verdict.write(message_, session);
    reply(inbox, message_);
}

void AskingMirrors::verdict(const Packet& packet) {
    wire::Reader in = packet.fields();
    (void)in.number<std::uint64_t>();  // our session
    mirror::Verdict verdict;
    if (!verdict.read(in)) return;
    const auto found = requests_.find(verdict.request);
    if (found == requests_.end()) return;
    verdict.client = found->second.client;
    verdict.request = found->second.number;
    requests_.erase(found);
    ledger_.answer(verdict);
    const auto inbox = inboxes_.find(verdict.client);
    if (inbox == inboxes_.end()) return;
    verdict.write(message_, sessions_[verdict.client]);
    reply(inbox->second, message_);
}

void AskingMirrors::answered(const Packet& packet) {
    switch (packet.type) {
        case Message::verdict:
            return verdict(packet);
        case Message::reply: {
            if (commands_.empty()) return;
            const Command command = std::move(commands_.front());
            commands_.pop_front();
            withSession(message_, packet.first, command.session);
            return reply(command.inbox, message_);
        }
        case Message::digest:
        case Message::anatomy: {
            if (!std::exchange(asked_, false)) return;
            const Question question = std::move(questions_.front());
            questions_.pop_front();
            withSession(message_, packet.first, sessionOf(question.message));
            return reply(question.inbox, message_);
        }
        default:
            return;
    }
}

void AskingMirrors::repaired(const SharedRecord& record, std::size_t maxBytes) {
    if (!std::exchange(asked_, false)) return;
    const Question question = std::move(questions_.front());
    questions_.pop_front();
    const std::span<const std::byte> whole = record->bytes.bytes();
    for (std::size_t sent = 0; sent < whole.size(); sent += maxBytes) {
        const auto part = whole.subspan(sent, std::min(maxBytes, whole.size() - sent));
        const std::uint64_t numbers[] = {sessionOf(question.message), whole.size(), sent, 0};
        mirror::write(message_, Message::data, numbers);
        reply_(question.inbox, message_.bytes(), part);
    }
}

void AskingMirrors::welcomed(bool sameEpoch) {
    asked_ = false;
    questions_.clear();
    commands_.clear();
    if (!sameEpoch) {
        // Node numbers have another meaning now; mirrors learn that by their own welcome.
        requests_.clear();
        ledger_.clear();
    }
    for (const auto& [number, request] : requests_) passOn(number, request);
}

void AskingMirrors::poll(Clock::time_point now) {
    allowance_ = std::min(kQuestionsAtOnce,
                          allowance_ + std::chrono::duration<double>(now - turned_).count() * kQuestionsPerSecond);
    turned_ = now;
    if (asked_ && now - askedAt_ > kAnswerWithin) {
        asked_ = false;
        questions_.pop_front();
    }
    if (!asked_ && !questions_.empty() && allowance_ >= 1 && server_.send(questions_.front().message)) {
        allowance_ -= 1;
        asked_ = true;
        askedAt_ = now;
    }
    if (now - pruned_ < kPruneEvery) return;
    pruned_ = now;
    std::erase_if(mirrors_, [&](const auto& m) { return now - m.second.heard > kForgotten; });
    std::erase_if(inboxes_, [&](const auto& i) { return !mirrors_.contains(i.second); });
    std::erase_if(sessions_, [&](const auto& s) { return !inboxes_.contains(s.first); });
}

}  // namespace rtsg::nats
