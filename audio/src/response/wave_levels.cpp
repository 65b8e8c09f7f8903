// Sums waves with their phases, and attributes the energy of each octave to them.
#include "wave_levels.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>
#include <span>

#include "edge_tones.h"
#include "pressure_sum.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kSphere = 4 * std::numbers::pi;
constexpr std::size_t kTonesInBand = kEdgeTones / kBandCount;
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

/// Parts that continue into one mirror image, and the sound that is heard of it.
struct ImageGroup {
    glm::dvec3 image{0};
    Bands whole{};
    std::size_t arrival = kNone;
    std::array<double, kEdgeTones> withDirect{};  // share of its pressure that is one with direct sound
};

/// All that comes from one source to one listener.
class Levels {
  private:
    auto straightPressure(std::size_t arrival) const {
        const Arrival& one = arrivals_[arrival];
        return [energy = one.straight < 0 ? one.energy : field_.straight[static_cast<std::size_t>(one.straight)]](
                   std::size_t t) { return std::sqrt(kSphere * energy[t / kTonesInBand]); };
    }
    /// The pressures of all waves, without the parts that images have for themselves.
    std::vector<EdgeTonePressures> withDirect() const {
        std::vector<EdgeTonePressures> left;
        for (const EdgeWave& wave : field_.waves) left.push_back(wave.pressure);
        for (std::size_t p = 0; p < parts_.images.size(); ++p)
            if (const ImagePart& part = parts_.images[p]; part.wave != ImagePart::kFaint)
                for (std::size_t t = 0; t < kEdgeTones; ++t)
                    left[part.wave][t] -= static_cast<float>(1 - groups_[groupOf_[p]].withDirect[t]) * part.pressure[t];
        return left;
    }

  public:
    Levels(const glm::dvec3& source, const glm::dvec3& listener, double speedOfSound, const BentParts& parts,
           std::vector<Arrival>& arrivals, EdgeField& field)
        : listener_(listener),
          c_(speedOfSound),
          straight_(glm::distance(source, listener)),
          parts_(parts),
          arrivals_(arrivals),
          field_(field),
          known_(arrivals.size()) {}

    void set() {
        if (field_.waves.empty() && parts_.images.empty()) return;
        direct_ = find(0, straight_, {});
        groupParts();
        addArrivals();
        PressureSum all(c_);
        if (direct_ != kNone) all.add(direct_, straight_, straightPressure(direct_));
        const std::vector<EdgeTonePressures> left = withDirect();
        for (std::size_t w = 0; w < left.size(); ++w)
            all.add(known_ + w, field_.waves[w].seconds * c_, [&](std::size_t t) { return left[w][t]; });
        addFaint(all);
        for (const ImageGroup& one : groups_)
            if (one.arrival != kNone)
                all.add(one.arrival, imagePath(one), [&, straight = straightPressure(one.arrival)](std::size_t t) {
                    return one.withDirect[t] * straight(t);
                });
        clearEnergies();
        all.addEnergies(arrivals_);
        for (std::size_t g = 0; g < groups_.size(); ++g) addImage(g);
        giveBack();
        mergeFaint();
        std::ranges::stable_sort(arrivals_, {}, &Arrival::seconds);
    }

  private:
    double imagePath(const ImageGroup& group) const { return glm::distance(group.image, listener_); }

    std::size_t find(std::uint32_t order, double pathLength, const std::optional<glm::dvec3>& position) const {
        const double seconds = pathLength / c_;
        for (std::size_t i = 0; i < known_; ++i) {
            const Arrival& one = arrivals_[i];
            if (one.order != order || !(std::abs(one.seconds - seconds) < 1e-8 + 1e-6 * seconds)) continue;
            if (!position || glm::distance(listener_ + one.direction * pathLength, *position) < 1e-4 * pathLength)
                return i;
        }
        return kNone;
    }

