// rtsg record: runs a scene in simulated time and logs every change.
#include <memory>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/session/running_scene.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/record.h>

#include "files.h"
#include "keyframes.h"
#include "log_store.h"
#include "rotate.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct RecordArguments {
    std::string scene, out, duration = "1s";
    std::string mode = "state", coding = "raw";
    double error = 1e-3;
    std::vector<std::string> set;
    ResourceArguments resources;
    StartTime start;
    NetworkArguments network;
    KeyframeArguments keyframes;
    RotateArguments rotate;
    double fps = 60;
    bool realtime = false, json = false, inputs = false, force = false, embed = false;
};

/// The log of a scene. It has a thread of its own, except with inputs, which need the running scene itself.
class Recording {
  public:
    static Result<std::unique_ptr<Recording>> start(Scene& scene, const std::string& file, const LogOptions& options) {
        auto recording = std::make_unique<Recording>();
        if (options.inputs || options.mode.mode == Mode::input) {
            auto writer = LogWriter::create(file, builtinTypes(), options);
            if (!writer) return std::unexpected(writer.error());
            recording->writer_ = std::move(*writer);
            recording->attachment_ = scene.bus().attach(*recording->writer_);
        } else {
            auto recorder = LogRecorder::start(scene, file, options, LogRecorder::WhenBehind::wait);
            if (!recorder) return std::unexpected(recorder.error());
            recording->recorder_ = std::move(*recorder);
        }
        return recording;
    }
    std::string failure() const { return recorder_ ? recorder_->failure() : attachment_.failure(); }
    std::uint64_t bytes() const { return recorder_ ? recorder_->bytes() : writer_->bytes(); }
    Result<> stop() {
        if (recorder_) return recorder_->stop();
        if (!attachment_.attached()) return fail(attachment_.failure());
        attachment_.detach();
        return writer_->close();
    }

  private:
    std::unique_ptr<LogRecorder> recorder_;
    std::unique_ptr<LogWriter> writer_;
    Attachment attachment_;
};

/// The number of a session whose clock was set: the same for the same scene and options, so that it is recorded again
/// as the same file. Without --at, 0: any number.
std::uint64_t epochOf(const RecordArguments& o, const Scene& scene) {
    if (o.start.at.empty()) return 0;
    const std::string text =
        fmt::format("{} {} {} {} {} {} {} {} {} {} {}", scene.hash().hex(), o.start.at, o.start.clip, o.duration, o.fps,
                    o.mode, o.error, o.inputs, o.embed, fmt::join(o.set, " "), RTSG_VERSION);
    return checksumOf(std::as_bytes(std::span(text))) | 1;
}

LogOptions logOptions(const RecordArguments& options) {
    LogOptions result;
    result.mode.mode = *modeFromName(options.mode);
    result.mode.coding = *codingFromName(options.coding);
    if (result.mode.mode == Mode::lossy) result.mode.maxError = options.error;
    result.inputs = options.inputs;
    options.keyframes.setIn(result);
    options.rotate.setIn(result);
    result.existing = existing(options.force);
    return result;
}

void printSummary(const RecordArguments& options, RunningScene& running, std::uint64_t frames, std::uint64_t states,
                  std::uint64_t bytes) {
    const double perFrame = static_cast<double>(bytes) / static_cast<double>(std::max<std::uint64_t>(1, frames));
    const std::string hash = running.scene().hash().hex();
    if (options.json)
        fmt::print("{{\"states\":{},\"frames\":{},\"t\":{},\"bytes\":{},\"bytes_per_frame\":{:.1f},\"hash\":\"{}\"}}\n",
                   states, frames, running.time(), bytes, perFrame, hash);
    else if (options.rotate.wanted())
        fmt::print("{} states to t = {} s, {} bytes in the last file, state {}\n", states, running.time(), bytes, hash);
    else
        fmt::print("{} states to t = {} s, {} bytes ({:.1f} a frame), state {}\n", states, running.time(), bytes,
                   perFrame, hash);
}

