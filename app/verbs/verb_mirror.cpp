// rtsg mirror: keeps a replica of a served scene and makes outputs of it.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/session/foxglove.h>
#include <rtsg/session/health.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/record_log.h>

#include "cli.h"
#include "extensions.h"
#include "log_store.h"
#include "nats.h"
#include "output_arguments.h"
#include "request_arguments.h"
#include "say.h"
#include "service_manager.h"
#include "viewer_arguments.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kAspects[] = {"none",  "structure", "transform", "geometry", "appearance",
                                    "light", "view",      "sound",     "time"};  // in the order of Aspect

struct MirrorArguments {
    std::string endpoint, duration, patience = "5s", key, name, latency = "0", whenSlow = "merge", mode = "state";
    std::vector<std::string> control, parts, aspects;
    RequestArguments requests;
    double fps = 0;
    std::string maxLag;
    std::uint64_t maxRecord = kMaxPayload, maxRate = 0;
    OutputArguments outputs;
    MetricsArguments metrics;
    FoxgloveArguments foxglove;
    std::vector<std::string> fields;
    SayArguments say;
    bool json = false, insecure = false;
};

/// The names that no node of the replica has; a number begins with #.
std::vector<std::string> missingParts(const Scene& replica, const std::vector<std::string>& parts) {
    std::vector<std::string> missing;
    for (const std::string& part : parts) {
        std::uint32_t number = 0;
        if (constexpr std::string_view region = "region:"; part.starts_with(region)) {
            // A region is missing if its centre node does not exist.
            const std::string name = part.substr(region.size(), part.find(',') - region.size());
            double radius = 0;
            const bool isName = std::from_chars(name.data(), name.data() + name.size(), radius).ec != std::errc();
            if (isName && !replica.findName(name)) missing.push_back(part);
            continue;
        }
        const bool numbered = part.starts_with('#') &&
                              std::from_chars(part.data() + 1, part.data() + part.size(), number).ec == std::errc();
        if (!(numbered ? replica.find(NodeId{number}) != nullptr : bool(replica.findName(part))))
            missing.push_back(part);
    }
    return missing;
}

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// At a lower rate the session's own messages would fill the link.
constexpr std::uint64_t kMinRate = 1000;

Result<MirrorClientOptions> clientOptions(const MirrorArguments& options) {
    if (!options.maxLag.empty() && (options.whenSlow == "block" || options.whenSlow == "resync"))
        throw UsageError("--max-lag", fmt::format("is for --when-slow merge or near: with {} frames come however "
                                                  "late, until 8 MiB wait",
                                                  options.whenSlow));
    if (options.maxRate > 0 && options.maxRate < kMinRate)
        throw UsageError("--max-rate",
                         fmt::format("{} bytes a second: at least {}, or 0 for any", options.maxRate, kMinRate));
    if (parseSeconds(options.latency) > 3600) throw UsageError("--latency", options.latency + ": an hour at most");
    MirrorClientOptions result;
    if (!options.key.empty()) {
        auto keys = MirrorKeys::load(options.key);
        if (!keys) return std::unexpected(keys.error());
        if (auto ok = keys->checkForClient(); !ok) return fail(ok.error().text, {}, options.key);
        result.keys = std::move(*keys);
    }
    result.name = options.name;
    result.latency = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(options.latency)));
    result.framesPerSecond = options.fps;
    result.maxRecord = options.maxRecord;
    result.maxBytesPerSecond = options.maxRate;
    // Outputs of every frame need every frame, however late.
    const bool everyFrame = options.outputs.any() && !options.outputs.isLive();
    const std::string lag = !options.maxLag.empty() ? options.maxLag : everyFrame ? "0" : "250ms";
    result.maxLag = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(lag)));
    result.inputs = options.mode == "input";
    result.parts = options.parts;
    for (const std::string& name : options.aspects)
        result.aspects.push_back(static_cast<Aspect>(std::ranges::find(kAspects, name) - std::ranges::begin(kAspects)));
    result.whenSlow = options.whenSlow == "block"    ? MirrorWhenSlow::block
                      : options.whenSlow == "resync" ? MirrorWhenSlow::resync
                      : options.whenSlow == "near"   ? MirrorWhenSlow::nearFirst
                                                     : MirrorWhenSlow::coalesce;
    return result;
}

