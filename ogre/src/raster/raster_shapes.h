// Converts meshes for a rasteriser.
//
// Threading: re-entrant.
#pragma once

#include <memory>
#include <vector>

#include <rtsg/renderers/mesh.h>

#include "raster_module.h"

namespace rtsg {

struct RasterArrays {
    std::vector<RasterVertex> vertices;
    std::vector<RasterLook> looks;
    std::vector<RasterStroke> strokes;
    std::vector<std::uint32_t> indices;
    Bounds bounds;
    RasterMesh view() const { return {vertices, looks, strokes, indices, bounds.min, bounds.max}; }
};

/// `channel`: of the texture coordinates.
RasterArrays rasterArrays(const Mesh& mesh, std::size_t channel);

/// From which corners the vertices of a mesh that deforms come, so that those of the next mesh are found at once.
/// Corners share a vertex where the mesh's indices say so, not where numbers are equal by chance.
class RasterCorners {
  public:
    /// All arrays of a mesh, with its vertices in that order.
    RasterArrays start(std::shared_ptr<const Mesh> mesh, std::size_t channel);
    /// Sets `out` to the parts of the mesh that differ from the last one: positions, and texture coordinates and
    /// colours if they differ. Returns false if the mesh must be uploaded as a whole.
    bool next(std::shared_ptr<const Mesh> mesh, std::size_t channel, RasterArrays& out);

  private:
    std::shared_ptr<const Mesh> mesh_;    // the last one
    std::vector<std::uint32_t> corners_;  // of each vertex: 3 times the triangle, and which of its corners
};

}  // namespace rtsg
