// Looks for the edges in a plane that a straight way crosses, and for the gaps between the faces that end there.
#include "edge_rows.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "edge_paths.h"

namespace rtsg {
namespace {

/// Where a face begins on the way, or ends; metres on from the first edge.
struct Mark {
    double at = 0;
    bool begins = false;
};

/// A part of the way, over a face or over a gap.
struct Part {
    double from, to;
};

/// The plane of a face, and the straight way in it.
struct Line {
    glm::dvec3 from, along, normal;  // the last into the air
};

/// Whether the line crosses the edge of a face in its plane, with the body below.
bool crosses(const Line& line, const WallEdge& edge, Mark& mark) {
    constexpr double kAlong = 1e-4;
    const glm::dvec3 way = edge.from - line.from;
    const double place = placeRounding(edge.from), rounding = 1e-5 * (glm::length(way) + edge.length) + 2 * place;
    if (std::abs(glm::dot(way, line.normal)) > rounding ||
        std::abs(glm::dot(edge.axis, line.normal)) > 1e-5 + 2 * place / edge.length)
        return false;
    const bool first = std::abs(glm::dot(edge.faceA, line.normal)) < kAlong;
    const glm::dvec3 &face = first ? edge.faceA : edge.faceB, &other = first ? edge.faceB : edge.faceA;
    const double toward = glm::dot(line.along, face);
    if (std::abs(glm::dot(face, line.normal)) >= kAlong || glm::dot(other, line.normal) >= kAlong ||
        std::abs(toward) < kAlong)
        return false;
    mark = {glm::dot(way, face) / toward, toward > 0};
    const double on = glm::dot(line.along * mark.at - way, edge.axis);
    return on >= 0 && on <= edge.length;
}

/// From edge to edge; where one is not known there is no gap.
std::vector<Part> facesOf(std::vector<Mark>& marks, double from, double to) {
    std::ranges::stable_sort(marks, {}, &Mark::at);
    std::vector<Part> faces;
    double begun = from;
    int open = 0;
    for (const Mark& mark : marks) {
        if (mark.at < from || mark.at > to) continue;
        if (mark.begins) {
            if (open++ == 0) begun = mark.at;
        } else if (open > 0) {
            if (--open == 0) faces.push_back({begun, mark.at});
        } else if (faces.empty()) {
            faces.push_back({from, mark.at});
        } else {
            faces.back().to = mark.at;
        }
    }
    if (open > 0) faces.push_back({begun, to});
    return faces;
}

/// Of the way from a place on to the edge next to it, in the plane, how much counts: all in the plane.
double nearPlane(double toEdge, double whole, double cosine, double waveNumber) {
    const double length = std::max(0.0, toEdge * (whole - toEdge) / whole);
    return toEdge / (1 + waveNumber * length * (1 - cosine));
}

double leftBeyond(double before, double gap, double after) {
    const double square = before * after / ((before + gap) * (after + gap));
    return 0.5 + std::asin(std::sqrt(std::clamp(square, 0.0, 1.0))) / std::numbers::pi;
}

}  // namespace

RowShare rowShareOf(const PairWay& way, const glm::dvec3& source, const glm::dvec3& listener,
                    std::span<const WallEdge* const> edges, double speedOfSound) {
    RowShare result;
    result.share.fill(1);
    const glm::dvec3 across = way.bySecond - way.byFirst;
    const double second = glm::length(across);
    const Line line{way.byFirst, across / second, way.atFirst.offFace(*way.first, true)};
    std::vector<Mark> marks;
    for (const WallEdge* edge : edges)
        if (Mark mark; edge != way.first && edge != way.second && crosses(line, *edge, mark)) marks.push_back(mark);
    if (marks.empty()) return result;
    marks.push_back({0, true});
    marks.push_back({second, false});
    const double from = std::min(0.0, glm::dot(source - line.from, line.along));
    const double to = std::max(second, glm::dot(listener - line.from, line.along));
    const std::vector<Part> faces = facesOf(marks, from, to);
    if (faces.size() < 2) return result;
    const double begin = faces.front().from, end = faces.back().to;
    const auto cosine = [&](const glm::dvec3& place, double edge, double side) {
        const glm::dvec3 off = place - line.from - edge * line.along;
        const double length = glm::length(off);
        return length > 0 ? side * glm::dot(off, line.along) / length : 1.0;
    };
    const double backward = cosine(source, begin, -1), forward = cosine(listener, end, 1);
    const double rounding = 1e-9 * (to - from);
    for (std::size_t i = 1; i < faces.size(); ++i) {
        const Part gap{faces[i - 1].to, faces[i].from};
        const bool before = std::abs(gap.to) <= rounding, after = std::abs(gap.from - second) <= rounding;
        if (!before && !after && (gap.from < 0 || gap.to > second)) continue;
        result.before = result.before || before;
        result.after = result.after || after;
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            const double k = 2 * std::numbers::pi * edgeToneHz(static_cast<double>(t)) / speedOfSound;
            const double a = gap.from - begin + nearPlane(begin - from, to - from, backward, k);
            const double b = end - gap.to + nearPlane(to - end, to - from, forward, k);
            const double left = leftBeyond(a, gap.to - gap.from, b);
            result.share[t] *= before || after ? 2 - 2 * left : left;
        }
    }
    return result;
}

}  // namespace rtsg
