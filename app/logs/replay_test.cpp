// Runs `rtsg replay` as a test: runs the scene again, and compares states, pictures and sound with those expected.
#include "replay_test.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/sync/log_check.h>
#include <rtsg/sync/replay.h>
#include <rtsg/sync/replay_test.h>

#include "replay_page.h"
#include "say.h"
#include "scene_picture.h"

namespace rtsg::app {

namespace {

/// The file that a test makes for comparison. It is in the current folder, away from the user's own files.
std::string actualName(const std::string& reference) {
    const std::filesystem::path path(reference);
    return path.stem().string() + ".actual" + path.extension().string();
}

/// The picture or sound that is compared with a reference; nothing if that is empty.
///
/// Tests may run at the same time in one folder with references of the same name. So each test makes its file under a
/// name of its own, and renames it at the end.
class MadeFile {
  public:
    explicit MadeFile(const std::string& reference) {
        if (reference.empty()) return;
        shown_ = actualName(reference);
        const std::filesystem::path path(shown_);
        file_ = fmt::format("{}.{}{}", path.stem().string(), ::getpid(), path.extension().string());
    }
    ~MadeFile() {
        std::error_code ignored;  // there may be none, and the reason has been reported
        if (!file_.empty()) std::filesystem::rename(file_, shown_, ignored);
    }
    MadeFile(const MadeFile&) = delete;
    MadeFile& operator=(const MadeFile&) = delete;

    const std::string& file() const { return file_; }
    const std::string& shown() const { return shown_; }

