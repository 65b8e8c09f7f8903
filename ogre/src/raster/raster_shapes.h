// Meshes as a rasteriser wants them.
//
// Threading: re-entrant.
#pragma once

#include <vector>

#include <rtsg/renderers/mesh.h>

#include "raster_module.h"

namespace rtsg {

struct RasterArrays {
    std::vector<RasterVertex> vertices;
    std::vector<RasterStroke> strokes;
    std::vector<std::uint32_t> indices;
    Bounds bounds;
    RasterMesh view() const { return {vertices, strokes, indices, bounds.min, bounds.max}; }
};

/// `channel`: of the texture coordinates.
RasterArrays rasterArrays(const Mesh& mesh, std::size_t channel);

}  // namespace rtsg
