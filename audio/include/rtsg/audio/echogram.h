// Echogram: what a listener receives from one source, as energy over time in octave bands.
//
// Energy is intensity-like: a source of unit power gives 1 / (4 pi d^2) per square metre at distance d in free
// field. Time counts from emission. Discrete arrivals (image sources) are kept apart from the binned remainder, so that
// nothing is smeared that is known exactly; the two never overlap. What edges bend is there twice: as energies of
// octaves among the arrivals, and with its phases, for who makes pressure of it.
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
    glm::dvec3 direction{0};  // unit, world frame, from the listener towards where it comes from
    std::uint32_t order = 0;  // reflections; 0 is direct sound
    /// For a mirror image of the source: when the source moves by `way`, the image moves by turn * way. Else 0.
    glm::mat3 turn{0.0f};
    /// If edges change it: the index in EdgeField::straight of what it is without them. Else -1.
    std::int32_t straight = -1;
};

/// The tones of an EdgeWave: five an octave, evenly on the axis of octaves, from that band's lowest on.
constexpr std::size_t kEdgeTones = 5 * kBandCount;
/// Hz; `tone` may lie between two of them.
double edgeToneHz(double tone);

/// By tone: pressure re that of the source in the open at 1 m; time as exp(i w t).
using EdgeTonePressures = std::array<std::complex<float>, kEdgeTones>;

/// A way by places on edges, each of which moves along its edge where source and listener do.
struct EdgeRoute {
    glm::dvec3 first{0}, last{0};          // the places; of one edge both are the same
    glm::dvec3 firstAxis{0}, lastAxis{0};  // unit; 0: it stays where it is, as an edge's end does
    double over = 0;                       // m that it is longer than straight between them, over a round body
};

/// An edge of which wedgeField() knows what it bends, wherever source and listener are.
struct BendingEdge {
    /// Unit, square to the axis and to each other: in the first face away from the edge, and off it into the air.
    glm::dvec3 face{0}, beside{0};
    double opening = 0;  // radians of air from that face on; 0: there is none
    Bands mirrors{};     // share of the pressure
};

/// A wave that comes by way of one edge or two.
struct EdgeWave {
    double seconds = 0;
    glm::dvec3 direction{0};       // as of an arrival
    std::uint32_t order = 1;       // edges on its way
    EdgeTonePressures pressure{};  // its phase re that of the delay
    EdgeRoute route;
    BendingEdge bends;  // if it comes by one edge alone, at the place where that is shortest
};

/// All that edges do to the pressure: the waves, and nothing to what comes straight or mirrored.
struct EdgeField {
    std::vector<EdgeWave> waves;
    std::vector<Bands> straight;  // energies without edges; 0 of what comes by way of edges alone
};

/// Bin k covers [k, k + 1) / binsPerSecond + start; the first also what comes earlier.
struct EnergyHistogram {
    double binsPerSecond = 1000;
    std::vector<Bands> bins;
    /// Such that bins begin with the first arrival, which mostly is the onset of the response; less than a bin.
    double start = 0;
    /// The energy of each bin as a figure-of-eight microphone along TraceResult::across hears it: times the squared
    /// cosine of its direction to that axis. It may have fewer bins; it is empty unless asked for.
    std::vector<Bands> lateral = {};

    double startOf(std::size_t bin) const { return start + static_cast<double>(bin) / binsPerSecond; }
    void add(double seconds, const Bands& energy) {
        const auto bin = static_cast<std::size_t>(std::max(0.0, (seconds - start) * binsPerSecond));
        if (bin >= bins.size()) bins.resize(bin + 1, Bands{});
        for (std::size_t b = 0; b < kBandCount; ++b) bins[bin][b] += energy[b];
    }
    /// Adds `factor` times another histogram of the same resolution and start.
    void accumulate(const EnergyHistogram& other, double factor = 1);
};

struct Echogram {
    std::vector<Arrival> arrivals;  // sorted by time
    EnergyHistogram late;
    EdgeField edges = {};

    /// The energy that counts in the pressure beside that of EdgeField::waves.
    const Bands& straightEnergy(const Arrival& arrival) const {
        return arrival.straight < 0 ? arrival.energy : edges.straight[static_cast<std::size_t>(arrival.straight)];
    }
    double duration() const;
    Bands total() const;
};

}  // namespace rtsg
