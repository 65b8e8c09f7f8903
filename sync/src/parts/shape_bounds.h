// ShapeBounds: boxes around what nodes draw, computed from fields alone, without tessellation.
//
// A box holds everything that is drawn. Skins and displacers count in the shape that their fields have. In metres, in
// double.
// Threading: the scene's thread.
#pragma once

#include <limits>
#include <vector>

#include <glm/mat4x4.hpp>

#include <rtsg/core/scene.h>

namespace rtsg {

struct ShapeBounds {
    Vec3d low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};

    bool empty() const { return !(low.x <= high.x && low.y <= high.y && low.z <= high.z); }
    void add(const Vec3d& point) {
        low = glm::min(low, point);
        high = glm::max(high, point);
    }
    void add(const ShapeBounds& other) {
        low = glm::min(low, other.low);
        high = glm::max(high, other.high);
    }
    /// The box, parallel to the axes, around this box after the transform.
    ShapeBounds through(const glm::dmat4& matrix) const;
    /// The distance from a point to the nearest point of the box. Infinite if the box is empty.
    double distance(const Vec3d& point) const;
    friend bool operator==(const ShapeBounds&, const ShapeBounds&) = default;
};

/// A node with all nodes below it, which enters and leaves as a whole.
struct ShapeUnit {
    ShapeBounds box;            // the box around the node; empty if it draws nothing
    bool isUnbounded = false;   // it has, or may have, an effect anywhere
    std::vector<NodeId> nodes;  // the node and all below it, each once, in order
    friend bool operator==(const ShapeUnit&, const ShapeUnit&) = default;
};

/// Lights, sounds, bindable nodes, layers, and geometry whose fields do not tell count as unbounded.
ShapeUnit shapeUnit(const Scene& scene, NodeId top);

/// Appends `more` to the list.
template <class T, class Range>
void append(std::vector<T>& list, const Range& more) {
    list.insert(list.end(), more.begin(), more.end());
}

/// Appends the nodes to which `node` leads by placement fields (placement.h) and fields of PROTO instances, except
/// those in `except`.
void appendBelow(const Scene& scene, const Node& node, FieldIndex except, std::vector<NodeId>& out);
/// The `start` nodes and all below them, each once, in order.
std::vector<NodeId> allBelow(const Scene& scene, std::vector<NodeId> start);

}  // namespace rtsg
