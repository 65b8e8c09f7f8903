// The acoustic tracer against a reference table, closed forms, and rooms that break methods.
#include <cmath>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "images/image_sources.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

using test::kListener;
using test::kSource;
using test::Shoebox;
using test::TriangleGeometry;
constexpr std::size_t kBand = kBand1k;

TraceOptions options(std::uint64_t rays, int imageOrder) {
    TraceOptions result;
    result.rays = rays;
    result.imageOrder = imageOrder;
    result.batches = 12;
    result.maxSeconds = 4;
    result.seed = 7;
    result.air.absorbs = false;
    return result;
}

struct Row {
    double absorption, scattering, edt, t20, t30, c50, c80, d50, ts, g;
};

/// Within twice the reported 95 % interval (about 1e-4 to miss by chance) plus what the reference itself is good for.
void expectRow(const MetricsEstimate& got, const Row& row) {
    const auto near = [&](Bands RoomMetrics::* figure, double expected, double reference, const char* name) {
        const double ci = (got.ci95.*figure)[kBand];
        EXPECT_NEAR((got.value.*figure)[kBand], expected, 2 * ci + reference)
            << name << " at absorption " << row.absorption << ", scattering " << row.scattering << ", ci95 " << ci;
        EXPECT_GT(ci, 0) << name;
    };
    near(&RoomMetrics::edt, row.edt, 0.007 * row.edt, "EDT");
    near(&RoomMetrics::t20, row.t20, 0.005 * row.t20, "T20");
    near(&RoomMetrics::t30, row.t30, 0.005 * row.t30, "T30");
    near(&RoomMetrics::c50, row.c50, 0.1, "C50");
    near(&RoomMetrics::c80, row.c80, 0.1, "C80");
    near(&RoomMetrics::d50, row.d50, 0.004, "D50");
    near(&RoomMetrics::ts, row.ts, 0.0007, "Ts");
    near(&RoomMetrics::g, row.g, 0.03, "G");
    // And the run is long enough to mean something: half the just noticeable differences.
    EXPECT_LT(got.ci95.t20[kBand], 0.025 * row.t20);
    EXPECT_LT(got.ci95.c80[kBand], 0.5);
    EXPECT_LT(got.ci95.g[kBand], 0.5);
}

class Box : public testing::TestWithParam<Row> {};

TEST_P(Box, AgreesWithTheReference) {
    const Row row = GetParam();
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, row.absorption, row.scattering).geometry();
    const TraceResult result = AcousticTracer(box).trace(kSource, kListener, options(30000, 3));
    expectRow(result.metrics(), row);
    EXPECT_EQ(result.imageOrder, 3);
    EXPECT_EQ(result.arrivals.size(), row.scattering < 1 ? 63u : 1u);
    EXPECT_LT(result.escaped[kBand], 1e-6);
    EXPECT_NEAR(result.absorbed[kBand] + result.escaped[kBand] + result.truncated[kBand], 1, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Reference, Box,
                         testing::Values(Row{.1, 0, 1.1741, 1.2978, 1.3696, -.687, 2.145, .4605, .0841, 25.442},
                                         Row{.1, .1, 1.1239, 1.1401, 1.1438, -.630, 2.285, .4638, .0810, 25.393},
                                         Row{.1, .5, 1.1093, 1.1075, 1.1088, -.790, 2.212, .4546, .0816, 25.323},
                                         Row{.1, 1, 1.1211, 1.1169, 1.1169, -1.127, 1.953, .4355, .0844, 25.274},
                                         Row{.3, 0, .3432, .3868, .4078, 8.340, 13.463, .8722, .0241, 19.251},
                                         Row{.3, .1, .3380, .3596, .3664, 8.401, 13.852, .8737, .0239, 19.271},
                                         Row{.3, .5, .3383, .3395, .3397, 8.178, 13.938, .8680, .0249, 19.164},
                                         Row{.3, 1, .3503, .3453, .3452, 7.675, 13.376, .8541, .0267, 19.133}),
                         [](const testing::TestParamInfo<Row>& row) {
                             return "absorption" + std::to_string(std::lround(row.param.absorption * 100)) +
                                    "scattering" + std::to_string(std::lround(row.param.scattering * 100));
                         });

