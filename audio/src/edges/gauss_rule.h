// Gauss's quadrature from 0 to 1: exact for polynomials with up to twice as many terms as the rule has nodes.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace rtsg {

template <std::size_t nodes>
struct GaussRule {
    GaussRule() {
        for (std::size_t i = 0; i < nodes; ++i) {
            // The places are the zeros of Legendre's polynomial, found by Newton's rule.
            double x = std::cos(std::numbers::pi * (static_cast<double>(i) + 0.75) / (nodes + 0.5)), slope = 1;
            for (int step = 0; step < 20; ++step) {
                double p = 1, before = 0;
                for (std::size_t n = 0; n < nodes; ++n) {
                    const auto order = static_cast<double>(n);
                    const double next = ((2 * order + 1) * x * p - order * before) / (order + 1);
                    before = p;
                    p = next;
                }
                slope = nodes * (x * p - before) / (x * x - 1);
                x -= p / slope;
            }
            positions[i] = 0.5 * (1 + x);
            weights[i] = 1 / ((1 - x * x) * slope * slope);
        }
    }
    std::array<double, nodes> positions{}, weights{};
};

}  // namespace rtsg
