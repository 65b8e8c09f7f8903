// Computes the share of direct sound that walls leave, resting and moving ones, and its loudness.
#include <algorithm>
#include <cmath>

#include "acoustic_engine_impl.h"
#include "images/image_sources.h"

namespace rtsg {
namespace {

/// Seconds for which direct sound waits for what bends, where tracing takes longer than that.
constexpr double kLongestWait = 0.5;

}  // namespace

glm::dvec3 AcousticEngine::Impl::apparentPosition(const EmitterState& state, double delay) const {
    return state.motion.at(static_cast<double>(samples) + static_cast<double>(options.blockSize) - delay).position;
}

/// The walls are the present ones, but the sound that is heard left earlier. Shapes that have since moved over its
/// starting point, such as the body of a moving source, count as its body, not as walls.
void AcousticEngine::Impl::findBodyAt(const EmitterState& state, const glm::dvec3& apparent,
                                      const ListenerPose& listener, std::vector<std::uint32_t>& body) const {
    body.clear();
    const double distance = glm::distance(apparent, listener.position);
    if (apparent != state.to && distance > 0) {
        geometry.addBodies(apparent, (listener.position - apparent) / distance, options.bodySize, body);
        leaveOutRooms(body, listener.position);
    }
    body.insert(body.end(), state.body.begin(), state.body.end());
}

/// Share of the energy of the bands of speech and music; `open`: slots that are not there.
double AcousticEngine::Impl::straightFraction(std::vector<std::uint32_t>& open, const glm::dvec3& apparent,
                                              const glm::dvec3& listener) const {
    OpenedGeometry room(geometry, std::move(open));
    const Bands fraction = directFraction(room, apparent, listener);
    open = room.takeOpen();
    double sum = 0;
    for (std::size_t b = 2; b < 7; ++b) sum += fraction[b] / 5;
    return sum;
}

/// The share that all walls leave. Walls that go along with the source stood beside it as they do now when it sent the
/// sound that is heard now, so they are judged from where both are now. Otherwise the body of a train would cover its
/// own sound, and be gone again with the next block.
double AcousticEngine::Impl::fractionOfAll(EmitterState& state, const glm::dvec3& apparent, Block& block) const {
    const glm::dvec3& listener = block.listener.position;
    if (apparent == state.to) state.alongside.clear();
    if (state.alongside.empty()) return straightFraction(block.bodies, apparent, listener);
    const auto without = [&](const std::vector<std::uint32_t>& body) {
        block.open = body;
        block.open.insert(block.open.end(), state.alongside.begin(), state.alongside.end());
        return std::ref(block.open);
    };
    const double others = straightFraction(without(block.bodies), apparent, listener);
    const glm::dvec3 beside = listener + (state.to - apparent);
    const double maximum = straightFraction(without(state.body), state.to, beside);
    if (!(others > 0) || !(maximum > 0)) return others;
    block.open = state.body;
    return others * std::min(1.0, straightFraction(block.open, state.to, beside) / maximum);
}

/// Measures the share of direct sound that walls leave at the end of the block. For walls that moved since the response
/// in use was traced, the share at that time is used.
void AcousticEngine::Impl::measurePath(const SoundNode& sound, EmitterState& state, const glm::dvec3& apparent,
                                       Block& block) const {
    MovedWalls& moved = state.movedWalls;
    const auto forget = [&] {
        moved.clear();
        state.images.setOpen(1);
        moved.resting = moved.heard = moved.all;
        moved.lateSince = seconds();
    };
    moved.all = 0;
    if (!(glm::distance(apparent, block.listener.position) < kHorizon) || sound.law == SoundNode::Law::none)
        return forget();
    findBodyAt(state, apparent, block.listener, block.bodies);
    moved.all = fractionOfAll(state, apparent, block);
    if (!moved.any() || !options.reflections || !sound.reflected || !state.traced || state.jumped) return forget();
    const auto resting = [&] {
        block.open = block.bodies;
        block.open.insert(block.open.end(), moved.slots().begin(), moved.slots().end());
        return straightFraction(block.open, apparent, block.listener.position);
    };
    const auto scale = [&](double factor) {
        state.images.scaleOpen(factor);
        for (StraightPath* known : {&moved.traced, &moved.asked}) known->open = std::min(1.0, known->open * factor);
    };
    double fraction = resting();
    // Nothing is heard of a wall's setting off, or coming to rest.
    if (moved.takeGrown() && fraction > 0) scale(std::sqrt(moved.resting / fraction));
    if (!state.images.fades() && moved.settle(state.images.straight().at)) {
        if (!moved.any()) return forget();
        const double fewer = resting();
        if (fewer > 0) scale(std::sqrt(fraction / fewer));
        fraction = fewer;
    }
    moved.resting = fraction;
    const double open = state.images.openNext();
    moved.heard = fraction * open * open;
    if (state.images.fades() || !isLate(moved.heard, moved.all)) moved.lateSince = seconds();
    if (seconds() < moved.lateSince + kLongestWait) return;
    state.images.setOpen(moved.open());
    moved.heard = moved.all;
}

void AcousticEngine::Impl::levelOf(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& apparent,
                                   const Block& block, HeardLevel& to, bool& audible) const {
    const SoundNode& sound = *emitter.sound;
    const ListenerPose& listener = block.listener;
    // Sound that left before a gain became that large is still on its way.
    const auto bounded = [](double gain) { return std::isnan(gain) ? 0 : std::clamp(gain, -kLoudest, kLoudest); };
    if (sound.law == SoundNode::Law::none) {
        audible = true;
        to.directGain = to.lateGain = bounded(sound.intensity * listener.gain);
        return;
    }
    double distance = glm::distance(apparent, listener.position);
    const bool near = distance < kHorizon;
    if (!near) distance = kHorizon;
    // The listener in the node's frame as if the node were where it was heard.
    const glm::dvec3 local = emitter.localFrom(listener.position - apparent);
    const double level =
        !near ? 0
              : sound.intensity * listener.gain *
                    (options.levels == AcousticOptions::Levels::x3d ? sound.level(local) : 1 / std::max(distance, 0.1));
    audible = level != 0;
    const double open = state.movedWalls.heard * std::exp(-airAttenuation(air)[kBand1k] * distance);
    to.heard = state.movedWalls.resting > 0;
    // In a response direct sound is 1 / d: times d, reflections keep their ratio to it.
    to.directGain = bounded(level * sound.coneGain(local) * std::sqrt(open));
    to.lateGain = bounded(level * std::max(distance, 0.1));
}

}  // namespace rtsg
