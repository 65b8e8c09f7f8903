// The messages of a mirror server to each peer: the order of records, credit, answers and requests.
#include <algorithm>
#include <concepts>

#include <fmt/format.h>

#include "server_io.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;
using Kind = MirrorShadow::Question::Kind;

namespace {

constexpr std::size_t kChunk = std::size_t{256} << 10;
constexpr std::size_t kSmall = 1024;  // bytes of a record whose acknowledgement may wait long
constexpr std::uint64_t kSmallestWindow = 64 << 10, kLargestWindow = std::uint64_t{64} << 20;
constexpr std::uint64_t kLargestDebt = 2 * kLargestWindow;
constexpr std::uint64_t kAnswerCost = 1024;  // overhead of an answer that waits to be read
constexpr std::uint64_t kSmallBacklog =
    8 << 10;                                // bytes of frames behind a keyframe for which a new keyframe does not pay
constexpr auto kPatience = 200ms;           // to wait for the shadow's newer keyframe
constexpr double kMaxQuestions = 24;        // of one peer at once
constexpr double kQuestionsPerSecond = 4;   // of one peer in the long run
constexpr auto kAskEvery = 500ms;           // least time between requests for acknowledgement
constexpr auto kAskSeldom = 3500ms;         // the same where little is sent; pings of clients tell their state, too
constexpr auto kForgetEvery = 250ms;        // while some peers cannot read predicted frames
constexpr std::size_t kMaxMerged = 20000;   // frames
constexpr std::size_t kMaxControls = 16;    // that wait for the scene, of all peers
constexpr std::size_t kMaxVerdicts = 1000;  // that wait for their frame
constexpr std::size_t kMaxWaitingQuestions = 64;  // of an broadcast

}  // namespace

void MirrorServer::Io::handle(const std::string& identity, std::span<const std::byte> bytes,
                              std::span<const std::byte> body, const std::string& user) {
    wire::Reader in(bytes);
    const std::optional<Message> type = mirror::readPrologue(in);
    if (const auto version = mirror::foreignVersion(bytes);
        version && mirror::foreignType(bytes) == Message::hello && !leaving_)
        return refuseVersion(identity, *version);
    if (!type) return garbage(fmt::format("a message of {} bytes that is none of this protocol", bytes.size()));
    // A peer that comes now learns by the silence that nobody is there.
    if (leaving_ && *type != Message::bye && (*type != Message::ack || !peers_.contains(identity))) return;
    Peer* const all = broadcastOf(identity);
    if (*type == Message::hello) {
        mirror::Hello greeting;
        if (!greeting.read(in)) return garbage("a malformed hello");
        if (all)
            join(*all, identity, greeting, user);
        else
            hello(identity, greeting, user);
        return noteHeard(all ? all->identity : identity);
    }
    if (*type < Message::ack || *type > Message::control)
        return garbage(fmt::format("a message of unknown type {}", static_cast<unsigned>(*type)));
    const auto found = peers_.find(identity);
    if (*type == Message::bye) {
        if (found != peers_.end())
            peers_.erase(found);
        else if (all)
            leave(*all, identity);
        return;
    }
    Asker* asker = found != peers_.end() ? &found->second : nullptr;
    if (!asker && all)
        if (const auto member = all->broadcast->members.find(identity); member != all->broadcast->members.end())
            asker = &member->second;
    if (!asker) {
        mirror::begin(message_, Message::unknown);
        sendTo(identity, message_);
        return;
    }
    handleOf(all ? *all : found->second, *asker, *type, in, bytes, body);
    noteHeard(all ? all->identity : identity);
}

/// Notes a peer once for all its consecutive messages.
void MirrorServer::Io::noteHeard(const std::string& identity) {
    if (heard_.empty() || heard_.back() != identity) heard_.push_back(identity);
}

