// Lamps: the PointLights and SpotLights of a scene that has so many of them that each surface samples one, chosen by a
// tree.
//
// Threading: const once built.
#pragma once

#include <vector>

#include "light_tree.h"
#include "trace_scene.h"

namespace rtsg::trace {

class Lamps {
  public:
    /// Up to this number all are asked.
    static constexpr std::size_t kFew = 16;

    Lamps() = default;
    /// Takes its lights out of `groups`; none if they are few.
    explicit Lamps(LightGroups& groups);

    bool empty() const { return tree_.empty(); }
    const TraceLight& operator[](std::uint32_t lamp) const { return lights_[lamp]; }
    /// Calls LightTree::sample().
    LightTree::Choices sample(const simd::V8& point, const simd::V8& normal, simd::F8 u, std::uint32_t lanes) const {
        return tree_.sample(point, normal, u, lanes);
    }

  private:
    std::vector<TraceLight> lights_;
    LightTree tree_;
};

}  // namespace rtsg::trace
