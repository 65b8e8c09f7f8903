// Bench "sound": the acoustic tracer's rays against bare Embree on the same triangles and the same rays, and the time
// that the figures of a box take.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <fmt/format.h>

#include <rtsg/audio/live_sound.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/parallel_for.h>
#include <rtsg/renderers/shared_world.h>

#include "bare_embree.h"
#include "bench.h"
#include "geometry/world_geometry.h"
#include "rays/acoustic_tracer.h"
#include "scene/acoustic_tables.h"
#include "scenes/scenes.h"
#include "signal/convolver.h"
#include "sound_rooms.h"

namespace rtsg::bench {

namespace {

template <class Run>
void onOneThread(const Run& run) {
    withThreads(1, run);
}

/// Notes what a tracer asks.
class RayList final : public AcousticGeometry {
  public:
    RayList(const AcousticGeometry& geometry, const RayView& rays) : geometry_(&geometry), rays_(&rays) {}
    mutable std::vector<AskedRay> asked;

    std::span<const ReflectingPlane> planes() const override { return geometry_->planes(); }
    std::span<const AcousticMaterial> materials() const override { return geometry_->materials(); }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        note(origin, direction, maxDistance, false);
        return geometry_->closest(origin, direction, maxDistance, except, hit);
    }
    bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction, double distance,
                 std::uint32_t except) const override {
        note(origin + 1e-5 * facing, direction, distance - 2e-5, true);
        return geometry_->blocked(origin, facing, direction, distance, except);
    }
    std::uint32_t closestOf(const AcousticRays& rays, AcousticHits& hits) const override {
        for (int i = 0; i < rays.count; ++i)
            note(rays.origin[i] + 1e-5 * rays.facing[i], rays.direction[i], rays.maxDistance[i], false);
        return geometry_->closestOf(rays, hits);
    }
    std::uint32_t blockedOf(const AcousticRays& rays) const override {
        for (int i = 0; i < rays.count; ++i)
            note(rays.origin[i] + 1e-5 * rays.facing[i], rays.direction[i], rays.maxDistance[i] - 2e-5, true);
        return geometry_->blockedOf(rays);
    }
    double distanceToSurface(const glm::dvec3& point) const override { return geometry_->distanceToSurface(point); }
    void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const override {
        geometry_->surfacesNear(point, radius, visit);
    }

    Passage passage(const glm::dvec3& a, const glm::dvec3& b) const override { return geometry_->passage(a, b); }
    void visitEdges(const EdgeVisitor& visit) const override { geometry_->visitEdges(visit); }
    void visitRoundBodies(const RoundVisitor& visit) const override { geometry_->visitRoundBodies(visit); }

  private:
    void note(const glm::dvec3& origin, const glm::dvec3& direction, double maximum, bool any) const {
        Ray ray;
        ray.origin = rays_->fromWorld(origin);
        ray.direction = Vec3f(direction);
        ray.tMin = 1e-5f;
        ray.tMax = static_cast<float>(std::min(maximum, 1e9));
        asked.push_back({ray, any});
    }
    const AcousticGeometry* geometry_;
    const RayView* rays_;
};

