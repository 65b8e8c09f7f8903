// Mesh: the type of triangles (or of lines or points) that every geometry node is converted to and every renderer
// reads.
//
// Invariant: all indices are in range, all referenced positions are finite and below 1e18, and
// cross(b - a, c - a) of a triangle points to its front (X3D's `ccw` is already applied). Zero-area triangles
// may occur. Arrays of the scene are shared, never copied, when they can be read in place; for that reason
// triangles may be `triangleStride` = 4 apart ("a b c -1"), which Embree takes as a byte stride of 16.
// Threading: immutable once built; share it as shared_ptr<const Mesh>.
// Source: paper section 4.2 (utility classes); ISO/IEC 19775-1 V4.0 clauses 11, 13 and 14.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <rtsg/core/array.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

/// Axis-aligned; empty while min > max.
struct Bounds {
    Vec3f min{std::numeric_limits<float>::infinity()};
    Vec3f max{-std::numeric_limits<float>::infinity()};
    bool empty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
    void extend(Vec3f point) {
        min = glm::min(min, point);
        max = glm::max(max, point);
    }
    Vec3f size() const { return empty() ? Vec3f(0) : max - min; }
    Vec3f center() const { return empty() ? Vec3f(0) : min + 0.5f * (max - min); }
};

/// Values of 2, 3 or 4 floats at the corners of triangles: normals, texture coordinates, colours.
///
/// The value of corner c of triangle t is number i of the array, with k = t * triangleStep + c * cornerStep and
/// i = index ? index[k] : k. So per vertex, per corner and per face are one formula without branches on a binding.
class MeshAttribute {
  public:
    enum class Binding : std::uint8_t { none, vertex, corner, face };

    MeshAttribute() = default;

    /// Shares `values` (an Array of Vec2f, Vec3f, Vec4f, Color or ColorRGBA) and `indices` (empty: k itself).
    template <class T>
    MeshAttribute(Array<T> values, Binding binding, Array<std::int32_t> indices, std::uint32_t triangleStep)
        : data_(reinterpret_cast<const float*>(values.data())),
          count_(static_cast<std::uint32_t>(values.size())),
          triangleStep_(triangleStep),
          cornerStep_(binding == Binding::face ? 0u : 1u),
          components_(sizeof(T) / sizeof(float)),
          binding_(values.empty() ? Binding::none : binding),
          index_(indices.data()),
          indices_(std::move(indices)),
          values_(std::move(values)) {}

    bool present() const { return binding_ != Binding::none; }
    Binding binding() const { return binding_; }
    int components() const { return components_; }
    std::uint32_t valueCount() const { return count_; }
    const float* data() const { return data_; }
    /// The shared arrays: values of the original MF type; indices may be empty.
    const Value& values() const { return values_; }
    const Array<std::int32_t>& indices() const { return indices_; }
    std::uint32_t triangleStep() const { return triangleStep_; }

    /// Number of the value at a corner (0, 1, 2) of a triangle.
    std::uint32_t valueIndex(std::uint32_t triangle, std::uint32_t corner) const {
        const std::size_t k = std::size_t{triangle} * triangleStep_ + corner * cornerStep_;
        return index_ ? static_cast<std::uint32_t>(index_[k]) : static_cast<std::uint32_t>(k);
    }
    /// Missing components read as 0, 0, 0, 1. Precondition: present().
    Vec4f value(std::uint32_t triangle, std::uint32_t corner) const {
        const float* first = data_ + std::size_t{valueIndex(triangle, corner)} * components_;
        switch (components_) {
            case 2:
                return {first[0], first[1], 0.0f, 1.0f};
            case 3:
                return {first[0], first[1], first[2], 1.0f};
            default:
                return {first[0], first[1], first[2], first[3]};
        }
    }
    /// Linear in the triangle: u weighs corner 1 and v corner 2, as Embree reports them.
    Vec4f interpolate(std::uint32_t triangle, float u, float v) const {
        if (cornerStep_ == 0) return value(triangle, 0);
        return (1.0f - u - v) * value(triangle, 0) + u * value(triangle, 1) + v * value(triangle, 2);
    }

  private:
    const float* data_ = nullptr;
    std::uint32_t count_ = 0, triangleStep_ = 0, cornerStep_ = 0;
    std::uint8_t components_ = 0;
    Binding binding_ = Binding::none;
    const std::int32_t* index_ = nullptr;
    Array<std::int32_t> indices_;
    Value values_;
};