TEST(AcousticTracer, TheImageOrderDoesNotMoveTheExpectation) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .2, .2).geometry();
    std::vector<MetricsEstimate> estimates;
    for (const int order : {0, 2, 8}) {
        TraceOptions o = options(3600, order);
        o.seed = static_cast<std::uint64_t>(order) + 100;
        estimates.push_back(AcousticTracer(box).trace(kSource, kListener, o).metrics());
    }
    for (const MetricsEstimate& e : estimates)
        for (const auto figure : {&RoomMetrics::g, &RoomMetrics::t20, &RoomMetrics::c80}) {
            const double ci = std::hypot((e.ci95.*figure)[0], (estimates[2].ci95.*figure)[0]);
            EXPECT_NEAR((e.value.*figure)[0], (estimates[2].value.*figure)[0], 1.6 * ci + 0.02);
        }
    // More images, less noise.
    EXPECT_LT(estimates[2].ci95.g[0], estimates[0].ci95.g[0]);
}

TEST(AcousticTracer, TheRayCountDoesNotMoveTheExpectation) {
    // A threshold per ray would make few rays lose energy.
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    const MetricsEstimate few = AcousticTracer(box).trace(kSource, kListener, options(240, 1)).metrics();
    const MetricsEstimate many = AcousticTracer(box).trace(kSource, kListener, options(4800, 1)).metrics();
    EXPECT_NEAR(few.value.g[0], many.value.g[0], 2 * few.ci95.g[0]);
    EXPECT_NEAR(few.value.t20[0], many.value.t20[0], 2 * few.ci95.t20[0]);
    EXPECT_GT(few.ci95.g[0], 2 * many.ci95.g[0]);
}

TEST(AcousticTracer, RoomsThatBreakMethods) {
    // Against the lattice summed in closed form, and that against reference values where there are any. A line fitted
    // through the steps of a flutter echo depends on details: T20 and T30 of the reference differ by 6 and 2.4 %.
    struct Case {
        const char* name;
        Shoebox box;
        glm::dvec3 source, listener;
        double seconds, edt, t20, t30, referenceError;
    };
    Shoebox flutter, uneven;
    flutter.absorption = {.1, .1, .99, .99, .99, .99};
    uneven.absorption = {.05, .05, .05, .05, .9, .9};
    for (const Case& c :
         {Case{"flutter", flutter, kSource, kListener, 2, .1435, .6396, .9067, .065},
          Case{"uneven", uneven, kSource, kListener, 3, 1.345, 2.343, 2.616, .002},
          Case{"corridor", Shoebox::uniform({50, 2, 2.5}, .1), {5, .8, 1.5}, {35, 1.3, 1.2}, 4, 0, 0, 0, 0}}) {
        TraceOptions o = options(6000, 1000);
        o.air.speedOfSound = 343.2;
        o.maxSeconds = c.seconds;
        const TriangleGeometry room = c.box.geometry();
        const TraceResult result = AcousticTracer(room).trace(c.source, c.listener, o);
        const MetricsEstimate m = result.metrics();
        Echogram exact;
        const double near = 40;
        c.box.images(c.source, c.listener, c.seconds * 343.2, [&](double distance, double energy, int) {
            if (distance < near) {
                exact.arrivals.push_back({distance / 343.2, allBands(energy), {}, 0});
            } else {
                exact.late.add(distance / 343.2, allBands(energy));
            }
        });
        const RoomMetrics lattice = roomMetrics(exact);
        if (c.t30 > 0) {
            EXPECT_NEAR(lattice.edt[0], c.edt, 0.01 * c.edt) << c.name;
            EXPECT_NEAR(lattice.t20[0], c.t20, c.referenceError * c.t20) << c.name;
            EXPECT_NEAR(lattice.t30[0], c.t30, c.referenceError * c.t30) << c.name;
        }
        EXPECT_NEAR(m.value.edt[0], lattice.edt[0], 2 * m.ci95.edt[0] + 0.01 * lattice.edt[0]) << c.name;
        EXPECT_NEAR(m.value.t20[0], lattice.t20[0], 2 * m.ci95.t20[0] + 0.01 * lattice.t20[0]) << c.name;
        EXPECT_NEAR(m.value.t30[0], lattice.t30[0], 2 * m.ci95.t30[0] + 0.01 * lattice.t30[0]) << c.name;
        EXPECT_NEAR(m.value.g[0], lattice.g[0], 2 * m.ci95.g[0] + 0.01) << c.name;
    }
}