/// `peer` is the asker, or stands for an broadcast with the asker in it.
void MirrorServer::Io::handleOf(Peer& peer, Asker& asker, Message type, wire::Reader& in,
                                std::span<const std::byte> bytes, std::span<const std::byte> body) {
    switch (type) {
        case Message::ack: {
            if (&asker != &peer) return garbage("an acknowledgement of a broadcast");
            std::uint64_t numbers[3];  // session, sequence, bytes
            if (!mirror::read(in, numbers)) return garbage("a malformed acknowledgement");
            if (numbers[0] != peer.session) return;  // sent before its last hello
            if (numbers[2] > peer.sentBytes || numbers[2] < peer.ackedBytes)
                return garbage("an acknowledgement of what was never sent");
            peer.debt = 0;  // messages arrive in order, so it has read everything before
            peer.ackedBytes = numbers[2];
            peer.awaitedAt = clock_.now();  // a peer that acknowledges by itself need not be asked
            peer.pace.acknowledged(numbers[2], peer.awaitedAt);
            // What an broadcast's joiners get is older than what it has.
            peer.ackedState = peer.broadcast ? std::max(peer.ackedState, numbers[1]) : numbers[1];
            break;
        }
        case Message::ping: {
            std::uint64_t token[1];
            if (!mirror::read(in, token)) return garbage("a malformed ping");
            const std::uint64_t answer[] = {token[0], clock_.nanoseconds()};
            mirror::write(message_, Message::pong, answer);
            sendTo(asker.identity, message_);
            break;
        }
        case Message::doubt:
        case Message::inspect:
        case Message::want:
            if (in.number<std::uint64_t>() != asker.session) break;
            if (&asker == &peer)
                question(peer, bytes);
            else if (auto& questions = peer.broadcast->questions; questions.size() < kMaxWaitingQuestions)
                questions.push_back({asker.identity, asker.session, {bytes.begin(), bytes.end()}});
            break;
        case Message::submit:
            submission(peer, asker, in, body);
            break;
        case Message::control:
            control(asker, in);
            break;
        default:
            break;
    }
    asker.heard = clock_.now();
}

/// Also sent to a peer that must join anew, as after a seek, because it said hello by the same connection.
void MirrorServer::Io::reply(const Shared::Control& control) {
    mirror::Words{control.session, control.text}.write(message_, Message::reply);
    sendTo(control.peer, message_);
}

void MirrorServer::Io::control(const Asker& asker, wire::Reader& in) {
    mirror::Words command;
    if (!command.readControl(in)) return garbage("a malformed control");
    if (command.session != asker.session) return;
    if (asker.upstream == MirrorUpstream::none)
        return reply({asker.identity, command.session, "refused: this server takes no requests"});
    const std::scoped_lock lock(shared_->mutex);
    // A seek may cost every peer a snapshot. No more seeks are taken than a frame has time for.
    if (shared_->controls.size() >= kMaxControls)
        return reply({asker.identity, command.session, "refused: too many commands wait"});
    shared_->controls.push_back({asker.identity, command.session, std::move(command.text)});
    shared_->callScene();
}

void MirrorServer::Io::refuse(const std::string& identity, const std::string& reason, bool forGood) {
    ++statistics_.refused;
    mirror::begin(message_, Message::refused);
    wire::putText(message_, reason);
    message_.put(static_cast<std::uint8_t>(forGood));
    sendTo(identity, message_);
}

void MirrorServer::Io::refuseVersion(const std::string& identity, std::uint8_t version) {
    warn(++foreigners_,
         fmt::format("refused a client: it speaks version {} of the protocol, and this server version {}", version,
                     mirror::kVersion));
    ++statistics_.refused;
    mirror::refuseVersion(message_, version);
    sendTo(identity, message_);
}

