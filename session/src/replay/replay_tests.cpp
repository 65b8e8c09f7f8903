// Runs a scene again, and compares states, pictures and sound with those expected.
#include <rtsg/session/replay_tests.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/renderers/image.h>
#include <rtsg/session/load_scene.h>
#include <rtsg/sync/replay.h>
#include <rtsg/sync/replay_test.h>

#include "outputs/outputs.h"

namespace rtsg {

/// The file that a test makes for comparison. It is in the current folder, away from the user's own files.
std::string actualName(const std::string& reference) {
    const std::filesystem::path path(reference);
    return path.stem().string() + ".actual" + path.extension().string();
}

double logStart(const std::string& log) {
    auto reader = LogReader::open(log);
    return reader && !reader->keyframes().empty() ? reader->keyframes().front().time : 0;
}

std::optional<Divergence> fromStart(std::optional<Divergence> divergence, double start) {
    if (divergence) divergence->time = std::round((divergence->time - start) * 1e6) / 1e6;
    return divergence;
}

namespace {

constexpr int kUsualWidth = 1280, kUsualHeight = 720;  // of pictures, unless another size is asked for

/// The picture or sound that is compared with a reference; nothing if that is empty.
///
/// Tests may run at the same time in one folder with references of the same name. So each test makes its file under a
/// name of its own, and renames it at the end.
class TemporaryFile {
  public:
    explicit TemporaryFile(const std::string& reference) {
        if (reference.empty()) return;
        shown_ = actualName(reference);
        const std::filesystem::path path(shown_);
        file_ = fmt::format("{}.{}{}", path.stem().string(), ::getpid(), path.extension().string());
    }
    ~TemporaryFile() {
        std::error_code ignored;  // there may be none, and the reason has been reported
        if (!file_.empty()) std::filesystem::rename(file_, shown_, ignored);
    }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;

    const std::string& file() const { return file_; }
    const std::string& shown() const { return shown_; }

