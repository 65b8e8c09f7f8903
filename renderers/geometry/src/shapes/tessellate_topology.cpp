// Binds colours, normals and texture coordinates to corners, and finishes a mesh from cut faces.
#include <fmt/format.h>

#include "tessellate_detail.h"

namespace rtsg::detail {

namespace {

// Four lanes, the last of which is ignored: arrays are padded, so a wide read of the last element is safe.
using Lanes = float __attribute__((vector_size(16)));
using LaneMask = std::int32_t __attribute__((vector_size(16)));

Lanes load(const Vec3f* point) {
    Lanes lanes;
    std::memcpy(&lanes, point, sizeof(lanes));
    return lanes;
}

std::int32_t clampIndex(std::int32_t index, std::size_t count, std::size_t& repairs) {
    if (static_cast<std::uint32_t>(index) < count) return index;
    ++repairs;
    return index < 0 ? 0 : static_cast<std::int32_t>(count - 1);
}

void warnRepairs(Mesh& mesh, const char* field, std::size_t repairs, std::size_t count) {
    if (repairs)
        warn(mesh, fmt::format("{} refers to values that do not exist: {} corners or faces use the nearest of the {} "
                               "there are",
                               field, repairs, count));
}

}  // namespace

bool scanTriangles(const Array<Vec3f>& positions, const std::int32_t* index, std::size_t stride, std::size_t count,
                   Bounds& bounds) {
    const auto size = static_cast<std::uint32_t>(positions.size());
    const Vec3f* first = positions.data();
    const Lanes limit = {kLargestCoordinate, kLargestCoordinate, kLargestCoordinate, kLargestCoordinate};
    const float infinity = std::numeric_limits<float>::infinity();
    Lanes low = {infinity, infinity, infinity, infinity}, high = -low;
    LaneMask good = {-1, -1, -1, -1};
    for (std::size_t t = 0; t < count; ++t) {
        const std::int32_t* corner = index + t * stride;
        for (int c = 0; c < 3; ++c) {
            if (static_cast<std::uint32_t>(corner[c]) >= size) return false;
            const Lanes p = load(first + corner[c]);
            good &= (p <= limit) & (p >= -limit);
            low = p < low ? p : low;
            high = p > high ? p : high;
        }
    }
    if (!(good[0] && good[1] && good[2])) return false;
    if (count > 0) bounds = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
    return true;
}

void reportOfFlatTriangles(Mesh& mesh) {
    std::size_t flat = 0;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        flat += isFlat(mesh.vertex(t, 0), mesh.vertex(t, 1), mesh.vertex(t, 2));
    if (flat) warn(mesh, fmt::format("{} triangles have no area and show nothing", flat));
}

void TopologyBuilder::reserve(std::size_t triangles, bool wantFaces) {
    corners_.reserve(triangles * 3);
    wantFaces_ = wantFaces;
    if (wantFaces) faces_.reserve(triangles);
}

Topology TopologyBuilder::finish(Mesh& mesh) {
    Topology topology;
    topology.corners = toArray(corners_);
    topology.faces = toArray(faces_);
    corners_ = {};
    faces_ = {};
    const std::size_t size = topology.corners.size();
    Array<std::int32_t> triangles = Array<std::int32_t>::ofSize(size);
    std::int32_t* out = triangles.mutableData();
    for (std::size_t i = 0; i < size; ++i) {
        out[i] = index_[static_cast<std::size_t>(topology.corners[i])];
        mesh.bounds.extend(mesh.positions[static_cast<std::size_t>(out[i])]);
    }
    mesh.triangles = std::move(triangles);
    mesh.triangleStride = 3;
    mesh.triangleCount = static_cast<std::uint32_t>(size / 3);
    return topology;
}

template <class T>
MeshAttribute bindCorners(Mesh& mesh, const Topology& topology, const Array<T>& values,
                          const Array<std::int32_t>& index, const char* field) {
    using Binding = MeshAttribute::Binding;
    if (values.empty() || mesh.empty()) return {};
    const std::size_t count = values.size();
    const std::size_t triangles = mesh.triangleCount, stride = mesh.triangleStride;
    const bool perVertex = index.empty();
    const bool inPlace = topology.corners.empty();

    // Without a repair the arrays of the scene can be read where they are.
    const Array<std::int32_t>& source = perVertex ? mesh.triangles : index;
    if ((perVertex && count >= mesh.positions.size()))
        return MeshAttribute(values, Binding::vertex, mesh.triangles, mesh.triangleStride);
    if (perVertex || (inPlace && source.size() >= (triangles - 1) * stride + 3)) {
        bool good = true;
        for (std::size_t t = 0; t < triangles; ++t)
            for (std::size_t c = 0; c < 3; ++c) good &= static_cast<std::uint32_t>(source[t * stride + c]) < count;
        if (good)
            return MeshAttribute(values, perVertex ? Binding::vertex : Binding::corner, source, mesh.triangleStride);
    }

    std::size_t repairs = 0;
    Array<std::int32_t> gathered = Array<std::int32_t>::ofSize(triangles * 3);
    std::int32_t* out = gathered.mutableData();
    for (std::size_t t = 0; t < triangles; ++t)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t k = t * stride + c;
            const std::size_t corner = perVertex || inPlace ? k : static_cast<std::size_t>(topology.corners[k]);
            const std::int32_t i = corner < source.size() ? source[corner] : -1;
            out[t * 3 + c] = clampIndex(i, count, repairs);
        }
    warnRepairs(mesh, field, repairs, count);
    return MeshAttribute(values, Binding::corner, gathered, 3);
}

