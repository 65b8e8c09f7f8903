// Images of listeners that scattering walls are connected with: the right ones, each path counted once, whatever is
// found.
#include "response/listener_images.h"

#include <cmath>

#include <gtest/gtest.h>

#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

using namespace test;
using trace::ListenerImages;
using trace::MirrorSequence;

constexpr int kBoxImages[] = {0, 6, 24, 62};  // up to so many mirrors

TEST(ListenerImages, OfABoxAreThoseOfTheLattice) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    for (int order = 0; order <= 3; ++order) {
        const ListenerImages images(box, kListener, order, 1000);
        EXPECT_LE(images.all().size(), static_cast<std::size_t>(kBoxImages[order]));
        // Some of the third order take so small an angle that no ray of the search meets them.
        EXPECT_GE(images.all().size(), static_cast<std::size_t>(kBoxImages[order]) * 9 / 10);
        for (const ListenerImages::Image& image : images.all()) {
            int mirrors = 0;
            for (int a = 0; a < 3; ++a) {
                const double size = Shoebox{}.size[a];
                // Cell k of the unfolded room.
                const double cell = std::floor(image.position[a] / size);
                const double inside = image.position[a] - cell * size;
                const bool even = std::fmod(std::abs(cell), 2) < .5;
                EXPECT_NEAR(even ? inside : size - inside, kListener[a], 1e-9);
                mirrors += static_cast<int>(std::abs(cell));
            }
            EXPECT_GE(mirrors, 1);
            EXPECT_LE(mirrors, order);
            EXPECT_NEAR(image.fraction, std::pow(.45, mirrors), 1e-12);
        }
    }
}

TEST(ListenerImages, AreKnownByTheirPlanesInTheOrderOfSound) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    const ListenerImages images(box, kListener, 3, 1000);
    const auto planes = box.planes();
    int known = 0;
    for (std::uint32_t a = 0; a < planes.size(); ++a)
        for (std::uint32_t b = 0; b < planes.size(); ++b) {
            MirrorSequence sequence;
            sequence.append(a);
            sequence.append(b);
            const std::uint32_t image = images.of(sequence);
            if (image == ListenerImages::kNone) continue;
            ++known;
            // Sound meets `a` first, so of the listener `b` is the first mirror.
            glm::dvec3 expected = kListener;
            for (const std::uint32_t p : {b, a})
                expected -= planes[p].normal * (2 * planes[p].signedDistance(expected));
            EXPECT_LT(glm::distance(images.all()[image].position, expected), 1e-9);
        }
    EXPECT_GT(known, 18);
    MirrorSequence tooLong;
    for (int i = 0; i < 5; ++i) tooLong.append(static_cast<std::uint32_t>(i % 2));
    EXPECT_EQ(images.of(tooLong), ListenerImages::kNone);
    EXPECT_EQ(images.of(MirrorSequence()), ListenerImages::kNone);
    MirrorSequence noPlane;
    noPlane.append(kNoPlane);
    EXPECT_EQ(images.of(noPlane), ListenerImages::kNone);
    EXPECT_TRUE(ListenerImages().all().empty());
    EXPECT_EQ(ListenerImages().of(tooLong), ListenerImages::kNone);
}

TraceOptions imagesOptions(std::uint64_t rays, std::uint64_t seed, int connectedOrder) {
    TraceOptions result = shortTrace(rays, seed, 3);
    result.connectedOrder = connectedOrder;
    return result;
}

/// A Lambert floor, z = 0, beside a mirror, x = 0, all else open. Late sound goes from the source or its image to the
/// floor, and from there to the listener or its image.
double besideAMirror(double absorption, double mirrored, const glm::dvec3& source, const glm::dvec3& listener) {
    constexpr int kSteps = 2000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
        for (int k = 0; k < kSteps; ++k) {
            // x = tan(u), y = tan(v): the half plane in a quarter turn and a half.
            const double u = (i + .5) / kSteps * M_PI / 2, v = ((k + .5) / kSteps - .5) * M_PI;
            const double x = std::tan(u), y = std::tan(v);
            const double area = (1 + x * x) * (M_PI / 2 / kSteps) * (1 + y * y) * (M_PI / kSteps);
            const auto view = [&](const glm::dvec3& position, double side) {
                const glm::dvec3 to = glm::dvec3(side * position.x, position.y, position.z) - glm::dvec3(x, y, 0);
                const double d = glm::length(to);
                return to.z / (d * d * d);
            };
            const double in = view(source, 1) + mirrored * view(source, -1);
            const double out = view(listener, 1) + mirrored * view(listener, -1);
            sum += area * in / (4 * M_PI) * (1 - absorption) * out / M_PI;
        }
    return sum;
}

