// rtsg touch: simulates touch: the path of a hand, its proxy, the forces and contacts over time.
#include <algorithm>
#include <cmath>
#include <locale>
#include <memory>
#include <optional>
#include <sstream>

#include <fmt/format.h>

#include <rtsg/core/output_file.h>
#include <rtsg/haptics/haptic_renderer.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/running_scene.h>
#include <rtsg/sync/log_recorder.h>

#include "cli.h"
#include "files.h"
#include "hand.h"
#include "log_store.h"
#include "say.h"
#include "start_time.h"
#include "touch_plot.h"

namespace rtsg::app {

namespace {

struct TouchArguments {
    std::string scene, device, out, record, duration, origin = "0 0 0";
    std::vector<std::string> set;
    ResourceArguments resources;
    StartTime start;
    double fps = 60, mass = 0, stiffness = 200, damping = 2;
    HapticOptions options;
    bool realtime = false, json = false, force = false;
};

/// Receives ticks: lines of a table are written at once; a drawing needs all ticks.
class TickFile {
  public:
    static Result<TickFile> create(const TouchArguments& arguments) {
        TickFile ticks;
        if (arguments.out.empty()) return ticks;
        auto file = OutputFile::create(arguments.out, existing(arguments.force));
        if (!file) return std::unexpected(file.error());
        ticks.file_.emplace(std::move(*file));
        ticks.draws_ = arguments.out.ends_with(".svg");
        if (!ticks.draws_)
            (void)ticks.file_->write(
                "seconds,hand_x,hand_y,hand_z,proxy_x,proxy_y,proxy_z,force_x,force_y,force_z,touching,known,shape\n");
        return ticks;
    }
    void take(HapticRenderer& renderer, const Scene& scene) {
        if (!file_) return;
        for (HapticTick& t : renderer.takeTicks())
            if (draws_)
                kept_.push_back(t);
            else
                (void)file_->write(row(t, scene));
    }
    /// Errors: the first one of all writing.
    Result<> finish() {
        if (!file_) return {};
        if (draws_) (void)file_->write(touchPlot(kept_));
        return file_->commit();
    }

  private:
    static std::string row(const HapticTick& t, const Scene& scene) {
        return fmt::format("{:.6f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},{:d},{:d},{}\n",
                           t.seconds, t.hand.x, t.hand.y, t.hand.z, t.proxy.x, t.proxy.y, t.proxy.z, t.force.x,
                           t.force.y, t.force.z, t.touching, t.known, t.touching ? labelOf(scene, t.shape) : "");
    }

    std::optional<OutputFile> file_;
    bool draws_ = false;
    std::vector<HapticTick> kept_;
};

class Touching {
  public:
    Touching(const TouchArguments& arguments, RunningScene& running, TickFile& ticks, const HapticOptions& options)
        : arguments_(arguments), running_(running), ticks_(ticks), renderer_(running.world().get(), options) {}

    Result<> attach() {
        if (auto ok = renderer_.attachToScene(running_.scene()); !ok) return ok;
        return renderer_.renderFrame();
    }
    HapticRenderer& renderer() { return renderer_; }

    /// Frames and ticks in turn, by the clock of the scene: the same each time.
    void simulate(HapticDevice& device, double seconds) {
        SharedWorld& world = running_.world().get();
        const double rate = renderer_.options().rate;
        const auto ticks = static_cast<std::uint64_t>(std::ceil(seconds * rate));
        std::uint64_t frame = 0;
        for (std::uint64_t tick = 0; tick <= ticks && !interrupted(); ++tick) {
            const double t = static_cast<double>(tick) / rate;
            if (t * arguments_.fps >= static_cast<double>(frame)) {
                if (frame) renderer_.sendEvents();
                ticks_.take(renderer_, running_.scene());
                running_.frame(static_cast<double>(frame++) / arguments_.fps);
                (void)world.present();
            }
            const auto position = device.position(t);
            const Vec3d nowhere(std::nan(""));
            device.push(renderer_.touch(position ? renderer_.inWorld(*position) : nowhere, t).force);
        }
        finishFrames();
    }

