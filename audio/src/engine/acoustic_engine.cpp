// Follows states of a scene and cuts time into blocks.
#include "acoustic_engine.h"
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "acoustic_engine_impl.h"
#include "response/reach.h"

namespace rtsg {
namespace {

/// If a step has more changes than this, they are treated as one.
constexpr std::size_t kManyChanges = 256;

}  // namespace

TraceOptions AcousticOptions::heardTrace(double quality) {
    constexpr double kMaxRays = 1e12;
    const double rays = std::clamp(static_cast<double>(kHeardRays) * quality * quality, 1.0, kMaxRays);
    return heardTraceOf(static_cast<std::uint64_t>(std::llround(rays)));
}

TraceOptions AcousticOptions::heardTraceOf(std::uint64_t rays) {
    TraceOptions trace;
    trace.rays = rays;
    // Images take next to nothing beside rays, as long as they are as few as usual.
    trace.maxImageCandidates =
        std::clamp<std::size_t>(static_cast<std::size_t>(trace.rays), kHeardRays, trace.maxImageCandidates);
    trace.maxSeconds = 3;
    trace.batches = 8;
    return trace;
}

AcousticEngine::AcousticEngine(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
AcousticEngine::~AcousticEngine() = default;

Result<std::unique_ptr<AcousticEngine>> AcousticEngine::create(const AcousticOptions& options) {
    if (options.sampleRate < 8000 || options.sampleRate > 192'000) return fail("the sample rate must be 8 to 192 kHz");
    if (options.ambisonicOrder < 0 || options.ambisonicOrder > kMaxAmbisonicOrder)
        return fail("the ambisonic order must be 1 to 7");
    if (options.hrtf && options.hrtf->sampleRate() != options.sampleRate)
        return fail("the head's responses have another sample rate");
    return std::unique_ptr<AcousticEngine>(new AcousticEngine(std::make_unique<Impl>(options)));
}

namespace {

void readClips(const std::vector<SoundVoice>& voices, const std::vector<std::shared_ptr<const AudioProcess>>& processes,
               ClipLibrary& clips) {
    for (const SoundVoice& voice : voices)
        if (voice.kind != SoundVoice::Kind::oscillator && voice.kind != SoundVoice::Kind::buffer &&
            !clips.inputOf(voice))
            clips.get(voice);
    for (const auto& process : processes) readClips(process->voices, process->inputs, clips);
}

}  // namespace

void AcousticEngine::prepare(const AcousticState& state) {
    for (const SoundEmitter& emitter : *state.sounds.emitters)
        readClips(emitter.sound->voices, emitter.sound->processes, impl_->clips);
    impl_->runAheadFor(state.sounds);
    impl_->makeHead(state.sounds.listener);
}
int AcousticEngine::channels() const {
    return static_cast<int>(impl_->channels);
}
AudioFindings AcousticEngine::analyse() {
    AudioFindings found;
    for (auto& [id, state] : impl_->states)
        if (!state.gone) state.mix.analyse(found);
    return found;
}

const HeardResponses& AcousticEngine::heard() const {
    return impl_->heard;
}
const std::vector<StreamedSound>& AcousticEngine::streams() const {
    return impl_->streams;
}
const Diagnostics& AcousticEngine::diagnostics() const {
    return impl_->clips.diagnostics();
}
OpenedGeometry AcousticEngine::geometryFor(const AcousticState& state, const RayView& rays, const glm::dvec3& source) {
    impl_->follow(state, rays);
    impl_->geometry.settle();
    const auto around = impl_->geometry.instancesAround(source, impl_->options.bodySize);
    return {impl_->geometry, impl_->bodyOf(around, state.sounds.listener.position)};
}
Air AcousticEngine::airOf(const AcousticState& state) const {
    return impl_->options.air.over(state.sounds.air.over(impl_->options.trace.air));
}

void AcousticEngine::Impl::leaveOutRooms(std::vector<std::uint32_t>& around, const glm::dvec3& listener) const {
    std::erase_if(around, [&](std::uint32_t slot) { return geometry.boxHolds(slot, listener); });
}

/// A body contains the source and nobody else: a shape that also contains the listener is a room, however small.
std::vector<std::uint32_t> AcousticEngine::Impl::bodyOf(std::vector<std::uint32_t> around,
                                                        const glm::dvec3& listener) const {
    leaveOutRooms(around, listener);
    return around;
}

namespace {

/// Whether a wall goes as a source does, which in the same time has gone `motion`: a vehicle's do, in bends too.
bool goesAlong(const AcousticBox& before, const AcousticBox& now, const glm::dvec3& motion) {
    const glm::dvec3 gone = 0.5 * (now.low + now.high - before.low - before.high);
    return motion != glm::dvec3(0) && glm::distance(gone, motion) <= 0.5 * glm::length(motion);
}

/// Whether the box is seen under so small an angle that its effect on sound is small; false if a value is not finite.
bool isSmallFrom(const AcousticBox& box, const glm::dvec3& position) {
    constexpr double kSmall = 0.35;
    return glm::length(box.high - box.low) < kSmall * box.distance(position);
}

}  // namespace

/// The walls in the direct path that moved, for a source that moves by `motion`. The source's own body is never in its
/// path.
void AcousticEngine::Impl::noteMoved(const WorldGeometry::Changes& changes, const glm::dvec3& motion,
                                     EmitterState& emitter) const {
    constexpr double kNear = 0.5;  // metres from where it will be: what moves is heard from where it was
    for (std::size_t i = 0; i < changes.boxes.size(); ++i) {
        const std::uint32_t slot = changes.slots[i];
        if (!changes.boxes[i].meetsSegment(emitter.to, now.position, kNear) ||
            std::ranges::find(emitter.body, slot) != emitter.body.end())
            continue;
        emitter.movedWalls.add(slot, seconds());
        // The boxes of a wall before and after follow each other.
        const std::size_t other = i > 0 && changes.slots[i - 1] == slot ? i - 1 : i + 1;
        const bool both = other < changes.slots.size() && changes.slots[other] == slot;
        std::erase(emitter.alongside, slot);
        if (both && emitter.alongside.size() < MovedWalls::kMax &&
            goesAlong(changes.boxes[std::min(i, other)], changes.boxes[std::max(i, other)], motion))
            emitter.alongside.push_back(slot);
    }
}

/// Takes over the walls and marks the emitters that what changed may concern.
void AcousticEngine::Impl::follow(const AcousticState& state, const RayView& rays) {
    const WorldGeometry::Changes& changes = geometry.note(state.walls, rays);
    std::span<const AcousticBox> boxes(changes.boxes);
    AcousticBox all;
    if (boxes.size() > kManyChanges) {
        for (const AcousticBox& box : boxes) all.extend(box);
        boxes = {&all, 1};
    }
    for (auto& [id, emitter] : states) {
        bool inBody = changes.everything;
        bool concerned = changes.everything || (emitter.tracing && !boxes.empty());
        emitter.staleSoon = emitter.staleSoon || changes.everything;
        for (const AcousticBox& box : boxes) {
            const bool reached = mayReach(emitter.reached, emitter.tracedSource, emitter.tracedListener, longest, box);
            concerned = concerned || reached;
            emitter.staleSoon = emitter.staleSoon || (reached && !isSmallFrom(box, emitter.tracedSource)) ||
                                (reached && !isSmallFrom(box, emitter.tracedListener));
            // Written so that a box which is no number is near.
            inBody = inBody || !(box.distance(emitter.to) > 1.01 * options.bodySize);
        }
        if (concerned) noteWallsChanged(emitter);
        if (changes.everything) emitter.alongside.clear();
        if (!changes.everything && changes.boxes.size() <= kManyChanges) {
            const SoundEmitter* moved = state.sounds.find(id);
            noteMoved(changes, moved ? moved->position() - emitter.to : glm::dvec3(0), emitter);
        }
        if (inBody && !emitter.gone) emitter.around = geometry.instancesAround(emitter.to, options.bodySize);
    }
}

/// Records the positions that emitters move to. Emitters that jump, come or go do so when the frame ends.
void AcousticEngine::Impl::followEmitters(const SoundVersion& sounds, double poseSeconds) {
    const double time = poseSeconds * options.sampleRate, seconds = std::max(0.0, poseSeconds - posedAt);
    for (const SoundEmitter& emitter : *sounds.emitters) stateOf(emitter, time);
    for (auto& [id, state] : states) {
        const SoundEmitter* emitter = state.gone ? nullptr : sounds.find(id);
        if (!emitter) continue;
        const glm::dvec3 to = emitter->position();
        if (to != state.to) state.around = geometry.instancesAround(to, options.bodySize);
        // Faster than sound is not moving but being put somewhere else.
        state.jumps = state.jumps || !(glm::distance(state.to, to) <= air.speedOfSound * std::max(1e-3, seconds));
        state.to = to;
        if (!state.jumps) state.motion.put(time, to, false);
        const auto body = bodyOf(state.around, now.position);
        if (body != state.body) state.stale = state.staleSoon = true;
        state.body = body;
    }
}

/// Emitters that no longer exist begin to fade.
void AcousticEngine::Impl::takeOver(const SoundVersion& sounds, double poseSeconds) {
    const double time = poseSeconds * options.sampleRate;
    const bool all = std::exchange(listenerJumps, false);
    if (all) listenerMotion.put(time, now, true);
    for (auto& [id, state] : states) {
        if (state.gone) continue;
        if (!sounds.find(id)) {
            state.gone = true;
            state.fading = static_cast<std::size_t>(state.level.delay) + state.responseFrames + options.blockSize;
            continue;
        }
        const bool jumps = std::exchange(state.jumps, false);
        if (jumps) state.motion.put(time, state.to, true);
        state.jumped = state.jumped || jumps || all;
    }
    followAir(sounds);
    runAheadFor(sounds);
    playing = sounds;
}

void AcousticEngine::Impl::followListener(const ListenerPose& listener, double poseSeconds) {
    const double seconds = std::max(0.0, poseSeconds - posedAt);
    now = listener;
    if (!posed) {
        before = now;
        posed = true;
        toSkip = channels * latency();
        listenerMotion.put(posedAt * options.sampleRate, now, true);
    }
    listenerJumps =
        listenerJumps || !(glm::distance(before.position, now.position) <= air.speedOfSound * std::max(1e-3, seconds));
    if (!listenerJumps) listenerMotion.put(poseSeconds * options.sampleRate, now, false);
}

/// A change of the scene's air concerns every response.
void AcousticEngine::Impl::followAir(const SoundVersion& sounds) {
    const Air fresh = options.air.over(sounds.air.over(options.trace.air));
    if (fresh == air) return;
    air = fresh;
    longest = options.trace.maxSeconds * air.speedOfSound;
    for (auto& [id, state] : states) state.stale = state.staleSoon = true;
}

EmitterState& AcousticEngine::Impl::stateOf(const SoundEmitter& emitter, double time) {
    const auto found = states.find(emitter.id);
    if (found != states.end()) return found->second;
    const auto fade = static_cast<std::size_t>(options.retraceSeconds * options.sampleRate);
    // Counted in blocks that are the same for all, whenever an emitter came.
    const std::size_t round = states.size() + static_cast<std::size_t>(samples) / options.blockSize;
    EmitterState& state = states.try_emplace(emitter.id, options.blockSize, channels, fade, round).first->second;
    state.to = emitter.position();
    state.motion.put(time, state.to, true);
    state.around = geometry.instancesAround(state.to, options.bodySize);
    state.body = bodyOf(state.around, now.position);
    return state;
}

void AcousticEngine::Impl::followState(const AcousticState& state, const RayView& rays, double poseSeconds) {
    followListener(state.sounds.listener, poseSeconds);
    follow(state, rays);
    followEmitters(state.sounds, poseSeconds);
    posedAt = std::max(posedAt, poseSeconds);
}

/// Goes back in time, as a log does that is played again. The sound goes on without a gap, while clips, motions and
/// measurements begin anew.
void AcousticEngine::Impl::goBack(double seconds) {
    const double rate = options.sampleRate;
    const std::int64_t back = std::llround(renderedUntil * rate) - std::llround(seconds * rate);
    samples -= back;
    firstSample -= back;
    renderedUntil = posedAt = seconds;
    const auto restart = [&](Trajectory& motion, const glm::dvec3& position) {
        motion = Trajectory(options.blockSize);
        motion.put(seconds * rate, position, true);
    };
    listenerMotion = ListenerMotion(options.blockSize);
    listenerMotion.put(seconds * rate, now, true);
    for (auto& [id, state] : states) {
        if (state.gone) continue;
        state.mix = {};
        restart(state.motion, state.to);
        state.jumped = true;
        state.tracedAt = -std::numeric_limits<double>::infinity();
        state.movedWalls.clear();
        state.images.setOpen(1);
    }
}

Result<> AcousticEngine::Impl::renderTo(const SoundVersion& sounds, double untilSeconds, SoundBuffer& sound) {
    const auto count = static_cast<int>(channels);
    if (sound.samples.empty()) {
        sound.sampleRate = options.sampleRate;
        sound.channels = count;
    }
    if (sound.sampleRate != options.sampleRate || sound.channels != count)
        return fail("the sound rendered into has another format");
    const double rate = options.sampleRate;
    const std::size_t wanted = channels * static_cast<std::size_t>(std::max(
                                              0.0, std::round(untilSeconds * rate) - std::round(renderedUntil * rate)));
    while (ready.size() < wanted) {
        const double begin = static_cast<double>(samples) / rate;
        // The blocks ahead of the sound, by the latency of heads.
        if (begin >= untilSeconds && playing.emitters != sounds.emitters) takeOver(sounds, untilSeconds);
        block();
    }
    sound.samples.insert(sound.samples.end(), ready.begin(), ready.begin() + static_cast<std::ptrdiff_t>(wanted));
    ready.erase(ready.begin(), ready.begin() + static_cast<std::ptrdiff_t>(wanted));
    before = now;
    renderedUntil = std::max(renderedUntil, untilSeconds);
    return {};
}

Result<> AcousticEngine::render(const AcousticState& state, const RayView& rays, double untilSeconds,
                                SoundBuffer& sound) {
    constexpr double kRounding = 1e-6;  // times since 1970 are exact to a quarter of that
    Impl& s = *impl_;
    if (untilSeconds < s.renderedUntil - kRounding) s.goBack(untilSeconds);
    const double end = std::max(untilSeconds, s.renderedUntil);
    s.followState(state, rays, end);
    if (!s.playing.emitters) s.takeOver(state.sounds, end);
    if (auto done = s.renderTo(state.sounds, end, sound); !done) return done;
    s.takeOver(state.sounds, end);
    return {};
}

Result<> AcousticEngine::renderLive(std::shared_ptr<const AcousticState> state, std::shared_ptr<const RayView> rays,
                                    double poseSeconds, SoundBuffer& sound) {
    Impl& s = *impl_;
    const auto began = std::chrono::steady_clock::now();
    if (s.options.background && !s.worker) s.worker = std::make_unique<TraceWorker>();
    if (s.worker) {
        if (auto ok = s.worker->failure(); !ok) return ok;
        if (auto done = s.worker->take()) s.takeResponse(std::move(*done));
    }
    if (state != s.liveState) {
        s.liveState = std::move(state);
        s.liveRays = std::move(rays);
        s.followState(*s.liveState, *s.liveRays, poseSeconds);
        s.takeOver(s.liveState->sounds, poseSeconds);
    }
    auto done = s.renderTo(s.liveState->sounds, liveEnd(), sound);
    const std::chrono::duration<double> work = std::chrono::steady_clock::now() - began;
    constexpr double kNew = 0.01;  // so that it is told over some hundred blocks
    s.load += kNew * (work.count() * s.options.sampleRate / static_cast<double>(s.options.blockSize) - s.load);
    return done;
}

double AcousticEngine::liveEnd() const {
    const double rate = impl_->options.sampleRate;
    return (std::round(impl_->renderedUntil * rate) + static_cast<double>(impl_->options.blockSize)) / rate;
}

}  // namespace rtsg
