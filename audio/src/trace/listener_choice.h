// ListenerChoice: which of the listeners and their mirror images to look for from a wall that scatters.
//
// By chance, in proportion to what each would get by Lambert's law if its way were free: cos / d^2 times what its
// mirrors leave. Chances are rounded to single precision, but each is exactly that with which its target is chosen.
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

    /// `share`: of energy that mirrors leave on the way at most.
    void add(const Target& target, double share) {
        if (targets_.empty()) center_ = target.position;
        const std::size_t at = targets_.size(), padded = (at / kLanes + 1) * kLanes;
        targets_.push_back(target);
        for (std::vector<float>* list : {&x_, &y_, &z_, &share_, &worth_}) list->resize(padded, 0.0f);
        const glm::vec3 place(target.position - center_);
        x_[at] = place.x, y_[at] = place.y, z_[at] = place.z;
        share_[at] = static_cast<float>(share);
    }
    std::size_t size() const { return targets_.size(); }
    const Target& target(std::size_t i) const { return targets_[i]; }

    /// The chance with which `which` was chosen from a surface with this unit normal, by `uniform` in [0, 1); 0 if none
    /// is before it.
    double choose(const glm::dvec3& point, const glm::dvec3& normal, double uniform, std::size_t& which) {
        float sums[kLanes] = {};
        weigh(glm::vec3(point - center_), glm::vec3(normal), sums);
        float all = 0;
        for (const float sum : sums) all += sum;
        if (!(all > 0)) return 0;
        float rest = static_cast<float>(uniform) * all;
        std::size_t lane = 0;
        for (std::size_t i = 0; i < kLanes; ++i) {
            if (!(sums[i] > 0)) continue;
            lane = i;
            if (rest < sums[i]) break;
            rest -= sums[i];
        }
        // Rounding may leave more than there is: then the last that might hear something.
        for (std::size_t i = lane; i < worth_.size(); i += kLanes) {
            if (!(worth_[i] > 0)) continue;
            which = i;
            if (rest < worth_[i]) break;
            rest -= worth_[i];
        }
        return static_cast<double>(worth_[which]) / static_cast<double>(all);
    }

  private:
    static constexpr std::size_t kLanes = 8;  // so that vectors of numbers need no rest

    /// 1 / sqrt(x) to some tenths of a percent, in steps that compilers make vectors of; Lomont 2003.
    static float rootInverse(float x) {
        const float y = std::bit_cast<float>(0x5F375A86 - (std::bit_cast<std::int32_t>(x) >> 1));
        return y * (1.5f - 0.5f * x * y * y);
    }

    void weigh(const glm::vec3& point, const glm::vec3& normal, float (&sums)[kLanes]) {
        const float *const xs = x_.data(), *const ys = y_.data(), *const zs = z_.data(), *const shares = share_.data();
        float* const worth = worth_.data();
        for (std::size_t at = 0; at < worth_.size(); at += kLanes)
            for (std::size_t i = 0; i < kLanes; ++i) {
                const float x = xs[at + i] - point.x, y = ys[at + i] - point.y, z = zs[at + i] - point.z;
                const float towards = x * normal.x + y * normal.y + z * normal.z;
                const float inverse = rootInverse(x * x + y * y + z * z + 1e-12f);
                const float now = shares[at + i] * std::max(towards, 0.0f) * (inverse * inverse * inverse);
                worth[at + i] = now;
                sums[i] += now;
            }
    }

    glm::dvec3 center_{0};
    std::vector<Target> targets_;
    std::vector<float> x_, y_, z_, share_, worth_;
};

}  // namespace rtsg::trace
