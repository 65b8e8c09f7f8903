// The thread of a mirror server that talks to peers: its loop, what it takes from other threads, and what it passes to
// them. server_peers.cpp has what it says to each peer.
#include "server_io.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <random>
#include <stdexcept>

#include <fmt/format.h>

#include "sockets/rare_warning.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;
using Kind = MirrorShadow::Question::Kind;

namespace {

constexpr std::size_t kLongestIncoming = mirror::kSubmitPart + 512;  // bytes; a hello is far below
constexpr std::size_t kReadAtOnce = 1000;  // messages, so that a peer that floods us leaves time for the others
constexpr auto kLastFrames = 300ms, kMergedWithin = 3000ms;  // for sending what peers do not have yet
constexpr auto kFarewell = 1000ms;                           // for peers to answer a goodbye
constexpr auto kTick = 10ms, kLongestSleep = 2000ms;         // between two looks at all peers, at least and at most
constexpr auto kMayBeLate = 1000ms;                          // while the machine is busy
constexpr auto kTickCosts = 50us;      // for each peer, so that the looks take some per cent of the time
constexpr auto kSettle = 5ms;          // between two publications of statistics, if there are more peers
constexpr std::size_t kFewPeers = 16;  // than this
constexpr auto kGather = 1000us;       // with more peers, all that they say in this time is read together
constexpr auto kLookAtLog = 20ms;      // as a log that hangs gives no notice
constexpr auto kUntilRest = 250ms;     // without frames, until connections need no more looks
constexpr auto kUnusedPart = 10s;      // until a part without peers is dropped
constexpr auto kNoRegions = 60s;       // until regions are tried again after a refusal
constexpr std::uint64_t kKeyframeEvery = std::uint64_t{8} << 20;  // bytes of frames, at least

}  // namespace

MirrorServer::Io::Io(std::shared_ptr<Shared> shared)
    : shared_(std::move(shared)),
      clock_(shared_->clock()),
      history_(streams_.try_emplace(0, shared_->options.history).first->second.history),
      shadow_(clock_, shared_->pool, shared_->wake, std::max<std::uint64_t>(shared_->options.history, 64 << 20),
              shared_->options.maximumIndexed),
      merges_(shared_->pool) {}

MirrorServer::Io::~Io() {
    worker_.stop();
    if (clock_.isStepped() && !listeners_.empty()) guard([this] { sayGoodbye(); });
}

Result<> MirrorServer::Io::start(const std::string& endpoint) {
    const MirrorServerOptions& options = shared_->options;
    auto listener = options.transport->listen(
        endpoint, {options.keys ? &*options.keys : nullptr, kLongestIncoming, shared_->wake.get()});
    if (!listener) return std::unexpected(listener.error());
    if (options.keys && !options.keyFile.empty()) keyFile_.begin(options.keyFile);
    listeners_.push_back(std::move(*listener));
    shared_->endpoint = listeners_.front()->endpoint();
    dictionaryHash_ = dictionaryHash(builtinTypes());
    restart();
    shadow_.onSnapshot([shared = shared_](std::uint64_t state, std::shared_ptr<const ChangeSet> snapshot) {
        std::shared_ptr<RecordLog> log;
        {
            const std::scoped_lock lock(shared->mutex);
            log = shared->log;
        }
        if (log) log->giveSnapshot(state, std::move(snapshot));
    });
    if (!clock_.isStepped()) worker_.run([this] { run(); }, [this] { shared_->awaken(); });
    return {};
}

/// State numbers get a new meaning, so all followers begin anew.
void MirrorServer::Io::restart() {
    if (!history_.empty()) {
        std::random_device device;
        shared_->epoch = std::uint64_t{device()} << 32 | device();
    }
    std::erase_if(streams_, [](const auto& s) { return s.first != 0; });
    history_.clear();
    merges_.clear();
    streams_.begin()->second.keyframeAsked = false;
    ledger_.clear();
    encodeHead(shared_->epoch, shared_->options.creator, builtinTypes(), shared_->options.mode, head_);
    mirror::begin(message_, Message::unknown);
    for (const auto& [identity, peer] : peers_) sendTo(identity, message_);
    std::erase_if(peers_, [](const auto& p) { return !p.second.broadcast; });
    for (auto& [identity, peer] : peers_) openBroadcast(static_cast<unsigned char>(identity[0]));
}

