// BandFilters: octave bands as weights of the bins of a spectrum.
//
// The weights are of zero phase and add up to 1, so that what is alike in all bands passes unchanged. Threading: const
// once made.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include <rtsg/audio/bands.h>

namespace rtsg {

/// Amplitude weight of a band at `hz`.
double octaveWeight(int band, double hz);

class BandFilters {
  public:
    /// By band: which others it is filtered with, numbered from 0 on.
    using Classes = std::array<std::size_t, kBandCount>;

    BandFilters(std::size_t fftSize, int sampleRate, const Classes& classes);
    /// One that the calling thread keeps, as it keeps the last few.
    static std::shared_ptr<const BandFilters> kept(std::size_t fftSize, int sampleRate, const Classes& classes);
    /// Each band by itself.
    static Classes apart();

    /// By bin, of a class.
    const std::vector<float>& operator[](std::size_t c) const { return weights_[c]; }

  private:
    std::size_t size_;
    int rate_;
    Classes classes_;
    std::array<std::vector<float>, kBandCount> weights_;
};

}  // namespace rtsg
