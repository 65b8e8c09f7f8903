// rtsg serve: runs a scene in real time, and mirrors and records it.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/session/health.h>
#include <rtsg/session/running_scene.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/record_log.h>
#include <rtsg/sync/replay.h>

#include "feeds.h"
#include "files.h"
#include "hints.h"
#include "keyframes.h"
#include "log_store.h"
#include "nats.h"
#include "rotate.h"
#include "say.h"
#include "serve_log.h"
#include "service_manager.h"
#include "start_time.h"
#include "web.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

/// While a scene rests, mirrors get a frame after so many seconds. It tells them the time and that the server lives,
/// slightly more often than the server would have to ping them.
constexpr double kTimeIsReported = 1.4;

struct ServeArguments {
    std::string scene, resume, endpoint = "tcp://127.0.0.1:*", duration, record, key, upstream = "none", block = "0";
    std::string mode = "state", coding = "raw";
    double fps = 60, error = 1e-3;
    std::string linger = "10s";
    std::size_t peers = 64, parts = 8, await = 0;
    std::uint64_t maxRate = 0;
    ResourceArguments resources;
    StartTime start{StartTime::Kind::live, {}, {}};
    NetworkArguments network;
    KeyframeArguments keyframes;
    ServeLogArguments log;
    RotateArguments rotate;
    WebArguments web;
    FeedArguments feeds;
    MetricsArguments metrics;
    SayArguments say;
    std::string nats;
    std::string shown;  // the log that is played or resumed, as it is named to the user
    bool insecure = false, json = false, force = false, reload = false, embed = false, resumeIfThere = false;
};

/// Makes a missing key file; the client gets a copy.
Result<std::optional<MirrorKeys>> serverKeysFrom(const std::string& file) {
    if (file.empty()) return std::nullopt;
    if (!std::filesystem::exists(file)) {
        if (auto ok = MirrorKeys::generate(file); !ok) return std::unexpected(ok.error());
        say(fmt::format("new keys in {}: rtsg keys {} --client CLIENT.key makes those of a mirror", file, file));
    }
    auto keys = MirrorKeys::load(file);
    if (!keys) return std::unexpected(keys.error());
    if (auto ok = keys->checkForServer(); !ok) return fail(ok.error().text, {}, file);
    return std::optional(std::move(*keys));
}

void printServerNews(MirrorServer& server) {
    for (const Diagnostic& d : server.takeDiagnostics()) say(d);
}