/// The outputs of the replica: a log of every frame, and pictures and sound of every frame on a thread of their own, or
/// of the newest state with --live.
class Created {
  public:
    Created(Scene& replica, const OutputArguments& arguments, const Resources& resources)
        : replica_(replica),
          world_(replica, resources, programContext()),
          makesMore_(!arguments.render.empty() || !arguments.tiles.empty() || !arguments.listen.empty() ||
                     !arguments.save.empty()) {
        if (!arguments.record.empty()) {
            LogOptions options;
            options.existing = existing(arguments.force);
            auto log = RecordLog::start(replica, arguments.record, options);
            if (!log) {
                problem_ = std::unexpected(log.error());
                logFailed_ = true;
                return;
            }
            log_ = std::move(*log);
        }
        const bool everyStep = !arguments.isLive() && (!arguments.render.empty() || !arguments.listen.empty());
        const OutputOptions outputs = arguments.options();
        auto attached = everyStep || !arguments.tiles.empty() ? followOutputs(replica, outputs, resources)
                                                              : refusingUsage(makeOutputs(world_, outputs, resources));
        if (attached)
            outputs_ = std::move(*attached);
        else
            problem_ = std::unexpected(attached.error());
    }
    WorldOnDemand& world() { return world_; }
    bool rests() const { return !outputs_ || outputs_->rests(); }
    bool wantsSteps() const { return log_ || (outputs_ && outputs_->wantsSteps()); }
    void step(const RecordStep& step) {
        if (log_) log_->add(replica_, step);
        if (outputs_) outputs_->step(replica_, step);
    }
    /// Called in every turn of the mirror's loop. One failure does not affect other outputs. Returns false if nothing
    /// that was asked for can still be made.
    bool frame() {
        if (!problem_) return false;
        if (log_ && !logFailed_ && !log_->failure().empty()) {
            logFailed_ = true;
            printError(log_->failure());
        }
        const bool created = !outputsFailed_ && outputs_->frame() && !outputs_->failed();
        outputsFailed_ = !created;
        return (created && (!logFailed_ || makesMore_)) || (log_ && !logFailed_);
    }
    Result<> finish() {
        const Result<> result = allOf(programContext(), {[&] { return problem_; }, [&] { return finishLog(); },
                                                         [&] { return outputs_ ? outputs_->finish() : Result<>(); }});
        app::print(replica_.diagnostics(), result ? "" : result.error().format());
        return result;
    }
    OutputReport report() const {
        OutputReport report = outputs_ ? outputs_->report() : OutputReport();
        if (logFailed_)
            report.addMissing(log_ ? fmt::format("the log beyond state {}", log_->acknowledged()) : "the log");
        return report;
    }
    /// Number of frames encoded here, because no usable record came.
    std::uint64_t encoded() const { return (log_ ? log_->encoded() : 0) + (outputs_ ? outputs_->encoded() : 0); }

  private:
    /// A log that failed earlier has been reported.
    Result<> finishLog() {
        if (!log_ || logFailed_) return {};
        const Result<> done = log_->stop();
        logFailed_ = !done;
        return done;
    }

    Scene& replica_;
    WorldOnDemand world_;
    const bool makesMore_;  // outputs other than a log
    bool logFailed_ = false, outputsFailed_ = false;
    Result<> problem_;
    std::unique_ptr<RecordLog> log_;
    std::unique_ptr<OutputMaker> outputs_;
};

class Mirroring {
  public:
    Mirroring(const MirrorArguments& options, MirrorOrigin& from)
        : options_(options),
          from_(from),
          duration_(options.duration.empty() ? 1e9 : parseSeconds(options.duration)),
          patience_(parseSeconds(options.patience)),
          latency_(parseSeconds(options.latency)),
          resources_(options.outputs.resources.ofReplica()),
          requests_(options.requests, programContext()) {}