/// `connected`: images of the listener are looked for too, as by default. All that the tracer asks counts as a ray, for
/// it as for bare Embree: to walls, to listeners and to their images.
void rayRatios(const Report& report, SoundRoom& hall, bool connected, bool quick) {
    TraceOptions options;
    options.rays = quick ? 320 : 3200;
    options.imageOrder = 0;
    options.diffractionOrder = 0;  // rays alone
    if (!connected) options.connectedOrder = 0;
    const std::string name = hall.name + (connected ? ", images of the listener looked for" : "");
    options.maxSeconds = 2;
    options.air.absorbs = false;
    const RayView& rays = hall.world->rays();
    const RayList list(hall.geometry, rays);
    onOneThread([&] { AcousticTracer(list).trace(hall.source, hall.listener, options); });
    const FlatScene robust(hall.world->rays()), fast(hall.world->rays(), false);
    const int runs = quick ? 1 : 7;
    std::vector<double> traced, asked, bareRobust, bareFast, barePackets;
    std::vector<double> ofRobust, ofBest,
        ofPackets;  // of each run: what else the machine does changes from one to the next
    for (int run = 0; run < runs; ++run) {
        double start = cpuSeconds();
        onOneThread([&] { keep(AcousticTracer(hall.geometry).trace(hall.source, hall.listener, options).rays); });
        traced.push_back(cpuSeconds() - start);
        start = cpuSeconds();
        for (const AskedRay& a : list.asked) {
            AcousticHit hit;
            const glm::dvec3 origin = rays.toWorld(a.ray.origin), direction(a.ray.direction);
            if (a.any)
                keep(
                    hall.geometry.blocked(origin, glm::dvec3(0), direction, static_cast<double>(a.ray.tMax), kNoPlane));
            else
                keep(hall.geometry.closest(origin, direction, static_cast<double>(a.ray.tMax), kNoPlane, hit));
        }
        asked.push_back(cpuSeconds() - start);
        bareRobust.push_back(robust.trace(list.asked));
        bareFast.push_back(fast.trace(list.asked));
        barePackets.push_back(robust.traceInPackets(list.asked));
        ofRobust.push_back(bareRobust.back() / traced.back());
        ofBest.push_back(std::min(bareRobust.back(), bareFast.back()) / traced.back());
        ofPackets.push_back(barePackets.back() / traced.back());
    }
    const auto count = static_cast<double>(list.asked.size());
    const auto rate = [&](std::vector<double>& seconds) { return count / median(seconds) * 1e-6; };
    const double best = std::max(rate(bareFast), rate(bareRobust));
    report({"sound", name, "rays of the tracer", "M/s", rate(traced), "bare Embree, robust", rate(bareRobust),
            "bare Embree, best flags", best});
    report({"sound", name, "questions of the tracer, one by one", "M/s", rate(asked), "bare Embree, robust",
            rate(bareRobust), "bare Embree, best flags", best});
    // The tracer's BVH is robust: rays go through no edge.
    report({"sound", name, "rays of the tracer / bare on the same BVH", "1", median(ofRobust), "", 0, "asked for", .8});
    report({"sound", name, "rays of the tracer / bare, best flags", "1", median(ofBest), "", 0, "", 0});
    report({"sound", name, "rays of the tracer / bare on the same BVH, sixteen at a time", "1", median(ofPackets), "",
            0, "", 0});
}

/// CPU time of a result for each of five listeners beside that for one, and what sharing costs their intervals.
void severalListeners(const Report& report, const SoundRoom& hall, bool quick) {
    const auto fraction = [&](double a, double b, double c) {
        return glm::mix(hall.source, hall.listener, .5) + glm::dvec3(a, b, c) * (hall.listener - hall.source);
    };
    const std::vector<glm::dvec3> five{hall.listener, fraction(-.3, .4, 0), fraction(.4, -.3, .1),
                                       fraction(.1, .2, -.1), fraction(.5, .3, .2)};
    TraceOptions options;
    options.rays = quick ? 1600 : 10'000;
    options.air.absorbs = false;
    const AcousticTracer tracer(hall.geometry);
    std::vector<double> one, all, separate, wider;
    onOneThread([&] {
        for (int run = 0; run < (quick ? 1 : 3); ++run) {
            options.seed = static_cast<std::uint64_t>(run) + 1;
            double start = cpuSeconds();
            std::vector<TraceResult> apart;
            for (const glm::dvec3& position : five) {
                apart.push_back(tracer.trace(hall.source, position, options));
                if (apart.size() == 1) one.push_back(cpuSeconds() - start);
            }
            separate.push_back(cpuSeconds() - start);
            start = cpuSeconds();
            const std::vector<TraceResult> shared = tracer.trace(hall.source, five, options);
            all.push_back(cpuSeconds() - start);
            double squares = 0;
            for (const auto figure : {&RoomMetrics::t20, &RoomMetrics::c80, &RoomMetrics::g}) {
                double alone = 0, together = 0;
                for (std::size_t i = 0; i < five.size(); ++i) {
                    alone += std::pow((apart[i].metrics().ci95.*figure)[kBand1k], 2);
                    together += std::pow((shared[i].metrics().ci95.*figure)[kBand1k], 2);
                }
                squares += together / alone / 3;
            }
            wider.push_back(std::sqrt(squares));
        }
    });
    report({"sound", hall.name, "five listeners, CPU time", "ms", 1e3 * median(all), "one after the other",
            1e3 * median(separate), "one listener", 1e3 * median(one)});
    report({"sound", hall.name, "five listeners / one", "1", median(all) / median(one), "", 0, "asked for", 1.3});
    report(
        {"sound", hall.name, "five listeners, intervals of T20, C80 and G / alone", "1", median(wider), "", 0, "", 0});
    // What one would take with as many rays as give each of the five the interval it has alone.
    report({"sound", hall.name, "five listeners / one, of equal intervals", "1",
            median(all) * median(wider) * median(wider) / median(one), "one after the other",
            median(separate) / median(one), "", 0});
}

