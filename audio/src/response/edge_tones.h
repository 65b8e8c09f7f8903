// The frequencies that represent an octave when levels of diffracted sound are averaged, and the specular shares there.
//
// Threading: const.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

namespace rtsg {

/// Values by tone: `lowest` gives those in the lowest octave from wave numbers, 1/m, and `next` gives a value from that
/// of the tone an octave below.
template <class Value, class Lowest, class Next>
std::array<Value, kEdgeTones> byOctaves(double speedOfSound, const Lowest& lowest, const Next& next) {
    constexpr std::size_t kInOctave = kEdgeTones / kBandCount;
    std::array<Value, kEdgeTones> values;
    for (std::size_t t = 0; t < kInOctave; ++t)
        values[t] = lowest(2 * std::numbers::pi * edgeToneHz(static_cast<double>(t)) / speedOfSound);
    for (std::size_t t = kInOctave; t < kEdgeTones; ++t) values[t] = next(values[t - kInOctave]);
    return values;
}

/// exp(-i k metres) by tone. Each is the square of the one an octave below: rounding is less than 1e-12 of a turn.
inline std::array<std::complex<double>, kEdgeTones> turnedBy(double metres, double speedOfSound) {
    using Complex = std::complex<double>;
    return byOctaves<Complex>(
        speedOfSound, [&](double k) { return std::polar(1.0, -k * metres); },
        [](const Complex& z) {
            return Complex((z.real() - z.imag()) * (z.real() + z.imag()), 2 * z.real() * z.imag());
        });
}

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