/// Waits until so many mirrors have the scene's first state, so that all of them have it.
void await(MirrorServer& server, std::size_t mirrors) {
    for (bool there = false; !there && !interrupted();) {
        server.service();
        printServerNews(server);
        there = server.statistics().peers >= mirrors && server.drain(std::chrono::milliseconds(50));
        if (!there) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
}

/// Begins with the scene's file, or with the session of the log.
Result<std::optional<ResumedSession>> begin(RunningScene& running, const ServeArguments& options) {
    if (options.resume.empty()) {
        if (!running.load()) return fail("nothing usable in it", {}, options.scene);
        return std::nullopt;
    }
    auto session = running.resume(options.resume);
    if (!session) return std::unexpected(session.error());
    const auto times = [](std::uint64_t count, std::string_view one, std::string_view several) {
        return count ? fmt::format("; {}", count == 1 ? std::string(one) : fmt::format("{} {}", count, several))
                     : std::string();
    };
    say(fmt::format(
        "going on at state {}, t = {:.3f} s{}{}", running.scene().sequence(), running.time(),
        times(session->damaged, "1 place of the log could not be read", "places of the log could not be read"),
        times(session->gaps, "states are missing in 1 place", "times states are missing")));
    if (session->file != options.resume)
        say(fmt::format("{} was cut before its first state: that is the last one of {}", options.resume,
                        session->file.string()));
    return std::optional(std::move(*session));
}

/// --resume-if-there: the log of --record is continued if there is one with a state in it. One that was cut before its
/// first state holds nothing, and is begun again.
void resumeIfThere(ServeArguments& options) {
    if (!options.resumeIfThere) return;
    const std::string option = "--resume-if-there";
    if (options.record.empty()) throw UsageError(option, "needs --record LOG, which it continues if it is there");
    if (!options.resume.empty()) throw UsageError(option, "cannot be combined with --resume");
    if (options.force) throw UsageError("--force", "cannot be combined with --resume-if-there, which replaces no log");
    if (isNatsAddress(options.record))
        throw UsageError(option, "needs a file: --resume continues a session that is stored at a NATS server");
    std::error_code ignored;
    if (!std::filesystem::exists(options.record, ignored)) return;
    const bool alone = earlierPieces(options.record).empty();
    auto log = Replayer::open(options.record);
    const bool hasNoState = std::filesystem::file_size(options.record, ignored) == 0 || (log && !(*log)->nextTime());
    if (alone && hasNoState) {
        options.force = true;
        return;
    }
    options.resume = std::exchange(options.record, {});
}

void checkResume(const ServeArguments& options) {
    const bool resumes = !options.resume.empty() || options.resumeIfThere;
    if (options.await > options.peers)
        throw UsageError(
            "--await", fmt::format("waits for {} mirrors, of which --peers lets in {}", options.await, options.peers));
    if (options.scene.empty() && options.resume.empty()) throw UsageError("SCENE is required, or --resume LOG");
    if (std::error_code ignored; std::filesystem::is_directory(options.resume, ignored))
        throw UsageError("--resume", options.resume + " is a folder: name the newest file of the log that is in it");
    if (options.reload && resumes)
        throw UsageError("--reload", "cannot be combined with --resume, which continues the session and not the file");
    const ServeLogArguments none;
    if (options.log.rate != none.rate || options.log.loop || options.log.paused || options.log.control)
        throw UsageError("--rate, --loop, --paused, --control", "are for a log, but a scene is served");
    if (!options.resume.empty() && !options.record.empty())
        throw UsageError("--record", "cannot be combined with --resume, which continues its log");
    if (resumes && !options.start.at.empty())
        throw UsageError("--at",
                         "not together with --resume: a log has its own clock, which goes on from its last state");
    if (resumes && !options.start.clip.empty())
        throw UsageError("--clip", "cannot be combined with --resume: the motion in the log continues");
    if (resumes && options.mode == nameOf(Mode::lossy))
        throw UsageError("--resume", "not together with --mode lossy: mirrors hold other values than the log");
}

std::chrono::milliseconds millisecondsFrom(const std::string& duration) {
    return std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(duration)));
}

/// Sets all options that do not depend on the scene.
Result<MirrorServerOptions> serverOptionsOf(const ServeArguments& options) {
    checkEndpoint("--bind", options.endpoint);
    MirrorServerOptions result;
    auto keys = serverKeysFrom(options.key);
    if (!keys) return std::unexpected(keys.error());
    result.keys = std::move(*keys);
    result.keyFile = options.key;
    result.insecure = options.insecure;
    result.upstream = *mirrorUpstreamFromName(options.upstream);
    result.maximumPeers = options.peers;
    result.maximumParts = options.parts;
    result.maxBytesPerSecond = options.maxRate;
    result.blockFor = millisecondsFrom(options.block);
    result.mode.coding = *codingFromName(options.coding);
    return result;
}

int play(const ServeArguments& options, const std::vector<std::string>& given) {
    if (!options.record.empty()) throw UsageError("--record", "a log is played, so there is a log already");
    if (options.mode != "state") throw UsageError("--mode", "a log is played as it was recorded");
    if (!options.start.at.empty())
        throw UsageError("--at", "a log is played with its recorded times; the command seek T jumps");
    if (options.await > 0) throw UsageError("--await", "a log is played at once; with --paused it waits for a command");
    for (const char* option :
         {"--fps", "--error", "--keyframe-bytes", "--keyframe-seconds", "--rotate", "--keep", "--free", "--dis",
          "--clip", "--feed", "--publish", "--fields", "--publish-rate", "--foxglove", "--metrics-port"})
        if (std::ranges::find(given, option) != given.end())
            throw UsageError(option, "is for a scene, but a log is played");
    const double duration =
        options.duration.empty() ? std::numeric_limits<double>::infinity() : parseSeconds(options.duration);
    const auto serverOptions = serverOptionsOf(options);
    if (!serverOptions) return printError(serverOptions.error()), kBad;
    return serveLog({options.scene, options.shown, options.endpoint, options.log, options.web,
                     options.resources.ofFile(firstFileOf(options.scene)), duration, parseSeconds(options.linger),
                     options.json, options.nats},
                    *serverOptions);
}

