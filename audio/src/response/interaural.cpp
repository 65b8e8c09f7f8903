// Correlates the sound at both ears of a head for each direction, and for a response by the directions of its energy.
#include "interaural.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "band_decay.h"
#include "batch_interval.h"
#include "signal/band_filters.h"
#include "signal/fft.h"

namespace rtsg {
namespace {

constexpr std::size_t kEarFft = 2048;
/// Delays are so much finer than samples: a quarter of one is a hundredth of a period at 2 kHz.
constexpr std::size_t kFiner = 4;
constexpr double kMaxDelay = 0.001;  // s
constexpr double kEarlySeconds = 0.08;

}  // namespace

void EarCorrelation::Function::add(const Function& other, double factor) {
    if (cross.size() < other.cross.size()) cross.resize(other.cross.size());
    for (std::size_t i = 0; i < other.cross.size(); ++i) cross[i] += factor * other.cross[i];
    left += factor * other.left;
    right += factor * other.right;
}

double EarCorrelation::Function::coefficient() const {
    double maximum = 0;
    for (const double value : cross) maximum = std::max(maximum, std::abs(value));
    return maximum / std::sqrt(left * right);
}

EarCorrelation::Functions EarCorrelation::functionsFrom(const Hrtf& head, double across) const {
    constexpr int kRound = 4;
    const auto kept = RealFft::kept(kEarFft), fine = RealFft::kept(kFiner * kEarFft);
    const double around = std::sqrt(std::max(0.0, 1 - across * across));
    Functions functions;
    std::array<RealFft::Spectrum, kBandCount> products;
    for (RealFft::Spectrum& product : products) product.resize(fine->bins());
    std::vector<float> padded(kEarFft), turned(kFiner * kEarFft);
    std::array<RealFft::Spectrum, 2> ears;
    for (int i = 0; i < kRound; ++i) {
        const double angle = 2 * std::numbers::pi * (i + 0.5) / kRound;
        const Hrtf::Ears heard = head.at({across, around * std::sin(angle), -around * std::cos(angle)});
        for (std::size_t ear = 0; ear < 2; ++ear) {
            std::fill(padded.begin(), padded.end(), 0.0f);
            std::copy_n(heard[ear].begin(), std::min(heard[ear].size(), kEarFft), padded.begin());
            kept->forward(padded, ears[ear]);
        }
        for (std::size_t k = 1; k < kept->bins(); ++k)
            for (std::size_t b = 0; b < kBandCount; ++b) {
                const double weight = weights_[b][k];
                if (weight == 0) continue;
                products[b][k] += static_cast<float>(weight) * ears[0][k] * std::conj(ears[1][k]);
                functions[b].left += weight * static_cast<double>(std::norm(ears[0][k]));
                functions[b].right += weight * static_cast<double>(std::norm(ears[1][k]));
            }
    }
    const auto delays = static_cast<std::size_t>(std::floor(kMaxDelay * rate_ * kFiner));
    for (std::size_t b = 0; b < kBandCount; ++b) {
        fine->inverse(std::move(products[b]), turned);
        // From the spectrum of one side to the sum over it, as the energies are: the inverse halves each bin.
        const double scale = static_cast<double>(kFiner * kEarFft) / 2;
        for (std::size_t d = 0; d <= 2 * delays; ++d)
            functions[b].cross.push_back(scale *
                                         static_cast<double>(turned[(d + turned.size() - delays) % turned.size()]));
    }
    return functions;
}

EarCorrelation::EarCorrelation(const Hrtf& head) : rate_(head.sampleRate()) {
    for (std::size_t b = 0; b < kBandCount; ++b)
        for (std::size_t k = 0; k <= kEarFft / 2; ++k) {
            const double hz = static_cast<double>(k) * rate_ / static_cast<double>(kEarFft);
            const double weight = octaveWeight(static_cast<int>(b), hz);
            weights_[b].push_back(weight * weight);
        }
    double all = 0;
    for (std::size_t i = 0; i < kRings; ++i) {
        const double angle = std::numbers::pi * static_cast<double>(i) / (kRings - 1);
        rings_.push_back(functionsFrom(head, -std::cos(angle)));
        const double fraction = std::sin(angle);
        all += fraction;
        for (std::size_t b = 0; b < kBandCount; ++b) even_[b].add(rings_.back()[b], fraction);
    }
    for (Function& function : even_) {
        const Function sum = function;
        function.add(sum, 1 / all - 1);
    }
}

namespace {

/// A span of time, and the energy of an octave within it.
struct TimeWindow {
    double begin = 0, end = 0;

