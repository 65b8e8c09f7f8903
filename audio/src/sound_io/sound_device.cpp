// Streams blocks to OpenAL's output by a queue of buffers.
#include <algorithm>
#include <utility>
#include <vector>

#include "openal_context.h"
#include "sound_device.h"

namespace rtsg {

struct SoundDevice::Impl {
    ~Impl() {
        if (context) {
            {
                const BoundContext bound(context);
                alSourceStop(source);
                alDeleteSources(1, &source);
                alDeleteBuffers(static_cast<ALsizei>(buffers.size()), buffers.data());
            }
            alcDestroyContext(context);
        }
        if (device) alcCloseDevice(device);
    }

    /// Takes back the blocks that were played, and counts an underrun if these were all.
    void collect() {
        ALint processed = 0, state = AL_PLAYING;
        alGetSourcei(source, AL_SOURCE_STATE, &state);
        alGetSourcei(source, AL_BUFFERS_PROCESSED, &processed);
        for (; processed > 0; --processed) {
            ALuint buffer = 0;
            alSourceUnqueueBuffers(source, 1, &buffer);
            idle.push_back(buffer);
        }
        if (playing && state != AL_PLAYING) {
            ++underruns;
            playing = false;
            // Buffers that are queued in a stopped source count as played at once, so that it would never be full
            // again.
            alSourceRewind(source);
        }
    }

    Options options;
    std::string name;
    ALCdevice* device = nullptr;
    ALCcontext* context = nullptr;
    ALuint source = 0;
    std::vector<ALuint> buffers, idle;
    bool playing = false;
    std::uint64_t underruns = 0;
};

SoundDevice::SoundDevice(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SoundDevice::~SoundDevice() = default;
SoundDevice::SoundDevice(SoundDevice&&) noexcept = default;
SoundDevice& SoundDevice::operator=(SoundDevice&&) noexcept = default;

Result<SoundDevice> SoundDevice::open(const Options& options) {
    if (const auto loaded = delayed::openal.load(); !loaded) return std::unexpected(loaded.error());
    const ShortPeriods periods;
    if (!alcIsExtensionPresent(nullptr, "ALC_EXT_thread_local_context"))
        return fail("this OpenAL has no contexts of single threads: OpenAL Soft is needed");
    if (options.blockSize < 16 || options.blockSize > 65536 || options.blocks < 2)
        return fail("the block size must be 16 to 65536 samples, of two blocks at least");
    auto impl = std::make_unique<Impl>();
    impl->options = options;
    impl->device = alcOpenDevice(options.name.empty() ? nullptr : options.name.c_str());
    if (!impl->device)
        return fail(options.name.empty() ? "there is no sound device"
                                         : "there is no sound device '" + options.name + "'");
    const ALCint attributes[] = {ALC_FREQUENCY,
                                 options.sampleRate,
                                 ALC_REFRESH,
                                 static_cast<ALCint>(static_cast<std::size_t>(options.sampleRate) / options.blockSize),
                                 ALC_HRTF_SOFT,
                                 ALC_FALSE,
                                 0};
    impl->context = alcCreateContext(impl->device, attributes);
    if (!impl->context) return fail("the sound device cannot be used");
    if (const ALCchar* name = alcGetString(impl->device, ALC_DEVICE_SPECIFIER)) impl->name = name;
    const BoundContext bound(impl->context);
    if (!alIsExtensionPresent("AL_EXT_FLOAT32")) return fail("the sound device takes no floating-point samples");
    alGenSources(1, &impl->source);
    impl->buffers.resize(options.blocks);
    alGenBuffers(static_cast<ALsizei>(options.blocks), impl->buffers.data());
    impl->idle = impl->buffers;
    // Two channels for two loudspeakers, as they are.
    alSourcei(impl->source, AL_DIRECT_CHANNELS_SOFT, AL_TRUE);
    if (alGetError() != AL_NO_ERROR) return fail("the sound device refuses to stream");
    return SoundDevice(std::move(impl));
}

std::size_t SoundDevice::free() {
    const BoundContext bound(impl_->context);
    impl_->collect();
    return impl_->idle.size();
}

Result<> SoundDevice::write(std::span<const float> stereo) {
    Impl& s = *impl_;
    const BoundContext bound(s.context);
    alGetError();
    s.collect();
    if (s.idle.empty()) return fail("the sound device has no room for a block");
    const ALuint buffer = s.idle.back();
    s.idle.pop_back();
    alBufferData(buffer, AL_FORMAT_STEREO_FLOAT32, stereo.data(), static_cast<ALsizei>(stereo.size_bytes()),
                 s.options.sampleRate);
    alSourceQueueBuffers(s.source, 1, &buffer);
    // It starts when all blocks are full, so that it has enough from then on.
    if (!s.playing && s.idle.empty()) {
        alSourcePlay(s.source);
        s.playing = true;
    }
    if (alGetError() != AL_NO_ERROR) return fail("the sound device does not take a block");
    return {};
}

std::uint64_t SoundDevice::underruns() const {
    return impl_->underruns;
}
const std::string& SoundDevice::name() const {
    return impl_->name;
}

double SoundDevice::latencySeconds() const {
    const Impl& s = *impl_;
    ALint played = 0;  // of the queued blocks
    {
        const BoundContext bound(s.context);
        if (s.playing) alGetSourcei(s.source, AL_SAMPLE_OFFSET, &played);
    }
    const double queued = static_cast<double>((s.buffers.size() - s.idle.size()) * s.options.blockSize);
    const double waiting = std::max(0.0, queued - played) / s.options.sampleRate;
    if (!alcIsExtensionPresent(s.device, "ALC_SOFT_device_clock")) return waiting;
    ALCint64SOFT nanoseconds = 0;
    alcGetInteger64vSOFT(s.device, ALC_DEVICE_LATENCY_SOFT, 1, &nanoseconds);
    return waiting + 1e-9 * static_cast<double>(nanoseconds);
}

}  // namespace rtsg
