// Clusters: one pass over the triangles of a group.
#include "clusters.h"

#include <algorithm>

#include "bvh.h"

namespace rtsg::bvh {

Clusters::Clusters(const Group& group) {
    all.reserve(group.triangles() / Cluster::kTriangles + group.live());
    group.forEachAttached([&](std::uint32_t local, const Triangles& from) {
        const Mesh& mesh = *from.mesh;
        if (meshes.size() <= local) meshes.resize(local + std::size_t{1});
        meshes[local] = {from.positions.data(), mesh.triangles.data(), mesh.triangleStride, mesh.triangleCount};
        for (std::uint32_t first = 0; first < mesh.triangleCount; first += Cluster::kTriangles) {
            Bounds box;
            const std::uint32_t end = std::min(first + Cluster::kTriangles, mesh.triangleCount);
            for (std::uint32_t t = first; t < end; ++t)
                for (std::uint32_t c = 0; c < 3; ++c) box.extend(from.positions[mesh.vertexIndex(t, c)]);
            all.push_back({box.min, local, box.max, first});
        }
    });
}

}  // namespace rtsg::bvh
