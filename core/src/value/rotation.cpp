// Converts between rotations, quaternions and matrices.
#include <rtsg/core/rotation.h>

#include <cmath>

#include <rtsg/core/portable_math.h>

namespace rtsg {

glm::dquat rotationAround(const glm::dvec3& axis, double angle) {
    const portable::SineCosine half = portable::sineCosine(angle * .5);
    return {half.cosine, axis.x * half.sine, axis.y * half.sine, axis.z * half.sine};
}

glm::dquat toQuaternion(const Rotation& r) {
    const glm::dvec3 axis(r.x, r.y, r.z);
    const double length = glm::length(axis);
    if (!(length > 0) || !std::isfinite(length) || !std::isfinite(r.angle)) return {1, 0, 0, 0};
    return rotationAround(axis / length, double{r.angle});
}

Rotation toRotation(glm::dquat q) {
    if (q.w < 0) q = -q;
    const double s = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    if (!(s > 0)) return {0, 0, 1, 0};
    return {static_cast<float>(q.x / s), static_cast<float>(q.y / s), static_cast<float>(q.z / s),
            static_cast<float>(2 * portable::atan2(s, q.w))};
}

glm::dmat3 rotationMatrixOf(const glm::dvec3& axis, double angle) {
    const portable::SineCosine by = portable::sineCosine(angle);
    const glm::dvec3 unit = axis / glm::length(axis), part = (1 - by.cosine) * unit, across = by.sine * unit;
    return {by.cosine + part.x * unit.x, part.x * unit.y + across.z,  part.x * unit.z - across.y,
            part.y * unit.x - across.z,  by.cosine + part.y * unit.y, part.y * unit.z + across.x,
            part.z * unit.x + across.y,  part.z * unit.y - across.x,  by.cosine + part.z * unit.z};
}

glm::dquat alongShorterArc(const glm::dquat& from, glm::dquat to, double fraction) {
    double cosine = glm::dot(from, to);
    if (cosine < 0) {
        to = -to;
        cosine = -cosine;
    }
    // Between neighbours the arc is its chord.
    if (cosine > 1 - 1e-15) return from * (1 - fraction) + to * fraction;
    const double angle = portable::acos(cosine), sine = portable::sin(angle);
    return from * (portable::sin((1 - fraction) * angle) / sine) + to * (portable::sin(fraction * angle) / sine);
}

}  // namespace rtsg
