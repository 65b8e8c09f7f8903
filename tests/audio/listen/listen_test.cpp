// Listening to whole scenes, against closed forms and against intervals that the method states itself.
#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/audio/world_geometry.h>
#include <rtsg/core/loader.h>
#include <rtsg/core/x3d.h>

#include "audio/triangle_geometry.h"
#include "signal/fractional_delay.h"

namespace rtsg {
namespace {

namespace fs = std::filesystem;

/// A folder of its own with sounds to play: an impulse, a constant tone.
class Listen : public testing::Test {
  protected:
    static constexpr int kRate = 48000;

    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("rtsg_listen_" + std::to_string(::getpid()));
        fs::create_directories(folder_);
        SoundBuffer impulse{kRate, 1, std::vector<float>(kRate / 10)};
        impulse.samples[0] = 0.5f;
        ASSERT_TRUE(writeWav((folder_ / "impulse.wav").string(), impulse, WavFormat::float32));
        SoundBuffer tone{kRate, 1, {}};
        for (int i = 0; i < kRate; ++i)
            tone.samples.push_back(static_cast<float>(0.5 * std::sin(2 * M_PI * 1000 * i / double{kRate})));
        ASSERT_TRUE(writeWav((folder_ / "tone.wav").string(), tone, WavFormat::float32));
    }
    void TearDown() override { fs::remove_all(folder_); }

    void load(Scene& scene, const std::string& body) {
        Diagnostics diagnostics;
        const bool loaded = loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + body, diagnostics, folder_);
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        ASSERT_TRUE(loaded);
    }
    ListenOptions options() const {
        ListenOptions o;
        o.seconds = 0.2;
        o.metrics = false;
        o.render.resources = std::filesystem::path(folder_);
        o.render.trace.rays = 400;
        o.trace.air.absorbs = false;
        return o;
    }
    static std::size_t peak(const SoundBuffer& sound, int channel) {
        std::size_t best = 0;
        for (std::size_t i = 0; i < sound.frames(); ++i)
            if (std::abs(sound.samples[2 * i + static_cast<std::size_t>(channel)]) >
                std::abs(sound.samples[2 * best + static_cast<std::size_t>(channel)]))
                best = i;
        return best;
    }

    fs::path folder_;
};

std::string room(const std::string& properties, const std::string& rest) {
    return "Transform { translation 3 2.5 1.5 children Shape { geometry Box { size 6 5 3 solid FALSE } "
           "appearance Appearance { acousticProperties AcousticProperties { " +
           properties + " } } } }\n" + rest;
}
const std::string kPair =
    "DEF Voice Sound { location 1 1 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source AudioClip { url "
    "\"impulse.wav\" } }\nViewpoint { position 4 3 1.5 }\n";

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
        t30.add(s.metrics.value.t30[4], s.metrics.ci95.t30[4]);
        edt.add(s.metrics.value.edt[4], s.metrics.ci95.edt[4]);
        c80.add(s.metrics.value.c80[4], s.metrics.ci95.c80[4]);
        g.add(s.metrics.value.g[4], s.metrics.ci95.g[4]);
        EXPECT_LT(report->escaped, 1e-5);
        EXPECT_NEAR(s.schroederHz, 2000 * std::sqrt(1.1075 / 90), 3);
        EXPECT_GE(report->rays, 9600u);
        EXPECT_GT(report->seconds, 0);
        EXPECT_TRUE(report->sound.samples.empty());
        if (seed > 1) continue;
        const std::string json = report->toJson();
        for (const char* key :
             {"\"sources\":[{\"source\":\"Voice\"", "\"bands_hz\":[63,125,250,500,1000,2000,4000,8000]", "\"EDT_s\":[",
              "\"T20_s\":[", "\"T30_s\":[", "\"C50_db\":[", "\"C80_db\":[", "\"D50\":[", "\"Ts_s\":[", "\"G_db\":[",
              "\"ci95\":{", "\"rays\":", "\"seconds\":", "\"escaped\":"})
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

