// Interaural cross-correlation: how alike the two ears of a head hear a room, in octaves.
//
// The coefficient is the largest magnitude of the normalised cross-correlation of both ears' pressures within a
// millisecond, from the onset to .08 s (early) and from there on (late): ISO 3382-1:2009, B.1. The head faces the
// source. What comes at different times or from different directions counts as noise that has nothing in common, as in
// all figures of energies; so what is worked out is the coefficient's mean, which no single measured response has to
// have. Of the random part of a response the energy and its lateral share are known: it is spread evenly over all
// directions, and what that leaves comes from the middle or from both sides. A head hears alike what comes at the same
// angle to the axis of its ears (a sphere does; of measured ears the mean over four such directions counts).
// Threading: const members from any number of threads.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <rtsg/audio/echogram.h>
#include <rtsg/audio/hrtf.h>

namespace rtsg {

struct InterauralEstimate {
    struct Value {
        Bands early = allBands(0), late = allBands(0);
    };
    Value value, ci95;  // NaN where nothing comes; half widths as MetricsEstimate has them
};

class EarCorrelation {
  public:
    /// Takes a twentieth of a second.
    explicit EarCorrelation(const Hrtf& head);

    /// `across`: TraceResult::across; `batches` as estimateMetrics() has them.
    InterauralEstimate estimate(std::span<const Arrival> arrivals, std::span<const EnergyHistogram> batches,
                                const glm::dvec3& across) const;

  private:
    /// The cross-correlation of one octave by delay, and the energies of both ears.
    struct Function {
        std::vector<double> cross;
        double left = 0, right = 0;

        void add(const Function& other, double factor);
        double coefficient() const;
    };
    using Functions = std::array<Function, kBandCount>;

    Functions functionsFrom(const Hrtf& head, double across) const;
    Function exactOf(std::span<const Arrival> arrivals, double begin, double end, std::size_t band,
                     const glm::dvec3& across) const;
    /// With random energy, of which that share is lateral.
    double coefficient(Function sum, double random, double lateral, std::size_t band) const;

    static constexpr std::size_t kRings = 121;  // directions by their angle to the axis of the ears, left to right
    int rate_;
    std::array<std::vector<double>, kBandCount> weights_;  // of energy in each octave, by frequency
    std::vector<Functions> rings_;
    Functions even_;  // of what comes from all sides alike
};

}  // namespace rtsg
