// Finds out whether two edges lie on one line and share a part of it.
#include "diffraction_overlaps.h"

#include <algorithm>
#include <cmath>

#include "diffraction_paths.h"

namespace rtsg {
namespace {

glm::dvec3 endOf(const WallEdge& edge) {
    return edge.from + edge.axis * edge.length;
}

double boxVolume(const WallBody& body) {
    return std::abs(glm::determinant(body.half));
}

bool haveSameFaces(const WallEdge& a, const WallEdge& b) {
    const auto same = [](const glm::dvec3& face, const glm::dvec3& other) { return glm::dot(face, other) > 1 - 1e-6; };
    return (same(a.faceA, b.faceA) && same(a.faceB, b.faceB)) || (same(a.faceA, b.faceB) && same(a.faceB, b.faceA));
}

}  // namespace

double edgeRounding(const WallEdge& edge) {
    return 1e-9 + positionRounding(edge.from) + positionRounding(endOf(edge));
}

bool joinedEdge(const WallEdge& a, const WallEdge& b, WallEdge& both) {
    if (a.material != b.material) return false;
    // The direction of the longer one is known better.
    if (b.length > a.length) return joinedEdge(b, a, both);
    const double off = edgeRounding(a);
    const glm::dvec3 from = b.from - a.from, to = endOf(b) - a.from;
    double low = glm::dot(from, a.axis), high = glm::dot(to, a.axis);
    if (glm::distance(from, a.axis * low) > off || glm::distance(to, a.axis * high) > off) return false;
    if (low > high) std::swap(low, high);
    if (low > a.length + off || high < -off || !haveSameFaces(a, b)) return false;
    both = a;
    low = std::min(low, 0.0);
    both.from += a.axis * low;
    both.length = std::max(high, a.length) - low;
    // Of two bodies that stand in each other the larger one.
    if (!a.body || !b.body || boxVolume(*b.body) > boxVolume(*a.body)) both.body = a.body ? b.body : nullptr;
    return true;
}

}  // namespace rtsg