TEST_F(Listen, AmbisonicSoundKnowsItsDirections) {
    Scene scene;
    // Nothing is mirrored: what is late comes from all sides alike.
    load(scene, room("absorption .3 diffuse .7",
                     "Sound { location 2 4 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source AudioClip { url "
                     "\"impulse.wav\" } }\nViewpoint { position 4 2 1.5 }\n"));
    ListenOptions o = options();
    o.seconds = 0.4;
    o.render.ambisonicOrder = 2;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->sound.channels, 9);
    ASSERT_EQ(report->sound.frames(), static_cast<std::size_t>(0.4 * kRate));
    // Two metres to the left and two up: W 1, Y (left) and Z (up) 1 / sqrt 2, X (ahead) 0.
    const auto delay = static_cast<std::size_t>(std::lround(std::sqrt(8.0) / 343 * kRate));
    std::array<double, 9> direct{}, late{}, fourth{};
    for (std::size_t i = 0; i < report->sound.frames(); ++i)
        for (std::size_t c = 0; c < 9; ++c) {
            const double x = static_cast<double>(report->sound.samples[9 * i + c]) / static_cast<double>(report->gain);
            if (i + 30 > delay && i < delay + 30)
                direct[c] += x * static_cast<double>(report->sound.samples[9 * i]) / static_cast<double>(report->gain);
            if (i > delay + 2000) late[c] += x * x, fourth[c] += x * x * x * x;
        }
    EXPECT_NEAR(direct[1] / direct[0], std::sqrt(.5), .02);
    EXPECT_NEAR(direct[2] / direct[0], std::sqrt(.5), .02);
    EXPECT_NEAR(direct[3] / direct[0], 0, .02);
    EXPECT_NEAR(direct[5] / direct[0], std::sqrt(3) * .5, .02);  // sqrt(3) y z
    // Late sound comes from everywhere: a channel of degree l holds 1 / (2 l + 1) of what W does. It is noise that
    // fades: the variance of a sum of its squares is two thirds of the sum of its fourth powers. Five deviations are
    // exceeded less than once in a million times.
    for (const auto& [from, to] : {std::pair(1u, 4u), std::pair(4u, 9u)}) {
        double energy = 0, variance = 2.0 / 3 * fourth[0] / (late[0] * late[0]);
        for (std::size_t c = from; c < to; ++c) {
            energy += late[c] / late[0];
            variance += 2.0 / 3 * fourth[c] / (late[0] * late[0]);
        }
        EXPECT_NEAR(energy, 1, 5 * std::sqrt(variance));
        EXPECT_LT(5 * std::sqrt(variance), .2);
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
    EXPECT_EQ(level("Shape { geometry Box { size 3 3 3 } }"), 0);                                            // a room
    EXPECT_EQ(level("Transform { translation 0 0 1 children Shape { geometry Box { size 1 1 .1 } } }"), 0);  // a screen
}

TEST_F(Listen, ErrorAsksForAsManyRaysAsItTakes) {
    Scene scene;
    load(scene, room("absorption .3 diffuse .3 specular .4", kPair));
    ListenOptions o = options();
    o.sound = false;
    o.metrics = true;
    o.trace.rays = 200;
    o.error = 0.5;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    const auto& m = report->sources[0].metrics;
    EXPECT_GT(report->rays, 400u);
    for (std::size_t b = 1; b < 7; ++b) {
        EXPECT_LE(m.ci95.t20[b], 0.5 * 0.05 * m.value.t20[b]);
        EXPECT_LE(m.ci95.c80[b], 0.5);
    }
}

TEST_F(Listen, TheReportSaysWhatWasUsedForWhatIsHeard) {
    Scene scene;
    load(scene, room("absorption .3 diffuse .3 specular .4", kPair));
    ListenOptions o = options();
    o.render.ask(3200, 0);
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->heard.responses, 1u);
    EXPECT_EQ(report->heard.rays, 3200u);
    EXPECT_GT(report->heard.images, 100u);
    EXPECT_NE(report->toJson().find(fmt::format(
                  "\"heard\":{{\"responses\":1,\"rays\":3200,\"images\":{},\"error\":null}}}}", report->heard.images)),
              std::string::npos)
        << report->toJson();
}

