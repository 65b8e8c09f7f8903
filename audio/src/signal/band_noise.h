// BandNoise: Gaussian noise in octave bands: of one response, or computed once and shared by all that are heard, each
// of which begins at another position in it.
//
// Filtering noise for each response takes ten transforms of its length. The noise is periodic. The bands add up to
// noise whose energy in every millisecond is its number of samples. Threading: const once constructed; kept() on any
// number of threads.
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
    BandNoise(int sampleRate, std::size_t size, std::uint64_t seed);
    /// Noise of a seed, for so many channels of so many samples.
    static std::shared_ptr<const BandNoise> of(std::uint64_t seed, int sampleRate, std::size_t frames, int channels);
    /// The one that is shared; it goes round in no fewer samples than these.
    static std::shared_ptr<const BandNoise> kept(int sampleRate, std::size_t frames);

    /// Adds noise that has the energy of each bin, in each octave, times `factor`. Energy goes over from one bin to the
    /// next, and in low octaves is a mean over a period of their tones, as no filter of them changes faster. Unlike
    /// seeds and channels begin at unlike positions.
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
