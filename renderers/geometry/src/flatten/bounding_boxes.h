// Bounding boxes that X3DBoundedObjects display: how large they are, and the lines that show one.
//
// A box is aligned with the world and goes around where the triangles' corners and the lines' ends are, not around the
// transformed boxes of the meshes: it is the smallest there is, to within double's rounding.
// Source: ISO/IEC 19775-1 V4.0 10.2.2, 10.3.1.
#pragma once

#include <limits>
#include <memory>
#include <optional>

#include <rtsg/renderers/mesh.h>

#include "flattener_roles.h"

namespace rtsg::flatten {

/// Axis-aligned in the world; empty while min > max.
struct WorldBox {
    Vec3d min{std::numeric_limits<double>::infinity()}, max{-std::numeric_limits<double>::infinity()};
    bool empty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
    void extend(const WorldBox& other) { min = glm::min(min, other.min), max = glm::max(max, other.max); }
    void extend(const Vec3d& point) { min = glm::min(min, point), max = glm::max(max, point); }
    friend bool operator==(const WorldBox&, const WorldBox&) = default;
};

/// The bounds of a mesh that is turned and scaled about its origin. They cost nothing if it is only scaled along its
/// axes; otherwise every corner is looked at.
WorldBox boundsOf(const Mesh& mesh, const glm::dmat3& linear);
/// Empty if it is not finite.
WorldBox moved(const WorldBox& box, const Vec3d& by);
/// Both at once.
WorldBox worldBox(const Mesh& mesh, const WorldFromLocal& worldFromLocal);

/// bboxSize and bboxCenter, in the space of the node's children; none if bboxSize is not given (-1 -1 -1).
std::optional<Bounds> authoredBox(const Node& node, const TypeRole& role);
/// Around its transformed corners.
WorldBox worldBox(const Bounds& box, const WorldFromLocal& worldFromLocal);

/// The twelve edges of a cube of side 1 about the origin, as lines. Always the same mesh.
std::shared_ptr<const Mesh> boxEdges();
/// The transform that makes boxEdges() the edges of the box. A box without thickness gets a millionth of its size, so
/// that the transform has an inverse. None if the box is empty or a point.
std::optional<WorldFromLocal> transformOfEdges(const WorldBox& box);

/// The instance that shows a box of `owner` there.
Instance edgesInstance(const Scene& scene, NodeId owner, const WorldFromLocal& worldFromLocal);

}  // namespace rtsg::flatten
