// A node type of one's own: a Pendulum that swings whatever its rotation is routed to. Its fields stand in
// pendulum.x3dspec, from which the build makes pendulum.h; what it does is the function below. `spec_compiler
// --skeleton Pendulum` prints such a file to start from. Nothing else has to know of the new node: it is
// mirrored and logged like any other.
//
//     03_own_node
#include <cmath>
#include <iostream>
#include <numbers>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/x3d.h>

#include "pendulum.h"

using workshop::Pendulum;

/// Called each frame while it returns a time that has come; with kNever, not before a field is written.
double swing(rtsg::Cascade& cascade, const rtsg::Node& node) {
    if (!node.get(Pendulum::enabled)) return rtsg::kNever;
    const double period = 2 * std::numbers::pi * std::sqrt(node.get(Pendulum::length) / 9.81);  // small angles
    const double angle = node.get(Pendulum::amplitude) * std::sin(2 * std::numbers::pi * cascade.now() / period);
    cascade.emit(node, Pendulum::rotation_changed, rtsg::Rotation{0, 0, 1, static_cast<float>(angle)});
    return cascade.now();
}

int main() {
    rtsg::Scene scene;
    for (auto& type : workshop::nodeTypes())
        if (!scene.defineType(std::move(type))) return 1;
    constexpr rtsg::Behaviour kBehaviour{.accepts = nullptr, .onEvent = nullptr, .onTime = swing};
    scene.registerBehaviour(*scene.findType(Pendulum::typeName), kBehaviour);

    const rtsg::NodeId clockwork = *scene.createNode(Pendulum::typeName);
    const rtsg::NodeId arm = scene.createNode(rtsg::x3d::Transform::type);
    const auto children = rtsg::x3d::RtsgScene::children;
    if (!scene.insertChild(scene.root(), children, clockwork) || !scene.insertChild(scene.root(), children, arm) ||
        !scene.set(clockwork, Pendulum::length, 9.81F) ||  // a period of 2 pi seconds
        !scene.addRoute(clockwork, Pendulum::rotation_changed.index, arm, rtsg::x3d::Transform::rotation.index))
        return 1;

    double worst = 0;
    for (int frame = 0; frame <= 60; ++frame) {
        const double t = frame / 10.0;
        scene.newFrame(t);
        const float angle = scene.node(arm).get(rtsg::x3d::Transform::rotation).angle;
        worst = std::max(worst, std::abs(angle - 0.5 * std::sin(t)));
        if (frame % 10 == 0) std::cout << "t = " << t << "  angle = " << angle << " rad\n";
    }
    std::cout << "largest deviation from 0.5 sin(t): " << worst << '\n';
    return worst < 1e-6 ? 0 : 1;
}
