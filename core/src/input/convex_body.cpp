// Triangles against convex bodies: closed forms for solids of revolution and boxes, distances for hulls.
#include "convex_body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include <rtsg/core/portable_math.h>

namespace rtsg {

namespace {

constexpr double kTouch = 1e-9;  // of the body's size
constexpr double kFar = std::numeric_limits<double>::infinity();

bool isFiniteTriangle(const ConvexBody::Triangle& triangle) {
    return std::ranges::all_of(
        triangle, [](const Vec3d& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); });
}

/// Which part of a line from `from` on lies within `half` of 0 along one axis; `first > last`: none.
void clipToSlab(double from, double along, double half, double& first, double& last) {
    if (along == 0) {
        if (std::abs(from) > half) first = kFar;
        return;
    }
    const double a = (-half - from) / along, b = (half - from) / along;
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
}

/// The point of a simplex of up to four points that is nearest to the origin, and which of them it takes.
struct Nearest {
    Vec3d point{0};
    std::array<Vec3d, 4> corners;
    std::size_t count = 0;
    double squared = kFar;

    void offer(const Vec3d& at, std::initializer_list<Vec3d> of) {
        const double size = glm::dot(at, at);
        if (!(size < squared)) return;
        squared = size;
        point = at;
        count = of.size();
        std::ranges::copy(of, corners.begin());
    }
    void corner(const Vec3d& a) { offer(a, {a}); }
    void edge(const Vec3d& a, const Vec3d& b) {
        const Vec3d ab = b - a;
        const double t = -glm::dot(a, ab) / glm::dot(ab, ab);
        if (t > 0 && t < 1) offer(a + t * ab, {a, b});
    }
    void face(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
        const Vec3d n = glm::cross(b - a, c - a);
        const double size = glm::dot(n, n);
        if (!(size > 0)) return;
        // On the inner side of each edge.
        if (glm::dot(glm::cross(a, b), n) > 0 && glm::dot(glm::cross(b, c), n) > 0 && glm::dot(glm::cross(c, a), n) > 0)
            offer(n * (glm::dot(a, n) / size), {a, b, c});
    }
    /// Whether the origin is within.
    static bool holds(const std::array<Vec3d, 4>& p) {
        const auto volume = [](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
            return glm::dot(a, glm::cross(b, c));
        };
        // The four parts that the origin cuts the tetrahedron into, all turned alike by more than rounding may.
        double size = 0;
        for (const Vec3d& one : p) size = std::max(size, glm::dot(one, one));
        const double noise = 1e-14 * size * std::sqrt(size);
        const double parts[] = {volume(p[1], p[2], p[3]), -volume(p[0], p[2], p[3]), volume(p[0], p[1], p[3]),
                                -volume(p[0], p[1], p[2])};
        return std::ranges::all_of(parts, [&](double v) { return v > noise; }) ||
               std::ranges::all_of(parts, [&](double v) { return v < -noise; });
    }
};

Nearest nearestOf(const std::array<Vec3d, 4>& p, std::size_t count) {
    Nearest nearest;
    for (std::size_t i = 0; i < count; ++i) {
        nearest.corner(p[i]);
        for (std::size_t j = 0; j < i; ++j) {
            nearest.edge(p[j], p[i]);
            for (std::size_t k = 0; k < j; ++k) nearest.face(p[k], p[j], p[i]);
        }
    }
    return nearest;
}

const Vec3d& farthest(std::span<const Vec3d> points, const Vec3d& direction) {
    return *std::ranges::max_element(points, {}, [&](const Vec3d& p) { return glm::dot(p, direction); });
}

}  // namespace

ConvexBody ConvexBody::box(const Vec3d& half) {
    return {Kind::box, half * (1 + kTouch)};
}
ConvexBody ConvexBody::sphere(double radius) {
    return {Kind::sphere, Vec3d(radius * (1 + kTouch))};
}
ConvexBody ConvexBody::cylinder(double radius, double halfHeight) {
    return {Kind::cylinder, Vec3d(radius, halfHeight, radius) * (1 + kTouch)};
}
ConvexBody ConvexBody::cone(double bottomRadius, double halfHeight) {
    if (halfHeight == 0) return cylinder(bottomRadius, 0);
    return {Kind::cone, Vec3d(bottomRadius, halfHeight, bottomRadius) * (1 + kTouch)};
}
ConvexBody ConvexBody::hull(std::vector<Vec3d> points) {
    Vec3d low(kFar), high(-kFar);
    for (const Vec3d& p : points) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    ConvexBody body(Kind::hull, (high - low) * .5);
    body.center_ = (low + high) * .5;
    for (Vec3d& p : points) p -= body.center_;
    body.points_ = std::move(points);
    return body;
}

