// The connection of a mirror's client: hello, pings, messages in and out, credit.
#include <algorithm>
#include <random>
#include <utility>

#include <fmt/format.h>
#include <poll.h>

#include "client_impl.h"
#include "sockets/rare_warning.h"

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr auto kConnectWithin = 2000ms, kConnectQuickly = 20ms;  // for an attempt, at most and at least
constexpr auto kAttemptsFor = 2s;                                // attempts with one such time at first; then longer,
constexpr int kMaxAttemptsFor = 8;                               // up to this many times
constexpr auto kHelloAgain = 500ms;                              // after a refusal or a goodbye
constexpr auto kHelloLost = 2s;                                  // without any answer at first; doubled each time
constexpr int kMaxDoublings = 4;
constexpr auto kLongestWait = 20ms;  // the most that poll() exceeds its timeout while frames keep coming
constexpr auto kQuiet = 400ms;       // after a heartbeat: then the server counts as lost, but may come back
constexpr auto kStreams = 250ms;     // longest pause between records that follow each other closely
constexpr auto kStreamEnds = 500ms;  // after such records: the server is asked whether it is there
constexpr auto kLookAtBytes = 250ms;
constexpr double kMoreThanPings = 1000;  // bytes a second; the connection brings more than pings
constexpr auto kPingAtFirst = 20ms;      // until there are some samples of the clock; then ever more rarely,
constexpr auto kPingLater = 3000ms;      // up to this, as each ping wakes four threads
constexpr std::uint64_t kFewSamples = 4, kDoublings = 7;
constexpr int kPortion = 64;        // messages at a time, because applying a long run of frames takes time
constexpr auto kRequestAgain = 1s;  // if there is no verdict
constexpr auto kAwake = 500ms;      // by which a wait may end late while the machine is busy
constexpr auto kAway = 1s;          // between two looks of a user who looks now and then; what is more is no silence
constexpr auto kAnswerWithin = 3s;  // for a question about hashes

std::uint64_t randomNumber() {
    std::random_device device;
    return std::uint64_t{device()} << 32 | device();
}

}  // namespace

MirrorClient::Impl::Impl(Scene& replica, MirrorClientOptions options)
    : replica_(replica),
      nextProvisional_(0),
      options_(std::move(options)),
      time_(options_.transport->clock()),
      decoder_(builtinTypes()),
      dictionaryHash_(decoder_.localHash()),
      originTypes_(dictionaryHash_) {}

MirrorClient::Impl::~Impl() {
    mirror::begin(message_, Message::bye);
    send();
}

/// Sends only if there is a connection. The message might be kept for the next one, where it has no meaning.
bool MirrorClient::Impl::send() {
    return linked() && connection_->send(message_.bytes());
}

bool MirrorClient::Impl::control(std::string_view command) {
    if (!connected_) return false;
    if (command.size() > mirror::kLongestControl) {  // cut off, it might mean something else
        replies_.push_back(fmt::format("refused: a command has at most {} bytes", mirror::kLongestControl));
        return true;
    }
    mirror::Words{session_, std::string(command)}.write(message_, Message::control);
    if (!send()) return false;
    commands_.push_back(session_);
    return true;
}

/// Replies come in the order of the commands. Their session may have ended, for example by a seek.
void MirrorClient::Impl::answered(const mirror::Words& reply) {
    const auto asked = std::ranges::find(commands_, reply.session);
    if (asked == commands_.end()) return;
    loseCommands(asked - commands_.begin());
    commands_.pop_front();
    replies_.push_back(reply.text);
}

/// The first `count` commands will get no reply any more.
void MirrorClient::Impl::loseCommands(std::ptrdiff_t count) {
    commands_.erase(commands_.begin(), commands_.begin() + count);
    for (; count > 0; --count)
        replies_.emplace_back("refused: the connection was lost before an answer came; it may have been carried out");
}

void MirrorClient::Impl::report(Severity severity, std::string text) {
    if (diagnostics_.size() < 100) diagnostics_.push_back({severity, endpoint_, {}, std::move(text)});
}

std::optional<Diagnostic> MirrorClient::Impl::takeRefusedPolls() {
    const std::uint64_t polls = foreignPolls_.exchange(0, std::memory_order_relaxed);
    if (polls == 0) return std::nullopt;
    return Diagnostic{
        Severity::error,
        endpoint_,
        {},
        fmt::format("poll() came from another thread than the replica's, which would refuse what it brings: "
                    "{} calls did nothing",
                    polls)};
}

