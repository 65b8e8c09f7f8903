// The scene as a program sees it: load, find, listen, set, add from text, route, remove, save.
//
//     12_scene_access examples/room.x3dv changed.x3d
#include <iostream>

#include <rtsg/core/listeners.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>

using namespace rtsg;

int main(int argc, char** argv) {
    Scene scene;
    Diagnostics diagnostics;
    const auto check = [&](const auto& ok) {  // what went wrong, and where
        for (const Diagnostic& one : diagnostics.all()) std::cerr << one.format() << '\n';
        if constexpr (requires { ok.error(); })
            if (!ok) std::cerr << ok.error().format() << '\n';
        if (!ok) std::exit(1);
    };
    if (argc != 3) return std::cerr << "usage: 12_scene_access SCENE CHANGED\n", 2;
    check(loadWorld(scene, argv[1], diagnostics));  // load
    const NodeId bell = scene.findName("BELL");     // find
    Listeners listeners(scene);                     // listen
    check(listeners.onField(bell, x3d::Transform::rotation, [](const Rotation& to, double t) {
        std::cout << "t = " << t << "  the bell has turned by " << to.angle << '\n';
    }));
    check(listeners.onNode(bell, [](const NodeEvent& event) {
        if (event.kind == NodeEvent::Kind::left) std::cout << "the bell is out\n";
    }));
    check(scene.set(bell, x3d::Transform::rotation, Rotation{0, 1, 0, 0.5F}));  // set: by handle,
    check(setFieldText(scene, "BELL.translation", "1 1.2 0"));                  // or by name and text
    scene.newFrame(0);

    const auto clock = createX3DFromString(scene, R"(                                   # add from text
        DEF CLOCK TimeSensor { startTime 1 cycleInterval 4 }
        DEF TURNER OrientationInterpolator { key [ 0 1 ] keyValue [ 0 1 0 0, 0 1 0 2 ] }
        ROUTE CLOCK.fraction_changed TO TURNER.set_fraction)",
                                           diagnostics);
    check(clock);
    for (const NodeId node : clock->roots) check(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    check(scene.addRoute(clock->find("TURNER"), x3d::OrientationInterpolator::value_changed.index,  // route
                         bell, x3d::Transform::rotation.index));
    for (const double t : {1.0, 2.0, 3.0}) scene.newFrame(t);
    check(scene.removeFromParents(bell));  // remove
    scene.newFrame(4);
    check(saveWorld(scene, argv[2], diagnostics, Existing::replace));  // save
}