void MirrorServer::Io::run() {
    guard([this] {
        while (!worker_.stops()) {
            gather();
            wait(patience());
            poll();
        }
        sayGoodbye();
    });
}

void MirrorServer::Io::step() {
    guard([this] {
        do {
            wait(0ms);
            poll();
        } while (shadow_.step());
    });
}

void MirrorServer::Io::guard(const std::function<void()>& work) {
    try {
        work();
    } catch (const std::exception& e) {
        giveUp(e.what());
    }
}

/// The application hears of the failure with the next frame, threads that wait for peers at once, and peers by the
/// silence.
void MirrorServer::Io::giveUp(const char* why) {
    peers_.clear();
    const std::scoped_lock lock(shared_->mutex);
    std::snprintf(shared_->failure, sizeof(shared_->failure), "%s", why);
    shared_->inbox.clear();
    shared_->statistics.peers = 0;
    shared_->heldUp = false;
    shared_->caughtUp.notify_all();
    shared_->callScene();
}

/// A thousand peers answer one after the other, and waking up for each costs more than its message. So messages that
/// arrive within a short time are read together. Frames of the scene are sent at once.
void MirrorServer::Io::gather() {
    const auto left = turned_ + kGather - clock_.now();
    if (peers_.size() > kFewPeers && !news_ && left > 0ns) {
        pollfd item = {shared_->wake.get(), POLLIN, 0};
        (void)clock_.wait({&item, 1}, left);
    }
    turned_ = clock_.now();
}

Listener::Items MirrorServer::Io::itemsOf(std::size_t listener) {
    return Listener::Items(items_.data() + 2 + listener * Listener::kDescriptors, Listener::kDescriptors);
}

/// Sleeps until something comes or is due.
void MirrorServer::Io::wait(Clock::duration maximum) {
    items_.resize(2 + listeners_.size() * Listener::kDescriptors);
    items_[0] = {shared_->wake.get(), POLLIN, 0};
    items_[1] = {keyFile_.descriptor(), POLLIN, 0};
    const bool busy = isBusy_ && clock_.now() - newsAt_ < kUntilRest;
    for (std::size_t i = 0; i < listeners_.size(); ++i)
        maximum = std::min(maximum, listeners_[i]->prepare(itemsOf(i), busy));
    if (clock_.wait(items_, maximum) < 0 && errno != EINTR) throw std::runtime_error(std::strerror(errno));
    if (items_[0].revents) shared_->wake.clear();
}

void MirrorServer::Io::poll() {
    takeInbox();
    takeAnswers();
    if (items_[1].revents) takeKeys();
    receiveAll();
    const Clock::time_point now = clock_.now();
    if (shared_->wantAcknowledged.exchange(false)) askAllForAcknowledgements();
    if (now - ticked_ >= std::max<Clock::duration>(kTick, kTickCosts * peers_.size()) ||
        shared_->originLost != reportedLost_)
        tick(now);
    // A thousand peers answer one after the other. A message of one is no reason to look at all others.
    const bool everybody = std::exchange(news_, false) || now >= allDue_;
    if (everybody)
        pumpAll(now);
    else
        pumpHeard(now);
    heard_.clear();
    shared_->pool->keepReady(std::exchange(wantedNext_, 0));
    // Statistics go through all peers. So after messages of single peers they are published rarely, unless the scene
    // waits for a peer.
    unsettled_ = !everybody && !heldUp_ && peers_.size() > kFewPeers && now - settled_ < settling();
    if (unsettled_) return;
    settled_ = now;
    publishStatistics();
}

void MirrorServer::Io::pumpAll(Clock::time_point now) {
    allDue_ = now + kLongestSleep;
    for (auto peer = peers_.begin(); peer != peers_.end();) {
        const bool there = pump(peer->second);
        if (there) allDue_ = std::min(allDue_, dueFor(peer->second, now));
        peer = there ? ++peer : peers_.erase(peer);
    }
}

void MirrorServer::Io::pumpHeard(Clock::time_point now) {
    for (const std::string& identity : heard_) {
        const auto peer = peers_.find(identity);
        if (peer == peers_.end()) continue;
        if (!pump(peer->second))
            peers_.erase(peer);
        else
            allDue_ = std::min(allDue_, dueFor(peer->second, now));
    }
}

