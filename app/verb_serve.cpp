// rtsg serve: a scene in real time, mirrored and recorded.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include <rtsg/core/terminal.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/mirror_server.h>

#include "files.h"
#include "keyframes.h"
#include "running_scene.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

struct Options {
    std::string scene, resume, endpoint = "tcp://127.0.0.1:*", duration, record, key, upstream = "none", block = "0";
    std::string mode = "state", coding = "raw";
    double fps = 60, error = 1e-3;
    std::string linger = "10s";
    std::size_t peers = 64, parts = 8, await = 0;
    std::uint64_t maxRate = 0;
    ResourceArguments resources;
    StartTime start{StartTime::Kind::live, {}};
    KeyframeArguments keyframes;
    bool insecure = false, json = false, force = false;
};

/// A key file that is not there yet is made: the client is given a copy.
Result<std::optional<MirrorKeys>> keysFrom(const std::string& file) {
    if (file.empty()) return std::nullopt;
    if (!std::filesystem::exists(file)) {
        if (auto ok = MirrorKeys::generate(file); !ok) return std::unexpected(ok.error());
        fmt::print(stderr, "new keys in {}: give a mirror a copy\n", file);
    }
    auto keys = MirrorKeys::load(file);
    if (!keys) return std::unexpected(keys.error());
    return std::optional(std::move(*keys));
}

void printNews(MirrorServer& server) {
    for (const Diagnostic& d : server.takeDiagnostics()) fmt::print(stderr, "{}\n", terminalText(d.format()));
}

