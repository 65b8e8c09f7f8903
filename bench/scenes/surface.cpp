// Surfaces that bench scenes are made of: patches, boxes, lathes, tubes, tori.
#include "surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// Two directions at right angles to `axis`.
std::pair<Vec3f, Vec3f> across(Vec3f axis) {
    const Vec3f d = glm::normalize(axis);
    const Vec3f side = glm::normalize(glm::cross(d, std::abs(d.y) < .9f ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0)));
    return {side, glm::cross(side, d)};
}

}  // namespace

Surface& Surface::add(const Surface& other) {
    const auto base = static_cast<std::int32_t>(points.size());
    points.insert(points.end(), other.points.begin(), other.points.end());
    texCoords.insert(texCoords.end(), other.texCoords.begin(), other.texCoords.end());
    triangles.reserve(triangles.size() + other.triangles.size());
    for (const std::int32_t i : other.triangles) triangles.push_back(base + i);
    return *this;
}
Surface& Surface::transform(const std::function<Vec3f(Vec3f)>& transform) {
    for (Vec3f& p : points) p = transform(p);
    return *this;
}
Surface& Surface::move(Vec3f by) {
    for (Vec3f& p : points) p += by;
    return *this;
}
Surface& Surface::scale(Vec3f by) {
    for (Vec3f& p : points) p *= by;
    return *this;
}
Surface& Surface::rotate(float angle) {
    const float c = std::cos(angle), s = std::sin(angle);
    for (Vec3f& p : points) p = {c * p.x + s * p.z, p.y, c * p.z - s * p.x};
    return *this;
}

Surface patch(int nu, int nv, const Patch& at) {
    Surface out;
    for (int i = 0; i <= nu; ++i)
        for (int k = 0; k <= nv; ++k) {
            const float u = static_cast<float>(i) / static_cast<float>(nu),
                        v = static_cast<float>(k) / static_cast<float>(nv);
            out.points.push_back(at(u, v));
            out.texCoords.emplace_back(u, v);
        }
    for (int i = 0; i < nu; ++i)
        for (int k = 0; k < nv; ++k) {
            const int a = i * (nv + 1) + k, b = a + nv + 1;
            for (const int index : {a, b, b + 1, a, b + 1, a + 1}) out.triangles.push_back(index);
        }
    return out;
}

Surface box(Vec3f low, Vec3f high) {
    Surface out;
    const Vec3f size = high - low;
    // For each axis the two others in an order that makes the face of the high side counter-clockwise.
    for (int axis = 0; axis < 3; ++axis)
        for (const bool far : {false, true}) {
            const int a = (axis + 1) % 3, b = (axis + 2) % 3;
            const auto base = static_cast<std::int32_t>(out.points.size());
            for (const auto& [s, t] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
                Vec3f p = low;
                p[axis] = far ? high[axis] : low[axis];
                p[a] += static_cast<float>(s) * size[a];
                p[b] += static_cast<float>(t) * size[b];
                out.points.push_back(p);
                out.texCoords.push_back(axis == 0 ? Vec2f(p.z, p.y) : axis == 1 ? Vec2f(p.x, p.z) : Vec2f(p.x, p.y));
            }
            const std::array<int, 6> corners = far ? std::array{0, 1, 2, 0, 2, 3} : std::array{0, 2, 1, 0, 3, 2};
            for (const int i : corners) out.triangles.push_back(base + i);
        }
    return out;
}
Surface boxAt(Vec3f centre, Vec3f size) {
    return box(centre - size * .5f, centre + size * .5f);
}

Surface lathe(const Profile& profile, int segments, int rings) {
    std::vector<Vec3f> line;
    for (const Vec2f& p : profile) line.emplace_back(p.x, p.y, 0);
    return patch(rings, segments, [&](float u, float v) {
        const Vec3f p = along(line, u);
        const float angle = 2 * kPi * v, radius = std::max(0.0f, p.x);
        return Vec3f(radius * std::cos(angle), p.y, radius * std::sin(angle));
    });
}

