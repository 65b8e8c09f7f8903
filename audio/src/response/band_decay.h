// BandDecay: the energy of one octave band over time, and where its response begins.
//
// Exact for arrivals, even within bins. Source: Schroeder 1965, "New method of measuring reverberation time", JASA 37,
// 409-412; the onset: ISO 3382-1:2009, A.3.4. Threading: a plain value.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <rtsg/audio/echogram.h>

namespace rtsg::trace {

/// The exact arrivals of one band, in order.
struct BandArrivals {
    std::vector<std::pair<double, double>> after;  // time; energy from here on
    double energy = 0, moment = 0;

    BandArrivals(std::span<const Arrival> arrivals, std::size_t band);
};

class BandDecay {
  public:
    BandDecay(const Echogram& echogram, std::size_t band)
        : BandDecay(std::make_shared<const BandArrivals>(echogram.arrivals, band), echogram.late,
                    bandOf(echogram.late, band)) {}
    /// The decay of arrivals, and of bins at the times of those of `late`.
    BandDecay(std::shared_ptr<const BandArrivals> arrivals, const EnergyHistogram& late, std::span<const double> bins);

    static std::vector<double> bandOf(const EnergyHistogram& histogram, std::size_t band);

    /// The time, s, at which the response begins: when the energy of the last millisecond is first a hundredth of the
    /// most in any millisecond. If an arrival brings it over, it is that arrival's time. NaN if nothing comes.
    double onset() const { return onset_; }
    /// Counts from another time.
    void beginAt(double onset);

    /// The energy of all that comes, before the onset too.
    double all() const { return all_; }
    /// The energy from the onset on; the functions below count from there, too.
    double total() const { return total_; }
    /// Energy-weighted time, s.
    double moment() const { return moment_; }

    double after(double seconds) const {
        double sum = 0;
        const auto it = std::upper_bound(arrivals_->after.begin(), arrivals_->after.end(), seconds,
                                         [](double t, const auto& arrival) { return t < arrival.first; });
        if (it != arrivals_->after.end()) sum += it->second;
        return sum + binsAfter(seconds);
    }

    /// after() of times that only grow, without searching.
    class Walk {
      public:
        explicit Walk(const BandDecay& decay) : decay_(decay) {}
        double after(double seconds) {
            const auto& arrivals = decay_.arrivals_->after;
            while (next_ < arrivals.size() && arrivals[next_].first <= seconds) ++next_;
            return decay_.exactFrom(next_) + decay_.binsAfter(seconds);
        }

        struct Step {
            double seconds, before, after;  // energies: as it comes near that time, and from there on
        };
        /// The next time at which the energy that is left changes unevenly: an arrival that takes more than a little of
        /// the `energy` that was left at the last call, the end of a bin, or `at` the latest.
        Step next(double seconds, double energy, double at) {
            constexpr double kLittle = 0.002;
            const auto& arrivals = decay_.arrivals_->after;
            const double end = std::min(at, decay_.binEndAfter(seconds));
            for (; next_ < arrivals.size() && arrivals[next_].first <= end; ++next_) {
                if (decay_.exactFrom(next_) - decay_.exactFrom(next_ + 1) < kLittle * energy) continue;
                const double time = arrivals[next_].first, before = decay_.exactFrom(next_) + decay_.binsAfter(time);
                return {time, before, after(time)};
            }
            const double left = decay_.exactFrom(next_) + decay_.binsAfter(end);
            return {end, left, left};
        }

      private:
        const BandDecay& decay_;
        std::size_t next_ = 0;
    };

  private:
    class Window;

    double findOnset() const;

    double startOf(std::size_t bin) const { return start_ + static_cast<double>(bin) / binsPerSecond_; }

    /// The energy of this arrival and all later ones.
    double exactFrom(std::size_t arrival) const {
        return arrival < arrivals_->after.size() ? arrivals_->after[arrival].second : 0;
    }

    double binsAfter(double seconds) const {
        const double position = std::max(0.0, (seconds - start_) * binsPerSecond_);
        if (!(position < static_cast<double>(tail_.size() - 1))) return 0;
        const auto bin = static_cast<std::size_t>(position);
        return tail_[bin] + (tail_[bin + 1] - tail_[bin]) * (position - static_cast<double>(bin));
    }

    double binEndAfter(double seconds) const {
        const double bin = std::floor((seconds - start_) * binsPerSecond_) + 1;
        const double end = start_ + bin / binsPerSecond_;
        return end > seconds ? end : start_ + (bin + 1) / binsPerSecond_;
    }

    std::shared_ptr<const BandArrivals> arrivals_;
    std::vector<double> tail_;  // energy from the bin's start on
    double binsPerSecond_, start_;
    double all_ = 0, allMoment_ = 0;
    double onset_ = std::numeric_limits<double>::quiet_NaN(), total_ = 0, moment_ = 0;
};

}  // namespace rtsg::trace