void MirrorClient::Impl::garbage(std::string text) {
    if (auto reported = mirror::reportedOf(++statistics_.garbage, "ignored " + std::move(text)))
        report(Severity::warning, std::move(*reported));
}

Result<> MirrorClient::Impl::start(const std::string& endpoint) {
    endpoint_ = endpoint;
    auto connection =
        options_.transport->connect(endpoint, {options_.keys ? &*options_.keys : nullptr, kConnectWithin});
    if (!connection) return std::unexpected(connection.error());
    connection_ = std::move(*connection);
    session_ = randomNumber();
    client_ = randomNumber();
    return {};
}

/// With `afresh` the server begins with a keyframe, whatever state the replica is in.
void MirrorClient::Impl::hello(bool afresh) {
    ++session_;  // messages of the last session that are still under way are ignored
    received_ = acknowledged_ = 0;
    partial_.clear();
    playout_.clear();
    bisection_.stop();
    connected_ = false;
    if (afresh) haveState_ = false;
    mirror::Hello greeting;
    greeting.session = session_;
    greeting.dictionaryHash = dictionaryHash_;
    greeting.epoch = haveState_ ? epoch_ : 0;
    greeting.sequence = haveState_ ? state_ : 0;
    greeting.window = options_.window;
    greeting.name = options_.name;
    greeting.wishes.client = client_;
    greeting.wishes.whenSlow = static_cast<std::uint8_t>(options_.whenSlow);
    greeting.wishes.milliFrames = static_cast<std::uint32_t>(std::clamp(options_.framesPerSecond, 0.0, 1e6) * 1000);
    greeting.wishes.parts = options_.parts;
    greeting.wishes.inputs = options_.inputs && options_.latency.count() == 0 && inputTroubles_ < kMaxInputTroubles;
    if (options_.whenSlow == MirrorWhenSlow::coalesce || options_.whenSlow == MirrorWhenSlow::nearFirst)
        greeting.wishes.lag = static_cast<std::uint32_t>(std::clamp<std::int64_t>(options_.maxLag.count(), 0, 1 << 30));
    greeting.wishes.rate = options_.maxBytesPerSecond;
    if (haveState_) greeting.wishes.hash = stateHash_;
    running_ = false;
    for (const Aspect aspect : options_.aspects)
        greeting.wishes.aspects |= std::uint32_t{1} << static_cast<unsigned>(aspect);
    greeting.write(message_);
    helloPending_ = !send();
    if (!helloPending_) ++unanswered_;
    greeted_ = time_.now();
}

/// Another hello makes the answer to the last one void. On a slow link that answer may take seconds.
bool MirrorClient::Impl::mayGreet(Clock::time_point now) const {
    const Clock::duration after =
        unanswered_ > 0 ? Clock::duration(kHelloLost) * (1 << std::min(unanswered_ - 1, kMaxDoublings)) : kHelloAgain;
    return helloPending_ || (!connected_ && now - greeted_ > after);
}

/// A lost connection is known at once and not only by silence. The next hello is sent when there is another connection.
void MirrorClient::Impl::watchConnection() {
    while (true) {
        switch (connection_->nextEvent()) {
            case Connection::Event::none:
                return;
            case Connection::Event::up:
                up_ = true;
                if (!connected_) helloPending_ = true;
                break;
            case Connection::Event::down:
                up_ = false;
                cut_ = true;
                break;
        }
    }
}

/// Call it when all messages of the lost connection have been read, because the last one may be a goodbye.
void MirrorClient::Impl::connectionLost() {
    cut_ = false;
    connected_ = false;
    unanswered_ = 0;
    helloPending_ = true;
    if (!lostAt_) lostAt_ = heard_;
    loseCommands(std::ssize(commands_));
}

/// True if bytes are arriving. A message is handed over when it is complete, which takes seconds on a slow link.
bool MirrorClient::Impl::bringsBytes(Clock::time_point now) {
    const std::chrono::duration<double> since = now - lookedAt_;
    if (since < kLookAtBytes) return false;
    const std::optional<std::uint64_t> bytes = connection_->bytesCome();
    if (!bytes) return false;
    lookedAt_ = now;
    const std::uint64_t before = std::exchange(brought_, *bytes);
    return *bytes > before && static_cast<double>(*bytes - before) >= kMoreThanPings * since.count();
}