Clock::time_point MirrorServer::Io::dueFor(const Peer& peer, Clock::time_point now) const {
    Clock::time_point due = Clock::time_point::max();
    if (!peer.placed && !peer.broadcast) due = now + 20ms;
    if (peer.broadcast && peer.placed && (peer.broadcast->stateWanted || !peer.broadcast->questions.empty()))
        due = now + 10ms;
    if (const auto wait = peer.pace.wait(now); wait.count() > 0) due = std::min(due, now + wait);
    if (peer.interval.count() > 0 && peer.placed && peer.state != historyOf(peer).newest())
        due = std::min(due, peer.due);
    return due;
}

std::chrono::milliseconds MirrorServer::Io::patience() {
    const Clock::time_point now = clock_.now();
    if (news_) return 0ms;
    auto result = std::max(1ms, untilTick(now));
    if (!held_.empty()) result = std::min<std::chrono::milliseconds>(result, kLookAtLog);
    const Clock::time_point due = unsettled_ ? std::min(allDue_, settled_ + settling()) : allDue_;
    return std::clamp(std::chrono::ceil<std::chrono::milliseconds>(due - now), 1ms, result);
}

/// The time until some peer must be pinged or dropped. With many peers that is always soon.
std::chrono::milliseconds MirrorServer::Io::untilTick(Clock::time_point now) const {
    const MirrorServerOptions& options = shared_->options;
    if (peers_.size() > kFewPeers) return options.heartbeat / 2;
    Clock::time_point due = now + kLongestSleep;
    for (const auto& [identity, peer] : peers_)
        due = std::min({due, peer.spoken + options.heartbeat,
                        peer.broadcast ? Clock::time_point::max() : peer.heard + options.peerTimeout});
    return std::chrono::ceil<std::chrono::milliseconds>(due - now);
}

Clock::duration MirrorServer::Io::settling() const {
    return std::max<Clock::duration>(kSettle, kTickCosts * peers_.size());
}

bool MirrorServer::Io::hasBeenSentAll(const Peer& peer) const {
    if (historyOf(peer).empty()) return true;
    return peer.placed && peer.state == historyOf(peer).newest() && !peer.asking && !peer.sending && !peer.then;
}

/// Sends the last frames of the scene, and merged those that were held back for slow peers, as no newer ones will come.
void MirrorServer::Io::sendLastFrames() {
    leaving_ = true;
    takeInbox();
    for (auto& [identity, peer] : peers_) {
        peer.pace.lift();
        peer.due = {};
    }
    const Clock::time_point start = clock_.now();
    while (true) {
        if (clock_.isStepped()) (void)shadow_.step();
        takeAnswers();
        for (auto peer = peers_.begin(); peer != peers_.end();) peer = pump(peer->second) ? ++peer : peers_.erase(peer);
        const bool all = std::ranges::all_of(peers_, [this](const auto& p) { return hasBeenSentAll(p.second); });
        // Merging is our own work, so no peer can delay the end by it.
        const bool merging = std::ranges::any_of(peers_, [](const auto& p) { return p.second.asking; });
        if (all || clock_.now() - start >= (merging ? kMergedWithin : kLastFrames)) return;
        wait(10ms);
        receiveAll();
    }
}

/// Says goodbye and waits for answers, so that slow readers still get everything.
void MirrorServer::Io::sayGoodbye() {
    sendLastFrames();
    std::erase_if(peers_, [this](const auto& peer) {
        // The newest state tells a peer whether it lacks something.
        const std::uint64_t newest[] = {historyOf(peer.second).newest()};
        mirror::write(message_, Message::bye, newest);
        return !sendTo(peer.first, message_);
    });
    const Clock::time_point end = clock_.now() + kFarewell;
    while (!peers_.empty() && clock_.now() < end) {
        wait(20ms);
        receiveAll();
    }
}

