// BoxTree: the box around many boxes, to which boxes are added and from which they are removed one by one.
//
// Boxes lie in groups of 16, groups of groups, and so on, so that an operation costs the logarithm of their number. The
// results do not depend on the order.
// Threading: none.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

class BoxTree {
  public:
    std::size_t size() const { return levels_[0].size(); }

    void insert(const AcousticBox& box) {
        levels_[0].push_back(box);
        refresh(size() - 1);
    }
    /// The last one takes the place of the one that goes.
    void erase(std::size_t at) {
        levels_[0][at] = levels_[0].back();
        levels_[0].pop_back();
        refresh(size());
        if (at < size()) refresh(at);
    }
    AcousticBox all() const { return around(levels_.back(), 0, levels_.back().size()); }
    /// Boxes read so far.
    std::uint64_t work() const { return work_; }

  private:
    static constexpr std::size_t kGroup = 16;

    static AcousticBox around(const std::vector<AcousticBox>& boxes, std::size_t first, std::size_t end) {
        AcousticBox box;
        for (std::size_t i = first; i < std::min(end, boxes.size()); ++i) box.extend(boxes[i]);
        return box;
    }
    /// Brings the groups above number `at` up to date; it may just have gone.
    void refresh(std::size_t at) {
        for (std::size_t level = 0;; ++level) {
            const std::size_t groups = (levels_[level].size() + kGroup - 1) / kGroup;
            if (groups <= 1) {
                levels_.resize(level + 1);
                return;
            }
            if (levels_.size() == level + 1) {
                levels_.emplace_back();
                for (std::size_t g = 0; g < groups; ++g)
                    levels_.back().push_back(around(levels_[level], g * kGroup, (g + 1) * kGroup));
            }
            at /= kGroup;
            levels_[level + 1].resize(groups);
            if (at < groups) levels_[level + 1][at] = around(levels_[level], at * kGroup, (at + 1) * kGroup);
            work_ += kGroup;
        }
    }

    std::vector<std::vector<AcousticBox>> levels_ = std::vector<std::vector<AcousticBox>>(1);
    std::uint64_t work_ = 0;
};

}  // namespace rtsg
