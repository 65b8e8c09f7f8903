// Overlap: frame N+1's cascade while frame N is pictured, against one after the other.
#include <algorithm>
#include <semaphore>
#include <thread>

#include <fmt/format.h>

#include <rtsg/core/replica.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

/// Boxes that all turn, each by an interpolator of its own.
std::string turningBoxes(int count) {
    std::string text = "#X3D V4.0 utf8\nDEF T TimeSensor { loop TRUE cycleInterval 5 }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "DEF I{0} OrientationInterpolator {{ key [ 0 .5 1 ] keyValue [ 0 1 0 0, 0 1 0 {1}, 0 1 0 0 ] }}\n"
            "DEF J{0} Transform {{ translation {2} {3} 0 children Shape {{ geometry Box {{ size .5 .5 .5 }} }} }}\n"
            "ROUTE T.fraction_changed TO I{0}.set_fraction\nROUTE I{0}.value_changed TO J{0}.rotation\n",
            i, 1 + i % 3, i % 100, i / 100);
    return text;
}

ImageOptions smallPicture() {
    ImageOptions options;
    options.settings.width = 128;
    options.settings.height = 72;
    options.settings.threads = 1;
    return options;
}

struct Times {
    double serial = 0, overlapped = 0, scene = 0, light = 0;  // wall seconds a frame
    bool ok = true;
};

Times measure(const std::string& document, int frames) {
    Times times;
    const ImageOptions options = smallPicture();
    double t = 0;
    const auto next = [&t] { return t += 1 / 60.0; };
    {
        Scene scene;
        Diagnostics diagnostics;
        (void)loadText(scene, document, diagnostics);
        SharedWorld world(scene);
        LightRenderer light(world);
        scene.newFrame(t);
        times.ok &= light.picture(options).has_value();
        const double begin = wallSeconds();
        for (int i = 0; i < frames; ++i) {
            scene.newFrame(next());
            times.ok &= light.picture(options).has_value();
        }
        times.serial = (wallSeconds() - begin) / frames;
    }
    Scene scene;
    Diagnostics diagnostics;
    (void)loadText(scene, document, diagnostics);
    scene.newFrame(t);
    Replica replica(scene);
    std::binary_semaphore start(0), done(0);
    bool stop = false;
    double inScene = 0, inLight = 0;
    std::jthread light([&] {
        SharedWorld world(replica.scene());
        LightRenderer renderer(world);
        for (;;) {
            start.acquire();
            if (stop) return;
            const double begin = wallSeconds();
            replica.poll();
            done.release();  // the sets are taken: the next frame may come
            times.ok &= renderer.picture(options).has_value();
            inLight += wallSeconds() - begin;
            done.release();
        }
    });
    const auto pictureWhile = [&](const auto& work) {
        start.release();
        done.acquire();
        work();
        done.acquire();
    };
    pictureWhile([] {});
    inScene = inLight = 0;
    const double begin = wallSeconds();
    for (int i = 0; i < frames; ++i)
        pictureWhile([&] {
            const double before = wallSeconds();
            scene.newFrame(next());
            inScene += wallSeconds() - before;
        });
    times.overlapped = (wallSeconds() - begin) / frames;
    times.scene = inScene / frames;
    times.light = inLight / frames;
    pictureWhile([] {});
    stop = true;
    start.release();
    light.join();
    times.ok &= replica.scene().hash() == scene.hash();
    return times;
}

}  // namespace

bool overlap(const Report& report, bool quick) {
    const int boxes = quick ? 1000 : 5000, frames = quick ? 20 : 60;
    const std::string document = turningBoxes(boxes);
    Times best;
    for (int i = 0; i < 5; ++i) {
        const Times one = measure(document, frames);
        if (!one.ok) return false;
        // Wall time: the quietest run says most; both ways of it together.
        if (i == 0 || one.serial + one.overlapped < best.serial + best.overlapped) best = one;
    }
    report({"overlap", fmt::format("{} turning boxes, 128 x 72 picture", boxes), "frame, overlapped (wall time)", "ms",
            best.overlapped * 1e3, "serial", best.serial * 1e3, "the longer half alone, on its own thread",
            std::max(best.scene, best.light) * 1e3});
    return true;
}

}  // namespace rtsg::bench
