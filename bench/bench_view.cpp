// The window in front of somebody who walks through the demo's hall, without a screen: how often it has a new picture,
// how long a key takes until it is seen, how long whoever stands still waits for the whole picture, and, by path, for
// one with little noise; and what a picture is worth, by its resolution and samples.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/ogre/ogre_renderer.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/world_queries.h>
#include <rtsg/window/scene_window.h>

#include "bench_view.h"
#include "charts.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

const char* const kSeenHall = "examples/demo/hall.x3dv";

double passedSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}
double valueAtQuantile(std::vector<double> values, double of) {
    if (values.empty()) return 0;
    std::ranges::sort(values);
    return values[static_cast<std::size_t>(of * static_cast<double>(values.size() - 1))];
}

/// Somebody in front of it: a scene that runs at 60 frames a second, and its window.
class Viewer {
  public:
    Result<> open(const std::string& file) {
        Diagnostics diagnostics;
        if (!loadFile(scene_, file, diagnostics)) return fail("the scene cannot be read");
        // Where it is to be gone round one walks all the same.
        scene_.forEachNode([&](const Node& node) {
            if (node.is(x3d::NavigationInfo::type)) info_ = node.id();
        });
        if (info_) (void)scene_.set(info_, x3d::NavigationInfo::type_, Array<String>{String("WALK")});
        scene_.setNavigation(true);
        world_.emplace(scene_);
        queries_.emplace(*world_, Resources::ofFile(file));
        scene_.setSpaceQueries(&*queries_);
        scene_.newFrame(0);
        SceneWindowOptions options;
        options.picture.settings.width = 1280, options.picture.settings.height = 720;
        options.picture.resources = Resources::ofFile(file);
        auto window = SceneWindow::open(*world_, std::move(options));
        if (!window) return std::unexpected(window.error());
        window_ = std::move(*window);
        return {};
    }
    ~Viewer() {
        window_.reset();
        scene_.setSpaceQueries(nullptr);
    }
    void key(const char* name, bool down) { (void)sendKey(scene_, *KeyInput::named(name, down)); }
    /// A frame, and what is shown until the next one is due.
    void poll() {
        const double now = passedSince(start_);
        scene_.newFrame(now);
        window_->poll(std::chrono::ceil<std::chrono::milliseconds>(
            std::chrono::duration<double>(std::max(0., 1 / 60.0 - (passedSince(start_) - now)))));
        if (const auto shown = window_->shown(); shown && shown != last_) {
            last_ = shown;
            if (shown->isMoving) widths_.push_back(shown->width);
        }
    }
    template <class Wanted>
    double until(const Wanted& wanted) {
        const Clock::time_point begun = Clock::now();
        while (!wanted() && passedSince(begun) < 20) poll();
        return passedSince(begun);
    }
    void walk(double seconds) {
        const char* const clients[] = {"UP", "LEFT", "DOWN", "RIGHT"};
        for (const double end = passedSince(start_) + seconds; passedSince(start_) < end;) {
            const char* variant = clients[steps_++ % 4];
            key(variant, true);
            for (const double turned = passedSince(start_) + .7; passedSince(start_) < turned;) poll();
            key(variant, false);
        }
    }
    /// Seconds from a key to the first picture of a state in which it has moved the viewer.
    double keyToPicture() {
        const std::uint64_t before = scene_.sequence();
        const ViewerPose from = viewerPose(scene_);
        key(steps_++ % 2 == 0 ? "LEFT" : "RIGHT", true);
        std::uint64_t moved = 0;
        const double took = until([&] {
            if (moved == 0 && scene_.sequence() > before && viewerPose(scene_) != from) moved = scene_.sequence();
            return moved != 0 && last_ && last_->sequence >= moved;
        });
        key("LEFT", false), key("RIGHT", false);
        for (int i = 0; i < 20; ++i) poll();
        return took;
    }
    /// Seconds from the frame in which the scene and the viewer stand still to the whole picture.
    double restToWhole() {
        key("LEFT", true);
        for (int i = 0; i < 20; ++i) poll();
        key("LEFT", false);
        poll();
        // Its clocks stop with it.
        const Clock::time_point begun = Clock::now();
        while (!(window_->shown() && window_->shown()->whole) && passedSince(begun) < 20) window_->poll(5ms);
        return passedSince(begun);
    }

