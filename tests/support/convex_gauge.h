// How deep a triangle is in a convex body, by nested search in double precision: independent of the closed forms that
// the library uses, slow, and exact to about a billionth of the triangle's size.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include <glm/glm.hpp>

namespace rtsg::test {

/// At most 0 within the body and on its surface; convex.
using Gauge = std::function<double(const glm::dvec3&)>;

inline Gauge boxGauge(const glm::dvec3& half) {
    return [=](const glm::dvec3& p) {
        const glm::dvec3 d = glm::abs(p) - half;
        return std::max({d.x, d.y, d.z});
    };
}
inline Gauge sphereGauge(double r) {
    return [=](const glm::dvec3& p) { return glm::length(p) - r; };
}
inline Gauge cylinderGauge(double r, double halfHeight) {
    return [=](const glm::dvec3& p) { return std::max(std::hypot(p.x, p.z) - r, std::abs(p.y) - halfHeight); };
}
/// The apex above.
inline Gauge coneGauge(double r, double halfHeight) {
    return [=](const glm::dvec3& p) {
        const double side = 2 * halfHeight * std::hypot(p.x, p.z) - r * (halfHeight - p.y);
        return std::max(side / std::hypot(2 * halfHeight, r), -halfHeight - p.y);
    };
}
/// The gauge of every plane through three of the points that has all others on one side. Precondition: the points are
/// not in one plane.
inline Gauge hullGauge(const std::vector<glm::dvec3>& points) {
    std::vector<std::pair<glm::dvec3, double>> planes;
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            for (std::size_t k = 0; k < j; ++k) {
                const glm::dvec3 n = glm::cross(points[j] - points[i], points[k] - points[i]);
                if (glm::length(n) < 1e-9) continue;
                for (const glm::dvec3& normal : {glm::normalize(n), -glm::normalize(n)}) {
                    double maximum = -INFINITY;
                    for (const glm::dvec3& p : points) maximum = std::max(maximum, glm::dot(p - points[i], normal));
                    if (maximum < 1e-12) planes.emplace_back(normal, glm::dot(points[i], normal));
                }
            }
    return [planes](const glm::dvec3& p) {
        double maximum = -INFINITY;
        for (const auto& [normal, at] : planes) maximum = std::max(maximum, glm::dot(p, normal) - at);
        return maximum;
    };
}

/// The least value of a convex function on [0, 1].
template <class F>
double minOnUnit(const F& f) {
    double low = 0, high = 1;
    for (int i = 0; i < 64; ++i) {
        const double a = low + (high - low) / 3, b = high - (high - low) / 3;
        (f(a) < f(b) ? high : low) = f(a) < f(b) ? b : a;
    }
    return std::min({f(low), f(high), f(0), f(1)});
}

inline double minOnTriangle(const Gauge& gauge, const std::array<glm::dvec3, 3>& t) {
    return minOnUnit([&](double u) {
        return minOnUnit([&](double v) { return gauge(t[0] + u * (t[1] - t[0]) + v * (1 - u) * (t[2] - t[0])); });
    });
}

}  // namespace rtsg::test
