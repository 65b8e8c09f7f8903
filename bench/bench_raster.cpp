// The rasteriser on the scenes of the paper's table 3: frames a second by deltas, by full traversal and by rays, and
// what follows a frame by deltas against the scene handed over anew; and hybrid pictures beside rays.
#include <algorithm>
#include <filesystem>
#include <optional>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/ogre/ogre_renderer.h>

#include "bench.h"
#include "bench/scenes/scenes.h"
#include "world/full_traversal.h"

namespace rtsg::bench {

namespace {

constexpr int kRasterWidth = 640, kRasterHeight = 480;

struct RasterFigures {
    std::vector<double> flattening, deltas, anew, drawing, rays;  // CPU seconds a frame
    /// Seconds by the clock, on all cores, from the clock's tick to the picture.
    std::vector<double> byDeltas, byTraversal, byRays;
    std::vector<double> hybrid, whitted;  // CPU seconds of a whole picture, with shadows and mirrors
    std::vector<double> ofRays;           // of the first of these, its rays
    double difference = 0, overlap = 1;   // of these two: the mean of 255; the part of what is no sky that both show
    double traced = 0;                    // share of a hybrid picture's pixels
    std::uint64_t meshes = 0, bent = 0;   // handed over while frames went by: whole, and only what moved
};

/// A scene with who shows it: OGRE and rays, and the traversal that finds changes without listeners.
class RasterRace {
  public:
    explicit RasterRace(const std::filesystem::path& file) : resources_(Resources::ofFile(file)) {
        image_.settings.width = kRasterWidth, image_.settings.height = kRasterHeight;
        image_.settings.samplesPerPixel = 1;
        image_.settings.shadows = Shadows::none, image_.settings.maxDepth = 0;
    }
    Result<> open(const std::filesystem::path& file) {
        Diagnostics diagnostics;
        if (!loadFile(scene_, file, diagnostics)) return fail("nothing usable in it", {}, file.string());
        scene_.forEachNode([&](const Node& node) {
            if (!eye_ && node.is(x3d::Viewpoint::type)) eye_ = node.id();
        });
        scene_.newFrame(0);
        SharedWorld::Options polled;
        polled.delivery = Delivery::polled, polled.timed = true;
        world_.emplace(scene_, polled), rayWorld_.emplace(scene_, polled);
        raster_.emplace(*world_, LightRenderer::Options(resources_));
        light_.emplace(*rayWorld_, LightRenderer::Options(resources_));
        if (const auto first = raster_->nextPicture(image_); !first) return std::unexpected(first.error());
        if (const auto first = light_->picture(image_); !first) return std::unexpected(first.error());
        if (auto ok = full_.attachToScene(scene_); !ok) return ok;
        return full_.renderFrame();
    }
    Result<> frame(int number, bool comparesAnew, RasterFigures& out) {
        walk();
        const OgreRenderer::Counts before = raster_->counts();
        const double begun = wallSeconds();
        scene_.newFrame(number / 60.0);
        const double thread = threadSeconds(), cascade = wallSeconds() - begun;
        if (auto ok = world_->update(); !ok) return ok;
        const double followed = threadSeconds() - thread, flattening = world_->times().flattening, start = cpuSeconds();
        if (const auto picture = raster_->nextPicture(image_); !picture) return std::unexpected(picture.error());
        const double whole = wallSeconds() - begun;
        const double handing = raster_->counts().handing - before.handing;
        out.meshes += raster_->counts().meshes - before.meshes, out.bent += raster_->counts().bent - before.bent;
        out.drawing.push_back(cpuSeconds() - start - handing);
        out.deltas.push_back(followed + handing), out.flattening.push_back(flattening);
        out.byDeltas.push_back(whole);
        // The same picture, had its changes been found by looking at every node.
        if (auto ok = full_.renderFrame(); !ok) return ok;
        out.byTraversal.push_back(whole - flattening + full_.stats().traverseSeconds);
        const double traced = cpuSeconds(), clock = wallSeconds();
        if (const auto picture = light_->picture(image_); !picture) return std::unexpected(picture.error());
        out.rays.push_back(cpuSeconds() - traced), out.byRays.push_back(wallSeconds() - clock + cascade);
        return comparesAnew ? anew(out) : Result<>();
    }

    /// Pictures with all that rays show, by both ways to find what the eye sees.
    Result<> whole(RasterFigures& out) {
        ImageOptions image = image_;
        image.settings.shadows = Shadows::automatic, image.settings.maxDepth = RenderSettings().maxDepth;
        constexpr int kTimes = 4;  // the first one builds
        for (int i = 0; i < kTimes; ++i) {
            walk();
            RenderStats stats;
            const double start = cpuSeconds(), before = raster_->counts().tracing;
            const auto hybrid = raster_->hybridPicture(image, &stats);
            if (!hybrid) return std::unexpected(hybrid.error());
            const double middle = cpuSeconds();
            const auto traced = light_->picture(image);
            if (!traced) return std::unexpected(traced.error());
            if (i == 0) continue;
            out.ofRays.push_back(raster_->counts().tracing - before);
            out.hybrid.push_back(middle - start), out.whitted.push_back(cpuSeconds() - middle);
            compare(*traced, *hybrid, out);
            out.traced = static_cast<double>(stats.primaryRays) /
                         static_cast<double>(std::max<std::size_t>(hybrid->pixels.size(), 1));
        }
        return {};
    }

