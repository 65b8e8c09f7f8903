// Moves a Transform inside a node type of its own: the smallest program that uses RTSG from outside.
#include <cstdio>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "workshop.h"

int main() {
    rtsg::Scene scene;
    const rtsg::NodeId box = scene.createNode(rtsg::x3d::Transform::type);
    for (auto& type : workshop::nodeTypes())
        if (!scene.defineType(std::move(type))) return 1;
    const auto turntable = scene.createNode(workshop::Turntable::typeName);
    if (!turntable || scene.node(*turntable).get(workshop::Turntable::speed) != 1.f) return 1;
    if (!scene.insertChild(scene.root(), rtsg::x3d::RtsgScene::children, *turntable)) return 1;
    if (!scene.insertChild(*turntable, workshop::Turntable::children, box)) return 1;
    scene.newFrame(0);
    if (!scene.set(box, rtsg::x3d::Transform::translation, rtsg::Vec3f(1, 2, 3))) return 1;
    const auto changes = scene.newFrame(1);
    std::printf("%zu change, hash %s\n", changes->changes.size(), scene.hash().hex().c_str());
    return changes->changes.size() == 1 ? 0 : 1;
}