    Scene& scene() { return scene_; }
    SceneWindow& window() { return *window_; }
    std::vector<double> widths() const { return widths_; }

  private:
    Scene scene_;
    NodeId info_;
    std::optional<SharedWorld> world_;
    std::optional<WorldQueries> queries_;
    std::unique_ptr<SceneWindow> window_;
    std::shared_ptr<const LivePictureShown> last_;
    std::vector<double> widths_;
    const Clock::time_point start_ = Clock::now();
    int steps_ = 0;
};

bool walked(const Report& report, const std::string& name, const std::string& file, bool quick) {
    Viewer viewer;
    if (const auto ok = viewer.open(file); !ok) {
        report({"view", name + ", " + ok.error().text, "window", "0/1", 0, "", 0, "", 0});
        return false;
    }
    const auto line = [&](const char* what, const char* unit, double value, const char* limit = "",
                          double maximum = 0) { report({"view", name, what, unit, value, "", 0, limit, maximum}); };
    viewer.until([&] { return viewer.window().statistics().presented > 0; });
    viewer.walk(quick ? 1 : 8);
    const std::vector<double> intervals = viewer.window().statistics().intervals;
    double sum = 0;
    for (const double one : intervals) sum += one;
    line("pictures a second, walking", "1/s", sum > 0 ? static_cast<double>(intervals.size()) / sum : 0, "budget", 30);
    line("from picture to picture, half", "ms", 1e3 * valueAtQuantile(intervals, .5), "budget", 1e3 / 30);
    line("from picture to picture, 95 %", "ms", 1e3 * valueAtQuantile(intervals, .95), "budget", 1e3 / 30);
    line("width of the picture, half", "pixels", valueAtQuantile(viewer.widths(), .5), "whole", 1280);
    std::vector<double> keys, rests;
    for (int i = 0; i < (quick ? 2 : 40); ++i) keys.push_back(viewer.keyToPicture());
    for (int i = 0; i < (quick ? 1 : 10); ++i) rests.push_back(viewer.restToWhole());
    line("key to picture, half", "ms", 1e3 * valueAtQuantile(keys, .5));
    line("key to picture, 95 %", "ms", 1e3 * valueAtQuantile(keys, .95), "asked", 80);
    line("standing still to the whole picture, half", "ms", 1e3 * valueAtQuantile(rests, .5));
    line("standing still to the whole picture, most", "ms", 1e3 * valueAtQuantile(rests, 1), "asked", 400);
    return true;
}

