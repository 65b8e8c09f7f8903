// Early lateral energy: of single reflections by their angle, of a plane that scatters, and of a diffuse room.
#include <cmath>

#include <gtest/gtest.h>

#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

using test::TriangleGeometry;

TEST(LateralEnergy, OfOneReflectionByItsAngle) {
    const glm::dvec3 across(1, 0, 0);
    for (const double degrees : {0.0, 30.0, 60.0, 90.0, 135.0})
        for (const double energy : {.1, .7}) {
            const double angle = degrees * M_PI / 180;
            const glm::dvec3 from(std::sin(angle), 0, -std::cos(angle));
            // Straight; one that counts; one before 5 ms and one after 80 ms from the side.
            std::vector<Arrival> arrivals{{.02, allBands(1), {0, 0, -1}, 0},
                                          {.0249, allBands(.3), {1, 0, 0}, 1},
                                          {.04, allBands(energy), from, 1},
                                          {.1001, allBands(.5), {1, 0, 0}, 2}};
            const MetricsEstimate found = estimateMetrics(arrivals, {}, across);
            const double expected = energy * std::sin(angle) * std::sin(angle) / (1 + .3 + energy);
            EXPECT_NEAR(found.value.lf[kBand1k], expected, 1e-12) << degrees;
            EXPECT_EQ(found.ci95.lf[kBand1k], 0);
            EXPECT_TRUE(std::isnan(estimateMetrics(arrivals, {}).value.lf[kBand1k]));
        }
}

/// By batches: the lateral part of a bin that lies across the limits counts as far as it lies within them.
TEST(LateralEnergy, OfRandomEnergyByBatches) {
    std::vector<EnergyHistogram> batches(8);
    for (std::size_t i = 0; i < batches.size(); ++i) {
        batches[i].bins.assign(100, allBands(.01));
        batches[i].lateral.assign(100, allBands(i % 2 == 0 ? .002 : .004));
    }
    const MetricsEstimate found = estimateMetrics({}, batches, {1, 0, 0});
    // From the onset at .01 ms of what comes evenly: 75 ms of .003 in 80 ms of .01.
    EXPECT_NEAR(found.value.lf[kBand1k], .3 * 75 / 80, 1e-3);
    EXPECT_GT(found.ci95.lf[kBand1k], .02);
    EXPECT_LT(found.ci95.lf[kBand1k], .12);
}

/// The energy that a Lambert floor y = 0 sends: all of it, and weighted by the squared cosine to the x axis.
std::array<double, 2> fromFloor(double absorption, const glm::dvec3& source, const glm::dvec3& listener) {
    double all = 0, lateral = 0;
    constexpr int kSteps = 1500;
    for (int i = 0; i < kSteps; ++i)
        for (int k = 0; k < kSteps; ++k) {
            const double u = (i + .5) / kSteps * 2 - 1, v = (k + .5) / kSteps * 2 - 1;
            const double x = std::tan(u * M_PI / 2), z = std::tan(v * M_PI / 2);
            const double area = std::pow(M_PI / kSteps, 2) * (1 + x * x) * (1 + z * z);
            const glm::dvec3 point(x, 0, z);
            const double d1 = glm::distance(point, source), d2 = glm::distance(point, listener);
            const double energy =
                (1 - absorption) * source.y / (4 * M_PI * d1 * d1 * d1) * listener.y / (M_PI * d2 * d2 * d2) * area;
            all += energy;
            lateral += energy * std::pow((x - listener.x) / d2, 2);
        }
    return {all, lateral};
}

TEST(LateralEnergy, OfAFloorThatScattersIsTheIntegral) {
    TriangleGeometry floor;
    floor.addQuad({-300, 0, -300}, {-300, 0, 300}, {300, 0, 300}, {300, 0, -300}, floor.addMaterial(.2, 1));
    floor.finish();
    const glm::dvec3 source{0, 1.5, -2}, listener{0, 1.2, 1};
    const auto [all, lateral] = fromFloor(.2, source, listener);
    TraceOptions options = test::shortTrace(160'000, 3, 2);
    options.lateral = true;
    // With another at another side, which has an axis of its own.
    const std::array<glm::dvec3, 2> listeners{listener, glm::dvec3(3, 1.2, -2)};
    for (const std::size_t count : {1, 2}) {
        const auto results = AcousticTracer(floor).trace(source, std::span(listeners).first(count), options);
        double found = 0, across = 0;
        for (const Bands& bin : results[0].echogram().late.bins) found += bin[kBand1k];
        for (const Bands& bin : results[0].echogram().late.lateral) across += bin[kBand1k];
        EXPECT_EQ(results[0].across, glm::dvec3(1, 0, 0));
        EXPECT_NEAR(found / all, 1, .02);
        EXPECT_NEAR(across / lateral, 1, .02);
        EXPECT_NEAR(std::abs(results.back().across.z), count == 2 ? 1 : 0, 1e-12);
    }
    options.lateral = false;
    EXPECT_TRUE(AcousticTracer(floor).trace(source, listener, options).echogram().late.lateral.empty());
}

/// In a room all of whose walls scatter a third of what comes late comes along any axis; the exact figure of a box.
TEST(LateralEnergy, OfADiffuseRoomIsAThird) {
    const TriangleGeometry room = test::Shoebox::uniform({6, 5, 3}, .1, 1).geometry();
    TraceOptions options = test::shortTrace(20'000, 1, 10);
    options.lateral = true;
    const TraceResult result = AcousticTracer(room).trace(test::kSource, test::kListener, options);
    double all = 0, across = 0;
    const EnergyHistogram late = result.echogram().late;
    for (std::size_t i = 200; i < late.lateral.size(); ++i)
        all += late.bins[i][kBand1k], across += late.lateral[i][kBand1k];
    EXPECT_NEAR(across / all, 1.0 / 3, .02);
    const MetricsEstimate metrics = result.metrics();
    EXPECT_GT(metrics.value.lf[kBand1k], .1);
    EXPECT_LT(metrics.value.lf[kBand1k], .4);
    EXPECT_GT(metrics.ci95.lf[kBand1k], 0);
    EXPECT_LT(metrics.ci95.lf[kBand1k], .02);
}

}  // namespace
}  // namespace rtsg