TEST(ListenerImages, ALambertFloorBesideAMirrorSendsWhatTheIntegralSays) {
    TriangleGeometry room;
    const std::uint32_t floor = room.addMaterial(.2, 1), mirror = room.addMaterial(.1, 0);
    room.addQuad({0, -900, 0}, {900, -900, 0}, {900, 900, 0}, {0, 900, 0}, floor);
    room.addQuad({0, -900, 0}, {0, 900, 0}, {0, 900, 900}, {0, -900, 900}, mirror);
    room.finish();
    const glm::dvec3 source(1, 0, 2), listener(2, 1, 1.5);
    const double exact = besideAMirror(.2, .9, source, listener);
    for (const int order : {0, 3}) {
        constexpr int kRuns = 40;
        double sum = 0, squares = 0;
        for (int run = 0; run < kRuns; ++run) {
            TraceOptions o = imagesOptions(960, 1 + run, order);
            o.receiverRadius = .2;
            const TraceResult result = AcousticTracer(room).trace(source, listener, o);
            double late = 0;
            for (const Bands& bin : result.echogram().late.bins) late += bin[kBand1k];
            sum += late / kRuns, squares += late * late / kRuns;
        }
        const double error = std::sqrt((squares - sum * sum) / kRuns);
        // The ball takes the mean over itself; connections are exact and of less noise.
        EXPECT_NEAR(sum, exact, 5 * error + (order == 0 ? .01 * exact : 0)) << order;
        EXPECT_LT(error, (order == 0 ? .05 : .004) * exact) << order;
    }
}

/// However many images are connected the expectation is the same, and intervals hold what they say.
TEST(ListenerImages, MoveNoExpectationAndLeaveIntervalsHonest) {
    // Values of many rays without any images connected; the reference table has 25.31 and 1.109.
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    double widths[4] = {};
    for (const int order : {0, 1, 2, 3}) {
        constexpr int kRuns = 120;
        int inG = 0, inT20 = 0;
        double meanG = 0, meanT20 = 0;
        for (int run = 0; run < kRuns; ++run) {
            TraceOptions o = imagesOptions(160, 100 + run, order);
            o.maxSeconds = 1.4;
            const MetricsEstimate m = AcousticTracer(box).trace(kSource, kListener, o).metrics();
            inG += std::abs(m.value.g[kBand1k] - 25.317) <= m.ci95.g[kBand1k];
            inT20 += std::abs(m.value.t20[kBand1k] - 1.109) <= m.ci95.t20[kBand1k];
            meanG += m.value.g[kBand1k] / kRuns, meanT20 += m.value.t20[kBand1k] / kRuns;
            widths[order] += m.ci95.g[kBand1k] / kRuns;
        }
        // Binomial with p = .95, n = 120: 4.2 standard deviations below the mean.
        EXPECT_GE(inG, 104) << order;
        EXPECT_GE(inT20, 104) << order;
        EXPECT_NEAR(meanG, 25.317, .12) << order;
        EXPECT_NEAR(meanT20, 1.109, .012) << order;
    }
    EXPECT_LT(widths[1], .8 * widths[0]);
    EXPECT_LT(widths[3], .5 * widths[0]);
}

/// With few images only some paths are known: the others are counted as before.
TEST(ListenerImages, PathsOfNoKnownImageAreNotLost) {
    TriangleGeometry room;
    const std::uint32_t wall = room.addMaterial(.2, .3);
    room.addBox({0, 0, 0}, {6, 5, 3}, {wall, wall, wall, wall, wall, wall});
    for (int i = 0; i < 6; ++i) {  // screens about the room
        const double x = 1.5 + .6 * i, y = .5 + .7 * ((i * 5) % 6);
        room.addQuad({x, y, 0}, {x + .3, y + .5, 0}, {x + .3, y + .5, 1.2}, {x, y, 1.2}, wall);
    }
    room.finish();
    MetricsEstimate estimates[2];
    for (const int order : {0, 3})
        estimates[order / 3] =
            AcousticTracer(room).trace(kSource, {4.1, 2.9, 1.4}, imagesOptions(16'000, 5, order)).metrics();
    for (const auto figure : {&RoomMetrics::t20, &RoomMetrics::t30, &RoomMetrics::c80, &RoomMetrics::g}) {
        const double ci = std::hypot((estimates[0].ci95.*figure)[kBand1k], (estimates[1].ci95.*figure)[kBand1k]);
        EXPECT_NEAR((estimates[0].value.*figure)[kBand1k], (estimates[1].value.*figure)[kBand1k], 1.6 * ci);
    }
    EXPECT_LT(estimates[1].ci95.g[kBand1k], estimates[0].ci95.g[kBand1k]);
}

}  // namespace
}  // namespace rtsg
