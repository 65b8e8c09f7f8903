// Points and moving balls against one triangle, in double precision.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <rtsg/core/value.h>

namespace rtsg::exact {

struct Triangle {
    Vec3d a, b, c;
    Vec3d at(double u, double v) const { return a + u * (b - a) + v * (c - a); }
};

/// A point of a triangle: weights of b and c.
struct Weights {
    double u = 0, v = 0;
};

/// The place along segment ab, in [0, 1], of its point nearest to p.
inline double nearestOnSegment(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
    const Vec3d ab = b - a;
    const double squared = glm::dot(ab, ab);
    return squared > 0 ? std::clamp(glm::dot(p - a, ab) / squared, 0.0, 1.0) : 0.0;
}

/// The foot of `p`'s perpendicular on the triangle, if that has an area to speak of and the foot falls inside.
inline std::optional<Weights> foot(const Vec3d& p, const Triangle& t) {
    const Vec3d ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a, normal = glm::cross(ab, ac);
    const double squared = glm::dot(normal, normal);
    // Below a sine of 1e-8 rounding decides, and the edges are the triangle.
    if (!(squared > 1e-16 * glm::dot(ab, ab) * glm::dot(ac, ac))) return {};
    const Weights w{glm::dot(glm::cross(ap, ac), normal) / squared, glm::dot(glm::cross(ab, ap), normal) / squared};
    if (w.u >= 0 && w.v >= 0 && w.u + w.v <= 1) return w;
    return {};
}

/// The nearest point of a triangle, which may have no area.
inline Weights nearest(const Vec3d& p, const Triangle& t) {
    if (const auto inside = foot(p, t)) return *inside;
    // Otherwise it is on an edge: the best of three. Also right for slivers, whose interior is their edges.
    const double s = nearestOnSegment(p, t.a, t.b), r = nearestOnSegment(p, t.a, t.c),
                 q = nearestOnSegment(p, t.b, t.c);
    Weights best{s, 0};
    double minimum = std::numeric_limits<double>::infinity();
    for (const Weights w : {Weights{s, 0}, Weights{0, r}, Weights{1 - q, q}}) {
        const Vec3d d = t.at(w.u, w.v) - p;
        if (const double squared = glm::dot(d, d); squared < minimum) minimum = squared, best = w;
    }
    return best;
}

/// The smaller root >= 0 of a x^2 + 2 b x + c with c > 0 (outside at the start): when the boundary is entered.
inline std::optional<double> entry(double a, double b, double c) {
    if (!(b < 0) || a <= 0) return {};
    const double discriminant = b * b - a * c;
    if (discriminant < 0) return {};
    return c / (-b + std::sqrt(discriminant));
}

struct Contact {
    double time = 0;  // in lengths of the movement
    Weights where;
};

/// When a ball first touches the triangle on its way from `center` to `center + movement`; at time 0 if it overlaps.
inline std::optional<Contact> sweep(const Vec3d& center, double radius, const Vec3d& movement, const Triangle& t) {
    const Weights first = nearest(center, t);
    const Vec3d apart = t.at(first.u, first.v) - center;
    const double squared = radius * radius;
    if (glm::dot(apart, apart) <= squared) return Contact{0, first};
    std::optional<Contact> best;
    const auto offer = [&](double time, Weights where) {
        if (time >= 0 && time <= 1 && (!best || time < best->time)) best = Contact{time, where};
    };
    // The face: the point of the ball nearest to the plane arrives inside.
    const Vec3d ab = t.b - t.a, ac = t.c - t.a, normal = glm::cross(ab, ac);
    const double length = glm::length(normal);
    if (length > 0) {
        const double height = glm::dot(center - t.a, normal) / length, speed = glm::dot(movement, normal) / length;
        const double time = speed != 0 ? ((height > 0 ? radius : -radius) - height) / speed : -1;
        // A ball that cuts the plane already is beside the triangle: it meets an edge or a corner.
        if (std::abs(height) >= radius && time >= 0 && time <= 1) {
            // Nothing can be touched sooner than the face from inside its prism.
            if (const auto inside = foot(center + time * movement, t)) return Contact{time, *inside};
        }
    }
    const double moved = glm::dot(movement, movement);
    const auto corner = [&](const Vec3d& p, Weights where) {
        const Vec3d from = center - p;
        if (const auto time = entry(moved, glm::dot(movement, from), glm::dot(from, from) - squared))
            offer(*time, where);
    };
    corner(t.a, {0, 0});
    corner(t.b, {1, 0});
    corner(t.c, {0, 1});
    const auto edge = [&](const Vec3d& p, const Vec3d& q, Weights atP, Weights atQ) {
        const Vec3d d = q - p, from = center - p;
        const double dd = glm::dot(d, d);
        if (!(dd > 0)) return;
        // Without what runs along the edge: a point against a circle.
        const Vec3d m = movement - d * (glm::dot(movement, d) / dd), f = from - d * (glm::dot(from, d) / dd);
        const double outside = glm::dot(f, f) - squared;
        if (outside <= 0) return;  // inside the endless cylinder: a corner or the face comes first
        if (const auto time = entry(glm::dot(m, m), glm::dot(m, f), outside)) {
            const double along = (glm::dot(from, d) + *time * glm::dot(movement, d)) / dd;
            if (along >= 0 && along <= 1)
                offer(*time, {atP.u + along * (atQ.u - atP.u), atP.v + along * (atQ.v - atP.v)});
        }
    };
    edge(t.a, t.b, {0, 0}, {1, 0});
    edge(t.a, t.c, {0, 0}, {0, 1});
    edge(t.b, t.c, {1, 0}, {0, 1});
    return best;
}

}  // namespace rtsg::exact
