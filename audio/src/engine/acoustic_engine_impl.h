// The insides of AcousticEngine: what it keeps between calls, and the steps of a block.
//
// Threading: the engine's thread.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/audio/acoustic_engine.h>
#include <rtsg/audio/ambisonics.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/loopback.h>

#include "emitter_state.h"

namespace rtsg {

struct AcousticEngine::Impl {
    Impl(const AcousticOptions& o, std::optional<LoopbackMixer> m)
        : options(o),
          channels(static_cast<std::size_t>(o.ambisonicOrder > 0 ? ambisonicChannels(o.ambisonicOrder) : 2)),
          longest(o.trace.maxSeconds * o.trace.air.speedOfSound),
          mixer(std::move(m)),
          clips(o.sampleRate, o.resources),
          renderedUntil(o.startTime),
          samples(std::llround(o.startTime * o.sampleRate)),
          lateQueue(channels * latency()) {}

    /// What one block sounds like while it is made.
    struct Block {
        double alpha;  // 0 to 1 on the way from the last state to this one
        const ListenerPose& listener;
        std::vector<float> dry, late;
        std::vector<std::vector<float>> out;  // by channel: all but what goes to the mixer
    };

    std::size_t latency() const { return mixer ? mixer->latency() : 0; }

    void follow(const AcousticState& state, const RayView& rays);
    void followEmitters(const SoundVersion& sounds, double seconds);
    void findBody(EmitterState& state);
    Result<EmitterState*> stateOf(const SoundEmitter& emitter);

    Result<> block(const SoundVersion& sounds, double alpha, const ListenerPose& listener);
    void renderEmitter(const SoundEmitter& emitter, EmitterState& state, Block& block);
    void play(const SoundNode& sound, EmitterState& state, std::span<float> dry);
    glm::dvec3 apparentPosition(const EmitterState& state, const glm::dvec3& source, const glm::dvec3& listener) const;
    HeardLevel levelOf(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& apparent,
                       const ListenerPose& listener, bool& audible) const;
    void renderDirect(const SoundNode& sound, EmitterState& state, const HeardLevel& to, Block& block);
    void spatialise(const SoundNode& sound, EmitterState& state, const glm::dvec3& apparent, Block& block);
    void fadeOut(Block& block);
    Result<> mixDown(const Block& block);

    bool mustTrace(const EmitterState& state, const glm::dvec3& source, const ListenerPose& listener) const;
    void trace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
               const ListenerPose& listener);

    AcousticOptions options;
    std::size_t channels;
    double longest;  // metres that sound goes within a response
    WorldGeometry geometry;
    std::optional<LoopbackMixer> mixer;  // none for ambisonics
    ClipLibrary clips;
    std::map<InstanceId, EmitterState> states;
    std::vector<std::size_t> freeSources;
    std::vector<std::vector<float>> blocks;  // by mixer source
    ListenerPose before, now;                // at the ends of the frame being rendered
    bool posed = false;
    double renderedUntil;
    std::int64_t samples;         // consumed from the voices
    std::deque<float> lateQueue;  // interleaved; delays reflections by the mixer's latency
    std::size_t toSkip = 0;       // of the mixer's latency, still to be dropped
    std::vector<float> ready;     // interleaved, rendered but not yet asked for
    HeardResponses heard;
};

}  // namespace rtsg