/// The pictures of the hall by path while somebody stands still, with the seconds since.
struct Noisy {
    double seconds = 0, noise = 0, denoised = 0;
    int samples = 0;
};
Result<std::vector<Noisy>> standStill(double maximum, int width, int height) {
    Scene scene;
    Diagnostics diagnostics;
    if (!loadFile(scene, kSeenHall, diagnostics)) return fail("the scene cannot be read");
    scene.newFrame(0);
    SharedWorld world(scene);
    LivePictureOptions options;
    options.settings.integrator = Integrator::path;
    options.settings.width = width, options.settings.height = height, options.settings.samplesPerPixel = 4;
    options.resources = Resources::ofFile(kSeenHall);
    options.maxSamples = 1 << 14;
    std::vector<Noisy> all;
    LivePicture pictures(world, std::move(options));
    const Clock::time_point start = Clock::now();
    if (auto ok = pictures.show(); !ok) return std::unexpected(ok.error());
    constexpr double kPatience = 120;  // a busy machine needs longer for the first two
    while (passedSince(start) < maximum || (all.size() < 2 && passedSince(start) < kPatience)) {
        std::this_thread::sleep_for(5ms);
        const auto shown = pictures.take();
        if (shown && shown->noise > 0)
            all.push_back({passedSince(start), shown->noise, shown->denoised, shown->samples});
    }
    if (all.size() < 2) return fail("hardly any picture came");
    return all;
}
/// The power of time by which noise falls, from the fifth of the pictures on.
double powerOf(const std::vector<Noisy>& all) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (std::size_t i = std::min<std::size_t>(all.size() / 5, all.size() - 2); i < all.size(); ++i) {
        const double u = std::log(all[i].seconds), v = std::log(all[i].noise);
        n += 1, x += u, y += v, xx += u * u, xy += u * v;
    }
    return (n * xy - x * y) / (n * xx - x * x);
}
bool rested(const Report& report, bool quick) {
    const std::string name = quick ? "hall by path, 160x90" : "hall by path, 1280x720";
    const auto all = standStill(quick ? 3 : 160, quick ? 160 : 1280, quick ? 90 : 720);
    if (!all) {
        report({"view", name + ", " + all.error().text, "pictures", "0/1", 0, "", 0, "", 0});
        return false;
    }
    const auto line = [&](const char* what, const char* unit, double value, const char* limit = "",
                          double maximum = 0) { report({"view", name, what, unit, value, "", 0, limit, maximum}); };
    for (const double wanted : {.1, .05}) {
        const auto found = std::ranges::find_if(*all, [&](const Noisy& one) { return one.noise <= wanted; });
        if (found == all->end()) continue;  // it takes longer than this looked on
        const bool isTenth = wanted > .07;
        line(isTenth ? "standing still until noise is 10 %" : "standing still until noise is 5 %", "s", found->seconds,
             "asked", isTenth ? 30 : 150);
    }
    const auto at30 = std::ranges::find_if(*all, [](const Noisy& one) { return one.seconds >= 30; });
    const Noisy& then = at30 == all->end() ? all->back() : *at30;
    line("noise after 30 s", "%", 100 * then.noise, "asked", 10);
    line("samples a pixel after 30 s", "", then.samples);
    line("share denoised after 30 s", "%", 100 * then.denoised);
    line("noise at the end", "%", 100 * all->back().noise, "asked", 5);
    line("noise falls by time to the power of", "", powerOf(*all), "root", -.5);
    return true;
}

}  // namespace

bool view(const Report& report, bool quick) {
    // Nobody looks: it needs no display.
    if (!std::getenv("SDL_VIDEODRIVER")) ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
    if (!std::filesystem::exists(kSeenHall)) {
        report({"view", fmt::format("{} is not below this folder", kSeenHall), "window", "0/1", 0, "", 0, "", 0});
        return false;
    }
    const bool walks = walked(report, "hall, 1280x720", kSeenHall, quick);
    return rested(report, quick) && walks;
}

namespace {

/// Enlarges a picture as the window does, but for rounding.
Picture enlarged(const Picture& from, int width, int height) {
    Picture to(width, height);
    to.space = from.space;
    const double stepX = static_cast<double>(from.width) / width, stepY = static_cast<double>(from.height) / height;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double fx = std::clamp((x + .5) * stepX - .5, 0., from.width - 1.);
            const double fy = std::clamp((y + .5) * stepY - .5, 0., from.height - 1.);
            const int left = static_cast<int>(fx), top = static_cast<int>(fy);
            const int right = std::min(left + 1, from.width - 1), bottom = std::min(top + 1, from.height - 1);
            const auto u = static_cast<float>(fx - left), v = static_cast<float>(fy - top);
            to.at(x, y) = glm::mix(glm::mix(from.at(left, top), from.at(right, top), u),
                                   glm::mix(from.at(left, bottom), from.at(right, bottom), u), v);
        }
    return to;
}

/// Root mean square of the differences over the mean, as shown.
double errorBeside(const Picture& picture, const Picture& truth) {
    double squares = 0, sum = 0;
    for (std::size_t i = 0; i < truth.pixels.size(); ++i) {
        const Vec3f a = glm::clamp(Vec3f(picture.pixels[i]), 0.f, 1.f),
                    b = glm::clamp(Vec3f(truth.pixels[i]), 0.f, 1.f);
        squares += double{glm::dot(a - b, a - b)} / 3, sum += (double{b.r} + b.g + b.b) / 3;
    }
    const auto count = static_cast<double>(truth.pixels.size());
    return std::sqrt(squares / count) / std::max(1e-9, sum / count);
}

