// Files of other programs as document commands: STL, OBJ, PLY and glTF 2.0, recognised by their content.
//
// Invariant: what a file says is checked against its size before anything is made of it; what cannot be had is reported
// and left out, and the rest is imported. One unit of a file is one metre. Threading: pure functions.
// Source: the STL format (StereoLithography Interface Specification, 3D Systems, 1988), the Wavefront OBJ format
// (Advanced Visualizer manual, appendix B1), PLY (Turk, 1994), glTF 2.0 (ISO/IEC 12113:2022).
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/documents/document_handler.h>

#include "commands/time_limit.h"

namespace rtsg::detail {

enum class FileKind : std::uint8_t {
    document,
    stl,
    obj,
    ply,
    gltf,
    glb,
    urdf,
    sdf,
    collada,
    fbx,
    threeDs,
    off,
    notRead
};

/// By the first bytes of a file; `size` is that of all of it, 0 if that is not known.
FileKind fileKind(std::string_view head, std::uint64_t size);
/// Says in a sentence what kind of file it is that cannot be read.
std::string whyNotRead(std::string_view head);

/// The content of a file beside the one that is read: a material library, a buffer.
using OpenBeside = std::function<Result<std::string>(std::string_view url)>;

struct ImportInput {
    std::string_view bytes;
    OpenBeside open;  // null: nothing may be opened
    std::uint64_t maximumBytes = std::uint64_t{4}
                                 << 30;  // of memory for what is made of the bytes before it is a scene
    std::string_view clip{};             // the animation that plays, of files that have several; empty: the first
    bool displayColors = false;          // colours of a glTF file are those of a screen, and not light
    TimeLimit time{};
};

/// Each gives a whole document, from beginDocument to endDocument; false if nothing was usable (then there may be
/// none).
bool importStl(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);
bool importObj(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);
bool importPly(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);
bool importGltf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);

/// Begins an imported document: its header and statements.
void beginImported(DocumentHandler& handler, std::string_view from, std::string_view version = "4.0");

/// One shape's triangles, polygons or points; empty lists are left out.
struct ImportedMesh {
    Array<Vec3f> points;
    Array<Vec3f> normals;
    Array<Vec4f> tangents;  // as the normals; only with these
    struct Named {
        std::string mapping;
        Array<Vec2f> texCoords;
    };
    Array<Vec2f> texCoords;
    std::vector<Named> namedTexCoords{};             // in their place, if there are any
    Array<ColorRGBA> colors;                         // one a point
    Array<std::int32_t> faces;                       // polygons, each ended by -1; or triangles without, if `triangles`
    Array<std::int32_t> normalIndex, texCoordIndex;  // as `faces`; empty: the same indices
    bool triangles = false;
    bool smooth = true;
    bool solid = false;
    std::string pointsName{};  // DEF of the Coordinate
    bool pointsGiven = false;  // a Coordinate of that name is there already
};

/// An Appearance in field `appearance` with a material of this type as it is by default; an UnlitMaterial is for points
/// without normals, which a Material would leave black.
void writeAppearance(DocumentHandler& handler, const char* material);
/// An IndexedTriangleSet, an IndexedFaceSet or, without faces, a PointSet in field `geometry`.
void writeMesh(DocumentHandler& handler, ImportedMesh mesh);

/// Scanner of words and numbers in a text of lines.
class LineScanner {
  public:
    explicit LineScanner(std::string_view text) : p_(text.data()), end_(p_ + text.size()) {}
    /// Moves to the next line; false at the end. A backslash at its end joins the next one.
    bool nextLine();
    std::string_view word();
    /// The rest of the line, without white space round it.
    std::string_view rest();
    bool number(float& out);
    bool integer(std::int64_t& out);
    std::uint32_t line() const { return line_; }
    const char* at() const { return p_; }

  private:
    void skipBlanks();
    const char *p_, *end_;
    std::uint32_t line_ = 0;
};

}  // namespace rtsg::detail