TEST_F(Listen, DirectSoundComesAfterItsDelayAtItsLevel) {
    for (const int samples : {100, 700, 4800}) {
        Scene scene;
        const double distance = samples * 343.0 / kRate;
        load(scene, "Sound { location 0 0 " + std::to_string(-distance) +
                        " minBack 0 minFront 0 maxBack 70 maxFront 70 source AudioClip { url \"impulse.wav\" } }\n"
                        "Viewpoint { position 0 0 0 }\n");
        const auto report = listen(scene, options());
        ASSERT_TRUE(report) << report.error().text;
        EXPECT_EQ(report->sound.frames(), 9600u);
        const std::size_t at = peak(report->sound, 0);
        EXPECT_EQ(at, static_cast<std::size_t>(samples));
        EXPECT_EQ(peak(report->sound, 1), at);
        // Inner ellipsoid without extent, outer at 70 m: linear in decibels between.
        EXPECT_NEAR(report->sound.samples[2 * at], 0.5 * std::pow(10.0, -distance / 70), 2e-3);
        EXPECT_TRUE(report->diagnostics.all().empty());
    }
}

TEST_F(Listen, PhysicalLevelsFallAsOneOverDistance) {
    std::vector<double> level;
    for (const double distance : {2.0, 4.0}) {
        Scene scene;
        load(scene, "Sound { location 0 0 " + std::to_string(-distance) +
                        " source AudioClip { url \"tone.wav\" } }\nViewpoint { position 0 0 0 }\n");
        ListenOptions o = options();
        o.render.levels = AcousticRenderer::Levels::physical;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report);
        double energy = 0;
        for (std::size_t i = 2 * 4000; i < 2 * 9000; i += 2)
            energy += report->sound.samples[i] * report->sound.samples[i];
        level.push_back(std::sqrt(energy / 5000 * 2));
    }
    EXPECT_NEAR(level[0], 0.5 / 2, 1e-3);
    EXPECT_NEAR(level[1], 0.5 / 4, 1e-3);
}

TEST_F(Listen, SidesAndTheListenersTurn) {
    const auto energies = [&](const std::string& view, bool binaural) {
        Scene scene;
        load(scene, "Sound { location 3 0 0 source AudioClip { url \"tone.wav\" } }\n" + view);
        ListenOptions o = options();
        o.render.binaural = binaural;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        std::array<double, 2> energy{};
        for (std::size_t i = 0; i < report->sound.samples.size(); ++i)
            energy[i % 2] += report->sound.samples[i] * report->sound.samples[i];
        return energy;
    };
    for (const bool binaural : {false, true}) {
        const auto right = energies("Viewpoint { position 0 0 0 }", binaural);
        EXPECT_GT(right[1], 3 * right[0]);
        const auto left = energies("Viewpoint { position 0 0 0 orientation 0 1 0 3.14159265 }", binaural);
        EXPECT_GT(left[0], 3 * left[1]);
        const auto ahead = energies("Viewpoint { position 0 0 0 orientation 0 1 0 -1.57079633 }", binaural);
        EXPECT_NEAR(ahead[0] / ahead[1], 1, binaural ? 0.05 : 1e-3);
        // A listener of its own goes before the viewpoint.
        const auto own = energies("Viewpoint { position 0 0 0 } ListenerPointSource { position 6 0 0 }", binaural);
        EXPECT_GT(own[0], 3 * own[1]);
    }
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
    // of noise of exactly that energy and of arrivals, of which some come so close together that they interfere.
    ListenOptions m = o;
    m.sound = false;
    m.metrics = true;
    m.trace = o.render.trace;
    const auto figures = listen(wet, m);
    ASSERT_TRUE(figures);
    double reflected = 0;
    const TraceResult& traced = figures->sources[0].trace;
    for (const Arrival& arrival : traced.arrivals)
        if (arrival.order > 0) reflected += arrival.energy[4];
    for (const Bands& bin : traced.echogram().late.bins) reflected += bin[4];
    reflected *= 4 * M_PI * 13;  // re direct
    const double heard = energy(b->sound, direct + 60, 28800) / 0.25;
    EXPECT_NEAR(10 * std::log10(heard / reflected), 0, 0.3);
    EXPECT_LE(b->sound.peak(), 1.0f);
}

