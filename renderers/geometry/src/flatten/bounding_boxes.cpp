// Sizes of displayed bounding boxes, and the twelve lines that all of them share.
#include "bounding_boxes.h"

#include <algorithm>
#include <cmath>

namespace rtsg::flatten {

namespace {

/// Whether each axis of the world is along one of the mesh's; then a transformed box fits its content, too.
bool keepsAxes(const glm::dmat3& m) {
    for (int row = 0; row < 3; ++row) {
        int along = 0;
        for (int column = 0; column < 3; ++column) along += m[column][row] != 0;
        if (along > 1) return false;
    }
    return true;
}

void extendByCorners(WorldBox& box, const Bounds& bounds, const glm::dmat3& linear) {
    const Vec3f ends[] = {bounds.min, bounds.max};
    for (int k = 0; k < 8; ++k) box.extend(linear * Vec3d(ends[k & 1].x, ends[k >> 1 & 1].y, ends[k >> 2].z));
}

}  // namespace

WorldBox boundsOf(const Mesh& mesh, const glm::dmat3& linear) {
    WorldBox box;
    const std::uint32_t count = mesh.strokes == Mesh::Strokes::none ? mesh.triangleCount : mesh.strokeCount,
                        corners = mesh.strokes == Mesh::Strokes::none ? 3 : 2;
    if (count == 0 || mesh.bounds.empty()) return box;
    if (keepsAxes(linear)) {
        extendByCorners(box, mesh.bounds, linear);
        return box;
    }
    for (std::uint32_t i = 0; i < count; ++i)
        for (std::uint32_t c = 0; c < corners; ++c) box.extend(linear * Vec3d(mesh.vertex(i, c)));
    return box;
}

WorldBox moved(const WorldBox& box, const Vec3d& by) {
    const WorldBox there{box.min + by, box.max + by};
    const Vec3d sum = there.max - there.min;
    return box.empty() || !std::isfinite(sum.x + sum.y + sum.z) ? WorldBox{} : there;
}

WorldBox worldBox(const Mesh& mesh, const WorldFromLocal& m) {
    return moved(boundsOf(mesh, glm::dmat3(m[0], m[1], m[2])), m[3]);
}

std::optional<Bounds> authoredBox(const Node& node, const TypeRole& role) {
    if (role.bboxSize == kNoField || role.bboxCenter == kNoField) return std::nullopt;
    const Vec3f size = read<Vec3f>(node, role.bboxSize), center = read<Vec3f>(node, role.bboxCenter);
    const float sum = size.x + size.y + size.z + center.x + center.y + center.z;
    if (!(size.x >= 0 && size.y >= 0 && size.z >= 0) || !std::isfinite(sum)) return std::nullopt;
    Bounds box;
    box.min = center - .5f * size, box.max = center + .5f * size;
    return box;
}

WorldBox worldBox(const Bounds& bounds, const WorldFromLocal& m) {
    WorldBox box;
    extendByCorners(box, bounds, glm::dmat3(m[0], m[1], m[2]));
    return moved(box, m[3]);
}

std::shared_ptr<const Mesh> boxEdges() {
    static const std::shared_ptr<const Mesh> edges = [] {
        const auto mesh = std::make_shared<Mesh>();
        std::vector<Vec3f> corners;
        std::vector<std::int32_t> ends;
        for (std::int32_t k = 0; k < 8; ++k) {
            corners.push_back(Vec3f(k & 1, k >> 1 & 1, k >> 2) - .5f);
            mesh->bounds.extend(corners.back());
            for (const std::int32_t axis : {1, 2, 4})
                if (!(k & axis)) ends.insert(ends.end(), {k, k | axis, k | axis});
        }
        mesh->positions = Array<Vec3f>(std::span<const Vec3f>(corners));
        mesh->triangles = Array<std::int32_t>(std::span<const std::int32_t>(ends));
        mesh->strokes = Mesh::Strokes::lines;
        mesh->strokeCount = 12;
        mesh->solid = false;
        return mesh;
    }();
    return edges;
}

std::optional<WorldFromLocal> transformOfEdges(const WorldBox& box) {
    if (box.empty()) return std::nullopt;
    Vec3d size = box.max - box.min;
    const double largest = std::max({size.x, size.y, size.z});
    if (!(largest > 0)) return std::nullopt;
    size = glm::max(size, Vec3d(largest * 0x1p-20));
    return WorldFromLocal(Vec3d(size.x, 0, 0), Vec3d(0, size.y, 0), Vec3d(0, 0, size.z),
                          box.min + .5 * (box.max - box.min));
}

Instance edgesInstance(const Scene& scene, NodeId owner, const WorldFromLocal& worldFromLocal) {
    Instance instance;
    instance.shape = owner;
    instance.geometry = scene.root();
    instance.castShadow = instance.heard = false;
    instance.boundingBox = true;
    instance.worldFromLocal = worldFromLocal;
    return instance;
}

}  // namespace rtsg::flatten
