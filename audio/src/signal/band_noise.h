// BandNoise: Gaussian noise in octave bands, computed once and shared by all responses, each of which begins at another
// position in it.
//
// Filtering noise for each response would take ten transforms of its length, a channel. The noise is periodic. The
// bands add up to noise whose energy in every millisecond is its number of samples. Threading: const once constructed;
// kept() on any number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/audio/bands.h>

namespace rtsg {

/// Energy of octaves in steps of time.
struct EnergySteps {
    std::span<const Bands> bins;
    double start = 0, binsPerSecond = 1000;
};

class BandNoise {
  public:
    /// `size`: samples in which it goes round, whole milliseconds.
    BandNoise(int sampleRate, std::size_t size);
    /// One that goes round in no fewer samples than these.
    static std::shared_ptr<const BandNoise> kept(int sampleRate, std::size_t frames);

    /// Adds noise that has the energy of each bin, in each octave, times `factor`. Energy goes over from one bin to the
    /// next, and in low octaves is a mean over a period of their tones, as no filter of them changes faster. Noise of
    /// unlike seeds or channels is unlike.
    void add(const EnergySteps& late, double factor, std::uint64_t seed, std::size_t channel,
             std::span<float> samples) const;

  private:
    void addBand(const std::vector<float>& energy, const EnergySteps& late, std::size_t band, std::size_t offset,
                 std::span<float> samples) const;

    int rate_;
    std::size_t size_;
    std::array<std::vector<float>, kBandCount> bands_;
};

}  // namespace rtsg
