// Bench "stage", lights: one of many local lights is switched; what light's tables take to follow it.
#include <string>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/shared_world.h>

#include "bench.h"
#include "bench_stage.h"

namespace rtsg::bench {

void stageLights(const Report& report, bool quick) {
    const int lamps = quick ? 100 : 1600, switches = quick ? 20 : 200;
    std::string text = "#X3D V4.0 utf8\nPROFILE Immersive\n";
    for (int i = 0; i < lamps; ++i)
        text += fmt::format(
            "Transform {{ translation {} 0 {} children [ DEF L{} PointLight {{ global FALSE }} Shape {{ appearance "
            "Appearance {{ material Material {{ }} }} geometry Box {{ }} }} ] }}\n",
            4 * (i % 40), 4 * (i / 40), i);
    Scene scene;
    Diagnostics diagnostics;
    if (!loadText(scene, text, diagnostics)) return;
    SharedWorld world(scene, {.flattening = {}, .rays = {}, .delivery = Delivery::immediate, .timed = true});
    LightTracer tracer;
    double start = threadSeconds();
    world.add(tracer);
    const double scratch = threadSeconds() - start;
    std::vector<double> seconds;
    for (int i = 0; i < switches; ++i) {
        const NodeId lamp = scene.findName(fmt::format("L{}", i * (lamps / switches)));
        (void)scene.set(lamp, x3d::PointLight::on, i % 2 != 0);
        scene.newFrame(i / 60.0);
        seconds.push_back(world.times().subscribers);
    }
    report({"stage", fmt::format("one of {} local lights is switched", lamps), "light's tables", "us",
            (median(seconds) - cpuClockSeconds()) * 1e6, "all tables anew", scratch * 1e6, "flattening it",
            world.times().flattening * 1e6});
}

}  // namespace rtsg::bench