/// Has the bytes that mirrors get. A lossy session sends them other values, so its log is of the scene itself.
struct SessionLog {
    std::shared_ptr<RecordLog> sent;
    std::unique_ptr<LogRecorder> own;

    explicit operator bool() const { return sent || own; }
    std::string failure() const { return sent ? sent->failure() : own ? own->failure() : std::string(); }
    std::uint64_t acknowledged() const { return sent ? sent->acknowledged() : own ? own->acknowledged() : 0; }
    std::uint64_t bytes() const { return sent ? sent->bytes() : own ? own->bytes() : 0; }
    std::uint64_t encoded() const { return sent ? sent->encoded() : 0; }
    Result<> stop() { return sent ? sent->stop() : own ? own->stop() : Result<>(); }
};

/// The scene's file, or the log with which it goes on.
const std::string& fileOf(const ServeArguments& options) {
    return options.scene.empty() ? options.resume : options.scene;
}

/// One session: a scene, its followers, and its log.
class Session {
  public:
    Session(const ServeArguments& options, double duration)
        : options_(options),
          duration_(duration),
          linger_(millisecondsFrom(options.linger)),
          running_(fileOf(options), options.resources.ofFile(fileOf(options)), options.start.options(),
                   programContext()) {}

    /// Each returns kDone, or the status with which the program ends.
    int open();
    int startServer();
    int startFeeds();
    int startLog();
    void run();
    int close();

  private:
    /// The name of the served file or log; urls start from the file's folder.
    const std::string& name() const { return resumed_ ? options_.shown : running_.file(); }
    const std::string& logFile() const { return resumed_ ? options_.resume : options_.record; }
    void lookAtLog();
    void frame(std::uint64_t slot);
    std::uint64_t rest(std::uint64_t slot, std::uint64_t last);
    std::uint64_t slotNow() const;
    Clock::time_point dueAt(std::uint64_t slot) const;
    void print(const MirrorServerStatistics& statistics) const;

    const ServeArguments& options_;
    const double duration_;
    const std::chrono::milliseconds linger_;
    RunningScene running_;
    std::optional<ResumedSession> resumed_;
    std::unique_ptr<LossyScene> lossy_;
    std::unique_ptr<MirrorServer> server_;
    Web web_;
    Published published_;
    std::optional<Feeds> feeds_;
    std::string counted_;  // by the feeds, as JSON
    Health health_;
    SessionLog log_;
    std::uint64_t frames_ = 0;
    Clock::time_point start_;
    double from_ = 0;  // time of the first frame
    double seconds_ = 0;
    bool failed_ = false;  // the log or the session ended early
};

int Session::open() {
    const std::vector<OutputName> outputs{{"--record", options_.record, OutputKind::log}};
    if (auto ok = checkFiles({options_.scene, options_.key, options_.resume}, outputs, options_.force); !ok)
        return printError(ok.error()), kBad;
    if (auto ok = options_.rotate.checkPieces(options_.record, options_.force); !ok)
        return printError(ok.error()), kBad;
    running_.allowNetwork(options_.network.dis);
    if (options_.embed) running_.embedFetched();
    if (options_.reload) orUsageError(running_.followEdits());
    auto resumed = begin(running_, options_);
    if (!resumed) return printError(resumed.error()), kBad;
    resumed_ = std::move(*resumed);
    keepResources(running_.scene(), running_.resources(), outputs);
    return kDone;
}

