// Bodies that glide, tumble and travel, as change sets to encode.
#include "motion_sync.h"

#include <cmath>

#include <rtsg/core/x3d.h>

namespace rtsg::bench {

namespace {

constexpr double kStep = 1. / 60;

template <class T>
T spline(const T (&p)[4], double t) {
    const double t2 = t * t, t3 = t2 * t;
    return p[0] * (-.5 * t3 + t2 - .5 * t) + p[1] * (1.5 * t3 - 2.5 * t2 + 1) + p[2] * (-1.5 * t3 + 2 * t2 + .5 * t) +
           p[3] * (.5 * t3 - .5 * t2);
}

Rotation asRotation(glm::dquat q) {
    if (q.w < 0) q = -q;
    const double s = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    if (s < 1e-12) return {};
    return {float(q.x / s), float(q.y / s), float(q.z / s), float(2 * std::atan2(s, q.w))};
}

}  // namespace

glm::dvec3 Motion::somewhere(double size) {
    std::uniform_real_distribution<double> along(-size, size);
    const double x = along(random_), y = along(random_), z = along(random_);
    return {x, y, z};
}
glm::dquat Motion::someRotation() {
    std::normal_distribution<double> n;
    const double w = n(random_), x = n(random_), y = n(random_), z = n(random_);
    return glm::normalize(glm::dquat(w, x, y, z));
}

glm::dquat Motion::rotationFrom(const glm::dquat& before) {
    const glm::dvec3 axis = glm::normalize(somewhere(1));
    const double angle = std::uniform_real_distribution<double>(0, 1.05)(random_);
    return glm::angleAxis(angle, axis) * before;
}

Motion::Motion(Movement movement, std::size_t bodies, std::uint64_t seed) : random_(seed), bodies_(bodies) {
    std::uniform_real_distribution<double> part(0, 1);
    for (std::size_t i = 0; i < bodies; ++i) {
        Body& b = bodies_[i];
        b.movement = movement == Movement::mixed ? static_cast<Movement>(i % 3) : movement;
        b.position = somewhere(10) + glm::dvec3(0, 10, 0);
        b.velocity = somewhere(3);
        b.spin = somewhere(5);
        b.rotation = someRotation();
        b.knots[0] = b.position;
        b.rotations[0] = b.rotation;
        for (int k = 1; k < 4; ++k) {
            b.knots[k] = b.knots[k - 1] + somewhere(2);
            b.rotations[k] = rotationFrom(b.rotations[k - 1]);
        }
        b.phase = part(random_);
        b.still = 1 + part(random_);
    }
}

void Motion::glide(Body& b) {
    b.phase += kStep;
    if (b.phase >= 1) {
        b.phase -= 1;
        for (int k = 0; k < 3; ++k) {
            b.knots[k] = b.knots[k + 1];
            b.rotations[k] = b.rotations[k + 1];
        }
        b.knots[3] = b.knots[2] + somewhere(2);
        b.rotations[3] = rotationFrom(b.rotations[2]);
    }
    for (int k = 1; k < 4; ++k)
        if (glm::dot(b.rotations[k - 1], b.rotations[k]) < 0) b.rotations[k] = -b.rotations[k];
    b.position = spline(b.knots, b.phase);
    b.rotation = glm::normalize(spline(b.rotations, b.phase));
}

void Motion::tumble(Body& b) {
    b.velocity.y -= 9.81 * kStep;
    b.position += b.velocity * kStep;
    const glm::dquat spin(0, b.spin.x, b.spin.y, b.spin.z);
    b.rotation = glm::normalize(b.rotation + (spin * b.rotation) * (.5 * kStep));
    std::normal_distribution<double> n(0, .3);
    for (int axis = 0; axis < 3; ++axis) {
        const double low = axis == 1 ? .5 : -10, high = 10;
        if (b.position[axis] >= low && (axis == 1 || b.position[axis] <= high)) continue;
        b.position[axis] = b.position[axis] < low ? low : high;
        b.velocity[axis] *= -.6;
        // Friction at the contact turns sliding into rolling, never the same way twice.
        b.spin = b.spin * .7 + glm::dvec3(b.velocity.z, n(random_), -b.velocity.x) * .6 +
                 glm::dvec3(n(random_), n(random_), n(random_));
        b.velocity += glm::dvec3(n(random_), std::abs(n(random_)) * .3, n(random_));
    }
    // Engines compute in single precision.
    b.position = glm::dvec3(glm::vec3(b.position));
    b.velocity = glm::dvec3(glm::vec3(b.velocity));
    b.spin = glm::dvec3(glm::vec3(b.spin));
    b.rotation = glm::dquat(glm::quat(b.rotation));
    if (glm::length(b.velocity) < .6 && b.position.y < .6) b.velocity += somewhere(3) + glm::dvec3(0, 5, 0);
}

void Motion::travel(Body& b) {
    b.still -= kStep;
    if (b.still > 0) return;  // at rest
    b.position += b.velocity * kStep;
    const glm::dquat spin(0, b.spin.x, b.spin.y, b.spin.z);
    b.rotation = glm::normalize(b.rotation + (spin * b.rotation) * (.5 * kStep));
    if (b.still < -1) {
        b.still = 2;
        b.velocity = somewhere(3);
    }
}

ChangeSet Motion::next() {
    ChangeSet set;
    set.from = ++frame_;
    set.to = frame_ + 1;
    set.time = double(frame_) * kStep;
    const auto add = [&](std::size_t i, FieldIndex field, Value value) {
        Change& change = set.changes.emplace_back();
        change.node = NodeId{kFirstNode + 3 * static_cast<std::uint32_t>(i)};
        change.field = field;
        change.external = false;
        change.value = std::move(value);
    };
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        Body& b = bodies_[i];
        switch (b.movement) {
            case Movement::smooth:
                glide(b);
                break;
            case Movement::chaotic:
                tumble(b);
                break;
            case Movement::mixed:
                travel(b);
                break;
        }
        const Vec3f position(b.position);
        const Rotation rotation = asRotation(b.rotation);
        if (position != b.shownPosition) add(i, x3d::Transform::translation.index, b.shownPosition = position);
        if (!(rotation == b.shownRotation)) add(i, x3d::Transform::rotation.index, b.shownRotation = rotation);
    }
    return set;
}

}  // namespace rtsg::bench