bool MirrorClient::Impl::receiving() const {
    return connected_ && !relayLost_ && time_.now() - coming_ <= heartbeat_ + kQuiet;
}

/// With `idle` no message waits to be read, so a silence is the server's and not ours.
void MirrorClient::Impl::keepInTouch(bool idle) {
    const Clock::time_point now = time_.now();
    if (idle && connected_ && linked() && bringsBytes(now)) heard_ = coming_ = now;
    // Frames came in close sequence and then stopped. The scene rests or the server is lost, so it is asked once.
    if (idle && linked() && streams_ && now - heard_ > kStreamEnds) {
        streams_ = false;
        ping(now);
    }
    const auto answersIn =
        kQuiet + std::chrono::duration_cast<Clock::duration>(4 * std::chrono::duration<double>(clock_.delay()));
    const bool unanswered =
        askedSince_ > heard_ && now - askedSince_ > answersIn && now - heard_ > kStreamEnds + kQuiet;
    quiet_ = idle && (now - heard_ > heartbeat_ + kQuiet || unanswered);
    if (linked() && mayGreet(now)) {
        hello(false);
    } else if (idle && connected_ && now - heard_ > options_.timeout) {
        report(Severity::note, "the server has gone silent");
        connectionLost();
        attempts_ = 0;
        reconnect(now);
    } else if (!connected_ && attempts_ > 0 &&
               now - reconnected_ > kAttemptsFor * std::min(attempts_, kMaxAttemptsFor)) {
        reconnect(now);
    }
    if (!connected_) return;
    attempts_ = 0;
    pingNow(now);
    sendRequests();
    if (bisection_.running() && now - asked_ > kAnswerWithin) {
        if (diverged_)
            giveUpRepair("the server does not answer questions");
        else
            bisection_.stop();
    }
    scrub(now);
}

/// After a silence TCP waits as long again before it retries. A new connection, tried every few round trips, works as
/// soon as the link does. Every other attempt waits longer, because the delay may have grown.
void MirrorClient::Impl::reconnect(Clock::time_point now) {
    reconnected_ = now;
    up_ = false;
    const auto trips =
        clock_.known() ? std::chrono::milliseconds(static_cast<int>(4e3 * clock_.delay())) : kConnectWithin;
    connection_->reconnect(attempts_++ % 2 ? kConnectWithin : std::clamp(trips, kConnectQuickly, kConnectWithin));
}

void MirrorClient::Impl::pingNow(Clock::time_point now) {
    const std::uint64_t known = clock_.samples(),
                        doublings = std::min(kDoublings, known - std::min(known, kFewSamples));
    if (now - pinged_ < std::min<Clock::duration>(kPingLater, kPingAtFirst * (1 << doublings))) return;
    ping(now);
}

void MirrorClient::Impl::ping(Clock::time_point now) {
    pinged_ = now;
    if (askedSince_ <= heard_) askedSince_ = now;
    if (received_ != acknowledged_) acknowledge();  // in the same packet, so nobody needs to ask for it
    const std::uint64_t token[] = {time_.nanoseconds()};
    mirror::write(message_, Message::ping, token);
    send();
}

/// Time in which this process was stopped, or did something else, is no silence of the server. `expected`: how long it
/// may have been since the last call.
void MirrorClient::Impl::forgetPause(Clock::duration expected) {
    const Clock::time_point now = time_.now();
    const Clock::duration pause = now - std::exchange(looked_, now) - expected;
    if (pause <= Clock::duration::zero()) return;
    for (Clock::time_point* time : {&heard_, &coming_, &askedSince_, &asked_}) *time = std::min(now, *time + pause);
}

/// Waits at most so long, and returns whether something may have come. Messages that no descriptor tells are read
/// before there is a wait.
bool MirrorClient::Impl::wait(std::chrono::milliseconds maximum) {
    if (!connection_->foundEmpty()) return true;  // events of the connection are read after its messages
    const auto [messages, events] = connection_->descriptors();
    pollfd items[] = {{messages, POLLIN, 0}, {events, POLLIN, 0}, {wakes_, POLLIN, 0}};
    const std::chrono::milliseconds due = untilDue(maximum);
    forgetPause(kAway);
    const int ready = time_.wait(items, due);
    forgetPause(due + kAwake);
    if (ready > 0 && items[1].revents) watchConnection();
    called_ = called_ || ready < 0 || (ready > 0 && items[2].revents);
    return ready > 0;
}

