// Responses of emitters: when they are traced anew, and from what.
#include <algorithm>
#include <cmath>
#include <utility>

#include "acoustic_engine_impl.h"
#include "scene/source_pattern.h"

namespace rtsg {
namespace {

/// Cosine of 3.6 degrees, the least turn that is traced anew.
constexpr double kTurned = 0.998;
/// So many sources look for leaks, and with so many rays of each batch.
constexpr int kLeakSearches = 8, kLeakExits = 32;

}  // namespace

bool AcousticEngine::Impl::mustTrace(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                                     const ListenerPose& listener) const {
    if (worker && !worker->idle()) return false;
    if (!state.hasResponse) return true;
    const bool aimed = emitter.sound->directional(options.levels == AcousticOptions::Levels::x3d);
    const bool moved = state.stale || glm::distance(state.tracedSource, source) > options.moveTolerance ||
                       glm::distance(state.tracedListener, listener.position) > options.moveTolerance ||
                       glm::dot(state.tracedRight, listener.right) < kTurned ||
                       (options.ambisonicOrder > 0 && glm::dot(state.tracedBack, listener.back) < kTurned) ||
                       (aimed && !(glm::dot(state.tracedAim, emitter.aim()) >= kTurned));
    return (moved || (state.wallsChanged && shallSeekLeaks(state))) &&
           seconds() >= state.tracedAt + options.retraceSeconds;
}

void AcousticEngine::Impl::noteWallsChanged(EmitterState& state) const {
    state.stale = true;
    if (!state.hasResponse) return;
    state.leaksSought = false;
    if (!state.wallsChanged) state.wallsChanged.emplace(seconds(), 0);
    state.wallsChanged->second = seconds();
}

/// A door that opens is a crack for a moment: what moves is waited for, as long as it may be a door.
bool AcousticEngine::Impl::shallSeekLeaks(const EmitterState& state) const {
    constexpr double kRest = 0.5, kMostMotion = 5;
    if (state.leaksSought || (!state.countsAsSearch && leakSearches >= kLeakSearches)) return false;
    return !state.wallsChanged || seconds() >= state.wallsChanged->second + kRest ||
           seconds() >= state.wallsChanged->first + kMostMotion;
}

/// Sources at one place have one room around them: whose leaks were told as another one's are not looked for again.
bool AcousticEngine::Impl::leaksKnownFrom(const glm::dvec3& source) const {
    return std::ranges::any_of(states, [&](const auto& other) {
        const EmitterState& state = other.second;
        return state.leaksSought && state.openings.openings.empty() && state.leaksSoughtFrom == source;
    });
}

void AcousticEngine::Impl::trace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
                                 const ListenerPose& listener) {
    TraceJob job;
    job.emitter = emitter.id;
    job.source = source;
    job.listener = listener.position;
    job.body = state.body;
    job.tracing = options.trace;
    job.tracing.air = air;
    if (shallSeekLeaks(state)) {
        state.wallsChanged.reset();
        state.leaksSought = leaksKnownFrom(source);
        state.leaksSoughtFrom = source;
        if (!state.leaksSought) job.tracing.exits = kLeakExits;
    }
    job.tracing.pattern = patternOf(emitter, source, listener.position, options.levels == AcousticOptions::Levels::x3d);
    job.error = options.error;
    job.maxRays = options.maxRays;
    job.longest = longest;
    job.block = options.blockSize;
    using Channels = ImpulseResponseOptions::Channels;
    job.response.channels = options.ambisonicOrder > 0 ? Channels::ambisonic
                            : options.binaural         ? Channels::binaural
                                                       : Channels::stereo;
    job.response.ambisonicOrder = options.ambisonicOrder;
    job.response.hrtf = options.hrtf;
    job.response.sampleRate = options.sampleRate;
    job.response.listenerRight = listener.right;
    job.response.listenerUp = listener.up;
    job.response.listenerBack = listener.back;
    job.response.firstOrder = 1;
    job.response.cutShare = 1e-6;
    job.response.speedOfSound = air.speedOfSound;
    // The same noise each time, another for each emitter: crossfades then do not rustle.
    job.response.seed = emitter.id.slot + 1;
    state.hasResponse = true;
    state.tracedAt = seconds();
    state.tracedSource = source;
    state.tracedListener = listener.position;
    state.tracedRight = listener.right;
    state.tracedBack = listener.back;
    state.tracedAim = emitter.aim();
    state.stale = false;
    if (!worker) {
        takeResponse(traceResponse(job, geometry));
        return;
    }
    job.state = liveState;
    job.rays = liveRays;
    state.tracing = true;
    worker->submit(std::move(job));
}

