// Prints what a moving Transform is told: the smallest program that uses RTSG from outside.
#include <cstdio>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

int main() {
    rtsg::Scene scene;
    const rtsg::NodeId box = scene.createNode(rtsg::x3d::Transform::type);
    if (!scene.insertChild(scene.root(), rtsg::x3d::RtsgScene::children, box)) return 1;
    scene.newFrame(0);
    if (!scene.set(box, rtsg::x3d::Transform::translation, rtsg::Vec3f(1, 2, 3))) return 1;
    const auto changes = scene.newFrame(1);
    std::printf("%zu change, hash %s\n", changes->changes.size(), scene.hash().hex().c_str());
    return changes->changes.size() == 1 ? 0 : 1;
}
