// One block of sound: direct sound through delay lines, reflections through traced responses.
#include <algorithm>
#include <cmath>

#include <rtsg/audio/impulse_response.h>

#include "acoustic_engine_impl.h"
#include "trace/reach.h"

namespace rtsg {
namespace {

/// Nothing is heard from farther away; metres.
constexpr double kHorizon = 20'000;

}  // namespace

bool AcousticEngine::Impl::mustTrace(const EmitterState& state, const glm::dvec3& source,
                                     const ListenerPose& listener) const {
    if (!state.hasResponse) return true;
    const bool moved = state.stale || glm::distance(state.tracedSource, source) > options.moveTolerance ||
                       glm::distance(state.tracedListener, listener.position) > options.moveTolerance ||
                       glm::dot(state.tracedRight, listener.right) < 0.998 ||  // 3.6 degrees
                       (!mixer && glm::dot(state.tracedBack, listener.back) < 0.998);
    return moved && static_cast<double>(samples) / options.sampleRate >= state.tracedAt + options.retraceSeconds;
}

void AcousticEngine::Impl::trace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
                                 const ListenerPose& listener) {
    const OpenedGeometry room(geometry, state.body);
    const ReachRecorder recorder(room, longest);
    const AcousticTracer tracer(recorder);
    TraceResult traced = tracer.trace(source, listener.position, options.trace);
    if (options.error > 0) {
        const double error =
            tracer.refineTo(traced, source, listener.position, options.trace, options.error, options.maxRays);
        heard.error = std::isnan(heard.error) ? error : std::max(heard.error, error);
    }
    ImpulseResponseOptions response;
    using Channels = ImpulseResponseOptions::Channels;
    response.channels = options.ambisonicOrder > 0 ? Channels::ambisonic
                        : options.binaural         ? Channels::binaural
                                                   : Channels::stereo;
    response.ambisonicOrder = options.ambisonicOrder;
    response.sampleRate = options.sampleRate;
    response.listenerRight = listener.right;
    response.listenerUp = listener.up;
    response.listenerBack = listener.back;
    response.firstOrder = 1;
    response.cutShare = 1e-6;
    response.speedOfSound = options.trace.air.speedOfSound;
    // The same noise each time, another for each emitter: crossfades then do not rustle.
    response.seed = emitter.id.slot + 1;
    const ImpulseResponse ir = makeImpulseResponse(traced.echogram(), response);
    for (std::size_t c = 0; c < channels; ++c) state.late[c].setResponse(ir.channels[c]);
    state.responseFrames = ir.frames();
    state.hasResponse = true;
    state.tracedAt = static_cast<double>(samples) / options.sampleRate;
    state.tracedSource = source;
    state.tracedListener = listener.position;
    state.tracedRight = listener.right;
    state.tracedBack = listener.back;
    state.reached = recorder.reached();
    // The receiver's sphere shrinks so as to touch no surface: what comes near the listener counts as well.
    state.reached.extend(listener.position - options.trace.receiverRadius / 0.9);
    state.reached.extend(listener.position + options.trace.receiverRadius / 0.9);
    state.stale = false;
    ++heard.responses;
    heard.rays = std::max(heard.rays, traced.rays);
    heard.images = std::max(heard.images, traced.arrivals.size());
}

void AcousticEngine::Impl::play(const SoundNode& sound, EmitterState& state, std::span<float> dry) {
    std::fill(dry.begin(), dry.end(), 0.0f);
    if (!sound.enabled) return;
    for (const SoundVoice& voice : sound.voices) state.players[voice.node.value].play(voice, clips, samples, dry);
}

/// Where it was when it sent what arrives now; a few steps converge for anything slower than sound.
glm::dvec3 AcousticEngine::Impl::apparentPosition(const EmitterState& state, const glm::dvec3& source,
                                                  const glm::dvec3& listener) const {
    glm::dvec3 apparent = source;
    for (int i = 0; i < 6; ++i) {
        const double delaySamples =
            glm::distance(apparent, listener) / options.trace.air.speedOfSound * options.sampleRate;
        apparent = state.track.at(state.track.newest() - delaySamples / static_cast<double>(options.blockSize));
    }
    return apparent;
}

