// Sums one band of an echogram from its end, and finds where it begins.
#include "band_decay.h"

namespace rtsg::trace {
namespace {

/// The window's length, and the share of the largest window's energy that begins the response.
constexpr double kOnsetSeconds = 0.001, kOnsetFraction = 0.01;

}  // namespace

BandArrivals::BandArrivals(std::span<const Arrival> arrivals, std::size_t band) {
    after.reserve(arrivals.size());
    for (const Arrival& arrival : arrivals)
        if (arrival.energy[band] > 0) after.emplace_back(arrival.seconds, arrival.energy[band]);
    std::sort(after.begin(), after.end());
    for (const auto& [seconds, each] : after) moment += seconds * each;
    // Summed from the end: the tail, 40 dB and more below the start, would drown in rounding otherwise.
    for (std::size_t i = after.size(); i-- > 0;) after[i].second = energy += after[i].second;
}

/// The energy of the last millisecond, from each time at which it jumps, or grows faster or slower, to the next.
class BandDecay::Window {
  public:
    explicit Window(const BandDecay& decay) : decay_(decay) {
        const std::vector<double>& tail = decay.tail_;
        std::size_t first = 0;
        while (first + 1 < tail.size() && tail[first] == tail[first + 1]) ++first;
        comes_ = goes_ = {0, arrival(0)};
        enters_ = leaves_ = {first, edge(first)};
    }

    double seconds = 0, before = 0, at = 0;  // energies: as it comes near that time, and then

    /// False: nothing changes any more.
    bool next() {
        seconds =
            std::min({comes_.seconds, goes_.seconds + kOnsetSeconds, enters_.seconds, leaves_.seconds + kOnsetSeconds});
        if (seconds == kNever) return false;
        const double bins = decay_.binsAfter(seconds - kOnsetSeconds) - decay_.binsAfter(seconds);
        before = exact() + bins;
        while (comes_.seconds <= seconds) comes_.seconds = arrival(++comes_.index);
        while (goes_.seconds + kOnsetSeconds <= seconds) goes_.seconds = arrival(++goes_.index);
        while (enters_.seconds <= seconds) enters_.seconds = edge(++enters_.index);
        while (leaves_.seconds + kOnsetSeconds <= seconds) leaves_.seconds = edge(++leaves_.index);
        at = exact() + bins;
        return true;
    }
    /// No later one holds more.
    double maxToCome() const { return decay_.exactFrom(goes_.index) + decay_.binsAfter(seconds - kOnsetSeconds); }

  private:
    static constexpr double kNever = std::numeric_limits<double>::infinity();
    struct Next {
        std::size_t index = 0;
        double seconds = kNever;
    };

    double arrival(std::size_t i) const {
        const auto& arrivals = decay_.arrivals_->after;
        return i < arrivals.size() ? arrivals[i].first : kNever;
    }
    double edge(std::size_t bin) const { return bin < decay_.tail_.size() ? decay_.startOf(bin) : kNever; }
    double exact() const { return decay_.exactFrom(goes_.index) - decay_.exactFrom(comes_.index); }

    const BandDecay& decay_;
    Next comes_, goes_, enters_, leaves_;  // of arrivals, and of edges of bins: into the window and out of it
};

BandDecay::BandDecay(std::shared_ptr<const BandArrivals> arrivals, const EnergyHistogram& late,
                     std::span<const double> bins)
    : arrivals_(std::move(arrivals)),
      binsPerSecond_(late.binsPerSecond),
      start_(late.start),
      allMoment_(arrivals_->moment) {
    tail_.assign(bins.size() + 1, 0.0);
    for (std::size_t i = bins.size(); i-- > 0;) {
        tail_[i] = tail_[i + 1] + bins[i];
        allMoment_ += bins[i] * (late.startOf(i) + 0.5 / binsPerSecond_);
    }
    all_ = arrivals_->energy + tail_[0];
    if (all_ > 0) beginAt(findOnset());
}

std::vector<double> BandDecay::bandOf(const EnergyHistogram& histogram, std::size_t band) {
    std::vector<double> bins;
    bins.reserve(histogram.bins.size());
    for (const Bands& bin : histogram.bins) bins.push_back(bin[band]);
    return bins;
}

double BandDecay::findOnset() const {
    // Direct sound mostly is a hundredth of all there is, and then of any window: nothing need be looked through.
    Window first(*this);
    if (first.next() && first.at >= kOnsetFraction * all_) return first.seconds;
    double maximum = 0;
    for (Window window(*this); window.next();) {
        maximum = std::max({maximum, window.before, window.at});
        if (window.maxToCome() <= maximum) break;
    }
    const double enough = kOnsetFraction * maximum;
    double time = 0, energy = 0;
    for (Window window(*this); window.next(); time = window.seconds, energy = window.at) {
        if (window.before >= enough)  // it grew evenly since then
            return time + (window.seconds - time) * (enough - energy) / (window.before - energy);
        if (window.at >= enough) return window.seconds;
    }
    return time;
}

void BandDecay::beginAt(double onset) {
    onset_ = onset;
    moment_ = allMoment_;
    std::size_t first = 0;
    for (; first < arrivals_->after.size() && arrivals_->after[first].first < onset; ++first)
        moment_ -= arrivals_->after[first].first * (exactFrom(first) - exactFrom(first + 1));
    for (std::size_t bin = 0; bin + 1 < tail_.size() && startOf(bin) < onset; ++bin) {
        const double fraction = std::min(1.0, (onset - startOf(bin)) * binsPerSecond_);
        moment_ -= fraction * (tail_[bin] - tail_[bin + 1]) * (startOf(bin) + fraction / 2 / binsPerSecond_);
    }
    total_ = exactFrom(first) + binsAfter(onset);
}

}  // namespace rtsg::trace
