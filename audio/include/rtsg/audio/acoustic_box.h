// AcousticBox: an axis-aligned box in world coordinates, in double precision: the extent of a path or of a moved shape.
//
// Threading: a plain value.
#pragma once

#include <algorithm>
#include <limits>

#include <glm/glm.hpp>

namespace rtsg {

struct AcousticBox {
    glm::dvec3 low{std::numeric_limits<double>::infinity()};
    glm::dvec3 high{-std::numeric_limits<double>::infinity()};

    bool empty() const { return !(low.x <= high.x); }
    void extend(const glm::dvec3& point) {
        low = glm::min(low, point);
        high = glm::max(high, point);
    }
    void extend(const AcousticBox& box) {
        low = glm::min(low, box.low);
        high = glm::max(high, box.high);
    }
    /// Whether the two boxes have a point in common.
    bool meets(const AcousticBox& box) const {
        return low.x <= box.high.x && box.low.x <= high.x && low.y <= box.high.y && box.low.y <= high.y &&
               low.z <= box.high.z && box.low.z <= high.z;
    }
    /// Distance from a point to the nearest point of the box; 0 inside.
    double distance(const glm::dvec3& point) const {
        return glm::length(glm::max(glm::max(low - point, point - high), glm::dvec3(0)));
    }
    /// Whether the segment between two points comes nearer to the box than `margin` along every axis.
    bool meetsSegment(const glm::dvec3& from, const glm::dvec3& to, double margin) const {
        double first = 0, last = 1;
        for (int i = 0; i < 3; ++i) {
            const double distance = to[i] - from[i], below = low[i] - margin - from[i],
                         above = high[i] + margin - from[i];
            if (distance == 0) {
                if (below > 0 || above < 0) return false;
                continue;
            }
            first = std::max(first, std::min(below / distance, above / distance));
            last = std::min(last, std::max(below / distance, above / distance));
        }
        return first <= last;
    }
};

}  // namespace rtsg