/// The same rules as in wait() and poll(): a socket that was not read until it was empty may hold messages that no
/// descriptor announces.
MirrorClient::Waiting MirrorClient::Impl::waiting() const {
    MirrorClient::Waiting waiting;
    waiting.descriptors = connection_->descriptors();
    if (connection_->foundEmpty() && !cut_ && !(helloPending_ && linked())) waiting.maximum = untilDue(longestSleep());
    return waiting;
}

/// How long to sleep if nothing comes. While all is well little is due.
std::chrono::milliseconds MirrorClient::Impl::longestSleep() const {
    const bool settled = connected_ && clock_.samples() >= kFewSamples && requests_.empty() && !bisection_.running();
    if (!settled) return 100ms;
    if (quiet_) return 250ms;
    if (streams_ || askedSince_ > heard_) return 100ms;
    const Clock::time_point due = std::min({pinged_ + kPingLater, heard_ + heartbeat_ + kQuiet, time_.now() + 2000ms});
    return std::max(20ms, std::chrono::ceil<std::chrono::milliseconds>(due - time_.now()));
}

std::size_t MirrorClient::Impl::poll(std::chrono::milliseconds timeout) {
    applied_ = 0;
    called_ = false;
    const bool lost = originLost();
    const Clock::time_point start = time_.now();
    const auto longest = std::max<Clock::duration>(timeout, kLongestWait);
    Clock::duration spent{};
    bool more = false;
    while (true) {
        auto maximum = std::clamp<std::chrono::milliseconds>(
            std::chrono::ceil<std::chrono::milliseconds>(timeout - spent), 0ms, longestSleep());
        // There is something to do, or more may follow, as frames follow a keyframe.
        if (more || cut_ || (helloPending_ && linked())) maximum = 0ms;
        const int messages = wait(maximum) ? receivePortion() : 0;
        statistics_.messages += static_cast<std::uint64_t>(messages);
        // Everything that came before the connection's event was there when the event was read.
        if (messages == 0 && cut_) connectionLost();
        keepInTouch(messages == 0);
        playDue();
        if (received_ != acknowledged_ && (awaited_ || received_ - acknowledged_ > options_.window / 4)) acknowledge();
        spent = time_.now() - start;
        more = messages > 0 && spent < longest && moreWaits_;
        if (more) continue;
        if (applied_ > 0 || called_ || originLost() != lost || spent >= timeout) break;
    }
    statistics_.sequence = state_;
    statistics_.originSequence = std::max({originAt_, newestHeard_, state_});
    return applied_;
}

/// Receives messages for a limited time. A user who makes a picture of each state takes long for a few of them, and the
/// server must hear from us meanwhile.
int MirrorClient::Impl::receivePortion() {
    const Clock::time_point start = time_.now();
    int messages = 0;
    moreWaits_ = true;
    while (messages < kPortion && time_.now() - start < kLongestWait) {
        moreWaits_ = receiveOne();
        if (!moreWaits_) break;
        ++messages;
    }
    return messages;
}

bool MirrorClient::Impl::receiveOne() {
    Received message;
    if (!connection_->receive(message)) return false;
    if (message.problem) {
        garbage(message.problem);
        return true;
    }
    wire::Reader in(message.first);
    const std::optional<Message> type = mirror::readPrologue(in);
    if (!type) {
        if (const auto version = mirror::foreignVersion(message.first); version && !connected_) {
            meetVersion(*version, message.first);
            return true;
        }
        garbage(fmt::format("a message of {} bytes that is none of this protocol", message.first.size()));
        return true;
    }
    heard_ = time_.now();
    // Answers may still follow a goodbye. Only a new welcome cancels it.
    if (*type == Message::bye) serverLeft_ = true;
    receive(*type, in, message);
    return true;
}

/// A server of another version refuses us in words, if it knows how versions meet. Later messages of that kind are
/// nobody's who has welcomed us.
void MirrorClient::Impl::meetVersion(std::uint8_t version, std::span<const std::byte> bytes) {
    wire::Reader in(bytes.subspan(mirror::kPrologue));
    refusal_ = mirror::versionText(version);
    if (mirror::foreignType(bytes) == Message::refused)
        if (const std::string_view said = in.text(); !in.problem) refusal_ = said;
    turnedAway_ = false;
    greeted_ = time_.now();
}

