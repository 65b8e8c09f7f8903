// rtsg replay: plays a log back, verifies, compares, shortens or exports it, or runs it as a test.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/session/mcap_export.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/sync/log_check.h>
#include <rtsg/sync/log_compact.h>
#include <rtsg/sync/log_summary.h>

#include "blame.h"
#include "cli.h"
#include "extensions.h"
#include "log_store.h"
#include "replay_test.h"
#include "start_time.h"
#include "table.h"

namespace rtsg::app {

namespace {

struct ReplayArguments {
    std::string log, shownLog, shownDiff, seek, duration, diff, compact, exported, blamed, tabled, only, without, out,
        frames, interval = "0s", runUp = "6s";
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
    warnOfDamage(options.log, options.diff, states.damage);
    const std::optional<Divergence> first = fromStart(*result, logStart(options.log));
    if (options.json)
        fmt::print("{{\"equal\":{},\"first_divergence\":{},{}}}\n", !first, toJson(first), toJson(states));
    else if (!first)
        fmt::print("{} and {} are equal {}\n", options.shownLog, options.shownDiff, states.format());
    if (first) printError(first->format());
    return first ? kBad : kDone;
}

/// `seek` is the option as typed; empty if it was not given.
Result<> reaches(const std::string& log, double time, const std::string& seek) {
    if (seek.empty()) return {};
    const auto summary = summariseLog(log);
    if (!summary) return std::unexpected(summary.error());
    if (summary->end >= time) return {};
    return fail(
        fmt::format("--seek {}: the log ends at {} s", seek, std::round((summary->end - logStart(log)) * 1e6) / 1e6),
        {}, log);
}

/// Says "2 of 5 s of the log, which ends at t = 3 s". Empty if the log is long enough.
std::string missingOfLog(double there, double wanted, double end) {
    constexpr double kRounding = 1e-6;  // doubles of times since 1970 are exact to a quarter of that
    if (there >= wanted - kRounding) return {};
    return fmt::format("{:.6g} of {:.6g} s of the log, which ends at t = {:.6g} s", wanted - there, wanted, end);
}

/// Seconds from the log's start; 0 without --seek.
double seekOf(const ReplayArguments& options, double start) {
    return options.seek.empty() ? 0 : parseMoment(options.seek, start);
}

/// Says so if what --compact keeps is shorter than --for.
Result<std::string> missingOfCompacted(const ReplayArguments& options) {
    if (options.duration.empty()) return std::string();
    const auto summary = summariseLog(options.log);
    if (!summary) return std::unexpected(summary.error());
    const double end = summary->end - logStart(options.log);
    return missingOfLog(end - seekOf(options, logStart(options.log)), parseSeconds(options.duration), end);
}

int compact(const ReplayArguments& options) {
    CompactOptions to;
    const double start = logStart(options.log), from = seekOf(options, start);
    if (!options.seek.empty()) to.from = start + from;
    if (!options.duration.empty()) to.to = start + (from + parseSeconds(options.duration));
    if (auto ok = reaches(options.log, start + from, options.seek); !ok) return printError(ok.error()), kBad;
    to.every = options.every;
    to.interval = parseSeconds(options.interval);
    to.only = splitFields(options.only);
    to.without = splitFields(options.without);
    to.log.existing = existing(options.outputs.force);
    const Progress progress = progressBar("compacting " + options.log);
    to.progress = [&](std::uint64_t done, std::uint64_t total) {
        if (progress) progress(done, total);
        return !interrupted();
    };
    const auto missing = missingOfCompacted(options);
    if (!missing) return printError(missing.error()), kBad;
    const auto report = compactLog(options.log, options.compact, to);
    if (interrupted() && !report) return printError("interrupted: " + options.compact + " was not written"), kBad;
    if (!report) return printError(report.error()), kBad;
    if (!options.json)
        fmt::print("{} of {} states, {} of {} bytes{}\n", report->statesWritten, report->statesRead,
                   report->bytesWritten, report->bytesRead,
                   report->damaged ? fmt::format("; {} places were damaged", report->damaged) : "");
    else
        fmt::print(
            "{{\"states\":{},\"states_before\":{},\"bytes\":{},\"bytes_before\":{},\"damaged\":{},\"gaps\":{},"
            "\"complete\":{},\"missing\":{}}}\n",
            report->statesWritten, report->statesRead, report->bytesWritten, report->bytesRead, report->damaged,
            report->gaps, report->lacks.empty() && missing->empty(), missing->empty() ? "null" : jsonString(*missing));
    if (!report->lacks.empty())
        printError(fmt::format("{} is not complete: {}: {}", options.compact, options.log, report->lacks));
    if (!missing->empty()) printError(fmt::format("missing: {}: {} is shorter", *missing, options.compact));
    return report->lacks.empty() && missing->empty() ? kDone : kBad;
}

/// Plays a log from its start or from --seek on, and makes the outputs.
class Replaying {
  public:
    Replaying(const ReplayArguments& options, Replayer& replayer)
        : options_(options),
          replayer_(replayer),
          check_(replayer),
          start_(replayer.keyframes().empty() ? 0 : replayer.keyframes().front().time),
          length_(options.duration.empty() ? 1e9 : parseSeconds(options.duration)),
          wanted_(outputsOf(options, replayer.head().epoch, start_)),
          resources_(options.outputs.resources.ofFile(firstFileOf(options.log))) {}

