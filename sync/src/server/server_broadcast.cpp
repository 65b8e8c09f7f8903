// Peers of a mirror server that read what a listener broadcasts: who joins, what it missed, and what it asks.
#include <algorithm>

#include "server_io.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::size_t kMaxMembers = 20000;
constexpr std::uint64_t kBroadcastWindow = std::uint64_t{64} << 20;  // bytes that the listener has not sent yet
constexpr auto kJoinersGather = 50ms;                                // from one state that is sent to the next
// A short question may have a long answer, and anybody may ask.
constexpr double kAnswersAtOnce = 128e6, kAnswersPerSecond = 32e6;  // bytes
constexpr auto kForgotten = 120s;                                   // a member of which nothing was heard
constexpr auto kPruneEvery = 10s;

}  // namespace

/// The listener's own connection stands for all members. They are those of this run of the scene.
void MirrorServer::Io::openBroadcast(std::size_t listener) {
    const std::string identity(1, static_cast<char>(listener));
    Peer& peer = peers_[identity];
    const bool isNew = !peer.broadcast;  // else the listener counts on
    const std::uint64_t sent = peer.sentBytes, acknowledged = peer.ackedBytes;
    MirrorPace pace =
        isNew ? MirrorPace(0, static_cast<double>(shared_->options.maxBytesPerSecond)) : std::move(peer.pace);
    peer = Peer{};
    peer.sentBytes = peer.awaitedBytes = sent;
    peer.ackedBytes = acknowledged;
    peer.pace = std::move(pace);
    const std::string& endpoint = listeners_[listener]->endpoint();
    peer.identity = peer.to = identity;
    peer.author = endpoint.substr(0, endpoint.find(':'));
    peer.longest = listeners_[listener]->broadcasts();
    peer.window = kBroadcastWindow;
    peer.heard = peer.spoken = clock_.now();
    peer.broadcast = std::make_unique<BroadcastGroup>();
    peer.broadcast->allowed = clock_.now();
    peer.broadcast->allowance = kAnswersAtOnce;
    statistics_.maxPeers = std::max(statistics_.maxPeers, peers_.size());
}

/// Null if peers of that listener read by themselves.
MirrorServer::Io::Peer* MirrorServer::Io::broadcastOf(const std::string& identity) {
    const auto found = peers_.find(std::string_view(identity).substr(0, 1));
    return found != peers_.end() && found->second.broadcast ? &found->second : nullptr;
}

/// Null if this client is none of the peer's.
MirrorServer::Io::Asker* MirrorServer::Io::askerIn(Peer& peer, std::uint64_t client) {
    if (!peer.broadcast) return peer.client == client ? &peer : nullptr;
    const auto found = peer.broadcast->clients.find(client);
    if (found == peer.broadcast->clients.end()) return nullptr;
    const auto member = peer.broadcast->members.find(found->second);
    return member == peer.broadcast->members.end() ? nullptr : &member->second;
}

/// A member gets what it missed by itself, or a state together with others; then it goes on with what all read.
void MirrorServer::Io::join(Peer& all, const std::string& identity, const mirror::Hello& hello,
                            const std::string& user) {
    BroadcastGroup& broadcast = *all.broadcast;
    if (!isListed(user)) return refuse(identity, kNotListed, true);
    if (broadcast.members.size() >= kMaxMembers && !broadcast.members.contains(identity))
        return refuse(identity, "the server has as many peers as it takes");
    leave(all, identity);
    introduce(broadcast.members[identity], identity, hello, user, all.author);
    broadcast.clients[hello.wishes.client] = identity;
    if (hello.epoch == shared_->epoch && hello.sequence <= all.state &&
        history_.continues(hello.sequence, hello.wishes.hash))
        broadcast.resuming.emplace_back(identity, hello.sequence);
    else
        broadcast.stateWanted = true;
    news_ = true;
}

void MirrorServer::Io::leave(Peer& all, const std::string& identity) {
    BroadcastGroup& broadcast = *all.broadcast;
    const auto member = broadcast.members.find(identity);
    if (member == broadcast.members.end()) return;
    const auto client = broadcast.clients.find(member->second.client);
    if (client != broadcast.clients.end() && client->second == identity) broadcast.clients.erase(client);
    broadcast.members.erase(member);
}