    /// In real time: a thread ticks, this one runs frames.
    Result<> live(std::unique_ptr<HapticDevice> device, double seconds) {
        running_.frame(0);
        if (auto ok = renderer_.start(std::move(device)); !ok) return ok;
        Pace pace{seconds, arguments_.fps, true};
        running_.run(pace, "touching " + arguments_.scene, [&](std::uint64_t, const ChangeSet&) {
            renderer_.sendEvents();
            ticks_.take(renderer_, running_.scene());
            return !interrupted() && !renderer_.hasEnded() && renderer_.failure().empty();
        });
        (void)renderer_.stop();
        finishFrames();
        return {};
    }

  private:
    /// Runs frames for the events of the last contacts.
    void finishFrames() {
        renderer_.sendEvents();
        ticks_.take(renderer_, running_.scene());
        for (int i = 1; i <= 3; ++i) running_.frame(running_.time() + 1 / arguments_.fps);
    }

    const TouchArguments& arguments_;
    RunningScene& running_;
    TickFile& ticks_;
    HapticRenderer renderer_;
};

void printTouched(const TouchArguments& arguments, const HapticReport& report, const RunningScene& running) {
    if (arguments.json)
        fmt::print(
            "{{\"t\":{:.3f},\"ticks\":{},\"missed\":{},\"unknown\":{},\"contacts\":{},\"largest_force_n\":{:.4f},"
            "\"tick_us\":{{\"median\":{:.1f},\"worst\":{:.1f}}},\"scheduling\":{},\"hash\":\"{}\"}}\n",
            running.time(), report.ticks, report.missed, report.unknown, report.contacts, report.largestForce,
            1e6 * report.medianSeconds, 1e6 * report.worstSeconds,
            report.scheduling.empty() ? "null" : jsonString(report.scheduling), running.scene().hash().hex());
    else
        fmt::print("{} ticks, {} contacts, at most {:.2f} N; a tick took {:.1f} us, at most {:.0f}{}\n", report.ticks,
                   report.contacts, report.largestForce, 1e6 * report.medianSeconds, 1e6 * report.worstSeconds,
                   report.missed ? fmt::format("; {} were missed", report.missed) : "");
}

Vec3d parseOrigin(const std::string& text) {
    std::string plain = text;
    std::ranges::replace(plain, ',', ' ');
    std::istringstream in(plain);
    in.imbue(std::locale::classic());
    Vec3d position(0);
    std::string rest;
    if (!(in >> position.x >> position.y >> position.z) || in >> rest)
        throw UsageError(fmt::format("--origin takes three numbers, metres, not '{}'", text));
    return position;
}

int touch(const TouchArguments& arguments) {
    HapticOptions options = arguments.options;
    options.origin = parseOrigin(arguments.origin);
    options.keepsTicks = !arguments.out.empty();
    std::vector<OutputName> outputs;
    if (!arguments.out.empty()) outputs.push_back({"-o", arguments.out, OutputKind::ticks});
    if (!arguments.record.empty()) outputs.push_back({"--record", arguments.record, OutputKind::log});
    if (auto ok = checkFiles({arguments.scene}, outputs, arguments.force); !ok) return printError(ok.error()), kBad;
    auto hand = openHand("--device", arguments.device, {{}, arguments.mass, arguments.stiffness, arguments.damping});
    if (!hand) return printError(hand.error()), kBad;
    const bool isLive = arguments.realtime || !hand->isSimulated;
    StartTime start = arguments.start;
    if (isLive) start.kind = StartTime::Kind::live;
    RunningScene running(arguments.scene, arguments.resources.ofFile(arguments.scene), start.options(),
                         programContext());
    if (!running.load()) return kBad;
    const double seconds = !arguments.duration.empty() ? parseSeconds(arguments.duration)
                           : hand->isSimulated         ? hand->seconds
                                                       : 1e9;
    if (auto ok = refusingUsage(running.inject(arguments.set, seconds)); !ok) return printError(ok.error()), kUsage;
    (void)interrupted();
    std::unique_ptr<LogRecorder> recorder;
    if (!arguments.record.empty()) {
        LogOptions log;
        log.existing = existing(arguments.force);
        auto started = LogRecorder::start(running.scene(), arguments.record, log, LogRecorder::WhenBehind::wait);
        if (!started) return printError(started.error()), kBad;
        recorder = std::move(*started);
    }
    auto ticks = TickFile::create(arguments);
    if (!ticks) return printError(ticks.error()), kBad;
    Touching touching(arguments, running, *ticks, options);
    Result<> result = touching.attach();
    if (result && hand->port && !arguments.json)
        reportError("a device may send its places to udp:127.0.0.1:{}\n", hand->port);
    if (result && isLive) result = touching.live(std::move(hand->device), seconds);
    if (result && !isLive) touching.simulate(*hand->device, seconds);
    const HapticReport report = touching.renderer().report();
    if (result && !report.failure.empty()) result = fail(report.failure);
    running.scene().seal();
    if (recorder) result = allOf(programContext(), {[&] { return result; }, [&] { return recorder->stop(); }});
    result = allOf(programContext(), {[&] { return result; }, [&] { return ticks->finish(); }});
    print(report.diagnostics);
    running.reportDiagnostics();
    if (!result) return printError(result.error()), kBad;
    printTouched(arguments, report, running);
    if (report.scheduling != "SCHED_FIFO" && !report.scheduling.empty())
        reportError("note: touch runs on {}\n", report.scheduling);
    if (report.ticks == report.unknown) return printError("the device never said where the hand is"), kBad;
    if (!interrupted()) return kDone;
    printError(fmt::format("interrupted after {:.3f} s", running.time()));
    return kBad;
}

}  // namespace

Verb addTouch(Command& program) {
    auto options = std::make_shared<TouchArguments>();
    Command* command =
        program.addVerb("touch", "Simulate touch: forces and contacts on a hand, a thousand times a second");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command
        ->addOption("--device", options->device,
                    "sim:FILE.csv, a path of lines seconds,x,y,z; udp:PORT, where a driver sends places; or spnav, "
                    "a 3D mouse")
        ->required();
    command->addOption("-o,--output", options->out, "every tick as .csv, or drawn as .svg");
    command->addOption("--record", options->record,
                       "log of the session, contacts included (.rlog, or nats://HOST:PORT/NAME)");
    command->addOption("--for", options->duration, "how long; else as long as the path is, or until Ctrl-C");
    command->addOption("--fps", options->fps, "frames of the scene a second")->preset()->range(1., 1e4);
    command->addOption("--set", options->set,
                       "inject an event: DEF.field=VALUE@TIME, VALUE as in ClassicVRML; or pointer=, key=, text=, "
                       "wheel=, head=");
    {
        const Command::Section section(*command, "Touch");
        command->addOption("--rate", options->options.rate, "ticks a second")->preset()->range(1., 1e5);
        command->addOption("--radius", options->options.radius, "radius of the ball that touches, metres")
            ->preset()
            ->range(1e-4, 1.);
        command->addOption("--max-force", options->options.maxForce, "N")->preset()->range(0., 1e4);
        command->addOption("--stiffness", options->options.surface.stiffness, "N/m, for surfaces without a stiffness")
            ->preset()
            ->range(0., 1e6);
        command->addOption("--origin", options->origin, "position of the device's zero in the world: X Y Z")->preset();
        command->addOption("--scale", options->options.scale, "metres in the world for one of the device's")
            ->preset()
            ->range(1e-6, 1e6);
    }
    {
        const Command::Section section(*command, "Simulated hand");
        command
            ->addOption("--mass", options->mass,
                        "with sim: mass in kg of a hand that an arm holds to the path; 0: the hand is on the path")
            ->preset()
            ->range(0., 1e3);
        command->addOption("--arm-stiffness", options->stiffness, "with --mass: N/m")->preset()->range(0., 1e6);
        command->addOption("--arm-damping", options->damping, "with --mass: N s/m")->preset()->range(0., 1e6);
    }
    options->start.addTo(*command);
    options->resources.addTo(*command);
    command->addFlag("--realtime", options->realtime, "with sim: run in real time, on a thread of its own");
    command->addFlag("--force", options->force, "replace files that are there");
    command->addFlag("--json", options->json, "the summary as JSON");
    command->footer(
        "Example: rtsg touch examples/touch.x3dv --device sim:examples/knock.csv -o knock.svg --record knock.rlog\n"
        "Example: rtsg touch hall.x3dv --device udp:5571 --origin \"0 1.2 3\" --for 10s\n"
        "Surfaces say how they feel in the metadata of their Appearance: stiffness, damping, staticFriction and "
        "dynamicFriction in a MetadataSet named RTSG. TouchSensors answer to what is touched.");
    return {command, [options]() -> int {
                auto stored = StoredLog::start("--record", options->record, LogUse::write, options->force);
                if (!stored) return printError(stored.error()), kBad;
                return stored->finish(touch(*options));
            }};
}

}  // namespace rtsg::app
