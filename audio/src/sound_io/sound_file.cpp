// Reads sound files by libsndfile, MPEG audio by libmpg123; writes WAV.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>

#include <fmt/format.h>
#include <sndfile.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/core/output_file.h>
#include <rtsg/core/sandbox.h>

#include "mpeg_sound.h"
#include "sandbox_sounds.h"
#include "signal/sound_libraries.h"
#include "sound_bytes.h"
#include "sound_length.h"

namespace rtsg {
namespace {

struct Close {
    void operator()(SNDFILE* file) const { sf_close(file); }
};
using File = std::unique_ptr<SNDFILE, Close>;

SF_VIRTUAL_IO virtualFile() {
    SF_VIRTUAL_IO io{};
    io.get_filelen = [](void* data) -> sf_count_t { return static_cast<SoundBytes*>(data)->size; };
    io.tell = [](void* data) -> sf_count_t { return static_cast<SoundBytes*>(data)->at; };
    io.seek = [](sf_count_t offset, int whence, void* data) -> sf_count_t {
        return static_cast<SoundBytes*>(data)->seek(offset, whence);
    };
    io.read = [](void* to, sf_count_t count, void* data) -> sf_count_t {
        return static_cast<SoundBytes*>(data)->read(to, count);
    };
    io.write = [](const void*, sf_count_t, void*) { return sf_count_t{0}; };
    return io;
}

bool isOgg(const SF_INFO& info) {
    return (info.format & SF_FORMAT_TYPEMASK) == SF_FORMAT_OGG;
}

/// Whether the file's last page ends a stream and is whole (RFC 3533, 6). Some versions of libsndfile take the last
/// page that there is for the end.
bool endsAsOggDoes(const SoundBytes& bytes) {
    constexpr std::int64_t kLongestPage = 27 + 255 + 255 * 255;
    const std::string tail = bytes.part(std::max<std::int64_t>(bytes.size - kLongestPage, 0), kLongestPage);
    constexpr std::size_t kFlags = 5, kSegments = 26, kHead = 27;
    constexpr int kEnds = 4;
    const std::size_t page = tail.rfind("OggS");
    if (page == tail.npos || page + kHead > tail.size()) return false;
    const std::size_t lengths = page + kHead, data = lengths + static_cast<std::uint8_t>(tail[page + kSegments]);
    if (data > tail.size()) return false;
    std::size_t end = data;
    for (std::size_t i = lengths; i < data; ++i) end += static_cast<std::uint8_t>(tail[i]);
    return (tail[page + kFlags] & kEnds) != 0 && end <= tail.size();
}

/// The damage at which libsndfile gave up, or which it left out, in a sound that it has read.
std::string damageOf(SNDFILE* file, const SF_INFO& info, const SoundBytes& bytes, const SoundBuffer& sound) {
    if (isOgg(info) && !endsAsOggDoes(bytes))
        return fmt::format("it ends after {:.3g} s, before the page that ends an Ogg stream", sound.seconds());
    if (info.frames < 0 || info.frames == SF_COUNT_MAX) return {};
    const double promised = static_cast<double>(info.frames) * promisedFraction(bytes);
    std::string missing = missingSound(promised, sound);
    if (missing.empty() && sf_error(file) != SF_ERR_NO_ERROR) missing = unreadableFrom(sound);
    return missing;
}

constexpr std::uint64_t kMaxSamples = std::uint64_t{1} << 29;

}  // namespace

Result<SoundBuffer> readSoundHere(SoundBytes bytes, std::uint64_t maxSamples, std::string& damage) {
    if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
    if (isMpegSound(bytes)) return readMpegSound(std::move(bytes), maxSamples, damage);
    SF_INFO info{};
    SF_VIRTUAL_IO io = virtualFile();
    const File opened(sf_open_virtual(&io, SFM_READ, &info, &bytes));
    SNDFILE* file = opened.get();
    if (!file) return fail(fmt::format("cannot read sound: {}", sf_strerror(nullptr)));
    if (info.channels < 1 || info.channels > 64 || info.samplerate < 1 || info.samplerate > 1'000'000)
        return fail(fmt::format("sound has {} channels at {} Hz", info.channels, info.samplerate));
    SoundBuffer sound;
    sound.sampleRate = info.samplerate;
    sound.channels = info.channels;
    // In pieces: the header's length may be a lie.
    constexpr sf_count_t kPiece = 1 << 16;
    for (;;) {
        const std::size_t at = sound.samples.size();
        if (auto ok = makeRoom(sound, static_cast<std::size_t>(kPiece * info.channels)); !ok)
            return std::unexpected(ok.error());
        const sf_count_t got = std::max<sf_count_t>(0, sf_readf_float(file, sound.samples.data() + at, kPiece));
        sound.samples.resize(at + static_cast<std::size_t>(got * info.channels));
        if (sound.samples.size() > maxSamples) return tooManySamples(maxSamples);
        if (got < kPiece) break;
    }
    for (float& sample : sound.samples)
        if (!std::isfinite(sample)) sample = 0;
    damage = damageOf(file, info, bytes, sound);
    return sound;
}

float SoundBuffer::peak() const {
    float result = 0;
    for (const float sample : samples) result = std::max(result, std::abs(sample));
    return result;
}

Result<SoundBuffer> readSound(const std::string& path, std::uint64_t maxSamples, std::string* damage) {
    std::ifstream file(path, std::ios::binary);
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (!file || error)
        return fail(fmt::format("cannot read sound: {}", error ? error.message() : std::strerror(errno)), {}, path);
    SoundBytes bytes;
    bytes.size = static_cast<std::int64_t>(size);
    bytes.readAt = [&](std::uint64_t offset, std::span<char> to) {
        file.clear();
        file.seekg(static_cast<std::streamoff>(offset)).read(to.data(), static_cast<std::streamsize>(to.size()));
        return static_cast<std::size_t>(file.gcount());
    };
    std::string found;
    auto sound = isSandboxed() ? readSoundSandboxed(bytes, {}, maxSamples, damage ? *damage : found)
                               : readSoundHere(std::move(bytes), maxSamples, damage ? *damage : found);
    if (!sound) sound.error().file = path;
    return sound;
}

Result<SoundBuffer> readSoundBytes(std::string_view bytes, std::uint64_t maxSamples, std::string* damage) {
    std::string found;
    SoundBytes source = SoundBytes::of(bytes);
    if (isSandboxed()) return readSoundSandboxed(source, bytes, maxSamples, damage ? *damage : found);
    return readSoundHere(std::move(source), maxSamples, damage ? *damage : found);
}

Result<> checkSound(const Resource& file) {
    return isSandboxed() ? checkSoundSandboxed(SoundBytes::of(file)) : checkSoundHere(SoundBytes::of(file));
}

Result<double> soundSeconds(const Resource& file) {
    return isSandboxed() ? soundSecondsSandboxed(SoundBytes::of(file)) : soundSecondsHere(SoundBytes::of(file));
}

Result<> checkSoundHere(SoundBytes source) {
    if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
    if (isMpegSound(source)) return {};
    SF_INFO info{};
    SF_VIRTUAL_IO io = virtualFile();
    const File opened(sf_open_virtual(&io, SFM_READ, &info, &source));
    if (!opened) return fail(fmt::format("cannot read sound: {}", sf_strerror(nullptr)));
    return {};
}

Result<double> soundSecondsHere(SoundBytes source) {
    if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
    if (isMpegSound(source)) return mpegSoundSeconds(std::move(source));
    const SoundBytes whole = source;
    SF_INFO info{};
    SF_VIRTUAL_IO io = virtualFile();
    const File file(sf_open_virtual(&io, SFM_READ, &info, &source));
    if (!file) return fail(fmt::format("cannot read sound: {}", sf_strerror(nullptr)));
    // An Ogg stream says at its end how long it is.
    std::string damage;
    if (isOgg(info) && info.frames == SF_COUNT_MAX) {
        const auto sound = readSoundHere(whole, kMaxSamples, damage);
        return sound ? Result<double>(sound->seconds()) : std::unexpected(sound.error());
    }
    if (info.samplerate < 1 || info.frames < 0 || info.frames == SF_COUNT_MAX)
        return fail("the header does not say how long the sound is");
    return static_cast<double>(info.frames) / info.samplerate;
}

Result<> checkSoundName(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    for (char& c : extension)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (extension == ".wav") return {};
    return fail("no kind of sound that can be written has such a name; there is: .wav", {}, path);
}

Result<> writeWav(const std::string& path, const SoundBuffer& sound, WavFormat format) {
    return writeWavWithComment(path, sound, format, {});
}

Result<std::string> readSoundComment(const std::string& path) {
    if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
    SF_INFO info{};
    const File file(sf_open(path.c_str(), SFM_READ, &info));
    if (!file) return fail(fmt::format("cannot read sound: {}", sf_strerror(nullptr)), {}, path);
    const char* const comment = sf_get_string(file.get(), SF_STR_COMMENT);
    return std::string(comment ? comment : "");
}

Result<> writeWavWithComment(const std::string& path, const SoundBuffer& sound, WavFormat format,
                             const std::string& comment) {
    if (auto ok = checkSoundName(path); !ok) return ok;
    if (sound.channels < 1 || sound.sampleRate < 1) return fail("a sound without channels or rate", {}, path);
    const float peak = sound.peak();
    for (const float sample : sound.samples)
        if (!std::isfinite(sample)) return fail("the sound holds values that are no numbers", {}, path);
    if (format != WavFormat::float32 && peak > 1)
        return fail(fmt::format("the sound's peak of {:.3f} is beyond full scale", peak), {}, path);
    SF_INFO info{};
    info.channels = sound.channels;
    info.samplerate = sound.sampleRate;
    info.format = SF_FORMAT_WAV | (format == WavFormat::pcm16   ? SF_FORMAT_PCM_16
                                   : format == WavFormat::pcm24 ? SF_FORMAT_PCM_24
                                                                : SF_FORMAT_FLOAT);
    if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
    auto out = OutputFile::create(path);
    if (!out) return std::unexpected(out.error());
    File file(sf_open_fd(out->descriptor(), SFM_WRITE, &info, SF_FALSE));
    if (!file) return fail(fmt::format("cannot write sound: {}", sf_strerror(nullptr)), {}, path);
    // The PEAK chunk holds the time of writing.
    sf_command(file.get(), SFC_SET_ADD_PEAK_CHUNK, nullptr, SF_FALSE);
    if (!comment.empty() && sf_set_string(file.get(), SF_STR_COMMENT, comment.c_str()) != 0)
        return fail("the comment cannot be written", {}, path);
    const auto frames = static_cast<sf_count_t>(sound.frames());
    if (sf_writef_float(file.get(), sound.samples.data(), frames) != frames)
        return fail(fmt::format("cannot write sound: {}", sf_strerror(file.get())), {}, path);
    if (sf_close(file.release()) != 0) return fail("cannot write sound", {}, path);
    return out->commit();
}

SoundBuffer spread(const SoundBuffer& sound, int channels) {
    if (sound.channels == channels) return sound;
    const auto own = static_cast<std::size_t>(sound.channels), all = static_cast<std::size_t>(channels);
    SoundBuffer wide{sound.sampleRate, channels, std::vector<float>(sound.frames() * all)};
    for (std::size_t i = 0; i < sound.frames(); ++i)
        for (std::size_t c = 0; c < all; ++c)
            if (own == 1 || c < own) wide.samples[i * all + c] = sound.samples[i * own + (own == 1 ? 0 : c)];
    return wide;
}

float normalise(SoundBuffer& sound, float limit) {
    const float peak = sound.peak();
    if (!(peak > limit)) return 1;
    const float factor = limit / peak;
    for (float& sample : sound.samples) sample = std::clamp(sample * factor, -limit, limit);
    return factor;
}

Result<double> differenceDb(const SoundBuffer& reference, const SoundBuffer& other) {
    if (reference.channels != other.channels || reference.sampleRate != other.sampleRate)
        return fail(fmt::format("{} channels at {} Hz and {} at {} Hz", reference.channels, reference.sampleRate,
                                other.channels, other.sampleRate));
    const double lengths[] = {reference.seconds(), other.seconds()};
    if (std::abs(lengths[0] - lengths[1]) > 1e-3 * std::max(lengths[0], lengths[1]))
        return fail(fmt::format("{:.4g} s and {:.4g} s long", lengths[0], lengths[1]));
    double signal = 0, difference = 0;
    for (std::size_t i = 0; i < std::max(reference.samples.size(), other.samples.size()); ++i) {
        const double a = i < reference.samples.size() ? reference.samples[i] : 0;
        const double b = i < other.samples.size() ? other.samples[i] : 0;
        signal += a * a;
        difference += (a - b) * (a - b);
    }
    return difference == 0 ? -std::numeric_limits<double>::infinity() : 10 * std::log10(difference / signal);
}

}  // namespace rtsg