void MirrorServer::Io::takeInbox() {
    std::vector<Shared::Item> items;
    std::vector<mirror::Verdict> verdicts;
    std::vector<Shared::Control> replies;
    {
        const std::scoped_lock lock(shared_->mutex);
        for (std::unique_ptr<Listener>& more : std::exchange(shared_->listeners, {})) {
            listeners_.push_back(std::move(more));
            items_.resize(2 + listeners_.size() * Listener::kDescriptors);
            if (listeners_.back()->broadcasts() == 0) continue;
            openBroadcast(listeners_.size() - 1);
            // Whoever followed another run of the scene has to join this one.
            mirror::begin(message_, Message::unknown);
            sendTo(std::string(1, static_cast<char>(listeners_.size() - 1)), message_);
        }
        items.swap(shared_->inbox);
        verdicts.swap(shared_->verdicts);
        replies.swap(shared_->replies);
        logged_ = {shared_->loggedStart, shared_->loggedState, shared_->longestWaitForLog};
    }
    for (const Shared::Control& answer : replies) reply(answer);
    for (Shared::Item& item : items) arrive(std::move(item));
    bool any = false, earlier = false;
    for (; !held_.empty() && (leaving_ || !waitsForLog(held_.front())); held_.pop_front()) {
        any = true;
        earlier = held_.front().earlier;
        release(std::move(held_.front()));
    }
    news_ |= any || !verdicts.empty();
    if (news_) isBusy_ = clock_.now() - std::exchange(newsAt_, clock_.now()) < kUntilRest;
    // Earlier frames come first, and the keyframe of their last state right after them.
    if (any && !earlier) keepKeyframeNear(0);
    for (mirror::Verdict& verdict : verdicts) {
        ++statistics_.requests;
        ledger_.answer(verdict);
        for (auto& [identity, peer] : peers_)
            if (const Asker* asker = askerIn(peer, verdict.client))
                peer.verdicts.push_back({asker->identity, asker->session, verdict});
    }
}

/// Passes a frame to the shadow at once, even if peers must wait for the log, because the log waits for the shadow's
/// snapshots.
void MirrorServer::Io::arrive(Shared::Item item) {
    if (item.restart) shadow_.restart();
    if (!item.earlier && !shadow_.post(item.record, item.snapshot)) callForSnapshot();
    held_.push_back(std::move(item));
}

/// True while the log lacks this frame. A frame that has waited too long is released; the next one's time counts anew.
bool MirrorServer::Io::waitsForLog(const Shared::Item& item) const {
    if (logged_.longestWait.count() == 0) return false;
    const auto longest = static_cast<std::uint64_t>(std::chrono::nanoseconds(logged_.longestWait).count());
    const bool logged =
        item.start < logged_.start || (item.start == logged_.start && item.record->header.to <= logged_.state);
    return !logged && item.record->published + longest > clock_.nanoseconds();
}

/// Releases a frame to the peers.
void MirrorServer::Io::release(Shared::Item item) {
    if (item.restart) {
        ++era_;
        restart();
    }
    if (item.requested) {
        ++statistics_.stalls;
        streams_.begin()->second.keyframeAsked = false;
        return history_.setKeyframe(std::move(item.record));
    }
    if (item.earlier) {
        history_.keepFirst();
        return history_.addEarlier(std::move(item.record));
    }
    ++statistics_.frames;
    if (item.record->header.kind == RecordKind::frame) wantedNext_ = item.record->bytes.size();
    if (!history_.add(std::move(item.record)))
        shared_->report(Severity::error, "a change set that does not follow the one before was not sent");
}

/// The shadow was given up, so the scene's thread must take a snapshot.
void MirrorServer::Io::callForSnapshot() {
    shared_->wantSnapshot = true;
    shared_->callScene();
}

void MirrorServer::Io::askForKeyframe(std::uint32_t part) {
    if (std::exchange(streams_.find(part)->second.keyframeAsked, true)) return;
    MirrorShadow::Question question;
    question.part = part;
    shadow_.ask(std::move(question));
}

/// Makes sure that a keyframe is ready before anybody asks. The cost stays a share of the frames'.
void MirrorServer::Io::keepKeyframeNear(std::uint32_t part) {
    const MirrorHistory& history = streams_.find(part)->second.history;
    const SharedRecord keyframe = history.keyframe();
    const std::uint64_t since = keyframe ? history.bytesFrom(keyframe->header.to) : 0;
    if (!keyframe ||
        since > std::min(std::max<std::uint64_t>(2 * keyframe->bytes.size(), kKeyframeEvery), history.limit() / 2))
        askForKeyframe(part);
}

void MirrorServer::Io::takeAnswers() {
    shadow_.checkAlive();
    for (MirrorShadow::Answer& answer : shadow_.takeAnswers()) early_.push_back(std::move(answer));
    for (; !early_.empty() && (leaving_ || !isEarly(early_.front())); early_.pop_front())
        if (early_.front().era == era_) takeAnswer(std::move(early_.front()));
}

