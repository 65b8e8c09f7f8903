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
#include <rtsg/audio/echogram.h>

namespace rtsg {

class EdgeTones {
  public:
    static constexpr int kTones = kEdgeTones / kBandCount;

    EdgeTones(const AcousticGeometry& geometry, double speedOfSound)
        : geometry_(geometry), speedOfSound_(speedOfSound) {}

    /// Calls with the number of each tone of a band, and its wave number, 1/m.
    template <class Call>
    void each(std::size_t band, const Call& call) const {
        for (std::size_t tone = band * kTones; tone < (band + 1) * kTones; ++tone)
            call(tone, 2 * std::numbers::pi * edgeToneHz(static_cast<double>(tone)) / speedOfSound_);
    }
    double speedOfSound() const { return speedOfSound_; }
    /// Share of the pressure.
    double mirrors(std::uint32_t material, std::size_t band) const {
        return std::sqrt(std::max(0.0, geometry_.materials()[material].mirrored(band)));
    }

  private:
    const AcousticGeometry& geometry_;
    double speedOfSound_;
};

}  // namespace rtsg
