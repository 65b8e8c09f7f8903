// rtsg run: the cascade of a scene in simulated time, with events sent and watched.
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/scene_builder.h>

#include "cli.h"
#include "injections.h"

namespace rtsg::app {

namespace {

struct Options {
    std::string scene, duration = "1s";
    double fps = 60;
    std::vector<std::string> watch, set;
    ResourceArguments resources;
    bool realtime = false, hash = false, json = false;
};

/// "DEF.field", "DEF.*" or "*"; empty field: all of the node's.
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

int run(const Options& options) {
    Scene scene;
    Diagnostics diagnostics(options.scene);
    const Resources resources = options.resources.ofFile(options.scene);
    if (!load(scene, options.scene, diagnostics, resources)) return kBad;
    auto injections = Injections::parse(scene, options.set);
    if (!injections) return printError(injections.error().text), kUsage;
    std::vector<Watch> watches;
    for (const std::string& text : options.watch) {
        const auto watch = parseWatch(scene, text);
        if (!watch) return printError(watch.error().text), kUsage;
        watches.push_back(*watch);
    }
    if (!watches.empty())
        scene.setEventListener([&](double t, const Node& node, FieldIndex field, const Value& value) {
            for (const Watch& w : watches)
                if ((!w.node || w.node == node.id()) && (w.field == kNoField || w.field == field)) {
                    fmt::print("{{\"t\":{},\"node\":{},\"field\":{},\"value\":{}}}\n", t,
                               jsonString(nodeLabel(scene, node.id())), jsonString(node.type().fields[field].name),
                               printFieldText(value, TextSyntax::json));
                    return;
                }
        });
    Diagnostics inlineDiagnostics(options.scene);
    BuildOptions build;
    build.resources = resources;
    if (options.scene != "-") build.file = options.scene;
    InlineLoader inlines(scene, inlineDiagnostics, build);
    const double duration = parseSeconds(options.duration);
    const auto frames = static_cast<std::uint64_t>(std::floor(duration * options.fps + 1e-9)) + 1;
    const auto start = std::chrono::steady_clock::now();
    const Progress progress = progressBar("running " + options.scene);
    for (std::uint64_t frame = 0; frame < frames; ++frame) {
        const double t = static_cast<double>(frame) / options.fps;
        if (options.realtime) std::this_thread::sleep_until(start + std::chrono::duration<double>(t));
        injections->sendUntil(t);
        const auto set = scene.newFrame(t);
        if (options.hash) fmt::print("{{\"frame\":{},\"t\":{},\"hash\":\"{}\"}}\n", frame, t, set->hash.hex());
        inlines.update();
        if (progress) progress(frame + 1, frames);
    }
    print(inlineDiagnostics);
    print(scene.diagnostics());
    if (progress) progress(1, 1);
    // Text would be in the way of whoever reads the events; a summary in JSON is one line more.
    if (options.json)
        fmt::print("{{\"frames\":{},\"t\":{},\"hash\":\"{}\"}}\n", frames, scene.now(), scene.hash().hex());
    else if (watches.empty() && !options.hash)
        fmt::print("{} frames to t = {} s, state {}\n", frames, scene.now(), scene.hash().hex());
    return kDone;
}

}  // namespace

Verb addRun(CLI::App& program) {
    auto options = std::make_shared<Options>();
    CLI::App* command = program.add_subcommand("run", "Run the event cascade in simulated time from 0");
    command->add_option("SCENE", options->scene, "scene file, or -")->required();
    command->add_option("--for", options->duration, "how long, such as 2s")->capture_default_str();
    command->add_option("--fps", options->fps, "frames a second")->capture_default_str()->check(CLI::Range(1e-3, 1e6));
    command->add_option("--watch", options->watch, "print every event of DEF.field, DEF.* or *");
    command->add_option("--set", options->set, "inject an event: DEF.field=VALUE@TIME, VALUE as in ClassicVRML");
    options->resources.addTo(*command);
    command->add_flag("--realtime", options->realtime, "one second a second");
    command->add_flag("--hash", options->hash, "print the state hash of every frame");
    command->add_flag("--json", options->json, "the summary as JSON, after the events if any are watched");
    command->footer(
        "Example: rtsg run door.x3dv --for 2s --fps 60 --watch DOOR.rotation --set PRESSED.set_boolean=TRUE@0.5");
    return {command, [options] { return run(*options); }};
}

}  // namespace rtsg::app