/// Until so many mirrors have the scene's first state, which is then that of all of them.
void await(MirrorServer& server, std::size_t mirrors) {
    for (bool there = false; !there && !interrupted();) {
        server.service();
        printNews(server);
        there = server.statistics().peers >= mirrors && server.drain(std::chrono::milliseconds(50));
        if (!there) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
}

/// From its file, or as the log of the session has it.
Result<std::optional<ResumedSession>> begin(RunningScene& running, const Options& options) {
    if (options.resume.empty()) {
        if (!running.load()) return fail("nothing usable in it", {}, options.scene);
        return std::nullopt;
    }
    auto session = running.resume(options.resume);
    if (!session) return std::unexpected(session.error());
    fmt::print(stderr, "going on at state {}, t = {:.3f} s{}\n", running.scene().sequence(), running.time(),
               session->damaged ? fmt::format("; {} places of the log could not be read", session->damaged) : "");
    return std::optional(std::move(*session));
}

void checkResume(const Options& options) {
    if (options.scene.empty() && options.resume.empty()) throw UsageError("SCENE is required, or --resume LOG");
    if (!options.resume.empty() && !options.record.empty())
        throw UsageError("--record", "not together with --resume, which goes on writing its log");
    if (!options.resume.empty() && options.mode == nameOf(Mode::lossy))
        throw UsageError("--resume", "not together with --mode lossy: mirrors hold other values than the log");
}

int serve(const Options& options) {
    const double duration = options.duration.empty() ? 1e9 : parseSeconds(options.duration);
    checkResume(options);
    const std::vector<OutputName> outputs{{"--record", options.record, OutputKind::log}};
    if (auto ok = checkFiles({options.scene, options.key, options.resume}, outputs, options.force); !ok)
        return printError(ok.error()), kBad;
    RunningScene running(options.scene.empty() ? options.resume : options.scene, options.resources, options.start);
    auto session = begin(running, options);
    if (!session) return printError(session.error()), kBad;
    Scene& scene = running.scene();
    keepResources(scene, running.resources(), outputs);
    auto keys = keysFrom(options.key);
    if (!keys) return printError(keys.error()), kBad;
    MirrorServerOptions serverOptions;
    serverOptions.keys = std::move(*keys);
    serverOptions.insecure = options.insecure;
    serverOptions.upstream = *mirrorUpstreamFromName(options.upstream);
    serverOptions.maximumPeers = options.peers;
    serverOptions.maximumParts = options.parts;
    serverOptions.mostBytesPerSecond = options.maxRate;
    serverOptions.blockFor = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(options.block)));
    serverOptions.mode.coding = *codingFromName(options.coding);
    if (options.mode == nameOf(Mode::input)) serverOptions.mode.mode = Mode::input;
    std::unique_ptr<LossyScene> lossy;
    if (options.mode == nameOf(Mode::lossy)) {
        auto followed = LossyScene::follow(scene, options.error);
        if (!followed) return printError(followed.error()), kUsage;
        lossy = std::move(*followed);
        serverOptions.mode.mode = Mode::lossy;
        serverOptions.mode.maxError = options.error;
    }
    if (*session) {
        serverOptions.epoch = (*session)->epoch;
        serverOptions.before = std::move((*session)->before);
    }
    auto server = MirrorServer::start(lossy ? lossy->scene() : scene, options.endpoint, serverOptions);
    if (!server) return printError(server.error()), kBad;
    (void)interrupted();  // from here on an interruption ends in order: no half file stays
    std::unique_ptr<LogRecorder> log;
    const std::string& logFile = *session ? options.resume : options.record;
    if (!logFile.empty()) {
        LogOptions logOptions;
        logOptions.existing = existing(options.force);
        logOptions.append = session->has_value();
        logOptions.epoch = lossy ? 0 : (*server)->epoch();
        options.keyframes.setIn(logOptions);
        auto created = LogRecorder::start(scene, logFile, logOptions);
        if (!created) return printError(created.error()), kBad;
        log = std::move(*created);
        // The state that the log ends with, again, before the first new one: so that none is missing between.
        if (*session) log->waitFor(scene.sequence(), std::chrono::seconds(10));
    }
    if (options.json)
        fmt::print("{{\"endpoint\":{}}}\n", jsonString((*server)->endpoint()));
    else
        fmt::print("serving {} at {}\n", running.file(), (*server)->endpoint());
    std::fflush(stdout);

    if (options.await > 0) await(**server, options.await);
    // Frames are at even times; those that there was no time for are left out, the clock never lags behind.
    const auto start = Clock::now();
    // A session that goes on does so with the frame after its last one.
    const double from = *session ? running.time() + 1 / options.fps : 0;
    std::uint64_t frames = 0, slot = 0;
    const auto last = static_cast<std::uint64_t>(std::floor(duration * options.fps + 1e-9));
    std::size_t mostPeers = 0;
    bool failed = false;
    const Progress progress = options.duration.empty() ? Progress{} : progressBar("serving " + running.file());
    while (!interrupted() && slot <= last) {
        (*server)->service();  // what mirrors have sent takes effect in this frame
        running.frame(from + static_cast<double>(slot) / options.fps);
        ++frames;
        mostPeers = std::max(mostPeers, (*server)->statistics().peers);
        printNews(**server);
        if (log && !failed && !log->failure().empty()) {
            printError(log->failure());
            printError(
                fmt::format("the recording has ended; {} holds the session to state {}", logFile, log->acknowledged()));
            failed = true;  // but those who follow go on
        }
        if (progress) progress(slot, last + 1);
        const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
        slot = std::max(slot + 1, static_cast<std::uint64_t>(elapsed * options.fps));
        const auto due = start + std::chrono::duration_cast<Clock::duration>(
                                     std::chrono::duration<double>(static_cast<double>(slot) / options.fps));
        while (!interrupted() && Clock::now() < due)
            std::this_thread::sleep_until(std::min(due, Clock::now() + std::chrono::milliseconds(50)));
    }
    if (progress) progress(1, 1);
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    running.printDiagnostics(log ? log->failure() : "");
    // Mirrors that are behind, with a picture say, may still catch up.
    const auto grace = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(options.linger)));
    if (!interrupted() && !(*server)->drain(grace)) fmt::print(stderr, "not all mirrors have caught up\n");
    const MirrorServerStatistics statistics = (*server)->statistics();
    printNews(**server);
    server->reset();
    if (log) {
        if (auto ok = log->stop(); !ok && !failed) {
            printError(ok.error());
            failed = true;
        }
    }
    const double fps = static_cast<double>(frames) / std::max(seconds, 1e-9);
    if (options.json)
        fmt::print(
            "{{\"frames\":{},\"seconds\":{:.3f},\"fps\":{:.2f},\"t\":{},\"sequence\":{},\"peers\":{},\"bytes\":{},"
            "\"snapshots\":{},\"merged\":{},\"resumed\":{},\"repairs\":{},\"requests\":{},\"stalls\":{},"
            "\"garbage\":{},\"refused\":{},\"lost\":{},\"log_bytes\":{},\"hash\":\"{}\"}}\n",
            frames, seconds, fps, running.time(), scene.sequence(), mostPeers, statistics.bytes, statistics.snapshots,
            statistics.merged, statistics.resumed, statistics.repairs, statistics.requests, statistics.stalls,
            statistics.garbage, statistics.refused, statistics.lost, log ? log->bytes() : 0, scene.hash().hex());
    else
        fmt::print("{} frames in {:.2f} s ({:.1f} a second), {} bytes to at most {} mirrors, state {}\n", frames,
                   seconds, fps, statistics.bytes, mostPeers, scene.hash().hex());
    if (interrupted()) {
        if (log && !failed) fmt::print(stderr, "{} holds the session to state {}\n", logFile, scene.sequence());
        if (!options.duration.empty() && running.time() - from < duration) {
            printError(fmt::format("interrupted at {} of {} s", running.time() - from, duration));
            failed = true;
        }
    }
    return failed ? kBad : kDone;
}

}  // namespace

