// Sound in memory and in files.
//
// Reading takes what libsndfile does (WAV, AIFF, FLAC, Ogg Vorbis, MP3, ...). Writing is WAV; the same samples always
// give the same bytes (no time stamps). Full scale is 1; PCM formats refuse samples beyond it rather than clip them:
// see normalise(). Threading: pure functions.
#pragma once

#include <cstdint>
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

/// Refuses what has more than `maxSamples`, all channels counted: a small packed file may hold hours of silence. Of
/// what is damaged or cut short it gives what can be read, and says in `damage`, else left empty, what is missing.
/// Samples that are damaged in a file whose format is whole are not noticed.
Result<SoundBuffer> readSound(const std::string& path, std::uint64_t maxSamples = std::uint64_t{1} << 29,
                              std::string* damage = nullptr);
/// The same as above for the content of a file.
Result<SoundBuffer> readSoundBytes(std::string_view bytes, std::uint64_t maxSamples = std::uint64_t{1} << 29,
                                   std::string* damage = nullptr);
/// Whether a file is of a format that these functions read, by its beginning; else why not.
Result<> checkSound(const Resource& file);
/// How long a file plays by its header, which may lie; in seconds. The sound itself is not read, but of an Ogg stream
/// that was cut short.
Result<double> soundSeconds(const Resource& file);

/// Whether a sound can be written under this name: fails, naming the kinds there are, unless it ends in .wav.
Result<> checkSoundName(const std::string& path);

enum class WavFormat : std::uint8_t { pcm16, pcm24, float32 };
Result<> writeWav(const std::string& path, const SoundBuffer& sound, WavFormat format = WavFormat::pcm24);

/// The mean of all channels.
SoundBuffer mixToMono(const SoundBuffer& sound);
/// In more channels, or as many: one goes to all of them, others stay where they are (ISO/IEC 19775-1 V4.0, 16.2).
SoundBuffer spread(const SoundBuffer& sound, int channels);
/// Band-limited conversion. Error: the rates are more than 256 times apart.
Result<SoundBuffer> resample(const SoundBuffer& sound, int sampleRate);
/// Scales down, never up, so that no sample exceeds `limit`; returns the factor used (1: nothing done).
float normalise(SoundBuffer& sound, float limit = 0.891251f /* -1 dB */);

/// Level of the difference relative to `reference`, dB: -inf when equal; above -20 dB one hears it. Errors: other
/// channels, rate or, by more than a thousandth, length (what is left over counts as difference).
Result<double> differenceDb(const SoundBuffer& reference, const SoundBuffer& other);

}  // namespace rtsg
