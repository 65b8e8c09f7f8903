// Rigid bodies: what a frame of a thousand takes while they fall, lie on each other, and rest.
#include <fmt/format.h>

#include <rtsg/documents/loader.h>
#include <rtsg/physics/rigid_body_physics.h>

#include "bench_bodies.h"

namespace rtsg::bench {

namespace {

/// Boxes on a floor, `layers` high, or in the air above it.
std::string pile(std::size_t count, std::size_t layers, double height) {
    std::string bodies, members;
    const std::size_t across = count / layers;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t column = i % across, layer = i / across;
        bodies += fmt::format(" RigidBody {{ position {} {} {} massDensityModel USE M geometry USE C{} }}",
                              2 * (column % 16), height + .5 + static_cast<double>(layer), 2 * (column / 16), i);
        members += fmt::format(" DEF C{} CollidableShape {{ shape USE S }}", i);
    }
    return "#X3D V4.0 utf8\nPROFILE Full\nDEF S Shape { geometry DEF M Box { size 1 1 1 } }\n"
           "RigidBodyCollection { autoDisable TRUE disableTime .2 disableLinearSpeed .2 disableAngularSpeed .3\n"
           "contactSurfaceThickness .002 collider CollisionCollection { frictionCoefficients .6 0 collidables [\n"
           "DEF F CollidableShape { shape Shape { geometry Box { size 1000 2 1000 } } }" +
           members + " ] } bodies [ RigidBody { fixed TRUE position 0 -1 0 geometry USE F }" + bodies + " ] }";
}

/// Median CPU time of a frame at 60 a second, after `settle` of them.
double bodiesFrame(std::size_t count, std::size_t layers, double height, int settle, int frames, std::size_t& awake) {
    Scene scene;
    RigidBodyPhysics physics(scene);
    Diagnostics diagnostics("bench");
    (void)loadText(scene, pile(count, layers, height), diagnostics);
    int frame = 0;
    for (; frame < settle; ++frame) scene.newFrame(frame / 60.0);
    awake = physics.counts().awake;
    std::vector<double> times;
    for (int i = 0; i < frames; ++i, ++frame) {
        const double start = cpuSeconds();
        scene.newFrame(frame / 60.0);
        times.push_back(cpuSeconds() - start);
    }
    return median(times);
}

}  // namespace

void rigidBodies(const Report& report, bool quick) {
    if (!RigidBodyPhysics::isAvailable()) return;
    const std::size_t count = quick ? 100 : 1'000;
    const int frames = quick ? 10 : 60;
    std::size_t awake = 0;
    const double falls = bodiesFrame(count, 1, 500, 2, frames, awake);
    report({"runtime", fmt::format("{} boxes, {} awake", count, awake), "a frame, they fall", "ms", falls * 1e3, "", 0,
            "", 0});
    const double lies = bodiesFrame(count, 4, 0, 2, 10, awake);
    report({"runtime", fmt::format("{} boxes, {} awake", count, awake), "a frame, in stacks of four", "ms", lies * 1e3,
            "", 0, "", 0});
    const double rests = bodiesFrame(count, 1, 0, 120, frames, awake);
    report({"runtime", fmt::format("{} boxes, {} awake", count, awake), "a frame, at rest", "ms", rests * 1e3,
            "they fall", falls * 1e3, "", 0});
}

}  // namespace rtsg::bench
