// rtsg relay: passes a served session on to mirrors of its own, with requests and verdicts.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include <rtsg/sync/mirror_relay.h>

#include "cli.h"
#include "hints.h"
#include "nats.h"
#include "say.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

struct RelayArguments {
    std::string origin, endpoint = "tcp://127.0.0.1:*", key, name, serveKey, upstream = "none", duration,
                        patience = "5s";
    std::string maxLag = "250ms";
    std::size_t peers = 64, parts = 8;
    SayArguments say;
    bool insecure = false, json = false;
};

Result<std::optional<MirrorKeys>> keysFrom(const std::string& file) {
    if (file.empty()) return std::nullopt;
    auto keys = MirrorKeys::load(file);
    if (!keys) return std::unexpected(keys.error());
    return std::optional(std::move(*keys));
}

template <class Source>
void printNews(Source& source) {
    for (const Diagnostic& d : source.takeDiagnostics())
        if (d.severity != Severity::note) say(d);
}

/// The waits between two looks at what to report, if nothing comes: while the origin is heard, and else.
constexpr std::chrono::milliseconds kWhileHeard{2000}, kWhileLost{500};

class Relaying {
  public:
    Relaying(const RelayArguments& options, MirrorOrigin& from)
        : options_(options),
          from_(from),
          duration_(options.duration.empty() ? 1e9 : parseSeconds(options.duration)),
          patience_(parseSeconds(options.patience)) {}

    int run() {
        if (auto ok = connect(); !ok) return printError(ok.error()), kBad;
        while (!interrupted() && seconds(start_) < duration_ && !over_) poll();
        if (good_ && interrupted() && !over_ && !options_.duration.empty())
            fail(fmt::format("interrupted after {:.1f} of {} s", seconds(start_), duration_));
        else if (good_ && !relay_->server())
            fail(fmt::format("{}: no origin", options_.origin));
        else if (good_ && over_ && !options_.duration.empty())
            fail(fmt::format("{} left after {:.1f} of {} s", options_.origin, seconds(start_), duration_));
        if (relay_->server()) relay_->server()->drain(std::chrono::seconds(1));
        if (serves_) print();
        return good_ ? kDone : kBad;
    }

  private:
    static double seconds(Clock::time_point since) {
        return std::chrono::duration<double>(Clock::now() - since).count();
    }

