// rtsg run: runs a scene in simulated time, sends events to it, and prints watched ones.
#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/running_scene.h>

#include "cli.h"
#include "feeds.h"
#include "output_arguments.h"
#include "say.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct RunArguments {
    std::string scene, duration = "1s";
    double fps = 60;
    std::vector<std::string> watch, set;
    OutputArguments outputs;
    StartTime start;
    NetworkArguments network;
    FeedArguments feeds;
    bool realtime = false, reload = false, hash = false, json = false;
};

/// "DEF.field", "DEF.*" or "*". With an empty field all fields of the node.
struct Watch {
    NodeId node;
    FieldIndex field = kNoField;
};

Result<Watch> parseWatch(const Scene& scene, const std::string& text) {
    if (text == "*") return Watch{};
    if (text.ends_with(".*")) {
        const NodeId node = scene.findName(text.substr(0, text.size() - 2));
        if (!node) return fail(fmt::format("{}: no node has that name", text));
        return Watch{node, kNoField};
    }
    const auto field = findField(scene, text);
    if (!field) return std::unexpected(field.error());
    return Watch{field->node, field->field};
}

Result<std::vector<Watch>> parseWatches(const Scene& scene, const std::vector<std::string>& texts) {
    std::vector<Watch> watches;
    for (const std::string& text : texts) {
        const auto watch = parseWatch(scene, text);
        if (!watch) return std::unexpected(watch.error());
        watches.push_back(*watch);
    }
    return watches;
}

/// True if it watches events that a Text sends by itself.
bool isOfTexts(const Scene& scene, const Watch& watch) {
    using T = x3d::Text;
    const auto isOne = [&](auto... fields) { return ((watch.field == fields.index) || ...); };
    if (watch.node && !scene.node(watch.node).is(T::type)) return false;
    return watch.field == kNoField || isOne(T::lineBounds, T::origin, T::textBounds);
}

void printEvents(RunningScene& running, const std::vector<Watch>& watches) {
    if (std::ranges::any_of(watches, [&](const Watch& one) { return isOfTexts(running.scene(), one); }))
        running.measureAllTexts();
    running.scene().setEventListener([&](double, const Node& node, FieldIndex field, const Value& value) {
        for (const Watch& w : watches)
            if ((!w.node || w.node == node.id()) && (w.field == kNoField || w.field == field)) {
                fmt::print("{{\"t\":{},\"node\":{},\"field\":{},\"value\":{}}}\n", running.time(),
                           jsonString(labelOf(running.scene(), node.id())), jsonString(node.type().fields[field].name),
                           printFieldText(value, TextSyntax::json));
                return;
            }
    });
}

/// Makes pictures, sound and the saved scene, from the first frame on.
class RunOutputs {
  public:
    RunOutputs(RunningScene& running, const RunArguments& options) : running_(running), arguments_(options.outputs) {
        arguments_.picturesPerSecond = options.fps;
        arguments_.seconds = parseSeconds(options.duration);
    }
    /// Call it after each frame. Returns false if going on is useless.
    bool follow(std::uint64_t frame) {
        if (!arguments_.any()) return !interrupted();
        if (frame == 0) {
            arguments_.sound.document = running_.file();
            auto attached = refusingUsage(makeOutputs(running_.world(), arguments_.options(), running_.resources()));
            if (!attached) {
                printError(attached.error());
                return false;
            }
            outputs_ = std::move(*attached);
        }
        return outputs_->frame() && !interrupted();
    }
    /// Returns false, after reporting it, if something that was asked for is missing.
    bool finish(bool complete) {
        if (!complete && interrupted() && !(outputs_ && outputs_->failed()))
            printError(fmt::format("interrupted after {} of {} s", running_.time(), arguments_.seconds));
        if (!arguments_.any()) return complete;
        if (!outputs_) return false;
        bool good = complete;
        if (auto ok = outputs_->finish(); !ok) {
            printError(ok.error());
            good = false;
        }
        report_ = outputs_->report();
        if (!report_->missing.empty()) {
            printError("missing: " + report_->missing);
            good = false;
        }
        return good;
    }
    std::string json() const { return report_ ? report_->json() : std::string(); }

  private:
    RunningScene& running_;
    OutputArguments arguments_;
    std::unique_ptr<OutputMaker> outputs_;
    std::optional<OutputReport> report_;
};

