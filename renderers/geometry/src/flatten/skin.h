// Skins: the points and normals of skinned humanoids, from the rest pose and the joints, and the points of segments
// that have displacers.
//
// A point of skinCoord is the rest point p, moved by each joint that lists it: p + sum of w (M p - p), where M is the
// joint's transform in the humanoid, composed along the skeleton, and w its skinCoordWeight. So a point that no joint
// lists stays, and weights that sum to 1 give linear blend skinning. Displacers of a joint add their weighted
// displacements, in its frame. Computed in double; the rest points are skinBindingCoords, or skinCoord's own. The
// normals of skinNormal (at rest those of skinBindingNormals) turn likewise, if there is one to each point. The points
// of a segment's coord are moved by its own displacers alone.
// Not modelled: jointBindingPositions, -Rotations and -Scales (at rest all joints have identity transforms).
// Invariant: what is kept for a humanoid follows from its nodes alone; work follows the humanoids whose nodes changed.
// Threading: one thread.
// Source: ISO/IEC 19774-1:2019 4.8 (skin); ISO/IEC 19775-1 V4.0 26.3.1 to 26.3.3, 26.3.5.
#pragma once

#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

#include "flattener_roles.h"

namespace rtsg {

class Scene;

/// Points and normals that stand for those of a coordinate or normal node, by its NodeId.
using PointsOf = std::unordered_map<std::uint32_t, Array<Vec3f>>;

namespace flatten {

class Skins {
  public:
    /// A joint, a segment, a displacer, a humanoid or a node that it refers to has changed. Finds the skins that it
    /// moves.
    void mark(const Scene& scene, NodeId node);
    /// Computes the marked skins anew. Appends the coordinate and normal nodes whose values have changed, and to
    /// `problems` the references to points that do not exist.
    void update(const Scene& scene, RoleTable& roles, std::vector<NodeId>& changed, Diagnostics& problems);
    /// Forgets everything and marks every humanoid and segment of the scene.
    void startOver(const Scene& scene);
    const PointsOf& points() const { return points_; }

  private:
    /// A humanoid or segment.
    struct Body {
        NodeId coordinate, normal;  // whose points and vectors it moves; none: of none
        bool marked = false;
    };
    void compute(const Scene& scene, RoleTable& roles, NodeId id, Body& body, std::vector<NodeId>& changed,
                 Diagnostics& problems);
    void letGo(NodeId& moved, std::vector<NodeId>& changed);
    void put(NodeId& moved, NodeId node, Array<Vec3f> values, std::vector<NodeId>& changed);

    std::map<std::uint32_t, Body> bodies_;  // by NodeId, in order: of two that share a coordinate the later wins
    PointsOf points_;
    std::vector<std::uint32_t> marked_;
    std::vector<NodeId> climbing_;
};

}  // namespace flatten
}  // namespace rtsg
