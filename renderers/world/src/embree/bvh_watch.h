// BvhWatch: tells how far refits have spoilt a mesh's BVH, without looking into Embree's own.
//
// Embree shows no nodes, so its builder is run once more over the same triangles, down to leaves of 16, and the areas
// of these boxes are followed. Their sum over the root's is the number of nodes a ray is expected to meet; on a knot, a
// cylinder and a room, twisted, waved, flattened and back, that of a new tree over that of the refitted one was within
// .07 of the ratio of ray speeds (within .25 where scattering makes huge triangles). The sum of a new tree is not known
// beforehand, so the change of the boxes' shares is watched, summed without sign: nothing spoils a tree without
// changing it. Rays ran at .9 of a rebuilt tree's speed at a change of .11 to .3, at .8 at .24 to .5. Invariant: a look
// does not depend on scale or place. Threading: look() on one thread at a time. Source: the surface area heuristic
// (Goldsmith and Salmon 1987); the signless change is ours.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "embree.h"

#include <rtsg/renderers/mesh.h>

namespace rtsg::bvh {

class BvhWatch {
  public:
    /// Watches a mesh, from its present state on.
    BvhWatch(RTCDevice device, const Mesh& mesh);

    struct Look {
        double cost = 0;  // number of nodes a ray is expected to meet, but for a factor
        /// Since the tree was built, in parts of its cost then or now, whichever is less: so one built over a tangle is
        /// found out when the mesh untangles. Infinite for a mesh that was built as a point.
        double change = 0;
    };
    /// With other positions for the same triangles.
    Look look(const Array<Vec3f>& positions) const;

    double builtCost() const { return builtCost_; }
    /// The cost of a look, as the number of positions that it reads.
    std::size_t size() const { return vertices_.size(); }

  private:
    double findAreas(const Array<Vec3f>& positions) const;

    // Children before their parents, the root last.
    std::vector<std::uint8_t> children_;  // per node; 0: a leaf
    std::vector<std::uint32_t> leafEnd_;  // per leaf, in vertices_
    std::vector<std::uint32_t> vertices_;
    std::vector<float> fraction_;      // per node: of the root's area, when built
    mutable std::vector<float> area_;  // per node, of the last look
    double builtCost_ = 0;
};

}  // namespace rtsg::bvh