    int run() {
        reportFailuresAtTheEnd(replayer_.scene());
        registerDocuments(replayer_.scene());
        runScripts(replayer_.scene());
        extensions().registerWith(replayer_.scene());
        replayer_.scene().setScriptResources(std::make_shared<const Resources>(resources_));
        fetches_.emplace(replayer_.scene(), resources_);
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
    /// Seconds since the log's start, rounded to a microsecond; doubles of times since 1970 are exact to a quarter of
    /// that.
    double time() const { return microseconds(time_); }
    static double microseconds(double seconds) { return std::round(seconds * 1e6) / 1e6; }
    /// Call it after a step or a seek. Another session in the log may begin with an earlier time.
    void noteTime() { time_ = replayer_.frames() == 0 ? 0 : replayer_.time() - start_; }
    std::optional<Divergence> first() const { return fromStart(check_.first(), start_); }

    /// The outputs that are asked for, with the pictures' numbers.
    static OutputArguments outputsOf(const ReplayArguments& options, std::uint64_t epoch, double start) {
        OutputArguments wanted = options.outputs;
        wanted.session = fmt::format("{:016x}", epoch);
        if (!options.duration.empty()) wanted.seconds = parseSeconds(options.duration);
        if (options.frames.empty()) return wanted;
        wanted.only = parsePictureRange(options.frames);
        wanted.start = start;
        wanted.runUp = parseSeconds(options.runUp);
        if (!wanted.listen.empty()) {
            const std::filesystem::path pattern = wanted.listen;
            const auto number = static_cast<int>(wanted.only->first);
            wanted.listen = pattern.parent_path() / *numberedName(pattern.filename().string(), number);
        }
        wanted.seconds = static_cast<double>(wanted.only->last + 1) / wanted.picturesPerSecond;
        return wanted;
    }
    double timeOfPicture(std::uint64_t number) const { return static_cast<double>(number) / wanted_.picturesPerSecond; }

    /// Goes to the state before the first picture, which a whole run makes of the first state at its time or later.
    Result<> seekPicture() {
        const std::uint64_t first = wanted_.only->first - (leadsIn(wanted_.options()) ? 1 : 0);
        if (auto ok = replayer_.seek(start_ + timeOfPicture(first) - 3 * kRounding); !ok) return ok;
        noteTime();
        more_ = true;
        if (replayer_.atEnd())
            return fail(fmt::format("--frames {}: the log ends at {} s", options_.frames, time()), {}, options_.log);
        return {};
    }

    Result<> beginAtStart() {
        more_ = true;
        while (more_ && replayer_.frames() == 0) more_ = check_.step().value_or(true);
        noteTime();
        return {};
    }

    Result<> begin() {
        // How direct sound goes on depends on how it began.
        if (wanted_.only && wanted_.only->first > 0 && wanted_.listen.empty()) return seekPicture();
        if (!seeks()) return beginAtStart();
        const double from = seekOf(options_, start_);
        if (auto ok = replayer_.seek(start_ + from); !ok) return ok;
        noteTime();
        more_ = true;
        if (time() < from && replayer_.atEnd())
            return fail(fmt::format("--seek {}: the log ends at {} s", options_.seek, time()), {}, options_.log);
        return {};
    }

    Result<> play() {
        begun_ = time();
        WorldOnDemand world(replayer_.scene(), resources_, programContext());
        auto attached = refusingUsage(makeOutputs(world, wanted_.options(), resources_));
        if (!attached) return std::unexpected(attached.error());
        OutputMaker& outputs = **attached;
        auto exported = startExport(world);
        if (!exported) return std::unexpected(exported.error());
        // With --seek alone the state at that time is shown or saved. Anything that has a length plays on.
        if (!seeks() || !options_.duration.empty() || options_.verify || *exported ||
            !options_.outputs.listen.empty() || options_.outputs.animated())
            step(outputs);
        else
            lookForGap();
        if (*exported)
            if (auto ok = (*exported)->finish(); !ok) {
                printError(ok.error());
                cut_ = true;
            }
        app::print(replayer_.scene().diagnostics());
        if (auto ok = outputs.finish(); !ok) {
            printError(ok.error());
            cut_ = true;
        }
        printReport(outputs.report(), wanted_);
        return {};
    }

    /// The state before a gap is that of a time within it only if nothing happened, which nobody knows.
    void lookForGap() {
        const auto missing = replayer_.missingNext();
        if (!missing || time() >= seekOf(options_, start_)) return;
        printError(fmt::format("{}: --seek {}: frames {} to {} are missing; what is there is frame {} (t = {} s)",
                               options_.log, options_.seek, missing->first, missing->second, missing->first - 1,
                               time()));
        cut_ = true;
    }

    /// Says what is missing, and which files lack it.
    void printReport(OutputReport report, const OutputArguments& wanted) {
        const std::string ofLog =
            options_.duration.empty() || cut_ ? std::string() : missingOfLog(time() - begun_, length_, time());
        if (!ofLog.empty()) {
            std::string files = wanted.written();
            if (!options_.exported.empty()) files += (files.empty() ? "" : ", ") + options_.exported;
            printError(fmt::format("missing: {}{}", ofLog, files.empty() ? "" : ": not whole: " + files));
            cut_ = true;
        }
        if (!report.missing.empty()) {
            printError("missing: " + report.missing);
            cut_ = true;
        }
        if (!ofLog.empty()) report.missing = ofLog + (report.missing.empty() ? "" : ", " + report.missing);
        outputs_ = report.json();
    }

    /// Null if no export was asked for.
    Result<std::unique_ptr<McapExport>> startExport(WorldOnDemand& world) {
        if (options_.exported.empty()) return nullptr;
        McapOptions mcap;
        mcap.compress = !options_.exportPlain;
        mcap.existing = existing(options_.outputs.force);
        return McapExport::attach(world.get(), options_.exported, mcap);
    }

    void step(OutputMaker& outputs) {
        const double until = !wanted_.only            ? time() + length_
                             : wanted_.listen.empty() ? timeOfPicture(wanted_.only->last)
                                                      : wanted_.seconds;
        const Progress progress = progressBar("replaying " + options_.log);
        const auto begun = std::chrono::steady_clock::now() - std::chrono::duration<double>(time());
        const bool looks = !options_.outputs.render.empty() || !options_.outputs.listen.empty();
        while (more_ && !interrupted() && !outputs.failed()) {
            // All sets of one time make one frame: an Inline that it loaded is a set of its own. Looking ahead costs
            // about as much as the states themselves.
            const std::optional<double> next = looks ? replayer_.nextTime() : std::nullopt;
            if (!next || *next != replayer_.scene().now()) {
                if (!outputs.frame() || time() >= until) break;
                if (next && options_.outputs.isLive())
                    wait(outputs,
                         begun + std::chrono::duration<double>(time_ + std::max(0.0, *next - replayer_.scene().now())));
            }
            more_ = check_.step().value_or(true);  // after an error it goes on at the next keyframe
            noteTime();
            if (progress) progress(replayer_.log().position(), replayer_.log().size());
        }
        if (progress) progress(1, 1);
        if (!more_ || !interrupted()) return;
        cut_ = true;
        printError(options_.exported.empty()
                       ? fmt::format("interrupted: {} was played to t = {} s", options_.log, time())
                       : fmt::format("interrupted: what is written holds {} to t = {} s", options_.log, time()));
    }

    /// Waits until that time. Nothing comes meanwhile, so whoever asks gets the newest state.
    template <class Moment>
    static void wait(OutputMaker& outputs, Moment until) {
        using Clock = std::chrono::steady_clock;
        constexpr std::chrono::milliseconds kOften{20};
        const auto end = std::chrono::ceil<Clock::duration>(until);
        while (!interrupted() && outputs.frame() && Clock::now() < end)
            sleepUntil(outputs.rests() ? end : std::min(end, Clock::now() + kOften));
    }

    /// Names the log's format if it is not this program's own, because hashes are then compared in that format.
    std::string format() const {
        const unsigned version = replayer_.head().formatVersion;
        return version == kFormatVersion ? std::string()
                                         : fmt::format("; recorded in format {}, whose hashes were compared", version);
    }
    std::string piece() const {
        const auto piece = replayer_.laterPiece();
        return piece ? fmt::format("; a piece that begins {} s into its session: {}", microseconds(piece->begins),
                                   piece->format())
                     : std::string();
    }
    /// Says that another session follows, and that it is unknown what came between.
    std::string unclosed() const {
        const std::uint64_t ends = replayer_.unclosedSessions();
        return ends ? fmt::format("; {} session{} within it not closed", ends, ends == 1 ? "" : "s") : std::string();
    }
    /// Says that the log was read to its end, and that it is unknown what came after that.
    std::string openEnd() const {
        const LogReader& log = replayer_.log();
        if (more_ || cut_ || log.closed() || log.beingWritten()) return "";
        return log.goesOn() ? "; the session goes on in a next piece"
                            : "; the log was not closed: its end may be missing";
    }
    std::string leftOut() const {
        const std::uint64_t changes = replayer_.losses().changes;
        return changes ? fmt::format("; {} changes of fields that this program does not have left out", changes)
                       : std::string();
    }

    void print() const {
        const LogReader& log = replayer_.log();
        const LaterPiece piece = replayer_.laterPiece().value_or(LaterPiece{});
        const std::string hash = replayer_.scene().hash().hex();
        if (!options_.json)
            fmt::print("{} states to t = {} s, {} as recorded; {} gaps, {} places damaged; state {}{}{}{}{}{}\n",
                       replayer_.frames(), time(), replayer_.verified(), replayer_.gaps(), log.damage().size(), hash,
                       unclosed(), openEnd(), this->piece(), format(), leftOut());
        else
            fmt::print(
                "{{\"frames\":{},\"verified\":{},\"first_divergence\":{},\"t\":{},\"before_s\":{},\"let_go_s\":{},"
                "\"hash\":\"{}\","
                "\"gaps\":{},\"damaged\":{},\"unclosed_sessions\":{},\"bytes\":{},\"closed\":{},\"goes_on\":{},"
                "\"being_written\":{},"
                "\"format\":{},\"left_out\":{}{}}}\n",
                replayer_.frames(), replayer_.verified(), toJson(first()), time(), microseconds(piece.begins),
                microseconds(piece.letGo), hash, replayer_.gaps(), log.damage().size(), replayer_.unclosedSessions(),
                log.size(), log.closed(), log.goesOn(), log.beingWritten(), replayer_.head().formatVersion,
                replayer_.losses().changes, outputs_);
        if (first()) printError(first()->format());
    }

    const ReplayArguments& options_;
    Replayer& replayer_;
    LogCheck check_;
    const double start_;
    double time_ = 0, begun_ = 0;  // the present time, and when playing began
    const double length_;
    const OutputArguments wanted_;
    const Resources resources_;
    std::optional<FollowedFetches> fetches_;
    bool more_ = false, cut_ = false;
    std::string outputs_;
};

using OptionNames = std::vector<std::string_view>;

bool holds(const OptionNames& names, std::string_view option) {
    return std::ranges::find(names, option) != names.end();
}

/// Something that `replay` does with a log, and the options that make sense with it.
struct ReplayMode {
    OptionNames asks;  // any of these requests it
    OptionNames takes;
    bool makesOutputs = false;  // takes --render, --listen, --save and their options
};

/// The first mode that is requested counts. The last one needs no request.
const std::vector<ReplayMode>& replayModes() {
    static const std::vector<ReplayMode> modes = {
        {{"--diff"}, {}},
        {{"--compact", "--only", "--without"}, {"-o", "--output", "--seek", "--for", "--every", "--interval"}},
        {{"--blame"}, {}},
        {{"--table"}, {"-o", "--output", "--seek", "--for", "--every"}},
        {{"--rerun", "--update", "--expect-picture", "--expect-sound", "--field", "--ignore", "--tolerance", "--junit",
          "--page"},
         {"--verify", "--picture-tolerance", "--sound-tolerance", "--name"},
         true},
        {{},
         {"--verify", "--seek", "--for", "--export", "--export-plain", "--live", "--device", "--denoise", "--frames",
          "--tile", "--run-up"},
         true}};
    return modes;
}

/// The typed option that requests the mode. Empty if none does.
std::string_view askingFor(const ReplayMode& mode, const OptionNames& given) {
    const auto found = std::ranges::find_if(given, [&](std::string_view option) { return holds(mode.asks, option); });
    return found == given.end() ? std::string_view() : *found;
}

const ReplayMode& modeOf(const OptionNames& given) {
    for (const ReplayMode& mode : replayModes())
        if (!askingFor(mode, given).empty()) return mode;
    return replayModes().back();
}

/// Throws UsageError for an option that needs another one.
void checkNeeded(const OptionNames& given) {
    static const OptionNames another = {"--compact", "--only", "--without"};
    static const std::pair<std::string_view, OptionNames> needed[] = {
        {"--every", {"--compact", "--table", "--only", "--without"}},
        {"--output", {"--table", "--only", "--without"}},
        {"--only", {"--output", "--compact"}},
        {"--without", {"--output", "--compact"}},
        {"--interval", another},
        {"--export-plain", {"--export"}},
        {"--picture-tolerance", {"--expect-picture"}},
        {"--sound-tolerance", {"--expect-sound"}},
        {"--name", {"--junit", "--page"}}};
    for (const auto& [option, others] : needed)
        if (holds(given, option) && std::ranges::none_of(others, [&](auto other) { return holds(given, other); }))
            throw UsageError(std::string(option), fmt::format("goes with {}", fmt::join(others, " or ")));
}

/// Throws UsageError for options that would have no effect.
void checkTogether(const std::vector<std::string>& typed) {
    const OptionNames given(typed.begin(), typed.end());
    checkNeeded(given);
    const ReplayMode& mode = modeOf(given);
    // These options permit something rather than request it.
    static const OptionNames always = {"LOG", "--json", "--force", "--base", "--allow", "--limit"};
    for (const std::string_view option : given) {
        if (holds(mode.asks, option) || holds(mode.takes, option) || holds(always, option)) continue;
        // Options that no mode names belong to outputs.
        const bool named = std::ranges::any_of(
            replayModes(), [&](const ReplayMode& m) { return holds(m.asks, option) || holds(m.takes, option); });
        if (mode.makesOutputs && !named) continue;
        const std::string_view asking = askingFor(mode, given);
        throw UsageError(std::string(option),
                         asking.empty() ? "has no meaning here" : fmt::format("cannot be combined with {}", asking));
    }
}

int makeTable(const ReplayArguments& options) {
    TableArguments arguments{options.log, options.tabled, options.out, {}, options.json};
    if (options.json && (options.out.empty() || options.out == "-"))
        throw UsageError("--json", "the table itself is on standard output; -o names a file for it");
    arguments.options.from = seekOf(options, logStart(options.log));
    if (!options.duration.empty()) arguments.options.to = arguments.options.from + parseSeconds(options.duration);
    arguments.options.every = options.every;
    return writeTable(arguments);
}

/// Throws UsageError for --frames that cannot be made, or together with options that set a beginning or a length.
void checkFrames(const OptionNames& given, const ReplayArguments& options) {
    if (holds(given, "--run-up") && (options.frames.empty() || options.outputs.listen.empty()))
        throw UsageError("--run-up", "goes with --frames and --listen");
    if (options.frames.empty()) return;
    (void)parsePictureRange(options.frames);
    const std::string &pictures = options.outputs.render, &sound = options.outputs.listen;
    if ((pictures.empty() && sound.empty()) ||
        (!pictures.empty() && (PictureFiles(pictures, 1).together() || !options.outputs.animated())))
        throw UsageError("--frames", "needs --render with a place for numbers in the name, such as %04d");
    if (!sound.empty() && (options.outputs.onDevice() || !checkSoundName(sound) ||
                           !numberedName(std::filesystem::path(sound).filename().string(), 0)))
        throw UsageError("--frames", "needs --listen with a place for a number in the name, such as %04d.wav");
    for (const std::string_view other : {"--seek", "--for", "--export", "--live", "--save", "--microphone", "--stream"})
        if (holds(given, other)) throw UsageError("--frames", fmt::format("cannot be combined with {}", other));
}

int replay(const Command& command, ReplayArguments options) {
    const std::vector<std::string> typed = command.given();
    checkTogether(typed);
    checkFrames(OptionNames(typed.begin(), typed.end()), options);
    const char* const shortened = options.compact.empty() ? "-o" : "--compact";
    if (!options.only.empty() || !options.without.empty()) {
        if (!options.compact.empty() && !options.out.empty())
            throw UsageError("-o", "cannot be combined with --compact, which names the log to write");
        // -o names the output; --compact does the same.
        if (options.compact.empty()) options.compact = std::exchange(options.out, {});
    }
    if (!options.outputs.picture.tile.empty()) {
        if (options.outputs.render.empty()) throw UsageError("--tile", "goes with --render");
        options.outputs.render = options.outputs.picture.fileOf(options.outputs.render);
    }
    if (!options.tabled.empty()) checkTableName(options.out);
    if (options.test.update) checkLogUse("--update", options.log, LogUse::recordAgain);
    options.shownLog = shownLog(options.log), options.shownDiff = shownLog(options.diff);
    const auto log = fetchLog("LOG", options.log);
    if (!log) return printError(log.error()), kBad;
    const auto other = fetchLog("--diff", options.diff);
    if (!other) return printError(other.error()), kBad;
    auto stored = StoredLog::start(shortened, options.compact, LogUse::write, options.outputs.force);
    if (!stored) return printError(stored.error()), kBad;
    if (auto ok = options.outputs.check({options.log, options.diff, options.test.rerun},
                                        {{"--export", options.exported, OutputKind::capture},
                                         {shortened, options.compact, OutputKind::log},
                                         {"-o", options.out == "-" ? "" : options.out, OutputKind::table}});
        !ok)
        return printError(ok.error()), kBad;
    if (!options.diff.empty()) return diff(options);
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    if (!options.compact.empty()) return stored->finish(compact(options));
    if (!options.blamed.empty()) return blame(options.log, options.blamed, options.json);
    if (!options.tabled.empty()) return makeTable(options);
    if (options.test.any()) {
        ReplayTestArguments test = options.test;
        test.closed = options.verify;
        return runReplayTestVerb(options.log, test, options.outputs, options.json);
    }
    (void)seekOf(options, 0);  // checked before anything is opened
    auto opened = Replayer::open(options.log);
    if (!opened) return printError(opened.error()), kBad;
    reportOfPieces(options.log);
    return Replaying(options, **opened).run();
}

}  // namespace

Verb addReplay(Command& program) {
    auto options = std::make_shared<ReplayArguments>();
    Command* command = program.addVerb("replay", "Play a log back; verify it; picture, hear and save it");
    command
        ->addOption("LOG", options->log,
                    "log to read (.rlog), folder of its pieces, or these by commas; or nats://HOST:PORT/NAME")
        ->required();
    command->addFlag("--verify", options->verify,
                     "check the whole log, to the index at the session's end; states are always checked");
    command->addOption("--seek", options->seek, "begin at this time after the log's start (1:30, 90s), or at a date");
    command->addOption("--for", options->duration, "how much to play");
    command->addFlag("--json", options->json, "the report as JSON");
    {
        const Command::Section section(*command, "Instead of playing");
        command->addOption("--diff", options->diff, "compare with another log, state by state");
        command->addOption("--blame", options->blamed,
                           "who changed NODE.field, when, and by which routes, as far as the log tells");
        command->addOption("--table", options->tabled,
                           "fields, separated by commas (TRAIN.rotation,DOOR.*), as CSV, one row for each state: from "
                           "--seek on, for the time of --for, one state of --every");
        command->addOption("--only", options->only,
                           "with -o: write a log in which only these fields change (TRAIN.rotation,DOOR.*); others "
                           "keep their first values");
        command->addOption("--without", options->without, "with -o: write a log in which these fields do not change");
        command->addOption("-o,--output", options->out,
                           "with --table: .csv to write; - or none: standard output. With --only and --without: .rlog");
        command->addOption("--compact", options->compact,
                           "write a shorter log (.rlog, or nats://HOST:PORT/NAME): from --seek on, for the time of "
                           "--for, with frames merged by --every or --interval");
        command
            ->addOption("--every", options->every,
                        "with --compact: this many frames become one; with --table: one row for this many states")
            ->preset()
            ->range(std::uint64_t{1}, UINT64_MAX);
        command->addOption("--interval", options->interval, "with --compact: frames closer than this become one")
            ->preset();
    }
    options->outputs.addTo(*command, OutputArguments::Options::ofReplay);
    options->outputs.picture.addTileTo(*command);
    {
        const Command::Section section(*command, "What is made");
        command->addOption(
            "--frames", options->frames,
            "A-B: only the pictures of these numbers, as a run of all makes them, into --render NAME%04d");
        command
            ->addOption("--run-up", options->runUp,
                        "with --frames and --listen: reflections are computed from this time before them on; with the "
                        "log's length, the sound has the bits of one run")
            ->preset();
        command->addOption("--export", options->exported, "MCAP file of it, for Foxglove: /tf, /scene, /rtsg/changes");
        command->addFlag("--export-plain", options->exportPlain, "the MCAP's chunks uncompressed");
    }
    options->test.addTo(*command);
    command->footer(
        "Example: rtsg replay hall.rlog --verify\n"
        "Example: rtsg replay hall.rlog --seek 2.5s --render then.png --base examples/demo\n"
        "Example: rtsg replay hall.rlog --render out/%04d.png --fps 25 --frames 10-19 --size 320x180\n"
        "Example: rtsg replay hall.rlog --render out/%04d.png --fps 25 --frames 0-1 --tile 0,1/2,2\n"
        "Example: rtsg replay hall.rlog --export hall.mcap\n"
        "Example: rtsg replay hall.rlog --blame LAMP_SWING.rotation\n"
        "Example: rtsg replay hall.rlog --table TRAIN.rotation -o train.csv\n"
        "Example: rtsg replay hall.rlog --without TRAIN.* -o cut.rlog\n"
        "Example: rtsg replay hall.rlog --compact short.rlog --seek 60s --for 10s --every 6\n"
        "Example: rtsg replay door.rlog --rerun door.x3dv --expect-picture door.png --size 160x120\n"
        "Exit status 1, naming frame, node and field, where a state is not the one recorded.\n"
        "Ctrl-C before the end leaves films, sounds, a picture of the last state and the saved scene unwritten.");
    return {command, [command, options] { return replay(*command, *options); }};
}

}  // namespace rtsg::app
