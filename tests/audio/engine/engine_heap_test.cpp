// Blocks of sound take nothing from the heap once all that plays has been heard.
#include <memory>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

#include "engine/acoustic_engine.h"
#include "support/counted_heap.h"

namespace rtsg {
namespace {

const std::filesystem::path kMeasuredEars = "/usr/share/libmysofa/default.sofa";

/// A room that sounds, block by block, as live sound has it; its state changes only when `next` says so.
class Sounding {
  public:
    Sounding(const std::string& text, AcousticOptions options) {
        Diagnostics diagnostics;
        EXPECT_TRUE(
            loadText(scene_,
                     "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 1 0 }\nTransform { translation 0 1 0 "
                     "children Shape { geometry Box { size 8 3 6 solid FALSE } appearance Appearance { "
                     "acousticProperties AcousticProperties { absorption .2 diffuse .4 specular .4 } } } }\n" +
                         text,
                     diagnostics));
        world_.add(tables_);
        options.trace.rays = 200;
        options.trace.maxImageCandidates = 100;
        engine_ = *AcousticEngine::create(options);
        sound_.samples.reserve(64 * 256);
    }
    ~Sounding() { world_.remove(tables_); }
    void next() {
        const double t = engine_->liveEnd();
        if (const NodeId moves = scene_.findName("Moves"); moves.value) {
            EXPECT_TRUE(scene_.set(moves, x3d::Transform::translation, Vec3f(static_cast<float>(std::sin(t)), 0, 0)));
        }
        scene_.newFrame(t);
        state_ = tables_.latest();
        rays_ = std::shared_ptr<const RayView>(std::shared_ptr<const RayView>(), &world_.rays());
    }
    void blocks(int count) {
        for (int i = 0; i < count; ++i) {
            sound_.samples.clear();
            rendered_ = engine_->renderLive(state_, rays_, engine_->liveEnd(), sound_).has_value() && rendered_;
            for (const float sample : sound_.samples) loudest_ = std::max(loudest_, std::abs(sample));
        }
    }
    bool rendered() const { return rendered_; }
    float loudest() const { return loudest_; }
    const Diagnostics& said() const { return engine_->diagnostics(); }

  private:
    Scene scene_;
    SharedWorld world_{scene_};
    AcousticTables tables_{world_.rays()};
    std::unique_ptr<AcousticEngine> engine_;
    std::shared_ptr<const AcousticState> state_;
    std::shared_ptr<const RayView> rays_;
    SoundBuffer sound_;
    bool rendered_ = true;
    float loudest_ = 0;
};

TEST(EngineHeap, ABlockTakesNothingOnceAllThatPlaysHasBeenHeard) {
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer owns the heap";
    const std::string tone = "OscillatorSource { frequency 300 gain .1 }",
                      pair =
                          "BufferAudioSource { numberOfChannels 2 sampleRate 48000 loop TRUE buffer [ .1 -.1 .2 .1 ] }";
    const auto placed = [](const std::string& fields, const std::string& source) {
        return "SpatialSound { " + fields + " location 1 1 -2 children [ " + source + " ] }\n";
    };
    AcousticOptions plain, binaural, ambisonic, direct;
    binaural.binaural = true;
    ambisonic.ambisonicOrder = 3;
    direct.reflections = false;
    struct Case {
        const char* name;
        std::string text;
        AcousticOptions options;
    };
    std::vector<Case> cases{
        {"direct", placed("", tone), direct},
        {"reflected", placed("", tone), plain},
        {"two channels, two and one together", placed("", pair) + placed("", tone) + placed("", pair + tone), plain},
        {"without a place", "AudioDestination { maxChannelCount 1 children [ " + pair + tone + " ] }", plain},
        {"in a thing that sounds",
         "Transform { translation 1 1 -2 children [ Shape { geometry Box { size .3 .3 .3 } } "
         "SpatialSound { children " +
             tone + " } ] }",
         plain},
        {"on a wall", placed("", tone) + "SpatialSound { location 1 -.5 -2 children " + tone + " }", plain},
        {"behind a screen",
         placed("", tone) + "Shape { geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 3 ] coord Coordinate { "
                            "point [ -2 0 -1, 2 0 -1, 2 2 -1, -2 2 -1 ] } } }",
         plain},
        {"a sphere", placed("enableHRTF TRUE", tone) + "ListenerPointSource { position 0 1 0 interauralDistance .2 }",
         plain},
        {"ambisonic", placed("", tone), ambisonic},
        {"a graph",
         placed("",
                "Gain { gain .5 children [ BiquadFilter { children Delay { delayTime .01 children " + pair +
                    " } } Convolver { buffer [ 1 .5 .2 ] children " + tone +
                    " } DynamicsCompressor { children WaveShaper { oversample \"2X\" children " + tone +
                    " } } ChannelMerger { children [ ChannelSelector { channelSelection 1 children ChannelSplitter { "
                    "children " +
                    pair + " } } Analyser { children " + tone + " } ] } SpatialSound { location 2 0 0 children " +
                    pair + " } SpatialSound { location 2 0 0 enableHRTF TRUE children " + tone + " } ] }"),
         direct},
    };
    if (std::filesystem::exists(kMeasuredEars)) {
        binaural.hrtf = *Hrtf::load(kMeasuredEars, 48000);
        cases.push_back({"through a head", placed("", tone), binaural});
    }
    for (const Case& one : cases)
        for (const bool moves : {false, true}) {
            SCOPED_TRACE(fmt::format("{}{}", one.name, moves ? ", on its way" : ""));
            Sounding sounding(moves ? "DEF Moves Transform { children [ " + one.text + " ] }" : one.text, one.options);
            for (int i = 0; i < 5; ++i) {
                sounding.next();
                sounding.blocks(60);
            }
            // The state stays the same, and its room has been traced; sound on its way goes on.
            sounding.blocks(120);
            EXPECT_EQ(test::allocationsOf([&] { sounding.blocks(50); }), 0u);
            EXPECT_TRUE(sounding.rendered());
            EXPECT_GT(sounding.loudest(), 1e-3f);
            for (const Diagnostic& d : sounding.said().all()) ADD_FAILURE() << d.format();
        }
}

}  // namespace
}  // namespace rtsg
