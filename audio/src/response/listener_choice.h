// ListenerChoice: chooses which listener, or which mirror image of one, a scattering wall is connected with.
//
// The choice is random, in proportion to the energy that each would receive by Lambert's law on a free path: cos / d^2
// times the share that its mirrors leave. All points on one side of a plane have the same targets in front of them, at
// the same distances from the plane. Both are found when the side is first used, so that a wall needs only 1 / d^3, and
// only for targets in front of it. Probabilities are rounded to single precision, but each target is chosen with
// exactly its rounded probability.
// Threading: one thread an object.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/glm.hpp>

namespace rtsg::trace {

class ListenerChoice {
  public:
    struct Target {
        glm::dvec3 position;
        std::size_t ear;
        std::uint32_t image;  // of those of the listener; none of them: the listener itself
    };

    /// `planes`: sides 0 to 2 * planes - 1 are those of planes.
    explicit ListenerChoice(std::size_t planes) : sideAt_(2 * planes, kUnseen) {}

    /// `share`: of energy that mirrors leave on the way at most. All of them before the first choice.
    void add(const Target& target, double fraction) {
        if (targets_.empty()) center_ = target.position;
        targets_.push_back(target);
        fractions_.push_back(fraction);
    }
    std::size_t size() const { return targets_.size(); }
    const Target& target(std::size_t i) const { return targets_[i]; }

    /// The chance with which `which` was chosen, by `uniform` in [0, 1), from a point on a surface with this unit
    /// normal; 0 if none is before it. `side`: the same for all places that have plane and normal in common; of no
    /// plane: any other number.
    double choose(std::size_t side, const glm::dvec3& point, const glm::dvec3& normal, double uniform,
                  std::size_t& which) {
        const Before& before = seenFrom(side, point, normal);
        const Lanes sums = weigh(before, glm::vec3(point - center_));
        float upTo[kLanes];
        float all = 0;
        for (std::size_t i = 0; i < kLanes; ++i) upTo[i] = all += sums[i];
        if (!(all > 0)) return 0;
        // Counted without branches, because the choice is random and branches would be mispredicted.
        float rest = static_cast<float>(uniform) * all;
        std::size_t lane = 0;
        for (std::size_t i = 0; i + 1 < kLanes; ++i) lane += upTo[i] <= rest;
        // Rounding may leave more than there is: then the last that might hear something.
        while (!(sums[lane] > 0)) --lane;
        rest -= upTo[lane] - sums[lane];
        std::size_t row = 0;
        for (std::size_t r = 0; r + 1 < before.rows.size(); ++r) row += weighed_[r].upTo[lane] <= rest;
        while (!(weighed_[row].worth[lane] > 0)) --row;
        which = before.of[row * kLanes + lane];
        return static_cast<double>(weighed_[row].worth[lane]) / static_cast<double>(all);
    }

  private:
    static constexpr std::size_t kLanes = 8;  // so that vectors of numbers need no rest
    static constexpr std::uint32_t kUnseen = 0xFFFFFFFF;

    // Compilers make vector instructions of these types on every machine.
    using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
    using Bits = std::int32_t __attribute__((vector_size(kLanes * sizeof(float))));

    struct Row {
        Lanes x{}, y{}, z{};  // from the center
        Lanes worth{};        // at a distance of 1; nothing of those that fill up the last row
    };
    /// The worth of a row seen from some place, and the sum with the rows before it.
    struct Weighed {
        Lanes worth, upTo;
    };
    /// The targets in front of a side.
    struct Before {
        std::vector<Row> rows;
        std::vector<std::uint32_t> of;  // targets
    };

    const Before& seenFrom(std::size_t side, const glm::dvec3& point, const glm::dvec3& normal) {
        if (side >= sideAt_.size()) {
            find(point, normal, passing_);
            return passing_;
        }
        if (sideAt_[side] == kUnseen) {
            sideAt_[side] = static_cast<std::uint32_t>(sides_.size());
            find(point, normal, sides_.emplace_back());
        }
        return sides_[sideAt_[side]];
    }

    void find(const glm::dvec3& point, const glm::dvec3& normal, Before& before) {
        before.of.clear();
        before.rows.clear();
        for (std::size_t i = 0; i < targets_.size(); ++i) {
            const double towards = glm::dot(targets_[i].position - point, normal);
            if (!(towards > 0)) continue;
            const std::size_t lane = before.of.size() % kLanes;
            if (lane == 0) before.rows.emplace_back();
            before.of.push_back(static_cast<std::uint32_t>(i));
            Row& row = before.rows.back();
            const glm::vec3 position(targets_[i].position - center_);
            row.x[lane] = position.x, row.y[lane] = position.y, row.z[lane] = position.z;
            row.worth[lane] = static_cast<float>(fractions_[i] * towards);
        }
        weighed_.resize(std::max(weighed_.size(), before.rows.size()));
    }

    /// 1 / sqrt(x) to some tenths of a percent; Lomont 2003.
    static Lanes rootInverse(const Lanes& x) {
        const Lanes y = std::bit_cast<Lanes>(0x5F375A86 - (std::bit_cast<Bits>(x) >> 1));
        return y * (1.5f - 0.5f * x * y * y);
    }

    /// Weighs the targets, and returns the sum of each column.
    Lanes weigh(const Before& before, const glm::vec3& point) {
        Lanes sums{};
        Weighed* weighed = weighed_.data();
        for (const Row& row : before.rows) {
            const Lanes x = row.x - point.x, y = row.y - point.y, z = row.z - point.z;
            const Lanes inverse = rootInverse(x * x + y * y + z * z + 1e-12f);
            const Lanes now = row.worth * (inverse * inverse * inverse);
            sums += now;
            *weighed++ = {now, sums};
        }
        return sums;
    }

    glm::dvec3 center_{0};
    std::vector<Target> targets_;
    std::vector<double> fractions_;
    std::vector<std::uint32_t> sideAt_;  // in `sides_`
    std::vector<Before> sides_;
    Before passing_;
    std::vector<Weighed> weighed_;  // by row
};

}  // namespace rtsg::trace
