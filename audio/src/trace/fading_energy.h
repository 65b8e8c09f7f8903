// FadingEnergy: how much energy the rays of a source have left after so many metres, from some that were followed.
//
// Rays that met walls which absorb little have more than others, the later the more so; then a few of them make all
// that is heard. By this table such a ray is split where it is scattered, and one with little is played (see
// trace/batch_tracer.h), so that all that are under way count alike. Any table leaves what is expected as it is: it
// decides how many rays tell of it. Source: weight windows; Booth and Hendricks 1984, "Importance estimation in forward
// Monte Carlo calculations", Fusion Technology 5. Threading: const once settled.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace rtsg::trace {

class FadingEnergy {
  public:
    /// A followed ray has this share of its energy left after a reflection, and after so many metres; air not counted.
    void add(double metres, double share) { met_.push_back({metres, share}); }
    /// After the last.
    void settle();

    /// The share of what a ray is sent with that those should have that are under way after so many metres.
    double target(double metres) const {
        const double at = std::max(0.0, metres * binsPerMetre_);
        return at < static_cast<double>(targets_.size()) ? targets_[static_cast<std::size_t>(at)] : last_;
    }

    /// What a ray should have at least: half of that; but what may be heard within 40 dB is never played.
    double least(double target) const { return std::min(0.5 * target, played_); }

  private:
    struct Met {
        double metres, share;
    };
    /// With so much of what the first have left rays are played at the earliest.
    static constexpr double kPlayed = 1e-4;

    std::vector<Met> met_;
    std::vector<double> targets_;
    double binsPerMetre_ = 0, last_ = 1, played_ = kPlayed;
};

}  // namespace rtsg::trace
