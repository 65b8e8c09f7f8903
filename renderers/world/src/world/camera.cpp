// Rays of perspective and parallel cameras.
#include <rtsg/renderers/camera.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/gtc/quaternion.hpp>

namespace rtsg {

namespace {

/// Rodrigues; a zero axis turns nothing.
Vec3d rotate(const Rotation& rotation, const Vec3d& v) {
    const Vec3d axis(rotation.x, rotation.y, rotation.z);
    const double length = glm::length(axis);
    if (!(length > 0) || !std::isfinite(length) || !std::isfinite(rotation.angle)) return v;
    const Vec3d k = axis / length;
    const double c = std::cos(double{rotation.angle}), s = std::sin(double{rotation.angle});
    return v * c + glm::cross(k, v) * s + k * (glm::dot(k, v) * (1 - c));
}

Vec3d linear(const WorldFromLocal& m, const Vec3d& v) {
    return m[0] * v.x + m[1] * v.y + m[2] * v.z;
}

bool areEven(const glm::dmat3& axes, const Vec3d& right, const Vec3d& up) {
    constexpr double kRounding = 1e-6;  // of a picture's width: no pixel shows it
    return glm::distance(right, axes[0]) < kRounding && glm::distance(up, axes[1]) < kRounding;
}

/// Position and axes from a local frame; keeps the defaults where a transform is singular.
Camera placed(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation) {
    Camera camera;
    const Vec3d eye = linear(worldFromLocal, position) + worldFromLocal[3];
    camera.nowhere = !glm::all(glm::lessThan(glm::abs(eye), Vec3d(1e18)));
    if (!camera.nowhere) camera.position = eye;
    const WorldFromLocal turned(linear(worldFromLocal, rotate(orientation, {1, 0, 0})),
                                linear(worldFromLocal, rotate(orientation, {0, 1, 0})),
                                linear(worldFromLocal, rotate(orientation, {0, 0, 1})), Vec3d(0));
    const glm::dmat3 axes = turningOf(turned);
    camera.right = axes[0];
    camera.up = axes[1];
    camera.forward = -axes[2];
    const double ahead = glm::length(turned[2]);
    const Vec3d right = turned[0] / ahead, up = turned[1] / ahead;
    constexpr double kFlat = 1e-9;  // a space this flat has no inverse worth the name
    if (!areEven(axes, right, up) && std::abs(glm::determinant(glm::dmat3(right, up, camera.forward))) > kFlat)
        camera.right = right, camera.up = up;
    return camera;
}

}  // namespace

ViewingAngles viewingAngles(double fieldOfView, double aspect) {
    const double angle =
        std::isfinite(fieldOfView) ? std::clamp(fieldOfView, 1e-6, std::numbers::pi - 1e-6) : std::numbers::pi / 4;
    const double tangent = std::tan(angle / 2);
    return {2 * std::atan(tangent * std::max(aspect, 1.0)), 2 * std::atan(tangent * std::max(1 / aspect, 1.0))};
}

glm::dmat3 turningOf(const WorldFromLocal& m) {
    const double size = std::max({glm::length(m[0]), glm::length(m[1]), glm::length(m[2])});
    if (!(size > 0) || !std::isfinite(size)) return glm::dmat3(1.0);
    Vec3d back = m[2] / size, upwards = m[1] / size;
    if (glm::length(back) < 1e-9) back = glm::cross(m[0] / size, upwards);
    if (glm::length(back) < 1e-9) return glm::dmat3(1.0);
    back = glm::normalize(back);
    upwards -= glm::dot(upwards, back) * back;
    if (glm::length(upwards) < 1e-9) upwards = glm::cross(back, m[0] / size);
    if (glm::length(upwards) < 1e-9)
        upwards = glm::cross(back, std::abs(back.x) < 0.5 ? Vec3d(1, 0, 0) : Vec3d(0, 0, 1));
    upwards = glm::normalize(upwards);
    return {glm::cross(upwards, back), upwards, back};
}

Camera Camera::perspective(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation,
                           double fieldOfView, double aspect) {
    Camera camera = placed(worldFromLocal, position, orientation);
    const ViewingAngles angles = viewingAngles(fieldOfView, aspect);
    camera.rightEdge = std::tan(angles.horizontal / 2);
    camera.top = std::tan(angles.vertical / 2);
    camera.left = -camera.rightEdge;
    camera.bottom = -camera.top;
    return camera;
}

Camera Camera::parallel(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation,
                        const std::array<double, 4>& extent, double aspect) {
    Camera camera = placed(worldFromLocal, position, orientation);
    camera.orthographic = true;
    const glm::dmat3 linearPart(worldFromLocal[0], worldFromLocal[1], worldFromLocal[2]);
    double scale = camera.isEven() ? std::cbrt(std::abs(glm::determinant(linearPart)))
                                   : glm::length(linear(worldFromLocal, rotate(orientation, {0, 0, 1})));
    if (!(scale > 0) || !std::isfinite(scale)) scale = 1;
    const double centerX = scale * (extent[0] + extent[2]) / 2, centerY = scale * (extent[1] + extent[3]) / 2;
    double halfX = scale * std::abs(extent[2] - extent[0]) / 2, halfY = scale * std::abs(extent[3] - extent[1]) / 2;
    if (!(halfX > 0) || !(halfY > 0)) halfX = halfY = scale;
    if (halfX < halfY * aspect)
        halfX = halfY * aspect;
    else
        halfY = halfX / aspect;
    camera.left = centerX - halfX, camera.rightEdge = centerX + halfX;
    camera.bottom = centerY - halfY, camera.top = centerY + halfY;
    return camera;
}

Camera Camera::shaped(double aspect) const {
    Camera camera = *this;
    if (panorama) return camera;
    const double centerX = (left + rightEdge) / 2, centerY = (bottom + top) / 2;
    const double half = std::min(rightEdge - left, top - bottom) / 2;
    const double halfX = half * std::max(aspect, 1.0), halfY = half * std::max(1 / aspect, 1.0);
    camera.left = centerX - halfX, camera.rightEdge = centerX + halfX;
    camera.bottom = centerY - halfY, camera.top = centerY + halfY;
    return camera;
}

Camera Camera::around() const {
    Camera camera = *this;
    camera.panorama = true, camera.orthographic = false;
    camera.lensRadius = 0;
    const glm::dmat3 turned = axes();
    camera.right = turned[0], camera.up = turned[1];
    camera.rightEdge = std::numbers::pi, camera.left = -camera.rightEdge;
    camera.top = std::numbers::pi / 2, camera.bottom = -camera.top;
    return camera;
}

Camera Camera::beside(double offset, double distance) const {
    Camera camera = *this;
    const double steps = areEven(axes(), right, up) ? offset : offset / glm::length(right);
    camera.position += steps * right;
    camera.left -= steps / distance, camera.rightEdge -= steps / distance;
    return camera;
}

Camera Camera::since(const Camera& before, double t) const {
    Camera camera = *this;
    if (before.viewpoint != viewpoint || before.layer != layer || before.orthographic != orthographic ||
        before.panorama != panorama)
        return camera;
    camera.position = glm::mix(before.position, position, t);
    if (before.right != right || before.up != up || before.forward != forward) {
        const glm::dmat3 from = before.axes(), to = axes();
        const glm::dmat3 turned = glm::mat3_cast(glm::slerp(glm::quat_cast(from), glm::quat_cast(to), t));
        camera.right = turned[0], camera.up = turned[1], camera.forward = -turned[2];
        if (!areEven(from, before.right, before.up) || !areEven(to, right, up)) {
            camera.right = turned * glm::mix(glm::transpose(from) * before.right, glm::transpose(to) * right, t);
            camera.up = turned * glm::mix(glm::transpose(from) * before.up, glm::transpose(to) * up, t);
        }
    }
    camera.left = glm::mix(before.left, left, t), camera.rightEdge = glm::mix(before.rightEdge, rightEdge, t);
    camera.bottom = glm::mix(before.bottom, bottom, t), camera.top = glm::mix(before.top, top, t);
    camera.focus = glm::mix(before.focus, focus, t);
    return camera;
}

Vec2d Camera::project(const Vec3d& world) const {
    const Vec3d d = world - position;
    const Vec3d gone = steps() * d;
    const double across = gone.x, upwards = gone.y, ahead = gone.z;
    Vec2d edge(across, upwards);
    if (panorama) {
        const double length = glm::length(d);
        edge = {std::atan2(across, ahead), length > 0 ? std::asin(std::clamp(upwards / length, -1.0, 1.0)) : 0.0};
    } else if (!orthographic) {
        if (!(ahead > 0)) return Vec2d(std::numeric_limits<double>::infinity());
        edge /= ahead;
    }
    return {(edge.x - left) / (rightEdge - left), (top - edge.y) / (top - bottom)};
}

void Camera::frame(const Vec3d& lower, const Vec3d& upper) {
    if (!glm::all(glm::lessThanEqual(lower, upper))) return;
    const Vec3d center = 0.5 * (lower + upper);
    const double radius = std::max(0.5 * glm::length(upper - lower), 1e-9);
    const double margin = 1.05;
    double distance = 0, halfX = 0, halfY = 0;
    const glm::dmat3 inSteps = steps();
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d offset((corner & 1 ? upper.x : lower.x) - center.x, (corner & 2 ? upper.y : lower.y) - center.y,
                           (corner & 4 ? upper.z : lower.z) - center.z);
        const Vec3d gone = inSteps * offset;
        const double x = std::abs(gone.x) * margin, y = std::abs(gone.y) * margin, towards = -gone.z;
        halfX = std::max(halfX, x), halfY = std::max(halfY, y);
        if (!orthographic) distance = std::max({distance, towards + x / rightEdge, towards + y / top});
    }
    if (orthographic) {
        const double aspect = (rightEdge - left) / (top - bottom);
        halfX = std::max({halfX, halfY * aspect, 1e-9});
        left = -halfX, rightEdge = halfX, bottom = -halfX / aspect, top = halfX / aspect;
        distance = 2 * radius;
    }
    // A single point or a flat scene seen edge-on must not end up at the eye.
    position = center - forward * std::max(distance, 1.01 * radius);
}

