// Bench "stage", readers: states of the world for readers on other threads, what they cost the scene, and how long it
// is held up while a picture is always under way.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <shared_mutex>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

#include "bench_stage.h"
#include "scene/acoustic_tables.h"

namespace rtsg::bench {

std::string manyBoxes(int count) {
    const int side = std::max(1, static_cast<int>(std::ceil(std::cbrt(count))));
    std::string text =
        "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 0 9 }\n"
        "Sound { source OscillatorSource { frequency 440 } }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "DEF B{0} Transform {{ translation {1} {2} {3} children {4} }}\n", i, 3 * (i % side), 3 * (i / side % side),
            -3 * (i / side / side),
            i == 0 ? "DEF S Shape { appearance Appearance { material Material { } } geometry Box { } }" : "USE S");
    return text;
}

namespace {

ListenOptions quietly() {
    ListenOptions options;
    options.metrics = options.sound = false;
    options.render.ambisonicOrder = 1;  // no sound library needed
    return options;
}

LightRenderer::Options pictureOf(int width, int height, unsigned threads) {
    LightRenderer::Options options;
    options.image.settings.width = width, options.image.settings.height = height;
    options.image.settings.threads = threads;
    return options;
}

/// Boxes on a world with light and sound; one moves a frame.
struct Moving {
    explicit Moving(int n, LightRenderer::Options picture = pictureOf(64, 36, 1)) : count(n) {
        Diagnostics diagnostics;
        (void)loadText(scene, manyBoxes(n), diagnostics);
        world = std::make_unique<SharedWorld>(
            scene, SharedWorld::Options{.flattening = {}, .rays = {}, .delivery = Delivery::immediate, .timed = true});
        light = std::make_unique<LightRenderer>(*world, std::move(picture));
        sound = std::make_unique<SoundRenderer>(*world, quietly());
        for (int i = 0; i < count; i += std::max(1, count / 64))
            movers.push_back(scene.findName(fmt::format("B{}", i)));
    }
    void frame() {
        const NodeId mover = movers[static_cast<std::size_t>(frames) % movers.size()];
        const double t = ++frames / 60.0;
        Vec3f position = scene.node(mover).get(x3d::Transform::translation);
        position.x += .01f * static_cast<float>(frames % 7 - 3);
        (void)scene.set(mover, x3d::Transform::translation, position);
        scene.newFrame(t);
    }
    int count, frames = 0;
    Scene scene;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<LightRenderer> light;
    std::unique_ptr<SoundRenderer> sound;
    std::vector<NodeId> movers;
};

double quantile(std::vector<double> values, double fraction) {
    std::ranges::sort(values);
    return values.empty() ? 0 : values[static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1))];
}

void handingOver(const Report& report, int count, int moves) {
    Moving boxes(count);
    const double clock = cpuClockSeconds();
    std::vector<double> rays, alone, beside, handed, taken;
    // Each box twice before anything counts: one that moves for the first time leaves what rests.
    for (int i = 0; i < 150; ++i) boxes.frame();
    for (int i = 0; i < moves; ++i) {
        boxes.frame();
        rays.push_back(boxes.world->times().rays);
        alone.push_back(boxes.world->times().rays + boxes.world->times().subscribers);
    }
    std::shared_ptr<const WorldState> held;
    for (int i = 0; i < moves; ++i) {
        const double start = threadSeconds();
        if (auto state = boxes.world->latest({})) held = *state;
        taken.push_back(threadSeconds() - start);
        boxes.frame();
        const SharedWorld::Times& times = boxes.world->times();
        handed.push_back(times.handingOver);
        beside.push_back(times.rays + times.subscribers + times.handingOver);
    }
    const double start = threadSeconds();
    std::vector<RayInstance> copy(boxes.world->rays().instances().begin(), boxes.world->rays().instances().end());
    keep(copy.data());
    const double plain = threadSeconds() - start;
    const double from = threadSeconds();
    for (int i = 0; i < 1000; ++i) keep(std::make_shared<WorldState>());
    const double minimum = (threadSeconds() - from) * 1e3;
    const double anew = threadSeconds();
    {
        SharedWorld other(boxes.scene);
        LightTracer tracer;
        AcousticTables tables(other.rays());
        other.add(tracer);
        other.add(tables);
    }
    const double scratch = (threadSeconds() - anew) * 1e6;
    const std::string which = fmt::format("one box of {} moves", count);
    const double bvh = (median(rays) - clock) * 1e6;
    report({"stage", which, "light and sound together", "us", (median(alone) - 2 * clock) * 1e6, "all anew", scratch,
            "the BVH alone", bvh});
    report({"stage", which, "light and sound together, with a reader of every state", "us",
            (median(beside) - 3 * clock) * 1e6, "all anew", scratch, "the BVH alone", bvh});
    report({"stage", which, "handing over a state, on the scene's thread", "us", (median(handed) - clock) * 1e6,
            "a copy of all instances", plain * 1e6, "a shared object", minimum});
    report({"stage", which, "taking a state, on the reader's thread", "us", (median(taken) - clock) * 1e6,
            "a copy of all instances", plain * 1e6, "a shared object", minimum});
}

/// Threads that trace, as long as this lives. Some of them take every state of a world; the others trace in a world
/// that rests. So the machine is equally busy however many readers there are, and only what they cost the scene
/// differs.
class Tracing {
  public:
    Tracing(const SharedWorld& world, const SharedWorld& resting, int threads) {
        for (int number = 0; number < threads; ++number)
            threads_.emplace_back([this, &world, &resting, number] { run(world, resting, number); });
    }
    ~Tracing() { stop_ = true; }
    /// How many take states from now on.
    void setReaders(int readers) { readers_ = readers; }

