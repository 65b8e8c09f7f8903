// rtsg chart: measures, and writes the results as CSV and SVG.
#include <algorithm>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "bench/bench_sync.h"
#include "bench/bench_sync_mirror.h"
#include "bench/charts.h"
#include "cli.h"

namespace rtsg::app {

namespace {

struct Source {
    const char* name;
    const char* about;
    bool (*measure)(const bench::ChartSink& sink, bool quick);
};

constexpr Source kSources[] = {
    {"frames", "the paper's scenes: a frame's cost in each mapping; minutes", bench::chartFrames},
    {"rays", "error of path-traced pictures against time", bench::chartRays},
    {"light",
     "error of a room lit by panels, and of scenes under a white sky, against time, beside Cycles and POV-Ray where "
     "they are installed",
     bench::chartLight},
    {"sound",
     "error of T20, C80, G and first arrivals in seven rooms against time, by images, rays, both and --error; moving "
     "sources "
     "against the time of a frame",
     bench::chartSound},
    {"heard",
     "error of what is heard against CPU time in a box, a hall, coupled rooms, an office and a corridor, by --quality",
     bench::chartHeard},
    {"sound-parts",
     "what each mechanism of diffraction brings behind screens, corners, doors, tables, columns and cars, beside "
     "boundary elements",
     bench::chartSoundParts},
    {"sync", "bytes of a change against error and time by coding and mode; replicas and late joins of a mirror",
     [](const bench::ChartSink& sink, bool quick) {
         const bool coded = bench::chartCodec(sink, quick);
         return bench::chartMirror(sink, quick) && coded;
     }},
    {"scale", "work of one change in scenes of 10^3 to 10^6 nodes", bench::chartScale},
    {"touch", "the stiffest surface that does not ring, and the error of forces, against the rate of touch",
     bench::chartTouch},
    {"view",
     "error of pictures of the demo's hall against time, by resolution and samples; by OGRE, too, with a display",
     bench::chartView},
    {"deform", "speed of rays through deforming meshes against rebuilt ones", bench::chartDeform},
};

struct ChartArguments {
    std::vector<std::string> names;
    std::string folder;
    bool quick = false, list = false, json = false;
};

int chart(const ChartArguments& options) {
    for (const std::string& name : options.names)
        if (std::ranges::find(kSources, name, &Source::name) == std::end(kSources)) {
            printError(fmt::format("no chart is called {}; rtsg chart --list names them", name));
            return kUsage;
        }
    if (options.list) {
        for (const Source& s : kSources) fmt::print("{:<12} {}\n", s.name, s.about);
        return kDone;
    }
    if (options.folder.empty()) {
        printError("say where to write: -o DIR");
        return kUsage;
    }
    bool good = true;
    const auto write = [&](const bench::Chart& c) {
        if (const Result<> result = bench::writeChart(c, options.folder); !result) {
            printError(result.error());
            good = false;
        } else if (options.json) {
            fmt::print("{{\"chart\":{},\"title\":{},\"series\":{},\"folder\":{}}}\n", jsonString(c.name),
                       jsonString(c.title), c.series.size(), jsonString(options.folder));
        } else {
            fmt::print("{}/{}.svg: {}\n", options.folder, c.name, c.title);
        }
        std::fflush(stdout);
    };
    for (const Source& s : kSources) {
        if (!options.names.empty() && std::ranges::find(options.names, s.name) == options.names.end()) continue;
        if (!s.measure(write, options.quick)) {
            printError(fmt::format("{} could not be measured", s.name));
            good = false;
        }
    }
    return good ? kDone : kBad;
}

}  // namespace

Verb addChart(Command& program) {
    auto options = std::make_shared<ChartArguments>();
    Command* command = program.addVerb("chart", "Measure speed against accuracy or size; CSV and pictures");
    command->addOption("NAME", options->names, "charts to make; all if none is named");
    command->addOption("-o,--output", options->folder, "folder for NAME.svg and NAME.csv");
    command->addFlag("--quick", options->quick, "smaller sizes, for a first look");
    command->addFlag("--list", options->list, "list the names");
    command->addFlag("--json", options->json, "a line of JSON for each chart written");
    command->footer("Example: rtsg chart scale -o out/charts");
    return {command, [options] { return chart(*options); }};
}

}  // namespace rtsg::app
