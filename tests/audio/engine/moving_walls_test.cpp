// Walls that move into the straight way of live sound, and out of it: what bends round them takes over without a gap.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

#include "engine/acoustic_engine.h"

namespace rtsg {
namespace {

constexpr double kWindow = 0.02, kFrame = 1.0 / 60;

/// A noise that repeats a hundred times a second, so that each window has two of it, whole.
std::string periodicNoise() {
    std::string samples;
    std::uint32_t state = 12345;
    for (int i = 0; i < 480; ++i) {
        state = state * 1664525 + 1013904223;
        samples += fmt::format("{:.4f} ", static_cast<double>(state >> 8) / (1 << 23) - 1);
    }
    return "BufferAudioSource { loop TRUE bufferDuration .01 sampleRate 48000 buffer [ " + samples + "] }";
}

struct Moving {
    std::string walls;  // besides
    std::string body;
    std::function<glm::dvec3(double)> positionAt;  // of the body
    std::function<glm::dvec3(double)> listener = [](double) { return glm::dvec3(4, 0, 0); };
    double seconds = 0;
    bool carries = false;  // the source is in the body
    /// On a thread of its own, at half the speed of time as the machine may be busy; else as fast as it goes.
    bool background = false;
};

/// The scene, and an engine that hears it.
class Heard {
  public:
    explicit Heard(const Moving& moving) : moving_(moving) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene_,
                             "#X3D V4.0 utf8\nPROFILE Full\nDEF Body Transform { children [ " + moving.body +
                                 (moving.carries ? sound() + " ] }\n" : " ] }\n" + sound()) + moving.walls +
                                 "DEF Ear ListenerPointSource { }\n",
                             diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.text;
        number_ = world_.add(tables_);
        AcousticOptions options;
        options.ambisonicOrder = 1;
        options.levels = AcousticOptions::Levels::physical;
        options.trace.rays = 50;
        options.trace.maxSeconds = .5;
        options.trace.air.absorbs = false;
        options.background = moving.background;
        engine_ = *AcousticEngine::create(options);
    }
    ~Heard() { world_.remove(tables_); }