    int run();

  private:
    /// Scene time since joining, rounded to a microsecond; doubles of times since 1970 are exact to a quarter of that.
    double since() const { return std::round(since_ * 1e6) / 1e6; }
    /// Notes whether the replica has gone on or back.
    void noteTime() {
        if (std::exchange(time_, replica_.now()) != replica_.now()) movedAt_ = Clock::now();
        since_ = elapsed_.at(replica_.now());
    }
    /// True if an output is as long as the scene time that passes.
    bool hasLength() const {
        const OutputArguments& outputs = options_.outputs;
        return !outputs.listen.empty() || !outputs.record.empty() || outputs.animated();
    }
    bool joined() const { return outputs_ != nullptr; }
    const MirrorStatistics& statistics() const { return client_ ? client_->statistics() : last_; }
    /// Leaves in order, so that the server does not take us for lost while outputs are still being made.
    void leave() {
        last_ = client_->statistics();
        client_.reset();
    }
    /// In step with a scene that has stood still for a while.
    bool standsStill() const { return secondsSince(movedAt_) >= std::min(duration_, 1.0) && client_->inStep(); }
    /// Scene time since joining; real time if the scene stands still and no output has a length.
    double reached() const {
        return !hasLength() && standsStill() ? std::max(since(), secondsSince(joinedAt_)) : since();
    }
    /// Average since joining.
    double framesPerSecond() const {
        const auto frames = static_cast<double>(statistics().frames - framesBefore_);
        return joined() && seconds_ > 0 ? frames / seconds_ : 0;
    }
    /// Joins when the replica is in the state that the origin had when we came, or as near as it will get. Earlier
    /// states from the server's history pass at once. Returns false if it failed with status_.
    bool join();
    bool mayJoin();
    void follow();
    std::chrono::milliseconds longestPoll() const;
    /// Sends each --control once, and prints the player's replies.
    void control(MirrorClient& client) {
        while (controls_ < options_.control.size() && client.control(options_.control[controls_])) ++controls_;
        for (const std::string& reply : client.takeReplies()) {
            ++replies_;
            if (reply.starts_with("refused"))
                fail(reply);
            else
                say(reply);
        }
    }
    bool isOver(std::size_t applied);
    bool bringsOnlyGarbage(std::size_t applied);
    void sayWhetherHeard();
    /// The state to catch up with. If another session has begun since, it is that session's.
    std::uint64_t wanted() const { return std::min(known_, statistics().originSequence); }
    /// The origin's state when --for was over, or a later one that the replica has reached.
    std::uint64_t origin() const { return std::max(wanted(), statistics().sequence); }
    void catchUp();
    void awaitAnswers();
    void sayWhatIsMissing();
    void fail(const std::string& text) {
        printError(text);
        good_ = false;
    }
    void finish();
    std::string comparison() const;
    void print() const;
    void printJson() const;

    const MirrorArguments& options_;
    MirrorOrigin& from_;
    const double duration_, patience_, latency_;
    const Resources resources_;
    Scene replica_;
    std::optional<FollowedFetches> fetches_;
    Requests requests_;
    Health health_;
    std::size_t controls_ = 0, replies_ = 0;  // commands sent and answered
    std::unique_ptr<MirrorClient> client_;    // null after leaving
    MirrorStatistics last_;
    Extensions::Attached subscribers_;  // of plug-ins
    std::unique_ptr<Created> outputs_;
    Wakeup viewers_;  // of foxglove_, when they want something
    Foxglove foxglove_;
    std::optional<std::uint64_t> firstState_;  // the state from which on it counts as joined
    std::uint64_t known_ = 0;                  // the origin's state when --for was over
    ElapsedTime elapsed_;
    std::uint64_t framesBefore_ = 0;  // frames before joining, from the server's history
    double since_ = 0, time_ = 0, seconds_ = 0;
    Clock::time_point firstAt_;  // when the first state came
    Clock::time_point heard_ = Clock::now(), joinedAt_ = Clock::now(), movedAt_ = Clock::now();
    Clock::time_point lostAt_ = Clock::now();  // when it was last heard
    Clock::time_point useful_ = Clock::now();  // when something useful last came
    std::uint64_t garbageThen_ = 0;            // useless messages until then
    bool good_ = true, equal_ = false, stoodStill_ = false, saidLost_ = false;
    int status_ = kDone;
    OutputReport report_;  // of the outputs, at the end
};