  private:
    void run(const SharedWorld& world, const SharedWorld& resting, int number) {
        while (!stop_) {
            const auto state = (number < readers_ ? world : resting).latest(std::chrono::milliseconds(20));
            if (!state) continue;
            for (int i = 0; i < 200; ++i)
                keep((*state)->rays->intersect({{0, 0, 9}, 0, {.001f * static_cast<float>(i), .1f, -1}}));
            std::this_thread::sleep_for(std::chrono::microseconds(500));
        }
    }

    std::atomic<bool> stop_{false};
    std::atomic<int> readers_{0};
    std::vector<std::jthread> threads_;
};

/// The scene's thread beside three threads that trace, of which some take every state.
void manyReaders(const Report& report, int count, int moves) {
    constexpr int kMax = 3, kMovesOfARound = 10, kSettling = 2;
    Moving boxes(count), resting(count);
    for (int i = 0; i < 150; ++i) boxes.frame(), resting.frame();
    (void)resting.world->present();
    Tracing tracing(*boxes.world, *resting.world, kMax);
    std::array<std::vector<double>, kMax + 1> seconds;
    // In turns, so that what else the machine does meets all alike.
    for (int round = 0; round * kMovesOfARound < moves; ++round)
        for (int order = 0; order <= kMax; ++order) {
            const int readers = (order + round) % (kMax + 1);
            tracing.setReaders(readers);
            for (int i = 0; i < kSettling + kMovesOfARound; ++i) {
                std::this_thread::sleep_for(std::chrono::milliseconds(4));  // all of them have the last state by then
                boxes.frame();
                if (i >= kSettling) seconds[static_cast<std::size_t>(readers)].push_back(boxes.world->times().all());
            }
        }
    for (std::size_t readers = 2; readers <= kMax; ++readers)
        report({"stage", fmt::format("one box of {} moves", count), fmt::format("update with {} readers", readers),
                "us", median(seconds[readers]) * 1e6, "one reader", median(seconds[1]) * 1e6, "no reader",
                median(seconds[0]) * 1e6});
}

/// The time in a frame in which the scene's thread waits, at 60 Hz: wall time less its own CPU time. It includes the
/// time for which the system takes the thread off a core, so the same is measured beside work that shares nothing.
std::vector<double> waits(Moving& boxes, int frames, const std::function<void(std::atomic<bool>&)>& work,
                          std::shared_mutex* lock = nullptr) {
    std::atomic<bool> stop{false};
    std::jthread worker([&] { work(stop); });
    std::vector<double> seconds;
    for (int i = 0; i < frames; ++i) {
        std::this_thread::sleep_for(std::chrono::microseconds(16'667));
        const double wall = wallSeconds(), cpu = threadSeconds();
        if (lock) lock->lock();
        boxes.frame();
        if (lock) lock->unlock();
        seconds.push_back(std::max(0.0, wallSeconds() - wall - (threadSeconds() - cpu)));
    }
    stop = true;
    return seconds;
}

void waitForPictures(const Report& report, bool quick) {
    const int frames = quick ? 20 : 600;
    Moving boxes(quick ? 100 : 1000, pictureOf(quick ? 64 : 1280, quick ? 36 : 720, 0));
    for (int i = 0; i < 150; ++i) boxes.frame();
    std::atomic<int> pictures{0};
    const auto picture = [&](std::atomic<bool>& stop) {
        while (!stop)
            if (const auto state = boxes.world->latest(std::chrono::milliseconds(20)))
                pictures += boxes.light->renderFrame(**state).has_value();
    };
    std::shared_mutex mutex;
    LightRenderer other(*boxes.world, pictureOf(quick ? 64 : 1280, quick ? 36 : 720, 0));
    const auto locking = [&](std::atomic<bool>& stop) {
        while (!stop) {
            const std::shared_lock lock(mutex);
            const auto camera = other.tracer().camera(boxes.world->rays(), 16 / 9.);
            if (camera)
                keep(other.tracer().render(boxes.world->rays(), *camera,
                                           pictureOf(quick ? 64 : 1280, quick ? 36 : 720, 0).image.settings));
        }
    };
    // Threads that share nothing with the scene, as many as a picture uses.
    const auto burn = [](std::atomic<bool>& stop) {
        std::vector<std::jthread> threads;
        for (unsigned i = 0; i < std::max(1u, std::thread::hardware_concurrency()); ++i)
            threads.emplace_back([&stop] {
                for (double x = 1; !stop; x = std::sqrt(x + 1)) keep(x);
            });
    };
    const std::vector<double> states = waits(boxes, frames, picture), machine = waits(boxes, frames, burn),
                              locked = waits(boxes, frames / 10 + 1, locking, &mutex);
    const char* const which = "a picture of 1280x720 is always under way";
    const auto line = [&](const char* metric, double fraction) {
        report({"stage", which, metric, "ms", quantile(states, fraction) * 1e3, "a lock for each picture",
                quantile(locked, fraction) * 1e3, "beside work that shares nothing",
                quantile(machine, fraction) * 1e3});
    };
    line("the scene's wait, p50", .5);
    line("the scene's wait, p99", .99);
    line("the scene's wait, worst", 1);
    report({"stage", which, "pictures meanwhile", "", static_cast<double>(pictures), "", 0, "", 0});
}

}  // namespace

void stageReaders(const Report& report, bool quick) {
    for (const int count : quick ? std::vector{100} : std::vector{100, 10'000, 100'000})
        handingOver(report, count, quick ? 50 : 400);
    manyReaders(report, quick ? 100 : 10'000, quick ? 50 : 1000);
    waitForPictures(report, quick);
}

}  // namespace rtsg::bench