/// Reads the list of clients again. A file that makes no sense, as one that is half written, changes nothing.
void MirrorServer::Io::takeKeys() {
    MirrorServerOptions& options = shared_->options;
    if (!options.keys || !keyFile_.changed()) return;
    auto fresh = MirrorKeys::load(options.keyFile);
    if (!fresh)
        return shared_->report(Severity::warning, fresh.error().format() + ": the list of keys stays as it was");
    if (options.mode.mode == Mode::lossy && !fresh->upstream.empty())
        return shared_->report(
            Severity::warning,
            options.keyFile.string() + ": a lossy mirror takes no requests: the list of keys stays as it was");
    if (fresh->serverSecret != options.keys->serverSecret)
        shared_->report(Severity::warning,
                        options.keyFile.string() + ": another pair for the server counts from its next start on");
    options.keys->clientPublic = std::move(fresh->clientPublic);
    options.keys->upstream = std::move(fresh->upstream);
    options.keys->names = std::move(fresh->names);
    shared_->report(Severity::note, fmt::format("{}: {} clients are on the list", options.keyFile.string(),
                                                options.keys->clientPublic.size()));
    const auto judge = [&](auto& askers) {
        for (auto& [identity, asker] : askers) asker.upstream = upstreamOf(asker.user);
        std::erase_if(askers, [&](const auto& a) {
            if constexpr (std::same_as<std::decay_t<decltype(a.second)>, Peer>)
                if (a.second.broadcast) return false;
            return !isListed(a.second.user) && (refuse(a.first, kNotListed, true), true);
        });
    };
    for (auto& [identity, peer] : peers_)
        if (peer.broadcast) judge(peer.broadcast->members);
    judge(peers_);
}

bool MirrorServer::Io::isListed(const std::string& user) const {
    const auto& keys = shared_->options.keys;
    return !keys || std::ranges::find(keys->clientPublic, user) != keys->clientPublic.end();
}

MirrorUpstream MirrorServer::Io::upstreamOf(const std::string& user) const {
    if (shared_->options.keys)
        if (const auto own = shared_->options.keys->upstream.find(user); own != shared_->options.keys->upstream.end())
            return own->second;
    return shared_->options.upstream;
}

std::optional<std::uint32_t> MirrorServer::Io::streamFor(const mirror::Hello& hello) {
    const mirror::Wishes& wishes = hello.wishes;
    for (const auto& [part, stream] : streams_)
        if (part != 0 && stream.wishes.aspects == wishes.aspects && stream.wishes.parts == wishes.parts) return part;
    if (streams_.size() > shared_->options.maximumParts && !dropUnusedPart()) return std::nullopt;
    const std::uint32_t part = nextPart_++;
    Stream& stream = streams_.try_emplace(part, shared_->options.history).first->second;
    stream.wishes.aspects = wishes.aspects;
    stream.wishes.parts = wishes.parts;
    ByteBuffer text;
    stream.wishes.write(text);
    stream.epochMix = checksumOf(text.bytes());
    stream.used = clock_.now();
    MirrorShadow::Question question;
    question.kind = Kind::open;
    question.part = part;
    question.wishes = stream.wishes;
    // The peer may have an earlier state of the part, from this server or the one that it continues. The nodes at the
    // margin of a region depend on how the viewer moved; if they differ now, so does the hash.
    if (hello.epoch == (shared_->epoch ^ stream.epochMix)) question.frames = history_.allSince(hello.sequence);
    shadow_.ask(std::move(question));
    return part;
}

/// The name of the peer's key in the key file, else the name it gives itself; in an broadcast both, or its name behind
/// the broadcast's.
std::string MirrorServer::Io::authorOf(const mirror::Hello& hello, const std::string& user,
                                       const std::string& by) const {
    const std::string name = hello.name.empty() ? fmt::format("peer-{:04x}", hello.wishes.client & 0xFFFF) : hello.name;
    std::string known = by;
    if (shared_->options.keys)
        if (const auto own = shared_->options.keys->names.find(user); own != shared_->options.keys->names.end())
            known = own->second;
    if (by.empty()) return known.empty() ? name : known;
    return known + "/" + name;
}

void MirrorServer::Io::introduce(Asker& asker, const std::string& identity, const mirror::Hello& hello,
                                 const std::string& user, const std::string& by) {
    asker.identity = identity;
    asker.user = user;
    asker.author = authorOf(hello, user, by);
    asker.session = hello.session;
    asker.client = hello.wishes.client;
    asker.upstream = upstreamOf(user);
    asker.sameTypes = hello.dictionaryHash == dictionaryHash_;
    asker.noTypes = hello.dictionaryHash == 0;
    asker.heard = clock_.now();
}

