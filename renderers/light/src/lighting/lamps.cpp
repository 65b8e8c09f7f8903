// Chooses the lights that are lamps, and their data for the tree.
#include "lamps.h"

#include <algorithm>
#include <cmath>

namespace rtsg::trace {

Lamps::Lamps(LightGroups& groups) {
    LightGroups::Group& whole = groups.groups[0];  // its lights are the last ones
    const auto first = groups.lights.begin() + whole.first;
    const auto isLamp = [](const TraceLight& light) {
        return light.kind == Light::Kind::point || light.kind == Light::Kind::spot;
    };
    if (static_cast<std::size_t>(std::count_if(first, groups.lights.end(), isLamp)) <= kFew) return;
    const auto lamps =
        std::stable_partition(first, groups.lights.end(), [&](const TraceLight& l) { return !isLamp(l); });
    lights_.assign(lamps, groups.lights.end());
    groups.lights.erase(lamps, groups.lights.end());
    whole.count = static_cast<std::uint32_t>(groups.lights.size()) - whole.first;

    std::vector<LightTree::Cluster> clusters;
    for (const TraceLight& light : lights_) {
        LightTree::Cluster cluster;
        cluster.bounds.extend(light.position);
        cluster.axis = light.direction;
        // A cone that is no wider than a half space needs no other bound.
        cluster.cosCone = light.kind == Light::Kind::spot && light.cutOffAngle < 1.57f ? 1.0f : -1.0f;
        const float power = std::max({light.color.x, light.color.y, light.color.z});
        cluster.power = std::isfinite(power) ? std::clamp(power, 0.0f, 1e20f) : 0.0f;
        const float scale = light.localFromWorld;
        cluster.falloff = light.attenuation * Vec3f(1, scale, scale * scale);
        clusters.push_back(cluster);
    }
    tree_ = LightTree(clusters, 1);
}

}  // namespace rtsg::trace
