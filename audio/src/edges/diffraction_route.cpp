// Shortest ways by one edge, in closed form, and by two, searched for from the last solution.
#include "diffraction_route.h"

#include <cmath>
#include <numbers>

namespace rtsg {
namespace {

glm::dvec3 unitFrom(const glm::dvec3& from, const glm::dvec3& to) {
    const glm::dvec3 displacement = to - from;
    const double length = glm::length(displacement);
    return length > 0 ? displacement / length : glm::dvec3(0);
}

/// AlongEdge an edge: how far along it from its place, and how far off.
struct AlongEdge {
    double along, radius;
};
AlongEdge besideEdge(const glm::dvec3& position, const glm::dvec3& at, const glm::dvec3& axis) {
    const glm::dvec3 displacement = position - at;
    const double along = glm::dot(displacement, axis);
    return {along, glm::length(displacement - axis * along)};
}

EdgePath pathThrough(const glm::dvec3& source, const glm::dvec3& first, const glm::dvec3& last,
                     const glm::dvec3& listener) {
    return {glm::distance(source, first) + glm::distance(first, last) + glm::distance(last, listener),
            unitFrom(first, source), unitFrom(last, listener), last};
}

/// Newton's steps, as the length is convex in both places; few, as it begins near its end. An edge that stays does not
/// count.
EdgePath byTwoEdges(const EdgeRoute& route, const glm::dvec3& source, const glm::dvec3& listener) {
    constexpr int kSteps = 4;
    glm::dvec3 p = route.first, q = route.last;
    EdgePath path = pathThrough(source, p, q, listener);
    for (int step = 0; step < kSteps; ++step) {
        const double s = glm::distance(source, p), w = glm::distance(p, q), r = glm::distance(q, listener);
        if (!(s > 0 && w > 0 && r > 0)) return path;
        const glm::dvec3 across = (q - p) / w;
        const double aa = glm::dot(route.firstAxis, route.firstAxis), bb = glm::dot(route.lastAxis, route.lastAxis);
        const double sa = -glm::dot(path.toSource, route.firstAxis), wa = glm::dot(across, route.firstAxis);
        const double wb = glm::dot(across, route.lastAxis), rb = glm::dot(path.toListener, route.lastAxis);
        const double xx = aa > 0 ? (aa - sa * sa) / s + (aa - wa * wa) / w : 1;
        const double yy = bb > 0 ? (bb - wb * wb) / w + (bb - rb * rb) / r : 1;
        const double xy = -(glm::dot(route.firstAxis, route.lastAxis) - wa * wb) / w;
        const double slopeX = sa - wa, slopeY = wb - rb, determinant = xx * yy - xy * xy;
        if (!(determinant > 0)) return path;
        double dx = (slopeY * xy - slopeX * yy) / determinant, dy = (slopeX * xy - slopeY * xx) / determinant;
        EdgePath next = pathThrough(source, p + route.firstAxis * dx, q + route.lastAxis * dy, listener);
        for (int half = 0; half < 8 && next.length > path.length; ++half) {
            dx /= 2, dy /= 2;
            next = pathThrough(source, p + route.firstAxis * dx, q + route.lastAxis * dy, listener);
        }
        if (!(next.length < path.length)) return path;
        p += route.firstAxis * dx;
        q = next.last;
        const bool done = path.length - next.length < 1e-12 * next.length;
        path = next;
        if (done) return path;
    }
    return path;
}

}  // namespace

namespace {

EdgePath straightPath(const EdgeRoute& route, const glm::dvec3& source, const glm::dvec3& listener) {
    if (route.first != route.last || route.firstAxis != route.lastAxis) return byTwoEdges(route, source, listener);
    if (route.firstAxis == glm::dvec3(0)) return pathThrough(source, route.first, route.first, listener);
    const AlongEdge s = besideEdge(source, route.first, route.firstAxis);
    const AlongEdge r = besideEdge(listener, route.first, route.firstAxis);
    const double radii = s.radius + r.radius;
    const double z = radii > 0 ? s.along + (r.along - s.along) * s.radius / radii : s.along;
    const glm::dvec3 by = route.first + route.firstAxis * z;
    return {std::hypot(radii, r.along - s.along), unitFrom(by, source), unitFrom(by, listener), by};
}

}  // namespace

EdgePath edgePath(const EdgeRoute& route, const glm::dvec3& source, const glm::dvec3& listener) {
    EdgePath path = straightPath(route, source, listener);
    path.length += route.over;
    return path;
}

WedgePath pathAbout(const EdgeRoute& route, const BendingEdge& edge, const glm::dvec3& source,
                    const glm::dvec3& listener) {
    const AlongEdge s = besideEdge(source, route.first, route.firstAxis);
    const AlongEdge r = besideEdge(listener, route.first, route.firstAxis);
    const auto angle = [&](const glm::dvec3& position) {
        const glm::dvec3 displacement = position - route.first;
        const double about = std::atan2(glm::dot(displacement, edge.beside), glm::dot(displacement, edge.face));
        return about < 0 ? about + 2 * std::numbers::pi : about;
    };
    WedgePath path;
    path.opening = edge.opening;
    path.sourceRadius = s.radius;
    path.receiverRadius = r.radius;
    path.along = r.along - s.along;
    path.sourceAngle = angle(source);
    path.receiverAngle = angle(listener);
    return path;
}

}  // namespace rtsg