bool Mirroring::join() {
    joinedAt_ = movedAt_ = Clock::now();
    framesBefore_ = client_->statistics().frames;
    time_ = replica_.now();
    elapsed_ = ElapsedTime(time_);
    OutputArguments arguments = options_.outputs;
    if (!options_.duration.empty()) arguments.seconds = duration_;
    arguments.endsByInterruption = options_.duration.empty();
    subscribers_ = attachSubscribers(replica_, programContext());
    outputs_ = std::make_unique<Created>(replica_, arguments, resources_);
    auto foxglove = Foxglove::start(options_.foxglove.listen, options_.fields, outputs_->world(),
                                    {options_.insecure, viewers_.get()}, programContext());
    if (!foxglove) {
        printError(foxglove.error());
        status_ = kBad;
        return false;
    }
    foxglove_ = std::move(*foxglove);
    if (options_.foxglove.wanted()) client_->wakeBy(viewers_.get());
    if (outputs_->wantsSteps()) client_->onStep([this](const RecordStep& step) { outputs_->step(step); });
    notifyServiceManager("READY=1");
    if (auto ok = refusingUsage(requests_.parse(replica_)); !ok) {
        printError(ok.error());
        status_ = kUsage;
        return false;
    }
    return true;
}

bool Mirroring::mayJoin() {
    const MirrorStatistics& statistics = client_->statistics();
    if (joined() || statistics.frames == 0) return false;
    if (!firstState_) {
        firstState_ = statistics.originSequence;
        firstAt_ = Clock::now();
    }
    // The server is not believed for ever. On a very slow link, or with a faulty server, outputs begin with the state
    // that is here.
    return statistics.sequence >= *firstState_ || client_->serverLeft() ||
           secondsSince(firstAt_) > patience_ + latency_;
}

bool Mirroring::isOver(std::size_t applied) {
    MirrorClient& client = *client_;
    if (joined() && !outputs_->frame()) return true;
    if (client.serverLeft() && applied == 0) return true;
    if (applied > 0 || client.inStep() || client.receiving()) heard_ = Clock::now();
    if (joined() && reached() >= duration_) return true;
    // A log that is paused or at its end may stand still for ever. A scene that is only held up goes on.
    stoodStill_ = joined() && client.inStep() && secondsSince(movedAt_) >= std::max(duration_, patience_) + latency_;
    if (stoodStill_) return true;
    if (bringsOnlyGarbage(applied)) return true;
    if (secondsSince(heard_) < patience_ + latency_) return false;
    // A server that ends in order says goodbye, and a relay says that it has lost its origin.
    const MirrorStatistics& statistics = client.statistics();
    const bool heard = joined() || statistics.messages > 0;
    fail(fmt::format("{}: {} for {} s", options_.endpoint,
                     heard && statistics.frames == 0 && statistics.garbage > 0
                         ? "nothing of what the server sends could be read"
                     : heard ? "the server, or the origin that it relays, has been silent"
                             : "no server",
                     patience_ + latency_) +
         (heard                  ? ""
          : options_.key.empty() ? " (one that has keys does not answer without --key)"
                                 : " (one does not answer whose list lacks the key, or that has none)"));
    return true;
}

/// True if only useless messages came for our whole patience, and more than by chance. Then later ones will not be
/// better.
bool Mirroring::bringsOnlyGarbage(std::size_t applied) {
    constexpr std::uint64_t kByChance = 8;
    const std::uint64_t garbage = client_->statistics().garbage;
    if (applied > 0 || client_->inStep()) {
        useful_ = Clock::now();
        garbageThen_ = garbage;
    }
    if (garbage <= garbageThen_ + kByChance || secondsSince(useful_) < patience_ + latency_) return false;
    fail(fmt::format("{}: nothing of what the server sends could be applied for {} s", options_.endpoint,
                     patience_ + latency_));
    return true;
}

