// Reflects particles at triangles: parabolas are cut with planes.
#include "particle_bounds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace rtsg::detail {

namespace {

constexpr int kMaxReflections = 256;
constexpr double kNotMet = std::numeric_limits<double>::infinity();

/// Real roots of c + b t + a t^2, the smaller one first; infinity for those that are not.
std::array<double, 2> roots(double c, double b, double a) {
    if (a == 0) return {b == 0 ? kNotMet : -c / b, kNotMet};
    const double root = b * b - 4 * a * c;
    if (!(root >= 0)) return {kNotMet, kNotMet};
    // Neither difference is one of nearly equal numbers.
    const double q = -.5 * (b + std::copysign(std::sqrt(root), b));
    const double one = q / a, other = q == 0 ? kNotMet : c / q;
    return {std::min(one, other), std::max(one, other)};
}

}  // namespace

void ParticleWalls::add(const Mesh& mesh) {
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Vec3d a(mesh.vertex(t, 0)), b(mesh.vertex(t, 1)), c(mesh.vertex(t, 2));
        const Vec3d e = b - a, f = c - a, n = glm::cross(e, f);
        const double area = glm::length(n);
        if (!(area > 0) || !std::isfinite(area)) continue;
        walls_.push_back({a, n / area, glm::cross(f, n) / (area * area), glm::cross(n, e) / (area * area),
                          glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c))});
    }
}

double ParticleWalls::meeting(const Wall& wall, const Vec3d& p, const Vec3d& v, const Vec3d& a, double seconds) {
    const Vec3d to = p - wall.corner;
    for (const double t : roots(glm::dot(wall.normal, to), glm::dot(wall.normal, v), .5 * glm::dot(wall.normal, a))) {
        if (!(t > 0) || !(t <= seconds)) continue;
        const Vec3d at = to + v * t + a * (.5 * t * t);
        // A little over the edge still counts: nothing slips between two walls that share one.
        constexpr double kSlack = 1e-9;
        const double x = glm::dot(at, wall.u), y = glm::dot(at, wall.v);
        if (x >= -kSlack && y >= -kSlack && x + y <= 1 + kSlack) return t;
    }
    return kNotMet;
}

bool ParticleWalls::move(Vec3d& p, Vec3d& v, const Vec3d& a, double seconds) const {
    for (int reflections = 0; reflections < kMaxReflections; ++reflections) {
        const Vec3d end = p + v * seconds + a * (.5 * seconds * seconds);
        Vec3d low = glm::min(p, end), high = glm::max(p, end);
        for (int i = 0; i < 3; ++i) {
            // The vertex of the parabola, where it turns.
            const double t = a[i] == 0 ? -1 : -v[i] / a[i];
            if (!(t > 0 && t < seconds)) continue;
            const double angle = p[i] + .5 * v[i] * t;
            low[i] = std::min(low[i], angle), high[i] = std::max(high[i], angle);
        }
        double first = kNotMet;
        const Wall* met = nullptr;
        for (const Wall& wall : walls_) {
            if (glm::any(glm::lessThan(wall.high, low)) || glm::any(glm::greaterThan(wall.low, high))) continue;
            if (const double t = meeting(wall, p, v, a, seconds); t < first) first = t, met = &wall;
        }
        if (!met) {
            p = end;
            v += a * seconds;
            return true;
        }
        // It goes on from just beside the wall, on the side that it came from.
        const Vec3d at = p + v * first + a * (.5 * first * first), came = v + a * first;
        const double into = glm::dot(came, met->normal);
        const double beside = 1e-9 * (1 + glm::length(at)) * (into > 0 ? -1 : 1);
        p = at + met->normal * beside;
        v = came - met->normal * (2 * into);
        seconds -= first;
    }
    v = Vec3d(0);
    return false;
}

}  // namespace rtsg::detail
