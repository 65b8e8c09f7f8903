// Finds where a pointer's ray meets the invisible plane, cylinder, disk or sphere along which a drag moves, and the
// translation or rotation that follows.
//
// All numbers are in the sensor's own coordinates at the time when the drag began, in double precision. The Y axis is
// the cylinder's, the plane is parallel to Z = 0, the sphere is about the origin. Each answer follows from the first
// and the present ray alone (except that turns of a disk are counted), so the way of the pointer in between does not
// matter. Beyond the visible edge of a cylinder or a sphere, the drag goes on turning by the distance that the ray has
// moved away. Threading: pure functions. Source: ISO/IEC 19775-1 V4.0 20.4.1 to 20.4.3.
#pragma once

#include <optional>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace rtsg::behaviours {

struct DragRay {
    glm::dvec3 origin, direction;  // the direction need not be a unit vector
};

/// A point ahead of the ray on the plane through `point` at right angles to `normal`; none if there is none.
std::optional<glm::dvec3> onPlane(const DragRay& ray, const glm::dvec3& point, const glm::dvec3& normal);

/// The angle about +Y from +Z.
double rotationAboutY(const glm::dvec3& point);
/// Into (-pi, pi].
double wrapped(double angle);

struct OnCylinder {
    glm::dvec3 point;
    double facing = 0;  // the angle of the side that the ray comes from, or leaves by if it is about the far side
    double beside = 0;  // from there to the point, on and on beyond the edge
};
/// `far`: on the side that the ray leaves by. None where the ray runs along the axis.
std::optional<OnCylinder> onCylinder(const DragRay& ray, double radius, bool far);
/// Whether `point`, on the ray, is where it leaves the cylinder about the Y axis rather than where it enters it.
bool leavesCylinder(const DragRay& ray, const glm::dvec3& point);

/// The point on the sphere, at distance `radius` from its middle; beyond the edge it goes on round the back. Nothing if
/// the ray has no direction.
std::optional<glm::dvec3> onSphere(const DragRay& ray, double radius, bool far);
bool leavesSphere(const DragRay& ray, const glm::dvec3& point);
/// The shortest turn from one direction to another; for opposite ones about an axis that is always the same.
glm::dquat shortestRotation(const glm::dvec3& from, const glm::dvec3& to);

}  // namespace rtsg::behaviours
