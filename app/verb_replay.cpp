// rtsg replay: a log played back, verified, compared, shortened, exported, or run as a test.
#include <filesystem>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include <rtsg/sync/log_compact.h>
#include <rtsg/sync/replay.h>

#include "cli.h"
#include "export/mcap_export.h"
#include "outputs.h"
#include "replay_test.h"

namespace rtsg::app {

namespace {

struct Options {
    std::string log, seek, duration, diff, compact, exported, interval = "0s";
    std::uint64_t every = 1;
    bool exportPlain = false;
    OutputArguments outputs;
    ReplayTestArguments test;
    bool verify = false, json = false;
};

int diff(const Options& options) {
    const Progress progress = progressBar("comparing " + options.log);
    const auto result = diffLogs(options.log, options.diff, progress);
    if (progress) progress(1, 1);
    if (!result) return printError(result.error()), kBad;
    if (options.json)
        fmt::print("{{\"equal\":{},\"first_divergence\":{}}}\n", !*result, toJson(*result));
    else if (!*result)
        fmt::print("{} and {} are equal in every state\n", options.log, options.diff);
    if (*result) printError((*result)->format());
    return *result ? kBad : kDone;
}

int compact(const Options& options) {
    CompactOptions to;
    if (!options.seek.empty()) to.from = parseSeconds(options.seek);
    if (!options.duration.empty()) to.to = (options.seek.empty() ? 0 : to.from) + parseSeconds(options.duration);
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
        if (!first_ && replayer_.divergence()) first_ = replayer_.divergence();
        return *more;
    }
    /// At the log's end, for those who ask for all of it.
    void expectClosed() {
        if (replayer_.log().closed()) return;
        const std::uint64_t last = replayer_.scene().sequence();
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

int replay(const Options& options) {
    if (auto ok = options.outputs.check(
            {options.log, options.diff, options.test.rerun},
            {{"--export", options.exported, OutputKind::log}, {"--compact", options.compact, OutputKind::log}});
        !ok)
        return printError(ok.error()), kBad;
    const bool seeks = !options.seek.empty();
    const double from = seeks ? parseSeconds(options.seek) : 0;
    const double length = options.duration.empty() ? 1e9 : parseSeconds(options.duration);
    if (!options.diff.empty()) return diff(options);
    (void)interrupted();  // from here on an interruption ends in order: no half file stays
    if (!options.compact.empty()) return compact(options);
    if (options.test.any()) return runReplayTest(options.log, options.test, options.outputs, options.json);

    auto opened = Replayer::open(options.log);
    if (!opened) return printError(opened.error()), kBad;
    Replayer& replayer = **opened;
    const Resources resources = options.outputs.resources.ofFile(options.log);
    replayer.scene().setScriptResources(std::make_shared<const Resources>(resources));
    if (seeks)
        if (auto ok = replayer.seek(from); !ok) return printError(ok.error()), kBad;
    if (seeks && replayer.scene().now() < from && replayer.atEnd()) {
        printError(
            fmt::format("{}: --seek {}: the log ends at {} s", options.log, options.seek, replayer.scene().now()));
        return kBad;
    }
    Check check(replayer);
    bool more = seeks || check.step(), cut = false;

    std::string worldJson;
    if (replayer.frames() > 0) {
        OutputArguments wanted = options.outputs;
        if (!options.duration.empty()) wanted.seconds = length;
        auto outputs = Outputs::attach(replayer.scene(), wanted, resources);
        if (!outputs) return printError(outputs.error()), kBad;
        std::unique_ptr<McapExport> exported;
        if (!options.exported.empty()) {
            McapOptions mcap;
            mcap.compress = !options.exportPlain;
            mcap.existing = existing(options.outputs.force);
            auto attached = McapExport::attach((*outputs)->world(), options.exported, mcap);
            if (!attached) return printError(attached.error()), kBad;
            exported = std::move(*attached);
        }
        // A state that was asked for by its time is what is shown or saved; anything that has a length plays on.
        const bool plays = !seeks || !options.duration.empty() || options.verify || exported ||
                           !options.outputs.listen.empty() || options.outputs.animated();
        const double until = replayer.scene().now() + length;
        const Progress progress = progressBar("replaying " + options.log);
        while (plays && more && replayer.scene().now() < until && !interrupted() && (*outputs)->failure().empty()) {
            more = check.step();
            if (progress) progress(replayer.log().position(), replayer.log().size());
        }
        if (progress) progress(1, 1);
        if (plays && more && interrupted()) {
            cut = true;
            printError(
                fmt::format("interrupted: what is written holds {} to t = {} s", options.log, replayer.scene().now()));
        }
        if (exported)
            if (auto ok = exported->finish(); !ok) {
                printError(ok.error());
                cut = true;
            }
        print(replayer.scene().diagnostics(), (*outputs)->failure());
        if (auto ok = (*outputs)->finish(); !ok) return printError(ok.error()), kBad;
        if (const std::string missing = (*outputs)->missing(); !missing.empty()) {
            printError("missing: " + missing);
            cut = true;
        }
        worldJson = (*outputs)->worldJson() + fmt::format(R"(,"pictures":{},"sound_seconds":{:.3f})",
                                                          (*outputs)->pictures(), (*outputs)->soundSeconds());
    } else {
        printError(options.log + ": no intact state");
    }

    if (options.verify && !more && !cut) check.expectClosed();
    const bool good = !cut && replayer.frames() > 0 && !check.first() && replayer.verified() == replayer.frames();
    if (!options.json)
        fmt::print("{} frames to t = {} s, {} as recorded; {} gaps, {} places damaged; state {}\n", replayer.frames(),
                   replayer.scene().now(), replayer.verified(), replayer.gaps(), replayer.log().damage().size(),
                   replayer.scene().hash().hex());
    else
        fmt::print(
            "{{\"frames\":{},\"verified\":{},\"first_divergence\":{},\"t\":{},\"hash\":\"{}\",\"gaps\":{},\"damaged\":{"
            "},"
            "\"bytes\":{},\"closed\":{}{}}}\n",
            replayer.frames(), replayer.verified(), toJson(check.first()), replayer.scene().now(),
            replayer.scene().hash().hex(), replayer.gaps(), replayer.log().damage().size(), replayer.log().size(),
            replayer.log().closed(), worldJson);
    if (check.first()) printError(check.first()->format());
    return good ? kDone : kBad;
}

}  // namespace

Verb addReplay(Command& program) {
    auto options = std::make_shared<Options>();
    Command* command = program.addVerb("replay", "Play a log back; verify it; picture, hear and save it");
    command->addOption("LOG", options->log, "log to read (.rlog)")->required();
    command->addFlag("--verify", options->verify,
                     "all of it, to the index that a log ends with; states are checked in any case");
    command->addOption("--seek", options->seek, "begin with the state of this scene time");
    command->addOption("--for", options->duration, "how much to play");
    command->addOption("--diff", options->diff, "compare with another log, state by state");
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
        "Example: rtsg replay hall.rlog --compact short.rlog --seek 60s --for 10s --every 6\n"
        "Example: rtsg replay door.rlog --rerun door.x3dv --expect-picture door.png --size 160x120\n"
        "Exit status 1, naming frame, node and field, where a state is not the one recorded.");
    return {command, [options] { return replay(*options); }};
}

}  // namespace rtsg::app
