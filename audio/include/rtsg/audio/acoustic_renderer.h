// AcousticRenderer: follows a scene and renders what its listener hears: stereo, binaural or ambisonic.
//
// Each emitter goes two ways: direct sound through a delay line of its own (propagation delay, hence Doppler) to a
// direction in the LoopbackMixer; reflections through a Convolver with the impulse response of the traced room, traced
// anew when emitter, listener or walls have moved. Time runs in samples: scene time t is sample t * sampleRate; between
// two frames poses are interpolated, so what is rendered lags the newest frame by nothing and needs no clock. Levels: 1
// is full scale. `Levels::x3d`: direct sound has the level that the node's distance law gives (times intensity, gain),
// reflections keep the physical ratio to it. `Levels::physical`: pressure 1 is that at 1 m, 1 / d beyond. Threading:
// one thread; apply() on the scene's. Tracing runs on all cores inside render(). Source: ISO/IEC 19775-1 V4.0 clause
// 16; Vorlaender 2008, 11.4 for the split into direct sound and the rest.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include <rtsg/audio/acoustic_tracer.h>
#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/sound_scene.h>
#include <rtsg/audio/world_geometry.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

class AcousticRenderer final : public InstanceSubscriber {
  public:
    enum class Levels : std::uint8_t { x3d, physical };

    struct Options {
        int sampleRate = 48000;
        bool binaural = false;
        /// 1 to 7: an ambisonic sound (see ambisonics.h) instead of two channels, and no OpenAL; 0: not.
        int ambisonicOrder = 0;
        /// 256 keeps moving sources smooth under HRTF.
        std::size_t blockSize = 256;
        Levels levels = Levels::x3d;
        /// Of the responses that are heard; metrics want more rays (see listen()).
        TraceOptions trace = heardTrace();
        AcousticMaterial defaultMaterial;
        /// A response is traced anew at most this often (seconds of scene time), and only when something moved by more
        /// than `moveTolerance` metres or the walls changed.
        double retraceSeconds = 0.2;
        double moveTolerance = 0.1;
        /// Authors put a Sound into the thing that sounds. Shapes around it that measure no more than this from corner
        /// to corner (metres) let its sound pass.
        double bodySize = 2.5;
        /// No reflections at all: direct sound only.
        bool reflections = true;
        /// Scene time of the first sample.
        double startTime = 0;
        /// Where relative urls of clips start.
        std::filesystem::path base;

        static TraceOptions heardTrace() {
            TraceOptions trace;
            trace.rays = 2000;
            trace.maxImageCandidates = 2000;
            trace.maxSeconds = 3;
            trace.batches = 8;
            return trace;
        }
    };

    /// `world` must outlive this, and be applied the same deltas, before this is.
    static Result<std::unique_ptr<AcousticRenderer>> create(const RayWorld& world, const Options& options);
    ~AcousticRenderer() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// Renders the scene time from the end of the last call (at first the start time) to `untilSeconds`, in whole
    /// blocks, and appends it to `sound`. The latency of OpenAL is taken out. The poses of the latest apply() are those
    /// at `untilSeconds`.
    Result<> render(double untilSeconds, SoundBuffer& sound);

    /// Of what render() appends.
    int channels() const;
    const SoundScene& scene() const;
    /// The room as of the last apply(), ready to be traced, as it is for sound from `source`: its own body left out.
    OpenedGeometry geometryFor(const glm::dvec3& source);
    /// Responses traced so far.
    std::uint64_t traces() const;
    Diagnostics diagnostics() const;

  private:
    struct Impl;
    explicit AcousticRenderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