  private:
    std::string file_, shown_;
};

Result<> comparePictures(const std::string& reference, const MadeFile& actual, double tolerance) {
    const std::string& made = actual.shown();
    const auto a = readPicture(reference), b = readPicture(actual.file());
    for (const auto* picture : {&a, &b})
        if (!*picture) return std::unexpected(picture->error());
    const auto difference = compare(*a, *b);
    if (!difference) return fail(fmt::format("{} and {}: {}", made, reference, difference.error().text));
    if (difference->rmse <= tolerance) return {};
    return fail(fmt::format("{} differs from {}: rmse {:.4g} exceeds {:.4g}, most at pixel {}, {} ({:.4g})", made,
                            reference, difference->rmse, tolerance, difference->worstX, difference->worstY,
                            difference->maximum));
}

Result<> compareSounds(const std::string& reference, const MadeFile& actual, double toleranceDb) {
    const std::string& made = actual.shown();
    const auto a = readSound(reference), b = readSound(actual.file());
    for (const auto* sound : {&a, &b})
        if (!*sound) return std::unexpected(sound->error());
    const auto level = differenceDb(*a, *b);
    if (!level) return fail(fmt::format("{} and {}: {}", made, reference, level.error().text));
    if (*level <= toleranceDb) return {};
    return fail(fmt::format("{} differs from {}: the difference is at {:.1f} dB of it, which exceeds {:.1f} dB", made,
                            reference, *level, toleranceDb));
}

}  // namespace

double logStart(const std::string& log) {
    auto reader = LogReader::open(log);
    return reader && !reader->keyframes().empty() ? reader->keyframes().front().time : 0;
}

std::optional<Divergence> fromStart(std::optional<Divergence> divergence, double start) {
    if (divergence) divergence->time = std::round((divergence->time - start) * 1e6) / 1e6;
    return divergence;
}

namespace {

void countFromStart(ReplayReport& report, double start) {
    const auto since = [start](double t) { return std::round((t - start) * 1e6) / 1e6; };
    report.divergence = fromStart(report.divergence, start);
    report.start = since(report.start);
    report.end = since(report.end);
    for (FieldDifference& d : report.differences) d.time = since(d.time);
    for (FieldHistory& h : report.histories)
        for (FieldHistory::Sample& s : h.samples) s.time = since(s.time);
}

}  // namespace

std::string toJson(const std::optional<Divergence>& d) {
    const auto orNull = [](const std::string& text) { return text.empty() ? "null" : jsonString(text); };
    if (!d) return "null";
    return fmt::format("{{\"frame\":{},\"t\":{},\"node\":{},\"field\":{},\"text\":{}}}", d->frame, d->time,
                       orNull(d->node), orNull(d->field), jsonString(d->text));
}

std::string toJson(const std::array<std::string, 2>& damage) {
    const auto orNull = [](const std::string& text) { return text.empty() ? "null" : jsonString(text); };
    return fmt::format("\"damage\":[{},{}]", orNull(damage[0]), orNull(damage[1]));
}

std::string toJson(const ComparedStates& states) {
    return fmt::format("\"compared\":{},\"in_one_alone\":{},{}", states.both, states.one, toJson(states.damage));
}

void warnOfDamage(const std::string& a, const std::string& b, const std::array<std::string, 2>& damage) {
    for (std::size_t i = 0; i < 2; ++i) {
        Diagnostics warnings(i == 0 ? a : b);
        if (!damage[i].empty()) warnings.warning({}, damage[i]);
        print(warnings);
    }
}

void addFieldSelection(Command& command, FieldSelection& selection) {
    command
        .addOption("--field", selection.fields,
                   "compare only these fields: HOOK.translation, DOOR.*; without it, whole states")
        ->repeatable();
    command
        .addOption("--ignore", selection.ignore,
                   "leave these fields out; the word initial: fields that have not changed since the first state")
        ->repeatable();
    command
        .addOption("--tolerance", selection.tolerance,
                   "largest difference of a number, in its unit; of a rotation, radians")
        ->preset();
}

void warnOf(const std::vector<std::string>& ignoredInVain) {
    Diagnostics warnings;
    for (const std::string& pattern : ignoredInVain)
        warnings.warning({}, fmt::format("--ignore {}: there is no such field", pattern));
    print(warnings);
}

void check(const FieldSelection& selection) {
    if (!(selection.tolerance >= 0))
        throw UsageError("--tolerance", fmt::format("{} is not 0 or more", selection.tolerance));
    if (auto ok = selection.check(); !ok) throw UsageError("--field", ok.error().text);
}

void ReplayTestArguments::addTo(Command& command) {
    const Command::Section section(command, "As a test");
    addFieldSelection(command, compared);
    command.addOption("--rerun", rerun,
                      "run SCENE again with the log's input; every frame must equal the recorded one");
    command.addOption("--expect-picture", expectPicture, "picture that the last state must give");
    command.addOption("--picture-tolerance", pictureTolerance, "root mean square error allowed, linear, white is 1")
        ->preset();
    command.addOption("--expect-sound", expectSound, "WAV that the sound must equal");
    command.addOption("--sound-tolerance", soundTolerance, "level allowed of the difference, dB below the sound")
        ->preset();
    command.addOption("--junit", junit, "the result as JUnit XML");
    command.addOption(
        "--page", page,
        "if the test fails, one HTML page: time line, what differed first and why, pictures side by side");
    command.addOption("--name", name, "name of the test, in both; default: the log's");
    command.addFlag("--update", update,
                    "record again: write the log of SCENE as it runs now, and the expected picture and sound");
}

namespace {

/// Tells how to record a log, as there is nothing to compare with yet.
std::string howToRecord(const std::string& log, const std::string& scene) {
    return fmt::format(
        "record one, with the input that the test is about:\n"
        "  rtsg record {} -o {} --for 5s --set NODE.field=VALUE@1.5\n",
        scene.empty() ? "SCENE" : scene, log);
}

std::string nameOfTest(const ReplayTestArguments& arguments, const std::string& log) {
    return arguments.name.empty() ? std::filesystem::path(log).stem().string() : arguments.name;
}

/// Writes the reports of passing tests, too, because otherwise the page of an earlier failure would stay.
Result<> writeReports(const ReplayTestArguments& arguments, const ReplayOutcome& outcome) {
    const auto write = [](const std::string& file, const std::string& text) {
        return file.empty() ? Result<>{} : writeWholeFile(file, std::as_bytes(std::span(text)));
    };
    if (auto ok = write(arguments.junit, arguments.junit.empty() ? "" : junitXml(outcome)); !ok) return ok;
    if (arguments.page.empty()) return {};
    if (!outcome.passed()) {
        if (auto ok = write(arguments.page, replayPage(outcome)); !ok) return ok;
        tellError("{} shows {}\n", arguments.page, outcome.report.frames > 0 ? "what differed" : "why");
        return {};
    }
    std::error_code error;
    if (std::filesystem::is_directory(arguments.page, error)) return fail("Is a directory", {}, arguments.page);
    std::filesystem::remove(arguments.page, error);
    return error ? fail(error.message(), {}, arguments.page) : Result<>{};
}

std::string jsonDifferences(const ReplayReport& report) {
    std::string text;
    for (const FieldDifference& d : report.differences)
        text += fmt::format(
            "{}{{\"node\":{},\"field\":{},\"frame\":{},\"last\":{},\"t\":{},\"states\":{},\"largest\":{},\"text\":{},"
            "\"cause\":{}}}",
            text.empty() ? "" : ",", jsonString(d.node), jsonString(d.field), d.frame, d.last, d.time, d.states,
            std::isinf(d.largest) ? "null" : fmt::format("{}", d.largest), jsonString(d.text), jsonString(d.cause));
    return text;
}

void printOutcome(const ReplayOutcome& outcome, bool json) {
    const ReplayReport& report = outcome.report;
    if (!json)
        fmt::print("{} of {} states as recorded{}: {}{}{}\n", report.verified, report.frames,
                   report.fields > 0 ? fmt::format(" in {} field{}", report.fields, report.fields == 1 ? "" : "s") : "",
                   outcome.passed() ? "passed" : "failed", report.updated ? "; the log was written anew" : "",
                   report.closed || report.updated || !outcome.passed() ? ""
                   : report.goesOn
                       ? "; the session goes on in a next piece, which was not run (--verify fails then)"
                       : "; the log was not closed: states may be missing at its end (--verify fails then)");
    else
        fmt::print(
            "{{\"frames\":{},\"verified\":{},\"first_divergence\":{},\"passed\":{},\"updated\":{},\"closed\":{},"
            "\"fields\":{},"
            "\"differences\":[{}]}}\n",
            report.frames, report.verified, toJson(report.divergence), outcome.passed(), report.updated, report.closed,
            report.fields, jsonDifferences(report));
    for (const ReplayCheck& check : outcome.checks)
        if (!check.failure.empty()) printError(check.failure);
    if (json) return;
    constexpr std::size_t kMost = 10;
    for (std::size_t i = 1; i < std::min(report.differences.size(), kMost); ++i) {
        const FieldDifference& d = report.differences[i];
        tellError("  also {}.{} from frame {} (t = {} s): {}\n", d.node, d.field, d.frame, d.time, d.text);
    }
    if (report.differences.size() <= kMost) return;
    const std::size_t more = report.differences.size() - kMost;
    tellError("  and {} more field{}\n", more, more == 1 ? "" : "s");
}

/// Requests the outputs that are compared. Throws UsageError if arguments contradict each other.
void askForWhatIsExpected(const ReplayTestArguments& arguments, OutputArguments& outputs) {
    if (arguments.update && arguments.rerun.empty())
        throw UsageError("--update", "needs --rerun SCENE: there is no scene to record");
    check(arguments.compared);
    if (arguments.compared.any() && arguments.rerun.empty())
        throw UsageError("--field", "needs --rerun SCENE: a replay has no values but the log's");
    // Errors show the name that the user gave, not that of the file made for comparison.
    const auto checkName = [](const char* option, const std::string& file, const Result<>& ok) {
        if (!ok) throw UsageError(option, file + ": " + ok.error().text);
    };
    if (!arguments.expectPicture.empty()) {
        checkName("--expect-picture", arguments.expectPicture, checkPictureName(arguments.expectPicture));
        if (!outputs.render.empty()) throw UsageError("--expect-picture", "not together with --render");
        outputs.render = arguments.update ? arguments.expectPicture : actualName(arguments.expectPicture);
    }
    if (!arguments.expectSound.empty()) {
        checkName("--expect-sound", arguments.expectSound, checkSoundName(arguments.expectSound));
        if (!outputs.listen.empty()) throw UsageError("--expect-sound", "not together with --listen");
        outputs.listen = arguments.update ? arguments.expectSound : actualName(arguments.expectSound);
    }
}

/// Says how the log ends. Empty if it was closed in order.
std::string howItEnds(const std::string& log) {
    auto opened = Replayer::open(log);
    if (!opened) return opened.error().format();
    LogCheck check(**opened);
    while (check.step().value_or(true)) continue;
    check.expectClosed();
    return check.first() ? log + ": " + fromStart(check.first(), logStart(log))->format() : "";
}

/// Builds the scene. Error: nothing of it is usable, or with `whole` anything is wrong with it.
Result<> buildScene(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources,
                    bool whole) {
    if (load(scene, file, diagnostics, resources) && !(whole && diagnostics.errors() > 0)) return {};
    const auto error = std::ranges::find(diagnostics.all(), Severity::error, &Diagnostic::severity);
    if (error != diagnostics.all().end()) return std::unexpected(*error);
    return fail("nothing usable in it", {}, file);
}

/// Gives the scene that is run again the files that the session fetched, so that it needs no network for those in the
/// log. Returns whether the log has their bytes.
bool keepFetched(const std::string& log, const Resources& resources) {
    auto recorded = Replayer::open(log);
    WebFetcher* fetcher = webFetcher(resources);
    if (!recorded || !fetcher || !(*recorded)->step().value_or(false)) return false;
    keepFetchedFiles((*recorded)->scene(), *fetcher);
    return fetcher->hasKeptBytes();
}

/// Fails the test if the scene or the log is incomplete.
void checkInputs(ReplayOutcome& outcome, const ReplayTestArguments& arguments, const Diagnostics& diagnostics) {
    if (const std::size_t errors = diagnostics.errors(); errors > 0)
        outcome.checks.push_back({"scene",
                                  fmt::format("{} has {} error{}: what was run is the rest of it", arguments.rerun,
                                              errors, errors == 1 ? "" : "s"),
                                  {}});
    if (arguments.closed && !arguments.update) outcome.checks.push_back({"end", howItEnds(outcome.log), {}});
}

DifferingPictures picturesOf(const Scene& recorded, const Scene& now, OutputArguments outputs,
                             const Resources& resources) {
    // Smaller, as they stand side by side on a page and the test waits for them.
    if (outputs.picture.size == PictureArguments().size) outputs.picture.size = "640x360";
    return {recorded.sequence(), pictureOf(recorded, outputs, resources), pictureOf(now, outputs, resources),
            outputs.picture.toneMap()};
}

/// Compares the picture and the sound that were made.
void compareWithExpected(ReplayOutcome& outcome, const ReplayTestArguments& arguments, const MadeFile& picture,
                         const MadeFile& sound) {
    if (arguments.update) return;
    // A run that ended at a difference has not reached the state of the references.
    const bool cut = outcome.report.divergence && outcome.report.differences.empty();
    const auto expect = [&](const std::string& name, const std::string& reference, const auto& comparison) {
        if (reference.empty() || cut) return;
        const Result<> ok = comparison();
        outcome.checks.push_back({name, ok ? "" : ok.error().format(), {}});
    };
    expect("picture", arguments.expectPicture,
           [&] { return comparePictures(arguments.expectPicture, picture, arguments.pictureTolerance); });
    expect("sound", arguments.expectSound,
           [&] { return compareSounds(arguments.expectSound, sound, arguments.soundTolerance); });
    if (arguments.expectPicture.empty()) return;
    outcome.expectedPicture = arguments.expectPicture;
    outcome.madePicture = picture.file();
}

ReplayOutcome outcomeOf(const ReplayTestArguments& arguments, const std::string& log) {
    ReplayOutcome outcome;
    outcome.name = nameOfTest(arguments, log);
    outcome.log = log;
    outcome.scene = arguments.rerun;
    return outcome;
}

/// A test that could not run has failed, in the reports, too.
int reportFailure(const ReplayTestArguments& arguments, const std::string& log, const std::string& why,
                  const std::string& advice = {}) {
    ReplayOutcome outcome = outcomeOf(arguments, log);
    outcome.checks.push_back({"states", why, advice});
    if (auto ok = writeReports(arguments, outcome); !ok) printError(ok.error());
    return kBad;
}

}  // namespace

int runReplayTest(const std::string& log, const ReplayTestArguments& arguments, OutputArguments outputs, bool json) {
    askForWhatIsExpected(arguments, outputs);
    const std::vector<OutputName> reports = {{"--junit", arguments.junit, OutputKind::testResult},
                                             {"--page", arguments.page, OutputKind::page}};
    std::vector<std::string> read = {log, arguments.rerun};
    if (!arguments.update) read.insert(read.end(), {arguments.expectPicture, arguments.expectSound});
    if (auto ok = outputs.check(read, reports); !ok) return printError(ok.error()), kBad;
    if (!std::filesystem::exists(log)) {
        const std::string why = log + ": there is no log yet", advice = howToRecord(log, arguments.rerun);
        printError(why);
        tellError("{}", advice);
        return reportFailure(arguments, log, why, advice);
    }
    const MadeFile picture(arguments.update ? "" : arguments.expectPicture);
    const MadeFile sound(arguments.update ? "" : arguments.expectSound);
    if (!picture.file().empty()) outputs.render = picture.file();
    if (!sound.file().empty()) outputs.listen = sound.file();
    const auto begun = std::chrono::steady_clock::now();
    const Resources resources = outputs.resources.ofFile(arguments.rerun.empty() ? firstFileOf(log) : arguments.rerun);

    const double start = logStart(log);
    ReplayOutcome outcome = outcomeOf(arguments, log);
    ReplayTest test;
    test.log = log;
    test.update = arguments.update;
    test.compared = arguments.compared;
    Diagnostics diagnostics(arguments.rerun);
    if (!arguments.rerun.empty())
        test.build = [&](Scene& scene) -> Result<> {
            // --update refuses a scene with errors, because the rest of it is no reference.
            const bool withBytes = keepFetched(log, resources);
            auto built = buildScene(scene, arguments.rerun, diagnostics, resources, arguments.update);
            if (WebFetcher* fetcher = webFetcher(resources); built && fetcher)
                (void)FetchedFiles(*fetcher, withBytes).publish(scene);
            return built;
        };
    test.check = [](const Scene&) { return interrupted() ? Result<>(fail("interrupted")) : Result<>(); };
    std::optional<WorldOnDemand> world;
    std::unique_ptr<Outputs> following;
    test.attach = [&](Scene& scene) -> Result<> {
        tellOfFailuresInTheEnd(scene);
        keepResources(scene, resources, reports);
        auto attached = Outputs::attach(world.emplace(scene, resources), outputs, resources);
        if (!attached) return std::unexpected(attached.error());
        following = std::move(*attached);
        return {};
    };
    // If no picture is expected, the page shows pictures of the first difference.
    if (!arguments.page.empty() && arguments.expectPicture.empty() && !arguments.update)
        test.differ = [&](const Scene& recorded, const Scene& now) {
            outcome.differing = picturesOf(recorded, now, outputs, resources);
        };
    if (!outputs.render.empty() || !outputs.listen.empty())
        test.frame = [&](const Scene&) { return following->frame(); };
    // Within the test's run, because the scene ends with it.
    test.finish = [&]() -> Result<> {
        if (!following) return {};
        Result<> result = following->finish();
        print(following->scene().diagnostics());
        return result;
    };
    Result<ReplayReport> report = runReplayTest(test);
    if (!report) {
        if (diagnostics.errors() == 0) printError(report.error());  // otherwise it has been reported
        return reportFailure(arguments, log, report.error().format());
    }

    outcome.report = std::move(*report);
    countFromStart(outcome.report, start);
    outcome.checks.push_back(
        {"states", outcome.report.divergence ? log + ": " + outcome.report.divergence->format() : "", {}});
    checkInputs(outcome, arguments, diagnostics);
    compareWithExpected(outcome, arguments, picture, sound);
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    warnOf(outcome.report.ignoredInVain);
    printOutcome(outcome, json);
    if (auto ok = writeReports(arguments, outcome); !ok) return printError(ok.error()), kBad;
    return outcome.passed() ? kDone : kBad;
}

}  // namespace rtsg::app