void MirrorClient::Impl::receive(Message type, wire::Reader& in, const Received& message) {
    std::uint64_t numbers[2];
    switch (type) {
        case Message::welcome:
            return welcome(in, message.second);
        case Message::data:
            return data(in, message.second);
        case Message::ping: {
            std::uint64_t token[1];
            if (!mirror::read(in, token)) return garbage("a malformed ping");
            if (haveState_) newestHeard_ = std::max(newestHeard_, token[0]);
            hearOrigin(in);
            mirror::write(message_, Message::pong, token);
            send();
            awaited_ = true;
            return noticeLoss(token[0]);
        }
        case Message::pong:
            if (!mirror::read(in, numbers)) return;
            clock_.sample(numbers[0], numbers[1], time_.nanoseconds());
            statistics_.clockOffset = clock_.offset();
            statistics_.delay = clock_.delay();
            statistics_.clockSamples = clock_.samples();
            return;
        case Message::bye:
            hearOrigin(in);
            mirror::begin(message_, Message::bye);
            send();
            loseCommands(std::ssize(commands_));
            connected_ = false;  // says hello again in a while
            if (!lostAt_) lostAt_ = heard_;
            unanswered_ = 0;
            greeted_ = time_.now();
            return report(Severity::note, "the server said goodbye");
        case Message::unknown:
            if (connected_) hello(false);
            return;
        case Message::refused:
            refusal_ = in.text();
            turnedAway_ = !in.left() || in.number<std::uint8_t>() == 0;
            connected_ = false;
            unanswered_ = 0;
            greeted_ = time_.now();
            return;
        case Message::reply: {
            mirror::Words reply;
            if (!reply.read(in)) return garbage("a malformed reply");
            return answered(reply);
        }
        case Message::digest:
        case Message::anatomy:
        case Message::verdict:
            if (connected_) arrived(message.first, false, 0);
            return;
        default:
            return garbage(fmt::format("a message of unknown type {}", static_cast<unsigned>(type)));
    }
}

/// Reads what a server appends to a ping or goodbye: the scene's state, which it may not have sent yet, and whether it
/// is a relay that has lost its origin.
void MirrorClient::Impl::hearOrigin(wire::Reader& in) {
    std::uint64_t numbers[1];
    if (!connected_ || !mirror::read(in, numbers)) return;
    originAt_ = std::max(originAt_, numbers[0]);
    const bool lost = in.left() && mirror::read(in, numbers) && (numbers[0] & 1) != 0;
    if (lost && !relayLost_) relayLostAt_ = heard_;
    relayLost_ = lost;
}

bool MirrorClient::Impl::originLost() const {
    return !connected_ || relayLost_ || quiet_;
}

void MirrorClient::Impl::welcome(wire::Reader& in, std::span<const std::byte> part) {
    std::uint64_t numbers[3];  // session, epoch, heartbeat
    if (!mirror::read(in, numbers)) return garbage("a malformed welcome");
    if (numbers[0] != session_) return;
    if (const auto intact = checkRecord(part, 0, options_.maxRecord); !intact)
        return garbage("a damaged head: " + intact.error().text);
    const Result<StreamHead> head = decodeHead(part);
    if (!head) return garbage("a head: " + head.error().text);
    if (head->formatVersion < kFormatVersion) {
        refusal_ = fmt::format("the server is of an earlier version: its hashes are those of format {}, ours of {}",
                               head->formatVersion, kFormatVersion);
        return;
    }
    if (auto ok = decoder_.setHead(*head); !ok) {
        refusal_ = ok.error().text;
        return;
    }
    if (decoder_.exact()) dictionaryHash_ = decoder_.localHash();
    originTypes_ = head->dictionaryHash;
    const auto misfits = [&](const Request& request) { return request.types != originTypes_; };
    for (const Request& request : requests_)
        if (misfits(request))
            verdicts_.push_back({request.number, "the origin has other node types than when this was asked", 0, {}});
    std::erase_if(requests_, misfits);
    std::uint64_t newest[1] = {0}, missed[1] = {relayMissed_};
    if (in.left() && mirror::read(in, newest) && in.left()) (void)mirror::read(in, missed);
    if (numbers[1] != epoch_) {
        if (missed[0] > relayMissed_ && !lostAt_) lostAt_ = relayLostAt_;
        if (epoch_ != 0) {
            ++statistics_.restarts;
            report(Severity::note, "the server is another run of the scene");
            // Node numbers have another meaning now, and nobody knows which requests were carried out.
            for (const Request& request : requests_)
                verdicts_.push_back({request.number, "the server started over", 0, {}});
            requests_.clear();
        }
        haveState_ = false;
        newestHeard_ = originAt_ = 0;
        epoch_ = numbers[1];
        clock_.reset();
    }
    originAt_ = std::max(originAt_, newest[0]);
    relayMissed_ = missed[0];
    for (Request& request : requests_) request.sent = 0;
    refusal_.clear();
    unanswered_ = 0;
    serverLeft_ = turnedAway_ = relayLost_ = false;
    connected_ = true;
    heartbeat_ = std::chrono::milliseconds(std::min<std::uint64_t>(numbers[2], 60000));
    acknowledge();  // tells the server that everything before has been read
}