Verb addServe(Command& program) {
    auto options = std::make_shared<Options>();
    Command* command = program.addVerb("serve", "Run a scene in real time and mirror it");
    command->addOption("SCENE", options->scene, "scene file, or -; with --resume only the folder that urls start from");
    command->addOption(
        "--resume", options->resume,
        "go on with the session in this log, killed or ended: same states, clock and epoch, so that mirrors "
        "go on too; the log is continued");
    command->addOption("--bind", options->endpoint, "ZeroMQ endpoint; * picks a free port")->preset();
    command->addOption("--for", options->duration, "how long; else until Ctrl-C");
    command->addOption("--fps", options->fps, "frames a second")->preset()->range(1e-3, 1e4);
    command
        ->addOption("--mode", options->mode,
                    "state: bit for bit; lossy: within --error while in motion; input: as state, and mirrors that ask "
                    "for it get what comes into each frame and run it")
        ->oneOf({"state", "lossy", "input"})
        ->preset();
    command->addOption("--error", options->error, "lossy: largest error, metres and radians; what rests is exact")
        ->positive()
        ->preset();
    command->addOption("--coding", options->coding, "of values: raw, fastest; compact; smallest")
        ->oneOf(std::vector<std::string>(kCodingNames.begin(), kCodingNames.end()))
        ->preset();
    command->addOption("--record", options->record, "log to write as well (.rlog)");
    options->keyframes.addTo(*command);
    addForce(*command, options->force);
    command->addOption("--key", options->key, "key file: encrypts, and lets in only those listed; made if missing");
    command->addOption("--linger", options->linger, "how long mirrors may catch up at the end")->preset();
    command
        ->addOption("--upstream", options->upstream,
                    "what mirrors may send, if the key file does not say it; code: edits of urls and Scripts too")
        ->preset()
        ->oneOf({"none", "events", "edits", "code"});
    command->addOption("--peers", options->peers, "how many mirrors may follow")->preset();
    command->addOption("--parts", options->parts, "how many different parts of the scene they may ask for")->preset();
    command->addOption("--max-rate", options->maxRate, "most bytes a second to each mirror, as 1MB; 0: any")
        ->bytes()
        ->preset();
    command->addOption("--await", options->await, "begin with the first frame when so many mirrors follow")->preset();
    command->addOption("--block", options->block, "how long a mirror that asks for it may hold up a frame")->preset();
    command->addFlag("--insecure", options->insecure, "serve other machines without keys");
    options->start.addTo(*command);
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "first the endpoint, then the summary as JSON lines");
    command->footer(
        "Example: rtsg serve hall.x3dv --bind tcp://127.0.0.1:4711 --for 20s --record hall.rlog\n"
        "Example: rtsg serve --resume hall.rlog --bind tcp://127.0.0.1:4711 --for 20s\n"
        "The first line on standard output names the endpoint, the port filled in.");
    return {command, [options] { return serve(*options); }};
}

}  // namespace rtsg::app
