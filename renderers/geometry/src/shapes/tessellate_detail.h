// Shared by the tessellators; private to this library.
//
// Words: a *corner* is a position in the source's index list, a *face* a polygon of the source. A Topology says
// which corner and which face each triangle of the mesh came from, so that attributes can be bound afterwards.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/tessellate.h>

#include <rtsg/core/portable_math.h>

namespace rtsg::detail {

constexpr float kLargestCoordinate = 1e18f;  // Embree ignores triangles beyond 1.8e18
/// More vertices than this are refused: products of dimensions in a small file must not fill the memory.
constexpr std::size_t kMaxVertices = std::size_t{1} << 27;

/// Finite and in range; false for NaN.
inline bool usable(float x) {
    return std::abs(x) <= kLargestCoordinate;
}
inline bool usable(Vec2f p) {
    return usable(p.x) && usable(p.y);
}
inline bool usable(Vec3f p) {
    return usable(p.x) && usable(p.y) && usable(p.z);
}

template <class T>
Array<T> toArray(const std::vector<T>& elements) {
    Array<T> result = Array<T>::ofSize(elements.size());
    if (!elements.empty())
        std::memcpy(static_cast<void*>(result.mutableData()), elements.data(), elements.size() * sizeof(T));
    return result;
}

inline void warn(Mesh& mesh, std::string text) {
    mesh.diagnostics.warning({}, std::move(text));
}
/// The rows to draw of a grid with `given` heights. All of them, since missing heights are 0, as in other browsers. If
/// a grid lacks so many that its dimension must be wrong, only the complete rows, so that a false dimension cannot fill
/// the memory. Warns in both cases.
std::size_t gridRowsToDraw(Mesh& mesh, std::size_t given, std::size_t columns, std::size_t rows);
/// Whether a size can be drawn; warns of one that cannot.
inline bool isPositive(Mesh& mesh, const char* field, float value) {
    if (value > 0.0f && usable(value)) return true;
    warn(mesh, fmt::format("{} {} is not above 0 and up to {:g}: nothing is drawn", field, value, kLargestCoordinate));
    return false;
}

struct Topology {
    /// 3 per triangle. Empty: the triangles are the source's index list in place, corner = t * triangleStride + c.
    Array<std::int32_t> corners;
    /// 1 per triangle. Empty: face = t.
    Array<std::int32_t> faces;
};

/// Collects triangles of a source that has an index per corner, then gives the mesh its indices and bounds.
class TopologyBuilder {
  public:
    TopologyBuilder(const Array<std::int32_t>& index, bool ccw) : index_(index), ccw_(ccw) {}
    void reserve(std::size_t triangles, bool wantFaces);
    void add(std::size_t a, std::size_t b, std::size_t c, std::size_t face) {
        corners_.push_back(static_cast<std::int32_t>(a));
        corners_.push_back(static_cast<std::int32_t>(ccw_ ? b : c));
        corners_.push_back(static_cast<std::int32_t>(ccw_ ? c : b));
        if (wantFaces_) faces_.push_back(static_cast<std::int32_t>(face));
    }
    std::size_t triangleCount() const { return corners_.size() / 3; }
    /// Precondition: every corner added is a valid position of the index, and that a usable position of the mesh.
    Topology finish(Mesh& mesh);

  private:
    const Array<std::int32_t>& index_;
    std::vector<std::int32_t> corners_, faces_;
    bool ccw_, wantFaces_ = false;
};

/// Checks all indices and coordinates of `count` triangles `stride` apart; fills `bounds` when everything is usable.
bool scanTriangles(const Array<Vec3f>& positions, const std::int32_t* index, std::size_t stride, std::size_t count,
                   Bounds& bounds);

/// Whether a triangle has no area at all, as its rounded corners lie: in double precision, where floats leave doubts.
inline bool isFlat(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const Vec3f ab = b - a, ac = c - a, n = glm::cross(ab, ac);
    if (glm::dot(n, n) > 1e-10f * glm::dot(ab, ab) * glm::dot(ac, ac)) return false;
    const Vec3d exactly(a);
    return glm::cross(Vec3d(b) - exactly, Vec3d(c) - exactly) == Vec3d(0);
}
/// Says how many triangles of a mesh have none; they show nothing.
void reportOfFlatTriangles(Mesh& mesh);

/// Binds values by the corners' own index (per vertex when `index` is empty) or by faces (`index` maybe empty). Missing
/// values and indices out of range are repaired, with a warning that names the field.
template <class T>
MeshAttribute bindCorners(Mesh& mesh, const Topology& topology, const Array<T>& values,
                          const Array<std::int32_t>& index, const char* field);
template <class T>
MeshAttribute bindFaces(Mesh& mesh, const Topology& topology, const Array<T>& values, const Array<std::int32_t>& index,
                        const char* field);

/// The three attributes of a composed geometry; normals are left absent when none are given.
struct AttributeIndices {
    Array<std::int32_t> color, normal, texCoord;
};
/// Numbers as an attribute's values, which have two components at least.
Array<Vec2f> inPairs(const Array<float>& values);
void bindAttributes(Mesh& mesh, const Topology& topology, const SurfaceParams& params, const AttributeIndices& indices);

/// ISO/IEC 19775-1, 13.3.6: the largest side of the box is s in 0 ... 1, the next t in the same scale.
TexCoords defaultTexCoords(const Bounds& bounds);

/// Weighted by the angle at the corner, smooth across edges whose faces differ by less than `creaseAngle`.
/// Absent (faceted) for an angle of 0 or less; per vertex for pi or more.
MeshAttribute generateNormals(const Mesh& mesh, float creaseAngle);

/// The same, again and again for one list of triangles whose positions change: what depends on the triangles alone is
/// found once, and which corners share a normal is found again only when an edge has turned sharp or smooth.
class NormalGenerator {
  public:
    NormalGenerator(float creaseAngle, bool remember)
        : creaseAngle_(creaseAngle),
          chord_(static_cast<float>(2 * portable::sin(.5 * double{creaseAngle}))),
          remember_(remember) {}
    /// Precondition: the same triangles each time.
    MeshAttribute make(const Mesh& mesh);

