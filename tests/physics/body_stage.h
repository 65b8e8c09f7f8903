// The stage for tests of rigid bodies: a scene whose bodies move.
#pragma once

#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/physics/rigid_body_physics.h>

namespace rtsg::test {

/// A scene with physics, made from nodes in ClassicVRML, in its frame of time 0.
struct BodyStage {
    Scene scene;
    RigidBodyPhysics physics{scene};

    explicit BodyStage(const std::string& nodes) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + nodes, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u);
        scene.newFrame(0);
    }
    const Node& node(std::string_view name) const { return scene.node(scene.findName(name)); }
    Vec3d position(std::string_view name) const { return Vec3d(node(name).get(x3d::RigidBody::position)); }
    Vec3d velocity(std::string_view name) const { return Vec3d(node(name).get(x3d::RigidBody::linearVelocity)); }
};

inline std::string collidable(const std::string& name, const std::string& geometry) {
    return fmt::format("DEF {} CollidableShape {{ shape Shape {{ geometry {} }} }}", name, geometry);
}

}  // namespace rtsg::test
