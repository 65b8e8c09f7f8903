// rtsg replay as a test: runs the scene again and compares pictures and sound with those expected.
#include "replay_test.h"

#include <cmath>
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/sync/replay_test.h>

namespace rtsg::app {

namespace {

/// Where what was made goes when it is not the reference itself: beside nothing of the user's, in the current folder.
std::string actualName(const std::string& reference) {
    const std::filesystem::path path(reference);
    return path.stem().string() + ".actual" + path.extension().string();
}

Result<> comparePictures(const std::string& reference, const std::string& made, double tolerance) {
    const auto a = readPicture(reference), b = readPicture(made);
    for (const auto* picture : {&a, &b})
        if (!*picture) return std::unexpected(picture->error());
    const auto difference = compare(*a, *b);
    if (!difference) return fail(fmt::format("{} and {}: {}", made, reference, difference.error().text));
    if (difference->rmse <= tolerance) return {};
    return fail(fmt::format("{} differs from {}: rmse {:.4g} exceeds {:.4g}, most at pixel {}, {} ({:.4g})", made,
                            reference, difference->rmse, tolerance, difference->worstX, difference->worstY,
                            difference->maximum));
}

Result<> compareSounds(const std::string& reference, const std::string& made, double toleranceDb) {
    const auto a = readSound(reference), b = readSound(made);
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

std::string toJson(const std::optional<Divergence>& d) {
    const auto orNull = [](const std::string& text) { return text.empty() ? "null" : jsonString(text); };
    if (!d) return "null";
    return fmt::format("{{\"frame\":{},\"t\":{},\"node\":{},\"field\":{},\"text\":{}}}", d->frame, d->time,
                       orNull(d->node), orNull(d->field), jsonString(d->text));
}

void ReplayTestArguments::addTo(Command& command) {
    const std::string group = "As a test";
    command.addOption("--rerun", rerun, "run SCENE afresh on the log's input; every frame has to be the recorded one")
        ->group(group);
    command.addOption("--expect-picture", expectPicture, "picture that the last state has to give")->group(group);
    command.addOption("--picture-tolerance", pictureTolerance, "root mean square error allowed, linear, white is 1")
        ->preset()
        ->group(group);
    command.addOption("--expect-sound", expectSound, "WAV that has to be heard")->group(group);
    command.addOption("--sound-tolerance", soundTolerance, "level allowed of the difference, dB below the sound")
        ->preset()
        ->group(group);
    command
        .addFlag("--update", update,
                 "record anew instead: write the log as SCENE runs now, and the picture and sound expected")
        ->group(group);
}

int runReplayTest(const std::string& log, const ReplayTestArguments& arguments, OutputArguments outputs, bool json) {
    if (arguments.update && arguments.rerun.empty())
        throw UsageError("--update", "needs --rerun SCENE: there is no scene to record");
    if (!arguments.expectPicture.empty()) {
        if (!outputs.render.empty()) throw UsageError("--expect-picture", "not together with --render");
        outputs.render = arguments.update ? arguments.expectPicture : actualName(arguments.expectPicture);
    }
    if (!arguments.expectSound.empty()) {
        if (!outputs.listen.empty()) throw UsageError("--expect-sound", "not together with --listen");
        outputs.listen = arguments.update ? arguments.expectSound : actualName(arguments.expectSound);
    }
    std::vector<std::string> read = {log, arguments.rerun};
    if (!arguments.update) read.insert(read.end(), {arguments.expectPicture, arguments.expectSound});
    if (auto ok = outputs.check(read); !ok) return printError(ok.error()), kBad;
    const std::string& origin = arguments.rerun.empty() ? log : arguments.rerun;
    const Resources resources = outputs.resources.ofFile(origin);

    const double start = logStart(log);
    ReplayTest test;
    test.log = log;
    test.update = arguments.update;
    Diagnostics diagnostics(arguments.rerun);
    if (!arguments.rerun.empty())
        test.build = [&](Scene& scene) -> Result<> {
            if (!load(scene, arguments.rerun, diagnostics, resources))
                return fail("nothing usable in it", {}, arguments.rerun);
            return {};
        };
    test.check = [](const Scene&) -> Result<> {
        if (interrupted()) return fail("interrupted");
        return {};
    };
    std::unique_ptr<Outputs> following;
    test.attach = [&](Scene& scene) -> Result<> {
        auto attached = Outputs::attach(scene, outputs, resources);
        if (!attached) return std::unexpected(attached.error());
        following = std::move(*attached);
        return {};
    };
    if (!outputs.render.empty() || !outputs.listen.empty())
        test.frame = [&](const Scene&) { return following->frame(); };
    // Within the test's run, as the scene goes with it.
    test.finish = [&]() -> Result<> {
        if (!following) return {};
        Result<> result = following->finish();
        print(following->scene().diagnostics());
        return result;
    };
    Result<ReplayReport> report = runReplayTest(test);
    if (!report) return printError(report.error()), kBad;

    report->divergence = fromStart(report->divergence, start);
    std::vector<std::string> failures;
    if (report->divergence) failures.push_back(log + ": " + report->divergence->format());
    const auto expect = [&](const std::string& reference, const auto& comparison) {
        if (reference.empty() || arguments.update || report->divergence) return;
        if (auto ok = comparison(); !ok) failures.push_back(ok.error().format());
    };
    expect(arguments.expectPicture,
           [&] { return comparePictures(arguments.expectPicture, outputs.render, arguments.pictureTolerance); });
    expect(arguments.expectSound,
           [&] { return compareSounds(arguments.expectSound, outputs.listen, arguments.soundTolerance); });
    const bool passed = report->passed() && failures.empty();
    if (!json)
        fmt::print("{} of {} states as recorded: {}{}\n", report->verified, report->frames,
                   passed ? "passed" : "failed", report->updated ? "; the log was written anew" : "");
    else
        fmt::print("{{\"frames\":{},\"verified\":{},\"first_divergence\":{},\"passed\":{},\"updated\":{}}}\n",
                   report->frames, report->verified, toJson(report->divergence), passed, report->updated);
    for (const std::string& failure : failures) printError(failure);
    return passed ? kDone : kBad;
}

}  // namespace rtsg::app