TEST(AcousticTracer, ALeakIsCounted) {
    TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    box.removeLastTriangle();  // half the ceiling
    const TraceResult result = AcousticTracer(box).trace(kSource, kListener, options(2400, 2));
    // Diffuse-field estimate: the hole takes S_hole of an absorption area of S_hole + .1 (S - S_hole).
    EXPECT_NEAR(result.escaped[0], 15 / (15 + .1 * 111), 0.05);
    EXPECT_NEAR(result.absorbed[0] + result.escaped[0] + result.truncated[0], 1, 0.01);
    EXPECT_LT(result.metrics().value.t30[0], 0.8);
}

TEST(AcousticTracer, DiffuseReflectionOfALargePlaneInClosedForm) {
    // Lambert plane z = 0, source and listener at height h above one point: E = integral of
    // cos / (4 pi r^2) * (1 - a) * cos / (pi r^2) dA = (1 - a) / (4 pi^2) * 2 pi * h^2 int rho drho / (rho^2 + h^2)^3
    //   = (1 - a) / (8 pi h^2).
    TriangleGeometry plane;
    plane.addQuad({-300, -300, 0}, {300, -300, 0}, {300, 300, 0}, {-300, 300, 0}, plane.addMaterial(0.2, 1.0));
    plane.finish();
    const double h = 2;
    TraceOptions o = options(24000, 2);
    const TraceResult result = AcousticTracer(plane).trace({0, 0, h}, {0, 0, h}, o);
    const double expected = 0.8 / (8 * M_PI * h * h);
    double late = 0;
    for (const Bands& bin : result.echogram().late.bins) late += bin[0];
    EXPECT_NEAR(late, expected, 0.01 * expected);
    EXPECT_NEAR(result.escaped[0], 0.5 + 0.4, 0.01);
    EXPECT_NEAR(result.absorbed[0], 0.1, 0.01);
}

TEST(AcousticTracer, ThinWallsPassSoundOnAllThreeWays) {
    // A partition with transmission between two halves of a box: by reciprocity of the closed form there is none, so
    // compare two partitions of the work: with all transmission and no reflection the partition must not be there at
    // all.
    const auto room = [](bool partition, double scattering) {
        TriangleGeometry g;
        const std::uint32_t wall = g.addMaterial(.2, scattering), clear = g.addMaterial(0, .5, 1.0);
        g.addBox({0, 0, 0}, {6, 5, 3}, {wall, wall, wall, wall, wall, wall});
        if (partition) g.addQuad({2.5, 0, 0}, {2.5, 5, 0}, {2.5, 5, 3}, {2.5, 0, 3}, clear);
        g.finish();
        return g;
    };
    for (const int connected : {options(1, 1).connectedOrder, 0}) {  // 0: from walls the listener alone is looked for
        const double scattering = connected > 0 ? .3 : 1;
        const TriangleGeometry with = room(true, scattering), without = room(false, scattering);
        TraceOptions o = options(4800, 2);
        o.connectedOrder = connected;
        const TraceResult a = AcousticTracer(with).trace(kSource, kListener, o);
        const TraceResult b = AcousticTracer(without).trace(kSource, kListener, o);
        EXPECT_EQ(a.arrivals.size(), b.arrivals.size());  // images pass the partition as rays do
        const MetricsEstimate ma = a.metrics(), mb = b.metrics();
        EXPECT_NEAR(ma.value.g[0], mb.value.g[0], 1.5 * std::hypot(ma.ci95.g[0], mb.ci95.g[0])) << connected;
        EXPECT_NEAR(ma.value.t20[0], mb.value.t20[0], 1.5 * std::hypot(ma.ci95.t20[0], mb.ci95.t20[0])) << connected;
        EXPECT_NEAR(ma.value.c80[0], mb.value.c80[0], 1.5 * std::hypot(ma.ci95.c80[0], mb.ci95.c80[0]) + 0.05)
            << connected;
    }
}

