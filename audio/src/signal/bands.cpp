// Computes how much of each octave band air absorbs (ISO 9613-1).
#include <rtsg/audio/bands.h>
#include <cmath>

namespace rtsg {

double speedOfSound(double celsius) {
    return 343.2 * std::sqrt((celsius + 273.15) / 293.15);
}

Air AirChoice::over(const Air& base) const {
    Air air = base;
    if (absorbs) air.absorbs = *absorbs;
    if (celsius) {
        air.celsius = *celsius;
        air.speedOfSound = rtsg::speedOfSound(*celsius);
    }
    if (relativeHumidity) air.relativeHumidity = *relativeHumidity;
    if (pressureKpa) air.pressureKpa = *pressureKpa;
    if (speedOfSound) air.speedOfSound = *speedOfSound;
    return air;
}

double airAbsorptionDbPerMetre(const Air& air, double hz) {
    const double kelvin = air.celsius + 273.15;
    const double relativeTemperature = kelvin / 293.15;
    const double relativePressure = air.pressureKpa / 101.325;
    const double saturation = std::pow(10.0, -6.8346 * std::pow(273.16 / kelvin, 1.261) + 4.6151);
    const double humidity = air.relativeHumidity * saturation / relativePressure;  // molar concentration, percent
    const double oxygen = relativePressure * (24 + 4.04e4 * humidity * (0.02 + humidity) / (0.391 + humidity));
    const double nitrogen = relativePressure / std::sqrt(relativeTemperature) *
                            (9 + 280 * humidity * std::exp(-4.170 * (1 / std::cbrt(relativeTemperature) - 1)));
    const double f2 = hz * hz;
    return 8.686 * f2 *
           (1.84e-11 / relativePressure * std::sqrt(relativeTemperature) +
            std::pow(relativeTemperature, -2.5) * (0.01275 * std::exp(-2239.1 / kelvin) / (oxygen + f2 / oxygen) +
                                                   0.1068 * std::exp(-3352.0 / kelvin) / (nitrogen + f2 / nitrogen)));
}

Bands airAttenuation(const Air& air) {
    Bands result{};
    if (!air.absorbs) return result;
    for (int b = 0; b < kBandCount; ++b) {
        const double hz = 1000 * std::pow(10.0, 0.3 * (b - kBand1k));
        result[static_cast<std::size_t>(b)] = airAbsorptionDbPerMetre(air, hz) * std::log(10.0) / 10;
    }
    return result;
}

}  // namespace rtsg
