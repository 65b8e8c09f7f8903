// AcousticEngine: renders what the listener of a scene hears: stereo, binaural or ambisonic.
//
//     auto engine = AcousticEngine::create({.binaural = true});
//     (*engine)->render(*tables.latest(), *world.freeze(), t, sound);      // to scene time t
//
// The sound of an emitter is made in two parts. Direct sound goes through a delay line of its own (propagation delay,
// hence Doppler) to panning or to a head. Reflections go through a Convolver with the impulse response of the traced
// room. The response is traced anew when the emitter, the listener or a wall near its paths has moved. Clips keep their
// channels. Time is counted in samples: scene time t is sample t * sampleRate. Positions are interpolated in between.
// Level 1 is full scale.
// Threading: one thread at a time, which need not be the scene's, because the engine reads only the state and the rays.
// Tracing uses all cores. Source: ISO/IEC 19775-1 V4.0 clause 16; Vorlaender 2008, 11.4 for the split into direct and
// rest.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <rtsg/audio/acoustic_renderer.h>

#include "geometry/world_geometry.h"
#include "rays/acoustic_tracer.h"
#include "scene/acoustic_tables.h"

namespace rtsg {

class AcousticEngine {
  public:
    static Result<std::unique_ptr<AcousticEngine>> create(const AcousticOptions& options);
    ~AcousticEngine();

    /// Renders the sound from the end of the last call (at first the start time) to the scene time `untilSeconds`, in
    /// whole blocks, and appends it to `sound`. The delay of heads is compensated. `state` is the state at
    /// `untilSeconds`. Positions move smoothly from those of the previous call to those of this one. Other changes
    /// (fields, nodes that come and go, jumps) are heard from the first block that begins after them; until then the
    /// previous state counts. At the first call `state` counts from the start. The walls, and so the reflections, are
    /// those of `state` for the whole call. States may be skipped. If time goes back, no sound is made, and the next
    /// call goes on from there. `rays` must be of the same state and are used only during the call.
    Result<> render(const AcousticState& state, const RayView& rays, double untilSeconds, SoundBuffer& sound);

    /// The same for one block of live sound. `poseSeconds` is the time of the positions; it may be before or after the
    /// end of the block. Responses are used when they are ready; the options may have them traced in the background.
    Result<> renderLive(std::shared_ptr<const AcousticState> state, std::shared_ptr<const RayView> rays,
                        double poseSeconds, SoundBuffer& sound);
    /// The time at which the next block of renderLive() ends, seconds. It is computed from a count of samples, because
    /// adding up clock times loses a sample now and then.
    double liveEnd() const;

    /// Reads the clips of the state and computes the head beforehand, so that render() need not.
    void prepare(const AcousticState& state);
    /// The number of channels that render() appends.
    int channels() const;
    Air airOf(const AcousticState& state) const;
    /// The room as it is for sound from `source`: without the shape that the source is inside of. Valid until the next
    /// call; `rays` must live as long.
    OpenedGeometry geometryFor(const AcousticState& state, const RayView& rays, const glm::dvec3& source);
    const HeardResponses& heard() const;
    /// Filled only if the options keep streams: one entry a node, in the order of their first sound, in whole blocks up
    /// to the last sample.
    const std::vector<StreamedSound>& streams() const;
    /// The results of each Analyser and DynamicsCompressor for the samples up to the end of the last call.
    AudioFindings analyse();
    /// Diagnostics about clips that could not be played, once each.
    const Diagnostics& diagnostics() const;
    /// The sources that played while no path led from them to the listener, in the order in which this was found. A
    /// source is listed once, and again when it is sealed off anew or from the other side; at most a thousand.
    const std::vector<SealedSource>& sealed() const;
    /// The sources that cannot have been heard so far; empty as soon as one source was within its reach.
    std::vector<UnheardSource> unheard() const;
    /// Records the result of a trace for room-acoustic figures, by the same rule. `seal`: the shapes between emitter
    /// and listener, or none.
    void note(const SoundEmitter& emitter, const glm::dvec3& listener, double seconds, std::optional<Seal> seal);
    /// The leaks of rooms, each once, with the source that it was found with; at most a thousand. They are looked for
    /// once, when a source is first heard, for eight sources at most.
    const std::vector<SoundLeak>& leaks() const;
    /// Records the leaks that a trace for room-acoustic figures found.
    void note(const SoundEmitter& emitter, const RoomOpenings& openings);

  private:
    struct Impl;
    explicit AcousticEngine(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
