// Clusters: the triangles of a group in groups of sixteen, in the order of their meshes, with a box each.
//
// Pictures use them in place of a tree: they need two bytes a triangle and are made in one pass. If neighbours in the
// list are not neighbours in space, the boxes help little; so count before you use them.
// Threading: immutable once made.
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg::bvh {

class Group;

struct Cluster {
    static constexpr std::uint32_t kTriangles = 16;
    Vec3f lower;
    std::uint32_t mesh;  // the group's local number
    Vec3f upper;
    std::uint32_t first;  // of its triangles
};

/// The triangles of a cluster, in the group's frame.
struct ClusteredMesh {
    const Vec3f* positions = nullptr;  // 16 bytes may be read at each
    const std::int32_t* triangles = nullptr;
    std::uint32_t stride = 3, count = 0;
};

struct Clusters {
    explicit Clusters(const Group& group);
    std::vector<Cluster> all;
    std::vector<ClusteredMesh> meshes;  // by local number
};

}  // namespace rtsg::bvh
