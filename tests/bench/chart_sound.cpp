// Charts "sound": how far a room's figures are from the lattice of mirror images in closed form, against time.
#include <cmath>

#include <fmt/format.h>

#include <rtsg/audio/acoustic_tracer.h>

#include "audio/triangle_geometry.h"
#include "bench.h"
#include "charts.h"

namespace rtsg::bench {

bool chartSound(const ChartSink& sink, bool quick) {
    // A box of mirrors: all of its echoes are known. Rays do all but the first orders.
    const test::Shoebox box = test::Shoebox::uniform({6, 5, 3}, .1, 0);
    const glm::dvec3 source(1, 1, 1.5), listener(4, 3, 1.5);
    const double speed = 343.2, length = 4;
    Echogram exact;
    box.images(source, listener, length * speed, [&](double distance, double energy, int) {
        // Apart where they can be told apart; the reach of single ones does not matter beyond 40 m.
        if (distance < 40)
            exact.arrivals.push_back({distance / speed, allBands(energy), {}, 0});
        else
            exact.late.add(distance / speed, allBands(energy));
    });
    const RoomMetrics truth = roomMetrics(exact);
    const int runs = quick ? 2 : 8;
    struct Figure {
        const char* name;
        Bands RoomMetrics::* value;
    };
    constexpr Figure kFigures[] = {{"EDT", &RoomMetrics::edt}, {"T20", &RoomMetrics::t20}, {"T30", &RoomMetrics::t30}};
    Chart chart{
        "sound-error",
        "Reverberation times: error against time",
        fmt::format("A mirroring box of 6 x 5 x 3 m, absorption 0.1; image sources to order 3, rays (numbers "
                    "labelled) for the rest. RMS over {} runs, from the lattice of images in closed form. Triangles "
                    "are tested one by one in double precision: 12 of them. CPU time.",
                    runs),
        {"time (ms)", true},
        {"RMS error (%)", true},
        {},
        {}};
    for (const Figure& f : kFigures) chart.series.push_back({f.name, {}});
    chart.series.push_back({"just noticeable (5 %)", {}, true});
    const test::TriangleGeometry room = box.geometry();
    for (std::uint64_t rays = 250; rays <= (quick ? 1000u : 64'000u); rays *= 4) {
        double squares[3] = {}, seconds = 0;
        for (int run = 0; run < runs; ++run) {
            TraceOptions options;
            options.rays = rays;
            options.imageOrder = 3;
            options.batches = 8;
            options.maxSeconds = length;
            options.seed = static_cast<std::uint64_t>(run) + 1;
            options.air.speedOfSound = speed;
            options.air.absorbs = false;
            const double start = cpuSeconds();
            const MetricsEstimate estimate = AcousticTracer(room).trace(source, listener, options).metrics();
            seconds += cpuSeconds() - start;
            for (std::size_t i = 0; i < 3; ++i) {
                const double error = (estimate.value.*kFigures[i].value)[0] / (truth.*kFigures[i].value)[0] - 1;
                squares[i] += error * error;
            }
        }
        for (std::size_t i = 0; i < 3; ++i)
            chart.series[i].points.push_back({seconds / runs * 1e3, 100 * std::sqrt(squares[i] / runs),
                                              i == 1 ? std::to_string(rays) : std::string()});
    }
    const auto& points = chart.series[0].points;
    chart.series[3].points = {{points.front().x, 5, {}}, {points.back().x, 5, {}}};
    sink(chart);
    return true;
}

}  // namespace rtsg::bench