/// Wall time on all cores until T20 is good to 1 % and levels to .1 dB.
void figures(const Report& report, SoundRoom& hall, bool quick) {
    TraceOptions options;
    options.air.absorbs = false;
    for (const std::uint64_t rays : {std::uint64_t{400}, std::uint64_t{1600}, std::uint64_t{6400}}) {
        options.rays = rays;
        std::vector<double> seconds, parts, cpu, t20, g;
        for (int run = 0; run < (quick ? 1 : 25); ++run) {
            options.seed = static_cast<std::uint64_t>(run) + 1;
            const double start = wallSeconds(), cpuStart = cpuSeconds();
            const TraceResult result = AcousticTracer(hall.geometry).trace(hall.source, hall.listener, options);
            const double middle = wallSeconds();
            const MetricsEstimate m = result.metrics();
            seconds.push_back(wallSeconds() - start);
            parts.push_back(middle - start);
            cpu.push_back(cpuSeconds() - cpuStart);
            t20.push_back(100 * std::abs(m.value.t20[kBand1k] / 1.109 - 1));
            g.push_back(std::abs(m.value.g[kBand1k] - 25.315));
        }
        const std::string name = fmt::format("{} with {} rays", hall.name, rays);
        report({"sound", name, "time of the figures", "ms", 1e3 * median(seconds), "tracing alone", 1e3 * median(parts),
                "asked for", 30});
        report(
            {"sound", name, "CPU time of the figures", "ms", 1e3 * median(cpu), "", 0, "asked for, on two cores", 60});
        report({"sound", name, "error of T20", "%", median(t20), "", 0, "asked for", 1});
        report({"sound", name, "error of G", "dB", median(g), "", 0, "asked for", .1});
        if (quick) return;
    }
}

}  // namespace

