// Touch: what a tick costs on a large mesh, and charts of stiffness and error against the rate of ticks.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/haptics/haptic_renderer.h>

#include "bench.h"
#include "chart.h"
#include "charts.h"

namespace rtsg::bench {

namespace {

constexpr int kSide = 224;          // quads; twice their square are 100,352 triangles
constexpr double kSpacing = 0.005;  // metres

/// Waves of a metre, 5 cm high.
double waveAt(double x, double z) {
    return .05 * std::sin(2 * std::numbers::pi * x) * std::cos(2 * std::numbers::pi * z);
}

/// A ground to touch: waves, or flat.
class Ground {
  public:
    Ground(bool isWavy, const HapticOptions& options) {
        using G = x3d::ElevationGrid;
        const NodeId grid = scene.createNode(G::type), shape = scene.createNode(x3d::Shape::type);
        position_ = scene.createNode(x3d::Transform::type);
        const int points = isWavy ? kSide + 1 : 2;
        const auto spacing = static_cast<float>(isWavy ? kSpacing : 1);
        std::vector<float> heights;
        for (int z = 0; z < points; ++z)
            for (int x = 0; x < points; ++x)
                heights.push_back(isWavy ? static_cast<float>(waveAt(x * kSpacing, z * kSpacing)) : 0);
        (void)scene.set(grid, G::xDimension, points);
        (void)scene.set(grid, G::zDimension, points);
        (void)scene.set(grid, G::xSpacing, spacing);
        (void)scene.set(grid, G::zSpacing, spacing);
        (void)scene.set(grid, G::height, Array<float>(std::move(heights)));
        (void)scene.set(shape, x3d::Shape::geometry, grid);
        (void)scene.insertChild(position_, x3d::Transform::children, shape);
        (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, position_);
        world.emplace(scene);
        scene.newFrame(0);
        renderer.emplace(*world, options);
        (void)renderer->attachToScene(scene);
        (void)renderer->renderFrame();
        (void)world->present();
    }
    void move(double seconds, float x) {
        (void)scene.set(position_, x3d::Transform::translation, Vec3f(x, 0, 0));
        scene.newFrame(seconds);
    }
    void frame(double seconds, float x) {
        move(seconds, x);
        (void)world->present();
    }

    Scene scene;
    std::optional<SharedWorld> world;
    std::optional<HapticRenderer> renderer;