void MirrorServer::Io::hello(const std::string& identity, const mirror::Hello& hello, const std::string& user) {
    // A connection outlasts the key with which it was made.
    if (!isListed(user)) return refuse(identity, kNotListed, true);
    auto found = peers_.find(identity);
    // The client is back with another connection, so the old one is of no use.
    if (hello.wishes.client != 0)
        std::erase_if(peers_,
                      [&](const auto& p) { return p.first != identity && p.second.client == hello.wishes.client; });
    if (found == peers_.end()) {
        if (peers_.size() >= shared_->options.maximumPeers) {
            warn(++crowded_, fmt::format("refused a peer: {} are here already", peers_.size()));
            return refuse(identity, "the server has as many peers as it takes");
        }
    }
    if (const auto refusal = MirrorPart::refusalOf(hello.wishes)) return refuse(identity, *refusal, true);
    if (isPartByRegion(hello.wishes) && clock_.now() < regionsAgain_) return refuse(identity, noRegions_);
    const std::optional<std::uint32_t> part = hello.wishes.partial() ? streamFor(hello) : 0;
    if (!part) return refuse(identity, "the server follows as many parts of the scene as it does at once");
    if (found == peers_.end()) found = peers_.emplace(identity, Peer{}).first;
    statistics_.maxPeers = std::max(statistics_.maxPeers, peers_.size());
    Peer& peer = found->second;
    const std::uint64_t debt = peer.debt + (peer.sentBytes - peer.ackedBytes) + head_.size() + kAnswerCost;
    if (debt > kLargestDebt) return garbage("a hello from a peer that reads no answers");
    const double allowance = peer.allowed == Clock::time_point{} ? kMaxQuestions : peer.allowance;
    peer = Peer{};
    introduce(peer, identity, hello, user);
    peer.to = identity;
    peer.toSession = hello.session;
    peer.debt = debt;
    peer.window = std::clamp(hello.window, kSmallestWindow, kLargestWindow);
    peer.spoken = peer.allowed = peer.heard;
    peer.allowance = allowance;
    if (hello.wishes.whenSlow <= static_cast<std::uint8_t>(MirrorWhenSlow::nearFirst))
        peer.whenSlow = static_cast<MirrorWhenSlow>(hello.wishes.whenSlow);
    if (hello.wishes.milliFrames > 0)
        peer.interval = std::chrono::duration_cast<Clock::duration>(1000s) / hello.wishes.milliFrames;
    std::uint64_t rate = hello.wishes.rate;
    if (const std::uint64_t maximum = shared_->options.maxBytesPerSecond; maximum > 0)
        rate = rate > 0 ? std::min(rate, maximum) : maximum;
    peer.pace = MirrorPace(hello.wishes.lag / 1e3, static_cast<double>(rate));
    peer.part = *part;
    peer.inputs =
        hello.wishes.inputs && shared_->options.mode.mode == Mode::input && peer.sameTypes && !hello.wishes.partial();
    const std::uint64_t epoch = shared_->epoch ^ streamOf(peer).epochMix;
    if (hello.epoch == epoch) peer.claim = Peer::Claim{hello.sequence, hello.wishes.hash};
    if (!historyOf(peer).empty()) enqueue(peer);
    if (!welcome(identity, hello.session, epoch, historyOf(peer).newest())) peers_.erase(found);
}

bool MirrorServer::Io::welcome(const std::string& to, std::uint64_t session, std::uint64_t epoch,
                               std::uint64_t newest) {
    const std::uint64_t numbers[] = {session, epoch, static_cast<std::uint64_t>(shared_->options.heartbeat.count()),
                                     newest, shared_->originMissed};
    mirror::write(message_, Message::welcome, numbers);
    return sendTo(to, message_, head_.bytes());
}

