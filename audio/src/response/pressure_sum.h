// Energies in octaves of a sum of pressures, with the interference of each pair.
//
// For each tone, which represents a fifth of an octave, the interference of two pressures with a path difference d is
// reduced by (1 + y + y y / 3) exp(-y), y = .0694 k d. For small differences this agrees with a flat band, sin(y) / y;
// beyond that it goes to zero without a change of sign, like a band with soft edges. Because it is an exponential times
// a polynomial, the sum over all pairs takes two passes over the pressures in order of path length. Source: Rybicki and
// Press, Physical Review Letters 74 (1995), 1060, on sums of exponentials. Threading: one thread an object.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include <rtsg/audio/echogram.h>

#include "edge_tones.h"

namespace rtsg {

class PressureSum {
  public:
    explicit PressureSum(double speedOfSound) : speedOfSound_(speedOfSound) {}

    /// `pressure`: of each tone re the phase of its way, m. The energies go to an arrival.
    template <class Pressure>
    void add(std::size_t arrival, double pathLength, const Pressure& pressure) {
        Node& node = nodes_.emplace_back();
        node.arrival = arrival;
        node.pathLength = pathLength;
        // Relative to the first path, so that phases are small numbers.
        const auto turned = turnedBy(pathLength - nodes_.front().pathLength, speedOfSound_);
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            const std::complex<double> value = std::complex<double>(pressure(t)) * turned[t];
            node.real[t] = static_cast<float>(value.real());
            node.imaginary[t] = static_cast<float>(value.imag());
        }
    }

    /// Adds to each arrival its own energy, and half of its interference with all others.
    void addEnergies(std::vector<Arrival>& arrivals);

  private:
    struct Node {
        std::size_t arrival = 0;
        double pathLength = 0;
        std::array<float, kEdgeTones> real{}, imaginary{}, energy{};
    };

    /// Adds what those before do to each; `backwards`: those after it.
    void walk(bool backwards);

    double speedOfSound_;
    std::vector<Node> nodes_;
};

}  // namespace rtsg
