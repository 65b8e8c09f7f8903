// Responses of emitters: decides when they are traced again, and from where.
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "acoustic_engine_impl.h"
#include "scene/source_pattern.h"
#include "signal/random.h"

namespace rtsg {
namespace {

/// Cosine of 3.6 degrees, the least turn that is traced anew.
constexpr double kTurned = 0.998;
/// The number of sources that look for leaks, and of exits from each batch for that.
constexpr int kLeakSearches = 8, kLeakExits = 32;
/// Metres that source and listener go at most while late energy goes on to count.
constexpr double kNearly = 2;
/// Seconds in which what begins to move is followed, and metres that it has moved by then.
constexpr double kSetOff = 0.01, kSetOffMoved = 1e-4;
/// Seconds after a trace the next one at the earliest, and in which it fades over, where a wall has moved into the
/// straight way or out of it.
constexpr double kSoon = 0.05;
/// Seconds in which first reflections fade in, of what sounds already.
constexpr double kBegins = 0.1;
/// A response is kept this many times as long if all changes are small and far away: their effect is less than that of
/// other random rays.
constexpr double kFarChanges = 5;
/// Images of a source that follow, and waves by way of edges, at most.
constexpr std::size_t kMaxImages = 8, kMaxEdges = 16;

/// Some of its sound came round edges when it was traced.
bool hasEdges(const EmitterState& state) {
    return state.traced && !state.traced->edges.waves.empty();
}

}  // namespace

AcousticEngine::Impl::Renewal AcousticEngine::Impl::renewalOf(const SoundEmitter& emitter, const EmitterState& state,
                                                              const glm::dvec3& source,
                                                              const ListenerPose& listener) const {
    if (worker && !worker->idle()) return Renewal::none;
    if (!state.hasResponse) return Renewal::trace;
    if (setsOff(emitter, state, source, listener)) return Renewal::setOff;
    const bool outdated = state.movedWalls.outdated();
    const double age = seconds() - state.tracedAt;
    if (age < std::min(outdated ? kSoon : options.retraceSeconds, options.retraceSeconds)) return Renewal::none;
    if (outdated) return Renewal::trace;
    const bool aimed = emitter.sound->directional(options.levels == AcousticOptions::Levels::x3d);
    const bool stale = state.stale && (state.staleSoon || age >= kFarChanges * options.retraceSeconds);
    const bool moved = stale || glm::distance(state.tracedSource, source) > options.moveTolerance ||
                       glm::distance(state.tracedListener, listener.position) > options.moveTolerance ||
                       (aimed && !(glm::dot(state.tracedAim, emitter.aim()) >= kTurned));
    if (moved) return Renewal::trace;
    const bool allRound = options.ambisonicOrder > 0 || state.reflectedBy == HeardBy::head;
    const bool turned = glm::dot(state.tracedRight, listener.right) < kTurned ||
                        (allRound && glm::dot(state.tracedBack, listener.back) < kTurned) ||
                        state.tracedBy != state.reflectedBy || state.tracedRadius != listener.headRadius();
    return turned && state.traced ? Renewal::rotation : Renewal::none;
}

/// The worker makes one response after the other: where there are more to be made than it can, whose is oldest comes
/// first, or those who come first would be heard by new ones and the others never.
void AcousticEngine::Impl::renew(const SoundEmitter& emitter, EmitterState& state) {
    const Renewal renewal = renewalOf(emitter, state, state.to, now);
    // A response for which direct sound waits counts as a second older.
    const auto since = [](const EmitterState& one) { return one.tracedAt - (one.movedWalls.outdated() ? 1 : 0); };
    if (renewal == Renewal::none || (worker && due.state && since(*due.state) <= since(state))) return;
    due = {&emitter, &state, renewal};
    if (!worker) renewLongestDue();
}

void AcousticEngine::Impl::renewLongestDue() {
    const auto [emitter, state, renewal] = std::exchange(due, {});
    if (renewal == Renewal::trace) trace(*state, *emitter, state->to, now);
    if (renewal == Renewal::rotation || renewal == Renewal::setOff) reuse(*state, *emitter, now, renewal);
}

void AcousticEngine::Impl::noteWallsChanged(EmitterState& state) const {
    state.stale = true;
}

/// Whether its images are to follow it: it moved by more than `least` metres, or the listener did. Sound that is not to
/// be shifted keeps its way.
bool AcousticEngine::Impl::isFollowed(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                                      const ListenerPose& listener, double minimum) const {
    return state.hasResponse && !state.jumps && !listenerJumps && (emitter.sound->doppler || listener.doppler) &&
           (glm::distance(state.tracedSource, source) > minimum ||
            glm::distance(state.tracedListener, listener.position) > minimum);
}

/// Sound that bends must be followed from the first, as direct sound is, or it would be late where that ends.
bool AcousticEngine::Impl::setsOff(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                                   const ListenerPose& listener) const {
    return !state.tracedImages && hasEdges(state) && isFollowed(emitter, state, source, listener, kSetOffMoved);
}

/// How many images, or waves by way of edges, are to follow the source, or the listener, rather than be heard from
/// where they were: of those that move the loudest, as long as they are few, and fewer through a head, which takes more
/// time.
std::size_t AcousticEngine::Impl::followedOf(const EmitterState& state, std::size_t maximum) const {
    constexpr std::size_t kMaxOfAll = 96, kMaxThroughHead = 32;
    if (!state.moves) return 0;
    const auto moving = std::ranges::count_if(states, [](const auto& other) { return other.second.moves; });
    const std::size_t all = state.reflectedBy == HeardBy::head ? kMaxThroughHead : kMaxOfAll;
    return std::clamp<std::size_t>(all / static_cast<std::size_t>(moving), 1, maximum);
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
    job.quick = worker && heard.unreflected > 1;
    if (!job.quick && !std::exchange(state.leaksSought, true) && leakSearches < kLeakSearches) {
        ++leakSearches;
        job.tracing.exits = kLeakExits;
    }
    job.tracing.pattern = patternOf(emitter, source, listener.position, options.levels == AcousticOptions::Levels::x3d);
    state.moves =
        isFollowed(emitter, state, source, listener, hasEdges(state) ? kSetOffMoved : 0.5 * options.moveTolerance);
    job.followed = followedOf(state, kMaxImages);
    job.followedEdges = followedOf(state, kMaxEdges);
    // Each has rays of its own, so that their mean tells more than any of them.
    job.tracing.seed += state.traces++;
    if (job.tracing.exits == 0 &&
        glm::distance(state.tracedSource, source) + glm::distance(state.tracedListener, listener.position) <= kNearly)
        job.kept = state.kept;
    job.longest = longest;
    job.block = options.blockSize;
    job.response = responseFor(&emitter, state.reflectedBy, listener);
    state.tracedSource = source;
    state.tracedListener = listener.position;
    state.tracedAim = emitter.aim();
    state.movedWalls.asked = {state.movedWalls.open(), seconds()};
    state.stale = state.staleSoon = false;
    state.tracing = worker != nullptr;
    submit(state, std::move(job), listener);
}

/// Paths and levels stay the same; only their directions relative to the head change, or they are followed from here
/// on.
void AcousticEngine::Impl::reuse(EmitterState& state, const SoundEmitter& emitter, const ListenerPose& listener,
                                 Renewal why) {
    TraceJob job;
    job.emitter = emitter.id;
    job.block = options.blockSize;
    job.response = responseFor(&emitter, state.reflectedBy, listener);
    job.traced = state.traced;
    job.images = state.tracedImages;
    if (why == Renewal::setOff) {
        job.source = state.tracedSource;
        job.listener = state.tracedListener;
        job.tracing = options.trace;
        job.tracing.air = air;
        job.tracing.pattern =
            patternOf(emitter, job.source, job.listener, options.levels == AcousticOptions::Levels::x3d);
        state.moves = true;
        job.followed = followedOf(state, kMaxImages);
        job.followedEdges = followedOf(state, kMaxEdges);
    }
    submit(state, std::move(job), listener);
}

ImpulseResponseOptions AcousticEngine::Impl::responseFor(const SoundEmitter* emitter, HeardBy by,
                                                         const ListenerPose& listener) const {
    using Channels = ImpulseResponseOptions::Channels;
    ImpulseResponseOptions response;
    response.channels = options.ambisonicOrder > 0 ? Channels::ambisonic
                        : by == HeardBy::gains     ? Channels::stereo
                                                   : Channels::binaural;
    response.ambisonicOrder = options.ambisonicOrder;
    if (by == HeardBy::head) response.hrtf = head;
    response.headRadius = listener.headRadius();
    response.sampleRate = options.sampleRate;
    response.listenerRight = listener.right;
    response.listenerUp = listener.up;
    response.listenerBack = listener.back;
    response.firstOrder = 1;
    response.cutFraction = 1e-6;
    response.speedOfSound = air.speedOfSound;
    // The same noise each time, wherever its ends are, another for each emitter: crossfades then do not rustle.
    response.sharedNoise = true;
    response.seed = options.trace.seed;
    if (emitter)
        for (const char c : emitter->name) response.seed = Random::mix(response.seed, static_cast<unsigned char>(c));
    return response;
}

void AcousticEngine::Impl::submit(EmitterState& state, TraceJob job, const ListenerPose& listener) {
    state.hasResponse = true;
    state.tracedAt = seconds();
    state.tracedRight = listener.right;
    state.tracedBack = listener.back;
    state.tracedBy = state.reflectedBy;
    state.tracedRadius = listener.headRadius();
    geometry.settle();
    if (!worker) return takeResponse(traceResponse(job, geometry));
    job.state = liveState;
    job.rays = liveRays;
    job.fraction = tracingFraction(load);
    worker->submit(std::move(job));
}

void AcousticEngine::Impl::takeResponse(TracedResponse traced) {
    ++(traced.turned ? heard.turned : heard.responses);
    heard.rays = std::max(heard.rays, traced.rays);
    heard.raysInAll += traced.rays;
    heard.images = std::max(heard.images, traced.imageCount);
    const auto found = states.find(traced.emitter);
    if (found == states.end()) return;
    EmitterState& state = found->second;
    for (std::size_t c = 0; c < channels; ++c) state.late[c].setResponse(std::move(traced.channels[c]));
    state.tracedImages = traced.images;
    if (!traced.turned) state.movedWalls.traced = state.movedWalls.asked;
    const StraightPath& straight = state.movedWalls.traced;
    const bool takesOver = isLate(state.images.straight().open, straight.open);
    // Images that begin to be followed sound as before as long as they have hardly moved: the sooner they take over the
    // better.
    const double seconds = traced.setsOff ? kSetOff : takesOver ? kSoon : state.traced ? 0 : kBegins;
    const auto fade = static_cast<std::size_t>(seconds * options.sampleRate);
    for (Convolver& late : state.late) late.fadeOnceIn(fade);
    state.images.set(std::move(traced.images), fade, straight);
    state.responseFrames = std::max(state.responseFrames, traced.frames);
    if (traced.turned) return;
    state.traced = std::move(traced.traced);
    state.kept = std::move(traced.kept);
    // A response that was traced in haste is improved until it is as good as others.
    if (state.kept.parts < kTraceParts) state.stale = state.staleSoon = true;
    state.reached = traced.reached;
    state.tracing = false;
    state.seal = std::move(traced.seal);
    if (!state.seal) endSeal(traced.emitter, this->seconds());
    state.openings = std::move(traced.openings);
}

void AcousticEngine::Impl::noteLeaks(const SoundEmitter& emitter, const RoomOpenings& openings) {
    constexpr std::size_t kMax = 1000;
    constexpr double kMin = 1e-4;  // weaker sound cannot be heard
    if (!openings.leak || openings.fraction < kMin || leaks.size() >= kMax) return;
    // It is known to some per cent of its size, and to some more from elsewhere.
    const bool known = std::ranges::any_of(leaks, [&](const SoundLeak& leak) {
        const double near = 0.02 + 0.25 * std::max(leak.openings.length, openings.length);
        return glm::distance(leak.openings.center, openings.center) < near;
    });
    if (!known) leaks.push_back({emitter.name, openings});
}

void AcousticEngine::Impl::noteSeal(const SoundEmitter& emitter, const glm::dvec3& source, const glm::dvec3& listener,
                                    double seconds, Seal seal) {
    constexpr std::size_t kMax = 1000;
    const auto reported = reportedSealed.find(emitter.id);
    if (reported != reportedSealed.end() && reported->second.first == seal.sourceInside) return;
    endSeal(emitter.id, seconds);
    reportedSealed[emitter.id] = {seal.sourceInside, sealed.size()};
    if (sealed.size() < kMax)
        sealed.push_back({emitter.name, emitter.sound->node, source, listener, seconds, std::move(seal)});
}

void AcousticEngine::Impl::endSeal(InstanceId emitter, double seconds) {
    const auto reported = reportedSealed.find(emitter);
    if (reported == reportedSealed.end()) return;
    if (reported->second.second < sealed.size()) sealed[reported->second.second].until = seconds;
    reportedSealed.erase(reported);
}

/// The present reason; sources that come within reach later are heard.
void AcousticEngine::Impl::noteUnheard(const SoundEmitter& emitter, double distance, bool inReach,
                                       const ListenerPose& listener) {
    using Why = UnheardSource::Why;
    constexpr std::size_t kMax = 1000;
    const SoundNode& sound = *emitter.sound;
    auto found = unheard.find(emitter.id);
    if (found == unheard.end()) {
        if (unheard.size() >= kMax) return;
        found = unheard.try_emplace(emitter.id).first;
        found->second = {emitter.name, sound.node, Why::far, distance, {}};
        if (sound.law == SoundNode::Law::ellipsoids)
            found->second.reach = fmt::format("maxFront {:g}, maxBack {:g}", sound.maxFront, sound.maxBack);
        else if (sound.law == SoundNode::Law::linear)
            found->second.reach = fmt::format("maxDistance {:g}", sound.maxDistance);
    }
    UnheardSource& source = found->second;
    source.nearest = std::min(source.nearest, distance);
    source.why = !sound.enabled         ? Why::off
                 : !sound.plays()       ? Why::empty
                 : sound.intensity == 0 ? Why::silent
                 : listener.gain == 0   ? Why::deaf
                 : inReach              ? Why::still
                                        : Why::far;
}

std::vector<UnheardSource> AcousticEngine::unheard() const {
    std::vector<UnheardSource> all;
    // If any source is in reach, authors mean the others to be out of it.
    for (const auto& [id, source] : impl_->unheard)
        if (!impl_->anyHeard && (!impl_->anyInReach || source.why == UnheardSource::Why::still)) all.push_back(source);
    return all;
}

const std::vector<SealedSource>& AcousticEngine::sealed() const {
    return impl_->sealed;
}

const std::vector<SoundLeak>& AcousticEngine::leaks() const {
    return impl_->leaks;
}

void AcousticEngine::note(const SoundEmitter& emitter, const RoomOpenings& openings) {
    impl_->noteLeaks(emitter, openings);
}

void AcousticEngine::note(const SoundEmitter& emitter, const glm::dvec3& listener, double seconds,
                          std::optional<Seal> seal) {
    if (seal)
        impl_->noteSeal(emitter, emitter.position(), listener, seconds, std::move(*seal));
    else
        impl_->endSeal(emitter.id, seconds);
}

}  // namespace rtsg