TEST_F(Listen, AMovingSourceIsShiftedByDoppler) {
    // Towards the listener at 20 m/s: f / (1 - v / c) exactly, which only the emission time gives.
    Scene scene;
    load(scene,
         "DEF Car Transform { translation 0 0 -60 children Sound { minBack 100 minFront 100 maxBack 200 maxFront 200 "
         "source AudioClip { url \"tone.wav\" loop TRUE } } }\n"
         "DEF Clock TimeSensor { cycleInterval 2 loop TRUE }\n"
         "DEF Way PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 -60 0 0 -20 ] }\n"
         "ROUTE Clock.fraction_changed TO Way.set_fraction\nROUTE Way.value_changed TO Car.translation\n"
         "Viewpoint { position 0 0 0 }\n");
    ListenOptions o = options();
    o.seconds = 1.2;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    // Count zero crossings between .5 and 1.1 s.
    double first = 0, last = 0;
    int crossings = 0;
    const auto& x = report->sound.samples;
    for (std::size_t i = kRate / 2; i < static_cast<std::size_t>(1.1 * kRate); ++i)
        if (x[2 * i] < 0 && x[2 * i + 2] >= 0) {
            const double at = static_cast<double>(i) + x[2 * i] / (x[2 * i] - x[2 * i + 2]);
            if (crossings++ == 0) first = at;
            last = at;
        }
    const double frequency = (crossings - 1) / (last - first) * kRate;
    EXPECT_NEAR(frequency, 1000 / (1 - 20 / 343.0), 0.5);
}

