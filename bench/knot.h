// A knotted tube whose coordinates change every frame: the paper's Escherknot, as near as its description allows.
//
// A (3, 2) torus knot; a TimeSensor drives a CoordinateInterpolator, whose keys wind and swell the tube and end as they
// began. Nothing but the coordinates changes: triangles, texture coordinates and creases stay.
#pragma once

#include <rtsg/core/scene.h>

namespace rtsg::bench {

struct KnotOptions {
    /// About so many; the paper's has 4,600.
    int triangles = 4600;
    /// Keys of the interpolator, the last equal to the first.
    int keys = 9;
    /// Seconds for a round.
    double seconds = 4;
    /// Radians a metre of height is wound by at most.
    float twist = 1.5f;
    /// The creaseAngle of the IndexedFaceSet; 0 leaves it faceted, 2 rounds it.
    float creaseAngle = 2;
    /// Faces of four corners instead of triangles.
    bool quads = false;
};

/// The nodes that were built; the shape is a child of `parent` (a grouping node, or the scene's root for none).
struct Knot {
    NodeId shape, faces, coordinate, interpolator, clock;
};
Knot addKnot(Scene& scene, const KnotOptions& options = {}, NodeId parent = {});

/// The tube's points at one phase (0 ... 1) of the round; `around` times `along` of them.
Array<Vec3f> knotPoints(const KnotOptions& options, float phase);

}  // namespace rtsg::bench