/// How long to wait if the clock needs nothing: until something comes.
std::chrono::milliseconds Mirroring::longestPoll() const {
    constexpr std::chrono::milliseconds kOften{50}, kSeldom{2000};
    const bool waits = !joined() || requests_.open() || !requests_.firstUnsent().empty() || !outputs_->rests() ||
                       controls_ < options_.control.size() || foxglove_.owes() || client_->originLost() ||
                       !client_->inStep();
    if (waits) return kOften;
    const double left = std::min(duration_ - reached(), duration_ - secondsSince(joinedAt_));
    return std::clamp(std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * std::min(left, 2.))), kOften, kSeldom);
}

void Mirroring::follow() {
    MirrorClient& client = *client_;
    const Progress progress = options_.duration.empty() ? Progress{} : progressBar("mirroring " + options_.endpoint);
    while (!interrupted()) {
        const std::size_t applied = client.poll(longestPoll());
        for (const Diagnostic& d : client.takeDiagnostics())
            if (d.severity != Severity::note) say(d);
        printNews(from_);
        // A server without room may have some in a while.
        if (!client.refusal().empty() && (!client.turnedAway() || secondsSince(heard_) >= patience_)) {
            fail(fmt::format("{} refused: {}", options_.endpoint, client.refusal()));
            break;
        }
        if (mayJoin() && !join()) return;
        health_.noteMirror(client.statistics(), from_.garbage());
        feedWatchdog();
        if (joined()) noteTime();
        if (joined() && progress)
            progress(static_cast<std::uint64_t>(1e3 * std::clamp(since(), 0., duration_)),
                     static_cast<std::uint64_t>(1e3 * duration_) + 1);
        viewers_.clear();
        if (joined()) foxglove_.after();
        if (joined()) requests_.poll(client, reached(), replica_.now());
        if (joined()) control(client);
        if (joined()) sayWhetherHeard();
        if (isOver(applied)) break;
    }
    if (progress) progress(1, 1);
}

/// A server that plays a log makes us join anew at jumps, which is no loss.
void Mirroring::sayWhetherHeard() {
    const bool lost = client_->originLost() && !client_->serverLeft();
    if (!lost) lostAt_ = Clock::now();
    if (lost == saidLost_ || secondsSince(lostAt_) < (lost ? .1 + 4 * client_->statistics().delay : 0)) return;
    saidLost_ = lost;
    say(fmt::format("{}: {}", options_.endpoint,
                    lost ? "the server, or the origin that it relays, is not heard: waiting for it" : "heard again"),
        lost ? Severity::warning : Severity::note);
}

/// Waits for records that are known to be missing. On a slow link they may take long, while the origin goes on.
void Mirroring::catchUp() {
    constexpr double kMax = 10;  // factor on the patience
    MirrorClient& client = *client_;
    known_ = client.statistics().originSequence;
    const auto end = Clock::now();
    auto came = end;
    while (good_ && client.statistics().sequence < wanted() && !client.serverLeft() && !interrupted() &&
           secondsSince(came) < patience_ && secondsSince(end) < kMax * patience_)
        if (client.poll(std::chrono::milliseconds(50)) > 0 || client.receiving()) came = Clock::now();
}

/// Waits for answers, because a request may be carried out after the time of --for.
void Mirroring::awaitAnswers() {
    if (!joined()) return;
    const auto end = Clock::now();
    const auto open = [&] { return requests_.open() || replies_ < options_.control.size(); };
    while (open() && !client_->serverLeft() && !interrupted() && secondsSince(end) < patience_) {
        client_->poll(std::chrono::milliseconds(50));
        requests_.takeVerdicts(*client_);
        control(*client_);
    }
    if (requests_.open())
        fail(fmt::format("{} of {} requests: no answer from {}",
                         requests_.sent - requests_.accepted - requests_.refused, requests_.sent, options_.endpoint));
    if (replies_ < options_.control.size())
        fail(fmt::format("--control {}: no answer from {}", options_.control[replies_], options_.endpoint));
    if (const std::string request = requests_.firstUnsent(); !request.empty())
        fail(fmt::format("{}: not sent: the replica ended at {} s", request, since()));
}

