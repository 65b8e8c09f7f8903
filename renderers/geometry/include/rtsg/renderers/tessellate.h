// Tessellation: pure functions from the fields of the standard geometry nodes to a Mesh.
//
// Invariant: every input, however broken, gives a valid Mesh (possibly empty), whose diagnostics say what was dropped
// or repaired. Time is linear in input plus output (n log n for a concave polygon of n corners). Closed solids share
// positions along seams, so that they are watertight by index; texture seams split texture coordinates, not positions.
// Normals of quadrics are exact. Lengths are in the node's units, angles in radians. Threading: the functions are pure
// and may run concurrently. Source: ISO/IEC 19775-1 V4.0 clauses 11.2.3, 11.4, 13.3, 14.3; the paper's geometry
// utilities, section 4.2.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <rtsg/renderers/mesh.h>

namespace rtsg {

class Scene;

/// How finely curved primitives are divided.
struct TessellationOptions {
    /// The largest distance between a circle and its polygon, as a share of the radius: .0025 gives 48 segments.
    float chordError = 0.0025f;
    /// Overrides chordError when positive: segments around the full circle (clamped to 4 ... 4096). Spheres have
    /// half as many rings from pole to pole.
    int segments = 0;

    int segmentsAround() const;
};

/// The largest distance between tessellated geometry and the true surface: in pixels of the picture, in metres, or as a
/// share of the geometry's own radius. All 0: as TessellationOptions says.
struct TessellationError {
    float pixels = 0, metres = 0, ofRadius = 0;
    bool any() const { return pixels > 0 || metres > 0 || ofRadius > 0; }
};

struct BoxParams {
    Vec3f size{2};
    bool solid = true;
};
struct SphereParams {
    float radius = 1;
    bool solid = true;
};
struct ConeParams {
    float bottomRadius = 1, height = 2;
    bool side = true, bottom = true, solid = true;
};
struct CylinderParams {
    float radius = 1, height = 2;
    bool side = true, top = true, bottom = true, solid = true;
};

Mesh tessellate(const BoxParams& params);
Mesh tessellate(const SphereParams& params, const TessellationOptions& options = {});
Mesh tessellate(const ConeParams& params, const TessellationOptions& options = {});
Mesh tessellate(const CylinderParams& params, const TessellationOptions& options = {});

/// One channel of texture coordinates from the scene. At most one of the arrays is filled; if none is, the node's
/// default mapping is used.
struct TexCoordParams {
    Array<Vec2f> point;
    Array<Vec3f> point3;  // TextureCoordinate3D
    Array<Vec4f> point4;  // TextureCoordinate4D
    /// TextureCoordinateGenerator of mode COORD: the position itself, (x, y, z) as (s, t, r).
    bool fromPosition = false;
    /// The other modes.
    TexCoords::Generator generator = TexCoords::Generator::none;
    std::vector<float> parameter;
    String mapping;
};

/// The fields that X3DComposedGeometryNode and IndexedFaceSet have in common. Empty arrays stand for NULL.
struct SurfaceParams {
    Array<Vec3f> coord;
    Vec3d anchor{0};  // the origin of the coordinates: Mesh::anchor
    Array<Color> color;
    Array<ColorRGBA> colorRGBA;  // preferred when both are given
    Array<Vec3f> normal;
    std::vector<TexCoordParams> texCoord;
    Array<float> fogDepth;  // per vertex
    /// X3D 4.1 Tangent, bound as normals are: Mesh::tangents.
    Array<Vec4f> tangent;
    bool ccw = true, solid = true;
    bool colorPerVertex = true, normalPerVertex = true;
};

struct IndexedFaceSetParams : SurfaceParams {
    Array<std::int32_t> coordIndex, colorIndex, normalIndex, texCoordIndex;
    /// A hint only: concave faces are found and divided correctly in any case.
    bool convex = true;
    float creaseAngle = 0;
};

/// The eight sets of triangles and quads; kinds without index use the coordinates in their order. Colours, normals and
/// tangents are always per vertex (11.4); normalPerVertex says how missing normals are made.
struct PrimitiveSetParams : SurfaceParams {
    enum class Kind : std::uint8_t {
        triangleSet,
        triangleStripSet,
        triangleFanSet,
        quadSet,
        indexedTriangleSet,
        indexedTriangleStripSet,
        indexedTriangleFanSet,
        indexedQuadSet,
    };
    Kind kind = Kind::triangleSet;
    /// For the indexed kinds; strips and fans end at -1.
    Array<std::int32_t> index;
    /// For the kinds without index: stripCount or fanCount.
    Array<std::int32_t> count;
};

/// `coord` is not used; normalPerVertex and colorPerVertex FALSE mean one value for each quadrilateral.
struct ElevationGridParams : SurfaceParams {
    Array<float> height;
    int xDimension = 0, zDimension = 0;
    float xSpacing = 1, zSpacing = 1;
    float creaseAngle = 0;
};

/// A grid of points of any kind: rows of `columns` from west to east, the first in the south.
struct PointGridParams : SurfaceParams {
    int columns = 0;
    float creaseAngle = 0;
};

struct ExtrusionParams {
    Array<Vec2f> crossSection{{1, 1}, {1, -1}, {-1, -1}, {-1, 1}, {1, 1}};
    Array<Rotation> orientation{Rotation{0, 0, 1, 0}};
    Array<Vec2f> scale{{1, 1}};
    Array<Vec3f> spine{{0, 0, 0}, {0, 1, 0}};
    bool beginCap = true, endCap = true, ccw = true, convex = true, solid = true;
    float creaseAngle = 0;
};

Mesh tessellate(const IndexedFaceSetParams& params);
Mesh tessellate(const PrimitiveSetParams& params);
Mesh tessellate(const ElevationGridParams& params);
/// Texture coordinates are 0 in the south-west and 1 in the north-east; fronts face up.
Mesh tessellate(const PointGridParams& params);
Mesh tessellate(const ExtrusionParams& params);

struct Disk2DParams {
    float innerRadius = 0, outerRadius = 1;
    bool solid = false;
};
struct Rectangle2DParams {
    Vec2f size{2};
    bool solid = false;
};
struct TriangleSet2DParams {
    Array<Vec2f> vertices;
    bool solid = false;
};
struct ArcClose2DParams {
    enum class Closure : std::uint8_t { pie, chord };
    Closure closure = Closure::pie;
    float startAngle = 0, endAngle = 1.5707964f, radius = 1;
    bool solid = false;
};

Mesh tessellate(const Disk2DParams& params, const TessellationOptions& options = {});
Mesh tessellate(const Rectangle2DParams& params);
Mesh tessellate(const TriangleSet2DParams& params);
Mesh tessellate(const ArcClose2DParams& params, const TessellationOptions& options = {});

/// PointSet, LineSet, IndexedLineSet, Polypoint2D and Polyline2D. Invalid strokes are left out with a warning.
struct StrokeParams {
    Array<Vec3f> coord;
    Array<Color> color;
    Array<ColorRGBA> colorRGBA;  // preferred when both are given
    Array<float> fogDepth;       // per vertex
    Array<Vec3f> normal;         // per vertex
    Mesh::Strokes kind = Mesh::Strokes::lines;
    /// For lines: `coordIndex` lists the points of each as in IndexedLineSet, or `vertexCount` says how many points of
    /// `coord` each takes.
    bool indexed = false;
    Array<std::int32_t> coordIndex, colorIndex, vertexCount;
    bool colorPerVertex = true;  // false: one colour for each line
};
/// The outline of a circle or a part of it; all of it if the angles are equal or a whole turn apart.
struct Arc2DParams {
    float startAngle = 0, endAngle = 1.570796f, radius = 1;
};
Mesh tessellate(const StrokeParams& params);
Mesh tessellate(const Arc2DParams& params, const TessellationOptions& options = {});

/// Strings as flat outlines in the plane z = 0, filled by the nonzero rule (clause 15). The em of the font is `size`;
/// the distance of lines is spacing * size. A string with another `length`, or too long for maxExtent, is scaled along
/// its line. Letters run to the left if leftToRight is FALSE; those of right-to-left scripts always do. Texture: s = x
/// / size, t = y / size.
struct TextParams {
    std::vector<std::string> strings;  // UTF-8
    std::vector<float> length;         // for each string; 0 or none: as the font gives it
    float maxExtent = 0;               // 0: any
    bool solid = false;
    std::vector<std::string> family{"SERIF"};
    /// A font that replaces family[fontAt], as in FontLibrary::_font; empty if there is none. fontName is for
    /// diagnostics.
    Array<std::int32_t> font;
    std::uint32_t fontAt = 0;
    std::string fontName;
    bool bold = false, italic = false;
    float size = 1, spacing = 1;
    bool horizontal = true, leftToRight = true, topToBottom = true;
    enum class Justify : std::uint8_t { first, begin, middle, end };
    Justify major = Justify::begin, minor = Justify::first;
    std::string language;
    bool inPixels = false;  // Mesh::inPixels: all lengths are pixels
};

/// If there are no fonts, or this build has no text, the mesh is empty and has a warning.
Mesh tessellate(const TextParams& params, const TessellationOptions& options = {});

/// The mesh of a geometry node and its Coordinate, Color, Normal and TextureCoordinate nodes; a PROTO instance stands
/// for the first node of its body. Geometry without triangles, lines or points gives an empty mesh whose diagnostics
/// say so. Diagnostics name the node. Errors: the node is missing or no geometry.
Result<std::shared_ptr<const Mesh>> tessellate(const Scene& scene, NodeId geometry,
                                               const TessellationOptions& options = {});

}  // namespace rtsg