  private:
    static void compare(const Picture& a, const Picture& b, RasterFigures& out) {
        const auto shown = [](const Vec4f& pixel) { return glm::clamp(Vec3f(pixel), Vec3f(0), Vec3f(1)) * 255.0f; };
        const auto isObject = [&](const Vec3f& color) {
            const Vec3f d = glm::abs(color - shown(a.pixels[0]));
            return std::max({d.x, d.y, d.z}) > 4;
        };
        double sum = 0, both = 0, any = 0;
        for (std::size_t i = 0; i < a.pixels.size(); ++i) {
            const Vec3f x = shown(a.pixels[i]), y = shown(b.pixels[i]), d = glm::abs(x - y);
            sum += static_cast<double>(d.x) + d.y + d.z;
            both += isObject(x) && isObject(y), any += isObject(x) || isObject(y);
        }
        out.difference = std::max(out.difference, sum / (3 * static_cast<double>(a.pixels.size())));
        if (any > 0) out.overlap = std::min(out.overlap, both / any);
    }
    /// A step aside, so that no pixel of the picture before will do.
    void walk() {
        if (!eye_) return;
        const Vec3f at = scene_.node(eye_).get(x3d::Viewpoint::position);
        (void)scene_.set(eye_, x3d::Viewpoint::position, at + Vec3f(.01f, 0, .01f));
    }
    Result<> anew(RasterFigures& out) {
        const double begin = threadSeconds();
        SharedWorld fresh(scene_);
        OgreRenderer again(fresh, LightRenderer::Options(resources_));
        const double attached = threadSeconds() - begin;
        if (const auto picture = again.nextPicture(image_); !picture) return std::unexpected(picture.error());
        out.anew.push_back(attached + again.counts().handing);
        return {};
    }

    Scene scene_;
    NodeId eye_;
    const Resources resources_;
    ImageOptions image_;
    std::optional<SharedWorld> world_, rayWorld_;
    std::optional<OgreRenderer> raster_;
    std::optional<LightRenderer> light_;
    FullTraversalRenderer full_;
};

Result<> rasterFrames(const std::filesystem::path& file, int frames, RasterFigures& out) {
    RasterRace race(file);
    if (auto ok = race.open(file); !ok) return ok;
    for (int i = 1; i <= frames; ++i)
        if (auto ok = race.frame(i, i <= 2, out); !ok) return ok;
    return race.whole(out);
}

void reportRaster(const Report& report, const std::string& what, const RasterFigures& figures) {
    const auto rate = [](const std::vector<double>& seconds) { return 1 / std::max(1e-9, median(seconds)); };
    report({"raster", what, "frames a second by OGRE, deltas", "1/s", rate(figures.byDeltas), "by full traversal",
            rate(figures.byTraversal), "by rays", rate(figures.byRays)});
    report({"raster", what, "a frame handed over, by deltas", "ms", median(figures.deltas) * 1e3, "the scene anew",
            median(figures.anew) * 1e3, "deltas alone", median(figures.flattening) * 1e3});
    report({"raster", what, "a picture, 640 x 480", "ms", median(figures.drawing) * 1e3, "by rays",
            median(figures.rays) * 1e3, "", 0});
    report({"raster", what, "a hybrid picture, with shadows", "ms", median(figures.hybrid) * 1e3, "by rays",
            median(figures.whitted) * 1e3, "its rays alone", median(figures.ofRays) * 1e3});
    report({"raster", what, "a hybrid picture differs from rays by, of 255", "", figures.difference, "overlap",
            figures.overlap, "pixels traced, of 100", 100 * figures.traced});
    report({"raster", what, "meshes handed over whole while frames went by", "", static_cast<double>(figures.meshes),
            "only what moved", static_cast<double>(figures.bent), "", 0});
}

}  // namespace

bool raster(const Report& report, bool quick) {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-raster-{}", getpid());
    std::filesystem::create_directories(folder);
    bool ok = true;
    for (const char* name : {"Beetles", "Troopers", "Venice", "Escherknot"}) {
        const auto triangles = writeBenchScene(name, quick ? .01 : 1, false, folder);
        RasterFigures figures;
        const Result<> done = triangles ? rasterFrames(folder / fmt::format("{}.x3dv", name), quick ? 4 : 12, figures)
                                        : std::unexpected(triangles.error());
        if (!done) {
            fmt::print(stderr, "raster: {}: {}\n", name, done.error().format());
            ok = false;
            break;
        }
        reportRaster(report, fmt::format("{}, {} triangles", name, *triangles), figures);
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
    return ok;
}

}  // namespace rtsg::bench