  private:
    NodeId position_;
};

double percentile(std::vector<double>& values, double fraction) {
    const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::ranges::nth_element(values, values.begin() + at);
    return values[static_cast<std::size_t>(at)];
}

void ticks(const Report& report, bool moves, int count) {
    Ground ground(true, {});
    std::vector<double> times, alone;
    for (int i = 0; i < count; ++i) {
        const double t = 1e-3 * i, angle = 2 * t;  // a circle of .3 m, .6 m/s
        const double x = .55 + .3 * std::cos(angle), z = .55 + .3 * std::sin(angle);
        if (moves && i % 16 == 0) ground.frame(t, static_cast<float>(.05 * std::sin(t)));
        const Vec3d hand(x, waveAt(x, z) + .002, z);
        const double start = threadSeconds();
        (void)ground.renderer->touch(hand, t);
        times.push_back(1e6 * (threadSeconds() - start - cpuClockSeconds()));
        const RayWorld& rays = ground.world->rays();
        const double asked = threadSeconds();
        rays.visitNear(rays.fromWorld(hand), .007f, [](std::uint32_t, std::uint32_t) { return .007f; });
        alone.push_back(1e6 * (threadSeconds() - asked - cpuClockSeconds()));
    }
    const std::string name = moves ? "100,352 triangles that move" : "100,352 triangles at rest";
    const double bare = percentile(alone, .5);
    for (const auto& [fraction, metric] :
         {std::pair{.5, "a tick, median"}, {.999, "a tick, 1 in 1,000"}, {1., "a tick, worst"}})
        report({"touch", name, metric, "us", percentile(times, fraction), "the clock's millisecond", 1000,
                "finding the triangles", bare});
}

/// CPU time of the scene's thread for a frame, with a hand on the ground or without one.
double frameTime(bool touched, double fraction) {
    Ground ground(true, {});
    if (touched) {
        SimulatedHand hand;
        hand.path = {{0, {.5, 0, .5}}, {60, {.6, 0, .6}}};
        if (!ground.renderer->start(simulatedDevice(std::move(hand)))) return 0;
    }
    std::vector<double> times;
    for (int i = 1; i <= 200; ++i) {
        const double start = threadSeconds();
        if (touched) ground.renderer->sendEvents();
        ground.move(i / 60., static_cast<float>(.05 * std::sin(i / 60.)));
        times.push_back(1e6 * (threadSeconds() - start - cpuClockSeconds()));
        std::this_thread::sleep_for(std::chrono::milliseconds(4));
    }
    (void)ground.renderer->stop();
    return percentile(times, fraction);
}

/// Whether a mass that a hand presses to a wall comes to rest there.
bool comesToRest(double rate, double stiffness, bool passive) {
    constexpr double kMass = .1, kDamping = 2, kPush = 1, kSeconds = 2;
    HapticOptions options;
    options.rate = rate;
    options.surface.stiffness = stiffness;
    options.maxForce = 1e6;
    options.passive = passive;
    Ground wall(false, options);
    double at = .01, velocity = 0, before = 0, after = 0;
    const auto steps = static_cast<int>(kSeconds * rate);
    const int inner = static_cast<int>(std::ceil(2e4 / rate));
    for (int i = 1; i <= steps; ++i) {
        const double force = wall.renderer->touch({.5, at, .5}, i / rate).force.y;
        for (int k = 0; k < inner; ++k) {
            velocity += (force - kPush - kDamping * velocity) / kMass / rate / inner;
            at += velocity / rate / inner;
        }
        double& energy = i < steps / 2 ? before : after;
        if (i > steps / 4) energy = std::max(energy, std::abs(velocity));
        if (!std::isfinite(at) || std::abs(at) > .5) return false;
    }
    return after < .5 * before || after < 1e-5;
}

double stiffest(double rate, bool passive) {
    double low = 10, high = 1e6;
    if (comesToRest(rate, high, passive)) return high;
    while (high / low > 1.05) {
        const double middle = std::sqrt(low * high);
        (comesToRest(rate, middle, passive) ? low : high) = middle;
    }
    return low;
}

/// The largest error of a force that is held for a tick while a hand goes into a surface, as a depth in mm.
double holdError(double rate, double speed) {
    HapticOptions options;
    options.rate = rate;
    options.maxForce = 1e6;
    Ground wall(false, options);
    double worst = 0, force = 0;
    for (int i = 0; i < static_cast<int>(.05 / speed * rate); ++i) {
        const double t = i / rate, depth = speed * t - .01 + .005;  // the proxy's radius
        if (depth > 0) worst = std::max(worst, std::abs(depth - force / options.surface.stiffness));
        force = wall.renderer->touch({.5, .01 - speed * t, .5}, t + 1e-9).force.y;
    }
    return 1e3 * worst;
}

}  // namespace

void touch(const Report& report, bool quick) {
    ticks(report, false, quick ? 5'000 : 100'000);
    ticks(report, true, quick ? 5'000 : 100'000);
    for (const auto& [fraction, metric] :
         {std::pair{.5, "a frame of the scene's thread, median"}, {.99, "a frame of the scene's thread, 1 in 100"}})
        report({"touch", "one thing of 100,352 triangles moves", metric, "us", frameTime(true, fraction),
                "without touch", frameTime(false, fraction), "", 0});
}

bool chartTouch(const ChartSink& sink, bool quick) {
    Chart chart, errors;
    chart.name = "touch-stability", chart.title = "The stiffest surface that does not ring";
    chart.note = "a hand of 0.1 kg with 2 N s/m of damping of its own presses with 1 N";
    errors.name = "touch-error", errors.title = "How far a force lags behind the hand";
    errors.note = "a hand that goes into a plane";
    chart.x = errors.x = {"ticks a second", true};
    chart.y = {"stiffness (N/m)", true}, errors.y = {"depth (mm)", true};
    Series with{"here", {}}, without{"without what keeps it passive", {}},
        theory{"2 b / T (Colgate and Schenkel 1994)", {}, true};
    Series slow{"0.05 m/s", {}}, fast{"0.5 m/s", {}};
    std::vector<double> rates{125, 250, 500, 1000, 2000, 4000};
    if (quick) rates = {250, 1000};
    for (const double rate : rates) {
        with.points.push_back({rate, stiffest(rate, true), ""});
        without.points.push_back({rate, stiffest(rate, false), ""});
        theory.points.push_back({rate, 2 * 2 * rate, ""});
        slow.points.push_back({rate, holdError(rate, .05), ""});
        fast.points.push_back({rate, holdError(rate, .5), ""});
    }
    chart.series = {with, without, theory};
    errors.series = {slow, fast};
    sink(chart);
    sink(errors);
    return true;
}

}  // namespace rtsg::bench
