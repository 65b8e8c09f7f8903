// Rooms that are listened to, against closed forms and against intervals that the method states itself.
#include <cmath>

#include <fmt/format.h>

#include "audio/triangle_geometry.h"
#include "listen_scene.h"
#include "signal/fractional_delay.h"

namespace rtsg {
namespace {

using namespace test;

/// A figure averaged over seeds, and how far it may be off by chance less than once in four million: Student's t with
/// the 60 degrees of freedom of four seeds of 16 batches is beyond 5.8 that seldom.
struct OverSeeds {
    static constexpr int kSeeds = 4;
    double mean = 0, squares = 0;
    void add(double value, double ci95) {
        mean += value / kSeeds;
        squares += ci95 * ci95 / (studentT95(15) * studentT95(15) * kSeeds * kSeeds);
    }
    double bound() const { return 5.8 * std::sqrt(squares); }
};

TEST_F(Listen, MeasuresTheReferenceBoxThroughTheWholePath) {
    OverSeeds t30, edt, c80, g;
    for (std::uint64_t seed = 1; seed <= OverSeeds::kSeeds; ++seed) {
        Scene scene;
        load(scene, room("absorption .1 diffuse .45 specular .45", kPair));
        ListenOptions o = options();
        o.sound = false;
        o.metrics = true;
        o.trace.rays = 9600;
        o.trace.seed = seed;
        ASSERT_EQ(o.trace.batches, 16);
        const auto report = listen(scene, o);
        ASSERT_TRUE(report) << report.error().text;
        ASSERT_EQ(report->sources.size(), 1u);
        const auto& s = report->sources[0];
        EXPECT_EQ(s.source, "Voice");
        t30.add(s.metrics.value.t30[kBand1k], s.metrics.ci95.t30[kBand1k]);
        edt.add(s.metrics.value.edt[kBand1k], s.metrics.ci95.edt[kBand1k]);
        c80.add(s.metrics.value.c80[kBand1k], s.metrics.ci95.c80[kBand1k]);
        g.add(s.metrics.value.g[kBand1k], s.metrics.ci95.g[kBand1k]);
        EXPECT_LT(report->escaped, 1e-5);
        EXPECT_NEAR(s.schroederHz, 2000 * std::sqrt(1.1075 / 90), 3);
        EXPECT_GE(report->rays, 9600u);
        EXPECT_GT(report->seconds, 0);
        EXPECT_TRUE(report->sound.samples.empty());
        if (seed > 1) continue;
        const std::string json = report->toJson();
        for (const char* key :
             {"\"sources\":[{\"source\":\"Voice\"", "\"bands_hz\":[31.5,63,125,250,500,1000,2000,4000,8000,16000]",
              "\"EDT_s\":[", "\"T20_s\":[", "\"T30_s\":[", "\"C50_db\":[", "\"C80_db\":[", "\"D50\":[", "\"Ts_s\":[",
              "\"G_db\":[", "\"ci95\":{", "\"rays\":", "\"seconds\":", "\"escaped\":"})
            EXPECT_NE(json.find(key), std::string::npos) << key << " in " << json;
        EXPECT_EQ(json.find("nan"), std::string::npos);
        const SoundBuffer ir = report->impulseResponses();
        EXPECT_EQ(ir.channels, 1);
        EXPECT_GT(ir.seconds(), 0.8);
    }
    // The reference is a Monte Carlo itself, good to what is added.
    EXPECT_NEAR(t30.mean, 1.1088, t30.bound() + .002);
    EXPECT_NEAR(edt.mean, 1.1093, edt.bound() + .002);
    EXPECT_NEAR(c80.mean, 2.212, c80.bound() + .03);
    EXPECT_NEAR(g.mean, 25.323, g.bound() + .015);
}

/// Schroeder's frequency is that of a room, which a box with a wall less is not.
TEST_F(Listen, AnOpenRoomHasNoSchroederFrequency) {
    const std::string walls =
        "Shape { appearance Appearance { acousticProperties AcousticProperties { absorption .1 diffuse .45 specular "
        ".45 "
        "} } geometry IndexedFaceSet { solid FALSE coord Coordinate { point [ 0 0 0, 6 0 0, 6 5 0, 0 5 0, 0 0 3, 6 0 "
        "3, "
        "6 5 3, 0 5 3 ] } coordIndex [ 0 1 2 3 -1 4 5 6 7 -1 0 1 5 4 -1 3 2 6 7 -1 0 3 7 4 -1 ";
    for (const bool open : {false, true}) {
        Scene scene;
        load(scene, walls + (open ? "" : "1 2 6 5 -1 ") + "] } }\n" + kPair);
        ListenOptions o = options();
        o.sound = false;
        o.metrics = true;
        o.trace.rays = 800;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report) << report.error().text;
        ASSERT_EQ(report->sources.size(), 1u);
        EXPECT_TRUE(std::isfinite(report->sources[0].metrics.value.t20[kBand1k])) << open;
        EXPECT_EQ(std::isnan(report->sources[0].schroederHz), open);
    }
}

TEST_F(Listen, TheBodyOfWhatSoundsDoesNotEncloseIt) {
    const std::string view = "Viewpoint { position 0 0 3 }\n";
    const auto level = [&](const std::string& body) {
        Scene scene;
        load(scene,
             "Transform { children [ Sound { source AudioClip { url \"impulse.wav\" } } " + body + " ] }\n" + view);
        const auto report = listen(scene, options());
        EXPECT_TRUE(report);
        return report->sound.peak();
    };
    EXPECT_NEAR(level("Shape { geometry Sphere { radius .3 } }"), level(""), 1e-3);
    EXPECT_NEAR(level("Shape { geometry Box { size .5 .5 .5 } }"), level(""), 1e-3);
    EXPECT_EQ(level("Shape { geometry Box { size 3 3 3 } }"), 0);  // a room
    // A screen: what comes round it, by two edges, is much softer.
    EXPECT_LT(level("Transform { translation 0 0 1 children Shape { geometry Box { size 1 1 .1 } } }"), .5 * level(""));
}

TEST_F(Listen, NeitherDoesABodyThatFollowsWhatSounds) {
    // Sound that is heard now left between 10 ms and a frame ago, at a place where the cab is now, 3 cm behind the
    // source.
    const auto level = [&](const std::string& body, double speed) {
        Scene scene;
        load(scene,
             "DEF Train Transform { children [ Sound { minBack 90 minFront 90 maxBack 200 maxFront 200 source "
             "OscillatorSource { frequency 440 } } " +
                 body + " ] }\nViewpoint { position 6 0 0 }\n");
        ListenOptions o = options();
        o.seconds = .5;
        o.render.reflections = false;
        o.runTo = [&](double t) {
            EXPECT_TRUE(scene.set(scene.findName("Train"), x3d::Transform::translation,
                                  Vec3f(static_cast<float>(speed * t), 0, 0)));
            scene.newFrame(t);
        };
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        double energy = 0;
        for (const float sample : report->sound.samples) energy += double{sample} * sample;
        return 10 * std::log10(energy);
    };
    const std::string cab = "Transform { translation -.18 0 0 children Shape { geometry Box { size .3 .3 .3 } } }";
    EXPECT_NEAR(level(cab, 3), level("", 3), .01);
    // A wall that goes with it, between it and the listener, is heard to be one.
    EXPECT_LT(level("Transform { translation .5 0 0 children Shape { geometry Box { size .1 3 3 } } }", 3),
              level("", 3) - 10);
}

TEST_F(Listen, ReverberationFollowsTheDirectSound) {
    Scene dry, wet;
    load(dry, kPair);
    load(wet, room("absorption .2 diffuse .5 specular .3", kPair));
    ListenOptions o = options();
    o.seconds = 0.6;
    const auto a = listen(dry, o), b = listen(wet, o);
    ASSERT_TRUE(a);
    ASSERT_TRUE(b);
    const auto direct = static_cast<std::size_t>(std::lround(std::sqrt(13.0) / 343 * kRate));
    const auto energy = [](const SoundBuffer& s, std::size_t from, std::size_t to) {
        double sum = 0;
        for (std::size_t i = 2 * from; i < 2 * to; ++i) sum += static_cast<double>(s.samples[i]) * s.samples[i];
        return sum / 2;
    };
    // Without a room there is direct sound and nothing else: the impulse of half, delayed by 504.57 samples; between
    // samples the window of the sinc takes a little from the highest frequencies.
    const double fraction = std::ceil(std::sqrt(13.0) / 343 * kRate) - std::sqrt(13.0) / 343 * kRate;
    double taps = 0;
    const SincTable sinc;
    for (int k = 0; k < 2 * SincTable::kHalf; ++k) taps += std::pow(static_cast<double>(sinc.tap(fraction, k)), 2);
    EXPECT_NEAR(energy(a->sound, direct - 40, direct + 40) / (.25 * taps), 1, 1e-3);
    EXPECT_NEAR(taps, .95, .05);
    EXPECT_NEAR(energy(a->sound, direct + 200, 28800), 0, 1e-6);
    // With one the ratio of reflected to direct energy is that of the response traced with the same seed, which is made
    // of noise of that energy, within what chance leaves, and of arrivals, of which some come so close together that
    // they interfere.
    ListenOptions m = o;
    m.sound = false;
    m.metrics = true;
    m.trace = o.render.trace;
    const auto figures = listen(wet, m);
    ASSERT_TRUE(figures);
    double reflected = 0;
    const TraceResult& traced = figures->sources[0].trace;
    for (const Arrival& arrival : traced.arrivals)
        if (arrival.order > 0) reflected += arrival.energy[kBand1k];
    for (const Bands& bin : traced.echogram().late.bins) reflected += bin[kBand1k];
    reflected *= 4 * M_PI * 13;  // re direct
    const double heard = energy(b->sound, direct + 60, 28800) / 0.25;
    EXPECT_NEAR(10 * std::log10(heard / reflected), 0, 0.4);
    EXPECT_LE(b->sound.peak(), 1.0f);
}

TEST_F(Listen, ABoothWithTheListenerInsideRings) {
    // As in a room of any size: the images of the lattice, and their level.
    const double a = .1;
    Scene scene;
    load(scene,
         "Shape { geometry Box { size 1 1.2 .9 solid FALSE } appearance Appearance { acousticProperties "
         "AcousticProperties { absorption .1 specular .9 } } }\n"
         "DEF Voice Sound { location -.2 .1 .05 source AudioClip { url \"impulse.wav\" } }\n"
         "Viewpoint { position .21 -.15 .1 }\n");
    ListenOptions o = options();
    o.metrics = true;
    o.trace.rays = 4800;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    test::Shoebox box = test::Shoebox::uniform({1, 1.2, .9}, a);
    double exact = 0;
    box.images({.3, .7, .5}, {.71, .45, .55}, 343, [&](double, double energy, int) { exact += energy; });
    const auto& m = report->sources[0].metrics;
    EXPECT_NEAR(m.value.g[kBand1k], 10 * std::log10(exact * 4 * M_PI * 100), 2 * m.ci95.g[kBand1k] + .05);
    EXPECT_GT(report->sources[0].trace.arrivals.size(), 1000u);
    EXPECT_LT(report->escaped, 1e-5);
    // And it is heard.
    double late = 0;
    for (std::size_t i = 2 * 200; i < report->sound.samples.size(); ++i)
        late += static_cast<double>(report->sound.samples[i]) * static_cast<double>(report->sound.samples[i]);
    EXPECT_GT(late, .1);
}

/// Energy of both channels from `from` seconds on, before the gain that kept it from clipping.
double energyAfter(const ListenReport& report, double from) {
    double sum = 0;
    for (auto i = 2 * static_cast<std::size_t>(from * 48000); i < report.sound.samples.size(); ++i)
        sum += std::pow(static_cast<double>(report.sound.samples[i]) / static_cast<double>(report.gain), 2) / 2;
    return sum;
}

TEST_F(Listen, ConesAndEllipsoidsReachReflections) {
    const auto late = [&](const std::string& sound) {
        Scene scene;
        load(scene, room("absorption .1 diffuse .9", sound + "\nViewpoint { position 4 3 1.5 }\n"));
        ListenOptions o = options();
        o.seconds = 1;
        o.render.trace.rays = 6400;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return energyAfter(*report, .1);
    };
    const std::string clip = "AudioClip { url \"impulse.wav\" }";
    const auto spatial = [&](const std::string& cone) {
        return "SpatialSound { location 1 1 1.5 direction .6 .8 0 rolloffFactor 0 " + cone + " children " + clip + " }";
    };
    const double all = late(spatial(""));
    // Half angle 30 degrees: (1 - cos 30) / 2 of the sphere.
    EXPECT_NEAR(10 * std::log10(late(spatial("coneInnerAngle 1.0472 coneOuterAngle 1.0472 coneOuterGain 0")) / all),
                -11.74, .6);
    EXPECT_NEAR(10 * std::log10(late(spatial("coneInnerAngle .01 coneOuterAngle .01 coneOuterGain .5")) / all), -6.02,
                .6);
    // Ellipsoids: what goes to each side relative to what goes to the listener, as loud there in both cases.
    const auto ellipsoid = [&](const glm::vec3& direction) {
        return fmt::format(
                   "Sound {{ location 1 1 1.5 direction {} {} {} minBack 0 minFront 0 maxBack 6 maxFront 60 source ",
                   direction.x, direction.y, direction.z) +
               clip + " }";
    };
    SoundNode node;
    node.minBack = node.minFront = 0, node.maxBack = 6, node.maxFront = 60;
    const auto mean = [&](const glm::dvec3& axis) {
        node.direction = axis;
        double sum = 0;
        for (int i = 0; i < 20000; ++i) {
            const double z = 1 - (2 * i + 1) / 20000.0, r = std::sqrt(1 - z * z);
            const double g = node.level(std::sqrt(13.0) * glm::dvec3(r * std::cos(2.4 * i), r * std::sin(2.4 * i), z));
            sum += g * g / 20000;
        }
        return sum;
    };
    // A field that is diffuse does not care where the source looks, only how much it sends.
    const double front = late(ellipsoid({.6f, .8f, 0})), expected = mean({.6, .8, 0}) * std::pow(1.0, 2);
    EXPECT_NEAR(10 * std::log10(front / all), 10 * std::log10(expected), .8);
}

TEST_F(Listen, AirIsThereUnlessSaidOtherwise) {
    const auto measured = [&](const std::string& info, const AirChoice& choice) {
        Scene scene;
        load(scene, info + room("absorption .03 diffuse .9", kPair));
        ListenOptions o;
        o.sound = false;
        o.trace.rays = 2400;
        o.render.air = choice;
        auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return *report;
    };
    const ListenReport usual = measured("", {});
    EXPECT_TRUE(usual.air.absorbs);
    EXPECT_EQ(usual.air.celsius, 20);
    EXPECT_EQ(usual.air.relativeHumidity, 50);
    AirChoice none;
    none.absorbs = false;
    const ListenReport still = measured("", none);
    // 1 / T = 1 / T of the walls + m c / 6 ln 10, where walls are alike in all bands.
    const Bands m = airAttenuation(usual.air);
    for (const std::size_t b : {5u, 6u, 7u}) {
        const double walls = still.sources[0].metrics.value.t20[b];
        const double expected = 1 / (1 / walls + m[b] * 343 / (6 * std::log(10.0)));
        EXPECT_NEAR(usual.sources[0].metrics.value.t20[b], expected, .02 * expected) << b;
    }
    const std::string cold =
        "WorldInfo { metadata MetadataSet { value [ MetadataFloat { name \"airTemperature\" value [ 0 ] } "
        "MetadataDouble { "
        "name \"airHumidity\" value [ 30 ] } ] } }\n";
    const ListenReport outside = measured(cold, {});
    EXPECT_EQ(outside.air.celsius, 0);
    EXPECT_EQ(outside.air.relativeHumidity, 30);
    EXPECT_NEAR(outside.air.speedOfSound, 331.3, .1);
    AirChoice user;
    user.celsius = 10;
    EXPECT_EQ(measured(cold, user).air.celsius, 10);
    EXPECT_EQ(measured(cold, user).air.relativeHumidity, 30);
    EXPECT_FALSE(measured("WorldInfo { metadata MetadataBoolean { name \"airAbsorption\" value [ FALSE ] } }\n", {})
                     .air.absorbs);
    EXPECT_NE(outside.toJson().find("\"air\":{\"absorbs\":true,\"temperature_c\":0,"), std::string::npos);
}

TEST_F(Listen, AcousticPropertiesAreShares) {
    const auto material = [&](const std::string& fields) {
        Scene scene;
        load(scene, "DEF S Shape { appearance Appearance { acousticProperties DEF A AcousticProperties { " + fields +
                        " } } }");
        return acousticMaterial(scene, scene.node(scene.findName("A")), AcousticMaterial{});
    };
    const AcousticMaterial fractions = material("absorption .2 diffuse .2 specular .6");
    EXPECT_NEAR(fractions.absorption[0], .2, 1e-6);
    EXPECT_NEAR(fractions.scattering[0], .25, 1e-6);
    EXPECT_EQ(fractions.transmission[0], 0);
    EXPECT_EQ(material("absorption .1").scattering[3], 0);
    EXPECT_EQ(material("absorption .1 diffuse .9").scattering[3], 1);  // though .1 + .9 is not 1 in single precision
    EXPECT_NEAR(material("absorption .1 diffuse .45").scattering[3], .5, 1e-6);
    EXPECT_NEAR(material("absorption .4 refraction .8").transmission[3], .6, 1e-6);
    EXPECT_NEAR(material("enabled FALSE absorption .9").absorption[0], AcousticMaterial{}.absorption[0], 1e-12);
}

/// A source in line with two faces of a box that meet: its images end at that edge, where rays have no length.
TEST_F(Listen, SourcesInLineWithTheFacesOfAnEdgeAreTraced) {
    Scene scene;
    load(scene, room("absorption .3", kPair) +
                    "Transform { translation 3 .5 1 children Shape { geometry Box { size 1 1 1 } } }\n");
    ListenOptions o = options();
    o.sound = false;
    o.metrics = true;
    o.trace.rays = 400;
    o.trace.diffractionOrder = 0;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report) << report.error().text;
    const TraceResult& trace = report->sources.at(0).trace;
    EXPECT_GT(trace.arrivals.size(), 20u);
    const double direct = std::hypot(3.0, 2.0);
    EXPECT_NEAR(trace.arrivals.front().seconds, direct / 343, 1e-6);
    EXPECT_NEAR(trace.arrivals.front().energy[kBand1k] * 4 * M_PI * direct * direct, 1, 1e-3);
    EXPECT_NEAR(trace.absorbed[kBand1k] + trace.escaped[kBand1k] + trace.truncated[kBand1k], 1, .01);
}

