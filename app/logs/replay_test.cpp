// Options of `rtsg replay` as a test, and what it prints.
#include "replay_test.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/renderers/picture.h>

#include "say.h"

namespace rtsg::app {

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
    constexpr std::size_t kMax = 10;
    for (std::size_t i = 1; i < std::min(report.differences.size(), kMax); ++i) {
        const FieldDifference& d = report.differences[i];
        reportError("  also {}.{} from frame {} (t = {} s): {}\n", d.node, d.field, d.frame, d.time, d.text);
    }
    if (report.differences.size() <= kMax) return;
    const std::size_t more = report.differences.size() - kMax;
    reportError("  and {} more field{}\n", more, more == 1 ? "" : "s");
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

/// A test that could not run has failed, in the reports, too.
int reportFailed(const ReplayTestArguments& arguments, const ReplayOutcome& outcome) {
    if (auto ok = writeReports(arguments, outcome, programContext()); !ok) printError(ok.error());
    return kBad;
}

}  // namespace

int runReplayTestVerb(const std::string& log, const ReplayTestArguments& arguments, OutputArguments outputs,
                      bool json) {
    askForWhatIsExpected(arguments, outputs);
    const std::vector<OutputName> reports = {{"--junit", arguments.junit, OutputKind::testResult},
                                             {"--page", arguments.page, OutputKind::page}};
    std::vector<std::string> read = {log, arguments.rerun};
    if (!arguments.update) read.insert(read.end(), {arguments.expectPicture, arguments.expectSound});
    if (auto ok = outputs.check(read, reports); !ok) return printError(ok.error()), kBad;
    if (!std::filesystem::exists(log)) {
        const std::string why = log + ": there is no log yet", advice = howToRecord(log, arguments.rerun);
        printError(why);
        reportError("{}", advice);
        return reportFailed(arguments, failedOutcome(log, arguments, why, advice));
    }
    const Resources resources = outputs.resources.ofFile(arguments.rerun.empty() ? firstFileOf(log) : arguments.rerun);
    const ReplayTestRun run = runReplayTest(log, arguments, outputs.options(), resources);
    if (run.failure) {
        if (run.failure->code == kUsageCode) throw UsageError(run.failure->text);
        if (!run.isReported) printError(*run.failure);
        return reportFailed(arguments, run.outcome);
    }
    warnOf(run.outcome.report.ignoredInVain);
    printOutcome(run.outcome, json);
    if (auto ok = writeReports(arguments, run.outcome, programContext()); !ok) return printError(ok.error()), kBad;
    return run.outcome.passed() ? kDone : kBad;
}

}  // namespace rtsg::app