    void groupParts() {
        for (const ImagePart& part : parts_.images) {
            const double rounding = 1e-5 * (1 + glm::length(part.image));
            const auto known = std::ranges::find_if(
                groups_, [&](const ImageGroup& one) { return glm::distance(one.image, part.image) < rounding; });
            if (known == groups_.end()) {
                groupOf_.push_back(groups_.size());
                groups_.push_back({part.image, part.whole});
                const std::size_t found = find(1, imagePath(groups_.back()), part.image);
                if (std::ranges::none_of(groups_, [&](const ImageGroup& one) { return one.arrival == found; }))
                    groups_.back().arrival = found;
            } else {
                groupOf_.push_back(static_cast<std::size_t>(known - groups_.begin()));
            }
        }
        for (std::size_t g = 0; g < groups_.size(); ++g) setFractions(g);
    }

    void setFractions(std::size_t number) {
        ImageGroup& group = groups_[number];
        const double pathLength = imagePath(group);
        std::array<Complex, kEdgeTones> sum{};
        if (group.arrival != kNone) {
            const auto straight = straightPressure(group.arrival);
            for (std::size_t t = 0; t < kEdgeTones; ++t) {
                sum[t] = straight(t);
                group.whole[t / kTonesInBand] = straight(t);
            }
        }
        for (std::size_t p = 0; p < parts_.images.size(); ++p) {
            const ImagePart& part = parts_.images[p];
            if (groupOf_[p] != number) continue;
            const auto turned = turnedBy(part.seconds * c_ - pathLength, c_);
            for (std::size_t t = 0; t < kEdgeTones; ++t) sum[t] += Complex(part.pressure[t]) * turned[t];
        }
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            // Half of it is left at its boundary, and less where it is not heard.
            const double whole = group.whole[t / kTonesInBand];
            const double left = whole > 0 ? std::norm(sum[t]) / (whole * whole) : 0;
            const double missing = std::clamp((1 - left) / 0.75, 0.0, 1.0);
            group.withDirect[t] = missing * missing;
        }
    }

    /// Parts of images whose waves are nothing by themselves.
    void addFaint(PressureSum& all) const {
        for (std::size_t p = 0; p < parts_.images.size(); ++p) {
            const ImagePart& part = parts_.images[p];
            if (part.wave == ImagePart::kFaint)
                all.add(arrivalOf(p), part.seconds * c_, [&](std::size_t t) {
                    return (groups_[groupOf_[p]].withDirect[t] - 1) * Complex(part.pressure[t]);
                });
        }
    }

    void addImage(std::size_t group) {
        const ImageGroup& one = groups_[group];
        const auto own = [&](std::size_t t) { return std::sqrt(1 - one.withDirect[t] * one.withDirect[t]); };
        PressureSum sum(c_);
        if (one.arrival != kNone)
            sum.add(one.arrival, imagePath(one),
                    [&, straight = straightPressure(one.arrival)](std::size_t t) { return own(t) * straight(t); });
        for (std::size_t p = 0; p < parts_.images.size(); ++p)
            if (groupOf_[p] == group)
                sum.add(arrivalOf(p), parts_.images[p].seconds * c_,
                        [&](std::size_t t) { return own(t) * Complex(parts_.images[p].pressure[t]); });
        sum.addEnergies(arrivals_);
    }

    /// Adds an arrival for each wave, and for each part that has no wave.
    void addArrivals() {
        const auto add = [&](double seconds, const glm::dvec3& direction, std::uint32_t order) {
            Arrival arrival;
            arrival.seconds = seconds;
            arrival.order = order;
            arrival.direction = direction;
            arrival.straight = static_cast<std::int32_t>(field_.straight.size());
            field_.straight.push_back({});
            arrivals_.push_back(arrival);
        };
        for (const EdgeWave& wave : field_.waves) add(wave.seconds, wave.direction, wave.order);
        for (const ImagePart& part : parts_.images) {
            if (part.wave == ImagePart::kFaint) {
                ownOf_.push_back(arrivals_.size());
                add(part.seconds, part.direction, 1);
            } else {
                ownOf_.push_back(known_ + part.wave);
            }
        }
    }
    std::size_t arrivalOf(std::size_t part) const { return ownOf_[part]; }
    /// Clears the energies of arrivals that are summed anew; without edges they stay as they are.
    void clearEnergies() {
        const auto clear = [&](std::size_t arrival) {
            if (arrival == kNone || std::ranges::find(summed_, arrival) != summed_.end()) return;
            Arrival& one = arrivals_[arrival];
            if (one.straight < 0) {
                one.straight = static_cast<std::int32_t>(field_.straight.size());
                field_.straight.push_back(one.energy);
            }
            one.energy = {};
            summed_.push_back(arrival);
        };
        clear(direct_);
        for (const ImageGroup& one : groups_) clear(one.arrival);
        for (std::size_t i = known_; i < arrivals_.size(); ++i) summed_.push_back(i);
        std::ranges::stable_sort(summed_, {}, [&](std::size_t i) { return arrivals_[i].seconds; });
    }

    /// The one that comes next to it in time of those that `counts`, of two as near the earlier one.
    template <class Counts>
    std::size_t nearest(std::size_t index, const Counts& counts) const {
        std::size_t before = index, after = index + 1;
        while (before > 0 && !counts(summed_[before - 1])) --before;
        while (after < summed_.size() && !counts(summed_[after])) ++after;
        if (before == 0) return after < summed_.size() ? summed_[after] : kNone;
        const auto apart = [&](std::size_t other) {
            return std::abs(arrivals_[summed_[other]].seconds - arrivals_[summed_[index]].seconds);
        };
        return summed_[after < summed_.size() && apart(after) < apart(before - 1) ? after : before - 1];
    }

    /// An arrival whose energy is below 0, since it takes more from others than it has, passes that on to the nearest
    /// one.
    void giveBack() {
        for (std::size_t b = 0; b < kBandCount; ++b)
            for (bool any = true; any;) {
                any = false;
                for (std::size_t index = 0; index < summed_.size(); ++index) {
                    double& energy = arrivals_[summed_[index]].energy[b];
                    if (!(energy < 0)) continue;
                    const std::size_t to = nearest(index, [&](std::size_t i) { return arrivals_[i].energy[b] > 0; });
                    if (to != kNone) arrivals_[to].energy[b] += energy;
                    any = any || (to != kNone && arrivals_[to].energy[b] < 0);
                    energy = 0;
                }
            }
    }

    /// Little as it is it comes with the next one that counts.
    void mergeFaint() {
        constexpr double kFaint = 1e-3;
        Bands all{};
        for (const std::size_t i : summed_)
            for (std::size_t b = 0; b < kBandCount; ++b) all[b] += arrivals_[i].energy[b];
        std::vector<bool> counting(arrivals_.size(), false);
        for (const std::size_t i : summed_) {
            counting[i] = i < known_;
            for (std::size_t b = 0; b < kBandCount; ++b)
                if (arrivals_[i].energy[b] > kFaint * all[b]) counting[i] = true;
        }
        const auto counts = [&](std::size_t i) -> bool { return counting[i]; };
        std::vector<std::size_t> to(summed_.size(), kNone);
        for (std::size_t index = 0; index < summed_.size(); ++index)
            if (!counts(summed_[index])) to[index] = nearest(index, counts);
        std::vector<bool> left(arrivals_.size(), true);
        for (std::size_t index = 0; index < summed_.size(); ++index) {
            const Arrival& from = arrivals_[summed_[index]];
            const bool nothing = std::ranges::none_of(from.energy, [](double one) { return one > 0; });
            if (to[index] != kNone)
                for (std::size_t b = 0; b < kBandCount; ++b) arrivals_[to[index]].energy[b] += from.energy[b];
            left[summed_[index]] = summed_[index] < known_ || (to[index] == kNone && !nothing);
        }
        std::size_t kept = 0;
        for (std::size_t i = 0; i < arrivals_.size(); ++i)
            if (left[i]) arrivals_[kept++] = arrivals_[i];
        arrivals_.resize(kept);
    }

    const glm::dvec3 listener_;
    const double c_, straight_;
    const BentParts& parts_;
    std::vector<Arrival>& arrivals_;
    EdgeField& field_;
    const std::size_t known_;
    std::size_t direct_ = kNone;
    std::vector<ImageGroup> groups_;
    std::vector<std::size_t> groupOf_, ownOf_;  // of the parts: groups, and arrivals
    std::vector<std::size_t> summed_;           // arrivals, by time
};

}  // namespace

void setLevels(const glm::dvec3& source, const glm::dvec3& listener, double speedOfSound, const BentParts& parts,
               std::vector<Arrival>& arrivals, EdgeField& field) {
    Levels(source, listener, speedOfSound, parts, arrivals, field).set();
}

}  // namespace rtsg