/// The number of values in a metadata node tells the first band; beyond them the nearest value counts.
TEST_F(Listen, BandsOfMetadataLieWhereTheirNumberSays) {
    const auto absorption = [&](const std::string& values) {
        Scene scene;
        load(scene,
             "DEF S Shape { appearance Appearance { acousticProperties DEF A AcousticProperties { absorption .5 "
             "metadata MetadataSet { value [ MetadataFloat { name \"absorption\" value [ " +
                 values + " ] } ] } } } }");
        return acousticMaterial(scene, scene.node(scene.findName("A")), AcousticMaterial{}).absorption;
    };
    const auto expect = [&](const std::string& values, const Bands& bands) {
        const Bands got = absorption(values);
        for (std::size_t b = 0; b < kBandCount; ++b)
            EXPECT_NEAR(got[b], bands[b], 1e-6) << values << ": " << kBandHz[b];
    };
    expect(".05 .1 .15 .2 .25 .3 .35 .4 .45 .5", {.05, .1, .15, .2, .25, .3, .35, .4, .45, .5});
    expect(".05 .1 .15 .2 .25 .3 .35 .4 .45", {.05, .1, .15, .2, .25, .3, .35, .4, .45, .45});  // 31.5 Hz to 8 kHz
    expect(".1 .15 .2 .25 .3 .35 .4 .45", {.1, .1, .15, .2, .25, .3, .35, .4, .45, .45});       // 63 Hz to 8 kHz
    expect(".1 .2 .3 .4 .5 .6 .7", {.1, .1, .1, .2, .3, .4, .5, .6, .7, .7});                   // 125 Hz to 8 kHz
    expect(".1 .2 .3 .4 .5 .6", {.1, .1, .1, .2, .3, .4, .5, .6, .6, .6});                      // 125 Hz to 4 kHz
    expect(".1 .2 .3 .4 .5", allBands(.5));                                                     // none: the field
}