void Mirroring::sayWhatIsMissing() {
    const MirrorStatistics& statistics = client_->statistics();
    if (interrupted() && !options_.duration.empty())
        fail(fmt::format("interrupted after {} of {} s", since(), duration_));
    else if (client_->serverLeft() && !options_.duration.empty() && since() < duration_ &&
             (hasLength() || secondsSince(joinedAt_) < duration_))
        fail(fmt::format("{} left after {} of {} s", options_.endpoint, since(), duration_));
    if (stoodStill_ && hasLength())
        fail(fmt::format("{} stands still after {} of {} s", options_.endpoint, since(), duration_));
    if (statistics.sequence < wanted())
        fail(fmt::format("the replica is in state {}, the origin was in state {}", statistics.sequence, wanted()));
    if (!joined()) return;
    for (const std::string& part : missingParts(replica_, options_.parts))
        fail(fmt::format("--part {}: {} has no such node", part, options_.endpoint));
}

void Mirroring::finish() {
    const MirrorStatistics& statistics = this->statistics();
    seconds_ = secondsSince(joinedAt_);
    if (joined()) {
        if (auto ok = outputs_->finish(); !ok) fail(ok.error().format());
        report_ = outputs_->report();
        if (statistics.holes > 0 && hasLength())
            report_.addMissing(fmt::format("{:.2f} s of the session", statistics.missed));
        if (!report_.missing.empty()) fail("missing: " + report_.missing);
    }
    equal_ = statistics.equal && statistics.sequence >= wanted();
    good_ = good_ && equal_ && statistics.divergences == 0 && requests_.refused + requests_.unsent == 0;
}

/// Compares the hashes if both sides are in the same state.
std::string Mirroring::comparison() const {
    const MirrorStatistics& statistics = this->statistics();
    if (statistics.equal && !equal_)
        return fmt::format("behind: state {} here, {} at the origin", statistics.sequence, origin());
    return fmt::format("{}: {} here, {} at the origin", equal_ ? "equal" : "not equal", statistics.hash.hex(),
                       statistics.originHash.hex());
}

void Mirroring::print() const {
    const MirrorStatistics& statistics = this->statistics();
    if (statistics.frames == 0) return fmt::print("no state of {} has come\n", options_.endpoint);
    const double frames = static_cast<double>(std::max<std::uint64_t>(1, statistics.frames));
    fmt::print(
        "{} ({} snapshots) to state {} of {}, {} bytes ({:.1f} a frame), {:.1f} frames a second\n"
        "{}; {} gaps, {} divergences, {} repairs\n",
        framesText(statistics.frames), statistics.snapshots, statistics.sequence, origin(), statistics.bytes,
        static_cast<double>(statistics.bytes) / frames, framesPerSecond(), comparison(), statistics.gaps,
        statistics.divergences, statistics.repairs);
    if (options_.mode == "input")
        fmt::print("{} of these computed here from what came into them{}\n", framesText(statistics.inputs),
                   statistics.inputs == 0 ? ": the server sends states" : "");
    if (requests_.sent > 0)
        fmt::print("{} requests sent, {} accepted, {} refused\n", requests_.sent, requests_.accepted,
                   requests_.refused);
    if (joined() && options_.outputs.any()) fmt::print("{}\n", report_.text());
}

