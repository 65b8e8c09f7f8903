// Walks along pressures, forwards and backwards, with a decaying sum of those that were passed.
#include "pressure_sum.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtsg {
namespace {

constexpr std::size_t kTonesOfOctave = kEdgeTones / kBandCount;
/// Half of the width of a fifth of an octave beside its middle.
const double kHalfWidth = std::sinh(0.1 * std::numbers::ln2);

using ToneSums = std::array<double, kEdgeTones>;

/// Sums over the pressures passed so far, multiplied by exp(-y) and by 1, y and y y.
struct Passed {
    ToneSums plain{}, once{}, twice{};

    /// By as much as y grows, `on`, and exp(-on).
    void goOn(const ToneSums& on, const ToneSums& left) {
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            twice[t] = left[t] * (twice[t] + on[t] * (2 * once[t] + on[t] * plain[t]));
            once[t] = left[t] * (once[t] + on[t] * plain[t]);
            plain[t] *= left[t];
        }
    }
    double at(std::size_t t) const { return plain[t] + once[t] + twice[t] / 3; }
};

}  // namespace

void PressureSum::walk(bool backwards) {
    Passed real, imaginary;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        Node& node = nodes_[backwards ? nodes_.size() - 1 - i : i];
        if (i > 0) {
            const double metres = std::abs(node.pathLength - nodes_[backwards ? nodes_.size() - i : i - 1].pathLength);
            const ToneSums on = byOctaves<double>(
                speedOfSound_, [&](double k) { return kHalfWidth * k * metres; }, [](double y) { return 2 * y; });
            const ToneSums left = byOctaves<double>(
                speedOfSound_, [&](double k) { return std::exp(-kHalfWidth * k * metres); },
                [](double e) { return e * e; });
            real.goOn(on, left);
            imaginary.goOn(on, left);
        }
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            const auto re = static_cast<double>(node.real[t]), im = static_cast<double>(node.imaginary[t]);
            node.energy[t] += static_cast<float>(re * real.at(t) + im * imaginary.at(t));
            real.plain[t] += re;
            imaginary.plain[t] += im;
        }
    }
}

void PressureSum::addEnergies(std::vector<Arrival>& arrivals) {
    constexpr double kSphere = 4 * std::numbers::pi;
    std::ranges::stable_sort(nodes_, {}, &Node::pathLength);
    walk(false);
    walk(true);
    for (const Node& one : nodes_)
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            const auto re = static_cast<double>(one.real[t]), im = static_cast<double>(one.imaginary[t]);
            arrivals[one.arrival].energy[t / kTonesOfOctave] +=
                (re * re + im * im + static_cast<double>(one.energy[t])) / (kSphere * kTonesOfOctave);
        }
}

}  // namespace rtsg
