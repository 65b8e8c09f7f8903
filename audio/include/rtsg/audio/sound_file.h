// Sound in memory and in files.
//
// Reading takes what libsndfile does (WAV, AIFF, FLAC, Ogg Vorbis, ...). Writing is WAV; the same samples always give
// the same bytes (no time stamps). Full scale is 1; PCM formats refuse samples beyond it rather than clip them: see
// normalise(). Threading: pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct SoundBuffer {
    int sampleRate = 48000;
    int channels = 1;
    std::vector<float> samples;  // interleaved

    std::size_t frames() const { return channels > 0 ? samples.size() / static_cast<std::size_t>(channels) : 0; }
    double seconds() const { return static_cast<double>(frames()) / sampleRate; }
    float peak() const;
};

/// At most `maxSeconds` are read, so that no file can fill the memory.
Result<SoundBuffer> readSound(const std::string& path, double maxSeconds = 3600);

enum class WavFormat : std::uint8_t { pcm16, pcm24, float32 };
Result<> writeWav(const std::string& path, const SoundBuffer& sound, WavFormat format = WavFormat::pcm24);

/// The mean of all channels.
SoundBuffer mixToMono(const SoundBuffer& sound);
/// Band-limited conversion.
Result<SoundBuffer> resample(const SoundBuffer& sound, int sampleRate);
/// Scales down, never up, so that no sample exceeds `limit`; returns the factor used (1: nothing done).
float normalise(SoundBuffer& sound, float limit = 0.891251f /* -1 dB */);

/// Level of the difference relative to `reference`, dB: -inf when equal; above -20 dB one hears it. Errors: other
/// channels, rate or, by more than a thousandth, length (what is left over counts as difference).
Result<double> differenceDb(const SoundBuffer& reference, const SoundBuffer& other);

}  // namespace rtsg
