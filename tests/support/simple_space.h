// Finds Boxes and Spheres, for tests of pointers without a renderer: every Shape is looked at for every ray, in double
// precision, with transforms multiplied here. For tests of triangles it finds TriangleSets, too.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/device_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::test {

class SimpleSpace final : public SpaceQueries {
  public:
    explicit SimpleSpace(const Scene& scene) : scene_(scene) {}

    std::optional<PointerHit> firstHit(const Vec3d& origin, const Vec3d& direction) override {
        std::optional<PointerHit> best;
        double nearest = INFINITY;
        visitShapes([&](const std::vector<NodeId>& path, const glm::dmat4& world, const Node& geometry) {
            const glm::dmat4 local = glm::inverse(world);
            const glm::dvec3 o = local * glm::dvec4(origin, 1), d = local * glm::dvec4(direction, 0);
            const auto [t, normal] = hit(geometry, o, d);
            if (!(t < nearest)) return;
            nearest = t;
            const glm::dvec3 point = o + d * t;
            best = PointerHit{world * glm::dvec4(point, 1),
                              glm::normalize(glm::transpose(glm::dmat3(local)) * normal),
                              {point.x, point.y},
                              path};
        });
        return best;
    }

    std::vector<std::vector<NodeId>> within(const Vec3d& center, double radius) override {
        std::vector<std::vector<NodeId>> paths;
        proxies_ = true;
        visitShapes([&](const std::vector<NodeId>& path, const glm::dmat4& world, const Node& geometry) {
            // Transforms without scale only.
            const glm::dvec3 at = glm::inverse(world) * glm::dvec4(center, 1);
            double distance = INFINITY;
            if (geometry.is(x3d::Box::type)) {
                const glm::dvec3 half = glm::dvec3(geometry.get(x3d::Box::size)) * .5;
                distance = glm::length(glm::max(glm::abs(at) - half, glm::dvec3(0)));
            } else if (geometry.is(x3d::Sphere::type)) {
                distance = std::abs(glm::length(at) - double(geometry.get(x3d::Sphere::radius)));
            }
            if (distance <= radius) paths.push_back(path);
        });
        proxies_ = false;
        return paths;
    }

    std::vector<Crossing> crossings(const Vec3d& origin, const Vec3d& direction, double length) override {
        std::vector<std::pair<double, Crossing>> found;
        const Vec3d unit = glm::normalize(direction);
        visitShapes([&](const std::vector<NodeId>& path, const glm::dmat4& world, const Node& geometry) {
            const glm::dmat4 local = glm::inverse(world);
            const glm::dvec3 o = local * glm::dvec4(origin, 1), d = local * glm::dvec4(unit, 0);
            for (const auto& [t, normal] : meetings(geometry, o, d)) {
                if (!(t >= 0 && t <= length)) continue;
                const glm::dvec3 point = o + d * t;
                found.push_back({t,
                                 {world * glm::dvec4(point, 1),
                                  glm::normalize(glm::transpose(glm::dmat3(local)) * normal),
                                  {point.x, point.y, 0},
                                  path}});
            }
        });
        std::ranges::stable_sort(found, {}, [](const auto& one) { return one.first; });
        std::vector<Crossing> crossings;
        for (auto& [t, one] : found) crossings.push_back(std::move(one));
        return crossings;
    }

    std::vector<Crossing> obstacles(const Vec3d& origin, const Vec3d& direction, double length) override {
        proxies_ = true;
        auto found = crossings(origin, direction, length);
        proxies_ = false;
        return found;
    }

    std::vector<ShapeBox> boxes() override {
        std::vector<ShapeBox> all;
        visitShapes([&](const std::vector<NodeId>& path, const glm::dmat4& world, const Node& geometry) {
            glm::dvec3 half(0);
            if (geometry.is(x3d::Box::type)) half = glm::dvec3(geometry.get(x3d::Box::size)) * .5;
            if (geometry.is(x3d::Sphere::type)) half = glm::dvec3(double(geometry.get(x3d::Sphere::radius)));
            if (half.x > 0) all.push_back({world, -half, half, path});
            if (!geometry.is(x3d::TriangleSet::type)) return;
            ShapeBox box{world, Vec3d(INFINITY), Vec3d(-INFINITY), path};
            for (const Vec3d& p : corners(geometry)) box.low = glm::min(box.low, p), box.high = glm::max(box.high, p);
            if (box.low.x <= box.high.x) all.push_back(box);
        });
        return all;
    }

