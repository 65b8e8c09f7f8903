// rtsg mirror: a replica of a served scene, and what is made of it.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include <rtsg/sync/mirror_client.h>

#include "cli.h"
#include "injections.h"
#include "outputs.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kAspects[] = {"none",  "structure", "transform", "geometry", "appearance",
                                    "light", "view",      "sound",     "time"};  // in the order of Aspect

struct Options {
    std::string endpoint, duration, patience = "5s", key, latency = "0", whenSlow = "merge", mode = "state";
    std::vector<std::string> set, parts, aspects;
    double fps = 0;
    OutputArguments outputs;
    bool json = false;
};

/// Names that nothing in the replica has; a number begins with #.
std::vector<std::string> missingParts(const Scene& replica, const std::vector<std::string>& parts) {
    std::vector<std::string> missing;
    for (const std::string& part : parts) {
        std::uint32_t number = 0;
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

/// --set: events for the origin, sent when the replica has come so far since it joined.
class Requests {
  public:
    explicit Requests(const std::vector<std::string>& texts) : texts_(texts) {}
    /// The names are known once there is a replica.
    Result<> parse(Scene& replica) {
        auto parsed = Injections::parse(replica, texts_);
        if (!parsed) return std::unexpected(parsed.error());
        injections_ = std::move(*parsed);
        return {};
    }
    void turn(MirrorClient& client, double since) {
        while (const Injections::Injection* due = injections_.next(since)) {
            if (const auto request = client.submitEvent(due->target.node, due->target.field, due->value))
                ++sent;
            else
                printError(request.error());
        }
        for (const MirrorVerdict& verdict : client.takeVerdicts()) {
            if (verdict.refusal.empty()) {
                ++accepted;
                continue;
            }
            ++refused;
            printError(fmt::format("request {} refused: {}", verdict.request, verdict.refusal));
        }
    }
    std::uint64_t sent = 0, accepted = 0, refused = 0;

  private:
    const std::vector<std::string>& texts_;
    Injections injections_;
};

int mirror(const Options& options) {
    if (auto ok = options.outputs.check({options.key}); !ok) return printError(ok.error()), kBad;
    const double duration = options.duration.empty() ? 1e9 : parseSeconds(options.duration);
    const double patience = parseSeconds(options.patience);
    MirrorClientOptions clientOptions;
    if (!options.key.empty()) {
        auto keys = MirrorKeys::load(options.key);
        if (!keys) return printError(keys.error()), kBad;
        clientOptions.keys = std::move(*keys);
    }
    clientOptions.latency = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(options.latency)));
    clientOptions.framesPerSecond = options.fps;
    clientOptions.inputs = options.mode == "input";
    clientOptions.parts = options.parts;
    for (const std::string& name : options.aspects)
        clientOptions.aspects.push_back(
            static_cast<Aspect>(std::ranges::find(kAspects, name) - std::ranges::begin(kAspects)));
    clientOptions.whenSlow = options.whenSlow == "block"    ? MirrorWhenSlow::block
                             : options.whenSlow == "resync" ? MirrorWhenSlow::resync
                                                            : MirrorWhenSlow::coalesce;
    const Resources resources = options.outputs.resources.ofReplica();
    Scene replica;
    replica.setScriptResources(std::make_shared<const Resources>(resources));
    Requests requests(options.set);
    auto connected = MirrorClient::connect(replica, options.endpoint, clientOptions);
    if (!connected) return printError(connected.error()), kUsage;
    MirrorClient& client = **connected;
    const MirrorStatistics& statistics = client.statistics();

    std::unique_ptr<Outputs> outputs;
    double firstTime = 0;
    bool good = true;
    const auto begun = Clock::now();
    auto heard = begun, joined = begun;
    const Progress progress = options.duration.empty() ? Progress{} : progressBar("mirroring " + options.endpoint);
    while (!interrupted()) {
        const std::size_t applied = client.poll(std::chrono::milliseconds(50));
        for (const Diagnostic& d : client.takeDiagnostics())
            if (d.severity != Severity::note) fmt::print(stderr, "{}\n", d.format());
        if (!client.refusal().empty()) {
            printError(fmt::format("{} refused: {}", options.endpoint, client.refusal()));
            good = false;
            break;
        }
        if (applied > 0 && !outputs) {
            joined = Clock::now();
            firstTime = replica.now();
            auto attached = Outputs::attach(replica, options.outputs, resources);
            if (!attached) return printError(attached.error()), kBad;
            outputs = std::move(*attached);
            if (auto ok = requests.parse(replica); !ok) return printError(ok.error().text), kUsage;
        }
        if (outputs && progress)
            progress(static_cast<std::uint64_t>(1e3 * std::clamp(replica.now() - firstTime, 0., duration)),
                     static_cast<std::uint64_t>(1e3 * duration) + 1);
        if (outputs) requests.turn(client, replica.now() - firstTime);
        if (outputs && !outputs->failure().empty()) break;
        if (client.serverLeft() && applied == 0) break;
        if (applied > 0 || client.inStep()) heard = Clock::now();
        if (outputs && (replica.now() - firstTime >= duration || (secondsSince(joined) >= duration && client.inStep())))
            break;
        if (secondsSince(heard) >= patience) {
            // A server that ends in order says goodbye.
            printError(fmt::format("{}: {} for {} s", options.endpoint,
                                   outputs ? "the server has been silent" : "no server", patience));
            good = false;
            break;
        }
    }
    if (progress) progress(1, 1);
    // What is known to be missing may still be on its way.
    const std::uint64_t known = statistics.originSequence;
    for (const auto end = Clock::now();
         good && statistics.sequence < known && !client.serverLeft() && secondsSince(end) < patience;)
        client.poll(std::chrono::milliseconds(50));
    if (interrupted() && !options.duration.empty()) {
        printError(fmt::format("interrupted after {} of {} s", replica.now() - firstTime, duration));
        good = false;
    }
    if (client.serverLeft() && !options.duration.empty() && replica.now() - firstTime < duration &&
        secondsSince(joined) < duration) {
        printError(fmt::format("{} left after {} of {} s", options.endpoint, replica.now() - firstTime, duration));
        good = false;
    }
    if (statistics.sequence < statistics.originSequence) {
        printError(fmt::format("the replica is in state {}, the origin was in state {}", statistics.sequence,
                               statistics.originSequence));
        good = false;
    }
    if (outputs)
        for (const std::string& part : missingParts(replica, options.parts)) {
            printError(fmt::format("--part {}: {} has no such node", part, options.endpoint));
            good = false;
        }
    const double seconds = secondsSince(joined);
    int pictures = 0;
    double soundSeconds = 0;
    if (outputs) {
        if (auto ok = outputs->finish(); !ok) {
            printError(ok.error());
            good = false;
        }
        pictures = outputs->pictures();
        soundSeconds = outputs->soundSeconds();
    }
    const bool equal = statistics.equal && statistics.sequence == statistics.originSequence;
    good = good && equal && statistics.divergences == 0 && requests.refused == 0;
    const double frames = static_cast<double>(std::max<std::uint64_t>(1, statistics.frames));
    if (!options.json) {
        fmt::print(
            "{} frames ({} snapshots) to state {} of {}, {} bytes ({:.1f} a frame), {:.1f} frames a second\n"
            "{}: {} here, {} at the origin; {} gaps, {} divergences, {} repairs\n",
            statistics.frames, statistics.snapshots, statistics.sequence, statistics.originSequence, statistics.bytes,
            static_cast<double>(statistics.bytes) / frames, frames / std::max(seconds, 1e-9),
            equal ? "equal" : "not equal", statistics.hash.hex(), statistics.originHash.hex(), statistics.gaps,
            statistics.divergences, statistics.repairs);
        if (requests.sent > 0)
            fmt::print("{} events sent, {} accepted, {} refused\n", requests.sent, requests.accepted, requests.refused);
        return good ? kDone : kBad;
    }
    fmt::print(
        "{{\"frames\":{},\"snapshots\":{},\"gaps\":{},\"bytes\":{},\"hash\":\"{}\",\"origin_hash\":\"{}\",\"equal\":{},"
        "\"divergences\":{},\"repairs\":{},\"sequence\":{},\"origin_sequence\":{},\"t\":{},\"seconds\":{:.3f},\"fps\":{"
        ":.2f},\"bytes_per_"
        "frame\":{:.1f},"
        "\"restarts\":{},\"garbage\":{},\"clock_offset_s\":{:.6f},\"delay_s\":{:.6f},\"jitter_s\":{:.6f},\"late\":{},"
        "\"sent\":{},\"accepted\":{},\"refused\":{},\"pictures\":{},\"sound_seconds\":{:.3f},\"inputs\":{}{}}}\n",
        statistics.frames, statistics.snapshots, statistics.gaps, statistics.bytes, statistics.hash.hex(),
        statistics.originHash.hex(), equal, statistics.divergences, statistics.repairs, statistics.sequence,
        statistics.originSequence, replica.now(), seconds, frames / std::max(seconds, 1e-9),
        static_cast<double>(statistics.bytes) / frames, statistics.restarts, statistics.garbage, statistics.clockOffset,
        statistics.delay, statistics.jitter, statistics.late, requests.sent, requests.accepted, requests.refused,
        pictures, soundSeconds, statistics.inputs, outputs ? outputs->worldJson() : std::string());
    return good ? kDone : kBad;
}

}  // namespace

