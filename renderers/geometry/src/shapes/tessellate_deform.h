// DeformingSurface: a composed geometry whose coordinates, and normals with them, change while all else stays.
//
// Invariant: what deform() gives equals what tessellating from scratch gives, triangle for triangle, at the cost of
// what depends on the coordinates: bounds, normals, default texture coordinates. Triangles are the same array
// as before, positions the scene's own. Polygons of more than three corners are cut by where their points are, so each
// is looked at again; when one would be cut otherwise (a quad has become concave, say) deform() declines. Threading:
// one thread.
#pragma once

#include <memory>
#include <unordered_map>
#include <variant>

#include "tessellate_detail.h"

namespace rtsg {
class Node;
class Scene;
}  // namespace rtsg

namespace rtsg::detail {

/// Points and normals that stand for those of a coordinate or normal node, by its NodeId.
using PointsOf = std::unordered_map<std::uint32_t, Array<Vec3f>>;
using ComposedParams = std::variant<IndexedFaceSetParams, PrimitiveSetParams>;

class DeformingSurface {
  public:
    /// Tessellates from scratch, and remembers.
    explicit DeformingSurface(const ComposedParams& params);
    /// The last one made; the caller may add to its diagnostics, which later ones inherit.
    const std::shared_ptr<Mesh>& mesh() const { return mesh_; }

    /// Null when more than the coordinates has changed, or triangles come or go with them.
    std::shared_ptr<Mesh> deform(const ComposedParams& params);

  private:
    ComposedParams params_;
    std::shared_ptr<Mesh> mesh_;  // the last one
    FacePlan plan_;
    PolygonCutter cutter_;
    NormalGenerator normals_;
    bool generatesNormals_ = false;
    bool usesAllPoints_ = false;
};

// ---- in tessellate_scene.cpp ----------------------------------------------------------------------------------------

bool isComposed(const Node& geometry);
/// Precondition: isComposed(). Fields that cannot be used are noted in the diagnostics of `problems`.
ComposedParams readComposed(const Scene& scene, const Node& geometry, Mesh& problems, const PointsOf* points = nullptr);
/// The points of a coordinate node, and none with a word in `problems` if it is of another kind.
Array<Vec3f> readPoints(const Scene& scene, NodeId coordinate, Mesh& problems);
/// Puts the node's type and name before each of the mesh's diagnostics.
void labelDiagnostics(const Scene& scene, const Node& geometry, Mesh& mesh);

/// The dimensions of an X3DVolumeDataNode.
Vec3f volumeSize(const Node& volume);

}  // namespace rtsg::detail