HeardLevel AcousticEngine::Impl::levelOf(const SoundEmitter& emitter, const EmitterState& state,
                                         const glm::dvec3& apparent, const ListenerPose& listener,
                                         bool& audible) const {
    const SoundNode& sound = *emitter.sound;
    double distance = glm::distance(apparent, listener.position);
    const bool near = distance < kHorizon;
    if (!near) distance = kHorizon;
    const glm::dmat3 linear(emitter.worldFromLocal[0], emitter.worldFromLocal[1], emitter.worldFromLocal[2]);
    // The listener in the node's frame as if the node were where it was heard; singular transforms: as it is.
    const glm::dvec3 offset = listener.position - apparent;
    const glm::dvec3 local =
        sound.location + (std::abs(glm::determinant(linear)) > 1e-12 ? glm::inverse(linear) * offset : offset);
    const double level =
        !near ? 0
              : sound.intensity * listener.gain *
                    (options.levels == AcousticOptions::Levels::x3d ? sound.level(local) : 1 / std::max(distance, 0.1));
    double open = 0;
    if (level != 0) {
        const Bands share = directShare(OpenedGeometry(geometry, state.body), apparent, listener.position);
        for (std::size_t b = 2; b < 7; ++b) open += share[b] / 5;
        const Bands air = airAttenuation(options.trace.air);
        open *= std::exp(-air[4] * distance);
    }
    audible = level != 0;
    // In a response direct sound is 1 / d: times d, reflections keep their ratio to it.
    return {.delay = distance / options.trace.air.speedOfSound * options.sampleRate,
            .directGain = level * sound.coneGain(local) * std::sqrt(open),
            .lateGain = level * std::max(distance, 0.1)};
}

/// From the level and delay at the end of the last block to these.
void AcousticEngine::Impl::renderDirect(const SoundNode& sound, EmitterState& state, const HeardLevel& to,
                                        Block& block) {
    const std::size_t size = options.blockSize;
    const HeardLevel from = state.level;
    const std::size_t first = state.line.written();
    state.line.write(block.dry, static_cast<std::size_t>(std::max(to.delay, from.delay)) + 2);
    std::vector<float>& direct = blocks[state.mixerSource];
    const bool glide = sound.doppler || std::abs(to.delay - from.delay) < 0.5;
    for (std::size_t i = 0; i < size; ++i) {
        const double w = static_cast<double>(i + 1) / static_cast<double>(size);
        const double gain = from.directGain + (to.directGain - from.directGain) * w;
        double value;
        if (glide) {
            const double d = to.delay == from.delay ? to.delay : from.delay + (to.delay - from.delay) * w;
            value = static_cast<double>(state.line.read(first + i, d));
        } else {  // no change of pitch wanted: from one delay to the other by crossfading
            value = static_cast<double>(state.line.read(first + i, from.delay)) * (1 - w) +
                    static_cast<double>(state.line.read(first + i, to.delay)) * w;
        }
        direct[i] = static_cast<float>(value * gain);
        block.late[i] = block.dry[i] * static_cast<float>(from.lateGain + (to.lateGain - from.lateGain) * w);
    }
}

/// Gives direct sound the direction that it comes from.
void AcousticEngine::Impl::spatialise(const SoundNode& sound, EmitterState& state, const glm::dvec3& apparent,
                                      Block& block) {
    const std::size_t size = options.blockSize;
    const glm::dvec3 offset = apparent - block.listener.position;
    const double far = glm::distance(apparent, block.listener.position);
    const double distance = far < kHorizon ? far : kHorizon;
    const glm::dvec3 towards =
        sound.spatialize && distance > 1e-6 ? block.listener.toLocal(offset) / distance : glm::dvec3(0);
    if (mixer) {
        mixer->setDirection(state.mixerSource, glm::vec3(towards));
        return;
    }
    const std::vector<float>& direct = blocks[state.mixerSource];
    std::vector<double> gains(channels);
    if (towards == glm::dvec3(0)) {
        gains[0] = 1;
    } else {
        ambisonicGains(options.ambisonicOrder, ambisonicAxes(towards), gains);
    }
    if (state.line.written() == size) state.gains = gains;
    for (std::size_t ch = 0; ch < channels; ++ch)
        for (std::size_t i = 0; i < size; ++i)
            block.out[ch][i] += direct[i] * static_cast<float>(state.gains[ch] + (gains[ch] - state.gains[ch]) *
                                                                                     static_cast<double>(i + 1) /
                                                                                     static_cast<double>(size));
    state.gains = gains;
}

