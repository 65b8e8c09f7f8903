// The first contact of a cylinder or a ball with a triangle.
#include "avatar_sweep.h"

#include <algorithm>
#include <cmath>

namespace rtsg {

namespace {

constexpr double kContact = 1e-9;  // metres

glm::dvec3 nearestOnSegment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3 along = b - a;
    const double square = glm::dot(along, along);
    return square > 0 ? a + along * std::clamp(glm::dot(p - a, along) / square, 0.0, 1.0) : a;
}

/// A convex polygon in a plane; `normal` need not have length 1, and 0 stands for a polygon that is a line.
struct Polygon {
    std::array<glm::dvec3, 8> corners{};
    std::size_t count = 0;
    glm::dvec3 normal{0};

    void add(const glm::dvec3& p) {
        if (count < corners.size()) corners[count++] = p;
    }
    glm::dvec3 nearest(const glm::dvec3& p) const {
        const double square = glm::dot(normal, normal);
        bool inside = square > 0;
        for (std::size_t i = 0; i < count && inside; ++i) {
            const glm::dvec3 &a = corners[i], &b = corners[(i + 1) % count];
            inside = glm::dot(glm::cross(b - a, p - a), normal) >= 0;
        }
        if (inside) return p - normal * (glm::dot(p - corners[0], normal) / square);
        glm::dvec3 best = corners[0];
        double minimum = INFINITY;
        for (std::size_t i = 0; i < count; ++i) {
            const glm::dvec3 q = nearestOnSegment(p, corners[i], corners[(i + 1) % count]);
            if (const double away = glm::dot(p - q, p - q); away < minimum) minimum = away, best = q;
        }
        return best;
    }
};

/// The part of a triangle between two heights.
Polygon slab(const std::array<glm::dvec3, 3>& triangle, double low, double high) {
    Polygon from;
    for (const glm::dvec3& corner : triangle) from.add(corner);
    for (const double sign : {1.0, -1.0}) {
        Polygon to;
        const auto above = [&](const glm::dvec3& p) { return sign > 0 ? p.y - low : high - p.y; };
        for (std::size_t i = 0; i < from.count; ++i) {
            const glm::dvec3 &a = from.corners[i], &b = from.corners[(i + 1) % from.count];
            const double ya = above(a), yb = above(b);
            if (ya >= 0) to.add(a);
            if ((ya > 0 && yb < 0) || (ya < 0 && yb > 0)) to.add(a + (b - a) * (ya / (ya - yb)));
        }
        from = to;
    }
    return from;
}

/// Newton's method on distance minus radius along the way.
std::optional<Met> firstContact(const Polygon& shape, const AvatarPath& path, double radius) {
    constexpr int kSteps = 64;
    constexpr double kApproach = 1e-6;  // along the way, to count as one
    double gone = 0;
    for (int i = 0; i < kSteps; ++i) {
        const glm::dvec3 at = path.eye + path.direction * gone, away = at - shape.nearest(at);
        const double distance = glm::length(away);
        if (!(distance > 0)) return std::nullopt;  // within it: there is no side to keep it on
        const double slope = glm::dot(path.direction, away) / distance, room = distance - radius;
        if (!(slope < -kApproach)) return std::nullopt;
        if (room <= kContact) return Met{gone, away / distance};
        gone += room / -slope;
        if (gone > path.length) return std::nullopt;
    }
    return Met{gone, -path.direction};
}

}  // namespace

SweptBall ballAround(const AvatarPath& path, const Avatar& avatar) {
    SweptBall ball{path.eye + path.direction * (path.length / 2), path.length / 2 + avatar.radius};
    if (!path.walks) return ball;
    const double half = std::max(0.0, avatar.height - avatar.step) / 2;
    ball.center.y -= half;
    ball.radius = std::sqrt(ball.radius * ball.radius + half * half);
    return ball;
}

std::optional<Met> sweepAvatar(const AvatarPath& path, const Avatar& avatar,
                               const std::array<glm::dvec3, 3>& triangle) {
    const glm::dvec3 normal = glm::cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
    const double area = glm::length(normal);
    if (!(area > 0) || !std::isfinite(area)) return std::nullopt;
    Polygon shape;
    if (!path.walks) {
        for (const glm::dvec3& corner : triangle) shape.add(corner);
        shape.normal = normal / area;
        return firstContact(shape, path, avatar.radius);
    }
    // What is gentle and below the eyes is ground.
    const double above = glm::dot(path.eye - triangle[0], normal);
    if (std::abs(normal.y) > kSteepest * area && (above >= 0) == (normal.y >= 0)) return std::nullopt;
    const double low = std::min(0.0, avatar.step * (1 + kStepMargin) - avatar.height);
    shape = slab(triangle, path.eye.y + low, path.eye.y);
    if (shape.count == 0) return std::nullopt;
    for (std::size_t i = 0; i < shape.count; ++i) shape.corners[i].y = path.eye.y;
    // Seen from above; a triangle that stands upright is a line there.
    constexpr double kUpright = 1e-9;
    if (std::abs(normal.y) > kUpright * area) shape.normal = {0, normal.y > 0 ? 1 : -1, 0};
    return firstContact(shape, path, avatar.radius);
}

}  // namespace rtsg