/// True if the answer is about a state that still waits for the log.
bool MirrorServer::Io::isEarly(const MirrorShadow::Answer& answer) const {
    if (answer.era != era_) return answer.era > era_;
    return !held_.empty() && answer.record && answer.record->header.to > history_.newest();
}

void MirrorServer::Io::takeAnswer(MirrorShadow::Answer answer) {
    if (answer.kind == Kind::keyframe || answer.kind == Kind::frame) {
        news_ = true;
        const auto stream = streams_.find(answer.part);
        if (stream == streams_.end()) return;
        if (answer.kind == Kind::keyframe) {
            stream->second.keyframeAsked = false;
            if (answer.record) stream->second.history.setKeyframe(std::move(answer.record));
        } else if (answer.record && stream->second.history.add(answer.record)) {
            keepKeyframeNear(answer.part);
        } else if (answer.why.empty()) {
            dropStream(answer.part);
        } else {
            refuseRegions(std::move(answer.why));
        }
        return;
    }
    const auto peer = peers_.find(answer.peer);
    if (peer == peers_.end() || peer->second.session != answer.session) return;
    noteHeard(peer->first);  // there is an answer for this peer
    peer->second.answer = std::move(answer);
}

bool MirrorServer::Io::receive(std::size_t listener) {
    const auto prefix = static_cast<char>(listener);
    Received message;
    std::string identity;
    for (std::size_t i = 0; i < kReadAtOnce; ++i) {
        if (!listeners_[listener]->receive(message)) return true;
        if (message.problem) {
            garbage(message.problem);
            continue;
        }
        identity.assign(1, prefix).append(message.from);
        handle(identity, message.first, message.second, message.user);
    }
    return false;
}

/// Call it after a wait.
void MirrorServer::Io::receiveAll() {
    for (std::size_t i = 0; i < listeners_.size(); ++i) {
        const bool drained = !listeners_[i]->came(itemsOf(i)) || receive(i);
        const Listener::Failures failures = listeners_[i]->received(drained);
        statistics_.refused += failures.refused;
        for (std::uint64_t n = 0; n < failures.refused; ++n)
            warn(++strangers_, "refused a connection: its key is not on the list");
        for (std::uint64_t n = 0; n < failures.garbage; ++n) garbage("a connection that did not speak the protocol");
        for (std::uint64_t n = 0; n < failures.endless; ++n) garbage("a message without end: its connection was ended");
    }
}

/// Drops a stream. Its peers are told to say hello again.
void MirrorServer::Io::dropStream(std::uint32_t part) {
    mirror::begin(message_, Message::unknown);
    std::erase_if(peers_, [&](const auto& p) { return p.second.part == part && (sendTo(p.first, message_), true); });
    streams_.erase(part);
    MirrorShadow::Question question;
    question.kind = Kind::close;
    question.part = part;
    shadow_.ask(std::move(question));
}

/// Drops the part that has been without peers for longest; until then it is kept for peers that come back. False if all
/// have peers.
bool MirrorServer::Io::dropUnusedPart() {
    std::set<std::uint32_t> used;
    for (const auto& [identity, peer] : peers_) used.insert(peer.part);
    auto oldest = streams_.end();
    for (auto s = std::next(streams_.begin()); s != streams_.end(); ++s)
        if (!used.contains(s->first) && (oldest == streams_.end() || s->second.used < oldest->second.used)) oldest = s;
    if (oldest == streams_.end()) return false;
    dropStream(oldest->first);
    return true;
}

/// Refuses regions for a while. Their peers ask again and again, and it takes long to find out whether regions can be
/// followed.
void MirrorServer::Io::refuseRegions(std::string why) {
    if (noRegions_ != why) shared_->report(Severity::warning, "no parts by region: " + why);
    noRegions_ = std::move(why);
    regionsAgain_ = clock_.now() + kNoRegions;
    const auto isRegion = [](const auto& s) { return isPartByRegion(s.second.wishes); };
    for (auto s = streams_.begin(); (s = std::find_if(s, streams_.end(), isRegion)) != streams_.end();) {
        const std::uint32_t part = (s++)->first;
        std::erase_if(peers_,
                      [&](const auto& p) { return p.second.part == part && (refuse(p.first, noRegions_), true); });
        dropStream(part);
    }
}

