// rtsg info: prints the content of a scene or a log.
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include <rtsg/core/terminal.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/sync/log_summary.h>

#include "cli.h"
#include "extensions.h"
#include "files.h"
#include "log_store.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct Counts {
    std::size_t nodes = 0, protos = 0, scripts = 0, sounds = 0, instances = 0, triangles = 0;
    std::map<std::string, std::size_t> components;
};

Counts count(const Scene& scene) {
    Counts c;
    scene.forEachNode([&](const Node& node) {
        if (node.id() == scene.root()) return;
        ++c.nodes;
        const NodeType& type = node.type();
        if (type.isA("X3DScriptNode")) ++c.scripts;
        if (type.name == "Sound" || type.name == "SpatialSound") ++c.sounds;
        if (type.kind == NodeType::Kind::builtin) ++c.components[type.component];
    });
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i) {
        const auto kind = scene.type(TypeIndex{static_cast<std::uint16_t>(i)}).kind;
        if (kind == NodeType::Kind::proto || kind == NodeType::Kind::externProto) ++c.protos;
    }
    return c;
}

struct InfoArguments {
    std::string file, shown;  // the file, and how it is named to the user
    ResourceArguments resources;
    bool json = false;
};

std::string asJson(const std::map<std::string, std::size_t>& counts) {
    std::string out;
    for (const auto& [name, n] : counts) out += fmt::format("{}{}:{}", out.empty() ? "" : ",", jsonString(name), n);
    return "{" + out + "}";
}

void printCounts(const std::map<std::string, std::size_t>& counts) {
    for (const auto& [name, n] : counts) fmt::print("    {:<24} {:>7} nodes\n", terminalText(name), n);
}

/// Counts the triangles of all instances: a mesh that is used twice counts twice.
void countTriangles(Scene& scene, const Resources& resources, Counts& c) {
    SharedWorld world(scene, worldOptions(resources));  // no rays are asked for: no BVH is built
    extensions().registerWith(world);
    const InstanceDelta all = world.flattener().snapshot();
    std::map<NodeId, std::size_t> triangles;
    for (const auto& geometry : all.geometries)
        if (geometry.mesh) triangles[geometry.node] = geometry.mesh->triangleCount;
    for (const Instance& instance : all.added) {
        if (instance.boundingBox) continue;
        ++c.instances;
        c.triangles += triangles[instance.geometry];
    }
    print(world.diagnostics());
}

int describeScene(const InfoArguments& options) {
    Scene scene;
    Diagnostics diagnostics(options.file);
    const Resources resources = options.resources.ofFile(options.file);
    const bool ok = load(scene, options.file, diagnostics, resources);
    std::error_code error;
    if (!ok && options.file != "-" && !std::filesystem::exists(options.file, error))
        return kBad;  // load() has reported that
    Counts c = count(scene);
    countTriangles(scene, resources, c);
    const std::string profile = scene.node(scene.root()).get(x3d::RtsgScene::profile).str();
    if (options.json) {
        fmt::print(
            "{{\"nodes\":{},\"routes\":{},\"triangles\":{},\"instances\":{},\"protos\":{},\"scripts\":{},"
            "\"sounds\":{},\"profile\":{},\"components\":{},\"errors\":{},\"warnings\":{}}}\n",
            c.nodes, scene.routeCount(), c.triangles, c.instances, c.protos, c.scripts, c.sounds, jsonString(profile),
            asJson(c.components), diagnostics.errors(), diagnostics.warnings());
        return ok ? kDone : kBad;
    }
    fmt::print(
        "{}\n  profile    {}\n  nodes      {}\n  routes     {}\n  shapes     {}\n  triangles  {}\n"
        "  protos     {}\n  scripts    {}\n  sounds     {}\n  problems   {} errors, {} warnings\n  components\n",
        terminalText(options.file), profile.empty() ? "none named" : terminalText(profile), c.nodes, scene.routeCount(),
        c.instances, c.triangles, c.protos, c.scripts, c.sounds, diagnostics.errors(), diagnostics.warnings());
    printCounts(c.components);
    return ok ? kDone : kBad;
}

