// Moments of flat polygons, and planes by least squares.
#include "outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

namespace rtsg::opening {

glm::dvec3 anyAcross(const glm::dvec3& d) {
    return glm::normalize(glm::cross(d, std::abs(d.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
}

namespace {

/// A symmetric matrix's eigenvectors by Jacobi's rotations, those of the largest eigenvalues first.
std::array<glm::dvec3, 3> principalAxes(glm::dmat3 m) {
    glm::dmat3 axes(1);
    for (int sweep = 0; sweep < 24; ++sweep)
        for (int p = 0; p < 2; ++p)
            for (int q = p + 1; q < 3; ++q) {
                if (!(std::abs(m[p][q]) > 0)) continue;
                const double angle = 0.5 * std::atan2(2 * m[p][q], m[q][q] - m[p][p]);
                const double c = std::cos(angle), s = std::sin(angle);
                glm::dmat3 rotation(1);
                rotation[p][p] = rotation[q][q] = c;
                rotation[p][q] = -s, rotation[q][p] = s;
                m = glm::transpose(rotation) * m * rotation;
                axes = axes * rotation;
            }
    std::array<int, 3> order{0, 1, 2};
    std::sort(order.begin(), order.end(), [&](int a, int b) { return m[a][a] > m[b][b]; });
    return {axes[order[0]], axes[order[1]], axes[order[2]]};
}

}  // namespace

bool Outline::holds(const glm::dvec3& p, double scale, double slack) const {
    const glm::dvec2 at = flat(p);
    const glm::dvec2 nearer = at / std::max(1.0, scale);
    bool inside = false;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec2 a = corners[i], b = corners[(i + 1) % corners.size()];
        if ((a.y > nearer.y) != (b.y > nearer.y) && nearer.x < a.x + (nearer.y - a.y) / (b.y - a.y) * (b.x - a.x))
            inside = !inside;
        const glm::dvec2 edge = b - a;
        const double t = std::clamp(glm::dot(nearer - a, edge) / std::max(1e-300, glm::dot(edge, edge)), 0.0, 1.0);
        nearest = std::min(nearest, glm::distance(nearer, a + edge * t));
    }
    return inside || nearest <= slack;
}

double Outline::length() const {
    return rectangle().x;
}

double Outline::width() const {
    const glm::dvec2 size = rectangle();
    // The axis of a long and narrow outline is hardly known as well as that.
    return size.x > 10 * size.y ? area / size.x : size.y;
}

glm::dvec2 Outline::rectangle() const {
    constexpr double kRound = 0.8;
    constexpr int kSteps = 360;
    glm::dvec2 best(extent(0), extent(std::numbers::pi / 2));
    for (int i = 1; i < kSteps && halfWidth > kRound * halfLength; ++i) {
        const double angle = i * std::numbers::pi / 2 / kSteps;
        const glm::dvec2 size(extent(angle), extent(angle + std::numbers::pi / 2));
        if (size.x * size.y < best.x * best.y) best = size;
    }
    return halfWidth > kRound * halfLength && best.x < best.y ? glm::dvec2(best.y, best.x) : best;
}

/// From end to end in a direction, radians from `along`.
double Outline::extent(double angle) const {
    const glm::dvec2 direction(std::cos(angle), std::sin(angle));
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const glm::dvec2& corner : corners) {
        const double at = glm::dot(corner, direction);
        low = std::min(low, at);
        high = std::max(high, at);
    }
    return high - low;
}

Outline outlineOf(const std::vector<glm::dvec3>& corners, const glm::dvec3& normal) {
    Outline result;
    glm::dvec3 middle(0);
    for (const glm::dvec3& corner : corners) middle += corner / static_cast<double>(corners.size());
    const glm::dvec3 u = anyAcross(normal), v = glm::cross(normal, u);
    double area = 0;
    glm::dvec2 first(0);
    glm::dvec3 second(0);  // xx, yy, xy
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3 p = corners[i] - middle, q = corners[(i + 1) % corners.size()] - middle;
        const glm::dvec2 a(glm::dot(p, u), glm::dot(p, v)), b(glm::dot(q, u), glm::dot(q, v));
        const double part = (a.x * b.y - a.y * b.x) / 2;
        area += part;
        first += part / 3 * (a + b);
        second += part / 6 *
                  glm::dvec3(a.x * a.x + a.x * b.x + b.x * b.x, a.y * a.y + a.y * b.y + b.y * b.y,
                             a.x * a.y + b.x * b.y + (a.x * b.y + a.y * b.x) / 2);
    }
    if (!(std::abs(area) > 0)) return result;
    const glm::dvec2 c = first / area;
    const double xx = second.x / area - c.x * c.x, yy = second.y / area - c.y * c.y, xy = second.z / area - c.x * c.y;
    const double angle = 0.5 * std::atan2(2 * xy, xx - yy), half = std::hypot((xx - yy) / 2, xy), mean = (xx + yy) / 2;
    result.center = middle + u * c.x + v * c.y;
    result.normal = normal;
    result.along = u * std::cos(angle) + v * std::sin(angle);
    result.across = glm::cross(normal, result.along);
    result.halfLength = std::sqrt(3 * std::max(0.0, mean + half));
    result.halfWidth = std::sqrt(3 * std::max(0.0, mean - half));
    result.area = std::abs(area);
    for (const glm::dvec3& corner : corners) result.corners.push_back(result.flat(corner));
    return result;
}

std::optional<FittedPlane> planeOf(std::vector<glm::dvec3> positions) {
    constexpr std::size_t kMin = 8;
    constexpr int kTrims = 6;
    if (positions.size() < kMin) return std::nullopt;
    FittedPlane plane;
    std::size_t kept = positions.size();
    for (int trim = 0; trim < kTrims; ++trim) {
        const std::span<const glm::dvec3> best = std::span(positions).first(kept);
        plane.middle = glm::dvec3(0);
        for (const glm::dvec3& p : best) plane.middle += p / static_cast<double>(kept);
        glm::dmat3 spread(0);
        for (const glm::dvec3& p : best)
            spread += glm::outerProduct(p - plane.middle, p - plane.middle) / static_cast<double>(kept);
        const auto axes = principalAxes(spread);
        plane.normal = axes[2];
        plane.across = std::sqrt(std::max(0.0, glm::dot(axes[1], spread * axes[1])));
        plane.off = std::sqrt(std::max(0.0, glm::dot(axes[2], spread * axes[2])));
        std::sort(positions.begin(), positions.end(), [&](const glm::dvec3& a, const glm::dvec3& b) {
            return std::abs(glm::dot(a - plane.middle, plane.normal)) <
                   std::abs(glm::dot(b - plane.middle, plane.normal));
        });
        kept = std::max(kMin, positions.size() * 3 / 5);
    }
    return plane;
}

}  // namespace rtsg::opening