TEST(AcousticTracer, AirShortensTheHighBandsAsItShould) {
    // In a room with little absorption: 1/T = 1/T_walls + m c / 13.8155.
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .2, 1).geometry();
    TraceOptions o = options(3600, 1);
    const MetricsEstimate dry = AcousticTracer(box).trace(kSource, kListener, o).metrics();
    o.air.absorbs = true;
    const MetricsEstimate air = AcousticTracer(box).trace(kSource, kListener, o).metrics();
    const Bands m = airAttenuation(o.air);
    for (const std::size_t b : {1ul, 6ul, 8ul, 9ul}) {
        const double expected = 1 / (1 / dry.value.t20[b] + m[b] * 343 / (6 * std::log(10.0)));
        EXPECT_NEAR(air.value.t20[b], expected, 0.01 * expected) << kBandHz[b];
    }
}

/// The box with what its walls are made of in each band.
TriangleGeometry bandedBox(const AcousticMaterial& material) {
    TriangleGeometry room;
    std::array<std::uint32_t, 6> materials;
    materials.fill(room.addMaterial(material));
    room.addBox(glm::dvec3(0), {6, 5, 3}, materials);
    room.finish();
    return room;
}

/// Bands that walls treat alike are computed once, whichever bands these are, and each band has its own result.
TEST(AcousticTracer, BandsThatWallsTreatAlikeAreComputedOnce) {
    const auto classesOf = [](int classes) {
        AcousticMaterial material;
        material.absorption = allBands(.1);
        for (std::size_t b = 0; b < kBandCount; ++b)
            material.scattering[b] = .3 + .05 * static_cast<double>(b % static_cast<std::size_t>(classes));
        return bandedBox(material);
    };
    TraceOptions o = options(800, 2);
    for (const int classes : {1, 2, 4, 5, 8, 9, 10}) {
        const TriangleGeometry room = classesOf(classes);
        const TraceResult result = AcousticTracer(room).trace(kSource, kListener, o);
        EXPECT_EQ(result.bandsTraced, classes);
        const MetricsEstimate m = result.metrics();
        EXPECT_EQ(m.bandsApart, classes);
        for (std::size_t b = 0; b < kBandCount; ++b) {
            const std::size_t same = b % static_cast<std::size_t>(classes);
            for (const auto figure : {&RoomMetrics::t20, &RoomMetrics::c80, &RoomMetrics::g}) {
                EXPECT_EQ((m.value.*figure)[b], (m.value.*figure)[same]);
                EXPECT_EQ((m.ci95.*figure)[b], (m.ci95.*figure)[same]);
            }
            EXPECT_NEAR(result.absorbed[b] + result.escaped[b] + result.truncated[b], 1, 1e-3);
            if (b != same || b == 0) continue;
            EXPECT_NE(m.value.t20[b], m.value.t20[0]);
            EXPECT_NEAR(m.value.g[b], 25.33, 2 * m.ci95.g[b] + .05) << classes << ' ' << b;
        }
    }
    // With specular reflection only, everything is exact: each band is that of a box with its own absorption.
    AcousticMaterial stripes;
    stripes.scattering = allBands(0);
    for (std::size_t b = 0; b < kBandCount; ++b) stripes.absorption[b] = b % 3 == 1 ? .3 : .1;
    const TriangleGeometry striped = bandedBox(stripes);
    const Air still{.absorbs = false};
    const ImageSources both =
        findImageSources(striped, kSource, kListener, {.maxOrder = 4}, 343, airAttenuation(still));
    for (const double absorption : {.1, .3}) {
        const TriangleGeometry plain = Shoebox::uniform({6, 5, 3}, absorption, 0).geometry();
        const ImageSources one =
            findImageSources(plain, kSource, kListener, {.maxOrder = 4}, 343, airAttenuation(still));
        ASSERT_EQ(one.arrivals.size(), both.arrivals.size());
        for (std::size_t i = 0; i < one.arrivals.size(); ++i)
            for (std::size_t b = 0; b < kBandCount; ++b) {
                if (stripes.absorption[b] != absorption) continue;
                EXPECT_DOUBLE_EQ(both.arrivals[i].energy[b], one.arrivals[i].energy[0]) << i << ' ' << b;
            }
    }
    // Air takes something else from each band of the figures, and nothing more from rays.
    o.air.absorbs = true;
    const TriangleGeometry concrete = classesOf(1);
    const TraceResult inAir = AcousticTracer(concrete).trace(kSource, kListener, o);
    EXPECT_EQ(inAir.bandsTraced, 1);
    EXPECT_EQ(inAir.metrics().bandsApart, kBandCount);
}

