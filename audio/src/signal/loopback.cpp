// Drives OpenAL Soft without a device: a block in, a block out, levels and latency calibrated.
#include <algorithm>
#include <cmath>
#include <vector>

#include <rtsg/audio/loopback.h>

#include "openal_context.h"

namespace rtsg {

struct LoopbackMixer::Impl {
    struct Source {
        ALuint name = 0;
        std::vector<ALuint> free;  // buffers not queued
        std::vector<ALuint> buffers;
    };

    ~Impl() {
        if (context) {
            const BoundContext bound(context);
            for (const Source& source : sources) {
                alDeleteSources(1, &source.name);
                alDeleteBuffers(static_cast<ALsizei>(source.buffers.size()), source.buffers.data());
            }
        }
        if (context) alcDestroyContext(context);
        if (device) alcCloseDevice(device);
    }

    /// Queues a block; false if OpenAL would not.
    bool queue(Source& source, std::span<const float> block) {
        ALint processed = 0;
        alGetSourcei(source.name, AL_BUFFERS_PROCESSED, &processed);
        for (; processed > 0; --processed) {
            ALuint buffer = 0;
            alSourceUnqueueBuffers(source.name, 1, &buffer);
            source.free.push_back(buffer);
        }
        if (source.free.empty()) {
            ALuint buffer = 0;
            alGenBuffers(1, &buffer);
            source.free.push_back(buffer);
            source.buffers.push_back(buffer);
        }
        const ALuint buffer = source.free.back();
        source.free.pop_back();
        alBufferData(buffer, AL_FORMAT_MONO_FLOAT32, block.data(), static_cast<ALsizei>(block.size_bytes()),
                     options.sampleRate);
        alSourceQueueBuffers(source.name, 1, &buffer);
        return alGetError() == AL_NO_ERROR;
    }