int recordFile(const RecordArguments& options) {
    const Pace pace{parseSeconds(options.duration), options.fps, options.realtime};
    const std::vector<OutputName> outputs{{"-o", options.out, OutputKind::log}};
    if (auto ok = checkFiles({options.scene}, outputs, options.force); !ok) return printError(ok.error()), kBad;
    if (auto ok = options.rotate.checkPieces(options.out, options.force); !ok) return printError(ok.error()), kBad;
    ResourceArguments resources = options.resources;
    resources.inBackground = pace.realtime;
    RunningScene running(options.scene, resources.ofFile(options.scene), options.start.options(), programContext());
    running.allowNetwork(options.network.dis);
    if (options.embed) running.embedFetched();
    if (!running.load()) return kBad;
    Scene& scene = running.scene();
    keepResources(scene, running.resources(), outputs);
    if (auto ok = refusingUsage(running.inject(options.set, pace.seconds)); !ok) return printError(ok.error()), kUsage;
    LogOptions wanted = logOptions(options);
    wanted.epoch = epochOf(options, scene);
    std::unique_ptr<LossyScene> lossy;
    if (wanted.mode.mode == Mode::lossy) {
        auto followed = LossyScene::follow(scene, options.error);
        if (!followed) return printError(followed.error()), kUsage;
        lossy = std::move(*followed);
    }
    scene.setInputRecording(options.inputs || wanted.mode.mode == Mode::input);
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    const Scene& logged = lossy ? lossy->scene() : scene;
    const std::uint64_t before = logged.sequence();
    auto log = Recording::start(lossy ? lossy->scene() : scene, options.out, wanted);
    if (!log) return printError(log.error()), kBad;
    const auto follow = [&](std::uint64_t, const ChangeSet&) { return (*log)->failure().empty() && !interrupted(); };
    const std::uint64_t done = running.run(pace, "recording " + options.out, follow);
    scene.seal();
    const Result<> stopped = (*log)->stop();
    running.reportDiagnostics(stopped ? "" : stopped.error().format());
    if (!stopped) {
        printError(stopped.error());
        printError((*log)->bytes() > 0
                       ? fmt::format("{} holds the first {} bytes, to a whole frame", options.out, (*log)->bytes())
                       : "nothing was recorded");
        return kBad;
    }
    printSummary(options, running, done, logged.sequence() - before + 1, (*log)->bytes());
    if (done == pace.frames()) return kDone;
    printError(fmt::format("interrupted: {} holds {} of {} frames", options.out, done, pace.frames()));
    return kBad;
}

int record(RecordArguments options) {
    auto stored = StoredLog::start(options.rotate.asked("-o"), options.out,
                                   options.rotate.wanted() ? LogUse::rotate : LogUse::write, options.force);
    if (!stored) return printError(stored.error()), kBad;
    return stored->finish(recordFile(options));
}

}  // namespace

Verb addRecord(Command& program) {
    auto options = std::make_shared<RecordArguments>();
    Command* command = program.addVerb("record", "Run a scene in simulated time and log every change");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command
        ->addOption("-o,--output", options->out,
                    "log to write (.rlog), or nats://HOST:PORT/NAME to store it in JetStream")
        ->required();
    command->addOption("--for", options->duration, "how long")->preset();
    command->addOption("--fps", options->fps, "frames a second")->preset()->range(1e-3, 1e6);
    command->addOption(
        "--set", options->set,
        "inject an event: DEF.field=VALUE@TIME, VALUE as in ClassicVRML; or pointer=, key=, text=, wheel=, head=");
    options->start.addTo(*command);
    options->resources.addTo(*command);
    options->network.addTo(*command);
    command->addFlag("--realtime", options->realtime, "one second a second");
    command->addFlag("--json", options->json, "the summary as JSON");
    {
        const Command::Section section(*command, "Log");
        command
            ->addOption("--mode", options->mode,
                        "state: the changes; input: only the input of each frame; lossy: as state, within --error")
            ->oneOf(std::vector<std::string>(kModeNames.begin(), kModeNames.end()))
            ->preset();
        command
            ->addOption("--error", options->error,
                        "lossy: largest error in motion, metres and radians; values at rest are exact")
            ->preset()
            ->positive();
        command->addOption("--coding", options->coding, "coding of values: raw, fastest; compact; smallest")
            ->oneOf(std::vector<std::string>(kCodingNames.begin(), kCodingNames.end()))
            ->preset();
        command->addFlag("--embed", options->embed, "store the bytes of files from the network, not only their hashes");
        command->addFlag("--inputs", options->inputs, "with state: also the input of each frame, for exact reruns");
        options->keyframes.addTo(*command);
        options->rotate.addTo(*command);
        addForce(*command, options->force);
    }
    command->footer(
        "Example: rtsg record hall.x3dv -o hall.rlog --for 10s\n"
        "Example: rtsg record door.x3dv -o door.rlog --for 3s --set PRESSED.set_boolean=TRUE@0.5\n"
        "Ctrl-C closes the log, with exit status 1 since it is shorter than asked for.");
    return {command, [options] { return record(*options); }};
}

}  // namespace rtsg::app