    Result<> connect() {
        checkEndpoint("--bind", options_.endpoint);
        MirrorClientOptions from;
        MirrorServerOptions to;
        auto theirs = keysFrom(options_.key), ours = keysFrom(options_.serveKey);
        if (!theirs) return std::unexpected(theirs.error());
        if (!ours) return std::unexpected(ours.error());
        from.keys = std::move(*theirs);
        from.name = options_.name;
        from.maxLag = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * parseSeconds(options_.maxLag)));
        to.keys = std::move(*ours);
        to.keyFile = options_.serveKey;
        to.insecure = options_.insecure;
        to.upstream = *mirrorUpstreamFromName(options_.upstream);
        to.maximumPeers = options_.peers;
        to.maximumParts = options_.parts;
        (void)interrupted();  // from here on an interruption ends the program in order
        if (auto ok = from_.prepare(from); !ok) return ok;
        auto relay =
            MirrorRelay::connect(replica_, from_.endpoint(), options_.endpoint, std::move(from), std::move(to));
        if (!relay) return std::unexpected(relay.error());
        relay_ = std::move(*relay);
        return {};
    }

    void poll() {
        const bool before = relay_->server() != nullptr, heard = !relay_->client().originLost();
        if (const auto applied = relay_->poll(longest()); !applied) {
            serves_ = relay_->server() != nullptr;
            return fail(namingOptions(applied.error(), "--serve-key", options_.serveKey));
        }
        MirrorClient& client = relay_->client();
        printNews(client);
        printNews(from_);
        if (relay_->server()) printNews(*relay_->server());
        if (!before && relay_->server()) sayEndpoint();
        if (heard || !client.originLost()) heard_ = Clock::now();
        const bool left = client.serverLeft(), refused = !client.refusal().empty() && !client.turnedAway();
        if (refused) fail(fmt::format("{} refused: {}", options_.origin, client.refusal()));
        if (left) over_ = true;  // the origin has ended in order, so the relay does
        if (!over_ && seconds(heard_) > patience_)
            fail(client.turnedAway() ? fmt::format("{} refused: {}", options_.origin, client.refusal())
                                     : fmt::format("{}: no origin for {} s", options_.origin, patience_));
    }
    std::chrono::milliseconds longest() const {
        if (!relay_->server() || relay_->client().originLost()) return kWhileLost;
        const std::chrono::duration<double> left(duration_ - seconds(start_)), maximum = kWhileHeard;
        return std::chrono::ceil<std::chrono::milliseconds>(std::clamp(left, 0 * maximum, maximum));
    }
    void sayEndpoint() const {
        if (options_.json)
            fmt::print("{{\"endpoint\":{}}}\n", jsonString(relay_->server()->endpoint()));
        else
            fmt::print("relaying {} at {}\n", options_.origin, relay_->server()->endpoint());
        std::fflush(stdout);
    }
    template <class Why>
    void fail(const Why& why) {
        printError(why);
        good_ = false;
        over_ = true;
    }
    void print() const {
        const MirrorStatistics& from = relay_->client().statistics();
        const MirrorServerStatistics to = relay_->server() ? relay_->server()->statistics() : MirrorServerStatistics{};
        if (options_.json)
            fmt::print(
                "{{\"frames\":{},\"snapshots\":{},\"gaps\":{},\"restarts\":{},\"sequence\":{},\"hash\":\"{}\","
                "\"equal\":{},"
                "\"peers\":{},\"requests\":{},\"bytes\":{}}}\n",
                from.frames, from.snapshots, from.gaps, from.restarts, from.sequence, from.hash.hex(), from.equal,
                to.peers, to.requests, to.bytes);
        else
            fmt::print("{} to state {}, {} requests passed on, {} bytes to mirrors\n", framesText(from.frames),
                       from.sequence, to.requests, to.bytes);
    }

    const RelayArguments& options_;
    MirrorOrigin& from_;
    const double duration_, patience_;
    Scene replica_;
    std::unique_ptr<MirrorRelay> relay_;
    Clock::time_point start_ = Clock::now(), heard_ = Clock::now();
    bool over_ = false, good_ = true;
    bool serves_ = true;  // nothing prevents it from serving
};

int relay(RelayArguments options) {
    options.say.apply();
    auto from = openOrigin(options.origin, options.key, parseSeconds(options.patience));
    if (!from) return printError(from.error()), kBad;
    options.origin = from->shown();
    return Relaying(options, *from).run();
}

}  // namespace

Verb addRelay(Command& program) {
    auto options = std::make_shared<RelayArguments>();
    Command* command = program.addVerb("relay", "Pass a served scene on to mirrors of its own");
    command
        ->addOption("ENDPOINT", options->origin,
                    "endpoint of the origin, or of another relay, or nats://HOST:PORT/NAME")
        ->required();
    command->addOption("--bind", options->endpoint, "ZeroMQ endpoint to serve at; * picks a free port")->preset();
    command->addOption("--for", options->duration, "how long; else until the origin leaves or Ctrl-C");
    command->addOption("--wait", options->patience, "give up after so long without an origin")->preset();
    command->addOption("--key", options->key, "key file for the origin");
    command->addOption("--serve-key", options->serveKey, "key file for the mirrors here");
    command->addOption("--name", options->name, "prefix of the names of mirrors here, in the origin's log")->preset();
    command
        ->addOption("--upstream", options->upstream,
                    "what mirrors here may send, unless the key file says otherwise; the origin also checks")
        ->preset()
        ->oneOf({"none", "events", "edits", "code"});
    command->addOption("--max-lag", options->maxLag, "as for rtsg mirror; 0: every frame is sent, however late")
        ->preset();
    command->addOption("--peers", options->peers, "most mirrors")->preset();
    command->addOption("--parts", options->parts, "most different parts of the scene that mirrors may follow")
        ->preset();
    command->addFlag("--insecure", options->insecure, "serve other machines without keys");
    command->addFlag("--json", options->json, "first the endpoint, then the summary as JSON lines");
    options->say.addTo(*command);
    command->footer(
        "Example: rtsg relay tcp://127.0.0.1:4711 --bind tcp://127.0.0.1:4712 --for 20s\n"
        "Mirrors that follow a relay are told within a second when it has lost its origin.");
    return {command, [options] { return relay(*options); }};
}

}  // namespace rtsg::app