int Session::startServer() {
    auto created = serverOptionsOf(options_);
    if (!created) return printError(created.error()), kBad;
    MirrorServerOptions how = std::move(*created);
    if (options_.mode == nameOf(Mode::input)) how.mode.mode = Mode::input;
    if (options_.mode == nameOf(Mode::lossy)) {
        auto followed = LossyScene::follow(running_.scene(), options_.error);
        if (!followed) return printError(followed.error()), kUsage;
        lossy_ = std::move(*followed);
        how.mode.mode = Mode::lossy;
        how.mode.maxError = options_.error;
    }
    if (resumed_) {
        how.epoch = resumed_->epoch;
        how.before = std::move(resumed_->before);
    }
    const std::optional<MirrorKeys> keys = how.keys;
    auto server = MirrorServer::start(lossy_ ? lossy_->scene() : running_.scene(), options_.endpoint, std::move(how));
    if (!server) return printError(namingOptions(server.error(), "--key", options_.key)), kBad;
    server_ = std::move(*server);
    auto web = Web::start(options_.web, *server_, keys);
    if (!web) return printError(web.error()), kBad;
    web_ = std::move(*web);
    auto published = Published::start(options_.nats, *server_, keys);
    if (!published) return printError(published.error()), kBad;
    published_ = std::move(*published);
    return kDone;
}

int Session::startLog() {
    if (logFile().empty()) return kDone;
    LogOptions logOptions;
    logOptions.existing = existing(options_.force);
    logOptions.append = resumed_.has_value();
    if (resumed_) logOptions.sessionStart = resumed_->start;
    logOptions.epoch = lossy_ ? 0 : server_->epoch();
    options_.keyframes.setIn(logOptions);
    options_.rotate.setIn(logOptions);
    if (lossy_) {
        auto created = LogRecorder::start(running_.scene(), logFile(), logOptions);
        if (!created) return printError(created.error()), kBad;
        log_.own = std::move(*created);
        // Waits until the present state is in the log, before the first new one. Otherwise the recorder would begin
        // with the newest state when its file is ready.
        log_.own->waitFor(running_.scene().sequence(), std::chrono::seconds(10));
        return kDone;
    }
    // It begins with the present state: that of the document, or again the last one of the log.
    auto created = RecordLog::start(running_.scene(), logFile(), logOptions);
    if (!created) return printError(created.error()), kBad;
    log_.sent = std::move(*created);
    // If this program is killed, no mirror is ahead of the log.
    server_->recordTo(log_.sent);
    return kDone;
}

int Session::startFeeds() {
    Feeds::Settings how;
    how.start = running_.start();
    how.insecure = options_.insecure;
    how.call = server_->callDescriptor();
    auto feeds = Feeds::start(options_.feeds, running_.world(), how);
    if (!feeds) return printError(namingOptions(feeds.error(), "--insecure", "")), kBad;
    feeds_ = std::move(*feeds);
    if (auto ok = health_.start(options_.metrics.listen, options_.insecure); !ok)
        return printError(namingOptions(ok.error(), "--insecure", "")), kBad;
    return kDone;
}

/// If the recording fails it ends, but mirrors go on.
void Session::lookAtLog() {
    if (!log_ || failed_ || log_.failure().empty()) return;
    printError(log_.failure());
    printError(log_.acknowledged() > 0
                   ? fmt::format("the recording has ended; {} holds the session at least to state {}", logFile(),
                                 log_.acknowledged())
                   : "nothing was recorded");
    failed_ = true;
}

void Session::run() {
    const std::string figures = health_.address();
    if (!figures.empty()) say("figures at http://" + figures + "/metrics");
    sayEndpoint(fmt::format("serving {} at", name()), *server_, web_, options_.json, published_.address(),
                feeds_->sayEndpoints() + (figures.empty() ? "" : fmt::format(",\"metrics\":{}", jsonString(figures))));
    notifyServiceManager(fmt::format("READY=1\nSTATUS=serving {} at {}", name(), server_->endpoint()));
    // The publisher counts as a peer, too.
    if (options_.await > 0) await(*server_, options_.await + (options_.nats.empty() ? 0 : 1));

    start_ = Clock::now();
    // A resumed session goes on with the frame after its last one.
    if (resumed_) from_ = running_.time() + 1 / options_.fps;
    const auto last = static_cast<std::uint64_t>(std::floor(duration_ * options_.fps + 1e-9));
    const Progress progress = options_.duration.empty() ? Progress{} : progressBar("serving " + name());
    for (std::uint64_t slot = 0; !interrupted() && slot <= last;) {
        server_->service();  // requests of mirrors take effect in this frame
        frame(slot);
        printServerNews(*server_);
        published_.printNews();
        web_.service(running_.scene(), running_.resources());
        lookAtLog();
        if (progress) progress(slot, last + 1);
        slot = rest(std::max(slot + 1, slotNow()), last);
        sleepUntil(dueAt(slot));
    }
    if (progress) progress(1, 1);
    seconds_ = std::chrono::duration<double>(Clock::now() - start_).count();
}