/// Says how many frames are missing, and how many are in the wrong order.
std::string gapsText(const LogSummary& log) {
    std::string text = log.gaps > 0 ? fmt::format(", {} missing", framesText(log.missingFrames)) : "";
    if (log.framesBehind > 0)
        text += fmt::format("; {} of earlier states: pieces are in another order than they were written in",
                            framesText(log.framesBehind));
    return text;
}

int describeLog(const InfoArguments& options) {
    const auto log = summariseLog(options.file);
    if (!log) return printError(log.error()), kBad;
    const double duration = std::round((log->end - log->start) * 1e6) / 1e6;
    if (options.json) {
        fmt::print(
            "{{\"states\":{},\"frames\":{},\"keyframes\":{},\"inputs\":{},\"sessions\":{},\"first_state\":{},\"last_"
            "state\":{},"
            "\"t\":{},\"begins\":{},\"duration_s\":{},\"bytes\":{},\"damaged\":{},\"damaged_bytes\":{},\"gaps\":{},"
            "\"missing_"
            "frames\":{},\"frames_behind\":{},\"closed\":{},\"goes_on\":{},"
            "\"being_written\":{},\"mode\":{},"
            "\"coding\":{},\"creator\":{},\"nodes\":{},\"types\":{}}}\n",
            log->states, log->frames, log->keyframes, log->inputs, log->sessions, log->firstState, log->lastState,
            log->start, jsonString(dateText(log->start)), duration, log->bytes, log->damaged, log->damagedBytes,
            log->gaps, log->missingFrames, log->framesBehind, log->closed, log->goesOn, log->beingWritten,
            jsonString(log->mode), jsonString(log->coding), jsonString(log->creator), log->nodes, asJson(log->types));
    } else {
        fmt::print(
            "{}\n  states     {}, {} to {}\n  keyframes  {}\n  inputs     {}\n  sessions   {}\n"
            "  time       {} s, from {} on\n  bytes      {}\n  damage     {} places, {} bytes{}\n"
            "  gaps       {}{}\n"
            "  mode       {}, coding {}, written by {}\n  nodes      {} in the last state\n",
            terminalText(options.shown), log->states, log->firstState, log->lastState, log->keyframes, log->inputs,
            log->sessions, duration, dateText(log->start), log->bytes, log->damaged, log->damagedBytes,
            log->beingWritten ? "; it is still being written"
            : log->closed     ? ""
            : log->goesOn     ? "; the session goes on in a next piece"
                              : "; it was not closed in order",
            log->gaps, gapsText(*log), terminalText(log->mode), terminalText(log->coding), terminalText(log->creator),
            log->nodes);
        printCounts(log->types);
        reportOfPieces(options.file);
    }
    return log->damaged + log->gaps + log->framesBehind == 0 ? kDone : kBad;
}

}  // namespace

Verb addInfo(Command& program) {
    auto options = std::make_shared<InfoArguments>();
    Command* command = program.addVerb("info", "Print the content of a scene or a log");
    command->addOption("FILE", options->file, "scene file, log, folder of a log's pieces, or - for a scene")
        ->required();
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "one JSON object");
    command->footer(
        "Example: rtsg info --json hall.x3dv\n"
        "Example: rtsg info hall.rlog\n"
        "Exit status 1 for a scene with errors, or a log with damage or missing frames.");
    return {command, [options]() -> int {
                options->shown = shownLog(options->file);
                const auto log = fetchLog("FILE", options->file);
                if (!log) return printError(log.error()), kBad;
                return isLogOrNamedSo(options->file) ? describeLog(*options) : describeScene(*options);
            }};
}

}  // namespace rtsg::app
