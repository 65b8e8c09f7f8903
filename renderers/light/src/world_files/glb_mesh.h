// The vertices of a mesh as a GLB file has them: each once, with one number for all of its attributes.
//
// Nothing is copied that the mesh has itself: values are read from it again when they are written, so the mesh must
// live until then. Threading: one thread a file. Source: glTF 2.0 3.7.2 (meshes without normals are flat).
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/renderers/mesh.h>

#include "shown_shapes.h"

namespace rtsg::mesh_files {

class GlbMesh {
  public:
    /// `channel`: of the texture coordinates. They are left out if neither a texture nor the author asks for them.
    GlbMesh(const Mesh& mesh, std::size_t channel, bool isTextured);

    std::size_t vertexCount() const { return isWhole_ ? mesh_.positions.size() : corners_.size(); }
    std::size_t indexCount() const { return std::size_t{mesh_.triangleCount} * 3; }
    bool hasNormals() const { return mesh_.normals.present(); }
    bool hasTexCoords() const { return hasTexCoords_; }
    bool hasColors() const { return mesh_.colors.present(); }
    /// Whether 16 bits are enough for the numbers of vertices.
    bool isSmall() const { return vertexCount() < 0xFFFF; }
    const Bounds& bounds() const { return bounds_; }

    void writePositions(Output& out) const;
    void writeNormals(Output& out) const;
    /// Calls for each vertex in order.
    template <class Visit>
    void forEachTexCoord(const Visit& visit) const {
        forEachVertex([&](std::uint32_t t, std::uint32_t c) { visit(texCoordAt(t, c)); });
    }
    template <class Visit>
    void forEachColor(const Visit& visit) const {
        forEachVertex([&](std::uint32_t t, std::uint32_t c) { visit(mesh_.color(t, weightU(c), weightV(c))); });
    }
    void writeIndices(Output& out) const;

  private:
    static float weightU(std::uint32_t corner) { return corner == 1 ? 1.0f : 0.0f; }
    static float weightV(std::uint32_t corner) { return corner == 2 ? 1.0f : 0.0f; }
    /// One triangle's corner of each vertex.
    template <class Visit>
    void forEachVertex(const Visit& visit) const {
        for (const std::uint32_t corner : corners_) visit(corner / 3, corner % 3);
    }
    Vec3f normalAt(std::uint32_t triangle, std::uint32_t corner) const {
        return mesh_.shadingNormal(triangle, weightU(corner), weightV(corner));
    }
    Vec4f texCoordAt(std::uint32_t triangle, std::uint32_t corner) const {
        return mesh_.texCoord(triangle, weightU(corner), weightV(corner), channel_);
    }
    void join();

    const Mesh& mesh_;
    const std::size_t channel_;
    bool hasTexCoords_ = false;
    bool isWhole_ = false;                // the mesh's own points are the vertices, and its own triangles the triangles
    std::vector<std::uint32_t> corners_;  // by vertex: 3 * triangle + corner
    std::vector<std::uint32_t> vertices_;  // by 3 * triangle + corner
    Bounds bounds_;
};

}  // namespace rtsg::mesh_files
