// Scenes and sets in which transforms move, for the benchmarks of rtsg::sync.
#pragma once

#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::bench {

/// Translation and rotation of `transforms` nodes, chaotic enough that nothing repeats.
inline ChangeSet animatedSet(int transforms) {
    ChangeSet set;
    set.from = 1;
    set.to = 2;
    for (int i = 0; i < transforms; ++i) {
        Change change;
        change.node = NodeId{static_cast<std::uint32_t>(100 + 3 * i)};
        change.field = x3d::Transform::translation.index;
        change.value = Vec3f(float(i), float(i % 17), 1);
        set.changes.push_back(change);
        change.field = x3d::Transform::rotation.index;
        change.value = Rotation{0, 1, 0, float(i) * .01f};
        set.changes.push_back(change);
    }
    return set;
}

/// A scene of which `moving` transforms (or all) move in every frame.
struct Moving {
    Scene scene;
    std::vector<NodeId> nodes;
    float phase = 0;

    explicit Moving(int transforms) {
        Array<NodeId> children;
        for (int i = 0; i < transforms; ++i) {
            nodes.push_back(scene.createNode(x3d::Transform::type));
            children.push_back(nodes.back());
        }
        (void)scene.setField(scene.root(), x3d::RtsgScene::children.index, children);
        scene.newFrame(0);
    }
    /// `count` of them, from `first` on, at `time` seconds.
    void frame(double time, std::size_t first, std::size_t count) {
        phase += .01f;
        for (std::size_t i = first; i < first + count; ++i)
            (void)scene.set(nodes[i % nodes.size()], x3d::Transform::translation,
                            Vec3f(phase, float(i), phase * float(i)));
        scene.newFrame(time);
    }
    void frame(int number) { frame(number, 0, nodes.size()); }
};

}  // namespace rtsg::bench
