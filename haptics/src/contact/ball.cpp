// Moves a ball among triangles: how far it gets, what it then touches, and along what it slides.
#include "ball.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace rtsg::haptics {

namespace {

constexpr int kSteps = 32;        // of a sweep: Newton's method, which needs few unless the ball grazes
constexpr int kSlides = 24;       // bends of a way
constexpr double kLittle = 1e-9;  // metres
constexpr double kSame = 1e-14;   // for normals: less than a path may lead against one

Vec3d unitOr(const Vec3d& v, const Vec3d& otherwise) {
    const double length = glm::length(v);
    return length > 1e-300 ? v / length : otherwise;
}

/// From the triangle to p; for one that p lies on, the triangle's own.
Vec3d normalTo(const Vec3d& p, const Vec3d& closest, const NearTriangle& t) {
    const Vec3d face = glm::cross(t.corners[1] - t.corners[0], t.corners[2] - t.corners[0]);
    return unitOr(p - closest, unitOr(face, Vec3d(0, 0, 1)));
}

/// Enough of it to have a plane.
bool hasArea(const Vec3d& ab, const Vec3d& ac) {
    const Vec3d across = glm::cross(ab, ac);
    return glm::dot(across, across) > 1e-28 * glm::dot(ab, ab) * glm::dot(ac, ac);
}

Vec3d closestOnEdges(const Vec3d& p, const Vec3d (&corners)[3]) {
    Vec3d best = corners[0];
    for (int i = 0; i < 3; ++i) {
        const Vec3d &a = corners[i], along = corners[(i + 1) % 3] - a;
        const double squared = glm::dot(along, along);
        const Vec3d at = a + (squared > 0 ? std::clamp(glm::dot(p - a, along) / squared, 0.0, 1.0) : 0.0) * along;
        if (glm::dot(p - at, p - at) < glm::dot(p - best, p - best)) best = at;
    }
    return best;
}

bool leadsAgainstNone(const Vec3d& displacement, const std::vector<Touching>& touching) {
    const double maximum = 1e-9 * glm::length(displacement);
    return std::ranges::all_of(touching,
                               [&](const Touching& t) { return glm::dot(t.normal, displacement) >= -maximum; });
}

}  // namespace

Vec3d closestOnTriangle(const Vec3d& p, const Vec3d (&corners)[3]) {
    const Vec3d &a = corners[0], &b = corners[1], &c = corners[2];
    const Vec3d ab = b - a, ac = c - a, ap = p - a;
    if (!hasArea(ab, ac)) return closestOnEdges(p, corners);
    const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return a;
    const Vec3d bp = p - b;
    const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return b;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + (d1 == d3 ? 0 : d1 / (d1 - d3)) * ab;
    const Vec3d cp = p - c;
    const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return c;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + (d2 == d6 ? 0 : d2 / (d2 - d6)) * ac;
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        const double sum = (d4 - d3) + (d5 - d6);
        return b + (sum == 0 ? 0 : (d4 - d3) / sum) * (c - b);
    }
    const double all = va + vb + vc;
    return all == 0 ? a : a + (vb / all) * ab + (vc / all) * ac;
}

/// The distance to a convex set is a convex function of the way, so each step of Newton's method ends before the ball
/// touches.
double freeFraction(const Vec3d& from, const Vec3d& displacement, double radius, const NearTriangle& triangle) {
    double fraction = 0;
    for (int step = 0; step < kSteps; ++step) {
        const Vec3d at = from + fraction * displacement, closest = closestOnTriangle(at, triangle.corners);
        const double gap = glm::length(at - closest) - radius - kSkin;
        const double approach = -glm::dot(normalTo(at, closest, triangle), displacement);  // metres for all of the way
        if (approach <= kLittle * glm::length(displacement) || gap > approach * (1 - fraction)) return 1;
        if (gap <= kLittle) return fraction;
        fraction += gap / approach;
    }
    return fraction;
}

double freeFraction(const Vec3d& from, const Vec3d& displacement, double radius,
                    const std::vector<NearTriangle>& triangles) {
    double fraction = 1;
    for (const NearTriangle& t : triangles) fraction = std::min(fraction, freeFraction(from, displacement, radius, t));
    return fraction;
}

std::vector<Touching> touched(const Vec3d& at, double radius, const std::vector<NearTriangle>& triangles,
                              double slack) {
    std::vector<Touching> result;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        const Vec3d closest = closestOnTriangle(at, triangles[i].corners);
        const double distance = glm::length(at - closest);
        if (distance > radius + 2 * kSkin + slack) continue;
        const Vec3d normal = normalTo(at, closest, triangles[i]);
        const auto same = std::ranges::find_if(
            result, [&](const Touching& other) { return glm::dot(other.normal, normal) > 1 - kSame; });
        if (same == result.end())
            result.push_back({normal, i, distance, closest});
        else if (distance < same->distance)
            *same = {normal, i, distance, closest};
    }
    return result;
}

/// The nearest vector of a cone lies inside, on one of its planes, on the line where two of them meet, or is 0.
Vec3d alongAll(const Vec3d& displacement, const std::vector<Touching>& touching) {
    if (leadsAgainstNone(displacement, touching)) return displacement;
    Vec3d best(0);
    double minimum = glm::dot(displacement, displacement);
    const auto consider = [&](const Vec3d& candidate) {
        const double off = glm::dot(displacement - candidate, displacement - candidate);
        if (off < minimum && leadsAgainstNone(candidate, touching)) best = candidate, minimum = off;
    };
    for (std::size_t i = 0; i < touching.size(); ++i) {
        const Vec3d& n = touching[i].normal;
        if (glm::dot(n, displacement) < 0) consider(displacement - glm::dot(n, displacement) * n);
        for (std::size_t j = 0; j < i; ++j) {
            const Vec3d line = glm::cross(n, touching[j].normal);
            const double squared = glm::dot(line, line);
            if (squared > 1e-12) consider(glm::dot(displacement, line) / squared * line);
        }
    }
    return best;
}

Vec3d slide(const Vec3d& from, const Vec3d& goal, double radius, const std::vector<NearTriangle>& triangles) {
    Vec3d at = from;
    for (int bend = 0; bend < kSlides; ++bend) {
        const Vec3d displacement = alongAll(goal - at, touched(at, radius, triangles));
        if (glm::dot(displacement, displacement) < kLittle * kLittle) break;
        at += freeFraction(at, displacement, radius, triangles) * displacement;
    }
    return at;
}

}  // namespace rtsg::haptics
