// rtsg record: runs a scene in simulated time and logs every change.
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include <fmt/format.h>

#include <rtsg/core/scene_builder.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/lossy_scene.h>

#include "cli.h"
#include "files.h"
#include "injections.h"

namespace rtsg::app {

namespace {

struct Options {
    std::string scene, out, duration = "1s";
    std::string mode = "state", coding = "raw";
    double error = 1e-3;
    std::vector<std::string> set;
    ResourceArguments resources;
    double fps = 60;
    bool realtime = false, json = false, inputs = false, force = false;
};

int record(const Options& options) {
    const double duration = parseSeconds(options.duration);
    if (auto ok = checkFiles({options.scene}, {{"-o", options.out, OutputKind::log}}, options.force); !ok)
        return printError(ok.error()), kBad;
    Scene scene;
    Diagnostics diagnostics(options.scene);
    const Resources resources = options.resources.ofFile(options.scene);
    if (!load(scene, options.scene, diagnostics, resources)) return kBad;
    auto injections = Injections::parse(scene, options.set);
    if (!injections) return printError(injections.error().text), kUsage;
    Diagnostics inlineDiagnostics(options.scene);
    BuildOptions build;
    build.resources = resources;
    if (options.scene != "-") build.file = options.scene;
    InlineLoader inlines(scene, inlineDiagnostics, build);
    LogOptions logOptions;
    logOptions.mode.mode = *modeFromName(options.mode);
    logOptions.mode.coding = *codingFromName(options.coding);
    std::unique_ptr<LossyScene> lossy;
    if (logOptions.mode.mode == Mode::lossy) {
        auto followed = LossyScene::follow(scene, options.error);
        if (!followed) return printError(followed.error()), kUsage;
        lossy = std::move(*followed);
        logOptions.mode.maxError = options.error;
    }
    logOptions.inputs = options.inputs;
    logOptions.existing = existing(options.force);
    scene.setInputRecording(options.inputs || logOptions.mode.mode == Mode::input);
    (void)interrupted();  // from here on an interruption ends in order: no half file stays
    auto log = LogWriter::create(options.out, builtinTypes(), logOptions);
    if (!log) return printError(log.error()), kBad;
    Attachment attachment = (lossy ? lossy->scene() : scene).bus().attach(**log);
    const auto frames = static_cast<std::uint64_t>(std::floor(duration * options.fps + 1e-9)) + 1;
    const auto start = std::chrono::steady_clock::now();
    const Progress progress = progressBar("recording " + options.out);
    std::uint64_t done = 0;
    for (; done < frames && attachment.attached() && !interrupted(); ++done) {
        const double t = static_cast<double>(done) / options.fps;
        if (options.realtime) std::this_thread::sleep_until(start + std::chrono::duration<double>(t));
        injections->sendUntil(t);
        scene.newFrame(t);
        inlines.update();
        if (progress) progress(done + 1, frames);
    }
    scene.seal();
    print(inlineDiagnostics);
    print(scene.diagnostics());
    if (!attachment.attached()) {
        printError(attachment.failure());
        printError(fmt::format("{} holds the first {} bytes, to a whole frame", options.out, (*log)->bytes()));
        return kBad;
    }
    attachment.detach();
    if (auto ok = (*log)->close(); !ok) return printError(ok.error()), kBad;
    const double perFrame =
        static_cast<double>((*log)->bytes()) / static_cast<double>(std::max<std::uint64_t>(1, done));
    if (options.json)
        fmt::print("{{\"frames\":{},\"t\":{},\"bytes\":{},\"bytes_per_frame\":{:.1f},\"hash\":\"{}\"}}\n", done,
                   scene.now(), (*log)->bytes(), perFrame, scene.hash().hex());
    else
        fmt::print("{} frames to t = {} s, {} bytes ({:.1f} a frame), state {}\n", done, scene.now(), (*log)->bytes(),
                   perFrame, scene.hash().hex());
    if (done == frames) return kDone;
    printError(fmt::format("interrupted: {} holds {} of {} frames", options.out, done, frames));
    return kBad;
}

}  // namespace

Verb addRecord(CLI::App& program) {
    auto options = std::make_shared<Options>();
    CLI::App* command = program.add_subcommand("record", "Run a scene in simulated time from 0 and log every change");
    command->add_option("SCENE", options->scene, "scene file, or -")->required();
    command->add_option("-o,--output", options->out, "log to write (.rlog)")->required();
    command->add_option("--for", options->duration, "how long")->capture_default_str();
    command->add_option("--fps", options->fps, "frames a second")->capture_default_str()->check(CLI::Range(1e-3, 1e6));
    command->add_option("--set", options->set, "inject an event: DEF.field=VALUE@TIME, VALUE as in ClassicVRML");
    command
        ->add_option("--mode", options->mode,
                     "state: the changes; input: only what came into each frame; lossy: as state, within --error")
        ->check(CLI::IsMember(std::vector<std::string>(kModeNames.begin(), kModeNames.end())))
        ->capture_default_str();
    command->add_option("--error", options->error, "lossy: largest error in motion, metres and radians; rest is exact")
        ->capture_default_str()
        ->check(CLI::PositiveNumber);
    command->add_option("--coding", options->coding, "of values: raw, fastest; compact; smallest")
        ->check(CLI::IsMember(std::vector<std::string>(kCodingNames.begin(), kCodingNames.end())))
        ->capture_default_str();
    command->add_flag("--inputs", options->inputs, "with state: also what came into each frame, for exact reruns");
    options->resources.addTo(*command);
    command->add_flag("--realtime", options->realtime, "one second a second");
    addForce(*command, options->force);
    command->add_flag("--json", options->json, "the summary as JSON");
    command->footer(
        "Example: rtsg record hall.x3dv -o hall.rlog --for 10s\n"
        "Example: rtsg record door.x3dv -o door.rlog --for 3s --set PRESSED.set_boolean=TRUE@0.5\n"
        "Ctrl-C ends the log in order, with exit status 1 as it is shorter than asked for.");
    return {command, [options] { return record(*options); }};
}

}  // namespace rtsg::app
