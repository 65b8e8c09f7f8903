// rtsg replay: a log played back, verified, compared, shortened, exported, or run as a test.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include <rtsg/sync/log_compact.h>
#include <rtsg/sync/log_summary.h>
#include <rtsg/sync/replay.h>

#include "blame.h"
#include "cli.h"
#include "export/mcap_export.h"
#include "live_outputs.h"
#include "replay_test.h"

namespace rtsg::app {

namespace {

struct ReplayArguments {
    std::string log, seek, duration, diff, compact, exported, blamed, interval = "0s";
    std::uint64_t every = 1;
    bool exportPlain = false;
    OutputArguments outputs;
    ReplayTestArguments test;
    bool verify = false, json = false;
};

int diff(const ReplayArguments& options) {
    const Progress progress = progressBar("comparing " + options.log);
    ComparedStates states;
    const auto result = diffLogs(options.log, options.diff, progress, &states);
    if (progress) progress(1, 1);
    if (!result) return printError(result.error()), kBad;
    const std::optional<Divergence> first = fromStart(*result, logStart(options.log));
    if (options.json)
        fmt::print("{{\"equal\":{},\"first_divergence\":{}}}\n", !first, toJson(first));
    else if (!first)
        fmt::print("{} and {} are equal {}\n", options.log, options.diff, states.format());
    if (first) printError(first->format());
    return first ? kBad : kDone;
}

/// `seek`: as it was typed; empty: nothing was.
Result<> reaches(const std::string& log, double time, const std::string& seek) {
    if (seek.empty()) return {};
    const auto summary = summariseLog(log);
    if (!summary) return std::unexpected(summary.error());
    if (summary->end >= time) return {};
    return fail(
        fmt::format("--seek {}: the log ends at {} s", seek, std::round((summary->end - logStart(log)) * 1e6) / 1e6),
        {}, log);
}

int compact(const ReplayArguments& options) {
    CompactOptions to;
    const double start = logStart(options.log), from = options.seek.empty() ? 0 : parseSeconds(options.seek);
    if (!options.seek.empty()) to.from = start + from;
    if (!options.duration.empty()) to.to = start + (from + parseSeconds(options.duration));
    if (auto ok = reaches(options.log, start + from, options.seek); !ok) return printError(ok.error()), kBad;
    to.every = options.every;
    to.interval = parseSeconds(options.interval);
    to.log.existing = existing(options.outputs.force);
    const Progress progress = progressBar("compacting " + options.log);
    to.progress = [&](std::uint64_t done, std::uint64_t total) {
        if (progress) progress(done, total);
        return !interrupted();
    };
    const auto report = compactLog(options.log, options.compact, to);
    if (interrupted() && !report) return printError("interrupted: " + options.compact + " was not written"), kBad;
    if (!report) return printError(report.error()), kBad;
    if (!options.json)
        fmt::print("{} of {} states, {} of {} bytes{}\n", report->statesWritten, report->statesRead,
                   report->bytesWritten, report->bytesRead,
                   report->damaged ? fmt::format("; {} places were damaged", report->damaged) : "");
    else
        fmt::print("{{\"states\":{},\"states_before\":{},\"bytes\":{},\"bytes_before\":{},\"damaged\":{}}}\n",
                   report->statesWritten, report->statesRead, report->bytesWritten, report->bytesRead, report->damaged);
    return kDone;
}

/// Steps to the log's end or `until`, and notes where it first was not what the origin had.
class Check {
  public:
    explicit Check(Replayer& replayer) : replayer_(replayer) {}

