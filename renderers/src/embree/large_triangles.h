// LargeTriangles: the few large triangles of a world, walls and floors, of which all are asked sixteen rays at a time,
// and boxes around everything else.
//
// A ray from anywhere to anywhere meets a box about as often as the box's surface is large, so where that is small most
// rays of light that bounces are answered without any tree. What is told is what Embree would tell, but for the last
// bits: a ray that runs so near an edge, a plane of its start or another triangle of the same distance that roundings
// might decide stays open, as one does that may meet anything else, and is to be traced.
// Invariant: bit for bit the same on any processor. Threading: immutable once made.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include <rtsg/renderers/ray.h>

#include "tree_view.h"

namespace rtsg::bvh {

class Group;

/// As the kernels read it: triangles plane by plane, two of a rectangle on one of them.
struct LargeTable {
    static constexpr std::size_t kTriangles = 32, kBoxes = 8;
    struct Plane {
        float corner[3], normal[3];  // unit; of the front
        std::uint32_t end;           // of its triangles
    };
    /// The weights of the second and the third corner at a place, from the plane's corner.
    struct Triangle {
        float second[4], third[4];  // the last number is that at the plane's corner
        float steepest;             // how fast a weight changes, 1/m
        std::uint32_t sides;        // that nothing comes through
    };
    Plane planes[kTriangles];
    Triangle triangles[kTriangles];
    float lower[kBoxes][3], upper[kBoxes][3];
    std::uint32_t planeCount = 0, triangleCount = 0, boxCount = 0;
    float size = 0;  // metres, of the largest sum of coordinates
    // Of triangles, what is told of a hit.
    alignas(64) float normal[3][kTriangles];
    alignas(64) float geometry[kTriangles], number[kTriangles];  // bits of integers
};

class LargeTriangles {
  public:
    static constexpr std::uint32_t kFront = 1, kBack = 2;
    /// Sides of an instance, by slot, that nothing comes through.
    using Sides = std::function<std::uint32_t(std::uint32_t slot)>;
    /// Null: a tree is quicker. `others`: what else there is; `mask`: of the rays.
    static std::unique_ptr<const LargeTriangles> make(const Group& group, const TreeView& others, std::uint32_t mask,
                                                      const Sides& sides);

    /// Of the rays that are active: a bit for each that meets one of these first, whose hit is then set as Embree sets
    /// it; of the others those of `open` are to be traced, and the rest meet nothing.
    std::uint32_t intersect(RayPacket16& rays, std::uint32_t& open) const;
    /// The same of what lies on their way: a bit for each that cannot come through. Of the others those that are not
    /// in `open` have nothing on their way.
    std::uint32_t occluded(const RayPacket16& rays, std::uint32_t& open) const;

    const LargeTable& table() const { return table_; }

  private:
    struct Member;
    void add(const Member& member, std::uint32_t sides);
    void add(const TreeView::Box& box);

    LargeTable table_;
};

/// What the machine's registers do for them.
struct LargeKernels {
    std::uint32_t (*intersect)(const LargeTable& table, RayPacket16& rays, std::uint32_t& open);
    std::uint32_t (*occluded)(const LargeTable& table, const RayPacket16& rays, std::uint32_t& open);
};
const LargeKernels& largeKernels8();
/// Null where this build or machine has none.
const LargeKernels* largeKernels16();

}  // namespace rtsg::bvh