/// Frames have even times. Those for which there was no time are left out, so the clock never lags.
void Session::frame(std::uint64_t slot) {
    const double t = from_ + static_cast<double>(slot) / options_.fps;
    const Clock::time_point begun = Clock::now();
    feeds_->before(t);
    running_.frame(t);
    feeds_->after(t);
    ++frames_;
    feedWatchdog();
    if (!health_.serves()) return;
    health_.noteFrame(Clock::now() - begun, running_.scene().sequence(), t);
    if (feeds_->any()) health_.noteFeeds(feeds_->counts());
    health_.noteServer(*server_);
    health_.noteLog(log_.bytes());
}
std::uint64_t Session::slotNow() const {
    return static_cast<std::uint64_t>(std::chrono::duration<double>(Clock::now() - start_).count() * options_.fps);
}
Clock::time_point Session::dueAt(std::uint64_t slot) const {
    return start_ + std::chrono::duration_cast<Clock::duration>(
                        std::chrono::duration<double>(static_cast<double>(slot) / options_.fps));
}

/// Sleeps through frames that would change nothing, until a mirror sends something, the file has been edited, the frame
/// before the next change, or the time must be told. Returns the next frame, or `slot` if there is nothing to sleep
/// through. The state before the sleep lasts until the frame before the one that ends it, so that frame is run, too.
std::uint64_t Session::rest(std::uint64_t slot, std::uint64_t last) {
    const double until = (std::min(running_.restsUntil(), feeds_->nextAt()) - from_) * options_.fps;
    const double reported = static_cast<double>(slot) + std::floor(kTimeIsReported * options_.fps);
    const double end = std::min({until - 1, reported, static_cast<double>(last)});
    if (!(end > static_cast<double>(slot))) return slot;
    const auto next = static_cast<std::uint64_t>(end);
    for (bool isAwake = false; !isAwake && !interrupted() && Clock::now() < dueAt(next);) {
        const auto wake =
            running_.followsEdits() ? std::min(dueAt(next), Clock::now() + RunningScene::kLookEvery) : dueAt(next);
        server_->wait(wake);
        isAwake = Clock::now() < wake || running_.isEdited();
    }
    const std::uint64_t now = std::min(slotNow(), next);
    if (now == next || now <= slot) return std::max(now, slot);
    if (!interrupted()) frame(now - 1);
    return now;
}

void Session::print(const MirrorServerStatistics& statistics) const {
    const Scene& scene = running_.scene();
    const double fps = static_cast<double>(frames_) / std::max(seconds_, 1e-9);
    if (options_.json)
        fmt::print(
            "{{\"frames\":{},\"seconds\":{:.3f},\"fps\":{:.2f},\"t\":{},\"sequence\":{},\"peers\":{},\"bytes\":{},"
            "\"snapshots\":{},\"merged\":{},\"resumed\":{},\"repairs\":{},\"requests\":{},\"stalls\":{},"
            "\"garbage\":{},\"refused\":{},\"lost\":{},\"log_bytes\":{},\"log_encoded\":{},\"hash\":\"{}\"{}}}\n",
            frames_, seconds_, fps, running_.time(), scene.sequence(), statistics.maxPeers, statistics.bytes,
            statistics.snapshots, statistics.merged, statistics.resumed, statistics.repairs, statistics.requests,
            statistics.stalls, statistics.garbage, statistics.refused, statistics.lost, log_.bytes(), log_.encoded(),
            scene.hash().hex(), counted_);
    else
        fmt::print("{} in {:.2f} s ({:.1f} a second), {} bytes to at most {} mirrors, state {}\n", framesText(frames_),
                   seconds_, fps, statistics.bytes, statistics.maxPeers, scene.hash().hex());
}