TEST_F(Listen, FollowsEditsOfTheScene) {
    Scene scene;
    load(scene,
         "DEF Voice Sound { location 1 0 0 source AudioClip { url \"tone.wav\" loop TRUE } }\nViewpoint { position 0 0 "
         "0 }\n");
    ListenOptions o = options();
    SharedWorld world(scene);
    SoundRenderer listening(world, o);
    ASSERT_EQ(listening.failure(), "");
    scene.newFrame(0);
    const NodeId voice = scene.findName("Voice");
    ASSERT_TRUE(voice);
    scene.newFrame(0.1);
    ASSERT_TRUE(listening.renderFrame());
    ASSERT_TRUE(scene.set(voice, x3d::Sound::enabled, false));
    scene.newFrame(0.2);
    ASSERT_TRUE(listening.renderFrame());
    ASSERT_TRUE(scene.set(voice, x3d::Sound::enabled, true));
    ASSERT_TRUE(scene.set(voice, x3d::Sound::location, Vec3f(-1, 0, 0)));
    scene.newFrame(0.3);
    ASSERT_TRUE(listening.renderFrame());
    ASSERT_TRUE(scene.destroyNode(voice));
    scene.newFrame(0.4);
    ASSERT_TRUE(listening.renderFrame());
    const SoundBuffer sound = listening.finish().sound;
    ASSERT_EQ(sound.frames(), static_cast<std::size_t>(0.4 * kRate));
    const auto energy = [&](double from, double to, std::size_t channel) {
        double sum = 0;
        for (auto i = static_cast<std::size_t>(from * kRate); i < static_cast<std::size_t>(to * kRate); ++i)
            sum += sound.samples[2 * i + channel] * sound.samples[2 * i + channel];
        return sum;
    };
    EXPECT_GT(energy(.02, .1, 1), 4 * energy(.02, .1, 0));
    EXPECT_NEAR(energy(.12, .2, 0) + energy(.12, .2, 1), 0, 1e-6);
    EXPECT_GT(energy(.28, .3, 0), 4 * energy(.28, .3, 1));
    EXPECT_NEAR(energy(.33, .4, 0) + energy(.33, .4, 1), 0, 1e-6);
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
    EXPECT_NEAR(m.value.g[4], 10 * std::log10(exact * 4 * M_PI * 100), 2 * m.ci95.g[4] + .05);
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

TEST_F(Listen, ClipsKeepTheirChannels) {
    SoundBuffer opposite{kRate, 2, {}}, same{kRate, 2, {}}, one{kRate, 1, {}};
    for (int i = 0; i < kRate / 2; ++i) {
        const auto x = static_cast<float>(.4 * std::sin(2 * M_PI * 700 * i / double{kRate}));
        opposite.samples.insert(opposite.samples.end(), {x, -x});
        same.samples.insert(same.samples.end(), {x, x});
        one.samples.push_back(x);
    }
    ASSERT_TRUE(writeWav((folder_ / "opposite.wav").string(), opposite, WavFormat::float32));
    ASSERT_TRUE(writeWav((folder_ / "same.wav").string(), same, WavFormat::float32));
    ASSERT_TRUE(writeWav((folder_ / "one.wav").string(), one, WavFormat::float32));
    const auto hear = [&](const std::string& file, bool spatialize, int mode) {
        Scene scene;
        load(scene, std::string("Sound { location 0 0 -3 spatialize ") + (spatialize ? "TRUE" : "FALSE") +
                        " minBack 9 minFront 9 source AudioClip { url \"" + file +
                        "\" } }\nViewpoint { position 0 0 0 }\n");
        ListenOptions o = options();
        o.render.binaural = mode == 1;
        o.render.ambisonicOrder = mode == 2 ? 1 : 0;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return report->sound;
    };
    for (const bool spatialize : {true, false}) {
        const SoundBuffer both = hear("opposite.wav", spatialize, 0), mono = hear("one.wav", spatialize, 0),
                          pair = hear("same.wav", spatialize, 0);
        double most = 0;
        for (std::size_t i = 0; i < mono.frames(); ++i) {
            ASSERT_NEAR(both.samples[2 * i], -both.samples[2 * i + 1], 1e-6);
            ASSERT_NEAR(pair.samples[2 * i], mono.samples[2 * i], 1e-6);
            ASSERT_NEAR(both.samples[2 * i], mono.samples[2 * i], 1e-6);
            most = std::max(most, std::abs(static_cast<double>(mono.samples[2 * i])));
        }
        EXPECT_NEAR(most, .4, 2e-3);
    }
    EXPECT_GT(hear("opposite.wav", true, 1).peak(), .05f);
    EXPECT_GT(hear("opposite.wav", false, 1).peak(), .3f);
    EXPECT_GT(hear("opposite.wav", true, 2).peak(), .1f);
}

TEST_F(Listen, PlainStereoHasTheSameEnergyInEveryDirection) {
    for (int degrees = 0; degrees < 360; degrees += 30) {
        const double a = degrees * M_PI / 180;
        Scene scene;
        load(scene,
             fmt::format("Sound {{ location {} 0 {} minBack 9 minFront 9 source AudioClip {{ url \"tone.wav\" }} }}\n"
                         "Viewpoint {{ position 0 0 0 }}\n",
                         3.43 * std::sin(a), -3.43 * std::cos(a)));
        const auto report = listen(scene, options());
        ASSERT_TRUE(report);
        std::array<double, 2> energy{};
        for (std::size_t i = 2 * 1000; i < 2 * 9400; ++i)
            energy[i % 2] += std::pow(static_cast<double>(report->sound.samples[i]), 2) / 8400;
        EXPECT_NEAR(10 * std::log10((energy[0] + energy[1]) / .25), 0, .01) << degrees;
        EXPECT_NEAR(energy[1] / (energy[0] + energy[1]), (1 + .9 * std::sin(a)) / 2, 1e-3) << degrees;
    }
}

TEST_F(Listen, AClipBesideAnInlinedFileIsFound) {
    fs::create_directories(folder_ / "parts" / "sounds");
    SoundBuffer loud{kRate, 1, std::vector<float>(kRate / 10, .5f)};
    ASSERT_TRUE(writeWav((folder_ / "parts" / "sounds" / "beside.wav").string(), loud, WavFormat::float32));
    std::ofstream(folder_ / "parts" / "inner.x3dv")
        << "#X3D V4.0 utf8\nPROFILE Full\nSound { location 0 0 -3 minBack 9 minFront 9 source AudioClip { url "
           "\"sounds/beside.wav\" } }\n";
    std::ofstream(folder_ / "outer.x3dv")
        << "#X3D V4.0 utf8\nPROFILE Full\nInline { url \"parts/inner.x3dv\" }\nViewpoint { position 0 0 0 }\n";
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, (folder_ / "outer.x3dv").string(), diagnostics));
    const auto report = listen(scene, options());
    ASSERT_TRUE(report);
    for (const Diagnostic& d : report->diagnostics.all()) ADD_FAILURE() << d.format();
    EXPECT_NEAR(report->sound.samples[2 * 2000], .5f, 1e-3);
    // And without saying where urls start.
    ListenOptions plain;
    plain.seconds = .2;
    plain.metrics = false;
    plain.render.resources = Resources::ofFile((folder_ / "outer.x3dv").string());
    const auto again = listen(scene, plain);
    ASSERT_TRUE(again);
    for (const Diagnostic& d : again->diagnostics.all()) ADD_FAILURE() << d.format();
}

