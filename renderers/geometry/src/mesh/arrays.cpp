// A mesh's attributes as the flat arrays that rasterisers and exporters take.
#include <vector>

#include <rtsg/renderers/mesh.h>

namespace rtsg {

namespace {

constexpr std::uint32_t kAbsent = 0xFFFFFFFF;

/// The numbers of a corner's values; kAbsent where the mesh has none or they follow from the position.
struct Combination {
    std::uint32_t normal, texCoord, color;
    friend bool operator==(const Combination&, const Combination&) = default;
};

template <class T>
Array<T> arrayOf(const std::vector<T>& elements) {
    Array<T> result = Array<T>::ofSize(elements.size());
    std::copy(elements.begin(), elements.end(), result.mutableData());
    return result;
}

}  // namespace

VertexArrays vertexArrays(const Mesh& mesh, std::size_t channel) {
    const MeshAttribute none;
    const MeshAttribute& texCoords = channel < mesh.texCoords.size() ? mesh.texCoords[channel].values : none;
    std::vector<Vec3f> positions, normals;
    std::vector<Vec2f> st;
    std::vector<ColorRGBA> colors;
    Array<std::uint32_t> triangles = Array<std::uint32_t>::ofSize(std::size_t{mesh.triangleCount} * 3);
    std::uint32_t* out = triangles.mutableData();

    // The vertices made of one position form a list; it is short, as few attributes differ at one point.
    std::vector<std::uint32_t> first(mesh.positions.size(), kAbsent), next;
    std::vector<Combination> combinations;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Vec3f faceted = mesh.geometricNormal(t);
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint32_t v = mesh.vertexIndex(t, c);
            const Combination wanted{mesh.normals.present() ? mesh.normals.valueIndex(t, c) : kAbsent,
                                     texCoords.present() ? texCoords.valueIndex(t, c) : kAbsent,
                                     mesh.colors.present() ? mesh.colors.valueIndex(t, c) : kAbsent};
            const float weightU = c == 1 ? 1.0f : 0.0f, weightV = c == 2 ? 1.0f : 0.0f;
            const Vec3f normal = mesh.normals.present() ? mesh.shadingNormal(t, weightU, weightV) : faceted;
            // At a hub shared by very many facets the list would grow long: past a few tries a new vertex is made.
            std::uint32_t found = first[v];
            for (int tries = 0; found != kAbsent && (combinations[found] != wanted || normals[found] != normal);)
                found = ++tries < 16 ? next[found] : kAbsent;
            if (found == kAbsent) {
                found = static_cast<std::uint32_t>(positions.size());
                positions.push_back(mesh.positions[v]);
                normals.push_back(normal);
                st.emplace_back(mesh.texCoord(t, weightU, weightV, channel));
                if (mesh.colors.present()) colors.push_back(mesh.color(t, weightU, weightV));
                combinations.push_back(wanted);
                next.push_back(first[v]);
                first[v] = found;
            }
            out[std::size_t{t} * 3 + c] = found;
        }
    }
    return {arrayOf(positions), arrayOf(normals), arrayOf(st), arrayOf(colors), std::move(triangles)};
}

}  // namespace rtsg
