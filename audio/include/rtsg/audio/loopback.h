// LoopbackMixer: OpenAL Soft without a sound card: mono streams at directions in, stereo blocks out.
//
// What OpenAL does here is panning or HRTF and nothing else: distance, delay and Doppler are the caller's, so that
// light and sound share one geometry and the delay is exact. Levels are calibrated when opened: a source straight ahead
// has unit energy gain in each channel, in plain stereo (where OpenAL gives .596) as with HRTF; `latency` tells the
// delay, the peak of the frontal head response included. The same input gives the same output, bit for bit. Threading:
// one thread per object; the OpenAL context is bound to the calling thread only while a call lasts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include <glm/glm.hpp>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class LoopbackMixer {
  public:
    struct Options {
        int sampleRate = 48000;
        bool binaural = false;
        /// Directions change at block borders: small blocks make moving sources smooth.
        std::size_t blockSize = 256;
        bool calibrate = true;
    };

    static Result<LoopbackMixer> open(const Options& options);
    ~LoopbackMixer();
    LoopbackMixer(LoopbackMixer&&) noexcept;
    LoopbackMixer& operator=(LoopbackMixer&&) noexcept;

    /// Index of a new source.
    Result<std::size_t> addSource();
    /// In the listener's frame: x right, y up, z back. Needs no unit length; zero is everywhere (no panning).
    void setDirection(std::size_t source, const glm::vec3& direction);
    /// One block per source (blockSize samples each, by source index) to one block of 2 * blockSize interleaved
    /// samples.
    Result<> render(std::span<const std::span<const float>> blocks, std::span<float> stereo);

    /// Samples from input to output, peak to peak, for a source ahead.
    std::size_t latency() const;
    /// Of OpenAL itself, before the calibration: root of the energy a frontal unit impulse has in one channel.
    float frontGain() const;
    bool binaural() const;
    std::size_t blockSize() const;

  private:
    struct Impl;
    explicit LoopbackMixer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
