// Heads without a SOFA file of sound that does not wait: another one is made on another thread, and heard once it is
// there.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

#include "audio/signal/rigid_sphere.h"
#include "engine/acoustic_engine.h"
#include "signal/hrtf_impl.h"

namespace rtsg {
namespace {

constexpr double kHeadTone = 500;

/// A tone 5 m ahead and to the right, and who listens to it with ears so far apart, block by block.
class OneTone {
  public:
    explicit OneTone(bool background) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene_,
                             "#X3D V4.0 utf8\nPROFILE Full\nSpatialSound { location 4 0 -3 rolloffFactor 0 enableHRTF "
                             "TRUE children OscillatorSource { frequency 500 } }\n"
                             "DEF Ear ListenerPointSource { position 0 0 0 interauralDistance .2 }\n",
                             diagnostics));
        world_.add(tables_);
        AcousticOptions options;
        options.reflections = false;
        options.background = background;
        engine_ = *AcousticEngine::create(options);
        scene_.newFrame(0);
        engine_->prepare(*tables_.latest());
    }
    ~OneTone() { world_.remove(tables_); }

    void setEars(float apart) {
        ASSERT_TRUE(scene_.set(scene_.findName("Ear"), x3d::ListenerPointSource::interauralDistance, apart));
        scene_.newFrame(engine_->liveEnd());
    }
    void blocks(int count) {
        const std::shared_ptr<const RayView> rays(std::shared_ptr<const RayView>(), &world_.rays());
        for (int i = 0; i < count; ++i)
            ASSERT_TRUE(engine_->renderLive(tables_.latest(), rays, engine_->liveEnd(), sound_));
    }
    /// The sound at the right ear relative to the left one, over the last fifth of a second.
    std::complex<double> right() const {
        std::array<std::complex<double>, 2> sums{};
        const std::size_t frames = sound_.samples.size() / 2;
        for (std::size_t i = frames - 9600; i < frames; ++i)
            for (std::size_t e = 0; e < 2; ++e)
                sums[e] += static_cast<double>(sound_.samples[2 * i + e]) *
                           std::polar(1.0, -2 * std::numbers::pi * kHeadTone * static_cast<double>(i) / 48000);
        return sums[1] / sums[0];
    }
    const std::vector<float>& samples() const { return sound_.samples; }

  private:
    Scene scene_;
    SharedWorld world_{scene_};
    AcousticTables tables_{world_.rays()};
    std::unique_ptr<AcousticEngine> engine_;
    SoundBuffer sound_;
};

std::complex<double> rightOnSphere(double apart) {
    const double azimuth = std::atan2(4, 3) * 180 / std::numbers::pi;
    return test::earOnSphere(apart / 2, kHeadTone, azimuth, 1) / test::earOnSphere(apart / 2, kHeadTone, azimuth, 0);
}

TEST(HeadMaker, TheThreadOfSoundMakesNoHead) {
    OneTone tone(true);
    tone.blocks(200);
    EXPECT_LT(std::abs(tone.right() - rightOnSphere(.2)), 2e-3);
    std::uint64_t before = spheresComputedHere();
    std::size_t from = tone.samples().size();
    // None of these sizes is any other test's; the middle ones may never be heard.
    for (const float apart : {.3511f, .3311f, .3111f}) {
        tone.setEars(apart);
        tone.blocks(1);
    }
    EXPECT_GT(before, 0u) << "the first, before any sound";
    // Not before it is there, and then for good.
    const auto start = std::chrono::steady_clock::now();
    while (std::abs(tone.right() - rightOnSphere(.3111f)) > 2e-3 &&
           std::chrono::steady_clock::now() - start < std::chrono::seconds(60)) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        tone.blocks(1);
    }
    EXPECT_LT(std::abs(tone.right() - rightOnSphere(.3111f)), 2e-3);
    EXPECT_EQ(spheresComputedHere(), before);
    // One fades into the other: nothing is steeper than the tone is at twice its level.
    float loudest = 0, steepest = 0;
    for (std::size_t i = from; i < tone.samples().size(); ++i) {
        loudest = std::max(loudest, std::abs(tone.samples()[i]));
        steepest = std::max(steepest, std::abs(tone.samples()[i] - tone.samples()[i - 2]));
    }
    EXPECT_LT(steepest, 2 * loudest * 2 * std::numbers::pi * kHeadTone / 48000);
    // Sound that waits makes its own, at once and so always the same.
    OneTone waits(false);
    waits.blocks(10);
    before = spheresComputedHere();
    waits.setEars(.3711f);
    waits.blocks(60);
    EXPECT_EQ(spheresComputedHere(), before + 1);
    EXPECT_LT(std::abs(waits.right() - rightOnSphere(.3711f)), 2e-3);
}

}  // namespace
}  // namespace rtsg
