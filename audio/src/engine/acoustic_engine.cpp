// Follows states of a scene and cuts time into blocks.
#include <rtsg/audio/acoustic_engine.h>
#include <algorithm>
#include <cmath>
#include <optional>

#include "acoustic_engine_impl.h"
#include "trace/reach.h"

namespace rtsg {
namespace {

/// More changes than this in one step are looked at as one.
constexpr std::size_t kManyChanges = 256;

glm::dvec3 mixedAxis(const glm::dvec3& a, const glm::dvec3& b, double alpha) {
    const glm::dvec3 m = glm::mix(a, b, alpha);
    const double length = glm::length(m);
    return length > 1e-6 ? m / length : b;
}

ListenerPose mixedPose(const ListenerPose& before, const ListenerPose& now, double alpha) {
    ListenerPose pose = now;
    pose.position = glm::mix(before.position, now.position, alpha);
    pose.right = mixedAxis(before.right, now.right, alpha);
    pose.up = mixedAxis(before.up, now.up, alpha);
    pose.back = mixedAxis(before.back, now.back, alpha);
    return pose;
}

}  // namespace

void AcousticOptions::ask(std::uint64_t rays, double largestError) {
    if (rays > trace.rays || largestError > 0) trace.maxImageCandidates = TraceOptions().maxImageCandidates;
    if (rays > 0) trace.rays = rays;
    error = largestError;
}

AcousticEngine::AcousticEngine(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
AcousticEngine::~AcousticEngine() = default;

Result<std::unique_ptr<AcousticEngine>> AcousticEngine::create(const AcousticOptions& options) {
    if (options.sampleRate < 8000 || options.sampleRate > 192'000) return fail("the sample rate must be 8 to 192 kHz");
    if (options.ambisonicOrder < 0 || options.ambisonicOrder > kMaxAmbisonicOrder)
        return fail("the ambisonic order must be 1 to 7");
    std::optional<LoopbackMixer> mixer;
    if (options.ambisonicOrder == 0) {
        auto opened = LoopbackMixer::open(
            {.sampleRate = options.sampleRate, .binaural = options.binaural, .blockSize = options.blockSize});
        if (!opened) return std::unexpected(opened.error());
        mixer = std::move(*opened);
    }
    return std::unique_ptr<AcousticEngine>(new AcousticEngine(std::make_unique<Impl>(options, std::move(mixer))));
}

int AcousticEngine::channels() const {
    return static_cast<int>(impl_->channels);
}
const HeardResponses& AcousticEngine::heard() const {
    return impl_->heard;
}
const Diagnostics& AcousticEngine::diagnostics() const {
    return impl_->clips.diagnostics();
}
OpenedGeometry AcousticEngine::geometryFor(const AcousticState& state, const RayView& rays, const glm::dvec3& source) {
    impl_->follow(state, rays);
    return {impl_->geometry, impl_->geometry.instancesAround(source, impl_->options.bodySize)};
}

void AcousticEngine::Impl::findBody(EmitterState& state) {
    state.body = geometry.instancesAround(state.to, options.bodySize);
}

/// Takes over the walls and marks the emitters that what changed may concern.
void AcousticEngine::Impl::follow(const AcousticState& state, const RayView& rays) {
    const WorldGeometry::Changes& changes = geometry.follow(state.walls, rays);
    std::span<const AcousticBox> boxes(changes.boxes);
    AcousticBox all;
    if (boxes.size() > kManyChanges) {
        for (const AcousticBox& box : boxes) all.extend(box);
        boxes = {&all, 1};
    }
    for (auto& [id, emitter] : states) {
        bool inBody = changes.everything;
        emitter.stale = emitter.stale || changes.everything;
        for (const AcousticBox& box : boxes) {
            emitter.stale =
                emitter.stale || mayReach(emitter.reached, emitter.tracedSource, emitter.tracedListener, longest, box);
            // Written so that a box which is no number is near.
            inBody = inBody || !(box.distance(emitter.to) > 1.01 * options.bodySize);
        }
        if (inBody && !emitter.gone) findBody(emitter);
    }
}

/// Where the emitters are on their way to; those that are no longer there begin to fade.
void AcousticEngine::Impl::followEmitters(const SoundVersion& sounds, double seconds) {
    for (auto& [id, state] : states) {
        if (state.gone) continue;
        const SoundEmitter* emitter = sounds.find(id);
        if (!emitter) {
            state.gone = true;
            state.fading = static_cast<std::size_t>(state.level.delay) + state.responseFrames + options.blockSize;
            continue;
        }
        state.from = state.to;
        state.to = emitter->position();
        if (state.from != state.to) findBody(state);
        // Faster than sound is not moving but being put somewhere else.
        if (glm::distance(state.from, state.to) > options.trace.air.speedOfSound * std::max(1e-3, seconds))
            state.from = state.to;
    }
}

Result<EmitterState*> AcousticEngine::Impl::stateOf(const SoundEmitter& emitter) {
    const auto found = states.find(emitter.id);
    if (found != states.end()) return &found->second;
    EmitterState& state = states.try_emplace(emitter.id, options.blockSize, channels).first->second;
    if (freeSources.empty()) {
        if (mixer)
            if (auto added = mixer->addSource(); !added) return std::unexpected(added.error());
        freeSources.push_back(blocks.size());
        blocks.emplace_back(options.blockSize);
    }
    state.mixerSource = freeSources.back();
    freeSources.pop_back();
    state.from = state.to = emitter.position();
    findBody(state);
    return &state;
}

Result<> AcousticEngine::render(const AcousticState& state, const RayView& rays, double untilSeconds,
                                SoundBuffer& sound) {
    Impl& s = *impl_;
    if (sound.samples.empty()) {
        sound.sampleRate = s.options.sampleRate;
        sound.channels = channels();
    }
    if (sound.sampleRate != s.options.sampleRate || sound.channels != channels())
        return fail("the sound rendered into has another format");
    const double rate = s.options.sampleRate, span = untilSeconds - s.renderedUntil;
    s.now = state.sounds.listener;
    if (!s.posed) {
        s.before = s.now;
        s.posed = true;
        s.toSkip = s.channels * s.latency();
    }
    s.follow(state, rays);
    s.followEmitters(state.sounds, span);
    const std::size_t wanted =
        s.channels *
        static_cast<std::size_t>(std::max(0.0, std::round(untilSeconds * rate) - std::round(s.renderedUntil * rate)));
    while (s.ready.size() < wanted) {
        const double end = static_cast<double>(s.samples + static_cast<std::int64_t>(s.options.blockSize)) / rate;
        const double alpha = span > 0 ? std::clamp((end - s.renderedUntil) / span, 0.0, 1.0) : 1;
        if (auto done = s.block(state.sounds, alpha, mixedPose(s.before, s.now, alpha)); !done) return done;
    }
    sound.samples.insert(sound.samples.end(), s.ready.begin(), s.ready.begin() + static_cast<std::ptrdiff_t>(wanted));
    s.ready.erase(s.ready.begin(), s.ready.begin() + static_cast<std::ptrdiff_t>(wanted));
    s.before = s.now;
    s.renderedUntil = std::max(s.renderedUntil, untilSeconds);
    return {};
}

}  // namespace rtsg
