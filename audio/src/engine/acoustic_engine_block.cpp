// One block of sound: direct sound through delay lines, reflections through traced responses.
#include <algorithm>
#include <cmath>
#include <functional>

#include <rtsg/audio/impulse_response.h>

#include "acoustic_engine_impl.h"

namespace rtsg {
namespace {

/// Samples between the places where a delay is computed; in between it is cubic.
constexpr std::size_t kDelayStep = 32;

}  // namespace

void AcousticEngine::Impl::play(const SoundEmitter& emitter, EmitterState& state, const Block& block) {
    const SoundNode& sound = *emitter.sound;
    if (sound.enabled) {
        // Two loudspeakers: the input of a destination is mixed up or down to them as in any node.
        const bool speakers = sound.law == SoundNode::Law::none && !sound.stream && options.ambisonicOrder == 0;
        const auto exactly = static_cast<std::size_t>(speakers ? std::min(sound.maxChannels, 2) : 0);
        // Sounds with a place are mixed down to two channels at most, as panners do ("clamped-max"; Web Audio API 1.1,
        // 1.27).
        const std::size_t maximum = sound.law == SoundNode::Law::none || sound.stream ? 0 : 2;
        AudioChannels& played = exactly == 1 ? state.lead : state.dry;
        state.mix.render(sound.voices, sound.processes,
                         {clips, samples, options.blockSize, emitter, block.listener, *head}, played,
                         {sound.discrete, exactly, std::max<std::size_t>(1, state.inputs.size()), maximum});
        if (exactly == 1) {
            state.dry.resize(2);
            for (std::vector<float>& dry : state.dry) dry = state.lead[0];
        }
        const double louder = std::max(1.0, std::abs(sound.coneOuterGain)) * std::abs(block.listener.gain);
        if (silenceNoSound(state.dry, sound.intensity * louder)) clips.noteNoSound(sound.name);
        return;
    }
    state.dry.resize(std::max<std::size_t>(1, state.inputs.size()));
    for (std::vector<float>& dry : state.dry) dry.assign(options.blockSize, 0.0f);
    // Clocks go on: it plays from a later position when it is heard again.
    state.mix = {};
}

void AcousticEngine::Impl::makeInputs(EmitterState& state, std::size_t count) const {
    while (state.inputs.size() < count) state.inputs.emplace_back().gains.resize(channels);
}

namespace {

/// The path from the source, from an image of it, or over edges.
EdgePath pathFrom(const FollowedImage* image, const glm::dvec3& source, const glm::dvec3& listener) {
    if (image && image->kind == FollowedImage::Kind::edge) return edgePath(image->edge->route, source, listener);
    const glm::dvec3 displacement = (image ? image->at(source) : source) - listener;
    EdgePath straight;
    straight.length = glm::length(displacement);
    const glm::dvec3 towards = straight.length > 0 ? displacement / straight.length : glm::dvec3(0);
    straight.toSource = image ? glm::transpose(image->rotation) * towards : towards;
    straight.toListener = -towards;
    return straight;
}

}  // namespace

/// How long what arrives at `time` was under way, and how that changes; Newton's method from a guess.
void AcousticEngine::Impl::findDelay(const Trajectory& motion, const FollowedImage* image, double time, double& delay,
                                     double& slope) const {
    const double speed = air.speedOfSound / options.sampleRate;  // metres a sample
    const Trajectory::Point at = listenerMotion.positionAt(time);
    slope = 0;
    for (int step = 0; step < 8; ++step) {
        const Trajectory::Point from = motion.at(time - delay);
        const EdgePath path = pathFrom(image, from.position, at.position);
        // Written so that a value that is not finite counts as far away.
        if (!(path.length < kHorizon)) {
            delay = kHorizon / speed;
            return;
        }
        const double along = glm::dot(path.toSource, from.velocity);
        // Nothing is faster than nine tenths of sound here.
        const double approach = std::max(0.1 * speed, speed + along);
        const double change = (path.length - delay * speed) / approach;
        delay = std::max(0.0, delay + change);
        slope = std::clamp((along + glm::dot(path.toListener, at.velocity)) / approach, -10.0, 0.9);
        if (std::abs(change) < 1e-9) return;
    }
}

/// The delays of this block, sample by sample; the last are kept in `to`.
void AcousticEngine::Impl::delaysOf(const EmitterState& state, HeardLevel& to, Block& block) const {
    const std::size_t size = options.blockSize;
    block.delays.resize(size);
    double from = state.level.delay, fromSlope = state.level.slope;
    for (std::size_t at = 0; at < size;) {
        const std::size_t next = std::min(size, at + kDelayStep);
        const double h = static_cast<double>(next - at);
        double delay = from + fromSlope * h, slope = 0;
        findDelay(state.motion, nullptr, static_cast<double>(samples) + static_cast<double>(next), delay, slope);
        const double distance = delay - from, a = fromSlope * h, b = slope * h;
        for (std::size_t i = at; i < next; ++i) {
            const double u = static_cast<double>(i + 1 - at) / h;
            block.delays[i] = from + u * (a + u * (3 * distance - 2 * a - b + u * (a + b - 2 * distance)));
        }
        from = delay;
        fromSlope = slope;
        at = next;
    }
    to.delay = from;
    to.slope = fromSlope;
}

/// Renders the direct sound of each input into the emitter's state.
void AcousticEngine::Impl::renderDirect(EmitterState& state, const HeardLevel& to, bool crossfade, Block& block) {
    block.before = state.level;
    block.after = to;
    block.crossfade = crossfade;
    const double farthest =
        std::max({to.delay, state.level.delay, *std::max_element(block.delays.begin(), block.delays.end())});
    state.direct.resize(state.inputs.size());
    for (std::size_t k = 0; k < state.inputs.size(); ++k) {
        DelayLine& line = state.inputs[k].line;
        line.write(state.dry[k], static_cast<std::size_t>(farthest) + 2);
        readDirect(line, block, state.direct[k]);
    }
}

/// Reads the block that was just written, at its delays.
void AcousticEngine::Impl::readDirect(const DelayLine& line, const Block& block, std::vector<float>& out) const {
    const std::size_t size = options.blockSize, first = line.written() - size;
    const auto fraction = [&](std::size_t i) { return static_cast<double>(i + 1) / static_cast<double>(size); };
    out.resize(size);
    if (block.crossfade) {
        for (std::size_t i = 0; i < size; ++i) {
            const auto at = [&](double delay) { return static_cast<double>(line.read(first + i, delay)); };
            out[i] =
                static_cast<float>(at(block.after.delay) * fraction(i) + at(block.before.delay) * (1 - fraction(i)));
        }
    } else {
        line.read(first, block.delays, out);
    }
    for (std::size_t i = 0; i < size; ++i) {
        const double gain = block.before.directGain + (block.after.directGain - block.before.directGain) * fraction(i);
        out[i] = static_cast<float>(static_cast<double>(out[i]) * gain);
    }
}

/// Reflections of the played sound; left of two channels stays left. `emitter` is null once it is gone.
void AcousticEngine::Impl::renderLate(EmitterState& state, const SoundEmitter* emitter, const HeardLevel& to,
                                      bool jumped, Block& block) {
    const std::size_t size = options.blockSize, inputs = state.inputs.size();
    const bool apart = inputs == 2 && channels == 2;
    state.reflected.resize(apart ? 2 : 1);
    for (std::size_t s = 0; s < state.reflected.size(); ++s) {
        const std::size_t first = apart ? s : 0, count = apart ? 1 : inputs;
        state.reflected[s].resize(size);
        for (std::size_t i = 0; i < size; ++i) {
            const double w = static_cast<double>(i + 1) / static_cast<double>(size);
            float sum = 0;
            for (std::size_t k = first; k < first + count; ++k) sum += state.dry[k][i];
            state.reflected[s][i] = sum / static_cast<float>(count) *
                                    static_cast<float>(state.level.lateGain + (to.lateGain - state.level.lateGain) * w);
        }
    }
    if (apart)
        for (Convolver& convolver : state.late) convolver.part();
    for (std::size_t ch = 0; ch < channels; ++ch)
        state.late[ch].process(state.reflected[apart ? ch : 0], block.out[ch]);
    const double start = static_cast<double>(samples), end = start + static_cast<double>(size);
    const ImpulseResponseOptions response = responseFor(emitter, state.reflectedBy, block.listener);
    const auto find = [&](const FollowedImage& image, int step, double& delay, double& slope) {
        if (!emitter && step >= 0) {  // it is where it was
            slope = 0;
            return;
        }
        const double at = std::min(end, start + static_cast<double>(step + 1) * ImagePlayer::kStep);
        findDelay(state.motion, &image, at, delay, slope);
    };
    const auto from = [&](const FollowedImage& image, double delay) {
        return image.at(state.motion.at(end - delay).position) - block.listener.position;
    };
    const auto ends = [&](double delay) {
        return ImagePlayer::EdgeEnds{state.motion.at(end - delay).position, block.listener.position};
    };
    const std::span<std::vector<float>> ears(block.ears);
    state.images.render({state.reflected, std::cref(find), std::cref(from), response, jumped, block.out,
                         response.hrtf ? ears : ears.first(0), std::cref(ends), to.lateGain, to.heard});
}

namespace {

/// In this block.
bool makesSound(const EmitterState& state) {
    return std::ranges::any_of(state.dry, [](const std::vector<float>& dry) {
        return std::ranges::any_of(dry, [](float sample) { return sample != 0; });
    });
}

}  // namespace

void AcousticEngine::Impl::renderEmitter(const SoundEmitter& emitter, EmitterState& state, Block& block) {
    const SoundNode& sound = *emitter.sound;
    if (sound.stream) {
        if (options.keepStreams) streamOut(emitter, state, block);
        return;
    }
    const double start = static_cast<double>(samples), end = start + static_cast<double>(options.blockSize);
    state.motion.advance(end);
    play(emitter, state, block);
    state.reflectedBy = heardBy(sound);
    makeInputs(state, state.dry.size());
    HeardLevel to;
    if (!state.started)
        findDelay(state.motion, nullptr, static_cast<double>(samples), state.level.delay, state.level.slope);
    delaysOf(state, to, block);
    // Without Doppler shift sound keeps its delay as long as there is any: it takes the new one while it is silent.
    const bool silent = state.quiet > static_cast<std::size_t>(state.level.delay) + options.blockSize;
    const bool doppler = sound.doppler || (block.listener.doppler && sound.law != SoundNode::Law::none);
    const bool held = !doppler && state.started && !silent;
    const glm::dvec3 apparent = apparentPosition(state, to.delay);
    findHeadRotations(state, apparent, !(state.started && state.jumped), block);
    if (held) {
        to.delay = state.level.delay;
        to.slope = 0;
    }
    if (sound.law == SoundNode::Law::none) to.delay = to.slope = 0;
    if (!doppler) std::fill(block.delays.begin(), block.delays.end(), to.delay);
    bool audible = false;
    measurePath(sound, state, apparent, block);
    levelOf(emitter, state, apparent, block, to, audible);
    if (!anyHeard) {
        const bool inReach =
            audible && sound.enabled && sound.plays() && sound.intensity != 0 && block.listener.gain != 0;
        anyInReach = anyInReach || inReach;
        anyHeard = inReach && makesSound(state);
        if (!anyHeard) noteUnheard(emitter, glm::distance(apparent, block.listener.position), inReach, block.listener);
    }
    if (!state.started) {
        state.level.directGain = to.directGain;
        state.level.lateGain = to.lateGain;
    }
    // A source whose delay was held does not glide to its new delay either.
    const bool crossfade = state.started && !held && (state.jumped || (state.held && doppler));
    state.started = true;
    state.jumped = false;
    state.held = held;
    renderDirect(state, to, crossfade, block);
    spatialise(sound, state, block);
    if (options.reflections && sound.reflected) {
        // Source, listener and walls of one instant, that of the scene, which the block is on its way to.
        // Who will be somewhere else when the frame ends is not there yet.
        const bool there = (!state.hasResponse || !(state.jumps || listenerJumps)) &&
                           start >= options.reflectedFrom * options.sampleRate - 0.5;
        if (audible && there) renew(emitter, state);
        noteWaiting(state, audible);
        renderLate(state, &emitter, to, crossfade, block);
    }
    noteSilence(state);
    // A source that plays nothing yet may be let out before it does.
    if (state.seal && state.quiet == 0) {
        noteSeal(emitter, state.tracedSource, state.tracedListener, start / options.sampleRate, std::move(*state.seal));
        state.seal.reset();
    }
    if (state.openings.leak && state.quiet == 0) {
        noteLeaks(emitter, state.openings);
        state.openings = {};
    }
    state.level = to;
}

void AcousticEngine::Impl::noteSilence(EmitterState& state) const {
    state.quiet = makesSound(state) ? 0 : state.quiet + options.blockSize;
}

/// Until something was traced of it only direct sound is heard.
void AcousticEngine::Impl::noteWaiting(EmitterState& state, bool audible) const {
    if (!audible || state.traced)
        state.waitsSince.reset();
    else if (!state.waitsSince)
        state.waitsSince = seconds();
}

void AcousticEngine::Impl::countWaiting() {
    heard.unreflected = 0;
    for (const auto& [id, state] : states) {
        if (state.gone || !state.waitsSince) continue;
        ++heard.unreflected;
        heard.longestWait = std::max(heard.longestWait, seconds() - *state.waitsSince);
    }
}

/// Emitters that are gone fall silent after their last reflections.
void AcousticEngine::Impl::fadeOut(Block& block) {
    const std::size_t size = options.blockSize;
    for (auto it = states.begin(); it != states.end();) {
        EmitterState& state = it->second;
        if (!state.gone) {
            ++it;
            continue;
        }
        if (state.inputs.empty()) {  // it has never been heard
            endSeal(it->first, seconds());
            it = states.erase(it);
            continue;
        }
        state.dry.resize(state.inputs.size());
        for (std::vector<float>& dry : state.dry) dry.assign(size, 0.0f);
        block.delays.assign(size, state.level.delay);
        renderDirect(state, state.level, false, block);
        hearGone(state, block);
        if (options.reflections) renderLate(state, nullptr, state.level, false, block);
        state.fading -= std::min(state.fading, size);
        if (state.fading > 0) {
            ++it;
        } else {
            endSeal(it->first, seconds());
            it = states.erase(it);
        }
    }
}

/// Mixes sound that went through the head and, delayed, sound that did not, into `ready`.
void AcousticEngine::Impl::mixDown(const Block& block) {
    const std::size_t size = options.blockSize;
    for (std::size_t i = 0; i < size; ++i)
        for (std::size_t ch = 0; ch < channels; ++ch) {
            float late = block.out[ch][i];
            if (!lateRing.empty()) {
                std::swap(late, lateRing[lateAt]);
                lateAt = (lateAt + 1) % lateRing.size();
            }
            const float ear = block.ears.empty() ? 0 : block.ears[ch][i];
            float sample = ear + late;
            if (!(std::abs(sample) <= static_cast<float>(kLoudest))) sample = 0;
            if (toSkip > 0) {
                --toSkip;
            } else {
                ready.push_back(sample);
            }
        }
}

/// Silence, in the memory of the last block.
void AcousticEngine::Impl::begin(Block& block, const ListenerPose& listener) const {
    block.listener = listener;
    block.out.resize(channels);
    block.ears.resize(lateRing.empty() ? 0 : channels);
    for (AudioChannels* to : {&block.out, &block.ears})
        for (std::vector<float>& channel : *to) channel.assign(options.blockSize, 0.0f);
}

void AcousticEngine::Impl::block() {
    const std::size_t size = options.blockSize;
    const double end = static_cast<double>(samples) + static_cast<double>(size);
    listenerMotion.advance(end);
    ListenerPose listener = listenerMotion.at(end);
    listener.gain = playing.listener.gain;
    listener.doppler = playing.listener.doppler;
    listener.earDistance = playing.listener.earDistance;
    begin(work, listener);
    findHead(listener);
    for (const SoundEmitter& emitter : *playing.emitters) renderEmitter(emitter, states.at(emitter.id), work);
    countWaiting();
    renewLongestDue();
    fadeOut(work);
    endStreams();
    mixDown(work);
    samples += static_cast<std::int64_t>(size);
}

}  // namespace rtsg
