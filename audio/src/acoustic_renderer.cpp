#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <optional>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/audio/ambisonics.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/convolver.h>
#include <rtsg/audio/impulse_response.h>
#include <rtsg/audio/loopback.h>

#include "delay_line.h"

namespace rtsg {
namespace {

/// Nothing is heard from farther away; metres.
constexpr double kHorizon = 20'000;

/// Positions over time, one a block, for looking up where a source was when it sent what is heard now.
class Track {
  public:
    void add(const glm::dvec3& position) {
        positions_.push_back(position);
        if (positions_.size() > 8192) {
            positions_.pop_front();
            ++first_;
        }
    }
    /// `block` may lie between two.
    glm::dvec3 at(double block) const {
        const double newestIndex = static_cast<double>(positions_.size() - 1);
        // Written so that what is no number gives the oldest.
        const double wanted = block - static_cast<double>(first_);
        const double index = wanted > 0 ? std::min(wanted, newestIndex) : 0;
        const auto low = static_cast<std::size_t>(index);
        const std::size_t high = std::min(low + 1, positions_.size() - 1);
        return glm::mix(positions_[low], positions_[high], index - static_cast<double>(low));
    }
    double newest() const { return static_cast<double>(first_ + positions_.size() - 1); }

  private:
    std::deque<glm::dvec3> positions_;
    std::size_t first_ = 0;
};

struct EmitterState {
    EmitterState(std::size_t block, std::size_t channels) : gains(channels) {
        for (std::size_t c = 0; c < channels; ++c) late.emplace_back(block);
    }

    std::size_t mixerSource = 0;
    std::map<std::uint32_t, VoicePlayer> players;  // by voice node
    DelayLine line;
    Track track;
    std::vector<Convolver> late;      // by channel
    std::vector<double> gains;        // ambisonic, of direct sound at the end of the last block
    glm::dvec3 from{0}, to{0};        // this frame's way
    std::vector<std::uint32_t> body;  // slots of the shapes that it is in
    // At the end of the last block.
    double delay = 0, directGain = 0, lateGain = 0;
    bool started = false;
    // Of the response in use.
    bool hasResponse = false;
    double tracedAt = 0;
    glm::dvec3 tracedSource{0}, tracedListener{0}, tracedRight{0}, tracedBack{0};
    std::uint64_t tracedGeometry = 0;
    std::size_t responseFrames = 0;
    /// Gone from the scene; what it sent is still on its way for this many samples.
    bool gone = false;
    std::size_t fading = 0;
};

glm::dvec3 mixedAxis(const glm::dvec3& a, const glm::dvec3& b, double alpha) {
    const glm::dvec3 m = glm::mix(a, b, alpha);
    const double length = glm::length(m);
    return length > 1e-6 ? m / length : b;
}

}  // namespace

struct AcousticRenderer::Impl {
    Impl(const RayWorld& world, const Options& o, std::optional<LoopbackMixer> m)
        : options(o),
          channels(static_cast<std::size_t>(o.ambisonicOrder > 0 ? ambisonicChannels(o.ambisonicOrder) : 2)),
          geometry(world, {.defaultMaterial = o.defaultMaterial}),
          scene(&geometry, o.defaultMaterial),
          mixer(std::move(m)),
          clips(o.sampleRate, o.base),
          renderedUntil(o.startTime),
          samples(std::llround(o.startTime * o.sampleRate)),
          lateQueue(channels * latency()) {}

    std::size_t latency() const { return mixer ? mixer->latency() : 0; }

    Result<> block(double alpha, const ListenerPose& listener);
    void retrace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
                 const ListenerPose& listener);
    Result<EmitterState*> stateOf(const SoundEmitter& emitter);

    Options options;
    std::size_t channels;
    WorldGeometry geometry;
    SoundScene scene;
    std::optional<LoopbackMixer> mixer;  // none for ambisonics
    ClipLibrary clips;
    std::map<InstanceId, EmitterState> states;
    std::vector<std::size_t> freeSources;
    std::vector<std::vector<float>> blocks;  // by mixer source
    ListenerPose before, now;                // at the ends of the frame being rendered
    bool posed = false;
    double renderedUntil;
    std::int64_t samples;         // consumed from the voices
    std::deque<float> lateQueue;  // interleaved; delays reflections by the mixer's latency
    std::size_t toSkip = 0;       // of the mixer's latency, still to be dropped
    std::vector<float> ready;     // interleaved, rendered but not yet asked for
    std::uint64_t traces = 0;
};

