// How the errors of a traced room's figures fall with the number of rays: as one over its root, figure by figure.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/renderers/parallel_for.h>

#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"

namespace rtsg {
namespace {

using namespace test;

constexpr std::size_t kFigureTotal = 8;
constexpr Bands RoomMetrics::* kSloped[kFigureTotal] = {&RoomMetrics::edt, &RoomMetrics::t20, &RoomMetrics::t30,
                                                        &RoomMetrics::c50, &RoomMetrics::c80, &RoomMetrics::d50,
                                                        &RoomMetrics::ts,  &RoomMetrics::g};
constexpr const char* kSlopedNames[kFigureTotal] = {"EDT", "T20", "T30", "C50", "C80", "D50", "Ts", "G"};

std::vector<RoomMetrics> figuresOf(const TriangleGeometry& room, std::uint64_t rays, int runs, Echogram* mean) {
    std::vector<TraceResult> results(static_cast<std::size_t>(runs));
    parallelFor(results.size(), [&](std::size_t i) {
        TraceOptions o = shortTrace(rays, rays + i, TraceOptions().imageOrder);
        o.maxSeconds = .7;
        results[i] = AcousticTracer(room).trace(kSource, kListener, o);
    });
    std::vector<RoomMetrics> figures;
    for (const TraceResult& result : results) figures.push_back(roomMetrics(result.echogram()));
    if (mean) {
        *mean = results.front().echogram();
        mean->late.bins.clear();
        for (const TraceResult& result : results) mean->late.accumulate(result.echogram().late, 1.0 / runs);
    }
    return figures;
}

/// Over three decades of rays, and to the end: there is no floor. The reference is the mean of the runs with most rays,
/// over all seeds, whose own error is a fifth of theirs; other tests check it against closed forms.
TEST(ErrorSlope, IsMinusAHalfOverThreeDecadesForEveryFigure) {
    const TriangleGeometry room = Shoebox::uniform({6, 5, 3}, .3, .5).geometry();
    constexpr std::array<std::pair<std::uint64_t, int>, 4> kEfforts{{{64, 240}, {640, 120}, {6400, 48}, {64'000, 28}}};
    std::vector<std::vector<RoomMetrics>> figures;
    Echogram mean;
    for (const auto& [rays, runs] : kEfforts)
        figures.push_back(figuresOf(room, rays, runs, rays == kEfforts.back().first ? &mean : nullptr));
    const RoomMetrics truth = roomMetrics(mean);
    for (std::size_t f = 0; f < kFigureTotal; ++f) {
        std::array<double, kEfforts.size()> logs{};
        for (std::size_t e = 0; e < kEfforts.size(); ++e) {
            double squares = 0;
            for (const RoomMetrics& one : figures[e])
                squares += std::pow((one.*kSloped[f])[0] / (truth.*kSloped[f])[0] - 1, 2);
            // For the last one, the reference is made of the same runs.
            const auto n = static_cast<double>(figures[e].size());
            logs[e] = std::log10(squares / (e + 1 == kEfforts.size() ? n - 1 : n)) / 2;
        }
        double slope = 0;  // of the line of least squares; the efforts lie a decade apart
        for (std::size_t e = 0; e < logs.size(); ++e) slope += (static_cast<double>(e) - 1.5) * logs[e] / 5;
        EXPECT_NEAR(slope, -.5, .05) << kSlopedNames[f];
        // A floor would show at the end: there one standard deviation of the last decade is .08.
        EXPECT_NEAR(logs[3] - logs[2], -.5, .2) << kSlopedNames[f];
        RecordProperty(kSlopedNames[f], std::to_string(slope));
    }
}

}  // namespace
}  // namespace rtsg