int Session::close() {
    notifyServiceManager("STOPPING=1");
    running_.reportDiagnostics(log_.failure());
    // Mirrors that are behind, say because of a picture, may still catch up.
    if (!interrupted() && !server_->drain(linger_)) say("not all mirrors have caught up", Severity::warning);
    const MirrorServerStatistics statistics = server_->statistics();
    printServerNews(*server_);
    feeds_->end();
    counted_ = feeds_->json();
    feeds_.reset();  // it calls the server
    server_.reset();
    web_.end();
    published_.printNews();
    failed_ = failed_ || published_.failed();
    published_.end();
    if (log_) {
        if (auto ok = log_.stop(); !ok && !failed_) {
            printError(ok.error());
            failed_ = true;
        }
    }
    print(statistics);
    if (interrupted()) {
        if (log_ && !failed_)
            say(fmt::format("{} holds the session to state {}", logFile(), running_.scene().sequence()));
        if (!options_.duration.empty() && running_.time() - from_ < duration_) {
            printError(fmt::format("interrupted at {:.3f} of {} s", running_.time() - from_, duration_));
            failed_ = true;
        }
    }
    return failed_ ? kBad : kDone;
}

int serveScene(const ServeArguments& options) {
    Session session(options, options.duration.empty() ? 1e9 : parseSeconds(options.duration));
    if (const int status = session.open(); status != kDone) return status;
    if (const int status = session.startServer(); status != kDone) return status;
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    if (const int status = session.startFeeds(); status != kDone) return status;
    if (const int status = session.startLog(); status != kDone) return status;
    session.run();
    return session.close();
}

int serve(ServeArguments options, const std::vector<std::string>& given) {
    options.say.apply();
    options.web.check();
    options.feeds.check(options.scene, false);
    if (!options.nats.empty()) checkNatsAddress("--nats", options.nats);
    resumeIfThere(options);
    options.shown = shownLog(options.resume.empty() ? options.scene : options.resume);
    PassingFolder fetched;
    if (options.resume.empty() && isNatsAddress(options.scene)) {
        auto log = fetchLog("SCENE", options.scene);
        if (!log) return printError(log.error()), kBad;
        fetched = std::move(*log);
    }
    if (options.resume.empty() && isLogOrNamedSo(options.scene)) return play(options, given);
    options.resources.inBackground = true;
    checkResume(options);
    options.rotate.check(options.record.empty() ? options.resume : options.record);
    LogOptions ignored;
    options.rotate.setIn(ignored);  // throws before anything runs
    const bool rotates = options.rotate.wanted();
    checkLogUse(options.rotate.asked("--record"), options.record, rotates ? LogUse::rotate : LogUse::write);
    auto resumed = StoredLog::start(options.rotate.asked("--resume"), options.resume,
                                    rotates ? LogUse::goOnRotating : LogUse::goOn, false);
    if (!resumed) return printError(resumed.error()), kBad;
    auto recorded = StoredLog::start("--record", options.record, LogUse::write, options.force);
    if (!recorded) return printError(recorded.error()), kBad;
    return resumed->finish(recorded->finish(serveScene(options)));
}