void MirrorServer::Io::enqueue(Peer& peer) {
    const std::optional<Peer::Claim> claim = std::exchange(peer.claim, std::nullopt);
    if (!claim || !historyOf(peer).continues(claim->state, claim->hash)) return;
    peer.placed = true;
    peer.state = peer.ackedState = claim->state;
    ++statistics_.resumed;
}

bool MirrorServer::Io::mayAsk(Peer& peer) {
    const Clock::time_point now = clock_.now();
    const double earned = std::chrono::duration<double>(now - peer.allowed).count() * kQuestionsPerSecond;
    peer.allowance = std::min(kMaxQuestions, peer.allowance + earned);
    peer.allowed = now;
    return !peer.asking && peer.allowance >= 1;
}

void MirrorServer::Io::question(Peer& peer, std::span<const std::byte> bytes) {
    if (!mayAsk(peer)) return garbage("a question too many");
    peer.allowance -= 1;
    peer.asking = true;
    peer.answer.reset();
    MirrorShadow::Question question;
    question.kind = Kind::peers;
    question.part = peer.part;
    question.peer = peer.identity;
    question.session = peer.session;
    question.text.assign(bytes.begin(), bytes.end());
    shadow_.ask(std::move(question));
}

void MirrorServer::Io::submission(Peer& peer, Asker& asker, wire::Reader& in, std::span<const std::byte> body) {
    std::uint64_t numbers[4];  // session, request, size, offset
    if (!mirror::read(in, numbers)) return garbage("a malformed submission");
    const auto [session, request, size, offset] = numbers;
    if (session != asker.session) return;
    // The author that it names is put behind its own name, so that nobody can use another's name.
    std::string author = asker.author;
    if (in.left()) {
        const std::string_view given = in.text();
        if (in.problem || given.size() > mirror::kLongestName) return garbage("a submission of nobody");
        author += "/" + std::string(given);
    }
    const char* problem = nullptr;
    const bool complete = asker.submission.add(request, size, offset, body, problem);
    if (problem) return garbage(problem);
    if (!complete) return;
    mirror::Submission whole{asker.client,  request,          asker.upstream, std::move(asker.submission.bytes),
                             asker.noTypes, std::move(author)};
    asker.submission = {};
    const mirror::Verdict* known = nullptr;
    switch (ledger_.standing(asker.client, request, known)) {
        case mirror::RequestLedger::Standing::pending:
            return;
        case mirror::RequestLedger::Standing::answered:
            if (known) peer.verdicts.push_back({asker.identity, asker.session, *known});
            return;
        case mirror::RequestLedger::Standing::fresh:
            break;
    }
    mirror::Verdict refusal{asker.client, request, 0, {}, {}, {}};
    if (!asker.sameTypes && !asker.noTypes) {
        refusal.refusal = "the node types here are others than there";
    } else {
        const std::scoped_lock lock(shared_->mutex);
        if (shared_->submittedBytes + whole.record.size() <= mirror::kMaxSubmitted &&
            ledger_.begin(asker.client, request)) {
            shared_->submittedBytes += whole.record.size();
            submitters_.insert(asker.client);
            shared_->submissions.push_back(std::move(whole));
            return shared_->callScene();
        }
        refusal.refusal = "too many requests wait for the scene";
    }
    peer.verdicts.push_back({asker.identity, asker.session, std::move(refusal)});
}

bool MirrorServer::Io::behind(const Peer& peer) const {
    return peer.placed && historyOf(peer).bytesFrom(peer.state) > peer.window;
}

/// True if waiting frames would be older on arrival than the peer wants.
bool MirrorServer::Io::late(const Peer& peer) const {
    return peer.placed && (peer.whenSlow == MirrorWhenSlow::coalesce || peer.whenSlow == MirrorWhenSlow::nearFirst) &&
           peer.pace.late(historyOf(peer).bytesFrom(peer.state));
}