AcousticRenderer::AcousticRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
AcousticRenderer::~AcousticRenderer() = default;

Result<std::unique_ptr<AcousticRenderer>> AcousticRenderer::create(const RayWorld& world, const Options& options) {
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
    auto impl = std::make_unique<Impl>(world, options, std::move(mixer));
    return std::unique_ptr<AcousticRenderer>(new AcousticRenderer(std::move(impl)));
}

Result<> AcousticRenderer::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    impl_->scene.apply(scene, changes, delta);
    impl_->geometry.apply(delta);
    return {};
}

int AcousticRenderer::channels() const {
    return static_cast<int>(impl_->channels);
}
const SoundScene& AcousticRenderer::scene() const {
    return impl_->scene;
}
OpenedGeometry AcousticRenderer::geometryFor(const glm::dvec3& source) {
    impl_->geometry.update();
    return {impl_->geometry, impl_->geometry.instancesAround(source, impl_->options.bodySize)};
}
std::uint64_t AcousticRenderer::traces() const {
    return impl_->traces;
}

Diagnostics AcousticRenderer::diagnostics() const {
    Diagnostics all;
    all.append(impl_->scene.diagnostics());
    all.append(impl_->clips.diagnostics());
    return all;
}

Result<EmitterState*> AcousticRenderer::Impl::stateOf(const SoundEmitter& emitter) {
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
    state.from = state.to = scene.position(emitter);
    state.body = geometry.instancesAround(state.to, options.bodySize);
    return &state;
}

void AcousticRenderer::Impl::retrace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
                                     const ListenerPose& listener) {
    const double time = static_cast<double>(samples) / options.sampleRate;
    if (state.hasResponse) {
        const bool moved = state.tracedGeometry != geometry.version() ||
                           glm::distance(state.tracedSource, source) > options.moveTolerance ||
                           glm::distance(state.tracedListener, listener.position) > options.moveTolerance ||
                           glm::dot(state.tracedRight, listener.right) < 0.998 ||  // 3.6 degrees
                           (!mixer && glm::dot(state.tracedBack, listener.back) < 0.998);
        if (!moved || time < state.tracedAt + options.retraceSeconds) return;
    }
    geometry.update();
    const OpenedGeometry room(geometry, state.body);
    const TraceResult traced = AcousticTracer(room).trace(source, listener.position, options.trace);
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
    state.tracedAt = time;
    state.tracedSource = source;
    state.tracedListener = listener.position;
    state.tracedRight = listener.right;
    state.tracedBack = listener.back;
    state.tracedGeometry = geometry.version();
    ++traces;
}

