// ListenerChances: which of several listeners without images are looked for from a wall that scatters.
// Threading: one thread an object.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include "batch_task.h"

namespace rtsg::trace {

/// With what chance each of several listeners is looked for from a wall that scatters: in proportion to cos^2 / d^2 as
/// far as that goes, which is near enough to the cos / d^2 of what it hears, and takes no root. Chances depend on walls
/// before, never on whether anybody is seen, so what is heard divided by them is unbiased.
class ListenerChances {
  public:
    explicit ListenerChances(std::span<const Ear> ears) : count_(ears.size()) {
        const std::size_t padded = (count_ + kLanes - 1) / kLanes * kLanes;
        for (std::vector<double>* list : {&x_, &y_, &z_, &worth_, &sum_}) list->resize(padded);
        scale_.resize(padded, std::numeric_limits<double>::infinity());
        for (std::size_t i = 0; i < count_; ++i) {
            x_[i] = ears[i].position.x;
            y_[i] = ears[i].position.y;
            z_[i] = ears[i].position.z;
        }
        // For many listeners the looks of one wall grow with the root of their number: errors and time together are
        // least then.
        const auto n = static_cast<double>(count_);
        share_ = std::max(kLooks, kLooks / 2 * std::sqrt(n)) / n;
    }

    void weigh(const glm::dvec3& point, const glm::dvec3& normal) {
        double* const worth = worth_.data();
        for (std::size_t i = 0; i < x_.size(); ++i) {
            const double x = x_[i] - point.x, y = y_[i] - point.y, z = z_[i] - point.z;
            const double towards = std::max(0.0, x * normal.x + y * normal.y + z * normal.z);
            const double ratio = towards / (x * x + y * y + z * z);
            worth[i] = ratio * ratio;
        }
        for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] += worth[i];
        if (++walls_ % kRenewed != 0) return;
        for (std::size_t i = 0; i < sum_.size(); ++i) scale_[i] = share_ * static_cast<double>(walls_) / sum_[i];
    }
    double chance(std::size_t i) const {
        // Written so that what is no number is certain: before the first renewal, and on a listener's own place.
        const double ratio = worth_[i] * scale_[i];
        return ratio < 1 ? ratio : 1;
    }

  private:
    static constexpr std::size_t kLanes = 4;  // so that vectors of numbers need no rest
    static constexpr std::int64_t kRenewed = 32;
    static constexpr double kLooks = 0.8;  // from one wall, of all listeners together

    std::size_t count_;
    std::vector<double> x_, y_, z_, worth_, sum_, scale_;
    std::int64_t walls_ = 0;
    double share_ = 1;
};

}  // namespace rtsg::trace
