// Rotations, vectors and names that several parts of the import of glTF need.
#include "gltf_parts.h"

#include <cmath>

namespace rtsg::detail {

Rotation rotationOf(const double* q) {
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    Rotation result;
    if (sine == 0) return result;
    result.x = static_cast<float>(q[0] / sine);
    result.y = static_cast<float>(q[1] / sine);
    result.z = static_cast<float>(q[2] / sine);
    result.angle = static_cast<float>(2 * std::atan2(sine, q[3]));
    return result;
}

Vec3f vectorOf(const std::vector<double>& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

std::string defOfGltfNode(std::size_t node) {
    return "node" + std::to_string(node);
}

std::string defOfGltfPoints(std::size_t node, std::size_t part) {
    return defOfGltfNode(node) + "_points" + std::to_string(part);
}

}  // namespace rtsg::detail