Result<> AcousticRenderer::Impl::block(double alpha, const ListenerPose& listener) {
    const std::size_t size = options.blockSize;
    const double rate = options.sampleRate, c = options.trace.air.speedOfSound;
    std::vector<float> dry(size), late(size);
    std::vector<std::vector<float>> out(channels, std::vector<float>(size));
    std::vector<double> gains(channels);
    for (auto& b : blocks) std::fill(b.begin(), b.end(), 0.0f);

    for (const SoundEmitter& emitter : scene.emitters()) {
        auto found = stateOf(emitter);
        if (!found) return std::unexpected(found.error());
        EmitterState& state = **found;
        const SoundNode& sound = scene.sound(emitter);
        const glm::dvec3 source = glm::mix(state.from, state.to, alpha);
        state.track.add(source);

        std::fill(dry.begin(), dry.end(), 0.0f);
        if (sound.enabled)
            for (const SoundVoice& voice : sound.voices)
                state.players[voice.node.value].play(voice, clips, samples, dry);

        // Where it was when it sent what arrives now; a few steps converge for anything slower than sound.
        glm::dvec3 apparent = source;
        for (int i = 0; i < 6; ++i) {
            const double delaySamples = glm::distance(apparent, listener.position) / c * rate;
            apparent = state.track.at(state.track.newest() - delaySamples / static_cast<double>(size));
        }
        double distance = glm::distance(apparent, listener.position);
        const bool audible = distance < kHorizon;
        if (!audible) distance = kHorizon;
        const double delay = distance / c * rate;
        const glm::dmat3 linear(emitter.worldFromLocal[0], emitter.worldFromLocal[1], emitter.worldFromLocal[2]);
        // The listener in the node's frame as if the node were where it was heard; singular transforms: as it is.
        const glm::dvec3 offset = listener.position - apparent;
        const glm::dvec3 local =
            sound.location + (std::abs(glm::determinant(linear)) > 1e-12 ? glm::inverse(linear) * offset : offset);
        const double level =
            !audible ? 0
                     : sound.intensity * listener.gain *
                           (options.levels == Levels::x3d ? sound.level(local) : 1 / std::max(distance, 0.1));
        double open = 0;
        if (level != 0) {
            const Bands share = directShare(OpenedGeometry(geometry, state.body), apparent, listener.position);
            for (std::size_t b = 2; b < 7; ++b) open += share[b] / 5;
            const Bands air = airAttenuation(options.trace.air);
            open *= std::exp(-air[4] * distance);
        }
        const double directGain = level * sound.coneGain(local) * std::sqrt(open);
        // In a response direct sound is 1 / d: times d, reflections keep their ratio to it.
        const double lateGain = level * std::max(distance, 0.1);
        if (!state.started) {
            state.delay = delay;
            state.directGain = directGain;
            state.lateGain = lateGain;
            state.started = true;
        }

        const std::size_t first = state.line.written();
        state.line.write(dry, static_cast<std::size_t>(std::max(delay, state.delay)) + 2);
        std::vector<float>& direct = blocks[state.mixerSource];
        const bool glide = sound.doppler || std::abs(delay - state.delay) < 0.5;
        for (std::size_t i = 0; i < size; ++i) {
            const double w = static_cast<double>(i + 1) / static_cast<double>(size);
            const double gain = state.directGain + (directGain - state.directGain) * w;
            double value;
            if (glide) {
                const double d = delay == state.delay ? delay : state.delay + (delay - state.delay) * w;
                value = static_cast<double>(state.line.read(first + i, d));
            } else {  // no change of pitch wanted: from one delay to the other by crossfading
                value = static_cast<double>(state.line.read(first + i, state.delay)) * (1 - w) +
                        static_cast<double>(state.line.read(first + i, delay)) * w;
            }
            direct[i] = static_cast<float>(value * gain);
            late[i] = dry[i] * static_cast<float>(state.lateGain + (lateGain - state.lateGain) * w);
        }
        const glm::dvec3 towards = sound.spatialize && distance > 1e-6
                                       ? listener.toLocal(apparent - listener.position) / distance
                                       : glm::dvec3(0);
        if (mixer) {
            mixer->setDirection(state.mixerSource, glm::vec3(towards));
        } else {
            if (towards == glm::dvec3(0)) {
                std::fill(gains.begin(), gains.end(), 0.0);
                gains[0] = 1;
            } else {
                ambisonicGains(options.ambisonicOrder, ambisonicAxes(towards), gains);
            }
            if (first == 0) state.gains = gains;
            for (std::size_t ch = 0; ch < channels; ++ch)
                for (std::size_t i = 0; i < size; ++i)
                    out[ch][i] += direct[i] * static_cast<float>(state.gains[ch] + (gains[ch] - state.gains[ch]) *
                                                                                       static_cast<double>(i + 1) /
                                                                                       static_cast<double>(size));
            state.gains = gains;
        }
        if (options.reflections) {
            if (level != 0) retrace(state, emitter, source, listener);
            for (std::size_t ch = 0; ch < channels; ++ch) state.late[ch].process(late, out[ch]);
        }
        state.delay = delay;
        state.directGain = directGain;
        state.lateGain = lateGain;
    }

    // Those that are gone fall silent when their last reflections have.
    std::fill(dry.begin(), dry.end(), 0.0f);
    for (auto it = states.begin(); it != states.end();) {
        EmitterState& state = it->second;
        if (!state.gone) {
            ++it;
            continue;
        }
        const std::size_t first = state.line.written();
        state.line.write(dry, static_cast<std::size_t>(state.delay) + 2);
        for (std::size_t i = 0; i < size; ++i) {
            const float sample = state.line.read(first + i, state.delay) * static_cast<float>(state.directGain);
            blocks[state.mixerSource][i] = sample;
            if (!mixer)
                for (std::size_t ch = 0; ch < channels; ++ch)
                    out[ch][i] += sample * static_cast<float>(state.gains[ch]);
        }
        if (options.reflections)
            for (std::size_t ch = 0; ch < channels; ++ch) state.late[ch].process(dry, out[ch]);
        state.fading -= std::min(state.fading, size);
        if (state.fading > 0) {
            ++it;
        } else {
            freeSources.push_back(state.mixerSource);
            it = states.erase(it);
        }
    }

    std::vector<float> mixed(channels * size);
    if (mixer) {
        std::vector<std::span<const float>> inputs(blocks.begin(), blocks.end());
        if (auto rendered = mixer->render(inputs, mixed); !rendered) return rendered;
    }
    for (std::size_t i = 0; i < size; ++i)
        for (std::size_t ch = 0; ch < channels; ++ch) {
            lateQueue.push_back(out[ch][i]);
            const float sample = mixed[channels * i + ch] + lateQueue.front();
            lateQueue.pop_front();
            if (toSkip > 0) {
                --toSkip;
            } else {
                ready.push_back(sample);
            }
        }
    samples += static_cast<std::int64_t>(size);
    return {};
}

