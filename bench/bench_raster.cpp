// The rasteriser on the paper's scenes: what follows a frame by deltas against the scene handed over anew, and pictures
// beside those by rays.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/ogre/ogre_renderer.h>

#include "bench.h"
#include "bench/scenes/scenes.h"

namespace rtsg::bench {

namespace {

struct RasterFigures {
    std::vector<double> flattening, deltas, anew, drawing, rays;  // CPU seconds a frame
};

/// A step aside, so that no pixel of the picture before will do.
void walk(Scene& scene, NodeId eye) {
    if (!eye) return;
    const Vec3f at = scene.node(eye).get(x3d::Viewpoint::position);
    (void)scene.set(eye, x3d::Viewpoint::position, at + Vec3f(.01f, 0, .01f));
}

Result<> rasterFrames(const std::filesystem::path& file, int frames, RasterFigures& out) {
    Scene scene;
    Diagnostics diagnostics;
    if (!loadFile(scene, file, diagnostics)) return fail("nothing usable in it", {}, file.string());
    NodeId eye;
    scene.forEachNode([&](const Node& node) {
        if (!eye && node.is(x3d::Viewpoint::type)) eye = node.id();
    });
    scene.newFrame(0);
    SharedWorld::Options polled;
    polled.delivery = Delivery::polled, polled.timed = true;
    SharedWorld world(scene, polled), rayWorld(scene);
    const Resources resources = Resources::ofFile(file);
    OgreRenderer raster(world, LightRenderer::Options(resources));
    LightRenderer light(rayWorld, LightRenderer::Options(resources));
    ImageOptions image;
    image.settings.width = 640, image.settings.height = 480, image.settings.samplesPerPixel = 1;
    image.settings.shadows = Shadows::none, image.settings.maxDepth = 0;
    if (const auto first = raster.nextPicture(image); !first) return std::unexpected(first.error());
    if (const auto first = light.picture(image); !first) return std::unexpected(first.error());
    for (int i = 1; i <= frames; ++i) {
        walk(scene, eye);
        scene.newFrame(i / 60.0);
        const double before = threadSeconds(), handed = raster.counts().handing;
        if (auto ok = world.update(); !ok) return ok;
        const double followed = threadSeconds() - before, start = cpuSeconds();
        if (const auto picture = raster.nextPicture(image); !picture) return std::unexpected(picture.error());
        const double handing = raster.counts().handing - handed;
        out.drawing.push_back(cpuSeconds() - start - handing);
        out.deltas.push_back(followed + handing), out.flattening.push_back(world.times().flattening);
        const double traced = cpuSeconds();
        if (const auto picture = light.picture(image); !picture) return std::unexpected(picture.error());
        out.rays.push_back(cpuSeconds() - traced);
        if (i > 3) continue;
        const double begin = threadSeconds();
        SharedWorld fresh(scene);
        OgreRenderer anew(fresh, LightRenderer::Options(resources));
        const double attached = threadSeconds() - begin;
        if (const auto picture = anew.nextPicture(image); !picture) return std::unexpected(picture.error());
        out.anew.push_back(attached + anew.counts().handing);
    }
    return {};
}

}  // namespace

bool raster(const Report& report, bool quick) {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-raster-{}", getpid());
    std::filesystem::create_directories(folder);
    bool ok = true;
    for (const char* name : {"Beetles", "Troopers", "Venice", "Escherknot"}) {
        const auto triangles = writeBenchScene(name, quick ? .01 : .2, false, folder);
        RasterFigures figures;
        const Result<> done = triangles ? rasterFrames(folder / fmt::format("{}.x3dv", name), quick ? 4 : 12, figures)
                                        : std::unexpected(triangles.error());
        if (!done) {
            fmt::print(stderr, "raster: {}: {}\n", name, done.error().format());
            ok = false;
            break;
        }
        const std::string what = fmt::format("{}, {} triangles", name, *triangles);
        report({"raster", what, "a frame handed over, by deltas", "ms", median(figures.deltas) * 1e3, "the scene anew",
                median(figures.anew) * 1e3, "deltas alone", median(figures.flattening) * 1e3});
        report({"raster", what, "a picture, 640 x 480", "ms", median(figures.drawing) * 1e3, "by rays",
                median(figures.rays) * 1e3, "", 0});
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
    return ok;
}

}  // namespace rtsg::bench
