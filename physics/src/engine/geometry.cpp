// Makes the engine's geometry of a Shape: boxes, balls and cylinders exactly, all others as their triangles.
#include <cmath>

#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "engine.h"

namespace rtsg::physics {

namespace {

bool isLength(double value) {
    return std::isfinite(value) && value > 0 && value < 1e9;
}

}  // namespace

bool isFinite(const Pose& pose) {
    const auto sound = [](double value) { return std::abs(value) < 1e12; };  // false for NaN
    return sound(pose.position.x) && sound(pose.position.y) && sound(pose.position.z) && sound(pose.rotation.w) &&
           sound(pose.rotation.x) && sound(pose.rotation.y) && sound(pose.rotation.z);
}

bool GeomMaker::make(const Node& geometry, Geom& into) {
    problem = "has no size that can be: nothing collides with it";
    if (geometry.is(x3d::Box::type)) {
        const Vec3f size = geometry.get(x3d::Box::size);
        if (!isLength(size.x) || !isLength(size.y) || !isLength(size.z)) return false;
        into.geom = dCreateBox(nullptr, size.x, size.y, size.z);
        return true;
    }
    if (geometry.is(x3d::Sphere::type)) {
        const double radius = geometry.get(x3d::Sphere::radius);
        if (!isLength(radius)) return false;
        into.geom = dCreateSphere(nullptr, radius);
        return true;
    }
    const auto whole = [&] {
        using C = x3d::Cylinder;
        return geometry.get(C::side) && geometry.get(C::top) && geometry.get(C::bottom);
    };
    if (geometry.is(x3d::Cylinder::type) && whole()) {
        const double radius = geometry.get(x3d::Cylinder::radius), height = geometry.get(x3d::Cylinder::height);
        if (!isLength(radius) || !isLength(height)) return false;
        into.geom = dCreateCylinder(nullptr, radius, height);  // along z
        into.shape.rotation = rotationAround(glm::dvec3(1, 0, 0), std::numbers::pi / 2);
        return true;
    }
    return mesh(geometry, into);
}

bool GeomMaker::mesh(const Node& geometry, Geom& into) {
    const auto cut = tessellator.mesh(scene, geometry.id());
    problem = "has no triangles: nothing collides with it";
    if (!cut || cut->empty()) return false;
    for (const Vec3f& corner : cut->positions) into.corners.insert(into.corners.end(), {corner.x, corner.y, corner.z});
    const auto usable = [&](std::int32_t corner) {
        if (corner < 0 || static_cast<std::size_t>(corner) >= cut->positions.size()) return false;
        const Vec3f at = cut->positions[static_cast<std::size_t>(corner)];
        return std::abs(at.x) < 1e9f && std::abs(at.y) < 1e9f && std::abs(at.z) < 1e9f;
    };
    const auto positionOf = [&](std::int32_t corner) {
        return Vec3d(cut->positions[static_cast<std::size_t>(corner)]);
    };
    for (std::size_t t = 0; t < cut->triangleCount; ++t) {
        const std::int32_t* corner = cut->triangles.data() + t * cut->triangleStride;
        if (!usable(corner[0]) || !usable(corner[1]) || !usable(corner[2])) continue;
        const Vec3d a = positionOf(corner[0]);
        if (!(glm::length(glm::cross(positionOf(corner[1]) - a, positionOf(corner[2]) - a)) > 0)) continue;
        for (int c = 0; c < 3; ++c) into.triangles.push_back(static_cast<dTriIndex>(corner[c]));
    }
    if (into.triangles.empty()) return false;
    // Corners that no triangle has may be anything: the engine must not take their box.
    for (double& number : into.corners)
        if (!(std::abs(number) < 1e9)) number = 0;
    into.mesh = dGeomTriMeshDataCreate();
    dGeomTriMeshDataBuildDouble(into.mesh, into.corners.data(), 3 * sizeof(double),
                                static_cast<int>(into.corners.size() / 3), into.triangles.data(),
                                static_cast<int>(into.triangles.size()), 3 * sizeof(dTriIndex));
    into.geom = dCreateTriMesh(nullptr, into.mesh, nullptr, nullptr, nullptr);
    return true;
}

}  // namespace rtsg::physics