TEST(AcousticTracer, RepeatsExactlyAndRefines) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .3, .4).geometry();
    const AcousticTracer tracer(box);
    TraceResult a = tracer.trace(kSource, kListener, options(480, 2));
    const TraceResult b = tracer.trace(kSource, kListener, options(480, 2));
    EXPECT_EQ(a.echogram().total(), b.echogram().total());
    const double before = a.metrics().ci95.g[0];
    tracer.refine(a, kSource, kListener, options(480, 2), 4800);
    EXPECT_EQ(a.rays, 480u + 4800u);
    EXPECT_LT(a.metrics().ci95.g[0], 0.7 * before);
    EXPECT_NEAR(a.absorbed[0], 1, 0.01);
}

TEST(AcousticTracer, ADecayThatIsCutShortHasNoReverberationTime) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .05, .5).geometry();
    TraceOptions o = options(240, 1);
    o.maxSeconds = 0.5;  // of about 2.2
    const TraceResult cut = AcousticTracer(box).trace(kSource, kListener, o);
    EXPECT_GT(cut.truncated[0], 0.01);
    EXPECT_TRUE(std::isnan(cut.metrics().value.t30[0]));
    EXPECT_TRUE(std::isnan(cut.metrics().value.edt[0]));
    // Nor is it known what else was still to come.
    EXPECT_TRUE(std::isnan(cut.metrics().value.g[0]));
    EXPECT_TRUE(std::isnan(cut.metrics().ci95.c80[0]));
    EXPECT_NEAR(cut.absorbed[0] + cut.truncated[0], 1, 0.02);
    o.maxSeconds = 1.5;
    const TraceResult nearly = AcousticTracer(box).trace(kSource, kListener, o);
    EXPECT_LT(nearly.truncated[0], 0.01);
    EXPECT_TRUE(std::isnan(nearly.metrics().value.t30[0]));
    EXPECT_FALSE(std::isnan(nearly.metrics().value.g[0]));
}

/// Source on the floor or a listener on a wall: what a little before them is heard, and nothing escapes.
TEST(AcousticTracer, OnAWallIsTheLimitOfBeforeIt) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    const auto trace = [&](const glm::dvec3& source, const glm::dvec3& listener) {
        const TraceResult result = AcousticTracer(box).trace(source, listener, options(9600, 3));
        EXPECT_LT(result.escaped[0], 1e-6);
        return result;
    };
    struct Case {
        glm::dvec3 on, before;
        bool source;
    };
    for (const Case& c :
         {Case{{1, 1, 0}, {1, 1, 1e-3}, true}, Case{{0, 0, 0}, {1e-3, 1e-3, 1e-3}, true},
          Case{{6, 3, 1.5}, {6 - 1e-3, 3, 1.5}, false}, Case{{6, 5, 3}, {5.999, 4.999, 2.999}, false}}) {
        const TraceResult a = c.source ? trace(c.on, kListener) : trace(kSource, c.on);
        const TraceResult b = c.source ? trace(c.before, kListener) : trace(kSource, c.before);
        ASSERT_EQ(a.arrivals.size(), b.arrivals.size());
        for (std::size_t i = 0; i < a.arrivals.size(); ++i)
            EXPECT_NEAR(a.arrivals[i].seconds, b.arrivals[i].seconds, 6e-6);
        const MetricsEstimate ma = a.metrics(), mb = b.metrics();
        EXPECT_NEAR(ma.value.g[0], mb.value.g[0], 1.5 * std::hypot(ma.ci95.g[0], mb.ci95.g[0]) + .01);
        // In a corner three walls scatter from nearby.
        EXPECT_LT(ma.ci95.g[0], 1);
    }
}