void Camera::viewAll(const Vec3d& lower, const Vec3d& upper, const Vec3d& upright) {
    if (!glm::all(glm::lessThanEqual(lower, upper))) return;
    const Vec3d center = 0.5 * (lower + upper), towards = center - position;
    const Vec3d across = glm::cross(towards, upright);
    // A viewer who is in the middle already, or looks straight up or down at it, keeps his direction.
    if (areEven(axes(), right, up) && glm::length(across) > 1e-9 * glm::length(towards) * glm::length(upright)) {
        forward = glm::normalize(towards);
        right = glm::normalize(across);
        up = glm::cross(right, forward);
    }
    frame(lower, upper);
    if (orthographic) return;
    const double ball = 0.5 * glm::length(upper - lower) / std::min(rightEdge, top);
    position = center - forward * std::max(ball, glm::length(center - position));
}

glm::dmat3 Camera::axes() const {
    return turningOf({right, up, -forward, Vec3d(0)});
}

bool Camera::isEven() const {
    return areEven(axes(), right, up);
}

glm::dmat3 Camera::steps() const {
    const glm::dmat3 along(right, up, forward);
    return isEven() ? glm::transpose(along) : glm::inverse(along);
}

double Camera::pixel(int rows) const {
    const double high = (top - bottom) / rows;
    return isEven() ? high : high * std::min(glm::length(right), glm::length(up));
}

Camera::WorldRay Camera::ray(double x, double y) const {
    const double u = left + (rightEdge - left) * x, v = top + (bottom - top) * y;
    if (orthographic) return {position + u * right + v * up, forward};
    if (panorama) return {position, std::cos(v) * (std::cos(u) * forward + std::sin(u) * right) + std::sin(v) * up};
    return {position, glm::normalize(forward + u * right + v * up)};
}

Camera::Reach Camera::reach(const Vec3d& direction) const {
    const double ahead = panorama ? 1 : glm::dot(direction, forward);
    if (!(ahead > 0)) return {0, visibilityLimit};
    return {nearDistance / ahead, std::min(visibilityLimit, farDistance / ahead)};
}

bool Camera::isBounded() const {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    return nearDistance > 0 || visibilityLimit < kInfinite || farDistance < kInfinite;
}

}  // namespace rtsg