namespace {

constexpr const char* kMovingVoice =
    "DEF Voice Transform { children Sound { location 1 1 1.5 maxBack 60 maxFront 60 source OscillatorSource { "
    "frequency "
    "440 } } }\nViewpoint { position 4 3 1.5 }\n";

/// Beside underruns: sound that is ready 40 ms ahead cannot do without both cores for longer.
constexpr const char* kStolen = "ms of a core that the machine's host took meanwhile";

/// A moving source on OpenAL's silent device while every core is busy with other things, in real time.
bool live(const Report& report, bool quick) {
    ::setenv("ALSOFT_DRIVERS", "null", 1);
    Scene scene;
    Diagnostics diagnostics;
    if (!loadText(scene, boxScene(.5) + kMovingVoice, diagnostics)) return false;
    SharedWorld world(scene);
    std::vector<std::jthread> busy;
    for (unsigned i = 0; i < std::max(2u, std::thread::hardware_concurrency()); ++i)
        busy.emplace_back([](const std::stop_token& stop) {
            double x = 1;
            while (!stop.stop_requested())
                for (int k = 0; k < 1000; ++k) keep(x = std::sqrt(x + k));
        });
    auto heard = LiveSound::start(world, {});
    if (!heard) return false;
    const double begin = wallSeconds(), stolen = stolenSeconds(), seconds = quick ? .3 : 10;
    for (double t = 0; t < seconds; t = wallSeconds() - begin) {
        static_cast<void>(scene.set(scene.findName("Voice"), x3d::Transform::translation,
                                    Vec3f(static_cast<float>(std::sin(t)), 0, 0)));
        scene.newFrame(t);
        std::this_thread::sleep_for(std::chrono::milliseconds(16));
    }
    const LiveReport reported = (*heard)->stop();
    const std::string name = "live, every core busy";
    report({"sound", name, "latency, the largest", "ms", 1e3 * reported.latencySeconds, "", 0, "asked for", 50});
    report({"sound", name, "underruns", "1", static_cast<double>(reported.underruns), kStolen,
            1e3 * (stolenSeconds() - stolen), "asked for", 0});
    report({"sound", name, "share of a core that its thread takes", "1", reported.busy, "", 0, "all of it", 1});
    return reported.failure.empty();
}

/// What a response of 2 s takes of a core, a channel.
void convolution(const Report& report, bool quick) {
    constexpr int kRate = 48'000;
    constexpr std::size_t kBlock = 512;
    std::vector<float> response(2 * kRate), input(kBlock), output(kBlock);
    for (std::size_t i = 0; i < response.size(); ++i)
        response[i] = std::sin(static_cast<float>(i * i % 1009)) * std::exp(-3e-5f * static_cast<float>(i));
    for (std::size_t i = 0; i < kBlock; ++i) input[i] = std::cos(static_cast<float>(i));
    Convolver convolver(kBlock);
    convolver.setResponse(response);
    for (int i = 0; i < 4; ++i) convolver.process(input, output);  // it fades in
    std::vector<double> fractions;
    for (int run = 0; run < (quick ? 1 : 9); ++run) {
        const int blocks = quick ? 20 : 500;
        const double start = cpuSeconds();
        for (int i = 0; i < blocks; ++i) convolver.process(input, output);
        fractions.push_back((cpuSeconds() - start) * kRate / (blocks * static_cast<double>(kBlock)));
        keep(output[0]);
    }
    report({"sound", "one channel", "share of a core that a response of 2 s takes", "1", median(fractions), "", 0,
            "asked for", .01});
}

/// 32 sources that move in a box at 60 Hz, in real time on OpenAL's silent device: CPU time of all of it, and of frames
/// on the scene's thread.
bool movingSources(const Report& report, bool quick) {
    const std::optional<MovingSound> moved = moveSources(32, quick ? .3 : 20);
    if (!moved) return false;
    const std::vector<double>& frames = moved->frames;
    report(
        {"sound", "32 moving sources, live", "cores that all of it takes", "1", moved->cores, "", 0, "asked for", 1});
    report({"sound", "32 moving sources, live", "frame of the scene's thread, the longest, CPU time", "ms",
            1e3 * *std::max_element(frames.begin(), frames.end()), "median", 1e3 * median(frames), "asked for", 2});
    report({"sound", "32 moving sources, live", "underruns", "1", static_cast<double>(moved->reported.underruns),
            kStolen, 1e3 * moved->stolen, "asked for", 0});
    return moved->reported.failure.empty();
}

}  // namespace

bool sound(const Report& report, bool quick) {
    if (!live(report, quick) || !movingSources(report, quick)) return false;
    convolution(report, quick);
    Diagnostics diagnostics;
    SoundRoom box;
    box.name = "box";
    if (!loadText(box.scene, boxScene(.5), diagnostics)) return false;
    box.start();
    rayRatios(report, box, false, quick);
    rayRatios(report, box, true, quick);
    figures(report, box, quick);
    severalListeners(report, box, quick);
    const std::filesystem::path folder = std::filesystem::temp_directory_path() / "rtsg_bench_sound";
    std::filesystem::create_directories(folder);
    const auto written = writeBenchScene("Conference", quick ? .02 : .5, false, folder);
    SoundRoom hall;
    hall.name = "conference room";
    const bool loaded = written && loadFile(hall.scene, (folder / "Conference.x3dv").string(), diagnostics);
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
    if (!loaded) return false;
    hall.start();
    const Bounds bounds = hall.world->rays().bounds();
    const glm::dvec3 low = hall.world->rays().toWorld(bounds.min), high = hall.world->rays().toWorld(bounds.max);
    hall.source = glm::mix(low, high, glm::dvec3(.3, .6, .4));
    hall.listener = glm::mix(low, high, glm::dvec3(.7, .55, .6));
    rayRatios(report, hall, false, quick);
    severalListeners(report, hall, quick);
    return true;
}

}  // namespace rtsg::bench