TEST(AcousticTracer, BeforeAWallTheSpecularBoxHasTheLevelOfTheLattice) {
    const Shoebox box = Shoebox::uniform({6, 5, 3}, .1, 0);
    const TriangleGeometry room = box.geometry();
    for (const auto& [source, listener] :
         {std::pair(glm::dvec3(1e-4, 1, 1.5), kListener), std::pair(kSource, glm::dvec3(5.9999, 3, 1.5)),
          std::pair(glm::dvec3(0, 1, 1.5), glm::dvec3(6, 3, 1.5))}) {
        double exact = 0;
        box.images(source, listener, 4 * 343, [&](double, double energy, int) { exact += energy; });
        exact = 10 * std::log10(exact * 4 * M_PI * 100);
        const MetricsEstimate m = AcousticTracer(room).trace(source, listener, options(4800, 1000)).metrics();
        EXPECT_NEAR(m.value.g[0], exact, 2 * m.ci95.g[0] + .005);
        EXPECT_LT(m.ci95.g[0], .05);
    }
}

TEST(AcousticTracer, ADirectionalSourceReachesTheRoomByWhatItRadiates) {
    // A beam of half angle 30 degrees carries 1 - cos 30 over 2 of what goes to all sides: -11.7 dB in a diffuse field.
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .1, 1).geometry();
    TraceOptions o = options(9600, 2);
    const auto late = [&](const TraceResult& result) {
        double sum = 0;
        const auto& bins = result.echogram().late.bins;
        for (std::size_t i = 100; i < bins.size(); ++i) sum += bins[i][0];
        return sum;
    };
    const double all = late(AcousticTracer(box).trace(kSource, kListener, o));
    const glm::dvec3 axis = glm::normalize(glm::dvec3(1, 2, .5));
    o.pattern = [&](const glm::dvec3& d) { return glm::dot(d, axis) > std::cos(M_PI / 6) ? 1.0 : 0.0; };
    const TraceResult beam = AcousticTracer(box).trace(kSource, kListener, o);
    // Its first way is longer than others', so that it meets fewer walls until then: some .4 dB.
    EXPECT_NEAR(10 * std::log10(late(beam) / all), 10 * std::log10((1 - std::cos(M_PI / 6)) / 2) + .4, .3);
    // Mirror images leave the source towards their first wall.
    const TriangleGeometry mirror = Shoebox::uniform({6, 5, 3}, .1, 0).geometry();
    o.pattern = [&](const glm::dvec3& d) { return d.z < -1e-9 ? 1.0 : 0.0; };  // down
    o.rays = 12;
    const TraceResult down = AcousticTracer(mirror).trace(kSource, kListener, o);
    o.pattern = {};
    const TraceResult both = AcousticTracer(mirror).trace(kSource, kListener, o);
    EXPECT_EQ(both.arrivals.size(), 25u);
    // With orders up to two: floor, floor and a wall (4), floor and ceiling.
    EXPECT_EQ(down.arrivals.size(), 6u);
}

TEST(AcousticTracer, TheEchogramIsAsLongAsTheHallRings) {
    const TriangleGeometry hall = Shoebox::uniform({60, 45, 37}, .03, .4).geometry();  // 100,000 m^3
    TraceOptions o;
    o.rays = 1600;
    o.imageOrder = 1;
    o.air.absorbs = false;
    const TraceResult result = AcousticTracer(hall).trace({10, 10, 2}, {35, 20, 10}, o);
    EXPECT_GT(result.seconds, 20);
    EXPECT_NEAR(result.receiverRadius, 3, .3);
    const MetricsEstimate m = result.metrics();
    // Sabine 40 s; Eyring's is 1.5 % less.
    EXPECT_NEAR(m.value.t30[kBand1k], 39.5, .08 * 39.5);
    const TriangleGeometry small = Shoebox::uniform({6, 5, 3}, .3, .4).geometry();
    EXPECT_LT(AcousticTracer(small).trace(kSource, kListener, o).seconds, 2);
}

