// Looks for the edges in a plane that a straight way crosses, and for the gaps between the faces that end there.
#include "diffraction_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "edges/diffraction_paths.h"

namespace rtsg {
namespace {

/// A place where a face begins or ends, metres along the way from the first edge.
struct Mark {
    double at = 0;
    bool begins = false;
    const WallEdge* edge = nullptr;
};

/// The plane of a face, and the straight way in it.
struct Line {
    glm::dvec3 from, along, normal;  // the last into the air
};

/// Whether the line crosses the edge of a face in its plane, with the body below.
bool crosses(const Line& line, const WallEdge& edge, Mark& mark) {
    constexpr double kAlong = 1e-4;
    const glm::dvec3 displacement = edge.from - line.from;
    const double position = positionRounding(edge.from),
                 rounding = 1e-5 * (glm::length(displacement) + edge.length) + 2 * position;
    if (std::abs(glm::dot(displacement, line.normal)) > rounding ||
        std::abs(glm::dot(edge.axis, line.normal)) > 1e-5 + 2 * position / edge.length)
        return false;
    const bool first = std::abs(glm::dot(edge.faceA, line.normal)) < kAlong;
    const glm::dvec3 &face = first ? edge.faceA : edge.faceB, &other = first ? edge.faceB : edge.faceA;
    const double toward = glm::dot(line.along, face);
    if (std::abs(glm::dot(face, line.normal)) >= kAlong || glm::dot(other, line.normal) >= kAlong ||
        std::abs(toward) < kAlong)
        return false;
    mark = {glm::dot(displacement, face) / toward, toward > 0, &edge};
    const double on = glm::dot(line.along * mark.at - displacement, edge.axis);
    return on >= 0 && on <= edge.length;
}

/// The faces from edge to edge; if an edge is not known there is no gap.
std::vector<RowFace> facesOf(std::vector<Mark>& marks, double from, double to) {
    std::ranges::stable_sort(marks, {}, &Mark::at);
    std::vector<RowFace> faces;
    Mark begun{from};
    int open = 0;
    for (const Mark& mark : marks) {
        if (mark.at < from || mark.at > to) continue;
        if (mark.begins) {
            if (open++ == 0) begun = mark;
        } else if (open > 0) {
            if (--open == 0) faces.push_back({begun.at, mark.at, begun.edge, mark.edge});
        } else if (faces.empty()) {
            faces.push_back({from, mark.at, nullptr, mark.edge});
        } else {
            faces.back().to = mark.at;
            faces.back().end = mark.edge;
        }
    }
    if (open > 0) faces.push_back({begun.at, to, begun.edge});
    return faces;
}

/// The places where the straight way in the plane crosses edges, with those of the pair; none if it crosses no others.
std::vector<Mark> marksOn(const Line& line, const PairPath& path, double second,
                          std::span<const WallEdge* const> edges) {
    std::vector<Mark> marks;
    for (const WallEdge* edge : edges)
        if (Mark mark; edge != path.first && edge != path.second && crosses(line, *edge, mark)) marks.push_back(mark);
    if (marks.empty()) return marks;
    marks.push_back({0, true, path.first});
    marks.push_back({second, false, path.second});
    return marks;
}

Line lineOf(const PairPath& path) {
    return {path.byFirst, glm::normalize(path.bySecond - path.byFirst), path.atFirst.offFace(*path.first, true)};
}

/// The length that counts of the way from source or listener to the next edge: all of it in the plane, less above it.
double nearPlane(double toEdge, double whole, double cosine, double waveNumber) {
    const double length = std::max(0.0, toEdge * (whole - toEdge) / whole);
    return toEdge / (1 + waveNumber * length * (1 - cosine));
}

/// The faces on a way, and what gets along them to where it leaves the plane.
class Row {
  public:
    Row(const PairPath& path, const glm::dvec3& source, bool firstHides, const glm::dvec3& listener, bool secondHides,
        std::span<const WallEdge* const> edges)
        : source_(source), listener_(listener) {
        const double second = glm::distance(path.byFirst, path.bySecond);
        line_ = lineOf(path);
        std::vector<Mark> marks = marksOn(line_, path, second, edges);
        if (marks.empty()) return;
        from_ = std::min(0.0, glm::dot(source - line_.from, line_.along));
        to_ = std::max(second, glm::dot(listener - line_.from, line_.along));
        faces_ = facesOf(marks, from_, to_);
        // Seen from below the plane, the part beyond the edge hides the row, or does not.
        if (firstHides) std::erase_if(faces_, [&](const RowFace& one) { return one.to < 0; });
        if (secondHides) std::erase_if(faces_, [&](const RowFace& one) { return one.from > second; });
        const auto at = [&](double position) {
            const auto found = std::ranges::find_if(
                faces_, [&](const RowFace& one) { return one.from <= position && one.to >= position; });
            return static_cast<std::size_t>(found - faces_.begin());
        };
        first_ = at(0);
        last_ = at(second);
    }

