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
    std::string scene, endpoint = "tcp://127.0.0.1:*", duration, record, key, upstream = "none", block = "0";
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

int serve(const Options& options) {
    const double duration = options.duration.empty() ? 1e9 : parseSeconds(options.duration);
    const std::vector<OutputName> outputs{{"--record", options.record, OutputKind::log}};
    if (auto ok = checkFiles({options.scene, options.key}, outputs, options.force); !ok)
        return printError(ok.error()), kBad;
    RunningScene running(options.scene, options.resources, options.start);
    if (!running.load()) return kBad;
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
    auto server = MirrorServer::start(lossy ? lossy->scene() : scene, options.endpoint, serverOptions);
    if (!server) return printError(server.error()), kBad;
    (void)interrupted();  // from here on an interruption ends in order: no half file stays
    std::unique_ptr<LogRecorder> log;
    if (!options.record.empty()) {
        LogOptions logOptions;
        logOptions.existing = existing(options.force);
        options.keyframes.setIn(logOptions);
        auto created = LogRecorder::start(scene, options.record, logOptions);
        if (!created) return printError(created.error()), kBad;
        log = std::move(*created);
    }
    if (options.json)
        fmt::print("{{\"endpoint\":{}}}\n", jsonString((*server)->endpoint()));
    else
        fmt::print("serving {} at {}\n", options.scene, (*server)->endpoint());
    std::fflush(stdout);

    if (options.await > 0) await(**server, options.await);
    // Frames are at even times; those that there was no time for are left out, the clock never lags behind.
    const auto start = Clock::now();
    std::uint64_t frames = 0, slot = 0;
    const auto last = static_cast<std::uint64_t>(std::floor(duration * options.fps + 1e-9));
    std::size_t mostPeers = 0;
    bool failed = false;
    const Progress progress = options.duration.empty() ? Progress{} : progressBar("serving " + options.scene);
    while (!interrupted() && slot <= last) {
        (*server)->service();  // what mirrors have sent takes effect in this frame
        running.frame(static_cast<double>(slot) / options.fps);
        ++frames;
        mostPeers = std::max(mostPeers, (*server)->statistics().peers);
        printNews(**server);
        if (log && !failed && !log->failure().empty()) {
            printError(log->failure());
            printError(fmt::format("the recording has ended; {} holds the session to state {}", options.record,
                                   log->acknowledged()));
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
        if (log && !failed) fmt::print(stderr, "{} holds the session to state {}\n", options.record, scene.sequence());
        if (!options.duration.empty() && running.time() < duration) {
            printError(fmt::format("interrupted at {} of {} s", running.time(), duration));
            failed = true;
        }
    }
    return failed ? kBad : kDone;
}

}  // namespace

Verb addServe(Command& program) {
    auto options = std::make_shared<Options>();
    Command* command = program.addVerb("serve", "Run a scene in real time and mirror it");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
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
        "The first line on standard output names the endpoint, the port filled in.");
    return {command, [options] { return serve(*options); }};
}

}  // namespace rtsg::app