TEST_F(Listen, AnAudioDestinationAtTheRootIsHeard) {
    Scene scene;
    load(scene,
         "DEF Out AudioDestination { gain .5 children OscillatorSource { frequency 480 } }\n"
         "Viewpoint { position 500 0 0 }\n" +
             room("absorption .1", ""));
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    scene.newFrame(0);
    scene.newFrame(.1);
    ASSERT_TRUE(sound.renderFrame());
    for (std::size_t i = 0; i < 4800; ++i)
        for (std::size_t c = 0; c < 2; ++c)
            ASSERT_NEAR(sound.block()[2 * i + c], .5 * std::sin(2 * M_PI * 480 * static_cast<double>(i) / kRate), 1e-5)
                << i;
    ASSERT_TRUE(scene.set(scene.findName("Out"), x3d::AudioDestination::gain, .25f));
    scene.newFrame(.2);
    ASSERT_TRUE(sound.renderFrame());
    EXPECT_NEAR(*std::max_element(sound.block().begin() + 4000, sound.block().end()), .25f, 1e-3);
    EXPECT_TRUE(sound.finish().diagnostics.all().empty());
}

TEST_F(Listen, ImpulseResponsesHaveTheChannelsAskedFor) {
    using Channels = ImpulseResponseOptions::Channels;
    Scene scene;
    load(scene, room("absorption .3 diffuse .3 specular .4",
                     "DEF A Sound { location 5.5 3 1.5 source AudioClip { url \"impulse.wav\" } }\n"
                     "DEF B Sound { location 4 3 .5 source AudioClip { url \"impulse.wav\" } }\n"
                     "Viewpoint { position 4 3 1.5 }\n"));
    ListenOptions o = options();
    o.sound = false;
    o.metrics = true;
    o.trace.rays = 480;
    const auto response = [&](Channels channels, int order) {
        o.responses = channels;
        o.render.ambisonicOrder = order;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return report->impulseResponses();
    };
    const auto peak = [](const SoundBuffer& sound, std::size_t channel) {
        const auto channels = static_cast<std::size_t>(sound.channels);
        std::size_t best = 0;
        for (std::size_t i = 0; i < 300; ++i)
            if (std::abs(sound.samples[i * channels + channel]) > std::abs(sound.samples[best * channels + channel]))
                best = i;
        return std::pair(best, static_cast<double>(sound.samples[best * channels + channel]));
    };
    EXPECT_EQ(response(Channels::mono, 0).channels, 2);  // two sources
    const SoundBuffer stereo = response(Channels::stereo, 0);
    ASSERT_EQ(stereo.channels, 4);
    // A is 1.5 m to the right.
    EXPECT_NEAR(peak(stereo, 1).second / peak(stereo, 0).second, std::sqrt(1.9 / .1), .1);
    EXPECT_NEAR(peak(stereo, 3).second / peak(stereo, 2).second, 1, 1e-3);
    const SoundBuffer ears = response(Channels::binaural, 0);
    ASSERT_EQ(ears.channels, 4);
    EXPECT_NEAR(static_cast<double>(peak(ears, 0).first) - static_cast<double>(peak(ears, 1).first),
                .0875 / 343 * (1 + M_PI / 2) * kRate, 1.5);
    const SoundBuffer field = response(Channels::ambisonic, 2);
    ASSERT_EQ(field.channels, 18);
    EXPECT_NEAR(peak(field, 1).second / peak(field, 0).second, -1, .05);     // Y: left
    EXPECT_NEAR(peak(field, 9 + 3).second / peak(field, 9).second, 1, .05);  // X: ahead
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
    for (const std::size_t b : {4u, 5u, 6u}) {
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

TEST_F(Listen, ANodeRendererAddsTheVoiceOfItsNodes) {
    Scene scene;
    load(scene, "DEF Bell WorldInfo { title \"bell\" }\nViewpoint { position 0 0 0 }\n");
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    int called = 0;
    double end = 0;
    sound.registerNodeRenderer(
        "WorldInfo", nodeRendererFor<SoundRenderer>([&](SoundRenderer& s, const Node& node, Operation o) -> Result<> {
            EXPECT_EQ(o, SoundRenderer::kVoice);
            EXPECT_EQ(scene.name(node.id()), "Bell");
            EXPECT_NEAR(s.blockStart(), end, 1e-9);
            const auto channels = static_cast<std::size_t>(s.channels());
            end += static_cast<double>(s.block().size() / channels) / s.sampleRate();
            for (float& sample : s.block()) sample += .25f;
            ++called;
            return {};
        }));
    for (int frame = 1; frame <= 4; ++frame) {
        scene.newFrame(frame * .05);
        ASSERT_TRUE(sound.renderFrame());
    }
    EXPECT_EQ(called, 4);
    const SoundBuffer heard = sound.finish().sound;
    ASSERT_EQ(heard.frames(), static_cast<std::size_t>(.2 * kRate));
    for (const float sample : heard.samples) ASSERT_FLOAT_EQ(sample, .25f);
}

TEST_F(Listen, TheSameSceneGivesTheSameSamples) {
    std::vector<SoundBuffer> sounds;
    for (int i = 0; i < 2; ++i) {
        Scene scene;
        load(scene,
             room("absorption .3 diffuse .3 specular .4",
                  "DEF Move Transform { children " + kPair.substr(0, kPair.find('\n')) +
                      " }\n"
                      "DEF Clock TimeSensor { cycleInterval 1 loop TRUE }\n"
                      "DEF Way PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0 3 1 0 ] }\n"
                      "ROUTE Clock.fraction_changed TO Way.set_fraction\nROUTE Way.value_changed TO Move.translation\n"
                      "Viewpoint { position 4 3 1.5 }\n"));
        ListenOptions o = options();
        o.seconds = 0.5;
        o.render.binaural = true;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report);
        sounds.push_back(report->sound);
    }
    EXPECT_EQ(sounds[0].samples, sounds[1].samples);
    EXPECT_GT(sounds[0].peak(), 0.01f);
}

TEST_F(Listen, WhatIsMissingIsSaid) {
    Scene silent;
    load(silent, "Viewpoint { }");
    const auto nothing = listen(silent, options());
    ASSERT_TRUE(nothing);
    EXPECT_EQ(nothing->diagnostics.warnings(), 1u);
    EXPECT_EQ(nothing->sound.frames(), 9600u);
    EXPECT_EQ(nothing->sound.peak(), 0.0f);

    Scene missing;
    load(missing,
         "Sound { source AudioClip { description \"none\" url [ \"no.wav\" \"http://example.org/x.wav\" ] } "
         "}\nViewpoint { position 0 0 1 }");
    const auto replaced = listen(missing, options());
    ASSERT_TRUE(replaced);
    ASSERT_EQ(replaced->diagnostics.warnings(), 1u);
    EXPECT_NE(replaced->diagnostics.all()[0].text.find("no.wav"), std::string::npos);
    EXPECT_GT(replaced->sound.peak(), 0.1f);

    ListenOptions bad = options();
    bad.seconds = -1;
    EXPECT_FALSE(listen(silent, bad));
    bad = options();
    bad.render.sampleRate = 3;
    EXPECT_FALSE(listen(silent, bad));
}

TEST_F(Listen, AbsurdNumbersAreHarmless) {
    for (const std::string place : {"1e30 0 0", "1e9 1e9 0", "0 0 0", "30000 0 0", "1e-30 0 0"}) {
        Scene scene;
        load(scene, "DEF T Transform { translation " + place +
                        " scale 1 1e-20 1 children [ DEF S Sound { minFront 0 minBack 1e30 maxFront 1e38 maxBack 1e38 "
                        "source DEF C "
                        "AudioClip { url \"tone.wav\" loop TRUE pitch 1e30 startTime -1e300 } } SpatialSound { "
                        "referenceDistance 0 children OscillatorSource { frequency 1e30 } } ] }\n"
                        "Shape { geometry Box { size 1e15 1 1e-15 } }\nViewpoint { position 0 0 0 }\n");
        ListenOptions o = options();
        o.metrics = true;
        o.trace.rays = 100;
        const auto before = listen(scene, o);
        ASSERT_TRUE(before) << before.error().text;
        const float nan = std::numeric_limits<float>::quiet_NaN();
        const NodeId sound = scene.findName("S");
        (void)scene.set(sound, x3d::Sound::intensity, nan);
        (void)scene.set(sound, x3d::Sound::location, Vec3f(nan, 0, 0));
        (void)scene.set(sound, x3d::Sound::maxFront, std::numeric_limits<float>::infinity());
        (void)scene.set(scene.findName("C"), x3d::AudioClip::pitch, nan);
        (void)scene.set(scene.findName("T"), x3d::Transform::translation, Vec3f(nan, nan, nan));
        const auto after = listen(scene, o);
        ASSERT_TRUE(after) << after.error().text;
        for (const auto* report : {&*before, &*after})
            for (const float sample : report->sound.samples) ASSERT_TRUE(std::isfinite(sample)) << place;
    }
}

TEST_F(Listen, EllipsoidsAndDistanceLaws) {
    SoundNode sound;
    sound.minFront = 2, sound.minBack = 1, sound.maxFront = 10, sound.maxBack = 5;
    EXPECT_NEAR(sound.level({0, 0, 1.9}), 1, 1e-12);
    EXPECT_NEAR(sound.level({0, 0, -0.9}), 1, 1e-12);
    EXPECT_NEAR(sound.level({0, 0, 6}), 0.1 * std::pow(10, 0.5), 1e-12);  // half way: -10 dB
    EXPECT_NEAR(sound.level({0, 0, -3}), 0.1 * std::pow(10, 0.5), 1e-12);
    EXPECT_EQ(sound.level({0, 0, 10.1}), 0);
    EXPECT_EQ(sound.level({0, 0, -5.1}), 0);
    // At right angles the radius is the harmonic mean 2 f b / (f + b).
    EXPECT_NEAR(sound.level({4.0 / 3 - 1e-9, 0, 0}), 1, 1e-9);
    EXPECT_GT(sound.level({20.0 / 3 - 1e-6, 0, 0}), 0.09);
    EXPECT_EQ(sound.level({20.0 / 3 + 1e-6, 0, 0}), 0);
    sound.law = SoundNode::Law::inverse;
    EXPECT_NEAR(sound.level({0, 4, 0}), 0.25, 1e-12);
    sound.law = SoundNode::Law::linear;
    sound.maxDistance = 11;
    EXPECT_NEAR(sound.level({0, 6, 0}), 0.5, 1e-12);
    sound.law = SoundNode::Law::exponential;
    sound.rolloff = 2;
    EXPECT_NEAR(sound.level({0, 3, 0}), 1.0 / 9, 1e-12);
    sound.coneInner = 1, sound.coneOuter = 2, sound.coneOuterGain = .2;
    EXPECT_EQ(sound.coneGain({0, 0, 3}), 1);
    EXPECT_EQ(sound.coneGain({0, 0, -3}), .2);
    EXPECT_NEAR(sound.coneGain({std::sin(.75), 0, std::cos(.75)}), .6, 1e-9);
}

TEST_F(Listen, AcousticPropertiesAreShares) {
    const auto material = [&](const std::string& fields) {
        Scene scene;
        load(scene, "DEF S Shape { appearance Appearance { acousticProperties DEF A AcousticProperties { " + fields +
                        " } } }");
        return acousticMaterial(scene, scene.node(scene.findName("A")), AcousticMaterial{});
    };
    const AcousticMaterial shares = material("absorption .2 diffuse .2 specular .6");
    EXPECT_NEAR(shares.absorption[0], .2, 1e-6);
    EXPECT_NEAR(shares.scattering[0], .25, 1e-6);
    EXPECT_EQ(shares.transmission[0], 0);
    EXPECT_EQ(material("absorption .1").scattering[3], 0);
    EXPECT_NEAR(material("absorption .1 diffuse .9").scattering[3], 1, 1e-6);
    EXPECT_NEAR(material("absorption .1 diffuse .45").scattering[3], .5, 1e-6);
    EXPECT_NEAR(material("absorption .4 refraction .8").transmission[3], .6, 1e-6);
    EXPECT_NEAR(material("enabled FALSE absorption .9").absorption[0], AcousticMaterial{}.absorption[0], 1e-12);
    const AcousticMaterial bands = material(
        "absorption .5 metadata MetadataSet { value [ MetadataFloat { name \"absorption\" value [ .1 .2 .3 .4 .5 .6 ] "
        "} ] }");
    EXPECT_NEAR(bands.absorption[0], .1, 1e-6);
    EXPECT_NEAR(bands.absorption[1], .1, 1e-6);
    EXPECT_NEAR(bands.absorption[6], .6, 1e-6);
    EXPECT_NEAR(bands.absorption[7], .6, 1e-6);
}

}  // namespace
}  // namespace rtsg
