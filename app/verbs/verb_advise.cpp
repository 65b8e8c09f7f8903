// rtsg advise: tries settings in a scene, and says what each costs, how far it is from the truth, and what follows.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <span>

#include <fmt/format.h>

#include <rtsg/session/advice.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/running_scene.h>
#include <rtsg/sync/replay.h>

#include "cli.h"
#include "extensions.h"
#include "files.h"
#include "output_arguments.h"
#include "start_time.h"
#include "verb_advise.h"

namespace rtsg::app {

namespace {

struct AdviseArguments {
    std::string scene, senses, size = "1280x720", viewpoint, time = "20s", out, plan;
    double fps = 0, error = .05;
    unsigned cores = 0;
    std::uint64_t seed = 1;
    bool json = false;
    ResourceArguments resources;
    StartTime start;
};

/// Parses names by commas. Throws UsageError.
std::vector<Sense> parseSenses(std::string_view list) {
    std::vector<Sense> senses;
    for (std::size_t at = 0; at < list.size();) {
        const std::size_t end = std::min(list.find(',', at), list.size());
        const std::string_view name = list.substr(at, end - at);
        const auto known = std::ranges::find(kSenseNames, name);
        if (known == std::end(kSenseNames))
            throw UsageError("--for",
                             fmt::format("there is no \"{}\"; there are: pictures, sound, rooms, mirror, touch", name));
        const auto sense = static_cast<Sense>(known - std::begin(kSenseNames));
        if (std::ranges::find(senses, sense) == senses.end()) senses.push_back(sense);
        at = end + 1;
    }
    return senses;
}

AdviceOptions adviceOptions(const AdviseArguments& options) {
    AdviceOptions result;
    result.document = options.scene;
    result.senses = parseSenses(options.senses);
    const PictureSize size = PictureSize::parse(options.size);
    result.image.settings.width = size.width, result.image.settings.height = size.height;
    result.image.viewpoint = options.viewpoint;
    result.picturesPerSecond = options.fps, result.cores = options.cores;
    result.seconds = parseSeconds(options.time);
    if (!(result.seconds > 0)) throw UsageError("--time", "must be more than 0");
    result.seed = options.seed, result.error = options.error;
    result.context = programContext();
    result.goOn = [] { return !interrupted(); };
    return result;
}

bool isDrawing(const std::string& file) {
    return std::filesystem::path(file).extension() == ".svg";
}

Result<> write(const std::string& file, const std::string& text) {
    return file.empty() ? Result<>() : writeWholeFile(file, std::as_bytes(std::span(text)));
}

/// Prints and writes what was found.
int report(const AdviseArguments& options, const Result<Advice>& advice) {
    if (interrupted()) return printError("interrupted: nothing was written"), kBad;
    if (!advice) return printError(advice.error()), kBad;
    Diagnostics found = advice->diagnostics;
    found.setFile(options.scene);
    print(found);
    if (auto ok = write(options.out, isDrawing(options.out) ? advice->toSvg() : advice->toHtml()); !ok)
        return printError(ok.error()), kBad;
    if (auto ok = write(options.plan, advice->plan.toText(options.scene)); !ok) return printError(ok.error()), kBad;
    fmt::print("{}", options.json ? advice->toJson() + "\n" : advice->toText());
    for (const std::string& text : advice->missing) printError("missing: " + text);
    return advice->missing.empty() ? kDone : kBad;
}

int adviseScene(const AdviseArguments& options, AdviceOptions wanted, const std::vector<OutputName>& outputs) {
    RunningScene running(options.scene, options.resources.ofFile(options.scene), options.start.options(),
                         programContext());
    if (!running.load()) return kBad;
    keepResources(running.scene(), running.resources(), outputs);
    wanted.resources = running.resources();
    wanted.runTo = [&](double t) {
        running.frame(t);
        return true;
    };
    SharedWorld& world = running.world().get();
    const auto advice = advise(world, wanted);
    running.reportDiagnostics();
    return report(options, advice);
}

int adviseLog(const AdviseArguments& options, AdviceOptions wanted) {
    auto opened = Replayer::open(firstFileOf(options.scene));
    if (!opened) return printError(opened.error()), kBad;
    Replayer& replayer = **opened;
    registerDocuments(replayer.scene());
    extensions().registerWith(replayer.scene());
    wanted.resources = options.resources.ofFile(firstFileOf(options.scene));
    std::optional<Diagnostic> damage;
    std::optional<double> start;
    wanted.runTo = [&](double t) {
        while (!start || (replayer.nextTime() && *replayer.nextTime() - *start <= t + kRounding)) {
            auto more = replayer.step();
            if (!more) damage = more.error();
            if (!more || !*more) return false;
            if (!start) start = replayer.time();
        }
        return replayer.nextTime().has_value() || t == 0;
    };
    WorldOnDemand world(replayer.scene(), wanted.resources, programContext());
    const auto advice = advise(world.get(), wanted);
    const int status = report(options, advice);
    if (damage) return printError(*damage), kBad;
    return status;
}

int adviseOf(const AdviseArguments& options) {
    const AdviceOptions wanted = adviceOptions(options);
    const std::vector<OutputName> outputs{
        {"-o", options.out, isDrawing(options.out) ? OutputKind::ticks : OutputKind::page},
        {"--plan", options.plan, OutputKind::report}};
    if (auto ok = checkFiles({options.scene}, outputs, false); !ok) return printError(ok.error()), kBad;
    return isLogOrNamedSo(options.scene) ? adviseLog(options, wanted) : adviseScene(options, wanted, outputs);
}

}  // namespace

Verb addAdvise(Command& program) {
    auto options = std::make_shared<AdviseArguments>();
    Command* command =
        program.addVerb("advise", "Try settings in a scene: what each costs, its error, and which to take");
    command->addOption("SCENE", options->scene, "scene file, log, or -")->required();
    command->addOption(
        "--for", options->senses,
        "pictures, sound (played), rooms (figures), mirror, touch, by commas; default: what the scene has");
    command->addOption("--time", options->time, "all measuring stays within it")->preset();
    command->addOption("-o,--output", options->out, "a page with tables and diagrams (.html), or the diagrams (.svg)");
    command->addOption("--plan", options->plan,
                       "file (.txt) for the settings that are best, for --plan of render and listen");
    command->addFlag("--json", options->json, "tables and sentences as JSON");
    command->addOption("--size", options->size, "of the pictures, pixels")->preset();
    command->addOption("--viewpoint", options->viewpoint,
                       "DEF name or description of a viewpoint; default: the bound one");
    command->addOption("--error", options->error, "of pictures, RMS over mean, that the plan is for")
        ->preset()
        ->range(1e-4, 1e3);
    command->addOption("--fps", options->fps, "pictures a second that must be made")->range(1e-3, 1e4);
    command->addOption("--cores", options->cores, "cores that there are for them; 0: all")->preset();
    command->addOption("--seed", options->seed, "of the sampling")->preset();
    options->start.addTo(*command);
    options->resources.addTo(*command);
    command->footer("Example: rtsg advise hall.x3dv --for pictures,rooms --time 20s -o advice.html");
    return {command, [options] { return adviseOf(*options); }};
}

}  // namespace rtsg::app