TEST(AcousticTracer, WithoutAnyArrivalThereIsNoInterval) {
    // All that might come late is diffuse, from a patch behind a screen: no ray reaches the listener.
    TriangleGeometry g;
    const std::uint32_t rough = g.addMaterial(.1, .9), black = g.addMaterial(1, 0);
    g.addQuad({-1, -1, -2}, {1, -1, -2}, {1, 1, -2}, {-1, 1, -2}, rough);
    g.addQuad({-9, -9, -1}, {9, -9, -1}, {9, 9, -1}, {-9, 9, -1}, black);
    g.finish();
    TraceOptions o = options(2400, 1);
    const MetricsEstimate hidden = AcousticTracer(g).trace({0, 0, -1.5}, {3, 0, 2}, o).metrics();
    EXPECT_TRUE(std::isnan(hidden.value.g[0]));  // nothing at all
    // A slot lets direct sound through; the patch may or may not be heard.
    TriangleGeometry open;
    const std::uint32_t r = open.addMaterial(.1, .9), b = open.addMaterial(1, 0);
    open.addQuad({-.01, -.01, 0}, {.01, -.01, 0}, {.01, .01, 0}, {-.01, .01, 0}, r);
    open.addQuad({-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}, b);
    open.finish();
    const MetricsEstimate seldom = AcousticTracer(open).trace({2, 0, .5}, {0, 0, 5}, options(2400, 1)).metrics();
    EXPECT_TRUE(std::isfinite(seldom.value.g[0]));
    // The void: nothing is left to chance.
    TriangleGeometry nothing;
    nothing.finish();
    EXPECT_LT(AcousticTracer(nothing).trace({0, 0, 0}, {0, 0, 5}, o).metrics().ci95.g[0], 1e-12);
}

TEST(AcousticTracer, TheVoidIsSilentButForDirectSound) {
    TriangleGeometry nothing;
    nothing.finish();
    const TraceResult result = AcousticTracer(nothing).trace({0, 0, 0}, {0, 0, 10}, options(120, 3));
    for (const double escaped : result.escaped) EXPECT_NEAR(escaped, 1, 1e-12);
    ASSERT_EQ(result.arrivals.size(), 1u);
    EXPECT_NEAR(result.metrics().value.g[0], 0, 1e-9);
}

TEST(AcousticTracer, PlacesTooFarApartOrNowhereGiveNothing) {
    TriangleGeometry nothing;
    nothing.finish();
    const AcousticTracer tracer(nothing);
    EXPECT_FALSE(tracer.trace({0, 0, 0}, {.99e6, 0, 0}, options(120, 3)).batches.empty());
    for (const double far : {1.01e6, HUGE_VAL, std::nan("")}) {
        const TraceResult result = tracer.trace({0, 0, 0}, {far, 0, 0}, options(120, 3));
        EXPECT_TRUE(result.arrivals.empty());
        EXPECT_TRUE(result.batches.empty());
        EXPECT_EQ(result.rays, 0U);
    }
}

/// More rays until the error asked for is reached, or all that are allowed, or somebody ends it.
TEST(AcousticTracer, RefinesToAnErrorOrToItsLimit) {
    const TriangleGeometry room = Shoebox::uniform({6, 5, 3}, .2, .5).geometry();
    const AcousticTracer tracer(room);
    const glm::dvec3 source = kSource, listener = kListener;
    const TraceOptions few = options(240, 0);
    TraceResult result = tracer.trace(source, listener, few);
    const double before = largestError(result.metrics());
    const double reached = tracer.refineTo(result, source, listener, few, before / 2, 1'000'000);
    EXPECT_LE(reached, before / 2);
    EXPECT_EQ(reached, largestError(result.metrics()));
    EXPECT_GT(result.rays, 240U);
    TraceResult limited = tracer.trace(source, listener, few);
    EXPECT_GT(tracer.refineTo(limited, source, listener, few, 1e-6, 2000), 1e-6);
    EXPECT_GE(limited.rays, 2000U);
    EXPECT_LT(limited.rays, 2000U + limited.batches.size());
    TraceResult ended = tracer.trace(source, listener, few);
    const std::uint64_t rays = ended.rays;
    tracer.refineTo(ended, source, listener, few, 1e-6, 1'000'000, [] { return false; });
    EXPECT_EQ(ended.rays, rays);
}

}  // namespace
}  // namespace rtsg
