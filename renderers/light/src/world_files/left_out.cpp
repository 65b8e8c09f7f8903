// Counts lines, points, skies and the like, of which there is nothing in a mesh file.
#include "left_out.h"

#include <map>

#include <rtsg/core/x3d.h>

namespace rtsg::mesh_files {

void reportLeftOut(const Scene& scene, const Shapes& shapes, bool isGlb, Diagnostics& diagnostics) {
    std::map<std::string, std::size_t> counts;
    for (const Instance& instance : shapes.flattener.instances()) {
        if (!instance.id || !instance.seen || instance.boundingBox) continue;
        if (instance.volume) ++counts["volumes"];
        const auto found = shapes.meshes.find(instance.geometry.value);
        if (found == shapes.meshes.end() || !found->second || found->second->strokeCount == 0) continue;
        ++counts[found->second->strokes == Mesh::Strokes::points ? "shapes of points" : "shapes of lines"];
    }
    // What a file of triangles alone is for has none of the rest, which nobody expects there.
    if (isGlb)
        scene.forEachNode([&](const Node& node) {
            const bool isSky = node.is(x3d::Background::type) || node.is(x3d::TextureBackground::type);
            if (isSky || node.is(x3d::Fog::type) || node.is(x3d::LocalFog::type) || node.is(x3d::ClipPlane::type) ||
                node.is(x3d::EnvironmentLight::type) || node.is(x3d::TextureProjector::type) ||
                node.is(x3d::TextureProjectorParallel::type) || node.is(x3d::Sound::type) ||
                node.is(x3d::SpatialSound::type) || node.is(x3d::LayerSet::type) || node.is(x3d::Billboard::type) ||
                node.is(x3d::LOD::type))
                ++counts[node.type().name];
            if (node.is(x3d::NavigationInfo::type) && !node.get(x3d::NavigationInfo::headlight))
                ++counts["headlights that are off"];
            if ((node.is(x3d::PointLight::type) && node.get(x3d::PointLight::attenuation) != Vec3f(0, 0, 1)) ||
                (node.is(x3d::SpotLight::type) && node.get(x3d::SpotLight::attenuation) != Vec3f(0, 0, 1)))
                ++counts["lights that weaken otherwise than by the square of the distance"];
        });
    std::string all;
    for (const auto& [what, count] : counts)
        all += fmt::format("{}{}{}", all.empty() ? "" : ", ", what, count > 1 ? fmt::format(" ({})", count) : "");
    if (!all.empty()) diagnostics.warning({}, "left out of the file, which has none of these: " + all);
}

}  // namespace rtsg::mesh_files
