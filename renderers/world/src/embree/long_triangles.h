// LongTriangles: cuts long slanting triangles into pieces for Embree, and maps hits back to the whole triangles.
//
// The box of a beam that runs from one corner of a hall to another is the hall, and so are its triangles': every ray
// tests them all. Embree's builder cuts boxes (RTC_BUILD_QUALITY_HIGH), but ignores that where rays must not slip
// through (RTC_SCENE_FLAG_ROBUST), and what it cuts is not rounded outwards. So edges are cut here, at the same points
// for all triangles that share them: no seams come up, and boxes hold all of their pieces. Edges of one triangle alone
// stay whole: another mesh may begin there. The new points are corners, though, with what Embree says of rays that
// meet a corner to the last bit (RayWorld.ClosedSurfacesDoNotLeak).
// Invariant: corners of pieces lie within half a unit in the last place of where they are on their triangle.
// Threading: immutable once made. Source: Ernst, Greiner 2007 (early split clipping), with edges in place of boxes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include <rtsg/renderers/mesh.h>

namespace rtsg::bvh {

/// The triangles that Embree reads in place of a mesh, and the meaning of a hit on them. The first triangles are the
/// mesh's own; those that are cut have corner indices beyond all points there, so that Embree leaves them out. The
/// pieces follow.
struct LongTriangles {
    struct Piece {
        std::uint32_t triangle;
        float u[3], v[3];  // of its corners on the triangle: multiples of a power of two, exact
        Vec3f normal;      // the whole triangle's, towards its front, of any length
    };
    Array<Vec3f> positions;  // the mesh's, and those where edges were cut
    Array<std::int32_t> corners;
    std::uint32_t wholes = 0;  // triangles of the mesh
    std::vector<Piece> pieces;

    std::uint32_t count() const { return wholes + static_cast<std::uint32_t>(pieces.size()); }
    std::size_t bytes() const {
        return positions.size() * sizeof(Vec3f) + corners.size() * sizeof(std::int32_t) + pieces.size() * sizeof(Piece);
    }
    std::uint32_t triangleOf(std::uint32_t number) const {
        return number < wholes ? number : pieces[number - wholes].triangle;
    }
    /// Puts a hit on a piece on its triangle.
    void restore(std::uint32_t& number, float& u, float& v, float& normalX, float& normalY, float& normalZ) const {
        if (number < wholes) return;
        const Piece& piece = pieces[number - wholes];
        const float w = 1 - u - v;
        const auto at = [&](const float* corner) { return w * corner[0] + u * corner[1] + v * corner[2]; };
        const float u0 = std::max(at(piece.u), 0.0f), v0 = std::max(at(piece.v), 0.0f);
        number = piece.triangle, u = u0, v = v0;
        normalX = piece.normal.x, normalY = piece.normal.y, normalZ = piece.normal.z;
    }
};

/// Null where it would not pay: rays meet few boxes in vain, or edges of one triangle alone are in the way.
/// `positions`: those of the mesh, or as many in another frame.
std::shared_ptr<const LongTriangles> cutLongTriangles(const Mesh& mesh, const Array<Vec3f>& positions);

}  // namespace rtsg::bvh