  private:
    std::string file_, shown_;
};

/// The files of a test that compares and does not update.
struct CreatedFiles {
    explicit CreatedFiles(const ReplayTestOptions& options)
        : picture(options.update ? "" : options.expectPicture), sound(options.update ? "" : options.expectSound) {}
    const TemporaryFile picture, sound;
};

Result<> comparePictures(const std::string& reference, const TemporaryFile& actual, double tolerance) {
    const std::string& created = actual.shown();
    const auto a = readPicture(reference), b = readPicture(actual.file());
    for (const auto* picture : {&a, &b})
        if (!*picture) return std::unexpected(picture->error());
    const auto difference = compare(*a, *b);
    if (!difference) return fail(fmt::format("{} and {}: {}", created, reference, difference.error().text));
    if (difference->rmse <= tolerance) return {};
    return fail(fmt::format("{} differs from {}: rmse {:.4g} exceeds {:.4g}, most at pixel {}, {} ({:.4g})", created,
                            reference, difference->rmse, tolerance, difference->worstX, difference->worstY,
                            difference->maximum));
}

Result<> compareSounds(const std::string& reference, const TemporaryFile& actual, double toleranceDb) {
    const std::string& created = actual.shown();
    const auto a = readSound(reference), b = readSound(actual.file());
    for (const auto* sound : {&a, &b})
        if (!*sound) return std::unexpected(sound->error());
    const auto level = differenceDb(*a, *b);
    if (!level) return fail(fmt::format("{} and {}: {}", created, reference, level.error().text));
    if (*level <= toleranceDb) return {};
    return fail(fmt::format("{} differs from {}: the difference is at {:.1f} dB of it, which exceeds {:.1f} dB",
                            created, reference, *level, toleranceDb));
}

void countFromStart(ReplayReport& report, double start) {
    const auto since = [start](double t) { return std::round((t - start) * 1e6) / 1e6; };
    report.divergence = fromStart(report.divergence, start);
    report.start = since(report.start);
    report.end = since(report.end);
    for (FieldDifference& d : report.differences) d.time = since(d.time);
    for (FieldHistory& h : report.histories)
        for (FieldHistory::Sample& s : h.samples) s.time = since(s.time);
}

std::string nameOfTest(const ReplayTestOptions& options, const std::string& log) {
    return options.name.empty() ? std::filesystem::path(log).stem().string() : options.name;
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

/// Builds the scene. Error: nothing of it is usable, or anything is wrong with what would be recorded.
Result<> buildScene(Scene& scene, const ReplayTestOptions& options, Diagnostics& diagnostics,
                    const Resources& resources, const SessionContext& context) {
    const bool isUsable = loadScene(scene, options.rerun, diagnostics, resources, context);
    if (isUsable && !(options.update && diagnostics.errors() > 0)) return {};
    const auto error = std::ranges::find(diagnostics.all(), Severity::error, &Diagnostic::severity);
    if (error != diagnostics.all().end()) return std::unexpected(*error);
    return fail("nothing usable in it", {}, options.rerun);
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
void checkInputs(ReplayOutcome& outcome, const ReplayTestOptions& options, const Diagnostics& diagnostics) {
    if (const std::size_t errors = diagnostics.errors(); errors > 0)
        outcome.checks.push_back({"scene",
                                  fmt::format("{} has {} error{}: what was run is the rest of it", options.rerun,
                                              errors, errors == 1 ? "" : "s"),
                                  {}});
    if (options.closed && !options.update) outcome.checks.push_back({"end", howItEnds(outcome.log), {}});
}

DifferingPictures picturesOf(const Scene& recorded, const Scene& now, OutputOptions outputs,
                             const Resources& resources) {
    // Smaller, as they stand side by side on a page and the test waits for them.
    RenderSettings& settings = outputs.image.settings;
    if (settings.width == kUsualWidth && settings.height == kUsualHeight) settings.width /= 2, settings.height /= 2;
    return {recorded.sequence(), pictureOf(recorded, outputs, resources), pictureOf(now, outputs, resources),
            outputs.toneMap};
}

/// Compares the picture and the sound that were made.
void compareWithExpected(ReplayOutcome& outcome, const ReplayTestOptions& options, const TemporaryFile& picture,
                         const TemporaryFile& sound) {
    if (options.update) return;
    // A run that ended at a difference has not reached the state of the references.
    const bool cut = outcome.report.divergence && outcome.report.differences.empty();
    const auto expect = [&](const std::string& name, const std::string& reference, const auto& comparison) {
        if (reference.empty() || cut) return;
        const Result<> ok = comparison();
        outcome.checks.push_back({name, ok ? "" : ok.error().format(), {}});
    };
    expect("picture", options.expectPicture,
           [&] { return comparePictures(options.expectPicture, picture, options.pictureTolerance); });
    expect("sound", options.expectSound,
           [&] { return compareSounds(options.expectSound, sound, options.soundTolerance); });
    if (options.expectPicture.empty()) return;
    outcome.expectedPicture = options.expectPicture;
    outcome.createdPicture = picture.file();
}

ReplayOutcome outcomeOf(const ReplayTestOptions& options, const std::string& log) {
    ReplayOutcome outcome;
    outcome.name = nameOfTest(options, log);
    outcome.log = log;
    outcome.scene = options.rerun;
    return outcome;
}

}  // namespace

/// Writes the reports of passing tests, too, because otherwise the page of an earlier failure would stay.
Result<> writeReports(const ReplayTestOptions& options, const ReplayOutcome& outcome, const SessionContext& context) {
    const auto write = [](const std::string& file, const std::string& text) {
        return file.empty() ? Result<>{} : writeWholeFile(file, std::as_bytes(std::span(text)));
    };
    if (auto ok = write(options.junit, options.junit.empty() ? "" : junitXml(outcome)); !ok) return ok;
    if (options.page.empty()) return {};
    if (!outcome.passed()) {
        if (auto ok = write(options.page, replayPage(outcome)); !ok) return ok;
        context.note(fmt::format("{} shows {}", options.page, outcome.report.frames > 0 ? "what differed" : "why"));
        return {};
    }
    std::error_code error;
    if (std::filesystem::is_directory(options.page, error)) return fail("Is a directory", {}, options.page);
    std::filesystem::remove(options.page, error);
    return error ? fail(error.message(), {}, options.page) : Result<>{};
}

ReplayOutcome failedOutcome(const std::string& log, const ReplayTestOptions& options, const std::string& why,
                            const std::string& advice) {
    ReplayOutcome outcome = outcomeOf(options, log);
    outcome.checks.push_back({"states", why, advice});
    return outcome;
}

ReplayTestRun runReplayTest(const std::string& log, const ReplayTestOptions& options, OutputOptions outputs,
                            const Resources& resources) {
    const SessionContext& context = outputs.context;
    const auto files = std::make_shared<const CreatedFiles>(options);
    const auto& [picture, sound] = *files;
    if (!options.expectPicture.empty()) outputs.render = options.update ? options.expectPicture : picture.file();
    if (!options.expectSound.empty()) outputs.listen = options.update ? options.expectSound : sound.file();
    const auto begun = std::chrono::steady_clock::now();
    const double start = logStart(log);
    ReplayTestRun result{outcomeOf(options, log), {}, false, files};
    ReplayOutcome& outcome = result.outcome;
    ReplayTest test;
    test.log = log;
    test.update = options.update;
    test.compared = options.compared;
    Diagnostics diagnostics(options.rerun);
    if (!options.rerun.empty())
        test.build = [&](Scene& scene) -> Result<> {
            // --update refuses a scene with errors, because the rest of it is no reference.
            const bool withBytes = keepFetched(log, resources);
            auto built = buildScene(scene, options, diagnostics, resources, context);
            if (WebFetcher* fetcher = webFetcher(resources); built && fetcher)
                (void)FetchedFiles(*fetcher, withBytes).publish(scene);
            return built;
        };
    test.check = [&](const Scene&) { return context.interrupted() ? Result<>(fail("interrupted")) : Result<>(); };
    std::optional<WorldOnDemand> world;
    std::unique_ptr<Outputs> following;
    test.attach = [&](Scene& scene) -> Result<> {
        reportFailuresAtTheEnd(scene);
        const std::vector<OutputName> reports = {{"--junit", options.junit, OutputKind::testResult},
                                                 {"--page", options.page, OutputKind::page}};
        if (auto ok = checkUnused(scene, resources, reports); !ok) return ok;
        auto attached = Outputs::attach(world.emplace(scene, resources, context), outputs, resources);
        if (!attached) return std::unexpected(attached.error());
        following = std::move(*attached);
        return {};
    };
    // If no picture is expected, the page shows pictures of the first difference.
    if (!options.page.empty() && options.expectPicture.empty() && !options.update)
        test.differ = [&](const Scene& recorded, const Scene& now) {
            outcome.differing = picturesOf(recorded, now, outputs, resources);
        };
    if (!outputs.render.empty() || !outputs.listen.empty())
        test.frame = [&](const Scene&) { return following->frame(); };
    // Within the test's run, because the scene ends with it.
    test.finish = [&]() -> Result<> {
        if (!following) return {};
        Result<> created = following->finish();
        context.report(world->scene().diagnostics());
        return created;
    };
    Result<ReplayReport> report = runReplayTest(test);
    if (!report) {
        outcome.checks.push_back({"states", report.error().format(), {}});
        result.failure = report.error();
        result.isReported = diagnostics.errors() > 0;
        return result;
    }

    outcome.report = std::move(*report);
    countFromStart(outcome.report, start);
    outcome.checks.push_back(
        {"states", outcome.report.divergence ? log + ": " + outcome.report.divergence->format() : "", {}});
    checkInputs(outcome, options, diagnostics);
    compareWithExpected(outcome, options, picture, sound);
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return result;
}

}  // namespace rtsg
