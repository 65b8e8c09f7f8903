// Octave bands and the absorption of air.
//
// Every quantity with a value per band is a Bands: ten doubles for the octaves from 31.5 Hz to 16 kHz.
// Source: ISO 266 nominal mid-frequencies; air absorption by ISO 9613-1:1993, equations (3) to (6), evaluated at the
// exact mid-frequencies 1000 * 10^(3k/10) Hz, as the tables of ISO 9613-2 are.
// Threading: pure functions.
#pragma once

#include <array>
#include <optional>

namespace rtsg {

constexpr int kBandCount = 10;
using Bands = std::array<double, kBandCount>;
/// Nominal mid-frequencies, Hz.
constexpr Bands kBandHz{31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000};
/// The index of the octave of 1 kHz; the octave of 1000 * 2^k Hz has index kBand1k + k.
constexpr int kBand1k = 5;

constexpr Bands allBands(double value) {
    Bands result{};
    result.fill(value);
    return result;
}

struct Air {
    double speedOfSound = 343;  // m/s
    bool absorbs = true;        // whether the air attenuates at all
    double celsius = 20;
    double relativeHumidity = 50;  // percent
    double pressureKpa = 101.325;

    friend bool operator==(const Air&, const Air&) = default;
};

/// Speed of sound in dry air, m/s.
double speedOfSound(double celsius);

/// Properties of the air that were set explicitly; those without a value stay as they are.
struct AirChoice {
    std::optional<bool> absorbs;
    std::optional<double> speedOfSound, celsius, relativeHumidity, pressureKpa;

    /// With a temperature but no speed of sound, the speed follows from the temperature.
    Air over(const Air& base) const;
    friend bool operator==(const AirChoice&, const AirChoice&) = default;
};

/// Pure-tone attenuation in dB per metre at `hz`.
double airAbsorptionDbPerMetre(const Air& air, double hz);
/// Energy attenuation m in 1/m per band; energy falls as exp(-m * metres). Zeros unless `air.absorbs`.
Bands airAttenuation(const Air& air);

}  // namespace rtsg
