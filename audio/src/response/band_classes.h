// BandClasses: groups of octave bands that all walls treat alike, so that each group is computed once.
//
// Bands must be exactly equal, so nothing is lost. Air absorption depends on the distance only and is applied to each
// band afterwards. Threading: a plain value.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

namespace rtsg::trace {

struct BandClasses {
    std::array<std::size_t, kBandCount> of{};     // by band: its class
    std::array<std::size_t, kBandCount> first{};  // by class: its lowest band
    std::size_t count = 0;
};

/// Classes of bands by whether `same(a, b)` of two of them, which must be an equivalence; in the order of the bands.
template <class Same>
BandClasses bandClasses(const Same& same) {
    BandClasses classes;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        std::size_t c = 0;
        while (c < classes.count && !same(classes.first[c], b)) ++c;
        if (c == classes.count) classes.first[classes.count++] = b;
        classes.of[b] = c;
    }
    return classes;
}

inline BandClasses bandClasses(std::span<const AcousticMaterial> materials) {
    return bandClasses([&](std::size_t a, std::size_t b) {
        for (const AcousticMaterial& m : materials)
            if (m.absorption[a] != m.absorption[b] || m.scattering[a] != m.scattering[b] ||
                m.transmission[a] != m.transmission[b])
                return false;
        return true;
    });
}

/// By the content of each band in every arrival and every bin.
inline BandClasses bandClasses(std::span<const Arrival> arrivals, std::span<const EnergyHistogram> histograms) {
    return bandClasses([&](std::size_t a, std::size_t b) {
        for (const Arrival& arrival : arrivals)
            if (arrival.energy[a] != arrival.energy[b]) return false;
        for (const EnergyHistogram& histogram : histograms)
            for (const Bands& bin : histogram.bins)
                if (bin[a] != bin[b]) return false;
        return true;
    });
}

}  // namespace rtsg::trace
