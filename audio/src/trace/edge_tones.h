// The tones that stand for an octave where the levels of what edges bend are averaged, and what walls mirror there.
//
// Threading: const.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

class EdgeTones {
  public:
    static constexpr int kTones = 5;

    EdgeTones(const AcousticGeometry& geometry, double speedOfSound)
        : geometry_(geometry), speedOfSound_(speedOfSound) {}

    /// Calls with the wave number, 1/m, of each tone of a band.
    template <class Call>
    void each(std::size_t band, const Call& call) const {
        for (int i = 0; i < kTones; ++i) {
            const double octave = (i + 0.5) / kTones - 0.5;
            const double hz = 1000 * std::pow(2.0, static_cast<double>(band) - kBand1k + octave);
            call(2 * std::numbers::pi * hz / speedOfSound_);
        }
    }
    /// Share of the pressure.
    double mirrors(std::uint32_t material, std::size_t band) const {
        return std::sqrt(std::max(0.0, geometry_.materials()[material].mirrored(band)));
    }

  private:
    const AcousticGeometry& geometry_;
    double speedOfSound_;
};

}  // namespace rtsg