/// A keyframe for a peer that has no state of ours: the last one if only few frames follow it, else a new one.
SharedRecord MirrorServer::Io::keyframeFor(Peer& peer) {
    SharedRecord keyframe = historyOf(peer).keyframe();
    const bool near =
        keyframe && historyOf(peer).bytesFrom(keyframe->header.to) <= keyframe->bytes.size() + kSmallBacklog;
    const Clock::time_point now = clock_.now();
    if (peer.waitingSince == Clock::time_point{}) peer.waitingSince = now;
    if (!near) {
        askForKeyframe(peer.part);
        if (!keyframe || now - peer.waitingSince < kPatience) return nullptr;
    }
    peer.waitingSince = {};
    ++statistics_.snapshots;
    return keyframe;
}

/// With `all` nothing waits that could.
void MirrorServer::Io::merge(Peer& peer, std::vector<SharedRecord> frames, bool all) {
    MirrorShadow::Question question;
    question.kind = Kind::merge;
    question.part = peer.part;
    question.nearFirst = peer.whenSlow == MirrorWhenSlow::nearFirst && (peer.held != 0 || late(peer));
    question.held = peer.held != 0;
    question.all = all || leaving_;
    question.budget = peer.pace.inTime();
    question.peer = peer.identity;
    question.session = peer.session;
    question.frames = std::move(frames);
    statistics_.merged += question.frames.size();
    peer.asking = true;
    peer.answer.reset();
    shadow_.ask(std::move(question));
}

/// Merges what waits for the peer with everything since, or up to the state of the answer that waits.
void MirrorServer::Io::mergeHeld(Peer& peer) {
    std::vector<SharedRecord> frames = historyOf(peer).framesFrom(peer.held, kMaxMerged);
    const bool all = peer.answer.has_value();
    if (all) {
        const std::uint64_t state = peer.answer->state;
        std::erase_if(frames, [state](const SharedRecord& frame) { return frame->header.to > state; });
        peer.after = std::exchange(peer.answer, std::nullopt);
    }
    merge(peer, std::move(frames), all);
}

SharedRecord MirrorServer::Io::mergeNow(Peer& peer, std::vector<SharedRecord> frames) {
    if (peer.whenSlow != MirrorWhenSlow::nearFirst)
        if (SharedRecord merged = merges_.merge(peer.part, frames)) {
            statistics_.merged += frames.size();
            return merged;
        }
    // An answer that waits for the peer's state has its turn after that.
    if (peer.answer) peer.after = std::exchange(peer.answer, std::nullopt);
    merge(peer, std::move(frames));
    return nullptr;
}

/// The next frame, or all frames that the peer lacks merged into one.
SharedRecord MirrorServer::Io::frameFor(Peer& peer) {
    SharedRecord next = historyOf(peer).frameFrom(peer.state);
    if (!next || next->header.to == historyOf(peer).newest()) return next;
    return mergeNow(peer, historyOf(peer).framesFrom(peer.state, kMaxMerged));
}

/// Leads towards the `state` of an answer that waits, frame by frame, or merged if that would be late.
SharedRecord MirrorServer::Io::frameTowards(Peer& peer, std::uint64_t state) {
    SharedRecord next = historyOf(peer).frameFrom(peer.state);
    if (!next || next->header.to >= state || !late(peer)) return next;
    std::vector<SharedRecord> frames = historyOf(peer).framesFrom(peer.state, kMaxMerged);
    std::erase_if(frames, [state](const SharedRecord& frame) { return frame->header.to > state; });
    return mergeNow(peer, std::move(frames));
}