/// One channel of texture coordinates: stored values, or, when there are none, an affine map of the position.
struct TexCoords {
    MeshAttribute values;
    /// s = dot(sFromPosition.xyz, position) + sFromPosition.w, likewise t and r. Used only while !values.present().
    Vec4f sFromPosition{0}, tFromPosition{0}, rFromPosition{0};
    /// TextureCoordinateGenerator (18.4.8): coordinates that depend on the viewer are computed when they are needed,
    /// from the position, the normal and the view; the affine map above is then not used.
    enum class Generator : std::uint8_t {
        none,
        sphere,
        cameraSpaceNormal,
        cameraSpacePosition,
        cameraSpaceReflection,
        sphereLocal,
        coordEye,
        noise,
        noiseEye,
        sphereReflect,
        sphereReflectLocal,
        worldSpaceNormal,  // no modes of the standard; other browsers have them
        worldSpaceReflection,
    };
    Generator generator = Generator::none;
    std::vector<float> parameter;  // as in the node
    /// Whether the author gave them. If not, textures that need three coordinates make their own.
    bool authored = false;
    /// X3D 4.0 `mapping`: the name that a texture's mapping field refers to. Empty: the default channel.
    String mapping;
};

/// The data of a hit that shading needs, in the mesh's own frame.
struct SurfacePoint {
    Vec3f position{0};
    Vec3f geometricNormal{0, 0, 1};  // unit, towards the front
    Vec3f shadingNormal{0, 0, 1};    // unit, as authored or generated; it may disagree with the geometric side
    Vec4f texCoord{0, 0, 0, 1};
    ColorRGBA color{1, 1, 1, 1};
    bool hasColor = false;
    bool colorHasAlpha = false;  // from ColorRGBA: its alpha replaces the material's transparency
};

struct Mesh {
    Array<Vec3f> positions;
    /// Corner c of triangle t: triangles[t * triangleStride + c]. Valid as Embree's RTC_FORMAT_UINT3.
    Array<std::int32_t> triangles;
    std::uint32_t triangleCount = 0;
    std::uint32_t triangleStride = 3;  // 3 or 4 integers
    /// The mesh has lines or points instead of triangles (triangleCount is 0, so that code for triangles finds none).
    /// Stroke i runs from corner 0 to corner 1 of entry i of `triangles`, a point from itself to itself; corner 2
    /// equals corner 1, so attributes are interpolated with v = 0.
    enum class Strokes : std::uint8_t { none, points, lines };
    Strokes strokes = Strokes::none;
    std::uint32_t strokeCount = 0;
    /// If absent, triangles are faceted and shaded with the geometric normal; lines and points are lit only if they
    /// have normals.
    MeshAttribute normals;
    MeshAttribute colors;
    /// FogCoordinate (24.4.3): the fog's share of the colour, from 0 to 1, in the first of two components.
    MeshAttribute fogDepths;
    /// Tangent of X3D 4.1, as TANGENT of glTF 2.0 (3.7.2.1): the direction of a normal texture's s in the surface, of
    /// any length; the fourth component says whether t runs along normal x tangent (0 or above) or against it. If
    /// absent, normal textures follow the texture coordinates.
    MeshAttribute tangents;
    /// At least one channel when triangleCount > 0.
    std::vector<TexCoords> texCoords;
    /// X3D `solid`: the back need not be drawn.
    bool solid = true;
    /// Its unit is a pixel of the picture at any distance: text of a ScreenFontStyle (36.4.4).
    bool inPixels = false;
    /// The mesh's origin in the coordinates of its geometry node. It is 0 except for geographic geometry, which lies
    /// millions of metres from the node's origin while positions are floats.
    Vec3d anchor{0};
    /// The length that TessellationOptions::chordError is relative to, in the mesh's own unit; 0: the geometry is not
    /// curved.
    float curveSize = 0;
    /// The bounds of the positions that triangles use.
    Bounds bounds;
    Diagnostics diagnostics;

    bool empty() const { return triangleCount == 0; }
    std::uint32_t vertexIndex(std::uint32_t triangle, std::uint32_t corner) const {
        return static_cast<std::uint32_t>(triangles[std::size_t{triangle} * triangleStride + corner]);
    }
    Vec3f vertex(std::uint32_t triangle, std::uint32_t corner) const {
        return positions[vertexIndex(triangle, corner)];
    }
    Vec3f position(std::uint32_t triangle, float u, float v) const {
        const Vec3f a = vertex(triangle, 0);
        return a + u * (vertex(triangle, 1) - a) + v * (vertex(triangle, 2) - a);
    }
    /// A unit vector; (0, 0, 1) for a triangle without area.
    Vec3f geometricNormal(std::uint32_t triangle) const;
    /// A unit vector; the geometric normal if there is none or it has no direction.
    Vec3f shadingNormal(std::uint32_t triangle, float u, float v) const;
    /// (s, t, r, q); 0, 0, 0, 1 for a channel that does not exist.
    Vec4f texCoord(std::uint32_t triangle, float u, float v, std::size_t channel = 0) const;
    /// Opaque white if there are no colours.
    ColorRGBA color(std::uint32_t triangle, float u, float v) const;

