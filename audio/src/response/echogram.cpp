// Sums and lengths of energy over time.
#include <rtsg/audio/echogram.h>

#include <algorithm>
#include <cmath>

namespace rtsg {

void EnergyHistogram::accumulate(const EnergyHistogram& other, double factor) {
    const auto add = [&](std::vector<Bands>& to, const std::vector<Bands>& from) {
        if (to.size() < from.size()) to.resize(from.size(), Bands{});
        for (std::size_t i = 0; i < from.size(); ++i)
            for (std::size_t b = 0; b < kBandCount; ++b) to[i][b] += factor * from[i][b];
    };
    add(bins, other.bins);
    add(lateral, other.lateral);
}

double edgeToneHz(double tone) {
    constexpr double kInOctave = static_cast<double>(kEdgeTones) / kBandCount;
    return 1000 * std::exp2((tone + 0.5) / kInOctave - 0.5 - kBand1k);
}

double Echogram::duration() const {
    double result = late.startOf(late.bins.size());
    for (const Arrival& arrival : arrivals) result = std::max(result, arrival.seconds);
    return result;
}

Bands Echogram::total() const {
    Bands sum{};
    for (const Arrival& arrival : arrivals)
        for (std::size_t b = 0; b < kBandCount; ++b) sum[b] += arrival.energy[b];
    for (const Bands& bin : late.bins)
        for (std::size_t b = 0; b < kBandCount; ++b) sum[b] += bin[b];
    return sum;
}

}  // namespace rtsg
