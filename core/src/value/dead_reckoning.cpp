// The motion of an entity between two of its PDUs, in closed form.
#include <rtsg/core/dis_pdu.h>

#include <cmath>

#include <rtsg/core/geo_system.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>

namespace rtsg::dis {

namespace {

/// The factors of the unit matrix, the cross product and the dyad of the rotation rate in exp(Wt) and its integrals.
struct Weights {
    double unit = 0, cross = 0, dyad = 0;
    glm::dvec3 operator()(const glm::dvec3& rate, const glm::dvec3& v) const {
        return unit * v + cross * glm::cross(rate, v) + dyad * glm::dot(rate, v) * rate;
    }
};

// Below this angle series are more exact than closed forms, in which the leading terms cancel. Terms up to x^10 leave
// less than 1e-16 of the sum.
constexpr double kSmallAngle = 0.25;

/// The weights of the integral from 0 to t of exp(W s) ds.
Weights integralOf(double rate, double t) {
    const double x = rate * t, y = x * x;
    if (std::abs(x) < kSmallAngle)
        return {t * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72)))),
                t * t / 2 * (1 - y / 12 * (1 - y / 30 * (1 - y / 56 * (1 - y / 90)))),
                t * t * t / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72 * (1 - y / 110))))};
    return {portable::sin(x) / rate, (1 - portable::cos(x)) / (rate * rate),
            (x - portable::sin(x)) / (rate * rate * rate)};
}

/// The weights of the integral from 0 to t of s exp(W s) ds.
Weights momentOf(double rate, double t) {
    const double x = rate * t, y = x * x, t2 = t * t;
    if (std::abs(x) < kSmallAngle)
        return {t2 * (1. / 2 - y * (1. / 8 - y * (1. / 144 - y * (1. / 5760 - y / 403200)))),
                t2 * t * (1. / 3 - y * (1. / 30 - y * (1. / 840 - y * (1. / 45360 - y / 3991680)))),
                t2 * t2 * (1. / 8 - y * (1. / 144 - y * (1. / 5760 - y * (1. / 403200 - y / 43545600))))};
    const double c = portable::cos(x), s = portable::sin(x), r2 = rate * rate;
    return {(c + x * s - 1) / r2, (s - x * c) / (r2 * rate), (y / 2 - c - x * s + 1) / (r2 * r2)};
}

bool rotates(std::uint8_t model) {
    return model == 3 || model == 4 || model == 7 || model == 8;
}
bool accelerates(std::uint8_t model) {
    return model == 4 || model == 5 || model == 8 || model == 9;
}

/// From the axes of a body to those of a model.
const glm::dmat3 kModelFromBody(1, 0, 0, 0, 0, 1, 0, -1, 0);

}  // namespace

bool isBodyModel(std::uint8_t deadReckoning) {
    return deadReckoning >= 6 && deadReckoning <= 9;
}

bool isMoving(const EntityState& state) {
    const std::uint8_t model = state.deadReckoning;
    if (model < 2 || model > 9) return false;
    return state.velocity != glm::vec3(0) || (rotates(model) && state.angularVelocity != glm::vec3(0)) ||
           (accelerates(model) && state.acceleration != glm::vec3(0));
}

glm::dquat orientationOf(const EulerAngles& angles) {
    return rotationAround({0, 0, 1}, double{angles.psi}) * rotationAround({0, 1, 0}, double{angles.theta}) *
           rotationAround({1, 0, 0}, double{angles.phi});
}

EulerAngles anglesOf(const glm::dquat& worldFromBody) {
    const glm::dmat3 m = glm::mat3_cast(worldFromBody);  // m[column][row]
    const double theta = portable::asin(glm::clamp(-m[0][2], -1.0, 1.0));
    if (portable::hypot(m[0][0], m[0][1]) < 1e-9)
        return {static_cast<float>(portable::atan2(-m[1][0], m[1][1])), static_cast<float>(theta), 0};
    return {static_cast<float>(portable::atan2(m[0][1], m[0][0])), static_cast<float>(theta),
            static_cast<float>(portable::atan2(m[1][2], m[2][2]))};
}

EntityPose deadReckon(const EntityState& state, double t) {
    const std::uint8_t model = state.deadReckoning;
    EntityPose pose{state.location, orientationOf(state.orientation)};
    if (model < 2 || model > 9) return pose;
    const glm::dvec3 velocity(state.velocity);
    const glm::dvec3 acceleration = accelerates(model) ? glm::dvec3(state.acceleration) : glm::dvec3(0);
    const glm::dvec3 rate = rotates(model) ? glm::dvec3(state.angularVelocity) : glm::dvec3(0);
    const double speed = glm::length(rate);
    if (isBodyModel(model))
        pose.location +=
            pose.worldFromBody * (integralOf(speed, t)(rate, velocity) + momentOf(speed, t)(rate, acceleration));
    else
        pose.location += velocity * t + acceleration * (t * t / 2);
    if (speed > 0) pose.worldFromBody = glm::normalize(pose.worldFromBody * rotationAround(rate / speed, speed * t));
    return pose;
}

glm::dvec3 modelFromBody(const glm::dvec3& v) {
    return kModelFromBody * v;
}
glm::dvec3 bodyFromModel(const glm::dvec3& v) {
    return glm::transpose(kModelFromBody) * v;
}

Result<ExerciseFrame> ExerciseFrame::of(const Array<String>& geoSystem, const Vec3d& geoCoords) {
    const auto system = GeoSystem::read(geoSystem);
    if (!system) return std::unexpected(system.error());
    if (system->kind != GeoSystem::Kind::geocentric && geoCoords == Vec3d(0)) return ExerciseFrame{{}, kModelFromBody};
    const Vec3d origin = system->toGeocentric(geoCoords);
    if (!std::isfinite(origin.x + origin.y + origin.z)) return fail("geoCoords are no place");
    return ExerciseFrame{origin, glm::transpose(system->frameAt(origin))};
}

glm::dquat ExerciseFrame::toScene(const glm::dquat& worldFromBody) const {
    return glm::normalize(
        glm::quat_cast(sceneFromWorld * glm::mat3_cast(worldFromBody) * glm::transpose(kModelFromBody)));
}
glm::dquat ExerciseFrame::toWorld(const glm::dquat& sceneFromModel) const {
    return glm::normalize(
        glm::quat_cast(glm::transpose(sceneFromWorld) * glm::mat3_cast(sceneFromModel) * kModelFromBody));
}

}  // namespace rtsg::dis
