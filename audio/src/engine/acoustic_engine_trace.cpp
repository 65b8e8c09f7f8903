// Responses of emitters: when they are traced anew, and from what.
#include <algorithm>
#include <cmath>

#include <rtsg/audio/impulse_response.h>

#include "acoustic_engine_impl.h"
#include "trace/reach.h"

namespace rtsg {
namespace {

/// Cosine of 3.6 degrees, the least turn that is traced anew.
constexpr double kTurned = 0.998;

/// The direction that an emitter faces, in the world.
glm::dvec3 aimOf(const SoundEmitter& emitter) {
    const WorldFromLocal& m = emitter.worldFromLocal;
    const glm::dvec3 aim = glm::dmat3(m[0], m[1], m[2]) * emitter.sound->direction;
    const double length = glm::length(aim);
    return length > 0 && std::isfinite(length) ? aim / length : glm::dvec3(0);
}

}  // namespace

/// What it sends where, relative to what its level would be if it sent alike to all sides as it does to the listener.
SourcePattern AcousticEngine::Impl::patternOf(const SoundEmitter& emitter, const glm::dvec3& source,
                                              const glm::dvec3& listener) const {
    const SoundNode& sound = *emitter.sound;
    const bool levelled = options.levels == AcousticOptions::Levels::x3d;
    if (!sound.directional(levelled)) return {};
    const double distance = glm::distance(source, listener);
    const double reference = levelled ? sound.level(emitter.localFrom(listener - source)) : 1;
    if (!(reference > 0)) return {};
    return [&emitter, distance, reference, levelled](const glm::dvec3& direction) {
        const glm::dvec3 local = emitter.localFrom(direction * std::max(distance, 1e-3));
        const double amplitude =
            emitter.sound->coneGain(local) * (levelled ? emitter.sound->level(local) / reference : 1);
        return amplitude * amplitude;
    };
}

bool AcousticEngine::Impl::mustTrace(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                                     const ListenerPose& listener) const {
    if (!state.hasResponse) return true;
    const bool aimed = emitter.sound->directional(options.levels == AcousticOptions::Levels::x3d);
    const bool moved = state.stale || glm::distance(state.tracedSource, source) > options.moveTolerance ||
                       glm::distance(state.tracedListener, listener.position) > options.moveTolerance ||
                       glm::dot(state.tracedRight, listener.right) < kTurned ||
                       (options.ambisonicOrder > 0 && glm::dot(state.tracedBack, listener.back) < kTurned) ||
                       (aimed && !(glm::dot(state.tracedAim, aimOf(emitter)) >= kTurned));
    return moved && static_cast<double>(samples) / options.sampleRate >= state.tracedAt + options.retraceSeconds;
}

void AcousticEngine::Impl::trace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
                                 const ListenerPose& listener) {
    const OpenedGeometry room(geometry, state.body);
    const ReachRecorder recorder(room, longest);
    const AcousticTracer tracer(recorder);
    TraceOptions tracing = options.trace;
    tracing.air = air;
    tracing.pattern = patternOf(emitter, source, listener.position);
    TraceResult traced = tracer.trace(source, listener.position, tracing);
    if (options.error > 0) {
        const double error =
            tracer.refineTo(traced, source, listener.position, tracing, options.error, options.maxRays);
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
    response.speedOfSound = air.speedOfSound;
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
    state.tracedAim = aimOf(emitter);
    state.reached = recorder.reached();
    // The receiver's ball shrinks before a wall: what comes near the listener counts as well.
    state.reached.extend(listener.position - traced.receiverRadius / 0.4);
    state.reached.extend(listener.position + traced.receiverRadius / 0.4);
    state.stale = false;
    ++heard.responses;
    heard.rays = std::max(heard.rays, traced.rays);
    heard.images = std::max(heard.images, traced.arrivals.size());
}

}  // namespace rtsg
