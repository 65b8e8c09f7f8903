// LargeTriangles: the few large triangles of a world (walls and floors), which are all tested against sixteen rays at a
// time, and boxes around everything else.
//
// Rays from anywhere hit a box in proportion to its surface. So if the boxes are small, most rays of bouncing light are
// answered without a tree. The answers are Embree's, except for the last bits. A ray stays open, and must be traced, if
// it may hit anything else, or if rounding might decide: near an edge, near a plane of its start, or near another
// triangle at the same distance. Invariant: bit for bit the same on any processor. Threading: immutable once
// constructed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include <rtsg/renderers/ray.h>

#include "trees/tree_view.h"

namespace rtsg::bvh {

class Group;

/// A place is `corner + u * second + v * third`, for the u and v of LargeHits::faces, off by no more than `error`.
struct alignas(64) LargeSpot {
    float corner[3], red, second[3], green, third[3], blue, error[3], unused;  // colours: About::color
};

/// The table that the kernels read: parallelograms of two triangles each, as most walls are, then single triangles.
struct LargeTable {
    static constexpr std::size_t kFaces = 32, kBoxes = 8;
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;
    /// A place is `corner + x * (second - corner) + y * (third - corner)`. The first triangle is where x + y is at most
    /// 1, the other one beyond.
    struct Face {
        float corner[3], normal[3];  // unit; of the front
        float x[3], y[3];            // of places from the corner
        float steepest;              // how fast a weight changes, 1/m
        std::uint32_t sides;         // that nothing comes through
    };
    Face faces[kFaces];
    LargeSpot spots[kFaces];
    float lower[kBoxes][3], upper[kBoxes][3];
    float middle[kBoxes][3], radiusSquared[kBoxes];  // of a ball around the content of the box
    std::uint32_t convex[kBoxes];                    // the instance that is all of it and bulges everywhere; else kNone
    std::uint32_t pairCount = 0, faceCount = 0, boxCount = 0;  // pairs: parallelograms
    float size = 0;                                            // metres, of the largest sum of coordinates
    // The data that a hit reports.
    alignas(64) float normal[3][kFaces];  // as Hit::normal
    float mirrored[kFaces];               // -1: merged triangles are inside out there
    float corner[2][kFaces];              // of each of the two: the place of `corner`, or of the one opposite, in it
    float number[2][kFaces];              // bits of integers, like the members below
    float geometry[kFaces], instance[kFaces], label[kFaces];
};

/// Sixteen rays where they lie.
struct RayRows {
    const float *origin[3], *direction[3];
    const float* front;  // bits of the instances whose front they leave, or kNone; null: nobody knows
    float tMin, tMax;
    std::uint32_t lanes;  // a bit each that is asked about
};
/// The results for rays that meet something: hits, and the labels of their instances. `faces` has the same hits by
/// LargeSpots, with their numbers in place of triangles.
struct alignas(64) LargeHits {
    PacketHits16 hits, faces;
    std::int32_t label[16];
};

class LargeTriangles {
  public:
    static constexpr std::uint32_t kFront = 1, kBack = 2;
    /// An instance: the sides through which nothing comes, whether it is mirrored, and its numbers.
    struct About {
        std::uint32_t sides = 0;
        bool isMirrored = false;
        std::int32_t label = 0;
        Vec3f color{0};
    };
    using Visitor = std::function<About(std::uint32_t slot)>;
    /// Null: a tree is quicker. `others`: the rest of the world; `mask`: of the rays.
    static std::unique_ptr<const LargeTriangles> make(const Group& group, const TreeView& others, std::uint32_t mask,
                                                      const Visitor& report);

    /// A bit for each ray that meets one of these first; of the others those of `open` are to be traced, and the rest
    /// meet nothing. `rays` becomes a packet of them, with their hits as Embree sets them.
    std::uint32_t intersect(const RayRows& rows, RayPacket16& rays, LargeHits& hits, std::uint32_t& open) const;
    /// Returns a bit for each ray that is blocked. Other rays that are not in `open` have nothing on their way.
    std::uint32_t occluded(const RayRows& rows, std::uint32_t& open) const;

    const LargeTable& table() const { return table_; }

  private:
    LargeTable table_;
};

/// The kernels for the machine's width of registers.
struct LargeKernels {
    std::uint32_t (*intersect)(const LargeTable& table, const RayRows& rows, RayPacket16& rays, LargeHits& hits,
                               std::uint32_t& open);
    std::uint32_t (*occluded)(const LargeTable& table, const RayRows& rows, std::uint32_t& open);
};
const LargeKernels& largeKernels8();
/// Null where this build or machine has none.
const LargeKernels* largeKernels16();

}  // namespace rtsg::bvh