void addMirrors(Command& command, ServeArguments& options) {
    const Command::Section section(command, "Mirrors");
    command.addOption("--key", options.key, "key file: encrypts, and admits only the listed keys; made if missing");
    command.addFlag("--insecure", options.insecure, "serve other machines without keys");
    command
        .addOption("--upstream", options.upstream,
                   "what mirrors may send, unless the key file says otherwise; code: also edits of urls and Scripts")
        ->preset()
        ->oneOf({"none", "events", "edits", "code"});
    command.addOption("--peers", options.peers, "most mirrors")->preset();
    command.addOption("--parts", options.parts, "most different parts of the scene that mirrors may follow")->preset();
    command
        .addOption("--mode", options.mode,
                   "state: bit for bit; lossy: within --error while in motion; input: as state, and mirrors that ask "
                   "for it get what comes into each frame and run it")
        ->oneOf({"state", "lossy", "input"})
        ->preset();
    command.addOption("--error", options.error, "lossy: largest error, metres and radians; values at rest are exact")
        ->positive()
        ->preset();
    command.addOption("--coding", options.coding, "coding of values: raw, fastest; compact; smallest")
        ->oneOf(std::vector<std::string>(kCodingNames.begin(), kCodingNames.end()))
        ->preset();
    command.addOption("--max-rate", options.maxRate, "most bytes a second to each mirror, as 1MB; 0: any")
        ->bytes()
        ->preset();
    command.addOption("--block", options.block, "how long a mirror that asks for it may hold up a frame")->preset();
    command.addOption("--linger", options.linger, "time for mirrors to catch up at the end")->preset();
    command.addOption("--nats", options.nats,
                      "nats://HOST:PORT/NAME, or tls: publish there too, once for any number of mirrors");
}

}  // namespace

Verb addServe(Command& program) {
    auto options = std::make_shared<ServeArguments>();
    Command* command = program.addVerb("serve", "Run a scene in real time and mirror it");
    command->addOption(
        "SCENE", options->scene,
        "scene file, or -, or a log to play (file, folder of its pieces, nats://HOST:PORT/NAME); with --resume only "
        "the folder that urls start from");
    command->addOption("--resume", options->resume,
                       "continue the session in this log, after a crash or an end: with the same states, clock and "
                       "epoch, so that mirrors continue, too; the log is continued");
    command->addOption("--bind", options->endpoint, "ZeroMQ endpoint; * picks a free port")->preset();
    command->addOption("--for", options->duration, "how long; else until Ctrl-C");
    command->addOption("--fps", options->fps, "frames a second")->preset()->range(1e-3, 1e4);
    options->start.addTo(*command);
    command->addFlag("--json", options->json, "first the endpoint, then the summary as JSON lines");
    command->addFlag("--reload", options->reload, "follow the scene's file whenever it has been edited");
    command->addOption("--await", options->await, "run the first frame when this many mirrors follow")->preset();
    addMirrors(*command, *options);
    {
        const Command::Section section(*command, "Log");
        command->addOption("--record", options->record, "log to write as well (.rlog), or nats://HOST:PORT/NAME");
        command->addFlag("--resume-if-there", options->resumeIfThere,
                         "if the log of --record is there already, continue its session as --resume does: one command "
                         "for the first start and for each after a crash");
        options->keyframes.addTo(*command);
        options->rotate.addTo(*command);
        addForce(*command, options->force);
    }
    command->addFlag("--embed", options->embed,
                     "send mirrors, and record, the bytes of files from the network, not only their hashes");
    options->log.addTo(*command);
    options->web.addTo(*command);
    options->feeds.addTo(*command);
    options->metrics.addTo(*command);
    options->say.addTo(*command);
    options->resources.addTo(*command);
    options->network.addTo(*command);
    command->footer(
        "Example: rtsg serve hall.x3dv --bind tcp://127.0.0.1:4711 --for 20s --record hall.rlog\n"
        "Example: rtsg serve hall.x3dv --bind tcp://127.0.0.1:4711 --for 20s --record live.rlog --resume-if-there\n"
        "Example: rtsg serve --resume hall.rlog --bind tcp://127.0.0.1:4711 --for 20s\n"
        "Example: rtsg serve hall.rlog --loop --rate 0.5 --upstream events --for 5s\n"
        "Example: rtsg serve hall.x3dv --web 8080 --upstream events --for 20s\n"
        "Example: rtsg serve door.x3dv --feed udp://127.0.0.1:5601 --publish tcp://127.0.0.1:5602 --fields "
        "DOOR.rotation,PRESSED.* --for 20s\n"
        "The first line on standard output names the endpoint, the port filled in.");
    return {command, [command, options] { return serve(*options, command->given()); }};
}

}  // namespace rtsg::app