/// A record that was sent did not arrive, and no later frame or credit will show it, so the server waits for us. Says
/// hello again.
void MirrorClient::Impl::noticeLoss(std::uint64_t sent) {
    const std::uint64_t here = haveState_ ? state_ : 0;
    if (!connected_ || sent <= here || sent > originAt_ || !partial_.empty() || !playout_.empty()) return;
    ++statistics_.gaps;
    report(Severity::note, fmt::format("frames {} to {} are missing", here + 1, sent));
    hello(false);
}

void MirrorClient::Impl::data(wire::Reader& in, std::span<const std::byte> part) {
    std::uint64_t numbers[4];  // session, size, offset, published
    if (!mirror::read(in, numbers)) return garbage("malformed data");
    const auto [session, size, offset, published] = numbers;
    if (session != session_ || !connected_) return;
    const Clock::time_point before = std::exchange(dataAt_, time_.now());
    streams_ = streams_ || dataAt_ - before < kStreams;
    std::uint64_t later[1] = {0};
    if (in.left() >= sizeof(later)) (void)mirror::read(in, later);
    if ((later[0] & 1) == 0) awaited_ = true;
    if (size > options_.maxRecord) {
        refusal_ = fmt::format("it sends a record of {} bytes, {} are the most taken", size, options_.maxRecord);
        return;
    }
    if (part.empty() || part.size() > size || offset > size - part.size())
        return garbage(fmt::format("{} bytes from {} on of a record of {}", part.size(), offset, size));
    coming_ = heard_;
    received_ += part.size();
    statistics_.bytes += part.size();
    if (offset == 0 && part.size() == size) {
        partial_.clear();
        return arrived(part, true, published);
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
    // Gives credit for the next parts while this record is incomplete.
    if (received_ - acknowledged_ > options_.window / 4) acknowledge();
    if (partial_.size() < size) return;
    ByteBuffer whole;
    whole.swap(partial_);
    arrived(whole.bytes(), true, published);
    whole.swap(partial_);
    partial_.clear();
}

void MirrorClient::Impl::acknowledge() {
    const std::uint64_t numbers[] = {session_, haveState_ ? state_ : 0, received_};
    mirror::write(message_, Message::ack, numbers);
    if (!send()) return;
    acknowledged_ = received_;
    awaited_ = false;
}

/// Returns false if the socket takes no more for now.
bool MirrorClient::Impl::sendRequests() {
    if (!linked()) return false;
    const Clock::time_point now = time_.now();
    for (Request& request : requests_) {
        const std::span<const std::byte> whole = request.record.bytes();
        // The answer may have been lost, so it is sent again. The server carries out none twice.
        if (request.sent == whole.size() && now - request.sentAt > kRequestAgain) request.sent = 0;
        while (request.sent < whole.size()) {
            const auto part = whole.subspan(request.sent, std::min(mirror::kSubmitPart, whole.size() - request.sent));
            const std::uint64_t numbers[] = {session_, request.number, whole.size(), request.sent};
            mirror::write(message_, Message::submit, numbers);
            if (!request.author.empty()) wire::putText(message_, request.author);
            if (!connection_->send(message_.bytes(), part)) return false;
            request.sent += part.size();
            request.sentAt = now;
        }
    }
    return true;
}

}  // namespace rtsg
