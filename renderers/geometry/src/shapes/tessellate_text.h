// TextMaker: Text nodes to meshes; each glyph is cut into triangles once and then copied.
//
// Invariant: what it makes does not depend on what it made before. Memory: at most kMaxGlyphs of the last ones used.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tessellate_detail.h"

namespace rtsg {

class Fonts;
class Node;
struct FontChoice;
struct GlyphContour;
struct PlacedGlyph;

namespace detail {

/// A filled outline; lengths in ems.
struct GlyphMesh {
    std::vector<Vec2f> points;
    std::vector<std::int32_t> triangles;  // counter-clockwise
};

/// Cuts the interior by the nonzero rule into triangles. Curves deviate by `tolerance` at most.
GlyphMesh cutGlyph(const std::vector<GlyphContour>& contours, float tolerance);

class TextMaker {
  public:
    static constexpr std::size_t kMaxGlyphs = 16384;

    Mesh make(const TextParams& params, const TessellationOptions& options);
    /// The measures that measureText() returns.
    Array<float> measure(const TextParams& params);

  private:
    struct Line;
    const GlyphMesh& glyph(const Fonts& fonts, const PlacedGlyph& placed, float tolerance);
    std::uint32_t loadedFace(const Fonts& fonts, const TextParams& params, Mesh& mesh);
    static void layOutLines(std::vector<Line>& lines, const FontChoice& font, const TextParams& params);
    static void layOutColumns(std::vector<Line>& lines, const TextParams& params);
    std::vector<Line> layOut(const Fonts& fonts, const TextParams& params, Mesh& mesh);

    std::unordered_map<float, std::unordered_map<std::uint64_t, GlyphMesh>> glyphs_;  // by tolerance; face and glyph
    std::size_t kept_ = 0;
    static constexpr std::size_t kMaxFonts = 16;
    std::vector<std::pair<Array<std::int32_t>, std::uint32_t>> faces_;  // of the last fonts that were loaded
};

/// The fields of a Text and its font style. Precondition: it is a Text.
TextParams readText(const Scene& scene, const Node& text, Mesh& problems);

/// Does what tessellate() does. `text`, if any, remembers glyphs; `points` are those of coordinate nodes as skins have
/// moved them.
Result<std::shared_ptr<const Mesh>> tessellateNode(
    const Scene& scene, NodeId geometry, const TessellationOptions& options, TextMaker* text,
    const std::unordered_map<std::uint32_t, Array<Vec3f>>* points = nullptr);

}  // namespace detail
}  // namespace rtsg