    /// Levels of windows, dB.
    std::vector<double> levels() {
        int frame = 0;
        for (double t = 0; t < moving_.seconds; t = engine_->liveEnd()) {
            if (t >= frame * kFrame) goTo(kFrame * frame++);
            EXPECT_TRUE(engine_->renderLive(state_, rays_, t, sound_));
            // Block by block: what was stopped for a while does not hurry on, with nothing traced.
            if (moving_.background) std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        std::vector<double> levels;
        const auto size = static_cast<std::size_t>(kWindow * 48000);
        const auto channels = static_cast<std::size_t>(sound_.channels);
        for (std::size_t from = 0; from + size <= sound_.frames(); from += size) {
            double energy = 0;
            for (std::size_t i = from; i < from + size; ++i)
                energy += std::pow(static_cast<double>(sound_.samples[i * channels]), 2);
            levels.push_back(10 * std::log10(energy / static_cast<double>(size)));
        }
        return levels;
    }

    std::uint64_t responses() const { return engine_->heard().responses; }

  private:
    static std::string sound() {
        return "Sound { minBack 300 minFront 300 maxBack 900 maxFront 900 source " + periodicNoise() + " }\n";
    }
    void goTo(double t) {
        EXPECT_TRUE(scene_.set(scene_.findName("Body"), x3d::Transform::translation, Vec3f(moving_.positionAt(t))));
        EXPECT_TRUE(scene_.set(scene_.findName("Ear"), x3d::ListenerPointSource::position, Vec3f(moving_.listener(t))));
        scene_.newFrame(t);
        const auto present = world_.present();
        ASSERT_TRUE(present) << present.error().text;
        state_ = std::static_pointer_cast<const AcousticState>((*present)->of(number_));
        rays_ = (*present)->rays;
    }

    Moving moving_;
    Scene scene_;
    SharedWorld world_{scene_};
    AcousticTables tables_{world_.rays()};
    std::uint64_t number_ = 0;
    std::unique_ptr<AcousticEngine> engine_;
    SoundBuffer sound_;
    std::shared_ptr<const AcousticState> state_;
    std::shared_ptr<const RayView> rays_;
};

/// From `z` on with nothing that moves.
double restingLevel(const std::string& body, double z) {
    return Heard({.walls = "", .body = body, .positionAt = [z](double) { return glm::dvec3(2, 0, z); }, .seconds = .3})
        .levels()
        .back();
}

/// The sound while a body crosses the direct path, beside the sound with the body at rest anywhere on its path.
struct Resting {
    double far = 0, in = 0, lowest = 100, highest = -100;
};
constexpr double kFar = -1.2;

Resting restingLevels(const std::string& body) {
    Resting all;
    constexpr int kSteps = 12;
    for (int i = 0; i <= kSteps; ++i) {
        const double level = restingLevel(body, kFar * (kSteps - i) / kSteps);
        if (i == 0) all.far = level;
        all.in = level;
        all.lowest = std::min(all.lowest, level);
        all.highest = std::max(all.highest, level);
    }
    return all;
}
void staysBetween(const Resting& resting, const std::string& body, bool background) {
    ASSERT_GT(resting.highest, resting.lowest + 8);
    const auto levels = Heard({.walls = "",
                               .body = body,
                               .positionAt =
                                   [](double t) {
                                       const double in = kFar * (1 - std::clamp((t - .4) / .8, 0.0, 1.0));
                                       return glm::dvec3(2, 0, in - kFar * std::clamp((t - 1.6) / .8, 0.0, 1.0));
                                   },
                               .seconds = 2.8,
                               .background = background})
                            .levels();
    for (std::size_t i = 10; i < levels.size(); ++i) {
        const double t = static_cast<double>(i) * kWindow;
        EXPECT_GT(levels[i], resting.lowest - 3) << body << " at " << t << " s";
        EXPECT_LT(levels[i], resting.highest + 3) << body << " at " << t << " s";
    }
    EXPECT_NEAR(levels[79], resting.in, .5) << "while it rests in the way";
    EXPECT_NEAR(levels.back(), resting.far, .5) << "when it has gone by";
}
void staysBetweenRestingLevels(const std::string& body) {
    const Resting resting = restingLevels(body);
    for (const bool background : {false, true}) staysBetween(resting, body, background);
}

const char* const kBox = "Shape { geometry Box { size .8 2 .8 } }";
const char* const kColumn = "Shape { geometry Cylinder { radius .4 height 2 } }";

TEST(MovingWalls, WhatBendsRoundABoxTakesOverWithoutAGap) {
    staysBetweenRestingLevels(kBox);
}

TEST(MovingWalls, WhatBendsRoundAColumnTakesOverWithoutAGap) {
    staysBetweenRestingLevels(kColumn);
}

TEST(MovingWalls, AWallThatIsThereAtOnceEndsDirectSoundWithTheNextTrace) {
    for (const bool background : {false, true}) {
        const auto levels = Heard({.walls = "",
                                   .body = kBox,
                                   .positionAt = [](double t) { return glm::dvec3(2, 0, t > .5 && t < 1.3 ? 0 : -3); },
                                   .seconds = 2,
                                   .background = background})
                                .levels();
        const double open = levels[20], shut = restingLevel(kBox, 0);
        for (std::size_t i = 26; i < 65; ++i) EXPECT_GT(levels[i], shut - 3) << i;
        for (std::size_t i = 40; i < 65; ++i) EXPECT_LT(levels[i], shut + 1) << i << ": .3 s later";
        for (std::size_t i = 65; i < levels.size(); ++i) EXPECT_GT(levels[i], shut - 3) << i;
        for (std::size_t i = 80; i < levels.size(); ++i) EXPECT_NEAR(levels[i], open, 1) << i << ": .3 s later";
    }
}

/// Something that moves beside the straight way, out of it, changes nothing of how a wall that rests is followed.
TEST(MovingWalls, WallsThatRestCountInEveryBlockWhileOthersMove) {
    const auto levelsBeside = [](double swing) {
        return Heard({.walls = "Transform { translation 2 0 2.5 children Shape { geometry Box { size .2 6 4 } } }\n",
                      .body = "Shape { geometry Box { size .02 .02 .02 } }",
                      .positionAt = [=](double t) { return glm::dvec3(1 + swing * std::sin(20 * t), .2, 0); },
                      .listener = [](double t) { return glm::dvec3(4, 0, std::clamp(t - .3, 0.0, 1.5)); },
                      .seconds = 1.8})
            .levels();
    };
    const auto still = levelsBeside(0), moving = levelsBeside(.1);
    ASSERT_LT(still[80], still[20] - 8) << "into the shadow";
    for (std::size_t i = 10; i < still.size(); ++i) EXPECT_NEAR(moving[i], still[i], 1) << i;
}

/// Beside the way of its sound, nearer than a source goes while that is on its way: it never comes into it.
TEST(MovingWalls, TheBodyOfAVehicleDoesNotCoverTheSoundThatItCarries) {
    const auto driven = [](double speed) {
        return Heard({.walls = "",
                      .body = "Transform { translation .4 0 -.33 children Shape { geometry Box { size .6 .6 .6 } } }\n",
                      .positionAt = [=](double t) { return glm::dvec3(0, 0, speed * t); },
                      .listener = [=](double t) { return glm::dvec3(10, 0, speed * t); },
                      .seconds = 1.5,
                      .carries = true});
    };
    Heard still = driven(0), moving = driven(1);
    const std::vector<double> before = still.levels(), levels = moving.levels();
    for (std::size_t i = 10; i < levels.size(); ++i) EXPECT_NEAR(levels[i], before[i], 1) << i;
    EXPECT_LE(moving.responses(), 9u) << "each .2 s";
}

}  // namespace
}  // namespace rtsg