template <class T>
MeshAttribute bindFaces(Mesh& mesh, const Topology& topology, const Array<T>& values, const Array<std::int32_t>& index,
                        const char* field) {
    using Binding = MeshAttribute::Binding;
    if (values.empty() || mesh.empty()) return {};
    const std::size_t count = values.size();
    const std::size_t triangles = mesh.triangleCount;
    const bool identity = topology.faces.empty();
    if (index.empty() && identity && count >= triangles) return MeshAttribute(values, Binding::face, {}, 1);

    std::size_t repairs = 0;
    Array<std::int32_t> gathered = Array<std::int32_t>::ofSize(triangles);
    std::int32_t* out = gathered.mutableData();
    for (std::size_t t = 0; t < triangles; ++t) {
        const std::size_t face = identity ? t : static_cast<std::size_t>(topology.faces[t]);
        std::int32_t i = static_cast<std::int32_t>(face);
        if (!index.empty()) i = face < index.size() ? index[face] : -1;
        out[t] = clampIndex(i, count, repairs);
    }
    warnRepairs(mesh, field, repairs, count);
    return MeshAttribute(values, Binding::face, gathered, 1);
}

Array<Vec2f> inPairs(const Array<float>& values) {
    Array<Vec2f> result = Array<Vec2f>::ofSize(values.size());
    Vec2f* out = result.mutableData();
    for (const float value : values) *out++ = {std::isfinite(value) ? value : 0.0f, 0};
    return result;
}