void Mirroring::printJson() const {
    const MirrorStatistics& statistics = this->statistics();
    const double frames = static_cast<double>(std::max<std::uint64_t>(1, statistics.frames));
    fmt::print(
        "{{\"frames\":{},\"snapshots\":{},\"gaps\":{},\"bytes\":{},\"hash\":\"{}\",\"origin_hash\":\"{}\",\"equal\":{},"
        "\"divergences\":{},\"repairs\":{},\"sequence\":{},\"origin_sequence\":{},\"t\":{},\"seconds\":{:.3f},",
        statistics.frames, statistics.snapshots, statistics.gaps, statistics.bytes, statistics.hash.hex(),
        statistics.originHash.hex(), equal_, statistics.divergences, statistics.repairs, statistics.sequence, origin(),
        since(), seconds_);
    fmt::print(
        "\"fps\":{:.2f},\"bytes_per_frame\":{:.1f},\"restarts\":{},\"garbage\":{},\"clock_offset_s\":{:.6f},"
        "\"delay_s\":{:.6f},\"lag_s\":{:.4f},\"most_lag_s\":{:.4f},\"jitter_s\":{:.6f},\"late\":{},\"sent\":{},"
        "\"accepted\":{},\"refused\":{},",
        framesPerSecond(), static_cast<double>(statistics.bytes) / frames, statistics.restarts,
        statistics.garbage + from_.garbage(), statistics.clockOffset, statistics.delay, statistics.lag,
        statistics.maximumLag, statistics.jitter, statistics.late, requests_.sent, requests_.accepted,
        requests_.refused);
    fmt::print("\"inputs\":{},\"encoded\":{},\"holes\":{},\"missed_s\":{:.3f}{}}}\n", statistics.inputs,
               joined() ? outputs_->encoded() : 0, statistics.holes, statistics.missed, report_.json());
}

int Mirroring::run() {
    options_.say.apply();
    if (!options_.foxglove.wanted() && !options_.fields.empty())
        throw UsageError("--fields", "only together with --foxglove");
    if (!options_.foxglove.wanted() && options_.insecure)
        throw UsageError("--insecure", "only together with --foxglove");
    if (auto ok = options_.outputs.check({options_.key}); !ok) return printError(ok.error()), kBad;
    reportFailuresAtTheEnd(replica_);
    registerDocuments(replica_);
    runScripts(replica_);
    extensions().registerWith(replica_);
    replica_.setScriptResources(std::make_shared<const Resources>(resources_));
    fetches_.emplace(replica_, resources_);
    auto wanted = clientOptions(options_);
    if (!wanted) return printError(wanted.error()), kBad;
    if (auto ok = from_.prepare(*wanted); !ok) return printError(ok.error()), kUsage;
    auto connected = MirrorClient::connect(replica_, from_.endpoint(), std::move(*wanted));
    if (!connected) return printError(connected.error()), kUsage;
    client_ = std::move(*connected);
    if (auto ok = health_.start(options_.metrics.listen, false); !ok) return printError(ok.error()), kBad;
    if (health_.serves()) say("figures at http://" + health_.address() + "/metrics");
    heard_ = joinedAt_ = Clock::now();
    follow();
    if (status_ != kDone) return status_;
    catchUp();
    awaitAnswers();
    if (joined()) noteTime();
    sayWhatIsMissing();
    leave();
    if (auto ok = foxglove_.end(); !ok) fail(ok.error().format());
    finish();
    options_.json ? printJson() : print();
    return good_ ? kDone : kBad;
}

int mirror(MirrorArguments options) {
    auto from = openOrigin(options.endpoint, options.key, parseSeconds(options.patience));
    if (!from) return printError(from.error()), kBad;
    options.endpoint = from->shown();
    auto stored = StoredLog::start("--record", options.outputs.record, LogUse::write, options.outputs.force);
    if (!stored) return printError(stored.error()), kBad;
    return stored->finish(Mirroring(options, *from).run());
}

void addActing(Command& command, MirrorArguments& options) {
    const Command::Section section(command, "Acting on the scene");
    command.addOption("--name", options.name,
                      "author of --set, --edit and so on, in logs and for undo; a key file may give another name");
    options.requests.addTo(command);
    command
        .addOption("--control", options.control,
                   "tell a server that plays a log: pause, play, step [N], rate R, seek T, loop on|off, status; "
                   "the replies "
                   "go to standard error")
        ->repeatable();
}