SharedRecord MirrorServer::Io::nextFor(Peer& peer) {
    if (historyOf(peer).empty() || (peer.asking && !peer.answer)) return nullptr;
    if (peer.claim) enqueue(peer);
    if (peer.placed && !historyOf(peer).continues(peer.held != 0 ? peer.held : peer.state)) peer.placed = false;
    SharedRecord next;
    if (!peer.placed) {
        peer.asking = false;
        peer.answer.reset();
        peer.held = 0;
        if (!peer.broadcast) {
            next = keyframeFor(peer);
        } else {
            // Whoever lacks what came before asks for it.
            peer.placed = true;
            peer.state = peer.ackedState = historyOf(peer).newest();
        }
    } else if (peer.held != 0) {
        mergeHeld(peer);
    } else if (peer.state != historyOf(peer).newest()) {
        if (peer.answer) {
            next = frameTowards(peer, peer.answer->state);
        } else if (peer.interval.count() > 0) {
            const Clock::time_point now = clock_.now();
            if (now < peer.due) return nullptr;
            peer.due = std::max(peer.due + peer.interval, now);
            next = frameFor(peer);
        } else if ((!behind(peer) && !late(peer)) || peer.whenSlow == MirrorWhenSlow::block) {
            next = historyOf(peer).frameFrom(peer.state);
        } else if (peer.whenSlow == MirrorWhenSlow::resync) {
            peer.placed = false;
            next = keyframeFor(peer);
        } else {
            // The peer is a whole window behind, or frames are late. Frame by frame it would only fall back further.
            next = frameFor(peer);
        }
    }
    if (next) {
        peer.placed = true;
        peer.state = next->header.to;
    }
    return next;
}

/// Returns false if the peer is gone.
bool MirrorServer::Io::deliverAnswer(Peer& peer) {
    MirrorShadow::Answer& answer = *peer.answer;
    const bool merged = answer.kind == Kind::merge;
    if (peer.broadcast && !addressAnswer(peer, merged)) {
        peer.asking = false;
        peer.answer.reset();
        return true;
    }
    const std::uint64_t needed = merged && answer.record ? answer.record->header.from : answer.state;
    if (peer.held != 0 && !merged) return true;  // values that wait come first
    if (peer.placed && peer.state < needed && historyOf(peer).continues(peer.state)) return true;  // frames come first
    bool there = true;
    if (!answer.record && !answer.message) {
        if (merged)
            peer.placed = false;
        else
            garbage("a question that makes no sense");
    } else if (peer.placed && peer.state == needed) {
        if (!merged) ++(answer.record ? statistics_.repairs : statistics_.questions);
        if (answer.record) {
            peer.sending = codedFor(peer, answer.record);
            peer.running = false;
            peer.then.reset();
            peer.sent = 0;
            peer.state = answer.record->header.to;
            peer.held = answer.holds ? answer.state : 0;
        } else {
            there = sendTo(peer.to, *answer.message);
        }
    }
    if (peer.broadcast && !merged) peer.broadcast->questions.pop_front();
    peer.answer = std::exchange(peer.after, std::nullopt);
    peer.asking = peer.answer.has_value();
    return there;
}

bool MirrorServer::Io::deliverVerdicts(Peer& peer) {
    if (peer.verdicts.size() > kMaxVerdicts) peer.verdicts.clear();  // an honest peer never has that many
    while (!peer.verdicts.empty()) {
        const auto& [to, session, verdict] = peer.verdicts.front();
        if (verdict.refusal.empty() && (!peer.placed || peer.sending || peer.held != 0 || peer.state < verdict.state))
            break;
        verdict.write(message_, session);
        if (!sendTo(to, message_)) return false;
        peer.verdicts.pop_front();
    }
    return true;
}

/// The record in a coding that this peer can read. After a keyframe or merged frames a peer lacks what predictions
/// refer to. It gets raw frames until the next kForget, which is asked for here.
SharedRecord MirrorServer::Io::codedFor(Peer& peer, SharedRecord record) {
    if (!record || record->header.from == record->header.to || peer.broadcast) return record;
    const bool predicted = record->predicted != nullptr;
    peer.remembers = predicted && (peer.remembers || record->predicted->header.flags & kForget);
    if (peer.remembers) return record->predicted;
    // Not for peers that always get merged frames, and not more often than it pays.
    const Clock::time_point now = clock_.now();
    if (shared_->options.mode.coding != Coding::raw && peer.part == 0 && peer.interval.count() == 0 &&
        now - forgetAsked_ > kForgetEvery) {
        forgetAsked_ = now;
        shared_->wantForget = true;
    }
    return record;
}

SharedRecord MirrorServer::Io::asFollowed(Peer& peer, SharedRecord next) {
    if (!next || !peer.inputs) return codedFor(peer, next);
    if (peer.running && next->input) {
        peer.remembers = false;
        return next->input;
    }
    peer.then = next->runState;
    peer.running = peer.then != nullptr;
    if (!peer.running) shared_->wantRunState = true;
    return codedFor(peer, next);
}