/// The hall, seen from its first viewpoint.
struct SeenHall {
    SeenHall(int w, int h) : width(w), height(h) {}
    const int width, height;
    Scene scene;

    /// `draw(options)`: a picture. Median of some, in CPU seconds; labels say what was asked for.
    template <class Draw>
    Result<ChartPoint> point(const Draw& draw, int divisor, int samples, const Picture& truth, std::string label) {
        ImageOptions image;
        image.keep = false;
        image.settings.width = width / divisor, image.settings.height = height / divisor;
        image.settings.samplesPerPixel = samples;
        std::vector<double> seconds;
        Picture created;
        for (int run = 0; run < (samples > 2 ? 1 : 3); ++run) {
            const double start = cpuSeconds();
            auto picture = draw(image);
            if (!picture) return std::unexpected(picture.error());
            created = std::move(*picture);
            seconds.push_back(cpuSeconds() - start);
        }
        return ChartPoint{1e3 * median(seconds), errorBeside(enlarged(created, width, height), truth),
                          std::move(label)};
    }

    /// Coarser pictures, and whole ones with more samples.
    template <class Draw>
    Result<std::vector<Series>> series(const std::string& who, const Draw& draw, const Picture& truth) {
        Series sizes{who + ": resolution, one sample", {}}, samples{who + ": samples, all pixels", {}};
        for (const int divisor : {8, 4, 3, 2, 1}) {
            auto one = point(draw, divisor, 1, truth, divisor == 1 ? "1" : fmt::format("1/{}", divisor));
            if (!one) return std::unexpected(one.error());
            sizes.points.push_back(*one);
        }
        samples.points.push_back({sizes.points.back().x, sizes.points.back().y, ""});
        for (const int count : {2, 4, 8, 16}) {
            auto one = point(draw, 1, count, truth, fmt::format("{}", count));
            if (!one) return std::unexpected(one.error());
            samples.points.push_back(*one);
        }
        return std::vector<Series>{std::move(sizes), std::move(samples)};
    }
};

}  // namespace

bool chartView(const ChartSink& sink, bool quick) {
    if (!std::filesystem::exists(kSeenHall)) return false;
    const int width = quick ? 192 : 1280, height = quick ? 108 : 720;
    SeenHall hall(width, height);
    Diagnostics diagnostics;
    if (!loadFile(hall.scene, kSeenHall, diagnostics)) return false;
    hall.scene.newFrame(0);
    SharedWorld world(hall.scene);
    const LightRenderer::Options options(Resources::ofFile(kSeenHall));
    LightRenderer light(world, options);
    ImageOptions exact;
    exact.settings.width = width, exact.settings.height = height, exact.settings.samplesPerPixel = quick ? 16 : 64;
    exact.settings.seed = 77;
    const auto truth = light.picture(exact);
    if (!truth) return false;
    Chart chart;
    chart.name = "view-error", chart.title = "A picture in the window: error against time";
    chart.note = fmt::format(
        "The demo's hall at {} x {}; labels are the share of the width, or samples a pixel. Error: root mean square "
        "over "
        "the mean, beside {} samples. Rays with shadows and mirrors; OGRE beside itself, without.",
        width, height, exact.settings.samplesPerPixel);
    chart.x = {"CPU time of the picture (ms)", true}, chart.y = {"error"};
    auto traced = hall.series("rays", [&](const ImageOptions& image) { return light.picture(image); }, *truth);
    if (!traced) return false;
    chart.series = std::move(*traced);
    // Where there is a display.
    OgreRenderer raster(world, options);
    exact.settings.samplesPerPixel = quick ? 16 : 32;
    if (const auto own = raster.nextPicture(exact)) {
        auto drawn = hall.series("OGRE", [&](const ImageOptions& image) { return raster.nextPicture(image); }, *own);
        if (!drawn) return false;
        std::ranges::move(*drawn, std::back_inserter(chart.series));
    }
    sink(chart);
    return true;
}

}  // namespace rtsg::bench
