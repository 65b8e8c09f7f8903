// A folder with sounds to play, and scenes that play them; for tests of listening.
#pragma once

#include <cmath>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "support/temp_folder.h"

namespace rtsg::test {

/// A folder of its own with sounds to play: an impulse, a constant tone.
class Listen : public testing::Test {
  protected:
    static constexpr int kRate = 48000;

    void SetUp() override {
        SoundBuffer impulse{kRate, 1, std::vector<float>(kRate / 10)};
        impulse.samples[0] = 0.5f;
        ASSERT_TRUE(writeWav((folder_ / "impulse.wav").string(), impulse, WavFormat::float32));
        SoundBuffer tone{kRate, 1, {}};
        for (int i = 0; i < kRate; ++i)
            tone.samples.push_back(static_cast<float>(0.5 * std::sin(2 * M_PI * 1000 * i / double{kRate})));
        ASSERT_TRUE(writeWav((folder_ / "tone.wav").string(), tone, WavFormat::float32));
    }

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
        o.render.resources = folder_;
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

    const TempFolder own_;
    const std::filesystem::path folder_ = own_.path();
};

inline std::string room(const std::string& properties, const std::string& rest) {
    return "Transform { translation 3 2.5 1.5 children Shape { geometry Box { size 6 5 3 solid FALSE } "
           "appearance Appearance { acousticProperties AcousticProperties { " +
           properties + " } } } }\n" + rest;
}
inline const std::string kPair =
    "DEF Voice Sound { location 1 1 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source AudioClip { url "
    "\"impulse.wav\" } }\nViewpoint { position 4 3 1.5 }\n";

}  // namespace rtsg::test
