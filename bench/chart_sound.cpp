// Charts "sound": how far a room's figures are from what is right, against time, by each of the ways to trace it; and
// what a frame takes with ever more sources that move.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <rtsg/audio/listen.h>

#include "audio/triangle_geometry.h"
#include "bench.h"
#include "charts.h"
#include "rays/acoustic_tracer.h"
#include "sound_rooms.h"

namespace rtsg::bench {

namespace {

constexpr double kSpeed = 343;
constexpr std::size_t kFigureCount = 4;
struct ChartedFigure {
    const char *key, *title, *unit;
    double noticeable;
};
constexpr ChartedFigure kCharted[kFigureCount] = {{"t20", "T20", "%", 5},
                                                  {"c80", "C80", "dB", 1},
                                                  {"g", "G", "dB", 1},
                                                  {"early", "level of the first arrivals", "dB", 1}};
using Charted = std::array<double, kFigureCount>;  // seconds, and three times decibels

/// The level of sound that comes soon after the direct sound, relative to the direct sound, in dB.
double firstArrivals(const Echogram& echogram, double seconds) {
    if (echogram.arrivals.empty()) return std::numeric_limits<double>::quiet_NaN();
    const Arrival& direct = echogram.arrivals.front();
    const double end = direct.seconds + seconds;
    double energy = 0;
    for (const Arrival& arrival : echogram.arrivals)
        if (&arrival != &direct && arrival.seconds <= end) energy += arrival.energy[0];
    for (std::size_t k = 0; k < echogram.late.bins.size() && echogram.late.startOf(k) < end; ++k) {
        const double fraction = (end - echogram.late.startOf(k)) * echogram.late.binsPerSecond;
        energy += std::min(1.0, fraction) * echogram.late.bins[k][0];
    }
    return 10 * std::log10(energy / direct.energy[0]);
}

Charted chartedOf(const RoomMetrics& metrics, const Echogram& echogram, const SoundRoom& room) {
    return {metrics.t20[0], metrics.c80[0], metrics.g[0], firstArrivals(echogram, room.earlySeconds)};
}

/// In the units of the charts.
Charted errorsOf(const Charted& value, const Charted& truth) {
    Charted errors;
    for (std::size_t f = 0; f < kFigureCount; ++f)
        errors[f] = f == 0 ? 100 * (value[f] / truth[f] - 1) : value[f] - truth[f];
    return errors;
}

/// The true figures, and their uncertainties.
struct Truth {
    Charted value{}, error{};
    std::string from;
};

/// The lattice of mirror images in closed form.
Truth latticeTruth(const SoundRoom& room) {
    Echogram exact;
    test::Shoebox::uniform({6, 5, 3}, .1, 0)
        .images(room.source, room.listener, 4 * kSpeed, [&](double distance, double energy, int) {
            // Apart where they can be told apart; the reach of single ones does not matter beyond 40 m.
            if (distance < 40)
                exact.arrivals.push_back({distance / kSpeed, allBands(energy), {}, 0});
            else
                exact.late.add(distance / kSpeed, allBands(energy));
        });
    std::sort(exact.arrivals.begin(), exact.arrivals.end(),
              [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
    return {chartedOf(roomMetrics(exact), exact, room), {}, "the lattice of images in closed form"};
}

TraceOptions geometricOptions(std::uint64_t seed) {
    TraceOptions options;
    options.seed = seed;
    options.air.speedOfSound = kSpeed;
    options.air.absorbs = false;
    options.diffractionOrder = 0;
    return options;
}

/// Many rays of other seeds, and how much the figures of so many vary.
Truth longRunTruth(const SoundRoom& room, bool quick) {
    constexpr int kParts = 10;
    TraceOptions options = geometricOptions(0);
    options.rays = quick ? 2000 : 60'000;
    Echogram all;
    std::vector<Charted> parts;
    for (int part = 0; part < kParts; ++part) {
        options.seed = 1000 + static_cast<std::uint64_t>(part);
        const Echogram one = AcousticTracer(room.geometry).trace(room.source, room.listener, options).echogram();
        parts.push_back(chartedOf(roomMetrics(one), one, room));
        if (part == 0) all = {one.arrivals, {one.late.binsPerSecond, {}, one.late.start}};
        all.late.accumulate(one.late, 1.0 / kParts);
    }
    Truth truth{
        chartedOf(roomMetrics(all), all, room), {}, fmt::format("{} rays of other seeds", kParts * options.rays)};
    for (const Charted& part : parts) {
        const Charted errors = errorsOf(part, truth.value);
        for (std::size_t f = 0; f < kFigureCount; ++f)
            truth.error[f] += errors[f] * errors[f] / (kParts * (kParts - 1));
    }
    for (double& error : truth.error) error = std::sqrt(error);
    return truth;
}

/// One way to trace, tried with ever more effort.
class Method {
  public:
    Method(const char* name, const SoundRoom& room, const Truth& truth) : name_(name), room_(room), truth_(truth) {}

    /// Several runs of one effort; false once a run takes longer than it is worth.
    template <class Trace>
    bool add(const std::string& label, int runs, const Trace& trace) {
        Charted squares{};
        double seconds = 0;
        for (int run = 0; run < runs; ++run) {
            const double start = cpuSeconds();
            const TraceResult result = trace(static_cast<std::uint64_t>(run) + 1);
            const MetricsEstimate metrics = result.metrics();
            seconds += cpuSeconds() - start;
            const Charted errors = errorsOf(chartedOf(metrics.value, result.echogram(), room_), truth_.value);
            for (std::size_t f = 0; f < kFigureCount; ++f) squares[f] += errors[f] * errors[f];
        }
        for (std::size_t f = 0; f < kFigureCount; ++f)
            // Few images have no T20, and none may have come yet.
            if (const double error = std::sqrt(squares[f] / runs); error > 0 && error < kExact)
                exact_[f] = true;
            else if (std::isfinite(error))
                series_[f].push_back({seconds / runs * 1e3, error, label});
        return seconds / runs < 4;
    }
    Series series(std::size_t figure) const { return {name_, series_[figure]}; }
    /// Its name, where some of its points differ from what is right by rounding, and so are not drawn; else nothing.
    std::string exact(std::size_t figure) const { return exact_[figure] ? name_ : std::string(); }
    TraceResult trace(const TraceOptions& options) const {
        return AcousticTracer(room_.geometry).trace(room_.source, room_.listener, options);
    }
    /// Traces as `rtsg listen --error` does.
    TraceResult traceTo(double error, std::uint64_t seed) const {
        constexpr std::uint64_t kMax = 4'000'000;
        TraceOptions options = geometricOptions(seed);
        options.rays = ListenOptions::kFirstRays;
        const AcousticTracer tracer(room_.geometry);
        TraceResult result = tracer.trace(room_.source, room_.listener, options);
        static_cast<void>(tracer.refineTo(result, room_.source, room_.listener, options, error, kMax));
        return result;
    }

  private:
    /// Smaller differences than this, in the units of a figure, are rounding.
    static constexpr double kExact = 1e-5;

    std::string name_;
    const SoundRoom& room_;
    const Truth& truth_;
    std::vector<ChartPoint> series_[kFigureCount];
    bool exact_[kFigureCount] = {};
};

std::vector<Method> tryMethods(const SoundRoom& room, const Truth& truth, bool quick) {
    const int runs = quick ? 2 : 8;
    const std::uint64_t maximum = quick ? 1000 : 16'000;
    Method images("image sources alone", room, truth), rays("rays alone", room, truth),
        both("images and rays", room, truth), asked("--error", room, truth);
    for (const int order : {1, 2, 3, 5, 8, 12, 18, 26}) {
        TraceOptions options = geometricOptions(1);
        options.imageOrder = order;
        options.rays = 0;
        bool whole = true;
        const bool quickEnough = images.add(fmt::format("order {}", order), 1, [&](std::uint64_t) {
            TraceResult result = images.trace(options);
            whole = result.imageOrder == order;
            return result;
        });
        if (!whole || !quickEnough || (quick && order > 2)) break;
    }
    for (std::uint64_t count = 250; count <= maximum; count *= 4) {
        static_cast<void>(rays.add(std::to_string(count), runs, [&](std::uint64_t seed) {
            TraceOptions options = geometricOptions(seed);
            options.rays = count;
            options.imageOrder = options.connectedOrder = 0;
            return rays.trace(options);
        }));
        static_cast<void>(both.add(std::to_string(count), runs, [&](std::uint64_t seed) {
            TraceOptions options = geometricOptions(seed);
            options.rays = count;
            return both.trace(options);
        }));
    }
    for (const double error : {.4, .2, .1, .05}) {
        const bool quickEnough = asked.add(fmt::format("{}", error), runs / 2,
                                           [&](std::uint64_t seed) { return asked.traceTo(error, seed); });
        if (!quickEnough || quick) break;
    }
    return {images, rays, both, asked};
}

void chartRoom(const ChartSink& sink, const std::string& key, const std::string& name, const SoundRoom& room,
               const Truth& truth, bool quick) {
    const std::vector<Method> methods = tryMethods(room, truth, quick);
    for (std::size_t f = 0; f < kFigureCount; ++f) {
        const ChartedFigure& figure = kCharted[f];
        const std::string known =
            truth.error[f] > 0 ? fmt::format(", known to {:.2g} {}", truth.error[f], figure.unit) : std::string();
        Chart chart{fmt::format("sound-{}-{}", key, figure.key),
                    fmt::format("{}: error of {} against time", name, figure.title),
                    fmt::format("RMS over seeds, from {}{}; no air, no diffraction. Labels: orders of images, rays, "
                                "noticeable differences asked for. {}CPU time.",
                                truth.from, known,
                                f == 3 ? fmt::format("First: within {:g} ms of direct sound. ", 1e3 * room.earlySeconds)
                                       : std::string()),
                    {"time (ms)", true},
                    {fmt::format("RMS error ({})", figure.unit), true},
                    {},
                    {}};
        std::string exact;
        for (const Method& method : methods)
            if (const std::string its = method.exact(f); !its.empty()) exact += (exact.empty() ? "" : ", ") + its;
        if (!exact.empty()) chart.note += fmt::format(" Exact in the end, and not drawn there: {}.", exact);
        double low = std::numeric_limits<double>::infinity(), high = 0;
        for (const Method& method : methods) {
            chart.series.push_back(method.series(f));
            for (const ChartPoint& p : chart.series.back().points) low = std::min(low, p.x), high = std::max(high, p.x);
        }
        const auto line = [&](const std::string& text, double at) {
            if (at > 0) chart.series.push_back({text, {{low, at, {}}, {high, at, {}}}, true});
        };
        line(fmt::format("just noticeable ({} {})", figure.noticeable, figure.unit), figure.noticeable);
        line("what is right is known to this", truth.error[f]);
        sink(chart);
    }
}

/// The time of a frame with 1 to 64 sources that all move.
bool chartSources(const ChartSink& sink, bool quick) {
    constexpr double kFrame = 1e3 / 60;
    Chart chart{"sound-sources",
                "Moving sources: a frame of live sound",
                "Sources that all move in a box at 60 Hz, heard live on a silent device, reflections traced behind. "
                "CPU time a frame of 1/60 s.",
                {"moving sources", true},
                {"time a frame (ms)", true},
                {{"all threads", {}},
                 {"the sound's thread", {}},
                 {"the scene's thread, longest", {}},
                 {"the scene's thread, median", {}},
                 {"a core, all of the time", {}, true}},
                {}};
    for (int sources = 1; sources <= (quick ? 4 : 64); sources *= 2) {
        const std::optional<MovingSound> moved = moveSources(sources, quick ? .3 : 16);
        if (!moved || !moved->reported.failure.empty()) return false;
        const double x = sources;
        const std::string label =
            moved->reported.underruns ? fmt::format("{} underruns", moved->reported.underruns) : "";
        chart.series[0].points.push_back({x, moved->cores * kFrame, label});
        chart.series[1].points.push_back({x, moved->reported.busy * kFrame, {}});
        chart.series[2].points.push_back({x, 1e3 * *std::max_element(moved->frames.begin(), moved->frames.end()), {}});
        chart.series[3].points.push_back({x, 1e3 * median(moved->frames), {}});
        chart.series[4].points.push_back({x, kFrame, {}});
    }
    sink(chart);
    return true;
}

}  // namespace

bool chartSound(const ChartSink& sink, bool quick) {
    for (const double scattering : {0.0, .1, .5, 1.0}) {
        const auto room = boxRoom(scattering);
        if (!room) return false;
        const Truth truth = scattering == 0 ? latticeTruth(*room) : longRunTruth(*room, quick);
        chartRoom(sink, fmt::format("box{:03.0f}", 100 * scattering),
                  fmt::format("Box, {:.0f} % scattered", 100 * scattering), *room, truth, quick);
        if (quick) break;
    }
    for (const auto& [key, name, make] :
         {std::tuple{"hall", "Hall", &hallRoom}, std::tuple{"coupled", "Coupled rooms", &coupledRoom},
          std::tuple{"small", "Small room", &smallRoom}}) {
        const auto room = make();
        if (!room) return false;
        chartRoom(sink, key, name, *room, longRunTruth(*room, quick), quick);
        if (quick) break;
    }
    return chartSources(sink, quick);
}

}  // namespace rtsg::bench