Verb addMirror(CLI::App& program) {
    auto options = std::make_shared<Options>();
    CLI::App* command =
        program.add_subcommand("mirror", "Follow a served scene; picture, hear, log and save the replica");
    command->add_option("ENDPOINT", options->endpoint, "ZeroMQ endpoint that rtsg serve named")->required();
    command->add_option("--for", options->duration, "how long, in scene time; else until the server leaves or Ctrl-C");
    command->add_option("--wait", options->patience, "give up after so long without a server")->capture_default_str();
    command->add_option("--key", options->key, "key file, the server's or one with its public key and a pair");
    command->add_option("--set", options->set,
                        "send an event to the origin: DEF.field=VALUE@TIME, TIME in scene time since joining");
    command->add_option("--part", options->parts, "follow only this subtree: a DEF name, or # and a node's number");
    command->add_option("--aspect", options->aspects, "follow only fields of this aspect, as transform or geometry")
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(kAspects), std::end(kAspects))));
    command->add_option("--mode", options->mode, "input: run the cascade here, from what comes into each frame")
        ->check(CLI::IsMember({"state", "input"}))
        ->capture_default_str();
    command->add_option("--latency", options->latency, "hold frames this long after they were published, for evenness")
        ->capture_default_str();
    command->add_option("--most-fps", options->fps, "at most so many frames a second, others merged; 0: all")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 1e4));
    command
        ->add_option("--when-slow", options->whenSlow,
                     "what to get when too slow: merged frames, every frame while the scene waits (if the server "
                     "lets it), or a new snapshot")
        ->capture_default_str()
        ->check(CLI::IsMember({"merge", "block", "resync"}));
    options->outputs.addTo(*command, true);
    command->add_flag("--json", options->json, "the summary as JSON");
    command->footer(
        "Example: rtsg mirror tcp://127.0.0.1:4711 --for 10s --render out/%04d.png --listen out.wav --base "
        "examples/demo\n"
        "Exit status 1 unless the replica had the origin's state hash in every frame, and the origin took every "
        "event.");
    return {command, [options] { return mirror(*options); }};
}

}  // namespace rtsg::app