    /// False at the end.
    bool step() {
        const std::uint64_t before = replayer_.scene().sequence();
        const auto more = replayer_.step();
        if (!more) {
            note(before + 1, more.error().text);
            return true;  // it goes on with the next keyframe
        }
        const LogReader& log = replayer_.log();
        if (log.damage().size() > damage_) {
            damage_ = log.damage().size();
            const LogDamage& d = log.damage().back();
            note(before + 1,
                 fmt::format("bytes {} to {} of the log are damaged: {}", d.offset, d.offset + d.length, d.text));
        }
        if (replayer_.gaps() > gaps_) {
            gaps_ = replayer_.gaps();
            note(before + 1, fmt::format("frames {} to {} are missing", before + 1, replayer_.scene().sequence()));
        }
        if (replayer_.framesBehind() > 0)
            note(before + 1, fmt::format("{} frames of earlier states stand after state {}, and were not played: the "
                                         "pieces of the log are in another order than they were written in",
                                         replayer_.framesBehind(), before));
        if (!first_ && replayer_.divergence()) first_ = replayer_.divergence();
        return *more;
    }
    /// At the log's end, for those who ask for all of it.
    void expectClosed() {
        if (replayer_.log().closed()) return;
        const std::uint64_t last = replayer_.scene().sequence();
        if (replayer_.log().beingWritten())
            note(last + 1, fmt::format("the log is still being written: states after {} are yet to come", last));
        else
            note(last + 1, fmt::format("the log was not closed: nothing tells what came after state {}", last));
    }
    const std::optional<Divergence>& first() const { return first_; }

  private:
    void note(std::uint64_t frame, std::string text) {
        if (!first_) first_ = Divergence{frame, replayer_.scene().now(), {}, {}, std::move(text)};
    }

    Replayer& replayer_;
    std::size_t damage_ = 0;
    std::uint64_t gaps_ = 0;
    std::optional<Divergence> first_;
};

/// A log played from its start, or from --seek on, with what is made of it.
class Replaying {
  public:
    Replaying(const ReplayArguments& options, Replayer& replayer)
        : options_(options),
          replayer_(replayer),
          check_(replayer),
          start_(replayer.keyframes().empty() ? 0 : replayer.keyframes().front().time),
          length_(options.duration.empty() ? 1e9 : parseSeconds(options.duration)),
          resources_(options.outputs.resources.ofFile(options.log)) {}

    int run() {
        replayer_.scene().setScriptResources(std::make_shared<const Resources>(resources_));
        if (auto ok = begin(); !ok) return printError(ok.error()), kBad;
        if (replayer_.frames() == 0)
            printError(options_.log + ": no intact state");
        else if (auto ok = play(); !ok)
            return printError(ok.error()), kBad;
        if (options_.verify && !more_ && !cut_) check_.expectClosed();
        print();
        return !cut_ && replayer_.frames() > 0 && !check_.first() && replayer_.verified() == replayer_.frames() ? kDone
                                                                                                                : kBad;
    }

  private:
    bool seeks() const { return !options_.seek.empty(); }
    /// Since the log's start, to a microsecond: times since 1970 are exact to a quarter of that.
    double time() const { return std::round((replayer_.scene().now() - start_) * 1e6) / 1e6; }
    std::optional<Divergence> first() const { return fromStart(check_.first(), start_); }

    Result<> begin() {
        if (!seeks()) {
            more_ = check_.step();
            return {};
        }
        const double from = parseSeconds(options_.seek);
        if (auto ok = replayer_.seek(start_ + from); !ok) return ok;
        more_ = true;
        if (time() < from && replayer_.atEnd())
            return fail(fmt::format("--seek {}: the log ends at {} s", options_.seek, time()), {}, options_.log);
        return {};
    }

