// Charts "frames": the figures of rtsg bench frames, a row a scene.
#include <fmt/format.h>

#include "bench/scenes/scenes.h"
#include "bench_frames.h"
#include "charts.h"

namespace rtsg::bench {

namespace {

Chart chartOf(const std::string& name, const std::string& title, const std::string& note, Axis x, bool traversal) {
    Chart chart{name, title, note, std::move(x), {}, {}, {}};
    for (const char* mapping : kMappingNames) chart.series.push_back({mapping, {}});
    if (traversal) chart.series.push_back({"full traversal", {}});
    return chart;
}

}  // namespace

bool chartFrames(const ChartSink& sink, bool quick) {
    FrameOptions options;
    if (quick) options.scale = .01, options.width = 320, options.height = 180, options.budget = .2;
    const std::string size = fmt::format("{} x {}", options.width, options.height);
    Chart update =
        chartOf("frames-update", "Following one frame: from the clock's tick to a BVH ready for rays",
                "Cascade, change set, flattener and update of the ray world; scenes that move. CPU time of "
                "the scene's thread, medians, competitors in turn. Bare Embree: commit of what moves, or refit.",
                {"time (µs)", true}, true);
    update.series.push_back({"bare Embree", {}, true});
    Chart rays = chartOf("frames-rays", "Primary rays through each mapping, against one flat scene of bare Embree",
                         fmt::format("Time for {} rays in packets of 16, divided by rtcIntersect16's for the same rays "
                                     "on the same triangles. CPU time of one thread, medians of 5, in turn.",
                                     size),
                         {"time, 1 = bare rtcIntersect16", false, false}, false);
    Chart total = chartOf("frames-total", "A whole frame: follow the scene, then trace its primary rays",
                          fmt::format("{} rays; CPU time of one thread, medians, competitors in turn.", size),
                          {"time (ms)", true}, true);
    Chart memory = chartOf("frames-memory", "What tracing costs in memory beside the scene's own arrays",
                           "BVH, copies and records of instances, per triangle of the distinct meshes.",
                           {"bytes a triangle", true}, false);
    memory.series.push_back({"arrays of the scene", {}, true});
    bool good = true;
    const auto measure = [&](const std::string& name) {
        const auto f = measureFrames(name, options);
        if (!f) {
            fmt::print(stderr, "{}\n", f.error().format());
            good = false;
            return;
        }
        const auto row = static_cast<double>(total.rows.size()), tested = static_cast<double>(rays.rows.size());
        const bool moves = f->moved + f->deformed > 0;
        const auto moving = static_cast<double>(update.rows.size());
        const double work = f->sceneWork + f->flatten;
        for (std::size_t i = 0; i < kMappings.size(); ++i) {
            if (f->trace[i] == 0) continue;
            if (moves) update.series[i].points.push_back({(work + f->update[i]) * 1e6, moving, {}});
            if (f->flatTrace > 0) rays.series[i].points.push_back({f->trace[i] / f->flatTrace, tested, {}});
            total.series[i].points.push_back({(work + f->update[i] + f->trace[i]) * 1e3, row, {}});
            const RayWorld::Memory& m = f->memory[i];
            memory.series[i].points.push_back({static_cast<double>(m.bvhBytes + m.copyBytes + m.instanceBytes) /
                                                   static_cast<double>(std::max<std::uint64_t>(1, f->uniqueTriangles)),
                                               row,
                                               {}});
        }
        // The baseline traces the world that it updates, a hybrid one.
        total.series[3].points.push_back({(f->sceneWork + f->fullUpdate + f->trace[0]) * 1e3, row, {}});
        memory.series[3].points.push_back({f->memory[0].sceneBytesPerTriangle(), row, {}});
        for (Chart* chart : {&total, &memory}) chart->rows.push_back(f->scene);
        if (f->flatTrace > 0) rays.rows.push_back(f->scene);
        if (!moves) return;
        update.series[3].points.push_back({(f->sceneWork + f->fullUpdate) * 1e6, moving, {}});
        if (f->smallestUpdate > 0) update.series[4].points.push_back({f->smallestUpdate * 1e6, moving, {}});
        update.rows.push_back(f->scene);
    };
    for (const SceneInfo& s : benchScenes()) {
        measure(s.name);
        if (s.teapotScale > 0) measure(std::string(s.name) + "+teapot");
    }
    for (const Chart& chart : {update, rays, total, memory}) sink(chart);
    return good;
}

}  // namespace rtsg::bench
