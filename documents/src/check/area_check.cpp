// Finds triangles and faces of a document whose points lie on a line, or in one place: they show nothing.
#include <string>

#include "validated_node.h"

namespace rtsg::detail {

namespace {

/// Counts the faces of a geometry whose corners span no area.
class AreaCount {
  public:
    AreaCount(const Array<Vec3f>& points, const Array<std::int32_t>* index) : points_(points), index_(index) {}

    std::size_t size() const { return index_ ? index_->size() : points_.size(); }
    /// Takes each run of `corners` corners as a face.
    void inRuns(std::size_t corners) {
        for (std::size_t i = 0; i + corners <= size(); i += corners) face(i, i + corners);
    }
    /// Up to each -1.
    void toMarks() {
        for (std::size_t i = 0; i < size(); ++i) {
            const std::size_t begin = i;
            while (i < size() && (*index_)[i] >= 0) ++i;
            if (i > begin) face(begin, i);
        }
    }
    std::size_t flat() const { return flat_; }
    std::size_t first() const { return first_; }

  private:
    /// Flat only if it is so exactly: all corners lie on one line with the first two that differ.
    void face(std::size_t begin, std::size_t end) {
        const std::size_t number = faces_++;
        Vec3d from(0), along(0);
        for (std::size_t i = begin; i < end; ++i) {
            const auto at = index_ ? static_cast<std::uint32_t>((*index_)[i]) : i;
            if (at >= points_.size()) return;  // said elsewhere
            const Vec3d point(points_[at]);
            if (i == begin) from = point;
            if (along == Vec3d(0))
                along = point - from;
            else if (glm::cross(along, point - from) != Vec3d(0))
                return;
        }
        if (flat_++ == 0) first_ = number;
    }

    const Array<Vec3f>& points_;
    const Array<std::int32_t>* index_;
    std::size_t faces_ = 0, flat_ = 0, first_ = 0;
};

}  // namespace

void checkAreas(const ValidatedNode& node, SourceLocation where, Diagnostics& diagnostics) {
    const std::string& type = node.type->name;
    const bool faces = type == "IndexedFaceSet", quads = type == "QuadSet" || type == "IndexedQuadSet";
    const bool flat = type == "TriangleSet2D", indexed = type.starts_with("Indexed");
    if (node.isConnected || !(faces || quads || flat || type == "TriangleSet" || type == "IndexedTriangleSet")) return;
    const char* const field = flat ? "vertices" : faces ? "coordIndex" : "index";
    Array<Vec3f> points;
    if (flat) {
        if (const Array<Vec2f>* vertices = node.array<Vec2f>(field))
            for (const Vec2f& v : *vertices) points.push_back(Vec3f(v, 0));
    } else if (const auto coord = node.children.find("coord");
               coord != node.children.end() && coord->second.points.holds<Array<Vec3f>>()) {
        points = coord->second.points.as<Array<Vec3f>>();
    }
    const Array<std::int32_t>* index = indexed ? node.array<std::int32_t>(field) : nullptr;
    if (points.empty() || (indexed && !index)) return;
    AreaCount count(points, index);
    if (faces)
        count.toMarks();
    else
        count.inRuns(quads ? 4 : 3);
    if (count.flat() == 0) return;
    const std::string what = faces ? "face" : quads ? "quad" : "triangle", number = std::to_string(count.first());
    diagnostics.warning(node.at(field, where),
                        count.flat() == 1
                            ? what + " " + number + " (from 0) of " + type + " has no area and shows nothing"
                            : std::to_string(count.flat()) + " " + what + "s of " + type +
                                  " have no area and show nothing, the first of them number " + number + " (from 0)",
                        DiagnosticCode("geometry"));
}

}  // namespace rtsg::detail