/// Checks the viewpoint of pictures. Returns false if it does not exist and cannot come later.
bool checkViewpoint(const Scene& scene, const OutputArguments& outputs) {
    const std::string& name = outputs.picture.viewpoint;
    if (name.empty() || outputs.render.empty()) return true;
    bool known = false, mayCome = false;
    std::string all;
    scene.forEachNode([&](const Node& node) {
        mayCome = mayCome || node.type().isA("X3DScriptNode") || node.is(x3d::Inline::type);
        if (!node.type().isA("X3DViewpointNode")) return;
        const FieldIndex field = node.type().findExact("description");
        const String description = field == kNoField ? String() : node.get(Field<String>{field});
        const std::string_view own = scene.name(node.id());
        known = known || own == name || description.view() == name;
        all += fmt::format("{}\"{}\"", all.empty() ? "" : ", ", own.empty() ? description.view() : own);
    });
    if (known) return true;
    const std::string text = fmt::format("no viewpoint is called \"{}\"{}; there are: {}", name,
                                         mayCome ? " as yet" : "", all.empty() ? "none" : all);
    if (!mayCome) return printError(text), false;
    reportError("note: {}\n", terminalText(text));
    return true;
}

int runScene(const RunArguments& options) {
    const Pace pace{parseSeconds(options.duration), options.fps, options.realtime || options.outputs.isLive()};
    options.feeds.check(options.scene, true);
    if (auto ok = options.outputs.check({options.scene}); !ok) return printError(ok.error()), kBad;
    ResourceArguments resources = options.outputs.resources;
    resources.inBackground = pace.realtime;
    RunningScene running(options.scene, resources.ofFile(options.scene), options.start.options(), programContext());
    running.scene().setThreads(options.outputs.picture.threads);
    running.allowNetwork(options.network.dis);
    if (options.reload) orUsageError(running.followEdits());
    if (!running.load()) return kBad;
    Scene& scene = running.scene();
    keepResources(scene, running.resources(), options.outputs.names());
    if (!checkViewpoint(scene, options.outputs)) return kBad;
    if (auto ok = refusingUsage(running.inject(options.set, pace.seconds)); !ok) return printError(ok.error()), kUsage;
    const auto watches = parseWatches(scene, options.watch);
    if (!watches) return printError(watches.error()), kUsage;
    if (!watches->empty()) printEvents(running, *watches);
    RunOutputs created(running, options);
    (void)interrupted();  // from here on an interruption ends the program in order and cuts no line
    auto feeds = Feeds::start(options.feeds, running.world(), {.start = running.start(), .timed = true});
    if (!feeds) return printError(feeds.error()), kBad;
    running.beforeFrames([&](double t) { feeds->before(t); });
    const std::uint64_t frames = running.run(pace, "running " + options.scene, [&](std::uint64_t k, const auto& set) {
        feeds->after(running.time());
        if (options.hash) fmt::print("{{\"frame\":{},\"t\":{},\"hash\":\"{}\"}}\n", k, running.time(), set.hash.hex());
        return created.follow(k);
    });
    running.beforeFrames({});
    running.reportDiagnostics();
    feeds->end();
    const bool good = created.finish(frames == pace.frames());
    // Readers of the events do not want other text; a summary in JSON is one more line for them.
    if (options.json)
        fmt::print("{{\"frames\":{},\"t\":{},\"hash\":\"{}\"{}{}}}\n", frames, running.time(), scene.hash().hex(),
                   created.json(), feeds->json());
    else if (watches->empty() && !options.hash)
        fmt::print("{} to t = {} s, state {}\n", framesText(frames), running.time(), scene.hash().hex());
    return good ? kDone : kBad;
}

}  // namespace

Verb addRun(Command& program) {
    auto options = std::make_shared<RunArguments>();
    Command* command = program.addVerb("run", "Run the event cascade in simulated time");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command->addOption("--for", options->duration, "how long, such as 2s")->preset();
    command->addOption("--fps", options->fps, "frames a second, and pictures of --render")->preset()->range(1e-3, 1e6);
    command->addOption("--watch", options->watch, "print every event of DEF.field, DEF.* or *");
    command->addOption(
        "--set", options->set,
        "inject an event: DEF.field=VALUE@TIME, VALUE as in ClassicVRML; or pointer=, key=, text=, wheel=, head=");
    options->start.addTo(*command);
    options->outputs.addTo(*command, OutputArguments::Options::ofRun);
    options->network.addTo(*command);
    options->feeds.addTo(*command);
    command->addFlag("--realtime", options->realtime, "one second a second");
    command->addFlag("--reload", options->reload, "follow the scene's file whenever it has been edited");
    command->addFlag("--hash", options->hash, "print the state hash of every frame");
    command->addFlag("--json", options->json, "the summary as JSON, after the events if any are watched");
    command->footer(
        "Example: rtsg run door.x3dv --for 2s --fps 60 --watch DOOR.rotation --set PRESSED.set_boolean=TRUE@0.5\n"
        "Example: rtsg run hall.x3dv --for 2s --fps 25 --render out/%03d.png --size 320x180 --listen out/hall.wav\n"
        "Ctrl-C before the end leaves films, sounds, a picture of the last state and the saved scene unwritten.");
    return {command, [options] { return runScene(*options); }};
}

}  // namespace rtsg::app
