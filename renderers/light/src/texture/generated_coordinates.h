// Texture coordinates that depend on who looks, and noise: the modes of TextureCoordinateGenerator.
//
// They are made at each hit, from its own normal; rasterisers make them at the corners. `parameter` is as in 18.4.8. In
// modes of camera space x points to the right, y up, z towards the viewer, and places are relative to the eye.
// Threading: re-entrant. Source: ISO/IEC 19775-1 V4.0 18.4.8; noise as in Perlin 2002 (Improving Noise).
#pragma once

#include <rtsg/renderers/mesh.h>

namespace rtsg::trace {

struct GeneratorInput {
    Vec3f position{0}, normal{0, 0, 1};            // camera space; the normal a unit, on the viewer's side
    Vec3f localPosition{0}, localNormal{0, 0, 1};  // of the shape's own frame
};

/// (s, t, r).
Vec3f generatedCoordinates(const TexCoords& channel, const GeneratorInput& in);

/// In [-1, 1], 0 at whole numbers.
float noiseAt(const Vec3f& at);

}  // namespace rtsg::trace
