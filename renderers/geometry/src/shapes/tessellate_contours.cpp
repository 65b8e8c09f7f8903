// Cuts the outlines of glyphs into triangles: curves to short lines, then GLU's tessellator.
#include <algorithm>
#include <cmath>
#include <deque>

#include "glu.h"
#include "tessellate_text.h"
#include "text/fonts.h"

namespace rtsg::detail {

namespace {

constexpr int kMaxSegments = 64;  // of one curve

/// Appends points on the curve after its start, its end included.
void flattenCurve(const Vec2d* p, int degree, double tolerance, std::vector<Vec2d>& out) {
    // A chord of 1/n of the parameter lies within |second derivative| / (8 n^2) of the curve.
    double bend = 0;
    if (degree == 2) bend = 2 * glm::length(p[0] - 2.0 * p[1] + p[2]);
    if (degree == 3) bend = 6 * std::max(glm::length(p[0] - 2.0 * p[1] + p[2]), glm::length(p[1] - 2.0 * p[2] + p[3]));
    const double wanted = std::ceil(std::sqrt(bend / (8 * tolerance)));
    const int n = static_cast<int>(std::clamp(wanted, 1.0, static_cast<double>(kMaxSegments)));
    for (int i = 1; i < n; ++i) {
        const double t = static_cast<double>(i) / n, s = 1 - t;
        if (degree == 2)
            out.push_back(s * s * p[0] + 2 * s * t * p[1] + t * t * p[2]);
        else
            out.push_back(s * s * s * p[0] + 3 * s * s * t * p[1] + 3 * s * t * t * p[2] + t * t * t * p[3]);
    }
    out.push_back(p[degree]);
}

struct Cut {
    std::deque<Vec2d> points;  // never move: the library is given their addresses
    GlyphMesh mesh;
    std::unordered_map<const Vec2d*, std::int32_t> numbers;
    bool failed = false;
};

using Callback = void (*)();

void onGlyphVertex(void* vertex, void* user) {
    auto& cut = *static_cast<Cut*>(user);
    const auto* point = static_cast<const Vec2d*>(vertex);
    const auto [found, isNew] = cut.numbers.try_emplace(point, static_cast<std::int32_t>(cut.mesh.points.size()));
    if (isNew) cut.mesh.points.emplace_back(*point);
    cut.mesh.triangles.push_back(found->second);
}
void onGlyphCombine(GLdouble at[3], void* /*corners*/[4], GLfloat*, void** out, void* user) {
    auto& cut = *static_cast<Cut*>(user);
    cut.points.emplace_back(at[0], at[1]);
    *out = &cut.points.back();
}
void onGlyphError(GLenum, void* user) {
    static_cast<Cut*>(user)->failed = true;
}
void onGlyphEdgeFlag(GLboolean, void*) {}  // its presence makes the library emit separate triangles only

}  // namespace

GlyphMesh cutGlyph(const std::vector<GlyphContour>& contours, float tolerance) {
    Cut cut;
    GLUtesselator* tessellator = newTessellator();
    if (!tessellator) return {};
    gluTessCallback(tessellator, GLU_TESS_VERTEX_DATA, reinterpret_cast<Callback>(onGlyphVertex));
    gluTessCallback(tessellator, GLU_TESS_COMBINE_DATA, reinterpret_cast<Callback>(onGlyphCombine));
    gluTessCallback(tessellator, GLU_TESS_ERROR_DATA, reinterpret_cast<Callback>(onGlyphError));
    gluTessCallback(tessellator, GLU_TESS_EDGE_FLAG_DATA, reinterpret_cast<Callback>(onGlyphEdgeFlag));
    gluTessProperty(tessellator, GLU_TESS_WINDING_RULE, GLU_TESS_WINDING_NONZERO);
    gluTessNormal(tessellator, 0, 0, 1);
    gluTessBeginPolygon(tessellator, &cut);
    std::vector<Vec2d> outline;
    for (const GlyphContour& contour : contours) {
        outline.clear();
        const auto point = [&](std::size_t i) { return Vec2d(contour.points[2 * i], contour.points[2 * i + 1]); };
        std::size_t at = 0;
        for (const std::uint8_t degree : contour.segments) {
            Vec2d p[4];
            for (std::size_t k = 0; k <= degree; ++k) p[k] = point(at + k);
            flattenCurve(p, degree, tolerance, outline);
            at += degree;
        }
        gluTessBeginContour(tessellator);
        for (std::size_t i = 0; i < outline.size(); ++i) {
            if (outline[i] == outline[i == 0 ? outline.size() - 1 : i - 1]) continue;
            cut.points.push_back(outline[i]);
            GLdouble position[3] = {outline[i].x, outline[i].y, 0};
            gluTessVertex(tessellator, position, &cut.points.back());
        }
        gluTessEndContour(tessellator);
    }
    gluTessEndPolygon(tessellator);
    gluDeleteTess(tessellator);
    if (cut.failed) return {};
    cut.mesh.triangles.resize(cut.mesh.triangles.size() / 3 * 3);
    return std::move(cut.mesh);
}

}  // namespace rtsg::detail