    /// Spheres have none here.
    std::vector<Meeting> meetings(const Vec3d& center, double radius, TriangleTest& test) override {
        std::vector<Meeting> all;
        visitShapes([&](const std::vector<NodeId>& path, const glm::dmat4& world, const Node& geometry) {
            if (!test.concerns(path)) return;
            Meeting meeting{{world, Vec3d(INFINITY), Vec3d(-INFINITY), path}, INFINITY};
            bool met = false;
            for (const std::array<Vec3d, 3>& local : trianglesOf(geometry)) {
                std::array<Vec3d, 3> triangle;
                for (std::size_t i = 0; i < 3; ++i) {
                    triangle[i] = world * glm::dvec4(local[i], 1);
                    meeting.box.low = glm::min(meeting.box.low, local[i]);
                    meeting.box.high = glm::max(meeting.box.high, local[i]);
                }
                const double distance = distanceTo(triangle, center);
                meeting.distance = std::min(meeting.distance, distance);
                met = met || (distance <= radius && test.meets(triangle));
            }
            if (met) all.push_back(meeting);
        });
        return all;
    }

    std::vector<Vec3d> corners(const Node& geometry) override {
        std::vector<Vec3d> points;
        if (const Node* coord = coordOf(geometry))
            for (const Vec3f& p : coord->get(x3d::Coordinate::point)) points.emplace_back(p);
        return points;
    }

