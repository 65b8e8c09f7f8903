// ElevationGrid, and grids of points as GeoElevationGrid has them: two triangles a cell.
#include <fmt/format.h>

#include "tessellate_detail.h"

namespace rtsg {

using detail::warn;

namespace {

constexpr std::size_t kMaxFilledHeights = std::size_t{1} << 22;

/// Two triangles a quadrilateral; those with a point that is not finite are left out. `faces`, if it is wanted: the
/// quadrilateral of each triangle.
void cutQuadrilaterals(Mesh& mesh, bool ccw, std::size_t columns, std::size_t rows, Array<std::int32_t>* faces) {
    // Seen from +Y with z downwards, each quadrilateral runs down, right, up: fronts face +Y.
    Array<std::int32_t> triangles = Array<std::int32_t>::ofSize((columns - 1) * (rows - 1) * 6);
    if (faces) *faces = Array<std::int32_t>::ofSize(triangles.size() / 3);
    std::int32_t *out = triangles.mutableData(), *outFace = faces ? faces->mutableData() : nullptr;
    std::size_t count = 0, dropped = 0;
    const std::size_t second = ccw ? 1 : 2, third = ccw ? 2 : 1;
    for (std::size_t j = 0; j + 1 < rows; ++j)
        for (std::size_t i = 0; i + 1 < columns; ++i) {
            const std::size_t a = j * columns + i, b = a + columns, c = b + 1, d = a + 1;
            const std::size_t quad = j * (columns - 1) + i;
            const std::size_t corners[2][3] = {{a, b, c}, {a, c, d}};
            for (const auto& t : corners) {
                if (!detail::usable(mesh.positions[t[0]]) || !detail::usable(mesh.positions[t[1]]) ||
                    !detail::usable(mesh.positions[t[2]])) {
                    ++dropped;
                    continue;
                }
                for (const std::size_t v : {t[0], t[second], t[third]}) {
                    *out++ = static_cast<std::int32_t>(v);
                    mesh.bounds.extend(mesh.positions[v]);
                }
                if (outFace) outFace[count] = static_cast<std::int32_t>(quad);
                ++count;
            }
        }
    if (dropped) warn(mesh, fmt::format("height: {} triangles left out: their points are not finite", dropped));
    triangles.resize(count * 3);
    if (faces) faces->resize(count);
    mesh.triangles = triangles;
    mesh.triangleCount = static_cast<std::uint32_t>(count);
}

}  // namespace

std::size_t detail::gridRowsToDraw(Mesh& mesh, std::size_t given, std::size_t columns, std::size_t rows) {
    if (given / columns >= rows) return rows;
    const bool fill = rows <= kMaxFilledHeights / columns;
    warn(mesh, fmt::format("height has {} values, xDimension {} * zDimension {} needs more: {}", given, columns, rows,
                           fill ? "the others are 0" : "only complete rows are drawn"));
    return fill ? rows : given / columns;
}

Mesh tessellate(const ElevationGridParams& params) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (params.xDimension < 2 || params.zDimension < 2) {
        if (params.xDimension < 0 || params.zDimension < 0)
            warn(mesh, fmt::format("xDimension {} and zDimension {} may not be negative", params.xDimension,
                                   params.zDimension));
        else if (params.xDimension > 0 && params.zDimension > 0)
            warn(mesh, fmt::format("xDimension {} and zDimension {} make no faces: nothing is drawn", params.xDimension,
                                   params.zDimension));
        return mesh;
    }
    if (!(params.xSpacing > 0) || !(params.zSpacing > 0) || !detail::usable(params.xSpacing) ||
        !detail::usable(params.zSpacing)) {
        warn(mesh, fmt::format("xSpacing {} and zSpacing {} must be above 0: nothing is drawn", params.xSpacing,
                               params.zSpacing));
        return mesh;
    }
    const auto columns = static_cast<std::size_t>(params.xDimension);
    const std::size_t given = params.height.size();
    const std::size_t rows = detail::gridRowsToDraw(mesh, given, columns, static_cast<std::size_t>(params.zDimension));
    if (rows < 2) return mesh;

    Array<Vec3f> positions = Array<Vec3f>::ofSize(columns * rows);
    Vec3f* point = positions.mutableData();
    const auto heightAt = [&](std::size_t i) { return i < given ? params.height[i] : 0.0f; };
    for (std::size_t j = 0; j < rows; ++j)
        for (std::size_t i = 0; i < columns; ++i)
            *point++ = {static_cast<float>(i) * params.xSpacing, heightAt(j * columns + i),
                        static_cast<float>(j) * params.zSpacing};
    mesh.positions = std::move(positions);

    const bool faceValues = !params.colorPerVertex || !params.normalPerVertex;
    Array<std::int32_t> faces;
    cutQuadrilaterals(mesh, params.ccw, columns, rows, faceValues ? &faces : nullptr);
    if (mesh.empty()) return mesh;

    detail::bindAttributes(mesh, {.corners = {}, .faces = faces}, params, {});
    if (!mesh.normals.present())
        mesh.normals = detail::generateNormals(mesh, detail::checkedCreaseAngle(mesh, params.creaseAngle));
    // 13.3.4: one unit of s along x and of t along z, whatever the heights.
    for (std::size_t i = 0; i < mesh.texCoords.size(); ++i) {
        TexCoords& set = mesh.texCoords[i];
        if (set.values.present() || (i < params.texCoord.size() && params.texCoord[i].fromPosition)) continue;
        set.sFromPosition = {1.0f / (static_cast<float>(columns - 1) * params.xSpacing), 0, 0, 0};
        set.tFromPosition = {0, 0, 1.0f / (static_cast<float>(rows - 1) * params.zSpacing), 0};
    }
    return mesh;
}

Mesh tessellate(const PointGridParams& params) {
    Mesh mesh;
    mesh.solid = params.solid;
    mesh.anchor = params.anchor;
    const auto columns = static_cast<std::size_t>(std::max(params.columns, 0));
    const std::size_t rows = columns < 2 ? 0 : params.coord.size() / columns;
    if (rows < 2) return mesh;
    mesh.positions = params.coord;
    const bool faceValues = !params.colorPerVertex || !params.normalPerVertex;
    Array<std::int32_t> faces;
    // Rows go north, where those of an ElevationGrid go south.
    cutQuadrilaterals(mesh, !params.ccw, columns, rows, faceValues ? &faces : nullptr);
    if (mesh.empty()) return mesh;
    SurfaceParams bound = params;
    if (bound.texCoord.empty()) {
        Array<Vec2f> st = Array<Vec2f>::ofSize(columns * rows);
        Vec2f* out = st.mutableData();
        for (std::size_t j = 0; j < rows; ++j)
            for (std::size_t i = 0; i < columns; ++i)
                *out++ = {static_cast<float>(i) / static_cast<float>(columns - 1),
                          static_cast<float>(j) / static_cast<float>(rows - 1)};
        bound.texCoord.emplace_back().point = std::move(st);
    }
    detail::bindAttributes(mesh, {.corners = {}, .faces = faces}, bound, {});
    if (!mesh.normals.present())
        mesh.normals = detail::generateNormals(mesh, detail::checkedCreaseAngle(mesh, params.creaseAngle));
    return mesh;
}

}  // namespace rtsg