void MirrorServer::Io::forgetSilent(Peer& all, Clock::time_point now) {
    if (now - all.broadcast->pruned < kPruneEvery) return;
    all.broadcast->pruned = now;
    std::vector<std::string> silent;
    for (const auto& [identity, member] : all.broadcast->members)
        if (now - member.heard > kForgotten) silent.push_back(identity);
    for (const std::string& identity : silent) leave(all, identity);
}

/// Asks the members' next question, as if the peer asked it. Meanwhile nothing is sent, as to any peer that asks.
void MirrorServer::Io::askNext(Peer& all) {
    if (all.broadcast->questions.empty() || !all.placed || !mayAsk(all)) return;
    question(all, all.broadcast->questions.front().text);
}

/// Says who reads what comes next: all read merged frames, and the asker the answer to the question. False if nobody
/// has asked it.
bool MirrorServer::Io::addressAnswer(Peer& all, bool merged) {
    all.to = all.identity;
    all.toSession = 0;
    if (merged) return true;
    if (all.broadcast->questions.empty()) return false;
    const BroadcastGroup::Question& question = all.broadcast->questions.front();
    all.to = question.asker;
    all.toSession = question.session;
    return true;
}

/// To be called while no record is partly sent.
void MirrorServer::Io::answerJoiners(Peer& all) {
    BroadcastGroup& broadcast = *all.broadcast;
    const Clock::time_point now = clock_.now();
    const double earned = std::chrono::duration<double>(now - broadcast.allowed).count() * kAnswersPerSecond;
    broadcast.allowance = std::min(kAnswersAtOnce, broadcast.allowance + earned);
    broadcast.allowed = now;
    if (!all.placed) return;
    for (const auto& [identity, state] : std::exchange(broadcast.resuming, {})) {
        if (broadcast.allowance < 0) break;  // they ask again
        if (!history_.continues(state)) {
            broadcast.stateWanted = true;
            continue;
        }
        ++statistics_.resumed;
        sendState(all, identity, state, nullptr);
    }
    if (!broadcast.stateWanted || broadcast.allowance < 0 || now - broadcast.stateSent < kJoinersGather) return;
    const SharedRecord keyframe = keyframeFor(all);
    if (!keyframe || keyframe->header.to > all.state) return;  // those between come first
    broadcast.stateWanted = false;
    broadcast.stateSent = now;
    std::string joiners = all.identity;
    joiners += Listener::kJoiners;
    sendState(all, joiners, keyframe->header.to, keyframe);
}

/// Sends a welcome, the keyframe if there is one, all frames from there to what the members have, and a ping that tells
/// that state.
void MirrorServer::Io::sendState(Peer& all, const std::string& to, std::uint64_t from, const SharedRecord& keyframe) {
    std::vector<SharedRecord> records = history_.framesFrom(from, SIZE_MAX);
    std::erase_if(records, [&](const SharedRecord& frame) { return frame->header.to > all.state; });
    if (keyframe) records.insert(records.begin(), keyframe);
    welcome(to, 0, shared_->epoch, all.state);
    for (const SharedRecord& record : records) {
        const std::span<const std::byte> whole = record->bytes.bytes();
        for (std::size_t sent = 0; sent < whole.size(); sent += all.longest) {
            const auto part = whole.subspan(sent, std::min(all.longest, whole.size() - sent));
            const std::uint64_t numbers[] = {0, whole.size(), sent, record->published, 1};
            mirror::write(message_, Message::data, numbers);
            sendTo(to, message_, part, record);
        }
        all.sentBytes += whole.size();
        statistics_.bytes += whole.size();
        all.broadcast->allowance -= static_cast<double>(whole.size());
    }
    all.pace.sent(all.sentBytes, clock_.now(), false);
    const std::uint64_t state[] = {all.state, all.state, 0};
    mirror::write(message_, Message::ping, state);
    sendTo(to, message_);
}

}  // namespace rtsg
