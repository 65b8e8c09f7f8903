// rtsg bench: runs benches by name, and prints their lines as JSON.
#include <algorithm>
#include <memory>
#include <type_traits>

#include <fmt/format.h>

#include "bench/bench.h"
#include "bench/bench_frames.h"
#include "bench/bench_nats.h"
#include "bench/bench_sync.h"
#include "bench/bench_sync_mirror.h"
#include "bench/bench_view.h"
#include "bench/scenes/scenes.h"
#include "cli.h"

namespace rtsg::app {

namespace {

struct Bench {
    const char* name;
    const char* group;  // the name of the group, which runs all but onlyByName
    const char* about;
    bool (*run)(const bench::Report& report, bool quick);
    bool onlyByName = false;  // takes minutes and gigabytes, or real time
};

/// Wraps a bench that cannot fail.
template <void (*Run)(const bench::Report&, bool)>
bool always(const bench::Report& report, bool quick) {
    Run(report, quick);
    return true;
}
/// Wraps one of sync's benches in the requested size.
template <auto Run>
bool synced(const bench::Report& report, bool quick) {
    bench::SyncSizes sizes;
    if (quick)
        sizes = {
            .transforms = 1000, .frames = 100, .roundTrips = 200, .joinNodes = 20000, .peers = 8, .hourFrames = 20000};
    if constexpr (std::is_same_v<decltype(Run(sizes, report)), bool>) {
        return Run(sizes, report);
    } else {
        Run(sizes, report);
        return true;
    }
}

bool frames(const bench::Report& report, bool quick) {
    return bench::frames({.scale = quick ? .01 : 1.0}, report);
}

constexpr Bench kBenches[] = {
    {"read", "scene", "a ClassicVRML mesh of 2 M triangles: MB/s and peak memory", always<bench::read>},
    {"documents", "scene", "one mesh in ClassicVRML, XML and JSON: MB/s", always<bench::documents>},
    {"transform", "scene", "one animated Transform among many shapes: scene and bus work of a frame",
     always<bench::transform>},
    {"animated", "scene", "10,000 animated Transforms: cascade and change set", always<bench::animated>},
    {"changes", "scene", "a changed field on its way to three subscribers", always<bench::changes>},
    {"structure", "scene", "adding, removing and moving one node of many; bytes a node", always<bench::structure>},
    {"runtime", "scene", "scripts, levels of detail, routes, sensors and followers by the thousand",
     always<bench::runtime>},
    {"rays", "light", "primary rays with shading against the bare intersections", bench::rays},
    {"paths", "light", "a room lit by panels until its picture is known to 5 %", always<bench::paths>},
    {"raster", "light", "the paper's scenes by OGRE: frames by deltas, pictures beside rays; needs a display",
     bench::raster, true},
    {"overlap", "world", "the next frame's cascade while this one is pictured, against one after the other",
     bench::overlap},
    {"frames", "light", "the paper's scenes: load, picture, work of a frame in three mappings; minutes", frames, true},
    {"instances", "world", "rays through 100,000 things that may move against one flat BVH", always<bench::instances>},
    {"stage", "world", "one world: light, sound, and readers on threads of their own", always<bench::stage>},
    {"export", "world", "one box of many moves: what writing it as MCAP adds", always<bench::exporting>},
    {"view", "light", "the window, walking through the demo's hall: pictures a second, key to picture, rest to whole",
     bench::view, true},
    {"features", "light", "Text, lines and points; what content costs that no ray meets", always<bench::features>},
    {"sound", "audio", "the acoustic tracer's rays against bare Embree; the time of a box's figures", bench::sound},
    {"deform", "world", "following a deforming mesh against a bare refit; rays against a rebuilt BVH",
     always<bench::deform>},
    {"touch", "world", "a tick of touch on a mesh of 100,352 triangles, still and moving", always<bench::touch>},
    {"feeds", "world", "from a click to a line in the user's code, by TCP and MQTT, beside both alone",
     bench::feedsLatency},
    {"codec", "sync", "encoding and decoding a changed field", synced<bench::codec>},
    {"input", "sync", "input mode: bytes and time of a frame that derives from the clock", synced<bench::input>},
    {"mirror", "sync", "transform changes a second over loopback TCP, hash equal each frame",
     synced<bench::mirrorThroughput>},
    {"latency", "sync", "one change from newFrame() to the replica", synced<bench::mirrorLatency>},
    {"join", "sync", "a late joiner's verified replica, and what it costs the scene", synced<bench::mirrorJoin>},
    {"resume", "sync", "from the return of a link to a replica in step", synced<bench::mirrorResume>},
    {"peers", "sync", "many replicas, and a part of them stopped", synced<bench::mirrorPeers>},
    {"crowd", "sync", "256 replicas at 60 frames a second; 1,024 beside a bare PUB socket", synced<bench::mirrorCrowd>},
    {"nats", "sync", "mirrors by way of NATS and by ZeroMQ, beside both alone", synced<bench::natsCrowd>},
    {"regions", "sync", "mirrors of what is near: a frame's cost by the size of the scene and the number of regions",
     synced<bench::mirrorRegions>},
    {"log", "sync", "a log: written, scanned, replayed, sought in; what it costs the scene", synced<bench::log>},
};

std::string figure(const std::string& name, double value) {
    return name.empty() ? "null" : fmt::format("{{\"name\":{},\"value\":{:.6g}}}", jsonString(name), value);
}

void printLine(const bench::Line& l) {
    fmt::print("{{\"bench\":{},\"case\":{},\"metric\":{},\"unit\":{},\"value\":{:.6g},\"baseline\":{},\"limit\":{}}}\n",
               jsonString(l.bench), jsonString(l.name), jsonString(l.metric), jsonString(l.unit), l.value,
               figure(l.baselineName, l.baseline), figure(l.limitName, l.limit));
    std::fflush(stdout);
}

int writeScenes(const bench::FrameOptions& options, const std::string& folder) {
    std::vector<std::string> names = options.scenes;
    if (names.empty())
        for (const bench::SceneInfo& s : bench::benchScenes()) names.emplace_back(s.name);
    for (const std::string& name : names) {
        const std::size_t plus = name.find("+teapot");
        const auto written =
            bench::writeBenchScene(name.substr(0, plus), options.scale, plus != std::string::npos, folder);
        if (!written) return printError(written.error()), kBad;
        fmt::print("{}: {} triangles\n", name, *written);
    }
    return kDone;
}

}  // namespace

Verb addBench(Command& program) {
    struct BenchArguments {
        std::vector<std::string> names;
        bool quick = false, list = false, json = false, features = false;
        bench::FrameOptions frames;
        std::string folder;
    };
    auto options = std::make_shared<BenchArguments>();
    Command* command = program.addVerb("bench", "Measure; each figure beside a baseline and a limit, as JSON lines");
    command->addOption("NAME", options->names,
                       "benches to run, or groups of them (scene, world, light, audio, sync); all if none is named");
    command->addFlag("--quick", options->quick, "smaller sizes, for a first look");
    command->addFlag(
        "--features", options->features,
        "with `light`: measure only the cost of picture features, used and not used (the bench `features`)");
    command->addFlag("--list", options->list, "list the names");
    command->addOption("--scene", options->frames.scenes,
                       "of `frames`: Beetles, Venice, Conference[+teapot], Campus[+teapot], Kitchen, Troopers, "
                       "Escherknot, City");
    command->addOption("--scale", options->frames.scale, "of `frames`: share of the triangles")->range(1e-4, 1.0);
    command->addOption("--write", options->folder,
                       "write the scenes of `frames` into this folder instead of measuring");
    command->addFlag("--json", options->json, "accepted, and the default");
    command->footer(
        "Example: rtsg bench transform mirror\nExample: rtsg bench sync --quick\nExample: rtsg bench frames --scene "
        "Campus+teapot --scale 0.1");
    return {command, [options] {
                for (const std::string& name : options->names)
                    if (std::ranges::find(kBenches, name, &Bench::name) == std::end(kBenches) &&
                        std::ranges::find(kBenches, name, &Bench::group) == std::end(kBenches)) {
                        printError(fmt::format("no bench is called {}; rtsg bench --list names them", name));
                        return static_cast<int>(kUsage);
                    }
                if (options->features) options->names = {"features"};
                const bool chosen = !options->frames.scenes.empty() || options->frames.scale < 1;
                if (!options->folder.empty()) return writeScenes(options->frames, options->folder);
                bool good = true;
                const auto ended = [&good](const char* name, bool well) {
                    if (!well) printError(fmt::format("bench {}: what it measures is wrong or late", name));
                    good = well && good;
                };
                for (const Bench& b : kBenches) {
                    if (options->list)
                        fmt::print("{:<12} {:<6} {}\n", b.name, b.group, b.about);
                    else if (chosen && b.run == frames)
                        ended("frames", bench::frames(options->frames, printLine));
                    else if ((options->names.empty() && !b.onlyByName && !chosen) ||
                             std::ranges::find(options->names, b.name) != options->names.end() ||
                             (std::ranges::find(options->names, b.group) != options->names.end() && !b.onlyByName))
                        ended(b.name, b.run(printLine, options->quick));
                }
                return static_cast<int>(good ? kDone : kBad);
            }};
}

}  // namespace rtsg::app