void bindAttributes(Mesh& mesh, const Topology& topology, const SurfaceParams& params,
                    const AttributeIndices& indices) {
    const auto bind = [&](const auto& values, const Array<std::int32_t>& index, bool perVertex, const char* field) {
        return perVertex ? bindCorners(mesh, topology, values, index, field)
                         : bindFaces(mesh, topology, values, index, field);
    };
    mesh.normals = bind(params.normal, indices.normal, params.normalPerVertex, "normal");
    mesh.colors = params.colorRGBA.empty() ? bind(params.color, indices.color, params.colorPerVertex, "color")
                                           : bind(params.colorRGBA, indices.color, params.colorPerVertex, "color");
    if (!params.fogDepth.empty())
        mesh.fogDepths = bindCorners(mesh, topology, inPairs(params.fogDepth), {}, "fogCoord");
    if (!params.tangent.empty())
        mesh.tangents = bind(params.tangent, indices.normal, params.normalPerVertex, "tangent");
    for (const TexCoordParams& channel : params.texCoord) {
        TexCoords set;
        if (!channel.point.empty())
            set.values = bindCorners(mesh, topology, channel.point, indices.texCoord, "texCoord");
        else if (!channel.point3.empty())
            set.values = bindCorners(mesh, topology, channel.point3, indices.texCoord, "texCoord");
        else
            set.values = bindCorners(mesh, topology, channel.point4, indices.texCoord, "texCoord");
        if (channel.fromPosition) {
            set.sFromPosition.x = set.tFromPosition.y = set.rFromPosition.z = 1;
        } else if (!set.values.present()) {
            set = defaultTexCoords(mesh.bounds);
        }
        set.authored = channel.fromPosition || set.values.present();
        set.generator = channel.generator, set.parameter = channel.parameter;
        set.mapping = channel.mapping;
        mesh.texCoords.push_back(std::move(set));
    }
    if (mesh.texCoords.empty()) mesh.texCoords.push_back(defaultTexCoords(mesh.bounds));
}

TexCoords defaultTexCoords(const Bounds& bounds) {
    const Vec3f size = bounds.size();
    // Ties go to X, then Y, then Z.
    int s = 0;
    if (size.y > size[s]) s = 1;
    if (size.z > size[s]) s = 2;
    int t = s == 0 ? 1 : 0;
    for (int axis = t + 1; axis < 3; ++axis)
        if (axis != s && size[axis] > size[t]) t = axis;
    TexCoords result;
    if (!(size[s] > 0.0f)) return result;
    const float scale = 1.0f / size[s];
    if (!std::isfinite(scale)) return result;
    result.sFromPosition[s] = scale;
    result.sFromPosition.w = -bounds.min[s] * scale;
    result.tFromPosition[t] = scale;
    result.tFromPosition.w = -bounds.min[t] * scale;
    return result;
}

void CornerMesh::addTriangle(Corner a, Corner b, Corner c) {
    positionIndex.insert(positionIndex.end(), {a.position, b.position, c.position});
    normalIndex.insert(normalIndex.end(), {a.normal, b.normal, c.normal});
    texCoordIndex.insert(texCoordIndex.end(), {a.texCoord, b.texCoord, c.texCoord});
}

void CornerMesh::finish(Mesh& mesh) const {
    mesh.positions = toArray(positions);
    mesh.triangles = toArray(positionIndex);
    mesh.triangleStride = 3;
    mesh.triangleCount = static_cast<std::uint32_t>(positionIndex.size() / 3);
    for (const std::int32_t i : positionIndex) mesh.bounds.extend(positions[static_cast<std::size_t>(i)]);
    if (!normals.empty()) {
        const bool shared = normalIndex == positionIndex;
        mesh.normals =
            MeshAttribute(toArray(normals), shared ? MeshAttribute::Binding::vertex : MeshAttribute::Binding::corner,
                          shared ? mesh.triangles : toArray(normalIndex), 3);
    }
    TexCoords set;
    if (!texCoords.empty())
        set.values = MeshAttribute(toArray(texCoords), MeshAttribute::Binding::corner, toArray(texCoordIndex), 3);
    mesh.texCoords.clear();
    mesh.texCoords.push_back(std::move(set));
}

#define RTSG_X(T)                                                                                           \
    template MeshAttribute bindCorners(Mesh&, const Topology&, const Array<T>&, const Array<std::int32_t>&, \
                                       const char*);                                                        \
    template MeshAttribute bindFaces(Mesh&, const Topology&, const Array<T>&, const Array<std::int32_t>&, const char*);
RTSG_X(Vec2f)
RTSG_X(Vec3f)
RTSG_X(Vec4f)
RTSG_X(Color)
RTSG_X(ColorRGBA)
#undef RTSG_X

}  // namespace rtsg::detail
