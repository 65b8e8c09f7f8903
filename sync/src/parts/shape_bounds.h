// Boxes about what nodes draw, from the fields alone: nothing is tessellated for them.
//
// A box holds all that is drawn but what skins and displacers bend, which counts as it stands in its fields. In metres,
// in double. Threading: the scene's thread.
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
    /// The box along the axes about this one, moved.
    ShapeBounds through(const glm::dmat4& matrix) const;
    /// From a point to the nearest of the box; infinite if it is empty.
    double distance(const Vec3d& point) const;
    friend bool operator==(const ShapeBounds&, const ShapeBounds&) = default;
};

/// A node with all that is below it, which comes and goes as a whole.
struct ShapeUnit {
    ShapeBounds box;            // around the node; empty: it draws nothing
    bool isUnbounded = false;   // it has, or may have, an effect anywhere
    std::vector<NodeId> nodes;  // itself and all below it, each once, in order
    friend bool operator==(const ShapeUnit&, const ShapeUnit&) = default;
};

/// Lights, sounds, what can be bound, layers, and what is drawn where the fields do not tell count as unbounded.
ShapeUnit shapeUnit(const Scene& scene, NodeId top);

/// At the end of the list.
template <class T, class Range>
void append(std::vector<T>& list, const Range& more) {
    list.insert(list.end(), more.begin(), more.end());
}

/// The nodes to which place fields (placement.h) and the fields of PROTO instances lead from `node`, not counting
/// those in `except`.
void appendBelow(const Scene& scene, const Node& node, FieldIndex except, std::vector<NodeId>& out);
/// `start` and all below them, each once, in order.
std::vector<NodeId> allBelow(const Scene& scene, std::vector<NodeId> start);

}  // namespace rtsg
