#include <algorithm>
#include <memory>
#include <type_traits>

#include <fmt/format.h>

#include "bench/bench.h"
#include "bench/bench_sync.h"
#include "cli.h"

namespace rtsg::app {

namespace {

struct Bench {
    const char* name;
    const char* about;
    bool (*run)(const bench::Report& report, bool quick);
};

/// A bench that cannot fail as one that can.
template <void (*Run)(const bench::Report&, bool)>
bool always(const bench::Report& report, bool quick) {
    Run(report, quick);
    return true;
}
/// One of sync's, in the size asked for.
template <auto Run>
bool synced(const bench::Report& report, bool quick) {
    bench::SyncSizes sizes;
    if (quick) sizes = {.transforms = 1000, .frames = 100, .roundTrips = 200, .joinNodes = 20000};
    if constexpr (std::is_same_v<decltype(Run(sizes, report)), bool>) {
        return Run(sizes, report);
    } else {
        Run(sizes, report);
        return true;
    }
}

constexpr Bench kBenches[] = {
    {"read", "a ClassicVRML mesh of 2 M triangles: MB/s and peak memory", always<bench::read>},
    {"transform", "one animated Transform among many shapes: scene and bus work of a frame", always<bench::transform>},
    {"animated", "10,000 animated Transforms: cascade and change set", always<bench::animated>},
    {"changes", "a changed field on its way to three subscribers", always<bench::changes>},
    {"rays", "primary rays with shading against the bare intersections", bench::rays},
    {"codec", "encoding and decoding a changed field", synced<bench::codec>},
    {"mirror", "transform changes a second over loopback TCP, hash equal each frame", synced<bench::mirrorThroughput>},
    {"latency", "one change from newFrame() to the replica", synced<bench::mirrorLatency>},
    {"join", "a late joiner's verified replica", synced<bench::mirrorJoin>},
    {"log", "writing, scanning and replaying a log", synced<bench::logThroughput>},
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

}  // namespace

Verb addBench(CLI::App& program) {
    struct Options {
        std::vector<std::string> names;
        bool quick = false, list = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command =
        program.add_subcommand("bench", "Measure; each figure beside a baseline and a limit, as JSON lines");
    command->add_option("NAME", options->names, "benches to run; all if none is named");
    command->add_flag("--quick", options->quick, "smaller sizes, for a first look");
    command->add_flag("--list", options->list, "say what there is");
    command->footer("Example: rtsg bench transform mirror");
    return {
        command, [options] {
            for (const std::string& name : options->names)
                if (std::ranges::find(kBenches, name, &Bench::name) == std::end(kBenches)) {
                    printError(fmt::format("no bench is called {}; rtsg bench --list names them", name));
                    return static_cast<int>(kUsage);
                }
            bool good = true;
            for (const Bench& b : kBenches) {
                if (options->list)
                    fmt::print("{:<12} {}\n", b.name, b.about);
                else if (options->names.empty() || std::ranges::find(options->names, b.name) != options->names.end())
                    good = b.run(printLine, options->quick) && good;
            }
            return static_cast<int>(good ? kDone : kBad);
        }};
}

}  // namespace rtsg::app
