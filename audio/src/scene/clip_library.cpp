// Reads the sounds of clips once, and plays voices from them.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include <rtsg/audio/clip_library.h>
#include <rtsg/renderers/movie_sound.h>

#include "signal/fractional_delay.h"

namespace rtsg {

std::shared_ptr<const SoundBuffer> ClipLibrary::silence() {
    if (!silence_) silence_ = std::make_shared<const SoundBuffer>(SoundBuffer{sampleRate_, 1, {0}});
    return silence_;
}

namespace {

/// Samples of a clip for each that is heard without aliasing: work and reach grow with it.
constexpr double kFastest = 32;
/// It passes .92 of half the clip's rate, and errs by some millionths.
using ClipSinc = BasicSinc<48, 1024, 11>;

const ClipSinc& clipSinc() {
    static const ClipSinc sinc;
    return sinc;
}

/// The sum of weighted samples of one channel, `stride` apart.
float weightedSum(std::span<const float> weights, const float* samples, std::size_t stride) {
    std::array<float, 8> sums{};  // side by side
    std::size_t i = 0;
    for (; i + 8 <= weights.size(); i += 8)
        for (std::size_t k = 0; k < 8; ++k) sums[k] += weights[i + k] * samples[(i + k) * stride];
    for (; i < weights.size(); ++i) sums[i % 8] += weights[i] * samples[i * stride];
    return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}

/// Reads sound files by libsndfile; films, and files that libsndfile does not know, by FFmpeg. Ogg files may be either.
Result<SoundBuffer> readResource(Resource& file, std::uint64_t room, std::string& damage) {
    const bool film = isMovie(file) && file.readAt(0, 4) != "OggS";
    const Result<> own = film ? fail("it is a film") : checkSound(file);
    if (own) {
        const auto bytes = file.read();
        if (!bytes) return std::unexpected(bytes.error());
        return readSoundBytes(*bytes, room, &damage);
    }
    bool known = false;
    auto sound = movieSound(file, room, &known);
    if (sound) return SoundBuffer{sound->sampleRate, sound->channels, std::move(sound->samples)};
    return std::unexpected(known ? sound.error() : own.error());
}

}  // namespace

Result<SoundBuffer> ClipLibrary::read(const SoundVoice& voice, const std::string& url) {
    Result<Resource> resource = fail(fmt::format("'{}' has no folder to start from", urlForMessage(url)));
    for (std::size_t i = 0; i < voice.folders.size() && !resource; ++i) {
        auto one = resources_.open(voice.folders[i], url);
        if (one || i == 0) resource = std::move(one);
    }
    if (!resource) return std::unexpected(resource.error());
    const std::uint64_t room = resources_.policy().maximumSamples - samplesRead_;
    std::string damage;
    auto sound = readResource(*resource, room, damage);
    if (!sound) return fail(fmt::format("{}: {}", resource->name(), sound.error().text));
    samplesRead_ += sound->samples.size();
    if (sound->samples.empty()) return fail(fmt::format("{} is empty", resource->name()));
    if (!damage.empty())
        diagnostics_.warningAt(voice.location,
                               fmt::format("{}: {} is damaged or cut short: {}", voice.name, resource->name(), damage));
    return sound;
}

std::shared_ptr<const SoundBuffer> ClipLibrary::read(const SoundVoice& voice) {
    std::string reasons;
    for (const std::string& url : voice.urls) {
        auto sound = read(voice, url);
        if (sound) return std::make_shared<const SoundBuffer>(std::move(*sound));
        reasons += "; " + sound.error().text;
    }
    diagnostics_.warningAt(voice.location, fmt::format("{} is silent: no sound that can be read{}", voice.name,
                                                       voice.urls.empty() ? "; url is empty" : reasons));
    return nullptr;
}

const ClipLibrary::Given* ClipLibrary::given(const SoundVoice& voice) const {
    const bool microphone = voice.kind == SoundVoice::Kind::microphone;
    if (!microphone && voice.kind != SoundVoice::Kind::stream) return nullptr;
    const GivenSounds& sounds = microphone ? given_.microphones : given_.streams;
    for (const std::string& name : voice.urls)
        if (const auto found = sounds.find(name); found != sounds.end()) return &found->second;
    const auto any = sounds.find("");
    return any == sounds.end() ? nullptr : &any->second;
}

std::shared_ptr<SoundInput> ClipLibrary::inputOf(const SoundVoice& voice) const {
    const Given* one = given(voice);
    const auto* input = one ? std::get_if<std::shared_ptr<SoundInput>>(one) : nullptr;
    return input ? *input : nullptr;
}

/// Silence unless the user has given a sound: a scene opens no microphone by itself.
std::shared_ptr<const SoundBuffer> ClipLibrary::heardBy(const SoundVoice& voice) {
    const auto [at, fresh] = heard_.try_emplace({voice.kind, voice.urls});
    if (!fresh) return at->second;
    const Given* one = given(voice);
    const auto* buffer = one ? std::get_if<std::shared_ptr<const SoundBuffer>>(one) : nullptr;
    std::string why = fmt::format("nobody has said what microphone '{}' hears", voice.urls.front());
    if (buffer && *buffer) {
        if (!(*buffer)->samples.empty()) return at->second = *buffer;
        why = "it is empty";
    }
    diagnostics_.warningAt(voice.location, fmt::format("{} is silent: {}", voice.name, why));
    return at->second = silence();
}

void ClipLibrary::noteNoSound(const std::string& name) {
    if (noSounds_.insert(name).second)
        diagnostics_.warning({},
                             name + " is silent where it makes values that are no numbers, or too large for a sound");
}

std::shared_ptr<const SoundBuffer> ClipLibrary::get(const SoundVoice& voice) {
    if (voice.kind == SoundVoice::Kind::microphone || given(voice)) return heardBy(voice);
    if (voice.kind == SoundVoice::Kind::buffer) {
        SoundBuffer sound{std::clamp(static_cast<int>(voice.bufferRate), 1000, 1'000'000), voice.bufferChannels, {}};
        // The source has channel after channel, the result frame after frame. An incomplete last frame is dropped.
        const auto channels = static_cast<std::size_t>(sound.channels);
        const std::size_t frames = voice.buffer.size() / channels;
        sound.samples.reserve(frames * channels);
        std::size_t none = 0;
        for (std::size_t frame = 0; frame < frames; ++frame)
            for (std::size_t channel = 0; channel < channels; ++channel) {
                const float sample = voice.buffer[channel * frames + frame];
                none += std::isfinite(sample) ? 0 : 1;
                sound.samples.push_back(std::isfinite(sample) ? sample : 0);
            }
        if (none > 0)
            diagnostics_.warningAt(voice.location, fmt::format("{}: {} of the {} samples of its buffer are no finite "
                                                               "numbers: 0 counts",
                                                               voice.name, none, frames * channels));
        if (sound.samples.empty()) sound.samples.resize(static_cast<std::size_t>(sound.channels));
        return std::make_shared<const SoundBuffer>(std::move(sound));
    }
    const auto [at, fresh] = clips_.try_emplace(Key(voice.urls, voice.folders));
    if (fresh) {
        at->second = read(voice);
        if (!at->second) at->second = silence();
    }
    return at->second;
}

void VoicePlayer::load(const SoundVoice& voice, ClipLibrary& clips) {
    if (voice.kind == SoundVoice::Kind::oscillator) return;
    const std::pair format(voice.bufferRate, voice.bufferChannels);
    if ((clip_ || input_) && urls_ == voice.urls && folders_ == voice.folders &&
        buffer_.data() == voice.buffer.data() && format_ == format)
        return;
    given_ = clips.isGiven(voice);
    input_ = clips.inputOf(voice);
    clip_ = input_ ? nullptr : clips.get(voice);
    urls_ = voice.urls;
    folders_ = voice.folders;
    buffer_ = voice.buffer;
    format_ = format;
    seam_ = {};
}

std::size_t VoicePlayer::channels(const SoundVoice& voice, ClipLibrary& clips) {
    if (voice.kind == SoundVoice::Kind::oscillator) return 1;
    load(voice, clips);
    return input_ ? input_->channels() : static_cast<std::size_t>(clip_->channels);
}

/// Plays live input as it comes, from the start time on, and not while the voice is paused.
void VoicePlayer::playInput(const SoundVoice& voice, double rate, std::int64_t first,
                            std::span<std::vector<float>> out) const {
    const std::size_t frames = out[0].size();
    const auto active = [&](std::size_t i) {
        return voice.active((static_cast<double>(first) + static_cast<double>(i) + 0.5) / rate);
    };
    std::size_t from = 0;
    while (from < frames && !active(from)) ++from;
    if (from == frames) return;
    const std::span<const float> in = input_->block(first, frames, from);
    const std::size_t channels = in.size() / frames;
    const auto gain = static_cast<float>(voice.gain);
    for (std::size_t i = from; i < frames; ++i) {
        if (!active(i)) continue;
        for (std::size_t c = 0; c < out.size(); ++c)
            if (channels == 1 || c < channels) out[c][i] += gain * in[i * channels + (channels == 1 ? 0 : c)];
    }
}

/// The length of the part of the clip that is used, in samples.
double VoicePlayer::lengthOf(const SoundVoice& voice) const {
    return std::min(static_cast<double>(clip_->frames()),
                    std::max(1.0, std::round(voice.duration * clip_->sampleRate)));
}

VoicePlayer::Loop VoicePlayer::loopOf(const SoundVoice& voice) const {
    const double length = lengthOf(voice);
    // Seconds in single precision are whole samples where they nearly are.
    const auto sample = [&](double seconds) {
        const double at = seconds * clip_->sampleRate, whole = std::round(at);
        return std::abs(at - whole) < 1e-6 * (1 + whole) ? whole : at;
    };
    const Loop loop{sample(voice.loopStart), std::min(length, sample(voice.loopEnd))};
    const bool region = voice.loopEnd > voice.loopStart && voice.loopStart >= 0 && loop.begin < length;
    return region ? loop : Loop{0, length};
}

/// Which samples of the clip its value at the phase is made of, by the sinc. If more of them come than are heard,
/// frequencies above half the rate heard are left out: the sinc is wider by that factor.
void VoicePlayer::weigh(double faster) {
    const ClipSinc& sinc = clipSinc();
    constexpr int kTaps = 2 * ClipSinc::kHalf;
    const double whole = std::floor(phase_), fraction = phase_ - whole;
    first_ = static_cast<std::ptrdiff_t>(whole);
    if (faster > 1) {
        const double reach = ClipSinc::kHalf * faster, from = std::ceil(phase_ - reach);
        first_ = static_cast<std::ptrdiff_t>(from);
        weights_.clear();
        for (double at = from; at <= phase_ + reach; ++at) {
            const double x = (at - phase_) / faster, above = std::ceil(x);
            const int k = static_cast<int>(above) + ClipSinc::kHalf - 1;
            weights_.push_back(k >= 0 && k < kTaps ? sinc.tap(above - x, k) / static_cast<float>(faster) : 0);
        }
    } else if (fraction == 0) {
        weights_.assign(1, 1);
    } else {
        first_ -= ClipSinc::kHalf - 1;
        weights_.resize(kTaps);
        for (int k = 0; k < kTaps; ++k) weights_[static_cast<std::size_t>(k)] = sinc.tap(fraction, k);
    }
}

/// After the end of a loop comes its beginning, and before that its end; of a loop whose length is no whole number of
/// samples these lie between samples.
void VoicePlayer::unrollLoop(const Loop& loop, double length, double faster) {
    const ClipSinc& sinc = clipSinc();
    const auto reach = static_cast<std::size_t>(std::ceil(ClipSinc::kHalf * faster)) + 1;
    const double span = loop.end - loop.begin;
    const bool known = seam_.loop == loop && seam_.length == length && seam_.reach >= reach;
    if (span < 1 || known) return;
    const auto count = static_cast<std::size_t>(clip_->channels);
    seam_ = {loop, length, reach, {}, {}};
    const auto add = [&](std::vector<float>& to, double frame) {
        const double periods = std::floor((frame - loop.begin) / span), at = frame - periods * span;
        const double whole = std::floor(at), fraction = at - whole;
        const int half = fraction == 0 ? 0 : ClipSinc::kHalf;
        for (std::size_t c = 0; c < count; ++c) {
            float sample = 0;
            for (int k = half == 0 ? 0 : 1 - half; k <= half; ++k) {
                const double near = whole + k;
                if (near < 0 || near >= length) continue;
                const float weight = half == 0 ? 1 : sinc.tap(fraction, k + half - 1);
                sample += weight * clip_->samples[static_cast<std::size_t>(near) * count + c];
            }
            to.push_back(sample);
        }
    };
    for (std::size_t i = 0; i < reach; ++i) {
        add(seam_.after, std::ceil(loop.end) + static_cast<double>(i));
        add(seam_.before, std::ceil(loop.begin) - 1 - static_cast<double>(i));
    }
}

/// The sum of the weighted samples. A loop is left by its end when it was entered, and by its beginning when it has
/// been repeated.
float VoicePlayer::sampleAt(const Loop* loop, double length, std::size_t channel) const {
    const auto count = static_cast<std::size_t>(clip_->channels);
    const bool entered = loop && phase_ < loop->end && loop->end - loop->begin >= 1;
    const auto low = static_cast<std::ptrdiff_t>(entered && repeated_ ? std::ceil(loop->begin) : 0);
    const auto high = static_cast<std::ptrdiff_t>(entered ? std::ceil(loop->end) : length);
    const auto beyond = [&](const std::vector<float>& frames, std::ptrdiff_t frame) {
        const std::size_t at = static_cast<std::size_t>(frame) * count + channel;
        return at < frames.size() ? frames[at] : 0.0f;
    };
    const auto weights = [&](std::ptrdiff_t from, std::ptrdiff_t to) {
        return std::span(weights_).subspan(static_cast<std::size_t>(from - first_),
                                           static_cast<std::size_t>(to - from));
    };
    const std::ptrdiff_t end = first_ + std::ssize(weights_), from = std::clamp(low, first_, end),
                         to = std::clamp(high, from, end);
    float sample = 0;
    if (to > from)
        sample =
            weightedSum(weights(from, to), &clip_->samples[static_cast<std::size_t>(from) * count + channel], count);
    for (std::ptrdiff_t i = first_; entered && repeated_ && i < from; ++i)
        sample += weights_[static_cast<std::size_t>(i - first_)] * beyond(seam_.before, low - 1 - i);
    for (std::ptrdiff_t i = to; entered && i < end; ++i)
        sample += weights_[static_cast<std::size_t>(i - first_)] * beyond(seam_.after, i - high);
    return sample;
}

/// Whether there is something of the clip where it has got to: backwards it ends where it began, but for a loop, to
/// whose other end it comes then (Web Audio API, AudioBufferSourceNode's playback algorithm).
bool VoicePlayer::goOn(const Loop* loop, double step, double length) {
    const bool backwards = step < 0;
    if (backwards ? phase_ >= (loop ? loop->begin : 0) : phase_ < (loop ? loop->end : length)) return true;
    if (!loop || loop->end - loop->begin < 1) return false;
    const double span = loop->end - loop->begin;
    if (backwards)
        phase_ = loop->end - std::fmod(loop->begin - phase_, span);
    else
        phase_ = loop->begin + std::fmod(phase_ - loop->begin, span);
    if (phase_ >= loop->end) phase_ -= span;
    repeated_ = true;
    return true;
}

void VoicePlayer::play(const SoundVoice& voice, ClipLibrary& clips, std::int64_t first,
                       std::span<std::vector<float>> out) {
    const double rate = clips.sampleRate();
    const bool oscillator = voice.kind == SoundVoice::Kind::oscillator;
    load(voice, clips);
    if (input_ && !oscillator) return playInput(voice, rate, first, out);
    const double length = oscillator ? 0 : lengthOf(voice);
    const Loop loop = oscillator ? Loop{} : loopOf(voice);
    const Loop* const repeats = voice.loop ? &loop : nullptr;
    const std::size_t channels = oscillator ? 1 : static_cast<std::size_t>(clip_->channels);
    const double step = oscillator ? voice.frequency / rate : voice.pitch * clip_->sampleRate / rate;
    const double faster = std::clamp(std::abs(step), 1.0, kFastest);
    if (!oscillator && repeats) unrollLoop(loop, length, faster);
    // Below half the sample rate.
    const auto harmonics =
        static_cast<std::size_t>(std::min(1e6, step != 0 ? std::max(0.0, std::ceil(0.5 / std::abs(step)) - 1) : 1e6));
    for (std::size_t i = 0; i < out[0].size(); ++i) {
        // Half a sample of grace: a start between two samples must not be late by one through rounding.
        const double t = (static_cast<double>(first) + static_cast<double>(i) + 0.5) / rate;
        if (!voice.active(t)) {
            const bool over = t < voice.startTime || (voice.stopTime > voice.startTime && t >= voice.stopTime);
            if (over) playing_ = finished_ = false;  // else it is paused and keeps its place
            continue;
        }
        if (!playing_ && (!finished_ || start_ != voice.startTime)) {
            playing_ = true;
            finished_ = false;
            start_ = voice.startTime;
            repeated_ = false;
            // Started in the past: it is in the middle by now.
            const double since =
                std::round(static_cast<double>(first) + static_cast<double>(i) - (start_ + voice.pausedTotal) * rate);
            phase_ = given_ ? 0 : std::max(0.0, since) * step;
        }
        if (!playing_) continue;
        if (!std::isfinite(phase_)) phase_ = 0;
        if (!oscillator && !goOn(repeats, step, length)) {
            playing_ = false;
            finished_ = true;
            continue;
        }
        const auto gain = static_cast<float>(voice.gain);
        const double tone = !oscillator || harmonics == 0 ? 0
                            : voice.wave                  ? voice.wave->at(phase_, harmonics)
                                                          : std::sin(2 * std::numbers::pi * phase_);
        if (!oscillator) weigh(faster);
        for (std::size_t c = 0; c < out.size(); ++c) {
            if (oscillator)
                out[c][i] += static_cast<float>(voice.gain * tone);
            else if (channels == 1 || c < channels)
                out[c][i] += gain * sampleAt(repeats, length, channels == 1 ? 0 : c);
        }
        phase_ += step;
        if (oscillator) phase_ -= std::floor(phase_);
    }
}

}  // namespace rtsg
