// Paths: how long a room lit by panels takes until its picture is known to five percent, and what many lamps cost
// against one. One thread.
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

#include "bare_embree.h"
#include "bench.h"
#include "charts.h"
#include "cycles.h"
#include "panel_room.h"
#include "path_rays.h"
#include "pov_ray.h"
#include "under_sky.h"

namespace rtsg::bench {

namespace {

constexpr double kError = 0.05;

struct Known {
    double seconds = 0, error = 0;
    PathRayCounts rays;
};

/// The picture of a room sampled until `error` or `most` samples a pixel.
Known picture(int lamps, bool mirrors, int side, double error, int maximum, bool seen = true) {
    Scene scene;
    Diagnostics diagnostics;
    loadText(scene, panelRoom(lamps, mirrors, seen), diagnostics);
    SharedWorld world(scene);
    LightRenderer light(world);
    scene.newFrame(0);
    const ImageOptions options = pathOptions(side, error, maximum);
    RenderStats stats;
    const double start = cpuSeconds();
    keep(light.picture(options, &stats));
    return {cpuSeconds() - start,
            stats.error,
            {static_cast<double>(stats.primaryRays), static_cast<double>(stats.secondaryRays),
             static_cast<double>(stats.shadowRays)}};
}

/// CPU seconds that Embree alone takes for the rays of a picture: as many of each kind, through the same room.
double raysAlone(int lamps, int side, const PathRayCounts& counts, bool seen = true) {
    Scene scene;
    Diagnostics diagnostics;
    loadText(scene, panelRoom(lamps, false, seen), diagnostics);
    SharedWorld world(scene);
    scene.newFrame(0);
    PathRays::Lamps positions{lampMiddles(lamps), static_cast<float>(lampHalf(lamps))};
    // Any direction of view has rays like another's in it.
    const PathRays rays(world.rays(), {{0, 0, 1.9f}, seen ? 1.0f : .8f}, positions, side, 4, counts);
    return rays.minSeconds(world.rays(), counts);
}

/// The same room by Cycles: from what some samples reach, as all of its pixels get the same number.
void besideCycles(const Report& report, const Known& ours, int side, double alone) {
    const auto cycles = hasCycles() ? cyclesRoom(side, 64) : std::nullopt;
    std::string name = "room lit by 2 panels, beside Cycles";
    if (!cycles) name += hasCycles() ? " (blender could not make it)" : " (blender is not installed)";
    report({"paths", name, "CPU time to 5 % relative error", "s", ours.seconds,
            cycles ? "Cycles of Blender " + cycles->version : std::string(),
            cycles ? cycles->seconds * std::pow(cycles->error / kError, 2) : 0,
            "the same kinds of rays through bare Embree", alone});
}

/// Scenes of `rtsg bench frames` in the open, and the share of their triangles that is enough here.
struct Outdoors {
    const char *name, *file;
    double scale;
};
constexpr Outdoors kOutdoors[] = {
    {"Beetles", "beetles", .1}, {"Venice", "venice", .1}, {"Campus", "campus", .1}, {"City", "city", .01}};

/// Where a scene lies for Cycles, as long as it is asked.
struct SceneForCycles {
    std::filesystem::path file =
        std::filesystem::temp_directory_path() / fmt::format("rtsg_under_sky_{}.bin", ::getpid());
    explicit SceneForCycles(const UnderSky& scene) { scene.write(file); }
    SceneForCycles(const SceneForCycles&) = delete;
    SceneForCycles& operator=(const SceneForCycles&) = delete;
    ~SceneForCycles() { std::filesystem::remove(file); }
};

void underSky(const Report& report, int side) {
    for (const Outdoors& one : kOutdoors) {
        const UnderSky scene(one.name, one.scale);
        const UnderSky::Known ours = scene.picture(side, 0, 64);
        std::string name = fmt::format("{}, {} triangles, under a white sky", one.name, scene.triangles());
        const auto cycles = hasCycles() ? cyclesScene(SceneForCycles(scene).file, side, 64) : std::nullopt;
        if (!cycles) name += hasCycles() ? " (blender could not make it)" : " (blender is not installed)";
        report({"paths", name, "CPU time to 5 % relative error", "s", ours.seconds * std::pow(ours.error / kError, 2),
                cycles ? "Cycles of Blender " + cycles->version : std::string(),
                cycles ? cycles->seconds * std::pow(cycles->error / kError, 2) : 0, "", 0});
        if (cycles)
            report({"paths", name, "mean of the picture", "1", ours.mean, "Cycles of Blender " + cycles->version,
                    cycles->mean, "", 0});
    }
}

}  // namespace

void paths(const Report& report, bool quick) {
    const int side = quick ? 48 : 128;
    const Known known = picture(2, false, side, kError, 1 << 16);
    // The error by bounces alone, extrapolated from 64 samples: it falls with the square root of the time. Light that
    // few samples have not met yet is missing in it, so this is the least time.
    const Known bounced = picture(2, true, side, 1e-6, quick ? 64 : 256);
    const double bouncedSeconds = bounced.seconds * bounced.error * bounced.error / (kError * kError);
    const double alone = raysAlone(2, side, known.rays);
    report({"paths", "room lit by 2 panels", "CPU time to 5 % relative error", "s", known.seconds, "bounces alone",
            bouncedSeconds, "the same kinds of rays through bare Embree", alone});
    if (!quick) {
        besideCycles(report, known, side, alone);
        underSky(report, side);
    }
    const Known many = picture(1000, false, side, kError, 1 << 16);
    report({"paths", "room lit by 1,000 lamps", "CPU time to 5 % relative error", "s", many.seconds, "2 panels",
            known.seconds, "the same kinds of rays through bare Embree", raysAlone(1000, side, many.rays)});
    const Known one = picture(1, false, side, kError, 1 << 16, false),
                unseen = picture(1000, false, side, kError, 1 << 16, false);
    report({"paths", "room lit by 1,000 lamps out of sight", "CPU time to 5 % relative error", "s", unseen.seconds,
            "one lamp", one.seconds, "the same kinds of rays through bare Embree",
            raysAlone(1000, side, unseen.rays, false)});
}

namespace {

Chart lightChart(const std::string& name, const std::string& title, int side) {
    return {"light-" + name,
            title,
            fmt::format("{0} x {0} pixels, CPU time of one thread; relative standard error, root mean square over "
                        "the pixels. Labelled with samples a pixel, or with the error that was asked for.",
                        side),
            {"time (s)", true},
            {"relative error of a pixel", true},
            {{"path, all pixels alike", {}}, {"path with --error", {}}},
            {}};
}

/// Another program's, of which it is said when it made no picture.
void addOther(Chart& chart, Series series, const char* program) {
    if (series.points.empty()) {
        chart.note += fmt::format(" {} is installed and could not make it.", program);
        return;
    }
    chart.series.push_back(std::move(series));
}

void chartUnderSky(const ChartSink& sink, const Outdoors& one, bool quick) {
    const int side = quick ? 24 : 96, maximum = quick ? 16 : 256;
    const UnderSky scene(one.name, one.scale * (quick ? .1 : 1));
    Chart chart = lightChart(
        one.file, fmt::format("{} under a white sky, {} triangles: error against time", one.name, scene.triangles()),
        side);
    chart.note += " With flattening and BVH; whitted, which follows no light between things, is off from the truth.";
    Picture truth;
    for (int samples = 4; samples <= maximum; samples *= 4) {
        UnderSky::Known known = scene.picture(side, 0, samples);
        chart.series[0].points.push_back({known.seconds, known.error, std::to_string(samples)});
        truth = std::move(known.picture);
    }
    for (double error = .2; error > (quick ? .1 : .02); error /= 2) {
        const UnderSky::Known known = scene.picture(side, error, 1 << 14);
        chart.series[1].points.push_back({known.seconds, known.error, fmt::format("{:g}", error)});
    }
    const UnderSky::Known whitted = scene.whitted(side, truth);
    chart.series.push_back({"whitted", {{whitted.seconds, whitted.error, {}}}});
    if (!quick && hasCycles()) {
        Series cycles{"Cycles, all pixels alike", {}};
        const SceneForCycles given(scene);
        for (int samples = 4; samples <= maximum; samples *= 4)
            if (const auto created = cyclesScene(given.file, side, samples)) {
                cycles.name = "Cycles of Blender " + created->version + ", all pixels alike";
                cycles.points.push_back({created->seconds, created->error, std::to_string(samples)});
            }
        addOther(chart, std::move(cycles), "Cycles");
    } else if (!quick) {
        chart.note += " Cycles is not installed.";
    }
    if (!quick && hasPovRay()) {
        Series povRay{"POV-Ray, radiosity", {}};
        const auto file = std::filesystem::temp_directory_path() / fmt::format("rtsg_under_sky_{}.pov", ::getpid());
        scene.writePov(file);
        for (const int rays : {20, 100})
            if (const auto created = povRayScene(file, side, rays)) {
                povRay.name = "POV-Ray " + created->version + ", radiosity";
                const double error = UnderSky::errorFrom(created->picture, truth);
                povRay.points.push_back({created->seconds, error, std::to_string(rays)});
            }
        std::filesystem::remove(file);
        addOther(chart, std::move(povRay), "POV-Ray");
    } else if (!quick) {
        chart.note += " POV-Ray is not installed.";
    }
    sink(chart);
}

}  // namespace

bool chartLight(const ChartSink& sink, bool quick) {
    const int side = quick ? 24 : 96, maximum = quick ? 64 : 1024;
    Chart chart = lightChart("room", "A room lit by two panels: error against time", side);
    for (int samples = 16; samples <= maximum; samples *= 4) {
        const Known known = picture(2, false, side, 1e-6, samples);
        chart.series[0].points.push_back({known.seconds, known.error, std::to_string(samples)});
    }
    for (double error = .2; error > (quick ? .1 : .02); error /= 2) {
        const Known known = picture(2, false, side, error, 1 << 16);
        chart.series[1].points.push_back({known.seconds, known.error, fmt::format("{:g}", error)});
    }
    // Panels that only a bounce may find.
    Series bounces{"path without asking for lights", {}};
    for (int samples = 16; samples <= maximum; samples *= 4) {
        const Known known = picture(2, true, side, 1e-6, samples);
        bounces.points.push_back({known.seconds, known.error, std::to_string(samples)});
    }
    chart.series.push_back(std::move(bounces));
    if (!quick && hasCycles()) {
        Series cycles{"Cycles, all pixels alike", {}};
        for (int samples = 16; samples <= maximum; samples *= 4)
            if (const auto created = cyclesRoom(side, samples)) {
                cycles.name = "Cycles of Blender " + created->version + ", all pixels alike";
                cycles.points.push_back({created->seconds, created->error, std::to_string(samples)});
            }
        addOther(chart, std::move(cycles), "Cycles");
    } else if (!quick) {
        chart.note += " Cycles is not installed.";
    }
    sink(chart);
    for (const Outdoors& one : kOutdoors) chartUnderSky(sink, one, quick);
    chartLightParts(sink, quick);
    return true;
}

}  // namespace rtsg::bench