/// The point of the body that is farthest along a direction. Nobody asks this for hulls.
Vec3d ConvexBody::support(const Vec3d& direction) const {
    const double x = direction.x, y = direction.y, z = direction.z;
    if (kind_ == Kind::box) return {std::copysign(half_.x, x), std::copysign(half_.y, y), std::copysign(half_.z, z)};
    if (kind_ == Kind::sphere) return glm::normalize(direction) * half_.x;
    const double across = portable::hypot(x, z);
    const double rx = across > 0 ? half_.x * (x / across) : 0, rz = across > 0 ? half_.x * (z / across) : 0;
    if (kind_ == Kind::cylinder) return {rx, std::copysign(half_.y, y), rz};
    return half_.x * across - half_.y * y > half_.y * y ? Vec3d(rx, -half_.y, rz) : Vec3d(0, half_.y, 0);
}

/// Finds the smallest value along the segment of a convex function that is at most 0 inside the body.
bool ConvexBody::segmentMeets(const Vec3d& from, const Vec3d& to) const {
    const Vec3d along = to - from;
    double first = 0, last = 1;
    if (kind_ != Kind::sphere) clipToSlab(from.y, along.y, half_.y, first, last);
    if (kind_ == Kind::box) {
        clipToSlab(from.x, along.x, half_.x, first, last);
        clipToSlab(from.z, along.z, half_.z, first, last);
    }
    if (first > last) return false;
    if (kind_ == Kind::box) return true;
    const double r = half_.x, h = half_.y, slope = kind_ == Kind::cone ? r / (2 * h) : 0;
    const double upright = kind_ == Kind::sphere ? 1 : -slope * slope;  // what y^2 counts
    const auto inside = [&](double t) {
        const Vec3d p = from + t * along;
        if (kind_ == Kind::sphere) return glm::dot(p, p) <= r * r;
        return portable::hypot(p.x, p.z) <= (kind_ == Kind::cone ? slope * (h - p.y) : r);
    };
    if (inside(first) || inside(last)) return true;
    // The place where x^2 + z^2 + upright (y - top)^2 is least.
    const double y = from.y - (kind_ == Kind::cone ? h : 0);
    const double a = along.x * along.x + along.z * along.z + upright * along.y * along.y;
    const double b = from.x * along.x + from.z * along.z + upright * y * along.y;
    return a > 0 && inside(std::clamp(-b / a, first, last));
}

bool ConvexBody::sectionMeets(const Triangle& t) const {
    const Vec3d normal = glm::cross(t[1] - t[0], t[2] - t[0]);
    if (!(glm::dot(normal, normal) > 0)) return false;
    // Between the body's lowest and highest point above the plane.
    const Vec3d low = support(-normal), high = support(normal);
    const double bottom = glm::dot(low, normal), top = glm::dot(high, normal), at = glm::dot(t[0], normal);
    if (at < bottom || at > top) return false;
    const Vec3d section = top > bottom ? low + (high - low) * ((at - bottom) / (top - bottom)) : low;
    for (std::size_t i = 0; i < 3; ++i)
        if (glm::dot(glm::cross(t[(i + 1) % 3] - t[i], section - t[i]), normal) < 0) return false;
    return true;
}

/// Whether the hull and the triangle are apart, by the point nearest to the origin of their differences.
bool ConvexBody::hullMeets(const Triangle& triangle) const {
    constexpr int kMaxSteps = 100;
    const double touch = kTouch * std::max({half_.x, half_.y, half_.z}) + std::numeric_limits<double>::min();
    std::array<Vec3d, 4> simplex{points_.front() - triangle[0]};
    std::size_t count = 1;
    Vec3d nearest = simplex[0];
    for (int step = 0; step < kMaxSteps; ++step) {
        const double distance = glm::length(nearest);
        if (distance <= touch) return true;
        const Vec3d next = farthest(points_, -nearest) - farthest(triangle, nearest);
        const double proved = glm::dot(nearest, next) / distance;  // no point is nearer
        if (proved > touch) return false;
        if (std::find(simplex.begin(), simplex.begin() + count, next) != simplex.begin() + count) break;
        simplex[count++] = next;
        if (count == 4 && Nearest::holds(simplex)) return true;
        const Nearest found = nearestOf(simplex, count);
        if (!(found.squared < glm::dot(nearest, nearest))) break;
        nearest = found.point;
        simplex = found.corners;
        count = found.count;
    }
    // Neither was proved: rounding decides, and what rounding cannot tell apart meets.
    return true;
}

bool ConvexBody::meets(const Triangle& triangle) const {
    if (!isFiniteTriangle(triangle)) return false;
    const Triangle t{triangle[0] - center_, triangle[1] - center_, triangle[2] - center_};
    const Vec3d low = glm::min(glm::min(t[0], t[1]), t[2]), high = glm::max(glm::max(t[0], t[1]), t[2]);
    const Vec3d reach = half_ + kTouch * std::max({half_.x, half_.y, half_.z});
    if (glm::any(glm::greaterThan(low, reach)) || glm::any(glm::lessThan(high, -reach))) return false;
    if (kind_ == Kind::hull) return hullMeets(t);
    for (std::size_t i = 0; i < 3; ++i)
        if (segmentMeets(t[i], t[(i + 1) % 3])) return true;
    return sectionMeets(t);
}

}  // namespace rtsg