    bool hasGaps() const { return faces_.size() > 1 && last_ < faces_.size(); }

    double fraction(double waveNumber) const {
        const double begin = faces_.front().from, end = faces_.back().to;
        const double toFirst = nearPlane(begin - from_, to_ - from_, cosine(source_, begin, -1), waveNumber);
        const double fromLast = nearPlane(to_ - end, to_ - from_, cosine(listener_, end, 1), waveNumber);
        double fraction = 1;
        for (std::size_t i = 0; i + 1 < faces_.size(); ++i) {
            const double gapFrom = faces_[i].to, gapTo = faces_[i + 1].from;
            const double left =
                leftBeyond(gapFrom - begin + toFirst, std::max(0.0, gapTo - gapFrom), end - gapTo + fromLast);
            if (i >= first_ && i < last_) fraction *= left;
            if (i + 1 == first_ || i == last_) fraction *= 2 - 2 * left;
        }
        return fraction;
    }

  private:
    /// The cosine of the angle between the plane and the way from an edge to a place.
    double cosine(const glm::dvec3& position, double edge, double side) const {
        const glm::dvec3 off = position - line_.from - edge * line_.along;
        const double length = glm::length(off);
        return length > 0 ? side * glm::dot(off, line_.along) / length : 1.0;
    }

    const glm::dvec3 &source_, &listener_;
    Line line_{};
    std::vector<RowFace> faces_;
    double from_ = 0, to_ = 0;
    std::size_t first_ = 0, last_ = 0;
};

}  // namespace

double leftBeyond(double before, double gap, double after) {
    const double whole = (before + gap) * (after + gap);
    if (!(whole > 0)) return 1;  // no gap, and nothing on one side of it
    const double square = before * after / whole;
    return 0.5 + std::asin(std::sqrt(std::clamp(square, 0.0, 1.0))) / std::numbers::pi;
}

std::vector<RowFace> facesBetween(const PairPath& path, std::span<const WallEdge* const> edges) {
    const double second = glm::distance(path.byFirst, path.bySecond);
    std::vector<Mark> marks = marksOn(lineOf(path), path, second, edges);
    return facesOf(marks, 0, second);
}

BodyWeights::Tones rowFractionOf(const PairPath& path, const glm::dvec3& source, bool firstHides,
                                 const glm::dvec3& listener, bool secondHides, std::span<const WallEdge* const> edges,
                                 double speedOfSound) {
    BodyWeights::Tones result;
    result.fill(1);
    const Row row(path, source, firstHides, listener, secondHides, edges);
    if (!row.hasGaps()) return result;
    for (std::size_t t = 0; t < kEdgeTones; ++t)
        result[t] = row.fraction(2 * std::numbers::pi * edgeToneHz(static_cast<double>(t)) / speedOfSound);
    return result;
}

}  // namespace rtsg
