// Lamps: the PointLights and SpotLights of the whole scene, where they are so many that each surface asks one of them,
// chosen by a tree, in place of all.
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
    struct Choice {
        const TraceLight* light = nullptr;  // null: none can shine there
        float probability = 0;
    };
    /// As LightTree::sample().
    Choice sample(const Vec3f& point, const Vec3f& normal, float u) const {
        const LightTree::Choice choice = tree_.sample(point, normal, u);
        if (choice.thing == LightTree::kNone) return {};
        return {&lights_[choice.thing], choice.probability};
    }

  private:
    std::vector<TraceLight> lights_;
    LightTree tree_;
};

}  // namespace rtsg::trace