void AcousticEngine::Impl::renderEmitter(const SoundEmitter& emitter, EmitterState& state, Block& block) {
    const glm::dvec3 source = glm::mix(state.from, state.to, block.alpha);
    state.track.add(source);
    play(*emitter.sound, state, block.dry);
    const glm::dvec3 apparent = apparentPosition(state, source, block.listener.position);
    bool audible = false;
    const HeardLevel level = levelOf(emitter, state, apparent, block.listener, audible);
    if (!state.started) state.level = level;
    state.started = true;
    renderDirect(*emitter.sound, state, level, block);
    spatialise(*emitter.sound, state, apparent, block);
    if (options.reflections) {
        if (audible && mustTrace(state, source, block.listener)) trace(state, emitter, source, block.listener);
        for (std::size_t ch = 0; ch < channels; ++ch) state.late[ch].process(block.late, block.out[ch]);
    }
    state.level = level;
}

/// Those that are gone fall silent when their last reflections have.
void AcousticEngine::Impl::fadeOut(Block& block) {
    const std::size_t size = options.blockSize;
    std::fill(block.dry.begin(), block.dry.end(), 0.0f);
    for (auto it = states.begin(); it != states.end();) {
        EmitterState& state = it->second;
        if (!state.gone) {
            ++it;
            continue;
        }
        const std::size_t first = state.line.written();
        state.line.write(block.dry, static_cast<std::size_t>(state.level.delay) + 2);
        for (std::size_t i = 0; i < size; ++i) {
            const float sample =
                state.line.read(first + i, state.level.delay) * static_cast<float>(state.level.directGain);
            blocks[state.mixerSource][i] = sample;
            if (!mixer)
                for (std::size_t ch = 0; ch < channels; ++ch)
                    block.out[ch][i] += sample * static_cast<float>(state.gains[ch]);
        }
        if (options.reflections)
            for (std::size_t ch = 0; ch < channels; ++ch) state.late[ch].process(block.dry, block.out[ch]);
        state.fading -= std::min(state.fading, size);
        if (state.fading > 0) {
            ++it;
        } else {
            freeSources.push_back(state.mixerSource);
            it = states.erase(it);
        }
    }
}

/// Panned direct sound and delayed reflections into `ready`.
Result<> AcousticEngine::Impl::mixDown(const Block& block) {
    const std::size_t size = options.blockSize;
    std::vector<float> mixed(channels * size);
    if (mixer) {
        std::vector<std::span<const float>> inputs(blocks.begin(), blocks.end());
        if (auto rendered = mixer->render(inputs, mixed); !rendered) return rendered;
    }
    for (std::size_t i = 0; i < size; ++i)
        for (std::size_t ch = 0; ch < channels; ++ch) {
            lateQueue.push_back(block.out[ch][i]);
            const float sample = mixed[channels * i + ch] + lateQueue.front();
            lateQueue.pop_front();
            if (toSkip > 0) {
                --toSkip;
            } else {
                ready.push_back(sample);
            }
        }
    return {};
}

Result<> AcousticEngine::Impl::block(const SoundVersion& sounds, double alpha, const ListenerPose& listener) {
    const std::size_t size = options.blockSize;
    Block block{alpha, listener, std::vector<float>(size), std::vector<float>(size),
                std::vector<std::vector<float>>(channels, std::vector<float>(size))};
    for (auto& b : blocks) std::fill(b.begin(), b.end(), 0.0f);
    for (const SoundEmitter& emitter : *sounds.emitters) {
        auto state = stateOf(emitter);
        if (!state) return std::unexpected(state.error());
        renderEmitter(emitter, **state, block);
    }
    fadeOut(block);
    if (auto mixed = mixDown(block); !mixed) return mixed;
    samples += static_cast<std::int64_t>(size);
    return {};
}

}  // namespace rtsg
