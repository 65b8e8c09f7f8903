// Directions of what comes straight from an emitter: gains of channels, heads that were measured, spheres.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <rtsg/audio/panning.h>

#include "acoustic_engine_impl.h"
#include "trace/arrival_pan.h"

namespace rtsg {
namespace {

/// Where the channels of a clip stand around the direction of what plays it: degrees to the left.
double channelAngle(std::size_t channel, std::size_t count) {
    static constexpr double kStereo[] = {30, -30}, kThree[] = {30, -30, 0}, kQuad[] = {45, -45, 135, -135},
                            kFive[] = {30, -30, 0, 110, -110}, kSurround[] = {30, -30, 0, 0, 110, -110};
    switch (count) {
        case 1:
            return 0;
        case 2:
            return kStereo[channel];
        case 3:
            return kThree[channel];
        case 4:
            return kQuad[channel];
        case 5:
            return kFive[channel];
        case 6:
            return kSurround[channel];
        default:
            return 360.0 * static_cast<double>(channel) / static_cast<double>(count);
    }
}

/// About the listener's upright axis.
glm::dvec3 turned(const glm::dvec3& direction, double degrees) {
    const double a = degrees * std::numbers::pi / 180, c = std::cos(a), s = std::sin(a);
    return {c * direction.x + s * direction.z, direction.y, c * direction.z - s * direction.x};
}

/// Of what goes through a head: some direction, if it has none.
glm::dvec3 directionOr(const glm::dvec3& direction, const glm::dvec3& otherwise) {
    return direction == glm::dvec3(0) ? otherwise : direction;
}

}  // namespace

/// Through a head if the user has asked for one, or the sound itself (SpatialSound's enableHRTF).
HeardBy AcousticEngine::Impl::heardBy(const SoundNode& sound, const ListenerPose& listener) const {
    if (options.ambisonicOrder > 0 || !(options.binaural || sound.head)) return HeardBy::gains;
    if (options.hrtf) return HeardBy::measured;
    return mixer && !(listener.earDistance > 0) ? HeardBy::mixer : HeardBy::sphere;
}

/// When the first sound asks for a head by itself. From here on blocks run ahead of the sound by the latency.
void AcousticEngine::Impl::openMixer(const SoundVersion& sounds) {
    if (mixer || mixerTried || options.hrtf || options.ambisonicOrder > 0) return;
    if (std::ranges::none_of(*sounds.emitters, [](const SoundEmitter& emitter) { return emitter.sound->head; })) return;
    mixerTried = true;
    auto opened =
        LoopbackMixer::open({.sampleRate = options.sampleRate, .binaural = true, .blockSize = options.blockSize});
    if (!opened) {
        clips.note("enableHRTF: a sphere stands for the head, as " + opened.error().text);
        return;
    }
    mixer = std::move(*opened);
    const std::size_t early = channels * latency();
    lateRing.resize(early);
    toSkip += early;
}

/// Gains of one input by channel of the output.
void AcousticEngine::Impl::gainsOf(const glm::dvec3& towards, bool spatialize, std::size_t input, std::size_t inputs,
                                   std::vector<double>& gains) const {
    std::fill(gains.begin(), gains.end(), 0.0);
    const double share = 1.0 / static_cast<double>(inputs);
    if (options.ambisonicOrder > 0) {
        if (!spatialize && inputs == 1) {
            gains[0] = 1;
            return;
        }
        const glm::dvec3 direction = turned(spatialize ? towards : glm::dvec3(0, 0, -1), channelAngle(input, inputs));
        ambisonicGains(options.ambisonicOrder, ambisonicAxes(direction), gains);
        for (double& gain : gains) gain *= share;
        return;
    }
    const auto both = spatialize ? stereoGains(towards) : std::array<double, 2>{1, 1};
    if (inputs == 2) {
        // Left stays left: panning is a balance.
        gains[input] = both[input];
        return;
    }
    const auto own =
        inputs == 1 ? both
                    : stereoGains(turned(spatialize ? towards : glm::dvec3(0, 0, -1), channelAngle(input, inputs)));
    for (std::size_t c = 0; c < 2; ++c) gains[c] = own[c] * share;
}

/// Gives direct sound the direction that it comes from. Where it comes by another way than before one fades into the
/// other.
void AcousticEngine::Impl::spatialise(const SoundNode& sound, EmitterState& state, const glm::dvec3& apparent,
                                      Block& block) {
    const glm::dvec3 offset = apparent - block.listener.position;
    const double far = glm::distance(apparent, block.listener.position);
    const double distance = far < kHorizon ? far : kHorizon;
    const bool spatialize = sound.spatialize && distance > 1e-6;
    const glm::dvec3 towards = spatialize ? block.listener.toLocal(offset) / distance : glm::dvec3(0);
    const HeardBy by = spatialize ? state.reflectedBy : HeardBy::gains;
    const HeardBy earlier = state.spatialisedOnce ? state.heardBy : by;
    for (std::size_t k = 0; k < state.inputs.size(); ++k) {
        if (earlier != by) hear(state, k, earlier, towards, spatialize, {1, 0}, block);
        hear(state, k, by, towards, spatialize, earlier == by ? Ramp{} : Ramp{0, 1}, block);
    }
    state.heardBy = by;
    state.spatialisedOnce = true;
}

void AcousticEngine::Impl::hear(EmitterState& state, std::size_t k, HeardBy by, const glm::dvec3& towards,
                                bool spatialize, const Ramp& ramp, Block& block) {
    const std::size_t size = options.blockSize, inputs = state.inputs.size();
    EmitterInput& input = state.inputs[k];
    const glm::dvec3 ahead(0, 0, -1), direction = turned(directionOr(towards, ahead), channelAngle(k, inputs));
    const bool fresh = !state.spatialisedOnce || ramp.from == 0;
    if (by == HeardBy::mixer || by == HeardBy::measured) {
        std::vector<float>& share = block.part;
        share.resize(size);
        for (std::size_t i = 0; i < size; ++i) {
            const double w = ramp.from + (ramp.to - ramp.from) * static_cast<double>(i + 1) / static_cast<double>(size);
            share[i] = state.direct[k][i] * static_cast<float>(w / static_cast<double>(inputs));
        }
        if (by == HeardBy::mixer) {
            mixer->setDirection(*input.mixerSource, glm::vec3(direction));
            std::copy(share.begin(), share.end(), blocks[*input.mixerSource].begin());
            return;
        }
        input.head.turn(*options.hrtf, direction, size);
        for (std::size_t e = 0; e < 2; ++e) input.head.process(e, share, block.ears[e]);
        return;
    }
    std::vector<double>& gains = block.gains;
    gains.resize(channels);
    if (by == HeardBy::gains) {
        gainsOf(towards, spatialize, k, inputs, gains);
        for (double& gain : gains) gain *= ramp.to;
        if (fresh)
            for (std::size_t c = 0; c < channels; ++c) input.gains[c] = gains[c] * ramp.from;
        for (std::size_t c = 0; c < channels; ++c) mixInput(input, gains, c, state.direct[k], block);
        input.gains = gains;
        return;
    }
    const double radius = block.listener.headRadius();
    std::array<double, 2> delays{};
    for (int e = 0; e < 2; ++e) {
        const ArrivalPan ear = panOfEar(direction.x, e, radius, air.speedOfSound);
        delays[static_cast<std::size_t>(e)] = ear.delay * options.sampleRate;
        gains[static_cast<std::size_t>(e)] = ear.gain * ramp.to / static_cast<double>(inputs);
    }
    if (fresh) {
        input.earDelays = delays;
        for (std::size_t c = 0; c < 2; ++c) input.gains[c] = gains[c] * ramp.from;
    }
    hearBySphere(input, delays, gains, block);
}

/// Each ear at its time.
void AcousticEngine::Impl::hearBySphere(EmitterInput& input, const std::array<double, 2>& delays,
                                        const std::vector<double>& gains, Block& block) const {
    for (std::size_t e = 0; e < 2; ++e) {
        readDirect(input.line, block, input.earDelays[e], delays[e], block.part);
        mixInput(input, gains, e, block.part, block);
    }
    input.earDelays = delays;
    input.gains = gains;
}

/// Adds what a channel hears of an input, with a gain that goes from the last block's to this.
void AcousticEngine::Impl::mixInput(const EmitterInput& input, const std::vector<double>& gains, std::size_t channel,
                                    const std::vector<float>& direct, Block& block) const {
    const std::size_t size = options.blockSize;
    const double earlier = input.gains[channel], way = gains[channel] - earlier;
    if (gains[channel] == 0 && earlier == 0) return;
    for (std::size_t i = 0; i < size; ++i)
        block.out[channel][i] +=
            direct[i] * static_cast<float>(earlier + way * static_cast<double>(i + 1) / static_cast<double>(size));
}

/// What is gone from the scene is heard from where it was last.
void AcousticEngine::Impl::hearGone(EmitterState& state, Block& block) {
    const auto inputs = static_cast<float>(state.inputs.size());
    for (std::size_t k = 0; k < state.inputs.size(); ++k) {
        EmitterInput& input = state.inputs[k];
        std::vector<float>& direct = state.direct[k];
        switch (state.heardBy) {
            case HeardBy::gains:
                for (std::size_t c = 0; c < channels; ++c) mixInput(input, input.gains, c, direct, block);
                break;
            case HeardBy::sphere:
                hearBySphere(input, std::array(input.earDelays), std::vector<double>(input.gains), block);
                break;
            case HeardBy::mixer:
                for (float& sample : direct) sample /= inputs;
                blocks[*input.mixerSource] = direct;
                break;
            case HeardBy::measured:
                for (float& sample : direct) sample /= inputs;
                for (std::size_t e = 0; e < 2; ++e) input.head.process(e, direct, block.ears[e]);
                break;
        }
    }
}

}  // namespace rtsg