    Options options;
    ALCdevice* device = nullptr;
    ALCcontext* context = nullptr;
    std::vector<Source> sources;
    float frontGain = 1, makeUp = 1;
    std::size_t latency = 0;
    bool binaural = false;
};

LoopbackMixer::LoopbackMixer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LoopbackMixer::~LoopbackMixer() = default;
LoopbackMixer::LoopbackMixer(LoopbackMixer&&) noexcept = default;
LoopbackMixer& LoopbackMixer::operator=(LoopbackMixer&&) noexcept = default;

Result<LoopbackMixer> LoopbackMixer::open(const Options& options) {
    const ShortPeriods periods;
    if (!alcIsExtensionPresent(nullptr, "ALC_SOFT_loopback") ||
        !alcIsExtensionPresent(nullptr, "ALC_EXT_thread_local_context"))
        return fail("this OpenAL has no loopback device: OpenAL Soft is needed");
    if (options.blockSize < 16 || options.blockSize > 65536) return fail("the block size must be 16 to 65536 samples");
    auto impl = std::make_unique<Impl>();
    impl->options = options;
    impl->device = alcLoopbackOpenDeviceSOFT(nullptr);
    if (!impl->device) return fail("cannot open OpenAL's loopback device");
    const ALCint attributes[] = {ALC_FORMAT_CHANNELS_SOFT,
                                 ALC_STEREO_SOFT,
                                 ALC_FORMAT_TYPE_SOFT,
                                 ALC_FLOAT_SOFT,
                                 ALC_FREQUENCY,
                                 options.sampleRate,
                                 ALC_HRTF_SOFT,
                                 options.binaural ? ALC_TRUE : ALC_FALSE,
                                 ALC_OUTPUT_LIMITER_SOFT,
                                 ALC_FALSE,
                                 ALC_MONO_SOURCES,
                                 1024,
                                 0};
    if (!alcIsRenderFormatSupportedSOFT(impl->device, options.sampleRate, ALC_STEREO_SOFT, ALC_FLOAT_SOFT))
        return fail("OpenAL cannot render stereo at " + std::to_string(options.sampleRate) + " Hz");
    impl->context = alcCreateContext(impl->device, attributes);
    if (!impl->context) return fail("cannot create an OpenAL context");
    ALCint hrtf = ALC_FALSE;
    alcGetIntegerv(impl->device, ALC_HRTF_SOFT, 1, &hrtf);
    impl->binaural = hrtf == ALC_TRUE;
    if (options.binaural && !impl->binaural)
        return fail("OpenAL has no head-related responses for " + std::to_string(options.sampleRate) + " Hz");
    {
        const BoundContext bound(impl->context);
        alDistanceModel(AL_NONE);
        alListenerf(AL_GAIN, 1);
    }
    impl->latency = options.blockSize;

    if (options.calibrate) {
        Options plain = options;
        plain.calibrate = false;
        auto probe = open(plain);
        if (!probe) return std::unexpected(probe.error());
        if (auto added = probe->addSource(); !added) return std::unexpected(added.error());
        probe->setDirection(0, {0, 0, -1});
        std::vector<float> block(options.blockSize), out(2 * options.blockSize);
        double energy = 0;
        float peak = 0;
        std::size_t peakAt = options.blockSize;
        // The impulse comes in the second block, when all gains have settled; responses are much shorter than 4096
        // samples.
        const std::size_t blocks = 4 + 4096 / options.blockSize;
        for (std::size_t k = 0; k < blocks; ++k) {
            std::fill(block.begin(), block.end(), 0.0f);
            if (k == 1) block[0] = 1;
            const std::span<const float> input(block);
            if (auto rendered = probe->render({&input, 1}, out); !rendered) return std::unexpected(rendered.error());
            for (std::size_t i = 0; i < options.blockSize; ++i) {
                energy += 0.5 * (static_cast<double>(out[2 * i]) * static_cast<double>(out[2 * i]) +
                                 static_cast<double>(out[2 * i + 1]) * static_cast<double>(out[2 * i + 1]));
                if (std::abs(out[2 * i]) > peak) {
                    peak = std::abs(out[2 * i]);
                    peakAt = k * options.blockSize + i;
                }
            }
        }
        if (!(energy > 1e-6)) return fail("OpenAL's loopback device renders silence");
        impl->frontGain = static_cast<float>(std::sqrt(energy));
        impl->makeUp = 1 / impl->frontGain;
        impl->latency = peakAt - options.blockSize;
    }
    return LoopbackMixer(std::move(impl));
}

Result<std::size_t> LoopbackMixer::addSource() {
    const BoundContext bound(impl_->context);
    alGetError();
    Impl::Source source;
    alGenSources(1, &source.name);
    if (alGetError() != AL_NO_ERROR) return fail("OpenAL has no more sources");
    alSourcei(source.name, AL_SOURCE_RELATIVE, AL_TRUE);
    alSourcef(source.name, AL_ROLLOFF_FACTOR, 0);
    alSource3f(source.name, AL_POSITION, 0, 0, -1);
    impl_->sources.push_back(std::move(source));
    return impl_->sources.size() - 1;
}

void LoopbackMixer::setDirection(std::size_t source, const glm::vec3& direction) {
    const BoundContext bound(impl_->context);
    const float length = glm::length(direction);
    const glm::vec3 unit = length > 1e-6f && std::isfinite(length) ? direction / length : glm::vec3(0);
    alSource3f(impl_->sources[source].name, AL_POSITION, unit.x, unit.y, unit.z);
}

Result<> LoopbackMixer::render(std::span<const std::span<const float>> blocks, std::span<float> stereo) {
    Impl& s = *impl_;
    if (blocks.size() != s.sources.size()) return fail("one block per source is needed");
    const BoundContext bound(s.context);
    alGetError();
    for (std::size_t i = 0; i < blocks.size(); ++i) {
        Impl::Source& source = s.sources[i];
        ALint state = 0;
        alGetSourcei(source.name, AL_SOURCE_STATE, &state);
        // A source always has one block more queued than is about to be rendered: one that runs dry stops, and would
        // start again with a click.
        if (state != AL_PLAYING) {
            const std::vector<float> silence(s.options.blockSize);
            if (!s.queue(source, silence)) return fail("OpenAL does not take a block");
        }
        if (!s.queue(source, blocks[i])) return fail("OpenAL does not take a block");
        if (state != AL_PLAYING) alSourcePlay(source.name);
    }
    alcRenderSamplesSOFT(s.device, stereo.data(), static_cast<ALCsizei>(s.options.blockSize));
    if (alGetError() != AL_NO_ERROR) return fail("OpenAL failed to render");
    for (float& sample : stereo) sample *= s.makeUp;
    return {};
}

std::size_t LoopbackMixer::latency() const {
    return impl_->latency;
}
float LoopbackMixer::frontGain() const {
    return impl_->frontGain;
}
bool LoopbackMixer::binaural() const {
    return impl_->binaural;
}
std::size_t LoopbackMixer::blockSize() const {
    return impl_->options.blockSize;
}

}  // namespace rtsg
