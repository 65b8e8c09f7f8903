// A knotted tube of any number of facets, as nodes.
#include "knot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/core/x3d.h>

namespace rtsg::bench {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kAround = 12;

int along(const KnotOptions& options) {
    return std::max(8, options.triangles / (2 * kAround));
}

Vec3f onKnot(float t) {
    return Vec3f((2 + std::cos(3 * t)) * std::cos(2 * t), (2 + std::cos(3 * t)) * std::sin(2 * t), std::sin(3 * t));
}

}  // namespace

Array<Vec3f> knotPoints(const KnotOptions& options, float phase) {
    const int rings = along(options);
    Array<Vec3f> points = Array<Vec3f>::ofSize(static_cast<std::size_t>(rings) * kAround);
    Vec3f* out = points.mutableData();
    const float wave = std::sin(2 * kPi * phase);
    for (int a = 0; a < rings; ++a) {
        const float t = 2 * kPi * static_cast<float>(a) / static_cast<float>(rings);
        const Vec3f centre = onKnot(t), tangent = glm::normalize(onKnot(t + 1e-3f) - onKnot(t - 1e-3f));
        const Vec3f side = glm::normalize(glm::cross(tangent, Vec3f(0, 0, 1))), up = glm::cross(tangent, side);
        const float radius = .35f * (1 + .3f * std::sin(5 * t + 2 * kPi * phase));
        for (int k = 0; k < kAround; ++k) {
            const float u = 2 * kPi * static_cast<float>(k) / kAround;
            const Vec3f p = centre + radius * (std::cos(u) * side + std::sin(u) * up);
            const float angle = options.twist * wave * p.z, c = std::cos(angle), s = std::sin(angle);
            *out++ = Vec3f(c * p.x - s * p.y, s * p.x + c * p.y, p.z);
        }
    }
    return points;
}

Knot addKnot(Scene& scene, const KnotOptions& options, NodeId parent) {
    const int rings = along(options);
    Array<std::int32_t> index, texCoordIndex;
    Array<Vec2f> st;
    for (int a = 0; a <= rings; ++a)
        for (int k = 0; k <= kAround; ++k)
            st.push_back({static_cast<float>(k) / kAround, static_cast<float>(a) / static_cast<float>(rings) * 20});
    for (int a = 0; a < rings; ++a)
        for (int k = 0; k < kAround; ++k) {
            const int corners[4][2] = {{a, k}, {a, k + 1}, {a + 1, k + 1}, {a + 1, k}};
            const auto add = [&](int c) {
                const auto [i, j] = corners[c];
                index.push_back(i % rings * kAround + j % kAround);
                texCoordIndex.push_back(i * (kAround + 1) + j);
            };
            const auto end = [&] { index.push_back(-1), texCoordIndex.push_back(-1); };
            if (options.quads) {
                add(0), add(1), add(2), add(3), end();
            } else {
                add(0), add(1), add(2), end();
                add(0), add(2), add(3), end();
            }
        }
    Array<float> keys;
    Array<Vec3f> keyValues;
    const int count = std::max(2, options.keys);
    for (int i = 0; i < count; ++i) {
        const float phase = static_cast<float>(i) / static_cast<float>(count - 1);
        keys.push_back(phase);
        keyValues.append(knotPoints(options, i == count - 1 ? 0 : phase).span());
    }

    Knot knot;
    knot.shape = scene.createNode(x3d::Shape::type);
    knot.faces = scene.createNode(x3d::IndexedFaceSet::type);
    knot.coordinate = scene.createNode(x3d::Coordinate::type);
    knot.interpolator = scene.createNode(x3d::CoordinateInterpolator::type);
    knot.clock = scene.createNode(x3d::TimeSensor::type);
    const NodeId texture = scene.createNode(x3d::TextureCoordinate::type);
    const NodeId appearance = scene.createNode(x3d::Appearance::type), material = scene.createNode(x3d::Material::type);
    (void)scene.set(material, x3d::Material::diffuseColor, Color{.9f, .6f, .2f});
    (void)scene.set(appearance, x3d::Appearance::material, material);
    (void)scene.set(texture, x3d::TextureCoordinate::point, st);
    (void)scene.set(knot.coordinate, x3d::Coordinate::point, knotPoints(options, 0));
    (void)scene.set(knot.faces, x3d::IndexedFaceSet::coordIndex, index);
    (void)scene.set(knot.faces, x3d::IndexedFaceSet::texCoordIndex, texCoordIndex);
    (void)scene.set(knot.faces, x3d::IndexedFaceSet::creaseAngle, options.creaseAngle);
    (void)scene.set(knot.faces, x3d::IndexedFaceSet::coord, knot.coordinate);
    (void)scene.set(knot.faces, x3d::IndexedFaceSet::texCoord, texture);
    (void)scene.set(knot.shape, x3d::Shape::geometry, knot.faces);
    (void)scene.set(knot.shape, x3d::Shape::appearance, appearance);
    (void)scene.set(knot.interpolator, x3d::CoordinateInterpolator::key, keys);
    (void)scene.set(knot.interpolator, x3d::CoordinateInterpolator::keyValue, keyValues);
    (void)scene.set(knot.clock, x3d::TimeSensor::cycleInterval, Time{options.seconds});
    (void)scene.set(knot.clock, x3d::TimeSensor::loop, true);
    (void)scene.addRoute(knot.clock, x3d::TimeSensor::fraction_changed.index, knot.interpolator,
                         x3d::CoordinateInterpolator::set_fraction.index);
    (void)scene.addRoute(knot.interpolator, x3d::CoordinateInterpolator::value_changed.index, knot.coordinate,
                         x3d::Coordinate::point.index);
    for (const NodeId id : {knot.shape, knot.interpolator, knot.clock}) {
        if (parent)
            (void)scene.insertChild(parent, x3d::Group::children, id);
        else
            (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, id);
    }
    return knot;
}

}  // namespace rtsg::bench