Surface ellipsoid(Vec3f centre, Vec3f radii, int nu, int nv, float square) {
    return patch(nv, nu, [&](float u, float v) {
        const float theta = kPi * u, phi = 2 * kPi * v;
        const float ring = std::pow(std::max(0.0f, std::sin(theta)), square);
        return centre + radii * Vec3f(ring * signedPower(std::cos(phi), square), signedPower(std::cos(theta), square),
                                      ring * signedPower(std::sin(phi), square));
    });
}

Surface tube(const Curve& spine, const std::function<float(float)>& radius, int nu, int nv) {
    return patch(nu, nv, [&](float u, float v) {
        const float step = 1e-3f;
        const auto [side, up] = across(spine(std::min(1.0f, u + step)) - spine(std::max(0.0f, u - step)));
        const float angle = 2 * kPi * v;
        return spine(u) + radius(u) * (std::cos(angle) * side + std::sin(angle) * up);
    });
}
Surface rod(Vec3f from, Vec3f to, float radius, int segments, int rings) {
    return tube([&](float t) { return from + t * (to - from); }, [&](float) { return radius; }, rings, segments);
}
Surface torus(Vec3f centre, float ring, float thickness, int nu, int nv) {
    return patch(nu, nv, [&](float u, float v) {
        const float a = 2 * kPi * u, b = 2 * kPi * v, r = ring + thickness * std::cos(b);
        return centre + Vec3f(r * std::cos(a), r * std::sin(a), thickness * std::sin(b));
    });
}

Vec3f along(const std::vector<Vec3f>& points, float t) {
    const int last = static_cast<int>(points.size()) - 1;
    const float position = std::clamp(t, 0.0f, 1.0f) * static_cast<float>(last);
    const int i = std::min(static_cast<int>(position), last - 1);
    const float f = position - static_cast<float>(i);
    const auto at = [&](int k) { return points[static_cast<std::size_t>(std::clamp(k, 0, last))]; };
    const Vec3f a = at(i - 1), b = at(i), c = at(i + 1), d = at(i + 2);
    return b + .5f * f * (c - a + f * (2.0f * a - 5.0f * b + 4.0f * c - d + f * (3.0f * (b - c) + d - a)));
}

float signedPower(float x, float power) {
    return std::copysign(std::pow(std::abs(x), power), x);
}

float Dice::in(float low, float high) {
    // splitmix64
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15ull;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ z >> 27) * 0x94D049BB133111EBull;
    return low + (high - low) * static_cast<float>((z ^ z >> 31) >> 40) * 0x1p-24f;
}

float noise(Vec3f at) {
    const Vec3f cell = glm::floor(at), f = at - cell, w = f * f * (3.0f - 2.0f * f);
    const auto corner = [&](int i) {
        const auto x = static_cast<std::int32_t>(cell.x) + (i & 1),
                   y = static_cast<std::int32_t>(cell.y) + (i >> 1 & 1),
                   z = static_cast<std::int32_t>(cell.z) + (i >> 2);
        std::uint32_t h = static_cast<std::uint32_t>(x) * 73856093u ^ static_cast<std::uint32_t>(y) * 19349663u ^
                          static_cast<std::uint32_t>(z) * 83492791u;
        h = (h ^ h >> 15) * 0x2c1b3c6du;
        h = (h ^ h >> 12) * 0x297a2d39u;
        return static_cast<float>((h ^ h >> 15) >> 8) * 0x1p-23f - 1;
    };
    const auto line = [&](int i) { return glm::mix(corner(i), corner(i + 1), w.x); };
    const auto face = [&](int i) { return glm::mix(line(i), line(i + 2), w.y); };
    return glm::mix(face(0), face(4), w.z);
}

}  // namespace rtsg::bench
