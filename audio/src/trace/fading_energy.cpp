// What is left of rays by distance, made even where few of them tell of it.
#include "fading_energy.h"

namespace rtsg::trace {
namespace {

/// A mean of several rays, told by some that met walls at about this distance.
struct Group {
    double metres = 0, share = 0;
};

}  // namespace

void FadingEnergy::settle() {
    constexpr std::size_t kMostBins = 2048, kFew = 32;
    // So late that reverberation times need little of it: the later, the fewer rays tell of it.
    constexpr double kLate = 1e-3;
    std::sort(met_.begin(), met_.end(), [](const Met& a, const Met& b) { return a.metres < b.metres; });
    std::vector<Group> groups;
    for (std::size_t first = 0; first + kFew <= met_.size(); first += kFew) {
        Group group;
        for (std::size_t i = first; i < first + kFew; ++i) {
            group.metres += met_[i].metres / kFew;
            group.share += met_[i].share / kFew;
        }
        if (group.share > 0) groups.push_back(group);
    }
    met_.clear();
    if (groups.empty()) return;
    const Group &early = groups.front(), &last = groups.back();
    // Twice as far as is known it goes on as it did on the whole.
    const double span = last.metres - early.metres, fall = span > 0 ? std::log(last.share / early.share) / span : 0;
    binsPerMetre_ = kMostBins / (2 * last.metres);
    std::size_t next = 0;
    for (std::size_t bin = 0; bin < kMostBins; ++bin) {
        const double metres = (static_cast<double>(bin) + 0.5) / binsPerMetre_;
        while (next < groups.size() && groups[next].metres < metres) ++next;
        double mean = early.share;
        if (next == groups.size()) {
            mean = last.share * std::exp(fall * (metres - last.metres));
        } else if (next > 0) {
            const Group &a = groups[next - 1], &b = groups[next];
            mean = a.share * std::pow(b.share / a.share, (metres - a.metres) / (b.metres - a.metres));
        }
        targets_.push_back(std::max(mean, std::sqrt(mean * early.share * kLate)));
    }
    last_ = targets_.back();
    played_ = kPlayed * early.share;
}

}  // namespace rtsg::trace
