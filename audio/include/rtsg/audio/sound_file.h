// Sound in memory and in files.
//
// Reads the formats of libsndfile (WAV, AIFF, FLAC, Ogg Vorbis, MP3, ...). Writes WAV; the same samples always give the
// same bytes (no time stamps). Full scale is 1. PCM formats refuse samples beyond full scale, see normalise().
// Threading: pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>

namespace rtsg {

struct SoundBuffer {
    int sampleRate = 48000;
    int channels = 1;
    std::vector<float> samples;  // interleaved

    std::size_t frames() const { return channels > 0 ? samples.size() / static_cast<std::size_t>(channels) : 0; }
    double seconds() const { return static_cast<double>(frames()) / sampleRate; }
    float peak() const;
};

/// Refuses files with more than `maxSamples`, all channels counted: a small packed file may hold hours of silence. From
/// a damaged or truncated file it returns the readable part and writes into `damage` (otherwise left empty) what is
/// missing. Damaged samples in a file of valid format are not detected.
Result<SoundBuffer> readSound(const std::string& path, std::uint64_t maxSamples = std::uint64_t{1} << 29,
                              std::string* damage = nullptr);
/// The same as above for the content of a file.
Result<SoundBuffer> readSoundBytes(std::string_view bytes, std::uint64_t maxSamples = std::uint64_t{1} << 29,
                                   std::string* damage = nullptr);
/// Whether the beginning of a file shows a format that these functions read; otherwise the error says why not.
Result<> checkSound(const Resource& file);
/// The length in seconds according to the header, which may be wrong. Only for truncated Ogg streams is the sound
/// itself read.
Result<double> soundSeconds(const Resource& file);
/// How long a sound or a film plays, for BuildOptions::mediaLength: seconds, from the file's header if possible. A
/// sound in a film container without pictures is decoded for it, up to `maximumSamples`. Nothing: the file is neither a
/// sound nor a film, or cannot be read.
std::optional<double> mediaSeconds(const Resource& file, std::uint64_t maximumSamples);

/// Whether a sound can be written under this name. Fails, and lists the possible formats, unless the name ends in .wav.
Result<> checkSoundName(const std::string& path);

enum class WavFormat : std::uint8_t { pcm16, pcm24, float32 };
Result<> writeWav(const std::string& path, const SoundBuffer& sound, WavFormat format = WavFormat::pcm24);
/// The same with a comment: a text beside the samples, such as what the sound was made of (RIFF, LIST INFO, ICMT).
Result<> writeWavWithComment(const std::string& path, const SoundBuffer& sound, WavFormat format,
                             const std::string& comment);
/// Empty if the file has none. Error: it cannot be read.
Result<std::string> readSoundComment(const std::string& path);

/// Converts to the same or a larger number of channels: mono goes to all of them, other channels keep their numbers
/// (ISO/IEC 19775-1 V4.0, 16.2).
SoundBuffer spread(const SoundBuffer& sound, int channels);
/// Scales down, never up, so that no sample exceeds `limit`; returns the factor used (1: unchanged).
float normalise(SoundBuffer& sound, float limit = 0.891251f /* -1 dB */);

/// Level of the difference relative to `reference`, dB: -inf if equal; above -20 dB it is audible. Errors: different
/// channels or rates, or lengths that differ by more than a thousandth (a longer end counts as difference).
Result<double> differenceDb(const SoundBuffer& reference, const SoundBuffer& other);

}  // namespace rtsg
