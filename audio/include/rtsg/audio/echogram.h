// Echogram: the sound that a listener receives from one source, as energy over time in octave bands.
//
// Energy has the meaning of intensity: a source of unit power gives 1 / (4 pi d^2) per square metre at distance d in a
// free field. Time counts from emission. Discrete arrivals (image sources) are stored apart from the binned rest, so
// that exact times stay exact; no energy is in both. Diffracted sound is stored twice: as octave-band energies among
// the arrivals, and as complex pressures for making a pressure response.
// Threading: a plain value.
#pragma once

#include <algorithm>
#include <array>
#include <complex>
#include <cstdint>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/bands.h>

namespace rtsg {

struct Arrival {
    double seconds = 0;
    Bands energy{};
    glm::dvec3 direction{0};  // unit, world frame, from the listener to where the sound comes from
    std::uint32_t order = 0;  // reflections; 0 is direct sound
    /// For an image source: when the source moves by `way`, the image moves by turn * way. Otherwise 0.
    glm::mat3 rotation{0.0f};
    /// If edges change this arrival: the index in EdgeField::straight of its energy without edges. Otherwise -1.
    std::int32_t straight = -1;
};

/// The number of frequencies of an EdgeWave: five an octave, evenly spaced in octaves, from the lowest band's lowest
/// on.
constexpr std::size_t kEdgeTones = 5 * kBandCount;
/// Hz; a `tone` that is not an integer lies between two frequencies.
double edgeToneHz(double tone);

/// The pressure by tone, relative to that of the source at 1 m in a free field; time dependence exp(i w t).
using EdgeTonePressures = std::array<std::complex<float>, kEdgeTones>;

/// A path over points on edges. Each point moves along its edge when source or listener move.
struct EdgeRoute {
    glm::dvec3 first{0}, last{0};          // the points; the same for a path over one edge
    glm::dvec3 firstAxis{0}, lastAxis{0};  // unit; 0: the point does not move, like an end of an edge
    double over = 0;                       // m by which the path over a round body is longer than straight
};

/// An edge whose diffraction wedgeField() can compute for any positions of source and listener.
struct BendingEdge {
    /// Unit vectors square to the axis and to each other: in the first face away from the edge, and off this face into
    /// the air.
    glm::dvec3 face{0}, beside{0};
    double opening = 0;  // angle of the air from that face on, radians; 0: no such edge
    Bands mirrors{};     // reflected share of the pressure
};

/// A wave that arrives over one or two edges.
struct EdgeWave {
    double seconds = 0;
    glm::dvec3 direction{0};       // as in Arrival
    std::uint32_t order = 1;       // number of edges on the path
    EdgeTonePressures pressure{};  // phase relative to the delay
    EdgeRoute route;
    BendingEdge bends;  // if it arrives over one edge alone, at the point of the shortest path
};

/// The effect of edges on the pressure: diffracted waves. Direct and specular arrivals keep their pressure.
struct EdgeField {
    std::vector<EdgeWave> waves;
    std::vector<Bands> straight;  // energies without edges; 0 for arrivals that come over edges only
};

/// Bin k covers [k, k + 1) / binsPerSecond + start; the first bin also holds what arrives earlier.
struct EnergyHistogram {
    double binsPerSecond = 1000;
    std::vector<Bands> bins;
    /// Chosen so that the bins begin with the first arrival, which mostly is the onset of the response; less than a
    /// bin.
    double start = 0;
    /// The energy of each bin as a figure-of-eight microphone along TraceResult::across receives it: multiplied by the
    /// squared cosine between its direction and that axis. There may be fewer bins; empty unless requested.
    std::vector<Bands> lateral = {};

    double startOf(std::size_t bin) const { return start + static_cast<double>(bin) / binsPerSecond; }
    void add(double seconds, const Bands& energy) {
        const auto bin = static_cast<std::size_t>(std::max(0.0, (seconds - start) * binsPerSecond));
        if (bin >= bins.size()) bins.resize(bin + 1, Bands{});
        for (std::size_t b = 0; b < kBandCount; ++b) bins[bin][b] += energy[b];
    }
    /// Adds `factor` times another histogram with the same resolution and start.
    void accumulate(const EnergyHistogram& other, double factor = 1);
};

struct Echogram {
    std::vector<Arrival> arrivals;  // sorted by time
    EnergyHistogram late;
    EdgeField edges = {};

    /// The energy that counts in the pressure in addition to EdgeField::waves.
    const Bands& straightEnergy(const Arrival& arrival) const {
        return arrival.straight < 0 ? arrival.energy : edges.straight[static_cast<std::size_t>(arrival.straight)];
    }
    double duration() const;
    Bands total() const;
};

}  // namespace rtsg