    Result<> play() {
        OutputArguments wanted = options_.outputs;
        if (!options_.duration.empty()) wanted.seconds = length_;
        WorldOnDemand world(replayer_.scene(), resources_);
        auto attached = makeOutputs(world, wanted, resources_);
        if (!attached) return std::unexpected(attached.error());
        OutputMaker& outputs = **attached;
        auto exported = startExport(world);
        if (!exported) return std::unexpected(exported.error());
        // A state that was asked for by its time is what is shown or saved; anything that has a length plays on.
        if (!seeks() || !options_.duration.empty() || options_.verify || *exported ||
            !options_.outputs.listen.empty() || options_.outputs.animated())
            step(outputs);
        if (*exported)
            if (auto ok = (*exported)->finish(); !ok) {
                printError(ok.error());
                cut_ = true;
            }
        app::print(replayer_.scene().diagnostics());
        if (auto ok = outputs.finish(); !ok) return ok;
        const OutputReport report = outputs.report();
        if (!report.missing.empty()) {
            printError("missing: " + report.missing);
            cut_ = true;
        }
        made_ = report.json();
        return {};
    }

    /// Null if there is none to be made.
    Result<std::unique_ptr<McapExport>> startExport(WorldOnDemand& world) {
        if (options_.exported.empty()) return nullptr;
        McapOptions mcap;
        mcap.compress = !options_.exportPlain;
        mcap.existing = existing(options_.outputs.force);
        return McapExport::attach(world.get(), options_.exported, mcap);
    }

    void step(OutputMaker& outputs) {
        const double until = time() + length_;
        const Progress progress = progressBar("replaying " + options_.log);
        const auto begun = std::chrono::steady_clock::now() - std::chrono::duration<double>(time());
        const bool looks = !options_.outputs.render.empty() || !options_.outputs.listen.empty();
        while (more_ && !interrupted() && !outputs.failed()) {
            // All sets of one instant make one frame: an Inline that it loaded is a set of its own. To look ahead costs
            // about as much as the states themselves.
            const std::optional<double> next = looks ? replayer_.nextTime() : std::nullopt;
            if (!next || *next != replayer_.scene().now()) {
                if (!outputs.frame() || time() >= until) break;
                if (next && options_.outputs.isLive())
                    wait(outputs, begun + std::chrono::duration<double>(*next - start_));
            }
            more_ = check_.step();
            if (progress) progress(replayer_.log().position(), replayer_.log().size());
        }
        if (progress) progress(1, 1);
        if (!more_ || !interrupted()) return;
        cut_ = true;
        printError(fmt::format("interrupted: what is written holds {} to t = {} s", options_.log, time()));
    }

    /// Until then nothing comes; who asks for the newest state gets it.
    template <class Moment>
    static void wait(OutputMaker& outputs, Moment until) {
        while (!interrupted() && outputs.frame() && std::chrono::steady_clock::now() < until)
            std::this_thread::sleep_for(std::min<std::chrono::duration<double>>(
                std::chrono::milliseconds(20), until - std::chrono::steady_clock::now()));
    }

    /// Whose hashes the states were compared with, where it is not this program's kind.
    std::string format() const {
        const unsigned version = replayer_.head().formatVersion;
        return version == kFormatVersion ? std::string()
                                         : fmt::format("; recorded in format {}, whose hashes were compared", version);
    }
    /// Seconds from the session's start to the log's, if it is a later piece of a rotated one.
    double before() const {
        const std::optional<double> began = replayer_.head().start;
        return began ? std::max(0.0, std::round((start_ - *began) * 1e6) / 1e6) : 0;
    }
    std::string piece() const {
        return before() > 0 ? fmt::format("; a piece that begins {} s into its session", before()) : std::string();
    }
    std::string leftOut() const {
        const std::uint64_t changes = replayer_.losses().changes;
        return changes ? fmt::format("; {} changes of fields that this program does not have left out", changes)
                       : std::string();
    }