    /// The energy in the span from a histogram, in whose bins energy is spread evenly.
    double of(const EnergyHistogram& times, const std::vector<Bands>& bins, std::size_t band) const {
        double sum = 0;
        for (std::size_t i = 0; i < bins.size(); ++i) {
            const double start = times.startOf(i), length = 1 / times.binsPerSecond;
            const double fraction = (std::min(end, start + length) - std::max(begin, start)) / length;
            if (fraction > 0) sum += std::min(1.0, fraction) * bins[i][band];
        }
        return sum;
    }
};

/// Random energy, and what of it comes from the sides.
struct Scattered {
    double energy = 0, lateral = 0;

    void add(const Scattered& other, double factor) {
        energy += factor * other.energy;
        lateral += factor * other.lateral;
    }
};

/// How far along the rings a direction lies, from the left to the right.
double ringOf(const glm::dvec3& direction, const glm::dvec3& across, std::size_t rings) {
    const double right = std::clamp(glm::dot(direction, across), -1.0, 1.0);
    return std::acos(-right) / std::numbers::pi * static_cast<double>(rings - 1);
}

}  // namespace

EarCorrelation::Function EarCorrelation::exactOf(std::span<const Arrival> arrivals, double begin, double end,
                                                 std::size_t band, const glm::dvec3& across) const {
    std::array<double, kRings> energy{};
    for (const Arrival& arrival : arrivals) {
        if (!(arrival.seconds >= begin && arrival.seconds < end)) continue;
        const double ring = ringOf(arrival.direction, across, kRings);
        const auto low = std::min(static_cast<std::size_t>(ring), kRings - 2);
        const double fraction = ring - static_cast<double>(low);
        energy[low] += (1 - fraction) * arrival.energy[band];
        energy[low + 1] += fraction * arrival.energy[band];
    }
    Function sum;
    for (std::size_t i = 0; i < kRings; ++i)
        if (energy[i] > 0) sum.add(rings_[i][band], energy[i]);
    return sum;
}

double EarCorrelation::coefficient(Function sum, double random, double lateral, std::size_t band) const {
    constexpr double kEven = 1.0 / 3;
    if (random > 0) {
        const double fraction = lateral < kEven ? lateral / kEven : (1 - lateral) / (1 - kEven);
        const double evenly = std::clamp(fraction, 0.0, 1.0), rest = (1 - evenly) * random;
        sum.add(even_[band], evenly * random);
        if (lateral < kEven)
            sum.add(rings_[kRings / 2][band], rest);
        else
            for (const std::size_t side : {std::size_t{0}, kRings - 1}) sum.add(rings_[side][band], rest / 2);
    }
    return sum.coefficient();
}

InterauralEstimate EarCorrelation::estimate(std::span<const Arrival> arrivals, std::span<const EnergyHistogram> batches,
                                            const glm::dvec3& across) const {
    constexpr double kForever = std::numeric_limits<double>::infinity(), kEvenly = 1.0 / 3;
    InterauralEstimate result;
    const auto count = static_cast<double>(batches.size());
    Echogram mean{{arrivals.begin(), arrivals.end()}, {}};
    if (!batches.empty()) mean.late = {batches.front().binsPerSecond, {}, batches.front().start};
    for (const EnergyHistogram& batch : batches) mean.late.accumulate(batch, 1 / count);
    for (std::size_t i = 0; i < 2 * kBandCount; ++i) {
        const std::size_t b = i / 2;
        const bool early = i % 2 == 0;
        const double onset = trace::BandDecay(mean, b).onset(), limit = onset + kEarlySeconds;
        const TimeWindow window = early ? TimeWindow{onset, limit} : TimeWindow{limit, kForever};
        const Function exact = exactOf(arrivals, window.begin, window.end, b, across);
        std::vector<Scattered> parts;
        Scattered sum;
        for (const EnergyHistogram& batch : batches) {
            parts.push_back({window.of(batch, batch.bins, b), window.of(batch, batch.lateral, b)});
            sum.add(parts.back(), 1);
        }
        const auto coefficientWith = [&](const Scattered& random) {
            const bool known = across != glm::dvec3(0) && random.energy > 0;
            return coefficient(exact, random.energy, known ? random.lateral / random.energy : kEvenly, b);
        };
        Scattered whole;
        if (!batches.empty()) whole.add(sum, 1 / count);
        const double value = coefficientWith(whole);
        (early ? result.value.early : result.value.late)[b] = value;
        if (batches.size() < 2) continue;
        std::vector<double> without;
        for (const Scattered& part : parts) {
            Scattered rest;
            rest.add(sum, 1 / (count - 1));
            rest.add(part, -1 / (count - 1));
            without.push_back(coefficientWith(rest));
        }
        (early ? result.ci95.early : result.ci95.late)[b] = halfWidth95(without, value);
    }
    return result;
}

}  // namespace rtsg
