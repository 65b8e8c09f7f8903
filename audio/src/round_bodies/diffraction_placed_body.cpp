// Turns the axis such that angles count from the source to the listener.
#include "diffraction_placed_body.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtsg {
namespace {

/// Unit; any.
glm::dvec3 squareTo(const glm::dvec3& displacement) {
    const glm::dvec3 size = glm::abs(displacement);
    const bool x = size.x <= size.y && size.x <= size.z, y = !x && size.y <= size.z;
    return glm::normalize(glm::cross(displacement, glm::dvec3(x, y, !x && !y)));
}

}  // namespace

PlacedBody::PlacedBody(const RoundBody& body, const glm::dvec3& source, const glm::dvec3& listener) : body_(body) {
    glm::dvec3 s = source - body.center, r = listener - body.center;
    if (body.sphere) {
        const glm::dvec3 across = glm::cross(s, r);
        const double size = glm::length(across);
        axis_ = size > 1e-12 * glm::dot(s, s) ? across / size : squareTo(s);
    } else {
        axis_ = body.axis;
        fromAlong_ = glm::dot(s, axis_);
        path_.along = glm::dot(r, axis_) - fromAlong_;
        s -= axis_ * fromAlong_;
        r -= axis_ * glm::dot(r, axis_);
    }
    path_.sphere = body.sphere;
    path_.radius = body.radius;
    path_.sourceRadius = glm::length(s);
    path_.receiverRadius = glm::length(r);
    within_ = !(std::min(path_.sourceRadius, path_.receiverRadius) > (body.radius - depth()) * (1 - 1e-9));
    if (within_) return;
    // Between the facets and the circle it is as on the circle.
    path_.sourceRadius = std::max(path_.sourceRadius, body.radius);
    path_.receiverRadius = std::max(path_.receiverRadius, body.radius);
    toSource_ = glm::normalize(s);
    path_.angle = std::atan2(glm::dot(glm::cross(toSource_, r), axis_), glm::dot(toSource_, r));
    if (path_.angle >= 0) return;
    axis_ = -axis_;
    fromAlong_ = -fromAlong_;
    path_.along = -path_.along;
    path_.angle = -path_.angle;
}

RoundPath PlacedBody::pathBy(bool far) const {
    RoundPath path = path_;
    if (far) path.angle = 2 * std::numbers::pi - path.angle;
    return path;
}

double PlacedBody::depth() const {
    return body_.radius * (1 - std::cos(0.5 * body_.facet));
}

double PlacedBody::straight() const {
    RoundPath path = path_;
    path.along = 0;
    return path.distance();
}

double PlacedBody::detour() const {
    const double a = path_.radius, s = path_.sourceRadius, r = path_.receiverRadius;
    return std::sqrt(s * s - a * a) + std::sqrt(r * r - a * a) - straight();
}

double PlacedBody::covered() const {
    const double between = straight();
    return between > 0 ? path_.radius - path_.sourceRadius * path_.receiverRadius * std::sin(path_.angle) / between : 0;
}

glm::dvec3 PlacedBody::at(double angle, bool far, double along, double off) const {
    const glm::dvec3 side = glm::cross(axis_, toSource_) * (far ? -1.0 : 1.0);
    const glm::dvec3 out = std::cos(angle) * toSource_ + std::sin(angle) * side;
    return body_.center + body_.radius * off * out + axis_ * (fromAlong_ + along);
}

bool PlacedBody::has(const glm::dvec3& position) const {
    constexpr double kRounding = 1e-4;  // radians: corners in single precision are off by less
    if (body_.sphere || body_.halfArc >= std::numbers::pi) return true;
    const glm::dvec3 displacement = position - body_.center,
                     across = displacement - body_.axis * glm::dot(displacement, body_.axis);
    return glm::dot(across, body_.middle) >= glm::length(across) * std::cos(body_.halfArc + kRounding);
}

}  // namespace rtsg