  private:
    struct Pair {
        std::uint32_t a, b, neighbour;  // corners of a vertex, by their place in its run of incident_
    };
    struct Check {
        std::uint32_t a, b;  // triangles that share an edge
        bool smooth;
    };
    MeshAttribute smoothEverywhere(const Mesh& mesh);
    MeshAttribute smoothWithinCrease(const Mesh& mesh);
    void findFrames(const Mesh& mesh);
    void findCorners(const Mesh& mesh);
    void findGroups(const Mesh& mesh);
    bool isSmooth(std::uint32_t a, std::uint32_t b) const;
    template <class Visit>
    void forEachPair(const Mesh& mesh, std::size_t v, Visit visit);

    float creaseAngle_, chord_;
    bool remember_;
    std::vector<Vec3f> normals_;                   // per triangle: unit, or zero for one without area
    std::vector<float> angles_;                    // per corner
    std::vector<std::uint32_t> first_, incident_;  // per vertex its corners, as triangle * 3 + corner
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges_;
    std::vector<Pair> pairs_;
    std::vector<std::uint32_t> pairEnd_;  // per vertex, in pairs_
    std::vector<Check> checks_;           // every edge once
    Array<std::int32_t> index_;           // per corner its normal
    std::size_t values_ = 0;
};

/// Returns a usable crease angle, with a warning when it had to be replaced.
float checkedCreaseAngle(Mesh& mesh, float creaseAngle);

/// Cuts a counter-clockwise polygon into triangles in n log n. False, with no triangles, unless it is simple.
bool cutSimplePolygon(std::span<const Vec2d> points, std::vector<std::array<int, 3>>& triangles);

/// Cuts polygons into triangles: convex and simple ones by itself, the others (holes joined by bridges, crossings) by
/// the GLU tessellator, which is robust but quadratic.
class PolygonCutter {
  public:
    PolygonCutter() = default;
    PolygonCutter(const PolygonCutter&) = delete;
    PolygonCutter& operator=(const PolygonCutter&) = delete;
    ~PolygonCutter();

    /// tooLong: not simple, and with more corners than the GLU tessellator can take in reasonable time.
    enum class Outcome : std::uint8_t { good, degenerate, selfIntersecting, tooLong };
    /// Indices into `points`, oriented as the polygon is. Precondition: all points are usable.
    Outcome cut(std::span<const Vec3f> points, std::vector<std::array<int, 3>>& triangles);

  private:
    Outcome cutFlat(std::vector<std::array<int, 3>>& triangles);
    Outcome cutConcave(std::span<const Vec2d> points, std::vector<std::array<int, 3>>& triangles);
    void* tessellator_ = nullptr;  // GLUtesselator, made on first use
    std::vector<Vec2d> flat_;
    std::vector<int> kept_;
};

/// The polygons of a face set and how they were cut, to find out whether other points would cut them alike.
struct FacePlan {
    struct Polygon {
        std::uint32_t end, cutEnd;  // in vertices and cuts
        bool isQuad;                // of four corners, cut from the first to the third
    };
    std::vector<std::int32_t> vertices;    // of each polygon's corners
    std::vector<std::array<int, 3>> cuts;  // corners of each polygon's triangles
    std::vector<Polygon> polygons;         // of four corners and more
    /// Faces were left out or cut badly for where their points are.
    bool dependsOnPoints = false;

    void add(const Array<std::int32_t>& index, const std::vector<std::size_t>& corners,
             const std::vector<std::array<int, 3>>& triangles);
    /// Whether these points lead to the same triangles. Precondition: vertices are in range.
    bool cutsAlike(const Array<Vec3f>& points, PolygonCutter& cutter) const;
};

/// Implements the public functions; fills `plan`, if given.
Mesh tessellateFaces(const IndexedFaceSetParams& params, FacePlan* plan);
Mesh tessellateSet(const PrimitiveSetParams& params, FacePlan* plan);

/// For shapes that are generated: positions, normals and texture coordinates with an index each.
struct CornerMesh {
    struct Corner {
        int position = 0, normal = 0, texCoord = 0;
    };
    std::vector<Vec3f> positions, normals;
    std::vector<Vec2f> texCoords;
    std::vector<std::int32_t> positionIndex, normalIndex, texCoordIndex;

    int addPosition(Vec3f p) {
        positions.push_back(p);
        return static_cast<int>(positions.size()) - 1;
    }
    int addNormal(Vec3f n) {
        normals.push_back(n);
        return static_cast<int>(normals.size()) - 1;
    }
    int addTexCoord(Vec2f st) {
        texCoords.push_back(st);
        return static_cast<int>(texCoords.size()) - 1;
    }
    void addTriangle(Corner a, Corner b, Corner c);
    void addQuad(Corner a, Corner b, Corner c, Corner d) {
        addTriangle(a, b, c);
        addTriangle(a, c, d);
    }
    /// Without normals the mesh is faceted. Diagnostics already in `mesh` stay.
    void finish(Mesh& mesh) const;
};

}  // namespace rtsg::detail
