// Rotations, vectors and names that several parts of the import of glTF need.
#include "gltf_parts.h"

#include <cmath>

#include <rtsg/core/portable_math.h>

namespace rtsg::detail {

Rotation rotationOf(const double* q) {
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    Rotation result;
    if (sine == 0) return result;
    result.x = static_cast<float>(q[0] / sine);
    result.y = static_cast<float>(q[1] / sine);
    result.z = static_cast<float>(q[2] / sine);
    result.angle = static_cast<float>(2 * portable::atan2(sine, q[3]));
    return result;
}

Vec3f vectorOf(const std::vector<double>& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

namespace {

/// Where a list is in the file, how its items are called without names, and which attribute distinguishes items of the
/// same name.
struct Kind {
    const char* list;
    const char* kind;
};
constexpr std::array<Kind, 7> kKinds{{{"nodes", "node"},
                                      {"animations", "animation"},
                                      {"meshes", "mesh"},
                                      {"materials", "material"},
                                      {"cameras", "camera"},
                                      {"lights", "light"},
                                      {"textures", "texture"}}};

}  // namespace

GltfNames::GltfNames(const GltfFile& file) {
    using nlohmann::json;
    const json& punctual = GltfFile::object(GltfFile::object(file.root(), "extensions"), "KHR_lights_punctual");
    // Authors' names go first, so that none of them has to give way to one that was made up.
    for (std::size_t k = 0; k < kKinds.size(); ++k) {
        const bool lights = static_cast<List>(k) == List::lights;
        for (const json& one : GltfFile::list(lights ? punctual : file.root(), kKinds[k].list)) {
            const std::string name = one.is_object() ? GltfFile::text(one, "name") : std::string();
            const bool isNode = static_cast<List>(k) == List::nodes;
            names_[k].push_back({unique_.take(name, isNode ? "" : kKinds[k].kind), !name.empty()});
        }
    }
    for (std::size_t k = 0; k < kKinds.size(); ++k)
        for (std::size_t i = 0; i < names_[k].size(); ++i)
            if (!names_[k][i].isAuthored) names_[k][i].def = unique_.take(kKinds[k].kind + std::to_string(i));
}

std::string GltfNames::authoredOnce(List list, std::size_t index) {
    Name& name = of(list)[index];
    return name.isAuthored && !std::exchange(name.isGiven, true) ? name.def : std::string();
}

const std::string& GltfNames::points(std::size_t node, std::size_t part) {
    std::string& name = points_[{node, part}];
    if (name.empty()) name = take(of(List::nodes, node) + "_points" + std::to_string(part));
    return name;
}

}  // namespace rtsg::detail