    void print() const {
        const LogReader& log = replayer_.log();
        const std::string hash = replayer_.scene().hash().hex();
        if (!options_.json)
            fmt::print("{} states to t = {} s, {} as recorded; {} gaps, {} places damaged; state {}{}{}{}\n",
                       replayer_.frames(), time(), replayer_.verified(), replayer_.gaps(), log.damage().size(), hash,
                       piece(), format(), leftOut());
        else
            fmt::print(
                "{{\"frames\":{},\"verified\":{},\"first_divergence\":{},\"t\":{},\"before_s\":{},\"hash\":\"{}\","
                "\"gaps\":{},\"damaged\":{},\"bytes\":{},\"closed\":{},\"being_written\":{},\"format\":{},\"left_out\":"
                "{}{}}}\n",
                replayer_.frames(), replayer_.verified(), toJson(first()), time(), before(), hash, replayer_.gaps(),
                log.damage().size(), log.size(), log.closed(), log.beingWritten(), replayer_.head().formatVersion,
                replayer_.losses().changes, made_);
        if (first()) printError(first()->format());
    }

    const ReplayArguments& options_;
    Replayer& replayer_;
    Check check_;
    const double start_, length_;
    const Resources resources_;
    bool more_ = false, cut_ = false;
    std::string made_;
};

int replay(const ReplayArguments& options) {
    if (auto ok = options.outputs.check(
            {options.log, options.diff, options.test.rerun},
            {{"--export", options.exported, OutputKind::log}, {"--compact", options.compact, OutputKind::log}});
        !ok)
        return printError(ok.error()), kBad;
    if (!options.diff.empty()) return diff(options);
    (void)interrupted();  // from here on an interruption ends in order: no half file stays
    if (!options.compact.empty()) return compact(options);
    if (!options.blamed.empty()) return blame(options.log, options.blamed, options.json);
    if (options.test.any()) return runReplayTest(options.log, options.test, options.outputs, options.json);
    if (!options.seek.empty()) parseSeconds(options.seek);  // before anything is opened
    auto opened = Replayer::open(options.log);
    if (!opened) return printError(opened.error()), kBad;
    tellOfEarlierPieces(options.log);
    return Replaying(options, **opened).run();
}

}  // namespace

Verb addReplay(Command& program) {
    auto options = std::make_shared<ReplayArguments>();
    Command* command = program.addVerb("replay", "Play a log back; verify it; picture, hear and save it");
    command->addOption("LOG", options->log, "log to read (.rlog)")->required();
    command->addFlag("--verify", options->verify,
                     "all of it, to the index that a log ends with; states are checked in any case");
    command->addOption("--seek", options->seek, "begin with the state so long after the log's start");
    command->addOption("--for", options->duration, "how much to play");
    command->addOption("--diff", options->diff, "compare with another log, state by state");
    command->addOption("--blame", options->blamed,
                       "who changed NODE.field, when, and by which routes, as far as the log tells");
    command->addOption("--export", options->exported, "MCAP file of it, for Foxglove: /tf, /scene, /rtsg/changes");
    command->addFlag("--export-plain", options->exportPlain, "the MCAP's chunks uncompressed");
    command->addOption("--compact", options->compact,
                       "write it again, shorter: from --seek on, --for so long, with --every or --interval merged");
    command->addOption("--every", options->every, "with --compact: so many frames become one")
        ->preset()
        ->range(std::uint64_t{1}, UINT64_MAX);
    command->addOption("--interval", options->interval, "with --compact: frames closer than this become one")->preset();
    options->outputs.addTo(*command, OutputArguments::Options::ofReplay);
    options->test.addTo(*command);
    command->addFlag("--json", options->json, "the report as JSON");
    command->footer(
        "Example: rtsg replay hall.rlog --verify\n"
        "Example: rtsg replay hall.rlog --seek 2.5s --render then.png --base examples/demo\n"
        "Example: rtsg replay hall.rlog --export hall.mcap\n"
        "Example: rtsg replay hall.rlog --blame LAMP_SWING.rotation\n"
        "Example: rtsg replay hall.rlog --compact short.rlog --seek 60s --for 10s --every 6\n"
        "Example: rtsg replay door.rlog --rerun door.x3dv --expect-picture door.png --size 160x120\n"
        "Exit status 1, naming frame, node and field, where a state is not the one recorded.");
    return {command, [options] { return replay(*options); }};
}

}  // namespace rtsg::app