bool MirrorServer::Io::sendChunk(Peer& peer) {
    const std::span<const std::byte> whole = peer.sending->bytes.bytes();
    const Clock::time_point now = clock_.now();
    const std::size_t maximum = std::min(peer.longest, peer.pace.chunk(kChunk, now));
    const std::span<const std::byte> part = whole.subspan(peer.sent, std::min(maximum, whole.size() - peer.sent));
    const bool later = peer.broadcast || (part.size() == whole.size() && mayWait(peer, part.size(), now));
    const std::uint64_t numbers[] = {peer.toSession, whole.size(), peer.sent, peer.sending->published, later};
    mirror::write(message_, Message::data, numbers);
    if (!sendTo(peer.to, message_, part, peer.sending)) return false;
    peer.spoken = now;
    peer.sent += part.size();
    peer.sentBytes += part.size();
    peer.pace.sent(peer.sentBytes, now, !later);
    if (!later) {
        peer.awaitedBytes = peer.sentBytes;
        peer.awaitedAt = now;
    }
    statistics_.bytes += part.size();
    if (peer.sent == whole.size()) peer.sending.reset();
    return true;
}

/// Returns whether the peer may delay its acknowledgement of so many more bytes. Each is a message that wakes four
/// threads; with credit enough, one for several frames will do.
bool MirrorServer::Io::mayWait(const Peer& peer, std::uint64_t size, Clock::time_point now) const {
    const bool isSeldom = size <= kSmall && now - peer.spoken > kAskEvery;
    return peer.debt == 0 && peer.whenSlow != MirrorWhenSlow::block &&
           now - peer.awaitedAt < (isSeldom ? kAskSeldom : kAskEvery) &&
           peer.sentBytes + size - peer.ackedBytes <= peer.window / 4 && (isSeldom || peer.pace.spare(size, now));
}

/// Pings a client that was allowed to delay its acknowledgements, so that it sends one. Returns false if the peer is
/// gone.
bool MirrorServer::Io::askForAcknowledgement(Peer& peer) {
    if (peer.awaitedBytes == peer.sentBytes) return true;
    peer.awaitedBytes = peer.sentBytes;
    peer.spoken = peer.awaitedAt = clock_.now();
    return ping(peer);
}

void MirrorServer::Io::askAllForAcknowledgements() {
    for (auto peer = peers_.begin(); peer != peers_.end();)
        peer = askForAcknowledgement(peer->second) ? ++peer : peers_.erase(peer);
}

/// True if the peer has credit in bytes and in time.
bool MirrorServer::Io::mayPass(Peer& peer) {
    const std::uint64_t record = peer.sending ? peer.sending->bytes.size() : 0;
    const Clock::time_point now = clock_.now();
    if (peer.sentBytes - peer.ackedBytes < peer.window && peer.pace.open(record, now)) return true;
    if (peer.sending || (peer.placed && peer.state != historyOf(peer).newest())) peer.pace.held(now);
    return false;
}

bool MirrorServer::Io::pump(Peer& peer) {
    if (peer.broadcast) askNext(peer);
    while (mayPass(peer)) {
        if (peer.answer && !peer.sending && !peer.then && !deliverAnswer(peer)) return false;
        if (!peer.sending) {
            if (peer.broadcast) {
                peer.to = peer.identity;
                peer.toSession = 0;
                answerJoiners(peer);
            }
            peer.sending = peer.then ? std::exchange(peer.then, nullptr) : asFollowed(peer, nextFor(peer));
            peer.sent = 0;
        }
        if (!peer.sending) break;
        if (!sendChunk(peer)) return false;
    }
    // An acknowledgement that the peer has delayed would give credit.
    if (!mayPass(peer) && !askForAcknowledgement(peer)) return false;
    return peer.verdicts.empty() || deliverVerdicts(peer);
}

}  // namespace rtsg
