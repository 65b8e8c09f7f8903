// Directions of direct sound from an emitter: gains of channels, or a head.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "acoustic_engine_impl.h"
#include "signal/panning.h"

namespace rtsg {
namespace {

/// The angles of a clip's channels around the direction of the node that plays it: degrees to the left.
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

/// Nearer than this, metres, sound comes from nowhere.
constexpr double kHere = 1e-6;

/// Unit, as far as it is within hearing; 0 for a source at the listener.
glm::dvec3 directionOf(const glm::dvec3& offset) {
    const double far = glm::length(offset), distance = far < kHorizon ? far : kHorizon;
    return distance > kHere ? offset / distance : glm::dvec3(0);
}

/// The direction, or another one if it is 0, since a head needs some direction.
glm::dvec3 directionOr(const glm::dvec3& direction, const glm::dvec3& otherwise) {
    return direction == glm::dvec3(0) ? otherwise : direction;
}

/// Whether nobody hears which of two heads it is.
bool alike(const HeadMaker::Size& a, const HeadMaker::Size& b) {
    constexpr double kAlike = 5e-3;
    return std::abs(a.radius - b.radius) <= kAlike * b.radius &&
           std::abs(a.speedOfSound - b.speedOfSound) <= kAlike * b.speedOfSound;
}

}  // namespace

/// Through a head if the user has asked for one, or the sound itself (SpatialSound's enableHRTF).
HeardBy AcousticEngine::Impl::heardBy(const SoundNode& sound) const {
    return options.ambisonicOrder == 0 && (options.binaural || sound.head) ? HeardBy::head : HeardBy::gains;
}

/// From here on blocks are rendered ahead of the sound, by the time that an ear may be early.
void AcousticEngine::Impl::runAhead() {
    if (!lateRing.empty() || options.ambisonicOrder > 0) return;
    findHead(now);
    lateRing.resize(channels * head->early());
    toSkip += lateRing.size();
}

/// When the first sound asks for a head by itself.
void AcousticEngine::Impl::runAheadFor(const SoundVersion& sounds) {
    if (std::ranges::any_of(*sounds.emitters, [](const SoundEmitter& emitter) { return emitter.sound->head; }))
        runAhead();
}

bool AcousticEngine::Impl::hearsAs(const ListenerPose& listener) const {
    return head && (options.hrtf || alike({listener.headRadius(), air.speedOfSound}, headSize));
}

void AcousticEngine::Impl::makeHead(const ListenerPose& listener) {
    if (hearsAs(listener)) return;
    headSize = {listener.headRadius(), air.speedOfSound};
    head = options.hrtf ? options.hrtf : Hrtf::sphere(options.sampleRate, headSize.radius, headSize.speedOfSound);
}

/// Live sound goes on through the present head until another one is ready.
void AcousticEngine::Impl::findHead(const ListenerPose& listener) {
    if (!options.background || !head) return makeHead(listener);
    auto created = headMaker ? headMaker->take() : std::nullopt;
    if (hearsAs(listener)) {
        if (created) headAsked = {};  // an older request is no longer needed
        return;
    }
    if (created && created->head) {
        head = std::move(created->head);
        headSize = created->size;
        if (hearsAs(listener)) return;
    }
    const HeadMaker::Size size{listener.headRadius(), air.speedOfSound};
    if (!headMaker)
        headMaker = std::make_unique<HeadMaker>(options.sampleRate);
    else if (alike(size, headAsked))
        return;  // under way
    headAsked = size;
    headMaker->ask(size);
}

/// Gains of one input by channel of the output.
void AcousticEngine::Impl::gainsOf(const glm::dvec3& towards, bool spatialize, std::size_t input, std::size_t inputs,
                                   std::vector<double>& gains) const {
    std::fill(gains.begin(), gains.end(), 0.0);
    const double fraction = 1.0 / static_cast<double>(inputs);
    if (options.ambisonicOrder > 0) {
        if (!spatialize && inputs == 1) {
            gains[0] = 1;
            return;
        }
        const glm::dvec3 direction = turned(spatialize ? towards : glm::dvec3(0, 0, -1), channelAngle(input, inputs));
        ambisonicGains(options.ambisonicOrder, ambisonicAxes(direction), gains);
        for (double& gain : gains) gain *= fraction;
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
    for (std::size_t c = 0; c < 2; ++c) gains[c] = own[c] * fraction;
}

/// `apparent` is where it is heard from at the end of the block. `even`: it got there evenly. Precondition: delaysOf()
/// was called.
void AcousticEngine::Impl::findHeadRotations(const EmitterState& state, const glm::dvec3& apparent, bool even,
                                             Block& block) const {
    // Gains go on straight lines in between: what turns is smooth enough then.
    constexpr std::size_t kStep = 256;
    block.rotations.clear();
    for (std::size_t end = kStep; even && end < options.blockSize; end += kStep) {
        const double time = static_cast<double>(samples) + static_cast<double>(end);
        const ListenerPose listener = listenerMotion.at(time);
        const glm::dvec3 from = state.motion.at(time - block.delays[end - 1]).position;
        block.rotations.push_back({end, listener.toLocal(from - listener.position)});
    }
    block.rotations.push_back({options.blockSize, block.listener.toLocal(apparent - block.listener.position)});
}

/// Gives direct sound the direction that it comes from. If its path is another one than before, one fades into the
/// other.
void AcousticEngine::Impl::spatialise(const SoundNode& sound, EmitterState& state, Block& block) {
    const bool spatialize = sound.spatialize && !(glm::length(block.rotations.back().offset) <= kHere);
    const HeardBy by = spatialize ? state.reflectedBy : HeardBy::gains;
    const HeardBy earlier = state.spatialisedOnce ? state.heardBy : by;
    for (std::size_t k = 0; k < state.inputs.size(); ++k) {
        if (earlier != by) hear(state, k, earlier, spatialize, {1, 0}, block);
        if (by != HeardBy::head && earlier == by) ringOut(state.inputs[k], block);
        hear(state, k, by, spatialize, earlier == by ? Ramp{} : Ramp{0, 1}, block);
    }
    state.heardBy = by;
    state.spatialisedOnce = true;
}

void AcousticEngine::Impl::hear(EmitterState& state, std::size_t k, HeardBy by, bool spatialize, const Ramp& ramp,
                                Block& block) {
    const std::size_t size = options.blockSize, inputs = state.inputs.size();
    EmitterInput& input = state.inputs[k];
    const bool fresh = !state.spatialisedOnce || ramp.from == 0;
    const auto towards = [&](const Block::HeadRotation& rotation) {
        return spatialize ? directionOf(rotation.offset) : glm::dvec3(0);
    };
    if (by == HeardBy::head) {
        const glm::dvec3 ahead(0, 0, -1);
        const glm::dvec3 direction =
            turned(directionOr(towards(block.rotations.back()), ahead), channelAngle(k, inputs));
        std::vector<float>& fraction = block.part;
        fraction.resize(size);
        for (std::size_t i = 0; i < size; ++i) {
            const double w = ramp.from + (ramp.to - ramp.from) * static_cast<double>(i + 1) / static_cast<double>(size);
            fraction[i] = state.direct[k][i] * static_cast<float>(w / static_cast<double>(inputs));
        }
        input.head.setDirection(*head, direction, size);
        for (std::size_t e = 0; e < 2; ++e) input.head.process(e, fraction, block.ears[e]);
        input.ringing = input.head.rings();
        return;
    }
    std::vector<double>& gains = block.gains;
    gains.resize(channels);
    const std::span<const float> direct(state.direct[k]);
    std::size_t start = 0;
    for (const Block::HeadRotation& rotation : block.rotations) {
        const double fraction = static_cast<double>(rotation.end) / static_cast<double>(size);
        gainsOf(towards(rotation), spatialize, k, inputs, gains);
        if (start == 0 && fresh)
            for (std::size_t c = 0; c < channels; ++c) input.gains[c] = gains[c] * ramp.from;
        for (double& gain : gains) gain *= ramp.from + (ramp.to - ramp.from) * fraction;
        for (std::size_t c = 0; c < channels; ++c)
            mixInput(input, gains, c, direct.subspan(start, rotation.end - start),
                     std::span(block.out[c]).subspan(start, rotation.end - start));
        input.gains = gains;
        start = rotation.end;
    }
}

/// Lets sound that has gone into the head before ring out.
void AcousticEngine::Impl::ringOut(EmitterInput& input, Block& block) const {
    if (input.ringing == 0) return;
    block.part.assign(options.blockSize, 0.0f);
    for (std::size_t e = 0; e < 2; ++e) input.head.process(e, block.part, block.ears[e]);
    input.ringing -= std::min(input.ringing, options.blockSize);
    if (input.ringing == 0) input.head.restart();
}

/// Adds the sound of an input in a channel, with a gain that changes from the last one to this.
void AcousticEngine::Impl::mixInput(const EmitterInput& input, const std::vector<double>& gains, std::size_t channel,
                                    std::span<const float> direct, std::span<float> out) const {
    const std::size_t size = out.size();
    const double earlier = input.gains[channel], distance = gains[channel] - earlier;
    if (gains[channel] == 0 && earlier == 0) return;
    for (std::size_t i = 0; i < size; ++i)
        out[i] +=
            direct[i] * static_cast<float>(earlier + distance * static_cast<double>(i + 1) / static_cast<double>(size));
}

/// Renders an emitter that is gone from the scene from where it was last.
void AcousticEngine::Impl::hearGone(EmitterState& state, Block& block) {
    const auto inputs = static_cast<float>(state.inputs.size());
    for (std::size_t k = 0; k < state.inputs.size(); ++k) {
        EmitterInput& input = state.inputs[k];
        std::vector<float>& direct = state.direct[k];
        switch (state.heardBy) {
            case HeardBy::gains:
                for (std::size_t c = 0; c < channels; ++c) mixInput(input, input.gains, c, direct, block.out[c]);
                break;
            case HeardBy::head:
                for (float& sample : direct) sample /= inputs;
                for (std::size_t e = 0; e < 2; ++e) input.head.process(e, direct, block.ears[e]);
                break;
        }
    }
}

}  // namespace rtsg
