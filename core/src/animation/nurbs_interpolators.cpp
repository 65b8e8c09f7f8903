// Interpolators along NURBS curves and surfaces. ISO/IEC 19775-1 V4.0, 27.4.
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>

#include <rtsg/core/nurbs.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"

namespace rtsg::behaviours {

namespace {

std::vector<Vec3d> pointsOf(const Scene& scene, NodeId id) {
    std::vector<Vec3d> result;
    const Node* node = scene.effectiveNode(id);
    const auto take = [&](const auto& points) {
        result.reserve(points.size());
        for (const auto& p : points) result.emplace_back(p);
    };
    if (node && node->is(x3d::Coordinate::type)) take(node->get(x3d::Coordinate::point));
    if (node && node->is(x3d::CoordinateDouble::type)) take(node->get(x3d::CoordinateDouble::point));
    return result;
}

std::span<const double> spanOf(const Array<double>& values) {
    return {values.data(), values.size()};
}

/// Precondition: the order fits. `name`: which knots.
NurbsBasis basisOf(Cascade& cascade, const Node& node, int order, std::size_t count, const Array<double>& knots,
                   const char* name) {
    bool replaced = false;
    NurbsBasis basis(order, count, spanOf(knots), &replaced);
    if (replaced && !knots.empty())
        cascade.warn(node, std::string("the knots") + name + " do not fit " + std::to_string(count) +
                               " control points of order " + std::to_string(order) + ": taken as even");
    return basis;
}

template <class N>
std::optional<NurbsCurve> curveOf(Cascade& cascade, const Node& node) {
    const std::vector<Vec3d> points = pointsOf(cascade.scene(), node.get(N::controlPoint));
    const int order = node.get(N::order);
    if (!NurbsBasis::fits(order, points.size())) {
        cascade.warn(node, std::to_string(points.size()) + " control points for an order of " + std::to_string(order) +
                               "; the order is from 2 to " + std::to_string(NurbsBasis::kMaxOrder) +
                               ", and there are as many points at least");
        return std::nullopt;
    }
    return NurbsCurve{basisOf(cascade, node, order, points.size(), node.get(N::knot), ""),
                      nurbsPoints(points, spanOf(node.get(N::weight)))};
}

double within(const NurbsBasis& basis, float fraction) {
    return basis.first() + (basis.last() - basis.first()) * std::clamp(double{fraction}, 0.0, 1.0);
}

void position(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
    using N = x3d::NurbsPositionInterpolator;
    if (field != N::set_fraction.index) return;
    const float fraction = event.as<float>();
    if (std::isnan(fraction)) return;
    if (const auto curve = curveOf<N>(cascade, node))
        cascade.emit(node, N::value_changed, Vec3f(curve->at(within(curve->basis, fraction))));
}

/// Sends the shortest rotation that turns the z axis along the curve.
void orientation(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
    using N = x3d::NurbsOrientationInterpolator;
    if (field != N::set_fraction.index) return;
    const float fraction = event.as<float>();
    if (std::isnan(fraction)) return;
    const auto curve = curveOf<N>(cascade, node);
    if (!curve) return;
    Vec3d along;
    (void)curve->at(within(curve->basis, fraction), &along);
    const double length = glm::length(along);
    if (!(length > 0) || !std::isfinite(length)) return;
    along /= length;
    const Vec3d axis = glm::cross(Vec3d(0, 0, 1), along);
    const double sine = glm::length(axis);
    const Vec3d unit = sine > 1e-12 ? axis / sine : Vec3d(0, 1, 0);
    cascade.emit(node, N::value_changed,
                 Rotation{static_cast<float>(unit.x), static_cast<float>(unit.y), static_cast<float>(unit.z),
                          static_cast<float>(portable::atan2(sine, along.z))});
}

void surface(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
    using N = x3d::NurbsSurfaceInterpolator;
    if (field != N::set_fraction.index) return;
    const Vec2f fraction = event.as<Vec2f>();
    if (std::isnan(fraction.x) || std::isnan(fraction.y)) return;
    const std::vector<Vec3d> points = pointsOf(cascade.scene(), node.get(N::controlPoint));
    const auto counts = [](std::int32_t n) { return static_cast<std::size_t>(std::max(n, 0)); };
    const std::size_t nu = counts(node.get(N::uDimension)), nv = counts(node.get(N::vDimension));
    const int orderU = node.get(N::uOrder), orderV = node.get(N::vOrder);
    if (!NurbsBasis::fits(orderU, nu) || !NurbsBasis::fits(orderV, nv) || points.size() / nu < nv) {
        cascade.warn(node, std::to_string(points.size()) + " control points for " + std::to_string(nu) + " times " +
                               std::to_string(nv) + " and orders of " + std::to_string(orderU) + " and " +
                               std::to_string(orderV));
        return;
    }
    const NurbsSurface created{basisOf(cascade, node, orderU, nu, node.get(N::uKnot), " along u"),
                               basisOf(cascade, node, orderV, nv, node.get(N::vKnot), " along v"),
                               nurbsPoints(points, spanOf(node.get(N::weight)))};
    const double u = within(created.u, fraction.x), v = within(created.v, fraction.y);
    cascade.emit(node, N::position_changed, Vec3f(created.at(u, v)));
    if (const Vec3d normal = created.normal(u, v); normal != Vec3d(0))
        cascade.emit(node, N::normal_changed, Vec3f(normal));
}

}  // namespace

void appendNurbs(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onEvent) { table.push_back({type, {.onEvent = onEvent}}); };
    add(x3d::NurbsPositionInterpolator::type, position);
    add(x3d::NurbsOrientationInterpolator::type, orientation);
    add(x3d::NurbsSurfaceInterpolator::type, surface);
}

}  // namespace rtsg::behaviours
