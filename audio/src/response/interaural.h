// Interaural cross-correlation: how similar the sound at the two ears of a head is, in octaves.
//
// The coefficient is the largest magnitude of the normalised cross-correlation of both ears' pressures within a
// millisecond, from the onset to .08 s (early) and after that (late): ISO 3382-1:2009, B.1. The head faces the source.
// Sounds from different times or directions count as uncorrelated noise, as in all energy figures. So the result is the
// mean of the coefficient; a single measured response may have another value. Of the random part of a response, the
// energy and the lateral share are known. It is modelled as a part that is even over all directions, and a rest that
// comes from the middle or from both sides. Responses depend only on the angle to the axis of the ears: this is exact
// for a sphere; for measured heads the mean over four such directions is used.
// Threading: const members may be called from any number of threads.
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
    Value value, ci95;  // NaN if there is no energy; half widths as in MetricsEstimate
};

class EarCorrelation {
  public:
    /// Takes a twentieth of a second.
    explicit EarCorrelation(const Hrtf& head);

    /// `across`: TraceResult::across; `batches`: as in estimateMetrics().
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
    /// With added random energy, of which `lateral` is the lateral share.
    double coefficient(Function sum, double random, double lateral, std::size_t band) const;

    static constexpr std::size_t kRings = 121;  // directions by their angle to the axis of the ears, left to right
    int rate_;
    std::array<std::vector<double>, kBandCount> weights_;  // of energy in each octave, by frequency
    std::vector<Functions> rings_;
    Functions even_;  // of sound that is even over all directions
};

}  // namespace rtsg