Result<> AcousticRenderer::render(double untilSeconds, SoundBuffer& sound) {
    Impl& s = *impl_;
    if (sound.samples.empty()) {
        sound.sampleRate = s.options.sampleRate;
        sound.channels = channels();
    }
    if (sound.sampleRate != s.options.sampleRate || sound.channels != channels())
        return fail("the sound rendered into has another format");
    const double rate = s.options.sampleRate;
    s.now = s.scene.listener();
    if (!s.posed) {
        s.before = s.now;
        s.posed = true;
        s.toSkip = s.channels * s.latency();
    }
    for (auto& [id, state] : s.states) {
        if (state.gone) continue;
        const auto& emitters = s.scene.emitters();
        const auto emitter =
            std::lower_bound(emitters.begin(), emitters.end(), id.slot,
                             [](const SoundEmitter& e, std::uint32_t slot) { return e.id.slot < slot; });
        if (emitter == emitters.end() || emitter->id != id) {
            state.gone = true;
            state.fading = static_cast<std::size_t>(state.delay) + state.responseFrames + s.options.blockSize;
            continue;
        }
        state.from = state.to;
        state.to = s.scene.position(*emitter);
        // Faster than sound is not moving but being put somewhere else.
        state.body = s.geometry.instancesAround(state.to, s.options.bodySize);
        if (glm::distance(state.from, state.to) >
            s.options.trace.air.speedOfSound * std::max(1e-3, untilSeconds - s.renderedUntil))
            state.from = state.to;
    }
    const std::size_t wanted =
        s.channels *
        static_cast<std::size_t>(std::max(0.0, std::round(untilSeconds * rate) - std::round(s.renderedUntil * rate)));
    const double span = untilSeconds - s.renderedUntil;
    while (s.ready.size() < wanted) {
        const double end = static_cast<double>(s.samples + static_cast<std::int64_t>(s.options.blockSize)) / rate;
        const double alpha = span > 0 ? std::clamp((end - s.renderedUntil) / span, 0.0, 1.0) : 1;
        ListenerPose listener = s.now;
        listener.position = glm::mix(s.before.position, s.now.position, alpha);
        listener.right = mixedAxis(s.before.right, s.now.right, alpha);
        listener.up = mixedAxis(s.before.up, s.now.up, alpha);
        listener.back = mixedAxis(s.before.back, s.now.back, alpha);
        if (auto done = s.block(alpha, listener); !done) return done;
    }
    sound.samples.insert(sound.samples.end(), s.ready.begin(), s.ready.begin() + static_cast<std::ptrdiff_t>(wanted));
    s.ready.erase(s.ready.begin(), s.ready.begin() + static_cast<std::ptrdiff_t>(wanted));
    s.before = s.now;
    s.renderedUntil = std::max(s.renderedUntil, untilSeconds);
    return {};
}

}  // namespace rtsg
