// A recorded session as a test of an application: the scene is built afresh, gets the input that was recorded (somebody
// pressed the door's button), and every frame has to be the recorded one. A subscriber of the application's follows and
// is tested along. CMakeLists.txt registers it with rtsg_add_replay_test; `07_replay_test LOG --update` records anew.
//
//     rtsg record examples/door.x3dv -o door.rlog --for 3s --fps 30 --set PRESSED.set_boolean=TRUE@0.5
//     07_replay_test door.rlog
#include <algorithm>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/replay_test.h>

/// The part of the application that is tested: notes how far the door is open.
struct DoorWatch : rtsg::Subscriber {
    float angle = 0, widest = 0;

    rtsg::Result<> apply(const rtsg::Scene& scene, const rtsg::ChangeSet& changes) override {
        const rtsg::NodeId door = scene.findName("DOOR");
        for (const rtsg::Change& change : changes.changes)
            if (change.node == door && change.field == rtsg::x3d::Transform::rotation.index)
                angle = change.value.as<rtsg::Rotation>().angle;
        widest = std::max(widest, angle);
        return {};
    }
};

int main(int argc, char** argv) {
    DoorWatch watch;
    rtsg::Attachment attachment;
    rtsg::ReplayTest test;
    test.build = [](rtsg::Scene& scene) -> rtsg::Result<> {
        rtsg::Diagnostics diagnostics;
        if (!rtsg::loadFile(scene, DOOR_SCENE, diagnostics)) return rtsg::fail("nothing usable in it", {}, DOOR_SCENE);
        return {};
    };
    test.attach = [&](rtsg::Scene& scene) -> rtsg::Result<> {
        attachment = scene.bus().attach(watch);
        return {};
    };
    test.check = [&](const rtsg::Scene& scene) -> rtsg::Result<> {
        const auto angle = scene.node(scene.findName("DOOR")).get(rtsg::x3d::Transform::rotation).angle;
        if (watch.angle == angle) return {};
        return rtsg::fail("the watch has missed a turn of the door");
    };
    test.finish = [&]() -> rtsg::Result<> {
        if (watch.widest > 1.39f) return {};
        return rtsg::fail("the door did not open");
    };
    return rtsg::replayTestMain(argc, argv, test);
}