void MirrorServer::Io::tick(Clock::time_point now) {
    // Time in which this process was stopped is no silence of its peers.
    const Clock::duration pause = now - std::exchange(ticked_, now) - kLongestSleep - kMayBeLate;
    if (pause > 0ms)
        for (auto& [identity, peer] : peers_) peer.heard = std::min(now, peer.heard + pause);
    const bool lost = shared_->originLost, news = std::exchange(reportedLost_, lost) != lost;
    for (const auto& [identity, peer] : peers_) streamOf(peer).used = now;
    for (auto s = std::next(streams_.begin()); s != streams_.end();) {
        const auto next = std::next(s);
        if (now - s->second.used > kUnusedPart) dropStream(s->first);
        s = next;
    }
    for (auto p = peers_.begin(); p != peers_.end();) {
        Peer& peer = p->second;
        if (peer.broadcast) forgetSilent(peer, now);
        bool gone = !peer.broadcast && now - peer.heard > shared_->options.peerTimeout;
        if (gone) {
            ++statistics_.lost;
            shared_->report(Severity::note, fmt::format("peer '{}' was silent for too long", peer.author));
        } else if (news || now - peer.spoken > shared_->options.heartbeat) {
            peer.awaitedBytes = peer.sentBytes;
            peer.spoken = peer.awaitedAt = now;
            gone = !ping(peer);
        }
        p = gone ? peers_.erase(p) : ++p;
    }
    noticeWhoLeft();
}

void MirrorServer::Io::noticeWhoLeft() {
    if (submitters_.empty()) return;
    std::set<std::uint64_t> here;
    for (const auto& [identity, peer] : peers_) {
        here.insert(peer.client);
        if (peer.broadcast)
            for (const auto& [client, member] : peer.broadcast->clients) here.insert(client);
    }
    const std::scoped_lock lock(shared_->mutex);
    const auto gone = std::erase_if(submitters_, [&](std::uint64_t client) {
        if (here.contains(client)) return false;
        shared_->left.push_back(client);
        return true;
    });
    if (gone > 0) shared_->callScene();
}

bool MirrorServer::Io::ping(const Peer& peer) {
    const std::uint64_t token[] = {peer.state, historyOf(peer).newest(), reportedLost_ ? 1u : 0u};
    mirror::write(message_, Message::ping, token);
    return sendTo(peer.identity, message_);
}

bool MirrorServer::Io::sendTo(const std::string& identity, const ByteBuffer& head, std::span<const std::byte> body,
                              const SharedBytes& owner) {
    const std::string_view to(identity);
    return listeners_[static_cast<unsigned char>(to[0])]->send(to.substr(1), head.bytes(), body, owner);
}

void MirrorServer::Io::garbage(std::string text) {
    warn(++statistics_.garbage, "ignored " + std::move(text));
}

/// Refused clients may try again twenty times a second for ever.
void MirrorServer::Io::warn(std::uint64_t by, std::string text) {
    if (auto reported = mirror::reportedOf(by, std::move(text)))
        shared_->report(Severity::warning, std::move(*reported));
}

void MirrorServer::Io::publishStatistics() {
    statistics_.peers = peers_.size();
    statistics_.sequence = history_.newest();
    statistics_.acknowledged = history_.newest();
    bool heldUp = false;
    const Clock::time_point now = clock_.now();
    for (auto& [identity, peer] : peers_) {
        statistics_.acknowledged = std::min(statistics_.acknowledged, peer.ackedState);
        if (peer.whenSlow != MirrorWhenSlow::block) continue;
        if (!behind(peer)) {
            peer.behindSince = {};
        } else if (peer.behindSince == Clock::time_point{}) {
            peer.behindSince = now;
        } else if (now - peer.behindSince > shared_->options.blockFor) {
            shared_->report(Severity::note,
                            fmt::format("peer '{}' has held up the scene for long enough", peer.author));
            peer.whenSlow = MirrorWhenSlow::coalesce;
        }
        heldUp |= peer.whenSlow == MirrorWhenSlow::block && behind(peer);
    }
    shared_->wantPredicted = std::ranges::any_of(peers_, [](const auto& p) {
        return p.second.part == 0 && !p.second.inputs && p.second.interval.count() == 0 && !p.second.broadcast;
    });
    const std::scoped_lock lock(shared_->mutex);
    shared_->statistics = statistics_;
    shared_->heldUp = heldUp_ = heldUp;
    if (!heldUp) shared_->caughtUp.notify_all();
}

}  // namespace rtsg