    /// By the smallest of a fine net of points, and of finer ones round it: the distance is convex.
    static double distanceTo(const std::array<Vec3d, 3>& t, const Vec3d& point) {
        glm::dvec2 at(.5), low(0), high(1);
        double best = INFINITY;
        for (int round = 0; round < 12; ++round) {
            for (int i = 0; i <= 12; ++i)
                for (int j = 0; j <= 12; ++j) {
                    const glm::dvec2 position = low + (high - low) * glm::dvec2(i / 12., j / 12.);
                    const double u = position.x * (1 - position.y), v = position.y;
                    const double d = glm::distance(t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]), point);
                    if (d < best) best = d, at = position;
                }
            const glm::dvec2 part = (high - low) * .2;
            low = glm::clamp(at - part, glm::dvec2(0), glm::dvec2(1));
            high = glm::clamp(at + part, glm::dvec2(0), glm::dvec2(1));
        }
        return best;
    }

  private:
    const Node* coordOf(const Node& geometry) const {
        const FieldIndex field = geometry.type().findExact("coord");
        const Node* coord = field == kNoField ? nullptr : scene_.find(geometry.get(Field<NodeId>{field}));
        return coord && coord->is(x3d::Coordinate::type) ? coord : nullptr;
    }
    std::vector<std::array<Vec3d, 3>> trianglesOf(const Node& geometry) const {
        std::vector<std::array<Vec3d, 3>> all;
        if (geometry.is(x3d::Box::type)) {
            const glm::dvec3 half = glm::dvec3(geometry.get(x3d::Box::size)) * .5;
            for (int i = 0; i < 3; ++i)
                for (const double side : {-1.0, 1.0}) {
                    glm::dvec3 corner[4];
                    for (int k = 0; k < 4; ++k) {
                        corner[k][i] = side * half[i];
                        corner[k][(i + 1) % 3] = (k == 1 || k == 2 ? 1 : -1) * half[(i + 1) % 3];
                        corner[k][(i + 2) % 3] = (k > 1 ? 1 : -1) * half[(i + 2) % 3];
                    }
                    all.push_back({corner[0], corner[1], corner[2]});
                    all.push_back({corner[0], corner[2], corner[3]});
                }
        } else if (const Node* coord = geometry.is(x3d::TriangleSet::type) ? coordOf(geometry) : nullptr) {
            const auto& points = coord->get(x3d::Coordinate::point);
            for (std::size_t i = 0; i + 2 < points.size(); i += 3)
                all.push_back({Vec3d(points[i]), Vec3d(points[i + 1]), Vec3d(points[i + 2])});
        }
        return all;
    }

    template <class F>
    void visitShapes(const F& visit) {
        std::vector<NodeId> path;
        for (const NodeId root : scene_.node(scene_.root()).get(x3d::RtsgScene::children))
            walk(root, path, glm::dmat4(1), visit);
    }
    template <class F>
    void walk(NodeId id, std::vector<NodeId>& path, glm::dmat4 world, const F& visit) {
        const Node* node = scene_.find(id);
        if (!node) return;
        path.push_back(id);
        if (node->is(x3d::Transform::type)) {
            using T = x3d::Transform;
            const Rotation r = node->get(T::rotation);
            world = glm::translate(world, glm::dvec3(node->get(T::translation)));
            world = glm::rotate(world, double(r.angle), glm::dvec3(r.x, r.y, r.z));
            world = glm::scale(world, glm::dvec3(node->get(T::scale)));
        }
        if (node->is(x3d::Shape::type)) {
            if (const Node* geometry = scene_.find(node->get(x3d::Shape::geometry))) visit(path, world, *geometry);
        } else if (node->type().body() != kNoField) {
            const auto& body = node->get(Field<Array<NodeId>>{node->type().body()});
            const std::size_t count = node->is(x3d::Inline::type) ? body.size() : std::min<std::size_t>(1, body.size());
            for (std::size_t i = 0; i < count; ++i) walk(body[i], path, world, visit);
        } else if (const FieldIndex field = node->type().findExact("children"); field != kNoField) {
            for (const NodeId child : node->get(Field<Array<NodeId>>{field})) walk(child, path, world, visit);
        }
        if (proxies_ && node->is(x3d::Collision::type)) walk(node->get(x3d::Collision::proxy), path, world, visit);
        path.pop_back();
    }

    /// All meetings with the line, and the outward normals there; in no order.
    static std::vector<std::pair<double, glm::dvec3>> meetings(const Node& geometry, const glm::dvec3& o,
                                                               const glm::dvec3& d) {
        std::vector<std::pair<double, glm::dvec3>> all;
        if (geometry.is(x3d::Sphere::type)) {
            const double r = geometry.get(x3d::Sphere::radius), a = glm::dot(d, d), b = glm::dot(o, d);
            const double root = std::sqrt(b * b - a * (glm::dot(o, o) - r * r));
            if (root > 0)
                for (const double t : {(-b - root) / a, (-b + root) / a}) all.push_back({t, (o + d * t) / r});
        } else if (geometry.is(x3d::Box::type)) {
            const glm::dvec3 half = glm::dvec3(geometry.get(x3d::Box::size)) * .5;
            for (int i = 0; i < 3; ++i)
                for (const double side : {-1.0, 1.0}) {
                    const double t = (side * half[i] - o[i]) / d[i];
                    const glm::dvec3 at = o + d * t;
                    const int j = (i + 1) % 3, k = (i + 2) % 3;
                    if (!std::isfinite(t) || std::abs(at[j]) > half[j] || std::abs(at[k]) > half[k]) continue;
                    glm::dvec3 normal(0);
                    normal[i] = side;
                    all.push_back({t, normal});
                }
        }
        return all;
    }

    /// The first meeting ahead and the normal there.
    static std::pair<double, glm::dvec3> hit(const Node& geometry, const glm::dvec3& o, const glm::dvec3& d) {
        if (geometry.is(x3d::Sphere::type)) {
            const double r = geometry.get(x3d::Sphere::radius), a = glm::dot(d, d), b = glm::dot(o, d);
            const double root = std::sqrt(b * b - a * (glm::dot(o, o) - r * r));
            for (const double t : {(-b - root) / a, (-b + root) / a})
                if (t >= 0) return {t, (o + d * t) / r};
        } else if (geometry.is(x3d::Box::type)) {
            const glm::dvec3 half = glm::dvec3(geometry.get(x3d::Box::size)) * .5;
            double from = -INFINITY, to = INFINITY;
            int enters = 0, leaves = 0;
            for (int i = 0; i < 3; ++i) {
                const double a = (-half[i] - o[i]) / d[i], b = (half[i] - o[i]) / d[i];
                if (std::isnan(a) || std::isnan(b)) continue;
                if (std::min(a, b) > from) from = std::min(a, b), enters = i;
                if (std::max(a, b) < to) to = std::max(a, b), leaves = i;
            }
            if (from > to || to < 0) return {INFINITY, {}};
            const double t = from >= 0 ? from : to;
            glm::dvec3 normal(0);
            const int side = from >= 0 ? enters : leaves;
            normal[side] = (o + d * t)[side] > 0 ? 1 : -1;
            return {t, normal};
        }
        return {INFINITY, {}};
    }

    const Scene& scene_;
    bool proxies_ = false;  // whether Collisions' are visited too
};

}  // namespace rtsg::test