void addParts(Command& command, MirrorArguments& options) {
    const Command::Section section(command, "Parts of the scene");
    command.addOption("--part", options.parts,
                      "follow only this subtree: a DEF name, or # and a node's number; or what is near: "
                      "region:[NAME,|x,y,z,]RADIUS[,MARGIN] round a node, a point or the bound viewpoint");
    command.addOption("--aspect", options.aspects, "follow only fields of this aspect, as transform or geometry")
        ->oneOf(std::vector<std::string>(std::begin(kAspects), std::end(kAspects)));
    command.addOption("--most-fps", options.fps, "at most so many frames a second, others merged; 0: all")
        ->preset()
        ->range(0.0, 1e4);
    command.addOption("--mode", options.mode, "input: receive the input of each frame, and run the cascade here")
        ->oneOf({"state", "input"})
        ->preset();
}

void addSlowLinks(Command& command, MirrorArguments& options) {
    const Command::Section section(command, "Slow links");
    command.addOption("--max-lag", options.maxLag,
                      "the most that frames may be late on a slow link, besides its delay, before they are merged; 0: "
                      "never merged, the default with --render, --listen, --record and --save; else 250ms");
    command
        .addOption("--when-slow", options.whenSlow,
                   "what to get when too slow: merged frames; these with views, sounds and what is near the viewer "
                   "first, the rest waits for at most a second; every frame while the scene waits (if the server lets "
                   "it); or a new snapshot: these two however late, until 8 MiB wait")
        ->preset()
        ->oneOf({"merge", "near", "block", "resync"});
    command.addOption("--latency", options.latency, "show frames this long after they were published, for even motion")
        ->preset();
    command.addOption("--max-rate", options.maxRate, "most bytes a second from the server, such as 100kB; 0: no limit")
        ->bytes()
        ->preset();
    command.addOption("--max-record", options.maxRecord, "longest record accepted from the server, such as 64MB")
        ->bytes()
        ->preset();
}

}  // namespace

Verb addMirror(Command& program) {
    auto options = std::make_shared<MirrorArguments>();
    Command* command = program.addVerb("mirror", "Follow a served scene; picture, hear, log and save the replica");
    command->addOption("ENDPOINT", options->endpoint, "endpoint that rtsg serve named, or nats://HOST:PORT/NAME")
        ->required();
    command->addOption("--for", options->duration,
                       "how long, in scene time; by the clock where the scene stands still, unless a film, numbered "
                       "pictures, sound or a log are made of its time (an error after --wait then); else until the "
                       "server leaves or Ctrl-C. Where a log is played again, time goes on");
    command
        ->addOption("--wait", options->patience,
                    "give up after so long without a server, or with a scene that stands still where its time is "
                    "needed, but not before --for")
        ->preset();
    command->addOption("--key", options->key, "key file, the server's or one with its public key and a pair");
    command->addFlag("--json", options->json, "the summary as JSON");
    addActing(*command, *options);
    addParts(*command, *options);
    addSlowLinks(*command, *options);
    options->metrics.addTo(*command);
    options->foxglove.addTo(*command);
    command->addOption("--fields", options->fields, "for --foxglove: DEF.field or DEF.*, separated by commas")
        ->repeatable();
    command->addFlag("--insecure", options->insecure, "let other machines reach --foxglove");
    options->say.addTo(*command);
    options->outputs.addTo(*command, OutputArguments::Options::ofMirror);
    command->footer(
        "Example: rtsg mirror tcp://127.0.0.1:4711 --for 10s --save replica.x3d\n"
        "Example: rtsg mirror tcp://127.0.0.1:4711 --for 10s --render out/%04d.png --size 320x180 "
        "--listen out.wav --base examples/demo\n"
        "Exit status 1 unless the replica had the origin's state hash in every frame, and the origin took every "
        "request.\n"
        "Ctrl-C is the end where no --for is given; before the end of --for it leaves films, sounds, a picture of the\n"
        "last state and the saved scene unwritten.");
    return {command, [options] { return mirror(*options); }};
}

}  // namespace rtsg::app