    /// Whether it has an inside: along each edge, triangles run as often in one direction as in the other. Edges
    /// connect positions, so that seams of attributes do not count. It is computed at the first call, on any thread.
    bool isClosed() const;

  private:
    /// The cached answer of isClosed(), or -1. A copy forgets it, since it may be changed before it is shared.
    struct Answer {
        std::atomic<std::int8_t> value{-1};
        Answer() = default;
        Answer(const Answer&) {}
        Answer& operator=(const Answer&) {
            value = -1;
            return *this;
        }
    };
    mutable Answer closed_;
};

/// All values of a surface point, with channel 0. Preconditions: triangle < triangleCount; u, v >= 0; u + v <= 1.
SurfacePoint interpolate(const Mesh& mesh, std::uint32_t triangle, float u, float v);

/// The derivatives of the position by s and t on a triangle, for tangent-space normal maps. False if the mapping is
/// singular.
bool textureTangents(const Mesh& mesh, std::uint32_t triangle, std::size_t channel, Vec3f& dPds, Vec3f& dPdt);

/// A mesh with one index for all attributes, as rasterisers need it: corners that agree in every attribute become one
/// vertex.
struct VertexArrays {
    Array<Vec3f> positions, normals;  // normals are always there: geometric ones if the mesh is faceted
    Array<Vec2f> texCoords;           // of one channel
    Array<ColorRGBA> colors;          // empty without colours
    Array<std::uint32_t> triangles;   // 3 per triangle
};
VertexArrays vertexArrays(const Mesh& mesh, std::size_t channel = 0);

/// Checks the invariant at the top of this file for every index; empty if it holds. Takes linear time; for tests.
std::string findDefect(const Mesh& mesh);

/// Sum of triangle areas, and the volume enclosed (positive when fronts face outwards), in double precision.
double surfaceArea(const Mesh& mesh);
double enclosedVolume(const Mesh& mesh);

/// Bytes that the mesh refers to, including arrays shared with the scene.
std::size_t memoryUse(const Mesh& mesh);

// ---------------------------------------------------------------------------------------------------------------

inline Vec3f Mesh::geometricNormal(std::uint32_t triangle) const {
    const Vec3f a = vertex(triangle, 0);
    const Vec3f n = glm::cross(vertex(triangle, 1) - a, vertex(triangle, 2) - a);
    const float lengthSquared = glm::dot(n, n);
    if (lengthSquared > 1e-30f && lengthSquared < 1e30f) return n / std::sqrt(lengthSquared);
    // Tiny or huge triangles leave the range of float when their edges are multiplied.
    const Vec3d da(a);
    const Vec3d dn = glm::cross(Vec3d(vertex(triangle, 1)) - da, Vec3d(vertex(triangle, 2)) - da);
    const double length = glm::length(dn);
    return length > 0.0 ? Vec3f(dn / length) : Vec3f(0, 0, 1);
}

inline Vec3f Mesh::shadingNormal(std::uint32_t triangle, float u, float v) const {
    if (!normals.present()) return geometricNormal(triangle);
    const Vec3f n(normals.interpolate(triangle, u, v));
    const float lengthSquared = glm::dot(n, n);
    // The negated comparison also catches NaN.
    if (!(lengthSquared > 1e-24f && lengthSquared < 1e30f)) return geometricNormal(triangle);
    return n / std::sqrt(lengthSquared);
}

inline Vec4f Mesh::texCoord(std::uint32_t triangle, float u, float v, std::size_t channel) const {
    if (channel >= texCoords.size()) return {0, 0, 0, 1};
    const TexCoords& set = texCoords[channel];
    if (set.values.present()) return set.values.interpolate(triangle, u, v);
    const Vec4f p(position(triangle, u, v), 1.0f);
    return {glm::dot(set.sFromPosition, p), glm::dot(set.tFromPosition, p), glm::dot(set.rFromPosition, p), 1.0f};
}

inline ColorRGBA Mesh::color(std::uint32_t triangle, float u, float v) const {
    if (!colors.present()) return {1, 1, 1, 1};
    const Vec4f c = colors.interpolate(triangle, u, v);
    return {c.x, c.y, c.z, c.w};
}

}  // namespace rtsg
