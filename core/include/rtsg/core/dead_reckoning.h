// Dead reckoning: the pose of an entity some time after an Entity State PDU, and how the world coordinates of an
// exercise map into a scene.
//
// All numbers are double; errors are those of double precision at any rotation rate. Threading: values.
// Source: IEEE 1278.1-2012 annex E (models 0 to 9); ISO/IEC 19775-1 V4.0 clause 28, 25.2. The body's acceleration of
// models 6 to 9 is the rate of change of its velocity in its own, turning axes.
#pragma once

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/dis_pdu.h>
#include <rtsg/core/value.h>

namespace rtsg::dis {

/// The rotation from the body's axes to the world's.
glm::dquat orientationOf(const EulerAngles& angles);
/// The Euler angles of a unit quaternion; phi is 0 where the nose points straight up or down.
EulerAngles anglesOf(const glm::dquat& worldFromBody);

struct EntityPose {
    glm::dvec3 location{0};
    glm::dquat worldFromBody{1, 0, 0, 0};
};
/// The pose `seconds` after the PDU. With models 0 and 1, and those above 9, the entity does not move.
EntityPose deadReckon(const EntityState& state, double seconds);
/// Whether the linear velocity and acceleration are in the body's axes.
bool isBodyModel(std::uint8_t deadReckoning);
/// Whether deadReckon() gives another pose at another time.
bool isMoving(const EntityState& state);

/// The frame in which geoSystem and geoCoords put the coordinates of a node: at geoCoords, x points east, y up and z
/// south. In a geocentric system with geoCoords at the Earth's centre, the axes are the Earth's. In any other system,
/// geoCoords 0 0 0 mean that no place was given. The exercise is then on a plane: its x is the scene's x, its y the
/// scene's z, and its z, which points down, the scene's -y.
struct ExerciseFrame {
    glm::dvec3 origin{0};
    glm::dmat3 sceneFromWorld{1};

    /// Error: an invalid geoSystem; geoCoords that are no place in it.
    static Result<ExerciseFrame> of(const Array<String>& geoSystem, const Vec3d& geoCoords);
    glm::dvec3 toScene(const glm::dvec3& location) const { return sceneFromWorld * (location - origin); }
    glm::dvec3 toWorld(const glm::dvec3& point) const { return origin + glm::transpose(sceneFromWorld) * point; }
    /// A model looks along x, with y up and z to its right; a body looks along x, with y to its right and z down.
    glm::dquat toScene(const glm::dquat& worldFromBody) const;
    glm::dquat toWorld(const glm::dquat& sceneFromModel) const;
};
/// Turns a vector from the body's axes to the model's, and back.
glm::dvec3 modelFromBody(const glm::dvec3& v);
glm::dvec3 bodyFromModel(const glm::dvec3& v);

}  // namespace rtsg::dis