/// Once each, with the line of the metadata and what counts instead.
TEST_F(Listen, MetadataThatAreNoBandsAreTold) {
    const auto reported = [&](const std::string& name, const std::string& values) {
        Scene scene;
        load(scene,
             room("absorption .5 metadata\nMetadataDouble { name \"" + name + "\" value [ " + values + " ] }", kPair));
        const auto report = listen(scene, options());
        EXPECT_TRUE(report);
        std::string all;
        for (const Diagnostic& d : report->diagnostics.all()) all += fmt::format("{}: {}", d.where.line, d.text);
        const std::size_t node = all.find("AcousticProperties"), text = all.find(": absorption");
        return text == all.npos ? all : all.substr(0, node) + all.substr(text + 2);
    };
    EXPECT_EQ(reported("absorption", ".1 .2 .3 .4 .5 .6"), "");
    EXPECT_EQ(reported("color", ".1 .2 .3"), "");
    EXPECT_EQ(reported("absorption", ".1 .2 .3"),
              "4: absorption of the metadata has 3 values, and octave bands are 10 or 9 (from 31.5 Hz on), 8 (from 63 "
              "Hz) or 7 or 6 (from 125 Hz): the field counts");
    EXPECT_EQ(reported("absorption", ".1 .2 -1 .4 .5 2"),
              "4: absorption of the metadata has the value -1, outside 0 to 1: 0 counts");
    EXPECT_EQ(reported("absorption", ".1 .2 .3 .4 .5 2"),
              "4: absorption of the metadata has the value 2, outside 0 to 1: 1 counts");
}

}  // namespace
}  // namespace rtsg