void AcousticEngine::Impl::takeResponse(TracedResponse traced) {
    ++heard.responses;
    heard.rays = std::max(heard.rays, traced.rays);
    heard.images = std::max(heard.images, traced.images);
    if (!std::isnan(traced.error))
        heard.error = std::isnan(heard.error) ? traced.error : std::max(heard.error, traced.error);
    const auto found = states.find(traced.emitter);
    if (found == states.end()) return;
    EmitterState& state = found->second;
    for (std::size_t c = 0; c < channels; ++c) state.late[c].setResponse(std::move(traced.channels[c]));
    state.responseFrames = std::max(state.responseFrames, traced.frames);
    state.reached = traced.reached;
    state.tracing = false;
    state.seal = std::move(traced.seal);
    if (!state.seal) toldSealed.erase(traced.emitter);
    // In the open, or where nothing is lost, looking costs nothing, and walls may come yet.
    if (traced.openings.outdoors || !(traced.openings.escaped > 0)) return;
    state.leaksSought = true;
    if (!std::exchange(state.countsAsSearch, true)) ++leakSearches;
    state.openings = std::move(traced.openings);
}

void AcousticEngine::Impl::noteLeaks(const SoundEmitter& emitter, const glm::dvec3& source, double seconds,
                                     const RoomOpenings& openings) {
    constexpr std::size_t kMost = 1000;
    // Less cannot be heard, alone or beside what else escapes.
    constexpr double kLeast = 1e-4, kLeastOfAll = 0.01;
    for (const RoomOpening& opening : openings.openings) {
        const double share = opening.meanShare();
        if (!opening.leak || share < kLeast || share < kLeastOfAll * openings.escaped || leaks.size() >= kMost)
            continue;
        const bool known = std::any_of(leaks.begin(), leaks.end(), [&](const SoundLeak& leak) {
            const double near = 0.01 + 0.25 * std::max(leak.opening.length, opening.length);
            return glm::distance(leak.opening.center, opening.center) < near;
        });
        if (!known) leaks.push_back({emitter.name, emitter.sound->node, source, seconds, opening});
    }
}

void AcousticEngine::Impl::noteSeal(const SoundEmitter& emitter, const glm::dvec3& source, const glm::dvec3& listener,
                                    double seconds, Seal seal) {
    constexpr std::size_t kMost = 1000;
    const auto [told, fresh] = toldSealed.try_emplace(emitter.id, seal.sourceInside);
    if (!fresh && told->second == seal.sourceInside) return;
    told->second = seal.sourceInside;
    if (sealed.size() < kMost)
        sealed.push_back({emitter.name, emitter.sound->node, source, listener, seconds, std::move(seal)});
}

const std::vector<SealedSource>& AcousticEngine::sealed() const {
    return impl_->sealed;
}

const std::vector<SoundLeak>& AcousticEngine::leaks() const {
    return impl_->leaks;
}

void AcousticEngine::note(const SoundEmitter& emitter, double seconds, const RoomOpenings& openings) {
    impl_->noteLeaks(emitter, emitter.position(), seconds, openings);
}

void AcousticEngine::note(const SoundEmitter& emitter, const glm::dvec3& listener, double seconds,
                          std::optional<Seal> seal) {
    if (seal)
        impl_->noteSeal(emitter, emitter.position(), listener, seconds, std::move(*seal));
    else
        impl_->toldSealed.erase(emitter.id);
}

}  // namespace rtsg
