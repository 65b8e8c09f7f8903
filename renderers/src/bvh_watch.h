// BvhWatch: tells how far refits have spoilt a mesh's BVH, without looking into Embree's own.
//
// Embree shows no nodes, so its builder is run once more over the same triangles, down to leaves of 16, and the areas
// of these boxes are followed. Their sum over the root's is the expected number of nodes that a ray meets. Measured on
// a knot, a cylinder and a room of 5 k to 100 k triangles, twisted, waved, scattered, flattened and back: the sum after
// rebuilding over the sum after refitting is within .07 of the ratio of the rays' real speeds (within .25 where
// scattering makes huge triangles, and then it cries wolf, not the other way round). The sum to be had by rebuilding is
// not known before, and may fall while the sum of the old tree falls, too. So what is watched is the change of the
// boxes' shares, summed without sign: nothing spoils a tree without changing it. Rays ran at .9 of a rebuilt tree's
// speed at a change of .11 to .3, at .8 at .24 to .5, at .5 at 1 to 3. Threading: look() on one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <embree3/rtcore.h>

#include <rtsg/renderers/mesh.h>

namespace rtsg::bvh {

class BvhWatch {
  public:
    /// Of the mesh as it is now.
    BvhWatch(RTCDevice device, const Mesh& mesh);

    struct Look {
        double cost = 0;  // expected number of nodes that a ray meets, but for a factor
        double change =
            0;  // since the tree was built, in parts of the cost then; infinite for a mesh back from a point
    };
    /// With other positions for the same triangles. Does not depend on scale or place.
    Look look(const Array<Vec3f>& positions) const;

    double builtCost() const { return builtCost_; }
    /// What a look costs, as the number of positions that it reads.
    std::size_t size() const { return vertices_.size(); }

  private:
    double findAreas(const Array<Vec3f>& positions) const;

    // Children before their parents, the root last.
    std::vector<std::uint8_t> children_;  // per node; 0: a leaf
    std::vector<std::uint32_t> leafEnd_;  // per leaf, in vertices_
    std::vector<std::uint32_t> vertices_;
    std::vector<float> share_;         // per node: of the root's area, when built
    mutable std::vector<float> area_;  // per node, of the last look
    double builtCost_ = 0;
};

}  // namespace rtsg::bvh
