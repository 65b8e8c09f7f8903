// The scene's side of a mirror server: encodes each published set once, and carries out requests of peers.
#include <rtsg/sync/mirror_server.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <random>

#include <fmt/format.h>
#include <poll.h>

#include <rtsg/core/frame_input.h>
#include <rtsg/sync/input_codec.h>
#include <rtsg/sync/mirror_client.h>

#include "edits/request_order.h"
#include "server_io.h"

namespace rtsg {

namespace {

constexpr std::size_t kMaxForwarded = 64;  // commands that wait for the origin's answer
constexpr auto kLongestWaitForLog = std::chrono::hours(24);

}  // namespace

void MirrorServer::Shared::post(Item item) {
    {
        const std::scoped_lock lock(mutex);
        if (failure[0]) return;  // nobody would take it
        inbox.push_back(std::move(item));
    }
    awaken();
}

void MirrorServer::Shared::answer(mirror::Verdict verdict) {
    const std::scoped_lock lock(mutex);
    verdicts.push_back(std::move(verdict));
}

void MirrorServer::Shared::report(Severity severity, std::string text) {
    const std::scoped_lock lock(mutex);
    if (diagnostics.size() < 100) diagnostics.push_back({severity, endpoint, {}, std::move(text)});
}

Result<> MirrorServer::Shared::result() {
    const std::scoped_lock lock(mutex);
    if (!failure[0]) return {};
    return fail(fmt::format("the server's thread has ended: {}", failure), {}, endpoint);
}

/// Belongs to the scene's thread. The encoder keeps its buffers between frames.
struct MirrorServer::Encoder {
    explicit Encoder(const StreamMode& mode) : predicting(mode) {}
    ChangeEncoder encoder, predicting;
    InputEncoder inputs;
    std::uint64_t last = 0;
    std::uint64_t starts = 0;  // how often the scene has started over since sendWhatIsLogged()
    bool started = false, predicts = false;
};

MirrorServer::MirrorServer(Scene& scene, std::shared_ptr<Shared> shared)
    : scene_(scene),
      shared_(std::move(shared)),
      encoder_(std::make_unique<Encoder>(shared_->options.mode)),
      writers_(std::make_unique<mirror::Writers>(
          mirror::Writers{.pointers = {}, .history = {}, .locks = mirror::NodeLocks(shared_->clock())})),
      order_(std::make_unique<mirror::RequestOrder>(scene, *writers_)) {}

Result<std::unique_ptr<MirrorServer>> MirrorServer::start(Scene& scene, const std::string& endpoint,
                                                          MirrorServerOptions options) {
    if (!options.transport) options.transport = zmqTransport();
    const Result<bool> local = options.transport->isLocal(endpoint);
    if (!local) return std::unexpected(local.error());
    if (!*local && !options.keys && !options.insecure)
        return fail(
            DiagnosticCode("keys"),
            fmt::format("'{}' can be reached from other machines: give keys, or ask for an insecure server", endpoint));
    if (options.keys)
        if (auto ok = options.keys->checkForServer(); !ok) return std::unexpected(ok.error());
    if (options.mode.mode == Mode::lossy &&
        (options.upstream != MirrorUpstream::none || (options.keys && !options.keys->upstream.empty())))
        return fail("a lossy mirror takes no requests: the scene that it serves is not the one to be changed");
    auto shared = std::make_shared<Shared>();
    const auto before = std::exchange(options.before, {});
    shared->options = std::move(options);
    std::random_device device;
    const std::uint64_t fresh = std::uint64_t{device()} << 32 | device();
    shared->epoch = shared->options.epoch ? shared->options.epoch : fresh;
    std::unique_ptr<MirrorServer> server(new MirrorServer(scene, shared));
    server->io_ = std::make_unique<Io>(shared);
    // Do this before peers can ask, because they come back at once.
    for (const auto& set : before) {
        const std::shared_ptr<EncodedRecord> record = shared->pool->take();
        server->encoder_->encoder.encode(*set, record->bytes);
        finishRecord(*record);
        shared->post({record, false, false, true});
    }
    if (auto ok = server->io_->start(endpoint); !ok) return std::unexpected(ok.error());
    if (shared->options.mode.mode == Mode::input) scene.setInputRecording(true);
    server->attachment_ = scene.bus().attach(*server);
    return server;
}

MirrorServer::~MirrorServer() {
    if (log_) log_->onAcknowledged({});
    attachment_.detach();
    io_.reset();
}

const std::string& MirrorServer::endpoint() const {
    return shared_->endpoint;
}
std::uint64_t MirrorServer::epoch() const {
    return shared_->epoch;
}
std::string MirrorServer::subscriberName() const {
    return "mirror server " + shared_->endpoint;
}

MirrorServerStatistics MirrorServer::statistics() const {
    const std::scoped_lock lock(shared_->mutex);
    MirrorServerStatistics result = shared_->statistics;
    result.coded = shared_->coded;
    return result;
}

std::vector<Diagnostic> MirrorServer::takeDiagnostics() {
    const std::scoped_lock lock(shared_->mutex);
    return std::exchange(shared_->diagnostics, {});
}

/// Encodes the input once, for all peers that run the cascade themselves.
void MirrorServer::encodeInput(const ChangeSet& changes, EncodedRecord& record) {
    const auto finish = [&](const std::shared_ptr<EncodedRecord>& created) {
        finishRecord(*created);
        created->published = record.published;
        return created;
    };
    const std::shared_ptr<EncodedRecord> created = shared_->pool->take();
    if (!needsState(changes)) {
        encoder_->inputs.encode(changes, created->bytes);
        record.input = finish(created);
    }
    ChangeSet state;
    state.to = changes.to;
    state.time = changes.time;
    state.hash = changes.hash;
    state.input = changes.input;
    if (!state.input || !state.input->runState) {
        // Only if the scene is in this very state and a peer waits for its run state.
        if (scene_.sequence() != changes.to || !shared_->wantRunState.exchange(false)) return;
        auto input = std::make_shared<FrameInput>();
        input->runState = std::make_shared<const RunState>(scene_.runState());
        state.input = std::move(input);
    }
    const std::shared_ptr<EncodedRecord> after = shared_->pool->take();
    if (encoder_->inputs.encodeRunState(state, after->bytes)) record.runState = finish(after);
}

/// Encodes with prediction only while some peer takes it. A frame that is left out breaks the prediction, so it starts
/// anew.
void MirrorServer::encodePredicted(const ChangeSet& changes, EncodedRecord& record) {
    const bool before = std::exchange(encoder_->predicts, shared_->wantPredicted);
    if (!encoder_->predicts) return;
    const std::shared_ptr<EncodedRecord> predicted = shared_->pool->take();
    if (shared_->wantForget.exchange(false) || !before) encoder_->predicting.restart();
    encoder_->predicting.encode(changes, predicted->bytes);
    finishRecord(*predicted);
    predicted->published = record.published;
    record.predicted = predicted;
    shared_->coded.fetch_add(1, std::memory_order_relaxed);
}

void MirrorServer::encodeAndPost(const ChangeSet& changes, bool requested) {
    const std::shared_ptr<EncodedRecord> record = shared_->pool->take();
    encoder_->encoder.encode(changes, record->bytes);
    finishRecord(*record);
    record->published = shared_->clock().nanoseconds();
    if (shared_->options.mode.coding != Coding::raw && !changes.isSnapshot()) encodePredicted(changes, *record);
    if (shared_->options.mode.mode == Mode::input && !requested) encodeInput(changes, *record);
    // A snapshot within a stream means that the scene is a replica that joined anew.
    const bool restart = !requested && changes.isSnapshot() && encoder_->started && encoder_->last != 0;
    encoder_->started = true;
    encoder_->last = changes.to;
    encoder_->starts += restart;
    const bool isStep = changes.isSnapshot() || changes.from != changes.to;  // a repair is no step
    const bool snapshot = log_ && isStep && !requested && log_->addInPassing({record, nullptr}, changes);
    shared_->post({record, requested, restart, false, encoder_->starts, snapshot});
}

void MirrorServer::waitForThoseWhoBlock() {
    std::unique_lock lock(shared_->mutex);
    if (!shared_->heldUp) return;
    shared_->caughtUp.wait_for(lock, shared_->options.blockFor, [this] { return !shared_->heldUp; });
}

Result<> MirrorServer::apply(const Scene& scene, const ChangeSet& changes) {
    if (auto ok = shared_->result(); !ok) return ok;
    encodeAndPost(changes, false);
    notify(order_->happened(changes));
    const bool inThisState = scene.sequence() == changes.to && !scene.hasUnsealedEdits();
    if (inThisState && shared_->wantSnapshot.exchange(false)) encodeAndPost(scene.snapshot(), true);
    // With a clock that is stepped a peer could not catch up meanwhile.
    if (shared_->options.blockFor.count() > 0 && !shared_->clock().isStepped()) waitForThoseWhoBlock();
    return {};
}

void MirrorServer::service() {
    if (shared_->clock().isStepped()) io_->step();
    shared_->call.clear();
    std::vector<mirror::Submission> submissions;
    std::vector<Shared::Control> controls;
    std::vector<std::uint64_t> left;
    {
        const std::scoped_lock lock(shared_->mutex);
        submissions.swap(shared_->submissions);
        controls.swap(shared_->controls);
        left.swap(shared_->left);
        shared_->submittedBytes = order_->bytes();
    }
    const bool any = !submissions.empty() || !controls.empty();
    for (Shared::Control& control : controls) {
        if (!controller_ && forwardCommand_ && forwardedCommands_.size() < kMaxForwarded &&
            forwardCommand_(control.text)) {
            forwardedCommands_.emplace_back(std::move(control.peer), control.session);
            continue;
        }
        control.text = controller_       ? controller_(control.text)
                       : forwardCommand_ ? "refused: the origin cannot be asked now"
                                         : "refused: no log is played here";
        const std::scoped_lock lock(shared_->mutex);
        shared_->replies.push_back(std::move(control));
    }
    if (forward_) {
        pass(submissions);
    } else if (controller_) {
        // The states are those of a log, so an edit would be undone by the next one.
        for (const mirror::Submission& submission : submissions)
            shared_->answer({submission.client,
                             submission.request,
                             scene_.sequence(),
                             "a log is played: what happened in it stays as it was",
                             {},
                             {}});
    } else {
        order_->add(std::move(submissions));
        notify(order_->carryOut());
    }
    leaving_.insert(leaving_.end(), left.begin(), left.end());
    std::erase_if(leaving_, [&](std::uint64_t client) { return !order_->holds(client) && (letGo(client), true); });
    if (any) shared_->awaken();
    if (!shared_->wantSnapshot) return;
    scene_.seal();  // publishes pending changes, and the snapshot with them
    if (shared_->wantSnapshot.exchange(false)) encodeAndPost(scene_.snapshot(), true);
}

void MirrorServer::wait(std::chrono::steady_clock::time_point until) {
    pollfd item = {shared_->call.get(), POLLIN, 0};
    (void)shared_->clock().wait({&item, 1}, std::max(until - shared_->clock().now(), Clock::duration::zero()));
}

int MirrorServer::callDescriptor() const {
    return shared_->call.get();
}

void MirrorServer::notify(std::vector<mirror::Verdict> verdicts) {
    if (verdicts.empty()) return;
    for (mirror::Verdict& verdict : verdicts) shared_->answer(std::move(verdict));
    shared_->awaken();
}

void MirrorServer::admit(std::unique_ptr<Listener> listener) {
    {
        const std::scoped_lock lock(shared_->mutex);
        shared_->listeners.push_back(std::move(listener));
    }
    shared_->awaken();
}

void MirrorServer::onControl(Controller controller) {
    controller_ = std::move(controller);
}

void MirrorServer::forwardRequests(Forward forward) {
    forward_ = std::move(forward);
}

/// Checks the requests against what these peers may send; the origin checks what this server may.
void MirrorServer::pass(const std::vector<mirror::Submission>& submissions) {
    for (const mirror::Submission& submission : submissions) {
        mirror::Verdict verdict{submission.client, submission.request, scene_.sequence(), {}, {}};
        if (auto asked = mirror::examine(scene_, submission); !asked) {
            verdict.refusal = asked.error().text;
        } else if (const auto number = forward_(*asked); !number) {
            verdict.refusal = number.error().text;
        } else {
            for (const Change& change : asked->changes) writers_->pointers.saw(scene_, submission.client, change);
            forwarded_[*number] = {submission.client, submission.request};
            continue;
        }
        shared_->answer(std::move(verdict));
    }
}

/// Releases the objects that the pointers of a departed peer held. Otherwise they would be held for ever.
void MirrorServer::letGo(std::uint64_t client) {
    std::vector<Change> events = writers_->pointers.leave(scene_, client);
    if (events.empty()) return;
    if (forward_) {
        MirrorRequest request;
        request.changes = std::move(events);
        return (void)forward_(std::move(request));  // if the origin is gone, too, it releases all of ours
    }
    for (const Change& event : events) (void)scene_.sendEvent(event.node, event.field, event.value);
}

void MirrorServer::answer(const MirrorVerdict& verdict) {
    const auto found = forwarded_.find(verdict.request);
    if (found == forwarded_.end()) return;
    mirror::Verdict result{found->second.first, found->second.second, verdict.state, verdict.refusal, {}, verdict.kept};
    for (const auto& [provisional, number] : verdict.created)
        result.created.emplace_back(provisional.value, number.value);
    forwarded_.erase(found);
    shared_->answer(std::move(result));
    shared_->awaken();
}

void MirrorServer::forwardCommands(ForwardCommand forward) {
    forwardCommand_ = std::move(forward);
}

void MirrorServer::answerCommand(std::string reply) {
    if (forwardedCommands_.empty()) return;
    auto [peer, session] = std::move(forwardedCommands_.front());
    forwardedCommands_.pop_front();
    {
        const std::scoped_lock lock(shared_->mutex);
        shared_->replies.push_back({std::move(peer), session, std::move(reply)});
    }
    shared_->awaken();
}

std::function<void(std::uint64_t start, std::uint64_t state)> MirrorServer::sendWhatIsLogged(
    std::chrono::milliseconds atMost) {
    encoder_->starts = 0;
    const std::scoped_lock lock(shared_->mutex);
    shared_->longestWaitForLog = std::min<std::chrono::milliseconds>(atMost, kLongestWaitForLog);
    return [shared = shared_](std::uint64_t start, std::uint64_t state) {
        {
            const std::scoped_lock guard(shared->mutex);
            shared->loggedStart = start;
            shared->loggedState = state;
        }
        shared->awaken();
    };
}

void MirrorServer::recordTo(std::shared_ptr<RecordLog> log, std::chrono::milliseconds atMost) {
    log_ = std::move(log);
    {
        const std::scoped_lock lock(shared_->mutex);
        shared_->log = log_;
    }
    log_->onAcknowledged(sendWhatIsLogged(atMost));
}

void MirrorServer::setOriginLost(bool lost) {
    if (shared_->originLost.exchange(lost) != lost) shared_->awaken();
}

void MirrorServer::noteOriginMissed() {
    ++shared_->originMissed;
}

bool MirrorServer::drain(std::chrono::milliseconds timeout) {
    Clock& clock = shared_->clock();
    const auto end = clock.now() + timeout;
    while (true) {
        service();
        if (!shared_->result()) return false;
        const MirrorServerStatistics now = statistics();
        if (now.peers == 0 || now.acknowledged >= scene_.sequence()) return true;
        shared_->wantAcknowledged = true;
        shared_->awaken();
        if (clock.now() >= end) return false;
        (void)clock.wait({}, std::chrono::milliseconds(5));
    }
}

}  // namespace rtsg
